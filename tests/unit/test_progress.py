from __future__ import annotations

from app.progress import telling


class TestTelling:
    def test_a_part_counts_on_from_what_was_done_before_it(self) -> None:
        told: list[tuple] = []
        part = telling(lambda *place: told.append(place), "Solving.", start=10, total=20)
        part(3, 5, "a sentence of its own")
        assert told == [(13, 20, "Solving.")]

    def test_without_a_total_the_part_says_how_much_there_is(self) -> None:
        told: list[tuple] = []
        telling(lambda *place: told.append(place), "Solving.")(3, 5)
        assert told == [(3, 5, "Solving.")]
