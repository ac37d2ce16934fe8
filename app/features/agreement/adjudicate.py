"""Adjudicate: somebody decides between annotations that disagree."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from app.db.store import Store
from app.errors import ForbiddenError, NotFoundError
from app.features.agreement.queries import OPEN, list_agreements, list_group_agreements
from app.features.agreement.service import (
    AnnotationsComparison,
    adopt_and_decide,
    adopt_without_case,
    compare_states,
    list_undecided_annotations,
    read_limits,
)
from app.features.batches.queries import find_batch
from app.features.batches.service import read_batch
from app.features.datasets.service import dataset_id
from app.features.groups.state import GroupState
from app.features.groups.submit import load_solved_group
from app.features.groups.view_paint import PaintUpdater
from app.features.independent_annotations.adopt import return_annotation
from app.features.independent_annotations.queries import IndependentAnnotation
from app.features.independent_annotations.service import DisclosedAnnotation
from app.features.people.roles import Action, role_allows
from app.features.people.service import list_members
from app.json_text import Moment
from app.soccer.actors import LOCAL_USER, person_of_actor


@dataclass(frozen=True)
class OpenCase:
    """A group that waits for a decision.

    Attributes:
        worst: How many times its limit the worst disagreement is.
    """

    group: int
    number: int
    batch: int | None
    people: tuple[str, ...]
    worst: float
    disagreements: int
    since: Moment


@dataclass(frozen=True)
class AdjudicationCase:
    """A group that waits for a decision, with what it is to be decided between.

    Attributes:
        annotations: In the order in which they were submitted; ``comparison`` has the same order.
        refused: Why whoever asks may not decide; None: they may.
        own: Whether they decide about their own annotation, because nobody else is there.
    """

    original: GroupState
    batch: int | None
    annotations: tuple[IndependentAnnotation, ...]
    comparison: AnnotationsComparison
    refused: str | None
    own: bool


def list_open_cases(store: Store, dataset: str | int) -> list[OpenCase]:
    """The groups of a dataset that wait for a decision, those that disagree most first."""
    number = dataset_id(store, dataset)
    with store.read() as session:
        rows = list_agreements(session, number, state=OPEN)
    found = []
    for row in rows:
        batch = row.batch_id or None
        people = tuple(
            annotation.person
            for annotation in list_undecided_annotations(store, row.group_id, batch)
        )
        found.append(
            OpenCase(
                row.group_id, row.number, batch, people, row.worst, row.disagreements, row.found
            )
        )
    return found


def read_case(store: Store, group_id: int, *, actor: str) -> AdjudicationCase:
    """The adjudication case of a group: its annotations and their differences.

    Raises:
        NotFoundError: Nothing of it waits for a decision.
    """
    original = load_solved_group(store, group_id)
    with store.read() as session:
        row = next(
            (one for one in list_group_agreements(session, group_id) if one.state == OPEN), None
        )
        limits = read_limits(session, original.dataset_id)
    if row is None:
        raise NotFoundError(f"group {group_id} is not waiting for adjudication")
    annotations = list_undecided_annotations(store, group_id, row.batch_id or None)
    if len(annotations) < 2:
        raise NotFoundError(
            f"group {group_id} is not waiting for adjudication: fewer than two annotations have"
            " been submitted"
        )
    states = [load_solved_group(store, annotation.copy_id) for annotation in annotations]
    name = person_of_actor(actor)
    own = name in {annotation.person for annotation in annotations}
    named = _list_named_reviewers(store, row.batch_id)
    judges = _list_possible_judges(store, original.dataset_id, named)
    others = [one for one in judges if one not in {made.person for made in annotations}]
    refused = None
    if own and others:
        refused = f"you annotated this group yourself; {_join_names(others)} can decide"
    elif named and name not in judges:
        refused = f"this batch has named reviewers; {_join_names(judges)} can decide"
    return AdjudicationCase(
        original,
        row.batch_id or None,
        tuple(annotations),
        compare_states(states, limits),
        refused,
        own,
    )


def adjudicate_case(
    store: Store,
    group_id: int,
    annotation_id: int,
    *,
    as_start: bool = False,
    actor: str,
    paint: PaintUpdater | None = None,
) -> GroupState:
    """Take one of the annotations, or begin a third one from it.

    The annotation goes into the group in its person's name, the verdict upon it is the
    adjudicator's. A third one is edited and judged in the group itself from then on.

    Raises:
        NotFoundError: Nothing of the group waits for a decision, or it is no such annotation.
        ForbiddenError: It is one's own, and others could decide.
        ConflictError: It was changed meanwhile.
    """
    case = read_case(store, group_id, actor=actor)
    if case.refused is not None:
        raise ForbiddenError(case.refused)
    place = next(
        (at for at, annotation in enumerate(case.annotations) if annotation.id == annotation_id),
        None,
    )
    if place is None:
        raise NotFoundError(
            f"annotation {annotation_id} is not among the annotations that wait for adjudication"
        )
    return adopt_and_decide(
        store,
        group_id,
        case.batch,
        case.annotations,
        case.annotations[place],
        outcome="start" if as_start else "take",
        actor=actor,
        paint=paint,
        judge=not as_start,
    )


def adopt_into_group(
    store: Store,
    annotation: IndependentAnnotation,
    *,
    actor: str,
    paint: PaintUpdater | None = None,
) -> GroupState:
    """Take an annotation and its verdict over into the group; where it waits for a decision, this is it.

    Raises:
        ConflictError: It is not submitted, was decided about, or is of a gold group.
    """
    with store.read() as session:
        waits = any(
            (row.state, row.batch_id) == (OPEN, annotation.batch_id or 0)
            for row in list_group_agreements(session, annotation.group_id)
        )
    ready = list_undecided_annotations(store, annotation.group_id, annotation.batch_id)
    if not waits:
        return adopt_without_case(store, annotation, ready, actor=actor, paint=paint)
    return adopt_and_decide(
        store,
        annotation.group_id,
        annotation.batch_id,
        ready,
        annotation,
        outcome="take",
        actor=actor,
        paint=paint,
    )


def return_for_correction(
    store: Store, group_id: int, annotation_id: int, reason: str = "", *, actor: str
) -> DisclosedAnnotation:
    """Return one of the annotations that disagree to its person; the group waits no longer.

    Raises:
        NotFoundError: Nothing of the group waits for a decision, or it is no such annotation.
        ForbiddenError: Others have to decide, or it is their own.
    """
    case = read_case(store, group_id, actor=actor)
    if case.refused is not None:
        raise ForbiddenError(case.refused)
    annotation = next((one for one in case.annotations if one.id == annotation_id), None)
    if annotation is None:
        raise NotFoundError(
            f"annotation {annotation_id} is not among the annotations that wait for adjudication"
        )
    if annotation.person == person_of_actor(actor) != LOCAL_USER:
        raise ForbiddenError("you submitted this annotation yourself", hint="A lead can return it.")
    return return_annotation(store, annotation_id, reason, actor=actor)


def _list_named_reviewers(store: Store, batch_id: int) -> list[str]:
    """The reviewers whom a batch (0: none) names; nobody where it was deleted."""
    with store.read() as session:
        there = find_batch(session, batch_id) is not None
        return read_batch(session, batch_id, with_here=False).reviewers if there else []


def _list_possible_judges(store: Store, dataset: int, named: Collection[str]) -> list[str]:
    """The people who may judge in a dataset; where reviewers are named, these and the leads."""
    return [
        one.name
        for one in list_members(store, dataset)
        if role_allows(one.role, Action.REVIEW)
        and (not named or one.name in named or role_allows(one.role, Action.LEAD))
    ]


def _join_names(names: Sequence[str]) -> str:
    most = 3
    if len(names) > most:
        return f"{', '.join(names[:most])} or another reviewer"
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
