from __future__ import annotations

from app.progress import make_partial_progress, report_each_item


class TestTelling:
    def test_a_part_counts_on_from_what_was_done_before_it(self) -> None:
        told: list[tuple] = []
        part = make_partial_progress(
            lambda *place: told.append(place), "Solving.", start=10, total=20
        )
        part(3, 5, "a sentence of its own")
        assert told == [(13, 20, "Solving.")]

    def test_without_a_total_the_part_says_how_much_there_is(self) -> None:
        told: list[tuple] = []
        make_partial_progress(lambda *place: told.append(place), "Solving.")(3, 5)
        assert told == [(3, 5, "Solving.")]


class TestTold:
    def test_each_item_is_told_as_it_comes(self) -> None:
        places: list[tuple] = []
        items = report_each_item("ab", 2, lambda *place: places.append(place), "Reading.")
        assert (next(items), places) == ("a", [(0, 2, "Reading.")])
        assert list(items) == ["b"]
        assert places[1:] == [(1, 2, "Reading."), (2, 2, "Reading.")]

    def test_nobody_needs_to_hear_it(self) -> None:
        assert list(report_each_item("ab", 2, None, "Reading.")) == ["a", "b"]
