"""Groups without any picture: found, marked, and not accepted without a word."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import get_dataset
from app.features.groups.submit import load_group_state
from app.features.queue.service import list_groups
from app.features.verdicts.bulk import NO_PICTURE, RefusedGroups, give_verdicts, plan_verdicts
from app.features.verdicts.service import set_verdict
from app.soccer.group import Group


def without(group: Group, *keys: str) -> Group:
    """The group without the pictures of some views; of all where none is named."""
    views = (
        replace(view, media=None) if not keys or view.key in keys else view for view in group.views
    )
    return replace(group, views=tuple(views))


@pytest.fixture
def ids(fill, make_group) -> list[int]:
    """All pictures, one of two, none."""
    return fill(make_group(7), without(make_group(8), "8.png"), without(make_group(9)))


def found(store: Store, query: str) -> list[int]:
    dataset = get_dataset(store, "demo").id
    return [row.id for row in list_groups(store, dataset, query=query, limit=9).items]


class TestQueue:
    def test_counts_pictures_and_finds_by_them(self, store: Store, ids: list[int]) -> None:
        dataset = get_dataset(store, "demo").id
        rows = list_groups(store, dataset, limit=9).items
        assert [(row.pictures, row.views) for row in rows] == [(2, 2), (1, 2), (0, 2)]
        assert found(store, "pictures:none") == [ids[2]]
        assert found(store, "pictures:any") == ids[:2]
        assert found(store, "pictures:all") == ids[:1]
        assert found(store, "-pictures:all") == ids[1:]

    def test_an_unknown_value_of_pictures_is_refused(self, store: Store, ids: list[int]) -> None:
        with pytest.raises(InputError):
            found(store, "pictures:some")


class TestSetVerdict:
    def test_a_bare_acceptance_is_refused(self, store: Store, ids: list[int]) -> None:
        state = load_group_state(store, ids[2])
        assert state.solution is not None and state.solution.passes
        with pytest.raises(InputError, match="no picture") as caught:
            set_verdict(store, ids[2], "accepted", if_match=state.etag, actor="ann")
        assert caught.value.pointer == "/note"
        assert load_group_state(store, ids[2]).verdict.state == "unreviewed"

    def test_with_a_note_it_is_accepted_and_overrides_no_gate(
        self, store: Store, ids: list[int]
    ) -> None:
        etag = load_group_state(store, ids[2]).etag
        set_verdict(store, ids[2], "accepted", note="seen on tape", if_match=etag, actor="ann")
        verdict = load_group_state(store, ids[2]).verdict
        assert (verdict.state, verdict.note, verdict.override) == ("accepted", "seen on tape", None)

    @pytest.mark.parametrize("state", ["deferred", "rejected"])
    def test_other_verdicts_need_none(self, store: Store, ids: list[int], state: str) -> None:
        reason = "duplicate_view" if state == "rejected" else None
        etag = load_group_state(store, ids[2]).etag
        set_verdict(store, ids[2], state, reason, if_match=etag, actor="ann")
        assert load_group_state(store, ids[2]).verdict.state == state

    def test_one_picture_is_enough(self, store: Store, ids: list[int]) -> None:
        etag = load_group_state(store, ids[1]).etag
        set_verdict(store, ids[1], "accepted", if_match=etag, actor="ann")


class TestBulk:
    def test_bulk_accept_leaves_groups_without_pictures_alone_and_counts_them(
        self, store: Store, ids: list[int]
    ) -> None:
        dataset = get_dataset(store, "demo").id
        plan = plan_verdicts(store, dataset, "", "accepted")
        assert (plan.would_change, plan.refused) == (2, (RefusedGroups(NO_PICTURE, 1),))
        done = give_verdicts(store, dataset, "", "accepted", actor="ann")
        assert (done.changed, done.refused) == (2, (RefusedGroups(NO_PICTURE, 1),))
        done = give_verdicts(store, dataset, "", "accepted", note="seen on tape", actor="ann")
        assert done.refused == ()
        assert load_group_state(store, ids[2]).verdict.state == "accepted"
