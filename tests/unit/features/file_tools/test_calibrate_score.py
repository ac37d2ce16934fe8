from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from threading import Event

from app.workers.executors import AHEAD, run_tasks
from tests.waiting import SECONDS


class TestFanOut:
    def test_without_an_executor_results_come_in_order(self) -> None:
        assert list(run_tasks(abs, [-3, -1, -2], None)) == [3, 1, 2]

    def test_an_executor_does_all_of_them(self) -> None:
        with ThreadPoolExecutor(2) as executor:
            assert sorted(run_tasks(abs, range(-50, 0), executor)) == list(range(1, 51))

    def test_tasks_are_made_as_workers_become_free(self) -> None:
        made: list[int] = []

        def tasks():
            for number in range(100):
                made.append(number)
                yield number

        with ThreadPoolExecutor(1) as executor:
            results = run_tasks(abs, tasks(), executor)
            next(results)
            assert len(made) <= AHEAD + 1
            results.close()

    def test_once_told_to_stop_what_is_done_is_given_and_nothing_is_waited_for(self) -> None:
        held, stopped = Event(), Event()

        def work(number: int) -> int:
            if number:
                assert held.wait(SECONDS)
            return number

        with ThreadPoolExecutor(3) as executor:
            results = run_tasks(work, range(5), executor, stopped.is_set)
            found = [next(results)]
            stopped.set()
            found += list(results)
            held.set()
        assert found == [0]

    def test_without_an_executor_it_stops_before_the_next_task(self) -> None:
        stops = iter([False, False, True])
        assert list(run_tasks(abs, [-1, -2, -3], None, lambda: next(stops))) == [1, 2]
