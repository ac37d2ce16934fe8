"""A finding that a person has checked: no longer open, undone, and open again once it says something else."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from app.db.store import Store
from app.errors import InputError, StaleRevisionError
from app.features.findings.queries import GroupDismissals, split_open_and_dismissed_kinds
from app.features.findings.service import (
    FindingReference,
    count_groups,
    iterate_findings_as_json,
    read_findings,
    set_dismissal,
)
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state, submit_edit
from app.features.queue.refresh_queries import find_outdated_rows
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.membership import make_version_manifest
from app.features.versions.verify import verify_version
from app.soccer.annotation import BallAnnotation
from app.soccer.finding import Dismissal, Finding
from app.soccer.frames import Box

HERE = Finding("ball_size", "The ball is 1.9 times as large.", view="7.png", number=1.9)
SAID = Dismissal("ball_size", "7.png", None, None, 1.9, HERE.sentence, "ann", "2026-01-01")


class TestCovers:
    @pytest.mark.parametrize(
        ("change", "covered"),
        [
            ({}, True),
            ({"sentence": "The ball is 1.95 times as large.", "number": 1.95}, True),
            ({"number": 2.1}, False),
            ({"number": None}, False),
            ({"view": "7_1.png"}, False),
            ({"marking": "Middle line"}, False),
            ({"kind": "bad_point"}, False),
            ({"suggested": "Side line top"}, False),
        ],
    )
    def test_as_long_as_it_says_the_same(self, change: dict[str, Any], covered: bool) -> None:
        assert SAID.covers(replace(HERE, **change)) is covered

    def test_without_a_number_the_sentence_counts(self) -> None:
        finding = Finding("several_balls", "Two balls in A.", view="7.png")
        said = replace(SAID, kind="several_balls", number=None, sentence=finding.sentence)
        assert said.covers(finding)
        assert not said.covers(replace(finding, sentence="Three balls in A."))


class TestDismissedKinds:
    def test_one_of_two_findings_of_a_kind_leaves_the_other_open(self) -> None:
        findings = (HERE, replace(HERE, view="7_1.png"), Finding("no_paint", "None."))
        kinds = split_open_and_dismissed_kinds(findings, GroupDismissals(1, (SAID,)))
        assert kinds == (["ball_size", "no_paint"], ["ball_size"])


@pytest.fixture
def found(store: Store, fill, make_group) -> GroupState:
    """A group whose balls do not fit, so that something is found in it."""
    state = load_group_state(store, fill(make_group(9, shift=80.0))[0])
    assert state.solution is not None
    assert state.solution.findings
    return state


def first(state: GroupState) -> Finding:
    assert state.solution is not None
    return state.solution.findings[0]


def name_of(finding: Finding) -> FindingReference:
    names = ("kind", "view", "marking", "suggested", "number")
    return FindingReference(*(getattr(finding, name) for name in names))


def dismiss(
    store: Store, state: GroupState, finding: Finding, *, dismissed: bool = True, **more: Any
) -> GroupState:
    sent = {"if_match": state.etag, "actor": "ann", **more}
    return set_dismissal(store, state.id, name_of(finding), dismissed=dismissed, **sent)


def all_of(store: Store, state: GroupState) -> GroupState:
    """The group with every finding dismissed."""
    assert state.solution is not None
    for finding in state.solution.findings:
        state = dismiss(store, state, finding)
    return state


class TestSetDismissal:
    def test_it_is_kept_with_who_and_when_and_changes_nothing_else(self, store, found) -> None:
        after = dismiss(store, found, first(found), note="checked on the replay")
        again = load_group_state(store, found.id)
        for state in (after, again):
            said = state.dismissed[0]
            assert said is not None
            assert (said.actor, said.note) == ("ann", "checked on the replay")
            assert [one is None for one in state.dismissed[1:]] == [True] * len(state.dismissed[1:])
        assert (again.etag, again.revision) == (after.etag, found.revision)
        assert again.etag != found.etag
        assert again.solution == found.solution
        assert [entry.kind for entry in read_history(store, found.id)] == ["import", "dismissal"]

    def test_it_is_taken_back(self, store, found) -> None:
        after = dismiss(store, dismiss(store, found, first(found)), first(found), dismissed=False)
        assert set(after.dismissed) == {None}
        assert after.etag != found.etag
        (row,) = list_groups(store, found.dataset_id, "finding:any").items
        assert (row.findings != (), row.dismissed) == (True, ())

    def test_the_queue_knows_what_is_open_and_what_is_not(self, store, found) -> None:
        kinds = {finding.kind for finding in found.solution.findings}
        after = all_of(store, found)
        (row,) = list_groups(store, found.dataset_id, "finding:none dismissed:any").items
        assert (row.findings, set(row.dismissed)) == ((), kinds)
        assert list_groups(store, found.dataset_id, "finding:any").items == []
        for kind in kinds:
            assert list_groups(store, found.dataset_id, f"dismissed:{kind}").total == 1
        # A verdict, an own solution and the log rebuilt leave the row as it is.
        set_verdict(store, found.id, "deferred", if_match=after.etag, actor="ann")
        assert rebuild_tables(store) == []
        assert list_groups(store, found.dataset_id, "finding:none dismissed:any").total == 1
        with store.read() as session:
            assert find_outdated_rows(session)[1] == []

    def test_an_edit_that_changes_what_it_says_opens_it_again(self, store, found) -> None:
        after = all_of(store, found)
        ball = found.group.views[0].ball
        assert ball is not None
        moved = Box(ball.center.x + 200.0, ball.center.y - 90.0, 14.0, 14.0)
        edit = make_set_ball_edit(found.group.views[0].key, BallAnnotation(box=moved))
        state = submit_edit(store, found.id, edit, if_match=after.etag, actor="ben")
        assert None in state.dismissed
        (row,) = list_groups(store, found.dataset_id, "finding:any").items
        assert row.findings
        with store.read() as session:
            assert find_outdated_rows(session)[1] == []

    def test_who_saw_another_state_is_refused(self, store, found) -> None:
        dismiss(store, found, first(found))
        with pytest.raises(StaleRevisionError):
            dismiss(store, found, first(found), dismissed=False)
        with pytest.raises(StaleRevisionError):
            set_verdict(store, found.id, "deferred", if_match=found.etag, actor="ben")

    def test_a_finding_that_is_not_there_is_refused(self, store, found) -> None:
        with pytest.raises(InputError, match="no finding") as caught:
            dismiss(store, found, replace(first(found), view="99.png"))
        assert caught.value.pointer == "/kind"


class TestFindings:
    def test_the_list_has_them_with_who_checked_them(self, store, found) -> None:
        dismiss(store, found, first(found), note="fine")
        values = list(iterate_findings_as_json(store, "demo"))
        said = [value["dismissed"] for value in values]
        assert said[0] is not None
        assert (said[0]["by"], said[0]["note"]) == ("ann", "fine")
        assert said[1:] == [None] * len(said[1:])
        number = found.dataset_id
        (closed,) = read_findings(store, number, limit=9, dismissed=True)
        assert len(closed.findings) == 1
        all_of(store, load_group_state(store, found.id))
        assert read_findings(store, number, limit=9, dismissed=False) == []
        counts = [
            count_groups(store, number, None, dismissed=which) for which in (None, True, False)
        ]
        assert counts == [1, 1, 0]

    def test_as_many_are_counted_as_can_be_read_after_an_upgrade_of_the_solver(
        self, store, found, upgrade_solver
    ) -> None:
        upgrade_solver()
        number = found.dataset_id
        assert count_groups(store, number, None) == 0
        assert read_findings(store, number, limit=10) == []
        (row,) = list_groups(store, number, "finding:any").items
        assert row.findings
        solve_dataset(store, number)
        assert count_groups(store, number, None) == len(read_findings(store, number, limit=10)) == 1


class TestVersions:
    def test_a_version_keeps_them_and_one_without_any_has_the_hash_it_had(
        self, store, fill, make_group
    ) -> None:
        (number,) = fill(make_group(9, shift=80.0))
        state = load_group_state(store, number)
        set_verdict(store, number, "accepted", None, "seen", if_match=state.etag, actor="ann")
        plain = freeze_dataset(store, "demo", FreezeRequest("v1"), actor="ann")
        state = dismiss(store, load_group_state(store, number), first(state), note="fine")
        checked = freeze_dataset(store, "demo", FreezeRequest("v2"), actor="ann")
        state = dismiss(store, state, first(state), dismissed=False)
        again = freeze_dataset(store, "demo", FreezeRequest("v3"), actor="ann")
        assert again.hash == plain.hash != checked.hash
        assert verify_version(store, checked.id).ok
        (told,) = make_version_manifest(store, checked.id)["frozen"]["dismissed"]
        assert (told["kind"], told["note"]) == (first(state).kind, "fine")
        assert "ann" not in str(told)
