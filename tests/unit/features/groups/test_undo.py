from __future__ import annotations

from contextlib import closing

import pytest

from app.db.store import Store
from app.errors import ConflictError
from app.features.groups.edit import Edit, SetBalls, SetLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.state import GroupState
from app.features.groups.submit import submit_edit
from app.features.groups.undo import redo_group_edit, undo_group_edit
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))


def edited(store: Store, state: GroupState, edit: Edit) -> GroupState:
    return submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")


class TestUndo:
    def test_steps_back_and_forth_across_views(self, store, state) -> None:
        edits = [
            make_set_ball_edit("7.png", BALL),
            SetLines("7_1.png", {"Middle line": None}),
            SetViewInclusion("7_1.png", False),
            # More steps, there and back, than are read of a history at first.
            *(SetViewInclusion("7_1.png", included) for included in (True, False, True)),
        ]
        states = [state]
        for edit in edits:
            states.append(edited(store, states[-1], edit))
        now = states[-1]
        for earlier in reversed(states[:-1]):
            assert now.can_undo
            now = undo_group_edit(store, state.id, if_match=now.etag, actor="ann")
            assert now.group == earlier.group
            assert now.solution == earlier.solution
        assert not now.can_undo
        for later in states[1:]:
            assert now.can_redo
            now = redo_group_edit(store, state.id, if_match=now.etag, actor="ann")
            assert now.group == later.group
        assert not now.can_redo

    def test_a_fresh_edit_clears_redo(self, store, state) -> None:
        after = edited(store, state, make_set_ball_edit("7.png", BALL))
        back = undo_group_edit(store, state.id, if_match=after.etag, actor="ann")
        assert back.can_redo
        fresh = edited(store, back, make_set_ball_edit("7.png", None))
        assert fresh.can_undo
        assert not fresh.can_redo
        with pytest.raises(ConflictError, match="nothing to redo"):
            redo_group_edit(store, state.id, if_match=fresh.etag, actor="ann")

    def test_survives_a_restart(self, store, state) -> None:
        after = edited(store, state, make_set_ball_edit("7.png", BALL))
        with closing(Store.open(store.settings)) as other:
            back = undo_group_edit(other, state.id, if_match=after.etag, actor="ben")
        assert back.group == state.group
        assert (back.can_undo, back.can_redo) == (False, True)

    def test_without_an_edit_there_is_nothing_to_undo(self, store, state) -> None:
        with pytest.raises(ConflictError, match="nothing to undo"):
            undo_group_edit(store, state.id, if_match=state.etag, actor="ann")

    def test_is_logged_as_an_edit_of_its_own(self, store, state) -> None:
        after = edited(store, state, make_set_ball_edit("7.png", BALL))
        undo_group_edit(store, state.id, if_match=after.etag, actor="ben")
        entries = read_history(store, state.id)
        assert [(item.kind, item.actor) for item in entries] == [
            ("import", "ann"),
            ("edit", "ann"),
            ("undo", "ben"),
        ]
        assert entries[2].body["of"] == entries[1].id
        assert entries[2].body["edit"] == entries[1].body["inverse"]

    def test_several_balls_come_back(self, store, state) -> None:
        two = edited(store, state, SetBalls("7.png", (BALL, BALL)))
        picked = edited(store, two, make_set_ball_edit("7.png", BALL))
        back = undo_group_edit(store, state.id, if_match=picked.etag, actor="ann")
        assert back.group.view("7.png").balls == (BALL, BALL)
