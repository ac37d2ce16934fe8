"""Own annotations in a batch: where several people annotate each group, or some groups are gold,
everybody works on copies that nobody else sees.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import structlog

from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.batches.queries import (
    count_visible_work,
    list_returned_batch_groups,
    read_batch_groups,
)
from app.features.batches.queries import set_group_submission as hand_in_group
from app.features.batches.service import Batch, BatchRole, get_batch, list_batches
from app.features.independent_annotations.adopt import adopt_annotation
from app.features.independent_annotations.known_truth import (
    BatchAnnotationTerms,
    begin_next_annotation,
    count_gold_left,
    list_unseen_gold_outside_batches,
)
from app.features.independent_annotations.queries import (
    INDEPENDENT,
    IndependentAnnotation,
    count_begun_and_free_groups,
    find_annotation_of_copy,
    list_annotations_of_batch,
)
from app.features.independent_annotations.service import read_annotation
from app.features.independent_annotations.submission_queries import (
    require_annotation_open,
    submit_copy,
)
from app.features.people.visibility_queries import READER, sees_independent_work
from app.features.queue.fields import query_reveals_hidden_work
from app.soccer.actors import person_of_actor

log = structlog.get_logger("touchline.batches")
OVER = ("accepted", "rejected")
"""Verdicts after which a group waits for nobody."""


def makes_own_annotations(batch: Batch, parts: Collection[BatchRole]) -> bool:
    """Whether somebody with these parts makes annotations of their own in a batch."""
    if batch.verdicts == 1 and batch.gold_every is None:
        return False
    return BatchRole.ANNOTATOR in parts or (BatchRole.REVIEWER in parts and not batch.annotators)


def begin_next_own_annotation(
    store: Store, batch: Batch, person: str
) -> IndependentAnnotation | None:
    """The own annotation that somebody shall work on now; None: there is nothing left for them.

    Where one annotation a group is asked for, what they have submitted is taken over first.
    """
    adopt_if_sole_annotator(store, batch, person)
    with store.read() as session:
        groups = _list_waiting_groups(session, batch)
    terms = BatchAnnotationTerms(
        batch.id,
        batch.dataset_id,
        groups,
        batch.verdicts,
        batch.blind,
        batch.created,
        batch.gold_every,
    )
    return begin_next_annotation(store, terms, person=person)


def list_returned_groups(session: Session, batch: Batch, person: str) -> list[int]:
    """Groups whose annotation somebody submitted, was taken over, and was returned to them."""
    return [
        row.group_id
        for row in list_returned_batch_groups(session, [batch.id], person_of_actor(person))
    ]


def count_own_groups_left(session: Session, batch: Batch, person: str) -> int:
    """Of how many groups somebody may still make an annotation of their own, begun ones and those
    that they have back included."""
    name = person_of_actor(person)
    begun, free = count_begun_and_free_groups(
        session, batch.id, batch.dataset_id, name, batch.verdicts
    )
    left = begun + free + len(list_returned_groups(session, batch, person))
    if batch.gold_every is None:
        return left
    annotations = list_annotations_of_batch(session, batch.id, batch.dataset_id)
    kinds = [annotation.kind for annotation in annotations if annotation.person == name]
    fresh = len(
        list_unseen_gold_outside_batches(
            session, batch.dataset_id, name, _list_waiting_groups(session, batch)
        )
    )
    return left + count_gold_left(kinds, batch.gold_every, free, fresh)


def hide_others_progress(session: Session, batch: Batch) -> Batch:
    """A batch as whoever asks may see it.

    Of one that they annotate blind they see their own part alone: counts of the groups change with
    what is submitted of them, and not with what is submitted of a gold group. Groups that are hidden by
    that one count in no other.
    """
    if query_reveals_hidden_work(batch.query) and not sees_independent_work(batch.dataset_id):
        batch = replace(batch, query="")
    reader = READER.get()
    if reader is None or batch.dataset_id not in reader.batches:
        return batch
    if batch.id not in reader.batches[batch.dataset_id]:
        found = count_visible_work(session, batch.id, batch.dataset_id)
        if found is None:
            return batch
        counts = {name: getattr(found, name) for name in ("groups", "submitted", "settled", "last")}
        return replace(batch, **counts)
    return replace(with_own_counts(session, batch, reader.person), query="")


def with_own_counts(session: Session, batch: Batch, person: str) -> Batch:
    """A batch with the counts of somebody's own annotations: what they submitted is done."""
    annotations = list_annotations_of_batch(session, batch.id, batch.dataset_id)
    name = person_of_actor(person)
    back = set(list_returned_groups(session, batch, person))
    done = [
        annotation.submitted
        for annotation in annotations
        if annotation.person == name and annotation.submitted and annotation.group_id not in back
    ]
    return replace(
        batch,
        groups=len(done) + count_own_groups_left(session, batch, person),
        submitted=0,
        settled=len(done),
        last=max(done, default=None),
        here=[],
    )


def list_visible_batches(store: Store, dataset: str | int) -> list[Batch]:
    """The batches of a dataset as whoever asks may see them."""
    found = list_batches(store, dataset)
    with store.read() as session:
        return [hide_others_progress(session, batch) for batch in found]


def get_visible_batch(store: Store, batch_id: int) -> Batch:
    """A batch as whoever asks may see it; raises NotFoundError where there is none."""
    batch = get_batch(store, batch_id)
    with store.read() as session:
        return hide_others_progress(session, batch)


def _list_waiting_groups(session: Session, batch: Batch) -> list[int]:
    """The groups of a batch that wait for an annotation; what was submitted waits for its reviewer,
    what was returned for its annotator."""
    return [
        row.group_id
        for row in read_batch_groups(session, batch.id)
        if row.settled is None and row.submitted is None and row.submitted_by is None
    ]


def count_own_groups(session: Session, batch: Batch, person: str) -> int | None:
    """How many groups of a batch somebody annotates on their own, those that are done included.

    None where gold groups are mixed in: they add to what is done and not to what is left.
    """
    if batch.gold_every is not None:
        return None
    name = person_of_actor(person)
    annotations = list_annotations_of_batch(session, batch.id, batch.dataset_id)
    done = len([row for row in annotations if row.person == name and row.submitted is not None])
    return done + sum(
        count_begun_and_free_groups(session, batch.id, batch.dataset_id, name, batch.verdicts)
    )


def adopt_if_sole_annotator(store: Store, batch: Batch, person: str) -> None:
    """Take over what somebody submitted, where nobody else annotates the same groups.

    What an annotator has not judged waits for a reviewer then, as if they had submitted the group.
    """
    if batch.verdicts > 1:
        return
    with store.read() as session:
        ready = [
            row
            for row in list_annotations_of_batch(session, batch.id, batch.dataset_id)
            if row.person == person_of_actor(person)
            and (row.kind, row.settled) == (INDEPENDENT, None)
            and row.submitted is not None
        ]
    for row in ready:

        def note_work(session: Session, annotation: IndependentAnnotation = row) -> None:
            let_group_wait_for_reviewer(session, batch, annotation, at=now())

        try:
            adopt_annotation(store, row.id, actor=person, also=note_work, decided=False)
        except ConflictError as error:
            # It waits for a lead, or for the next time; the person goes on meanwhile.
            log.warning(
                "a submitted annotation was not applied to its group yet",
                id=row.id,
                error=str(error),
            )


def let_group_wait_for_reviewer(
    session: Session, batch: Batch, annotation: IndependentAnnotation, *, at: str
) -> None:
    """The group of an annotation that is taken over waits for a reviewer, where its annotator has
    not judged it."""
    if batch.annotators and annotation.verdict not in OVER:
        hand_in_group(session, batch.id, annotation.group_id, at=at, by=annotation.person)


def find_own_annotation(
    session: Session, batch: Batch, group: int, person: str
) -> IndependentAnnotation | None:
    """The own annotation of a person in a batch whose copy a group is; None: it is none."""
    row = find_annotation_of_copy(session, group)
    if row is None or (row.batch_id, row.person) != (batch.id, person_of_actor(person)):
        return None
    return read_annotation(session, row.id)


def submit_own_annotation(
    session: Session, annotation: IndependentAnnotation, *, actor: str, done: bool
) -> None:
    """Submit an own annotation; ``done`` False: refused, only a lead lets its person go on with it.

    Raises:
        ConflictError: It was submitted before, or is not and shall be taken back.
    """
    if not done:
        require_annotation_open(annotation)
        raise ConflictError("this annotation is not submitted yet")
    submit_copy(session, read_annotation(session, annotation.id), actor=actor, at=now())
