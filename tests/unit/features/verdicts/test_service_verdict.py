from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from app.db.store import Store
from app.errors import InputError, StaleRevisionError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.verdicts import service as module
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import REASONS
from app.soccer.policy import PAPER

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))


def judge(store, state, verdict, reason=None, note=None, actor="ann", **more):
    return set_verdict(
        store, state.id, verdict, reason, note, if_match=state.etag, actor=actor, **more
    )


@pytest.fixture
def failing(store, fill, make_group):
    """A group that fails the gate on reprojection."""
    return load_group_state(store, fill(make_group(9, shift=80.0))[0])


class TestSetVerdict:
    def test_accepting_is_kept_and_shown(self, store, state) -> None:
        after = judge(store, state, "accepted")
        verdict = after.verdict
        assert (verdict.state, verdict.actor, verdict.stale) == ("accepted", "ann", False)
        assert (verdict.fixed, verdict.override) == (False, None)
        assert after.etag != state.etag
        assert after.revision == state.revision
        (row,) = list_groups(store, state.dataset_id, "status:accepted").items
        assert row.reviewer == "ann"

    @pytest.mark.parametrize("reason", [reason for reason in REASONS if reason != "other"])
    def test_a_rejection_has_a_reason(self, store, state, reason) -> None:
        assert judge(store, state, "rejected", reason).verdict.reason == reason

    @pytest.mark.parametrize(
        ("arguments", "pointer"),
        [
            (("rejected",), "/reason"),
            (("rejected", "ugly"), "/reason"),
            (("rejected", "other"), "/note"),
            (("rejected", "other", "  "), "/note"),
            (("accepted", "other"), "/reason"),
            (("perhaps",), "/state"),
            (("deferred", None, "x" * 2001), "/note"),
        ],
    )
    def test_an_incomplete_verdict_is_refused(self, store, state, arguments, pointer) -> None:
        with pytest.raises(InputError) as caught:
            judge(store, state, *arguments)
        assert caught.value.pointer == pointer

    def test_accepting_against_a_gate_needs_a_note_and_is_stamped(self, store, failing) -> None:
        assert not failing.solution.passes
        with pytest.raises(InputError, match="needs a note"):
            judge(store, failing, "accepted")
        after = judge(store, failing, "accepted", note="seen on video")
        assert after.verdict.override == "reprojection"
        assert after.verdict.note == "seen on video"

    def test_accepting_a_ball_that_cannot_be_used_needs_a_note(
        self, store, fill, make_group
    ) -> None:
        below = load_group_state(store, fill(make_group(9, ball=(5.0, 2.0, 10.2)))[0])
        assert below.solution.passes
        with pytest.raises(
            InputError, match=r"cannot be used .*10\.20 m below the grass"
        ) as caught:
            judge(store, below, "accepted")
        assert caught.value.pointer == "/note"
        after = judge(store, below, "accepted", note="a hole")
        assert (after.verdict.override, after.verdict.note) == (None, "a hole")

    def test_a_group_that_is_not_solved_is_solved_first(self, store, fill, make_group) -> None:
        state = load_group_state(store, fill(make_group(9, shift=80.0), solved=False)[0])
        with pytest.raises(InputError, match="needs a note"):
            judge(store, state, "accepted")

    def test_becomes_stale_by_an_edit_and_fresh_by_its_undo(self, store, state) -> None:
        accepted = judge(store, state, "accepted")
        edited = submit_edit(
            store, state.id, make_set_ball_edit("7.png", BALL), if_match=accepted.etag, actor="ben"
        )
        assert (edited.verdict.state, edited.verdict.stale) == ("accepted", True)
        back = undo_group_edit(store, state.id, if_match=edited.etag, actor="ben")
        assert not back.verdict.stale

    def test_every_persons_verdict_is_kept_and_the_newest_counts(self, store, state) -> None:
        first = judge(store, state, "accepted", actor="ann")
        second = judge(store, first, "deferred", actor="ben")
        third = judge(store, second, "rejected", "bad_calibration", actor="ann")
        assert third.verdict.state == "rejected"
        assert [(item.actor, item.state) for item in third.verdicts] == [
            ("ann", "rejected"),
            ("ben", "deferred"),
        ]
        assert [item.kind for item in read_history(store, state.id)] == ["import", *["verdict"] * 3]

    def test_can_be_taken_back(self, store, state) -> None:
        after = judge(store, judge(store, state, "accepted"), "unreviewed")
        assert after.verdict.state == "unreviewed"
        (row,) = list_groups(store, state.dataset_id, "status:unreviewed").items
        assert row.reviewer is None

    def test_a_verdict_on_a_group_that_somebody_changed_is_refused(self, store, state) -> None:
        submit_edit(
            store, state.id, make_set_ball_edit("7.png", BALL), if_match=state.etag, actor="ben"
        )
        with pytest.raises(StaleRevisionError):
            judge(store, state, "accepted", note="note")

    def test_a_verdict_after_somebody_elses_is_refused(self, store, state) -> None:
        judge(store, state, "accepted")
        with pytest.raises(StaleRevisionError):
            judge(store, state, "deferred", actor="ben")

    def test_is_one_read_and_one_durable_commit(
        self, store: Store, state: GroupState, counted: Callable[..., Any]
    ) -> None:
        with counted(store) as cost:
            judge(store, state, "accepted")
        assert (cost.reads, cost.writes, cost.commits) == (1, 1, 1)
        assert cost.statements <= 14

    def test_answers_with_the_group_as_a_reader_gets_it(self, store, state) -> None:
        after = judge(store, state, "rejected", "sides_confused")
        assert load_group_state(store, state.id) == after

    def test_another_policy_meanwhile_judges_the_verdict(self, store, state, monkeypatch) -> None:
        read = module.ensure_group_solution

        def slow(*arguments, **options):
            found = read(*arguments, **options)
            monkeypatch.setattr(module, "ensure_group_solution", read)
            change_policy(
                store,
                state.dataset_id,
                replace(PAPER, min_baseline_m=500.0),
                if_match=None,
                actor="ann",
            )
            return found

        monkeypatch.setattr(module, "ensure_group_solution", slow)
        with pytest.raises(InputError, match="fails a gate"):
            judge(store, state, "accepted")
        assert len(read_history(store, state.id)) == 1
