"""A batch that asks two people for an annotation of each group, from giving out to the decision."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.store import Store
from app.errors import ForbiddenError
from app.features.agreement.adjudicate import (
    adjudicate_case,
    adopt_into_group,
    list_open_cases,
    read_case,
    return_for_correction,
)
from app.features.agreement.reopen import undo_edit_or_decision
from app.features.agreement.service import compare_or_adopt_submission
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.progress import list_own_batches
from app.features.batches.service import Batch, NewBatch, change_batch, get_batch, make_batch
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.submit import load_group_state, submit_edit
from app.features.independent_annotations.service import get_annotation_of_copy
from app.features.integrity.checks import examine_database
from app.features.notifications.queries import select_notifications
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.people.visibility_queries import EVERYTHING
from app.features.verdicts.service import set_verdict

PEOPLE = ("ada", "bo")


@pytest.fixture
def batch(store, fill, make_group) -> Batch:
    ids = fill(make_group(1), make_group(2))
    for name in (*PEOPLE, "cy"):
        invite(store, name, Role.REVIEWER, actor="local")
    new = NewBatch("twice", annotators=PEOPLE, reviewers=("cy",), verdicts=2)
    return make_batch(store, load_group_state(store, ids[0]).dataset_id, new, actor="lead")


def annotate(store: Store, leases: LeaseService, batch: Batch, person: str, moved: float) -> int:
    """The copy that somebody gets next, its ball moved and the group accepted."""
    copy = leases.lease_next_group(batch.id, BatchMember(person)).group
    assert copy is not None
    state = load_group_state(store, copy)
    view = next(view for view in state.group.views if view.ball is not None)
    assert view.ball is not None and view.ball.box is not None
    ball = replace(view.ball, box=replace(view.ball.box, x=view.ball.box.x + moved))
    state = submit_edit(
        store, copy, make_set_ball_edit(view.key, ball), if_match=state.etag, actor=person
    )
    set_verdict(store, copy, "accepted", None, "seen", if_match=state.etag, actor=person)
    return copy


def left(store: Store, person: str) -> int:
    """How many groups somebody is told that they may still get."""
    (mine,) = list_own_batches(store, lambda _dataset: BatchMember(person))
    return mine.left


def test_what_agrees_is_over_and_the_rest_waits_for_the_third(store, batch) -> None:
    leases = LeaseService(store)
    assert left(store, "ada") == 2
    for moved in (1.0, 1.0):
        copy = annotate(store, leases, batch, "ada", moved)
        assert compare_or_adopt_submission(store, copy) is None
    assert leases.lease_next_group(batch.id, BatchMember("ada")).group is None
    assert (left(store, "ada"), left(store, "bo")) == (0, 2)
    assert get_batch(store, batch.id).settled == 0

    assert compare_or_adopt_submission(store, annotate(store, leases, batch, "bo", 2.0)) == "agreed"
    assert get_batch(store, batch.id).settled == 1
    assert compare_or_adopt_submission(store, annotate(store, leases, batch, "bo", 30.0)) == "open"
    assert leases.lease_next_group(batch.id, BatchMember("bo")).group is None
    assert leases.lease_next_group(batch.id, BatchMember("cy")).group is None

    waiting = list_open_cases(store, batch.dataset_id)
    assert len(waiting) == 1
    group = waiting[0].group
    assert load_group_state(store, group).verdict.state == "unreviewed"
    case = read_case(store, group, actor="cy")
    after = adjudicate_case(store, group, case.annotations[1].id, actor="cy")
    assert (after.verdict.state, after.verdict.actor) == ("accepted", "cy")
    assert get_batch(store, batch.id).settled == 2
    assert list_open_cases(store, batch.dataset_id) == []


def test_one_that_a_lead_applies_early_ends_the_work_on_its_group(store, batch) -> None:
    leases = LeaseService(store)
    copies = [annotate(store, leases, batch, "ada", 1.0) for _ in range(2)]
    begun = leases.lease_next_group(batch.id, BatchMember("bo")).group
    first = get_annotation_of_copy(store, copies[0])
    adopt_into_group(store, first, actor="lead")
    assert get_batch(store, batch.id).settled == 1
    # Who has begun it goes on, and nothing more is asked of it.
    assert annotate(store, leases, batch, "bo", 30.0) == begun
    assert compare_or_adopt_submission(store, begun) is None
    assert compare_or_adopt_submission(store, annotate(store, leases, batch, "bo", 1.0)) == "agreed"
    assert get_batch(store, batch.id).settled == 2
    assert leases.lease_next_group(batch.id, BatchMember("ada")).group is None


def test_the_named_reviewers_of_a_batch_and_leads_decide_and_nobody_else(store, batch) -> None:
    leases = LeaseService(store)
    for name, role in (("dan", Role.REVIEWER), ("lea", Role.LEAD)):
        invite(store, name, role, actor="local")
    for person, moved in (("ada", 1.0), ("bo", 30.0)):
        copy = annotate(store, leases, batch, person, moved)
        compare_or_adopt_submission(store, copy)
    (case,) = list_open_cases(store, batch.dataset_id)
    found = read_case(store, case.group, actor="dan")
    assert found.refused == "this batch has named reviewers; cy or lea can decide"
    one = found.annotations[0].id
    for decide in (adjudicate_case, return_for_correction):
        with pytest.raises(ForbiddenError, match="cy or lea can decide"):
            decide(store, case.group, one, actor="dan")
    refused = [read_case(store, case.group, actor=name).refused for name in ("ada", "cy", "lea")]
    assert refused == ["you annotated this group yourself; cy or lea can decide", None, None]
    change_batch(store, batch.id, actor="lea", reviewers=[])
    assert read_case(store, case.group, actor="dan").refused is None


@pytest.mark.parametrize("as_start", [False, True])
def test_a_decision_whose_edit_is_undone_is_made_again(store, batch, as_start) -> None:
    leases = LeaseService(store)
    for person, moved in (("ada", 1.0), ("bo", 30.0)):
        copy = annotate(store, leases, batch, person, moved)
        compare_or_adopt_submission(store, copy)
    (case,) = list_open_cases(store, batch.dataset_id)
    before = read_case(store, case.group, actor="cy")
    one = before.annotations[1]
    for _ in range(2):
        done = adjudicate_case(store, case.group, one.id, as_start=as_start, actor="cy")
        assert get_batch(store, batch.id).settled == 1
        undone = undo_edit_or_decision(store, case.group, if_match=done.etag, actor="dan")
        assert undone.group == before.original.group
        assert read_case(store, case.group, actor="cy").annotations == before.annotations
        assert get_batch(store, batch.id).settled == 0
    told = [entry.body for entry in read_history(store, case.group) if entry.kind == "agreement"]
    assert [body["did"] for body in told] == ["decided", "reopened"] * 2
    assert [str(check) for check in examine_database(store) if not check.ok] == []


def test_an_edit_after_the_decision_is_undone_without_reopening_it(store, batch) -> None:
    leases = LeaseService(store)
    for person, moved in (("ada", 1.0), ("bo", 30.0)):
        copy = annotate(store, leases, batch, person, moved)
        compare_or_adopt_submission(store, copy)
    (case,) = list_open_cases(store, batch.dataset_id)
    one = read_case(store, case.group, actor="cy").annotations[1].id
    done = adjudicate_case(store, case.group, one, actor="cy")
    view = next(view for view in done.group.views if view.ball is not None)
    edit = make_set_ball_edit(view.key, None)
    edited = submit_edit(store, case.group, edit, if_match=done.etag, actor="cy")
    undo_edit_or_decision(store, case.group, if_match=edited.etag, actor="cy")
    assert list_open_cases(store, batch.dataset_id) == []


def test_the_people_of_a_batch_are_told_of_it_once(store, batch) -> None:
    change_batch(store, batch.id, actor="lead", annotators=("ada", "bo", "cy"))
    for name in ("ada", "bo", "cy"):
        with store.read() as session:
            person = find_person_by_name(session, name)
            rings = select_notifications(session, person.id, EVERYTHING, "", 10, None)
        assert [ring.kind for ring in rings] == ["assigned"], name
