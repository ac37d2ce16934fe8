"""Undo and redo of one verdict: what was there before returns as it was."""

from __future__ import annotations

from datetime import datetime
from typing import Any

import pytest

from app.errors import ConflictError, StaleRevisionError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.state import GroupState
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.queue.service import list_groups
from app.features.verdicts.service import Verdict, set_verdict
from app.features.verdicts.undo import redo_verdict, undo_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
REJECTED = Verdict("rejected", "bad_calibration", None)


def judge(store, state, verdict, reason=None, note=None, actor="ben") -> GroupState:
    return set_verdict(store, state.id, verdict, reason, note, if_match=state.etag, actor=actor)


def move_ball(store, state, actor="ben") -> GroupState:
    edit = make_set_ball_edit("7.png", BALL)
    return submit_edit(store, state.id, edit, if_match=state.etag, actor=actor)


def undo(store, state, given, actor="ben") -> GroupState:
    when = datetime.fromisoformat(given.verdict.at)
    return undo_verdict(store, state.id, when, if_match=state.etag, actor=actor)


def redo(store, state, given, verdict=REJECTED, actor="ben") -> GroupState:
    when = datetime.fromisoformat(given.verdict.at)
    return redo_verdict(store, state.id, when, verdict, if_match=state.etag, actor=actor)


@pytest.fixture
def stale(store, state) -> GroupState:
    """A group that was edited after ann had accepted it."""
    return move_ball(store, judge(store, state, "accepted", note="as it was", actor="ann"))


class TestUndoVerdict:
    def test_the_verdict_of_before_returns_with_its_person_time_and_staleness(
        self, store, stale
    ) -> None:
        mistaken = judge(store, stale, "rejected", "bad_calibration")
        after = undo(store, mistaken, mistaken)
        assert after.verdict == stale.verdict
        assert (after.verdict.actor, after.verdict.stale) == ("ann", True)
        assert [(item.actor, item.state) for item in after.verdicts] == [
            ("ann", "accepted"),
            ("ben", "unreviewed"),
        ]
        assert load_group_state(store, stale.id) == after
        (row,) = list_groups(store, stale.dataset_id, "status:accepted").items
        assert (row.reviewer, row.stale) == ("ann", True)

    def test_the_log_makes_the_same_state_again(self, store, stale) -> None:
        mistaken = judge(store, stale, "rejected", "bad_calibration")
        undo(store, mistaken, mistaken)
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_first_verdict_leaves_the_group_unreviewed(self, store, state) -> None:
        given = judge(store, state, "deferred")
        after = undo(store, given, given)
        assert (after.verdict.state, after.verdict.actor) == ("unreviewed", "ben")

    def test_several_are_undone_one_after_the_other(self, store, stale) -> None:
        first = judge(store, stale, "deferred")
        second = judge(store, first, "rejected", "bad_calibration")
        once = undo(store, second, second)
        assert once.verdict == first.verdict
        assert undo(store, once, first).verdict == stale.verdict

    def test_one_that_a_colleague_repeated_stays_theirs(self, store, state) -> None:
        mine = judge(store, state, "rejected", "bad_calibration")
        theirs = judge(store, mine, "rejected", "bad_calibration", actor="ann")
        with pytest.raises(ConflictError, match="is not the one to undo, so it stays"):
            undo(store, theirs, mine)
        assert load_group_state(store, state.id).verdict == theirs.verdict

    def test_nobody_undoes_the_verdict_of_a_colleague(self, store, state) -> None:
        theirs = judge(store, state, "deferred", actor="ann")
        with pytest.raises(ConflictError, match="another person gave this verdict"):
            undo(store, theirs, theirs)

    def test_a_group_that_was_edited_meanwhile_is_looked_at_first(self, store, state) -> None:
        given = judge(store, state, "deferred")
        move_ball(store, given, actor="ann")
        with pytest.raises(StaleRevisionError):
            undo(store, given, given)


class TestRedoVerdict:
    def test_gives_the_verdict_again_and_it_can_be_undone_again(self, store, stale) -> None:
        given = judge(store, stale, "rejected", "bad_calibration")
        again = redo(store, undo(store, given, given), given)
        assert (again.verdict.state, again.verdict.actor) == ("rejected", "ben")
        assert undo(store, again, again).verdict == stale.verdict

    def test_a_group_that_was_edited_since_keeps_what_it_has(self, store, state) -> None:
        given = judge(store, state, "rejected", "bad_calibration")
        edited = move_ball(store, undo(store, given, given))
        with pytest.raises(ConflictError, match="was edited since that verdict"):
            redo(store, edited, given)
        back = undo_group_edit(store, state.id, if_match=edited.etag, actor="ben")
        assert redo(store, back, given).verdict.state == "rejected"

    def test_a_group_that_a_colleague_has_judged_since_keeps_that(self, store, state) -> None:
        given = judge(store, state, "rejected", "bad_calibration")
        theirs = judge(store, undo(store, given, given), "deferred", actor="ann")
        with pytest.raises(ConflictError, match="somebody else has judged this group since"):
            redo(store, theirs, given)

    def test_what_was_never_given_is_not_given_again(self, store, state) -> None:
        theirs = judge(store, state, "deferred", actor="ann")
        with pytest.raises(ConflictError, match="no verdict of yours"):
            redo(store, theirs, theirs)


class TestPutVerdict:
    """The same over HTTP, where the time is the one that the group's document tells."""

    def put(self, api, body: dict[str, Any]) -> Any:
        headers = {"If-Match": api.get("/api/v1/groups/1").json()["etag"]}
        return api.put("/api/v1/groups/1/verdict", json=body, headers=headers)

    def test_a_verdict_is_undone_and_redone(self, api) -> None:
        given = {"state": "rejected", "reason": "bad_calibration"}
        at = self.put(api, given).json()["verdict"]["at"]
        undone = self.put(api, {"state": "unreviewed", "undo_of": at})
        assert (undone.status_code, undone.json()["verdict"]["state"]) == (200, "unreviewed")
        again = self.put(api, {"state": "unreviewed", "undo_of": at})
        assert (again.status_code, "so it stays" in again.text) == (409, True)
        redone = self.put(api, {**given, "redo_of": at})
        assert (redone.status_code, redone.json()["verdict"]["state"]) == (200, "rejected")

    def test_undo_gives_no_verdict_besides(self, api) -> None:
        at = self.put(api, {"state": "deferred"}).json()["verdict"]["at"]
        assert self.put(api, {"state": "accepted", "undo_of": at}).status_code == 422
