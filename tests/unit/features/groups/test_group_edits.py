from __future__ import annotations

import pytest

from app.features.datasets.service import dataset_id
from app.features.groups import group_edits
from app.features.groups.edit import SetPitch
from app.features.groups.group_edits import edit_groups
from app.features.groups.history import read_history
from app.features.groups.submit import load_group_state
from app.features.groups.undo import undo_group_edit
from app.features.solutions.service import list_stale_groups

WIDE, USUAL = SetPitch(105.0, 70.0), SetPitch(105.0, 68.0)


@pytest.fixture
def ids(store, fill, make_group) -> list[int]:
    return fill(*(make_group(seed) for seed in (7, 8, 9)))


def give(store, ids, edits, **options) -> int:
    with store.write() as session:
        where = (session, dataset_id(store, "demo"), "edit", ids)
        return edit_groups(*where, lambda some: edits(some), actor="ann", **options)


class TestGiveEdits:
    @pytest.mark.parametrize("batch", [1, 2, 100])
    def test_each_group_has_an_entry_that_can_be_taken_back(
        self, store, ids, batch, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(group_edits, "_BATCH", batch)
        found = give(store, ids, lambda some: dict.fromkeys(some, WIDE), body={"why": "measured"})
        assert found == 3
        assert sorted(list_stale_groups(store, "demo")) == sorted(ids)
        for number in ids:
            state = load_group_state(store, number)
            assert state.group.pitch.width == 70.0
            entry = read_history(store, number)[-1]
            assert (entry.actor, entry.body["why"]) == ("ann", "measured")
            back = undo_group_edit(store, number, if_match=state.etag, actor="bob")
            assert back.group.pitch.width == 68.0

    def test_what_changes_nothing_leaves_no_trace_but_where_more_is_said(self, store, ids) -> None:
        before = {
            number: (load_group_state(store, number).etag, len(read_history(store, number)))
            for number in ids
        }
        assert give(store, ids, lambda some: dict.fromkeys(some, USUAL), always_logged=ids[1]) == 1
        for number in ids:
            etag, entries = before[number]
            assert len(read_history(store, number)) == entries + (number == ids[1])
            assert (load_group_state(store, number).etag == etag) == (number != ids[1])

    def test_who_has_no_edit_is_left_alone(self, store, ids) -> None:
        assert give(store, ids, lambda some: {ids[2]: WIDE} if ids[2] in some else {}) == 1
        assert [load_group_state(store, number).group.pitch.width for number in ids] == [
            68.0,
            68.0,
            70.0,
        ]
