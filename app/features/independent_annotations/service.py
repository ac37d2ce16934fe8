"""One person's own annotation of a group, made on a copy that nobody else sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from app.db.log import iterate_group_entries_of_kinds
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, NotFoundError
from app.features.datasets.service import require_dataset_id
from app.features.groups.queries import read_groups
from app.features.groups.state import require_group
from app.features.groups.submit import solve_and_store_group
from app.features.independent_annotations.copying import (
    CopyRequest,
    copy_group,
    make_gold_group_start,
    rebuild_group_before_edits,
    strip_to_gold_start,
)
from app.features.independent_annotations.queries import (
    GOLD,
    INDEPENDENT,
    CopyAndOriginalNames,
    IndependentAnnotation,
    count_annotations,
    find_annotation,
    find_annotation_of_copy,
    find_common_gold_start,
    insert_annotation,
    list_annotations_of_group,
    read_annotations,
    read_copy_names,
)
from app.features.independent_annotations.submission_queries import RETURNED, submit_copy
from app.features.people.visibility_queries import READER
from app.features.queue.queries import read_columns_of_groups
from app.json_text import Moment
from app.soccer.actors import person_of_actor

_KINDS = ("work", "take")
"""Kinds of such entries: about groups of batches, and about own annotations."""


@dataclass(frozen=True)
class ReturnedGroup:
    """A group that was returned: by whom, when, and why; the reason may be empty.

    Attributes:
        group: What they work on; of an annotation of their own, the copy.
        by: Who returned it.
        reason: Why; may be empty.
    """

    group: int
    title: str
    by: str
    at: Moment
    reason: str


def read_returned_groups(session: Session, group_ids: Sequence[int]) -> dict[int, ReturnedGroup]:
    """How groups were returned last, by their ids; the caller knows that they wait again."""
    last = {
        entry.group_id: entry
        for entry in iterate_group_entries_of_kinds(session, group_ids, _KINDS)
        if entry.group_id is not None and entry.body.get("did") == RETURNED
    }
    names = {
        row.group_id: row.label or row.key
        for row in read_columns_of_groups(session, list(last), (), ("group_id", "label", "key"))
    }
    return {
        group: ReturnedGroup(
            group,
            names.get(group, ""),
            person_of_actor(entry.actor),
            entry.at,
            entry.body["reason"],
        )
        for group, entry in last.items()
    }


@dataclass(frozen=True)
class DisclosedAnnotation:
    """An independent annotation as everybody may see it who sees its copy; that it is a gold one it does not say.

    Attributes:
        batch: The batch that it is for; None: none.
        group: The copy: a group like any other.
        dataset: Of the groups that this is a copy of one of.
        of, number: The original, and its number in its dataset; None where its person is not told.
        title: What people call the group; where its person is not told, what they call the copy.
        place: Which one of this person in this batch, from 1.
        settled: When something was decided about it; None: not yet, or its person is not told.
        returned: Why its person has it back; None: they have not, or submitted it again.
    """

    id: int
    batch: int | None
    group: int
    dataset: int
    of: int | None
    number: int | None
    title: str
    person: str
    place: int
    begun: Moment
    submitted: Moment | None
    verdict: str | None
    settled: Moment | None
    returned: ReturnedGroup | None = None


def require_reach(reaches_copies: bool) -> None:
    """Raise ForbiddenError where whoever asks does not reach copies: by a token for one dataset."""
    if not reaches_copies:
        raise ForbiddenError(
            "a token for one dataset does not reach independent annotations",
            hint="Use a token for all datasets.",
        )


def begin_annotation(store: Store, group_id: int, *, person: str) -> DisclosedAnnotation:
    """Let a person begin their own annotation of a group; the one that they have already, if so.

    Args:
        store: The database.
        group_id: The original.
        person: Whose it is; also of a token, the person's.

    Raises:
        NotFoundError: There is no such group.
        ConflictError: It is a copy itself.
    """
    with store.write() as session:
        annotation = begin_annotation_in_session(session, group_id, person=person_of_actor(person))
        begun = disclose_annotation_in_session(session, annotation)
        session.respond(begun)
    solve_and_store_group(store, annotation.copy_id)
    return begun


def begin_annotation_in_session(
    session: Session,
    group_id: int,
    *,
    person: str,
    batch_id: int | None = None,
    kind: str = INDEPENDENT,
    since: str | None = None,
    blind: bool = True,
    nameless: bool = False,
) -> IndependentAnnotation:
    """``begin_annotation`` within a write session; the copy is solved by the caller.

    Args:
        session: Writes.
        group_id: The original.
        person: Whose it is.
        batch_id: For which batch; None: for none.
        kind: ``independent`` or ``gold``.
        since: When the batch began: edits of the original from then on are not seen.
        blind: Begin with the group as it was then, else as the last annotation of it left it.
        nameless: The copy is of a batch with gold groups: it does not say which group it is of, and
            begins with what all copies of such a batch begin with.
    """
    stored = require_group(session, group_id)
    others = [
        one for one in list_annotations_of_group(session, group_id) if one.batch_id == batch_id
    ]
    for one in others:
        if one.person == person:
            return one
    if find_annotation_of_copy(session, group_id) is not None:
        raise ConflictError(
            "this is an independent annotation already",
            hint="Start from the group that it was made from.",
        )
    place = count_annotations(session, batch_id, person) + 1
    ready = [one.copy_id for one in others if one.submitted is not None]
    start = stored.group
    if kind == GOLD:
        start = make_gold_group_start(session, stored)
    elif (blind or nameless) and since is not None:
        start = rebuild_group_before_edits(session, stored, since)
    elif not blind and ready:
        start = require_group(session, ready[-1]).group
    common = find_common_gold_start(session, stored.dataset_id) if nameless else None
    if common is not None:
        start = strip_to_gold_start(start, common)
    order = CopyRequest(stored, batch_id, person, f"{batch_id or 0}-{place}" if nameless else None)
    copy_id = copy_group(session, order, start)
    annotation_id = insert_annotation(
        session,
        batch_id=batch_id,
        group_id=group_id,
        copy_id=copy_id,
        person=person,
        kind=kind,
        place=place,
    )
    return read_annotation(session, annotation_id)


def submit_annotation(store: Store, annotation_id: int, *, actor: str) -> DisclosedAnnotation:
    """Submit an independent annotation; from then on it stays as it is.

    Raises:
        NotFoundError: There is no such annotation.
        ForbiddenError: It is somebody else's.
        ConflictError: It was submitted already.
    """
    with store.write() as session:
        annotation = read_annotation(session, annotation_id)
        submit_copy(session, annotation, actor=actor, at=now())
        handed = disclose_annotation_in_session(session, read_annotation(session, annotation_id))
        session.respond(handed)
        return handed


def get_annotation(store: Store, annotation_id: int) -> IndependentAnnotation:
    """An independent annotation; raises NotFoundError where there is none."""
    with store.read() as session:
        return read_annotation(session, annotation_id)


def get_annotation_of_copy(store: Store, copy_id: int) -> IndependentAnnotation:
    """The independent annotation whose copy a group is.

    Raises:
        NotFoundError: It is an ordinary group.
    """
    annotation = find_independent_annotation_of_group(store, copy_id)
    if annotation is not None:
        return annotation
    with store.read() as session:
        there = bool(read_groups(session, [copy_id]))
    if not there:
        raise NotFoundError.group(copy_id)
    raise NotFoundError(f"group {copy_id} is not an independent annotation")


def find_independent_annotation_of_group(
    store: Store, copy_id: int
) -> IndependentAnnotation | None:
    """The independent annotation whose copy a group is; None for an ordinary group."""
    with store.read_for_one_statement() as session:
        return find_annotation_of_copy(session, copy_id)


def list_annotations(
    store: Store, dataset: str | int, sees_all: Callable[[int], bool], *, person: str
) -> list[DisclosedAnnotation]:
    """The independent annotations of a dataset's groups as they are shown, oldest first.

    Args:
        store: The database.
        dataset: Name or id.
        sees_all: Whether everybody's are shown, by the dataset's id.
        person: Whose else.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        dataset_id = require_dataset_id(session, dataset)
        whose = None if sees_all(dataset_id) else person_of_actor(person)
        found = read_annotations(session, dataset_id, whose)
        return _disclose_annotations(session, found)


def disclose_annotation(store: Store, annotation: IndependentAnnotation) -> DisclosedAnnotation:
    """An independent annotation as it is shown."""
    with store.read() as session:
        return disclose_annotation_in_session(session, annotation)


def disclose_annotation_in_session(
    session: Session, annotation: IndependentAnnotation
) -> DisclosedAnnotation:
    """``disclose_annotation`` within a session."""
    return _disclose_annotations(session, [annotation])[0]


def _disclose_annotations(
    session: Session, annotations: Sequence[IndependentAnnotation]
) -> list[DisclosedAnnotation]:
    heads = {row.id: row for row in read_copy_names(session, [one.copy_id for one in annotations])}
    reader = READER.get()
    blind = frozenset[int]() if reader is None else frozenset().union(*reader.batches.values())
    waiting = [one.copy_id for one in annotations if one.submitted is None and one.settled is None]
    back = read_returned_groups(session, waiting)

    def is_disclosed(one: IndependentAnnotation) -> bool:
        """Whether it may be known of what it is a copy, and what became of it: its person is told neither
        while they work blind, nor ever of a copy without a name, which may be of a gold group."""
        if one.batch_id in blind:
            return False
        own = reader is None or reader.person == one.person
        return bool(heads[one.copy_id].same) or not own

    return [
        DisclosedAnnotation(
            id=one.id,
            batch=one.batch_id,
            group=one.copy_id,
            dataset=heads[one.copy_id].of_id,
            of=one.group_id if disclosed else None,
            number=heads[one.copy_id].number if disclosed else None,
            title=_choose_copy_title(heads[one.copy_id], disclosed),
            person=one.person,
            place=one.place,
            begun=one.begun,
            submitted=one.submitted,
            verdict=one.verdict,
            # Of a gold group nothing is ever decided.
            settled=one.settled if disclosed else None,
            returned=back.get(one.copy_id),
        )
        for one, disclosed in ((one, is_disclosed(one)) for one in annotations)
    ]


def _choose_copy_title(head: CopyAndOriginalNames, disclosed: bool) -> str:
    return str((head.of_label or head.of_key) if disclosed else (head.label or head.key))


def read_annotation(session: Session, annotation_id: int) -> IndependentAnnotation:
    """``get_annotation`` within a session."""
    row = find_annotation(session, annotation_id)
    if row is None:
        raise NotFoundError(f"there is no annotation {annotation_id}")
    return row
