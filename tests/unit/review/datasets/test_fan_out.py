from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

from app.review.datasets.fan_out import AHEAD, fan_out


class TestFanOut:
    def test_without_an_executor_results_come_in_order(self) -> None:
        assert list(fan_out(abs, [-3, -1, -2], None)) == [3, 1, 2]

    def test_an_executor_does_all_of_them(self) -> None:
        with ThreadPoolExecutor(2) as executor:
            assert sorted(fan_out(abs, range(-50, 0), executor)) == list(range(1, 51))

    def test_tasks_are_made_as_workers_become_free(self) -> None:
        made: list[int] = []

        def tasks():
            for number in range(100):
                made.append(number)
                yield number

        with ThreadPoolExecutor(1) as executor:
            results = fan_out(abs, tasks(), executor)
            next(results)
            assert len(made) <= AHEAD + 1
            results.close()
