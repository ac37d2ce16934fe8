"""Full solve: solutions, pitches, and the yield of many groups, in one run that can be stopped."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.store import Store
from app.features.pitches.service import list_matches_to_estimate
from app.features.solutions.service import list_stale_groups
from app.features.solve import jobs as full_solve
from app.features.solve.jobs import describe_pending_work, refresh_yield_table, solve_fully
from app.features.what_if import blocks as gathered


@pytest.fixture
def two(store: Store, fill, make_group) -> Store:
    """Two unsolved groups of two matches."""
    fill(*(replace(make_group(number), match=f"{number}") for number in (7, 8)), solved=False)
    return store


class Told:
    """A progress that keeps what it was told."""

    def __init__(self) -> None:
        self.calls: list[tuple[int, int | None, str]] = []

    def __call__(self, done: int, total: int | None = None, sentence: str = "", /) -> None:
        self.calls.append((done, total, sentence))


def test_groups_are_solved_and_pitches_estimated(two: Store) -> None:
    report = solve_fully(two, "demo", None, Told())
    assert (report.total, report.solved) == (2, 2)
    assert (list_stale_groups(two, "demo"), list_matches_to_estimate(two, "demo")) == ([], [])


def test_once_it_is_stopped_what_is_solved_stays_and_no_more_is_begun(two: Store) -> None:
    asked = iter([False])
    report = solve_fully(two, "demo", None, Told(), lambda: next(asked, True))
    assert report.solved == 2
    assert list_stale_groups(two, "demo") == []
    assert list_matches_to_estimate(two, "demo") == ["7", "8"]


def test_stopped_between_two_matches_it_keeps_the_first(two: Store) -> None:
    solve_fully(two, "demo", None, Told(), lambda: not list_stale_groups(two, "demo"))
    before = list_matches_to_estimate(two, "demo")
    solve_fully(two, "demo", None, Told(), lambda: len(list_matches_to_estimate(two, "demo")) < 2)
    assert (before, list_matches_to_estimate(two, "demo")) == (["7", "8"], ["8"])


def test_what_is_left_is_said_as_long_as_something_is(two: Store) -> None:
    assert describe_pending_work(two, "demo") == "2 are left to do"
    solve_fully(two, "demo", None, Told(), lambda: not list_stale_groups(two, "demo"))
    assert describe_pending_work(two, "demo") == "the pitch of 2 matches is left to estimate"
    solve_fully(two, "demo", None, Told())
    assert describe_pending_work(two, "demo") is None


@pytest.mark.parametrize(("at_once", "counted"), [(1, True), (2, False)])
def test_the_yield_of_many_groups_is_counted_at_once(
    two: Store, monkeypatch: pytest.MonkeyPatch, at_once: int, counted: bool
) -> None:
    monkeypatch.setattr(full_solve, "AT_ONCE", at_once)
    looked: list[int] = []
    read = gathered.read_tables
    monkeypatch.setattr(
        gathered,
        "read_tables",
        lambda session, rows: looked.extend(row.group_id for row in rows) or read(session, rows),
    )
    progress = Told()
    refresh_yield_table(two, "demo", solve_fully(two, "demo", None, progress), progress)
    sentences = [sentence for *_, sentence in progress.calls if sentence]
    assert sentences == (["Counting the passing groups of demo."] if counted else [])
    assert len(looked) == (2 if counted else 0)
