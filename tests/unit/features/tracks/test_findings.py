"""Balls that contradict a track: findings of their groups, as long as the track says so."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import delete, select

from app.db.session import Session
from app.db.store import Store
from app.features.datasets.service import dataset_id
from app.features.datasets.tables import ImportFindingModel
from app.features.findings.service import FindingReference, iterate_findings_as_json, set_dismissal
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.suggested_edits import list_edits_of_finding
from app.features.groups.undo import undo_group_edit
from app.features.queue.refresh_queries import find_outdated_rows
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.tracks import findings, making
from app.features.tracks.findings import refresh_track_notices, save_notices
from app.features.tracks.service import (
    TrackReview,
    list_tracks,
    make_tracks,
    read_track_detail,
    review_track,
)
from app.features.tracks.tables import TrackModel
from app.soccer.finding import TRACK_DISAGREES, Finding
from app.soccer.frames import ImagePoint
from app.tracking.ball_track import EventCorrection
from tests.flights import FIRST, places
from tests.rigs import TRUTH
from tests.unit.features.tracks.test_service import move

AT = 20
"""The frame of the stretch whose first view shows another ball."""


def make(store: Store) -> None:
    make_tracks(store, "demo", None, "ann", lambda *_: None)


def judge(store: Store, verdict: Any) -> None:
    (track,) = list_tracks(store, "demo")
    review_track(store, track.id, TrackReview(verdict), track.etag, actor="ben")


def told(store: Store) -> list[tuple[str, str | None]]:
    """Group and view of each finding of the track."""
    values = iterate_findings_as_json(store, "demo")
    return [(item["group"], item["view"]) for item in values if item["kind"] == TRACK_DISAGREES]


def of_group(store: Store, group: int) -> Finding:
    solution = load_group_state(store, group).solution
    assert solution is not None
    (found,) = [item for item in solution.findings if item.kind == TRACK_DISAGREES]
    return found


@pytest.fixture
def beside(store: Store, flight: list[int]) -> int:
    """A group whose first view shows a ball 60 px beside the track."""
    move(store, flight[AT], 60.0)
    make(store)
    return flight[AT]


def rows(store: Store) -> list[tuple[int, int | None]]:
    """Ids of what is stored, and their groups."""
    model = ImportFindingModel
    with store.read() as session:
        found = session.execute(
            select(model.id, model.group_id).where(model.kind == TRACK_DISAGREES)
        )
        return [(row.id, row.group_id) for row in found]


class TestFindings:
    def test_name_the_ball_and_where_the_track_is_seen(self, store: Store, beside: int) -> None:
        view = load_group_state(store, beside).group.views[0].key
        assert told(store) == [(str(FIRST + AT), view)]
        found = of_group(store, beside)
        assert found.sentence.startswith("It lies ")
        assert found.number == pytest.approx(60, abs=6)
        (seen,) = TRUTH[view].project(places(AT + 1)[-1:])
        assert found.place == pytest.approx(seen.tolist(), abs=4)

    def test_stand_in_the_queue(self, store: Store, beside: int) -> None:
        listed = list_groups(store, dataset_id(store, "demo"), f"finding:{TRACK_DISAGREES}")
        assert [row.id for row in listed.items] == [beside]
        with store.read() as session:
            assert find_outdated_rows(session)[1] == []

    def test_offer_to_move_the_ball_or_to_leave_the_view_out(
        self, store: Store, beside: int
    ) -> None:
        state, found = load_group_state(store, beside), of_group(store, beside)
        moved, left_out = list_edits_of_finding(state.group, found)
        assert (moved.label, left_out.label) == ("Move the ball there", "Leave it out")
        center = moved.edit.apply(state.group).views[0].ball.center
        assert (center.x, center.y) == pytest.approx(found.place)
        assert not left_out.edit.apply(state.group).views[0].included

    def test_go_with_the_edit_that_mends_and_come_back_with_its_undo(
        self, store: Store, beside: int
    ) -> None:
        state = load_group_state(store, beside)
        moved = list_edits_of_finding(state.group, of_group(store, beside))[0]
        after = submit_edit(store, beside, moved.edit, if_match=state.etag, actor="ann")
        assert told(store) == []
        with store.read() as session:
            assert find_outdated_rows(session)[1] == []
        undo_group_edit(store, beside, if_match=after.etag, actor="ann")
        assert len(told(store)) == 1
        with store.read() as session:
            assert find_outdated_rows(session)[1] == []

    def test_are_gone_when_the_track_is_made_without_a_reason_for_them(
        self, store: Store, beside: int
    ) -> None:
        state = load_group_state(store, beside)
        moved = list_edits_of_finding(state.group, of_group(store, beside))[0]
        submit_edit(store, beside, moved.edit, if_match=state.etag, actor="ann")
        solve_dataset(store, "demo")
        make(store)
        assert told(store) == []

    def test_follow_the_verdict_on_the_track(self, store: Store, beside: int) -> None:
        before = of_group(store, beside)
        judge(store, "accepted")
        assert of_group(store, beside) == before
        judge(store, "rejected")
        assert told(store) == []
        judge(store, "none")
        assert of_group(store, beside) == before

    def test_pass_over_a_ball_that_was_moved_since(self, store: Store, beside: int) -> None:
        judge(store, "rejected")
        state = load_group_state(store, beside)
        ball = state.group.views[0].ball
        away = make_set_ball_edit(state.group.views[0].key, type(ball)(point=ImagePoint(5.0, 5.0)))
        submit_edit(store, beside, away, if_match=state.etag, actor="ann")
        judge(store, "none")
        assert told(store) == []

    def test_are_checked_off_and_stay_so(self, store: Store, beside: int) -> None:
        found, state = of_group(store, beside), load_group_state(store, beside)
        name = FindingReference(found.kind, found.view)
        set_dismissal(store, beside, name, dismissed=True, if_match=state.etag, actor="ann")
        make(store)
        rows = list_groups(store, dataset_id(store, "demo"), f"dismissed:{TRACK_DISAGREES}")
        assert [row.id for row in rows.items] == [beside]

    def test_that_are_there_are_not_written_again(self, store: Store, beside: int) -> None:
        before = rows(store)
        assert [group for _, group in before] == [beside]
        make(store)
        assert rows(store) == before

    def test_say_where_the_balls_of_a_track_are(self, store: Store, beside: int) -> None:
        (track,) = list_tracks(store, "demo")
        detail = read_track_detail(store, track.id)
        assert len(detail.ball.contradicted) == track.summary.contradicted >= 1


def is_write(store: Store, session: Session) -> bool:
    """Whether nobody else can write beside a session."""
    return session.engine is store._writer


class TestMeanwhile:
    """What changes between the read and the write."""

    def test_verdicts_that_never_cease_end_in_what_holds_at_last(
        self, store: Store, beside: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        verdicts, read = itertools.cycle(["accepted", "rejected"]), findings._read_notices
        turns: list[str] = []

        def judged_meanwhile(*given: Any) -> Any:
            found = read(*given)
            if not is_write(store, given[0]):
                turns.append(next(verdicts))
                assert len(turns) <= findings.TRIES
                judge(store, turns[-1])
            return found

        monkeypatch.setattr(findings, "_read_notices", judged_meanwhile)
        refresh_track_notices(store, dataset_id(store, "demo"), ["rig"])
        assert turns == ["accepted", "rejected", "accepted"]
        assert [group for group, _ in told(store)] == [str(FIRST + AT)]

    def test_a_group_that_is_no_more_is_passed_over(self, store: Store, beside: int) -> None:
        with store.read() as session:
            found = findings._read_notices(session, dataset_id(store, "demo"), ["rig"])
        gone = replace(found.items[0], group_id=10_000)
        with store.write() as session:
            both = replace(found, items=[gone, *found.items])
            save_notices(session, dataset_id(store, "demo"), both)
        assert [group for _, group in rows(store)] == [beside]

    def test_corrections_that_never_cease_are_all_in_the_track(
        self, store: Store, beside: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        read, turns = making.apply_corrections, list[int]()

        def corrected_meanwhile(*given: Any) -> Any:
            if len(turns) < making.TRIES - 1:
                turns.append(FIRST + 30 + len(turns))
                (track,) = list_tracks(store, "demo")
                said = tuple(EventCorrection(frame, "kick", True) for frame in turns)
                review_track(
                    store, track.id, TrackReview(corrections=said), track.etag, actor="ben"
                )
            return read(*given)

        move(store, beside, 30.0)
        monkeypatch.setattr(making, "apply_corrections", corrected_meanwhile)
        make(store)
        (track,) = list_tracks(store, "demo")
        assert [item.frame for item in track.corrections] == turns == [FIRST + 30, FIRST + 31]

    def test_a_track_that_is_deleted_comes_back(
        self, store: Store, beside: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        digest = making.digest_inputs

        def deleted_meanwhile(*given: Any) -> Any:
            with store.write() as session:
                session.execute(delete(TrackModel))
            return digest(*given)

        monkeypatch.setattr(making, "digest_inputs", deleted_meanwhile)
        make(store)
        assert [track.key for track in list_tracks(store, "demo")] == ["rig"]
