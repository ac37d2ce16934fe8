"""One person's own annotation of a group, made on a copy that nobody else sees."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from app.db.log import read_entries_of
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.datasets.service import need_dataset
from app.features.groups.queries import read_groups
from app.features.groups.state import need_group
from app.features.groups.submit import solved
from app.features.independent_annotations.copying import (
    CopyOrder,
    copy_group,
    gold_start_of,
    start_of,
    stripped,
)
from app.features.independent_annotations.gold_queries import common_start
from app.features.independent_annotations.queries import (
    GOLD,
    INDEPENDENT,
    Take,
    count_takes,
    find_take,
    insert_take,
    names_of,
    take_of_copy,
    takes_in,
    takes_of_group,
)
from app.features.independent_annotations.submission_queries import RETURNED, submit_copy
from app.features.people.visibility_queries import READER
from app.features.queue.listing_queries import read_columns
from app.finite import Moment
from app.soccer.actors import person_of

_KINDS = ("work", "take")
"""Kinds of such entries: about groups of batches, and about own annotations."""


@dataclass(frozen=True)
class HandedBack:
    """A group that was handed back: by whom, when, and why; the reason may be empty.

    Attributes:
        group: What they work on; of an annotation of their own, the copy.
        by: Who handed it back.
        reason: Why; may be empty.
    """

    group: int
    title: str
    by: str
    at: Moment
    reason: str


def read_handed_back(session: Session, group_ids: Sequence[int]) -> dict[int, HandedBack]:
    """How groups were handed back last, by their ids; the caller knows that they wait again."""
    last = {
        entry.group_id: entry
        for entry in read_entries_of(session, group_ids, _KINDS)
        if entry.group_id is not None and entry.body.get("did") == RETURNED
    }
    names = {
        row.group_id: row.label or row.key
        for row in read_columns(session, list(last), (), ("group_id", "label", "key"))
    }
    return {
        group: HandedBack(
            group, names.get(group, ""), person_of(entry.actor), entry.at, entry.body["reason"]
        )
        for group, entry in last.items()
    }


@dataclass(frozen=True)
class TakeView:
    """A take as everybody may see it who sees its copy; that it is a gold one it does not say.

    Attributes:
        batch: The batch that it is for; None: none.
        group: The copy: a group like any other.
        dataset: Of the groups that this is a copy of one of.
        of, number: The original, and its number in its dataset; None where its person is not told.
        title: What people call the group; where its person is not told, what they call the copy.
        place: Which one of this person in this batch, from 1.
        settled: When something was decided about it; None: not yet, or its person is not told.
        handed_back: Why its person has it back; None: they have not, or handed it in again.
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
    handed_in: Moment | None
    verdict: str | None
    settled: Moment | None
    handed_back: HandedBack | None = None


def begin_take(store: Store, group_id: int, *, person: str) -> TakeView:
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
        take = begin(session, group_id, person=person_of(person))
        begun = show(session, take)
        session.respond(begun)
    solved(store, take.copy_id)
    return begun


def begin(
    session: Session,
    group_id: int,
    *,
    person: str,
    batch_id: int | None = None,
    kind: str = INDEPENDENT,
    since: str | None = None,
    blind: bool = True,
    nameless: bool = False,
) -> Take:
    """``begin_take`` within a write session; the copy is solved by the caller.

    Args:
        session: Writes.
        group_id: The original.
        person: Whose it is.
        batch_id: For which batch; None: for none.
        kind: ``independent`` or ``gold``.
        since: When the batch began: edits of the original from then on are not seen.
        blind: Begin with the group as it was then, else as the last take of it left it.
        nameless: The copy is of a batch with gold groups: it does not say which group it is of, and
            begins with what all copies of such a batch begin with.
    """
    stored = need_group(session, group_id)
    others = [one for one in takes_of_group(session, group_id) if one.batch_id == batch_id]
    for one in others:
        if one.person == person:
            return one
    if take_of_copy(session, group_id) is not None:
        raise ConflictError(
            "this is an own annotation already", hint="Begin from the group that it is of."
        )
    place = count_takes(session, batch_id, person) + 1
    ready = [one.copy_id for one in others if one.handed_in is not None]
    start = stored.group
    if kind == GOLD:
        start = gold_start_of(session, stored)
    elif (blind or nameless) and since is not None:
        start = start_of(session, stored, since)
    elif not blind and ready:
        start = need_group(session, ready[-1]).group
    common = common_start(session, stored.dataset_id) if nameless else None
    if common is not None:
        start = stripped(start, common)
    order = CopyOrder(stored, batch_id, person, f"{batch_id or 0}-{place}" if nameless else None)
    copy_id = copy_group(session, order, start)
    take_id = insert_take(
        session,
        batch_id=batch_id,
        group_id=group_id,
        copy_id=copy_id,
        person=person,
        kind=kind,
        place=place,
    )
    return read_take(session, take_id)


def hand_in(store: Store, take_id: int, *, actor: str) -> TakeView:
    """Submit an independent annotation; from then on it stays as it is.

    Raises:
        NotFoundError: There is no such take.
        ForbiddenError: It is somebody else's.
        ConflictError: It was submitted already.
    """
    with store.write() as session:
        take = read_take(session, take_id)
        submit_copy(session, take, actor=actor, at=now())
        handed = show(session, read_take(session, take_id))
        session.respond(handed)
        return handed


def get_take(store: Store, take_id: int) -> Take:
    """A take; raises NotFoundError where there is none."""
    with store.read() as session:
        return read_take(session, take_id)


def get_take_of(store: Store, copy_id: int) -> Take:
    """The take whose copy a group is.

    Raises:
        NotFoundError: It is an ordinary group.
    """
    take = find_take_of(store, copy_id)
    if take is not None:
        return take
    with store.read() as session:
        there = bool(read_groups(session, [copy_id]))
    if not there:
        raise NotFoundError.group(copy_id)
    raise NotFoundError(f"group {copy_id} is not an independent annotation")


def find_take_of(store: Store, copy_id: int) -> Take | None:
    """The take whose copy a group is; None for an ordinary group."""
    with store.glance() as session:
        return take_of_copy(session, copy_id)


def list_takes(
    store: Store, dataset: str | int, sees_all: Callable[[int], bool], *, person: str
) -> list[TakeView]:
    """The takes of a dataset's groups as they are shown, oldest first.

    Args:
        store: The database.
        dataset: Name or id.
        sees_all: Whether everybody's are shown, by the dataset's id.
        person: Whose else.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        dataset_id = need_dataset(session, dataset)
        whose = None if sees_all(dataset_id) else person_of(person)
        found = takes_in(session, dataset_id, whose)
        return _shown(session, found)


def shown(store: Store, take: Take) -> TakeView:
    """A take as it is shown."""
    with store.read() as session:
        return show(session, take)


def show(session: Session, take: Take) -> TakeView:
    """``shown`` within a session."""
    return _shown(session, [take])[0]


def _shown(session: Session, takes: Sequence[Take]) -> list[TakeView]:
    heads = {row.id: row for row in names_of(session, [one.copy_id for one in takes])}
    reader = READER.get()
    blind = frozenset[int]() if reader is None else frozenset().union(*reader.batches.values())
    waiting = [one.copy_id for one in takes if one.handed_in is None and one.settled is None]
    back = read_handed_back(session, waiting)

    def is_told(one: Take) -> bool:
        """Whether it may be known of what it is a copy, and what became of it: its person is told neither
        while they work blind, nor ever of a copy without a name, which may be of a gold group."""
        if one.batch_id in blind:
            return False
        own = reader is None or reader.person == one.person
        return bool(heads[one.copy_id].same) or not own

    return [
        TakeView(
            id=one.id,
            batch=one.batch_id,
            group=one.copy_id,
            dataset=heads[one.copy_id].of_id,
            of=one.group_id if told else None,
            number=heads[one.copy_id].number if told else None,
            title=_title(heads[one.copy_id], told),
            person=one.person,
            place=one.place,
            begun=one.begun,
            handed_in=one.handed_in,
            verdict=one.verdict,
            # Of a gold group nothing is ever decided.
            settled=one.settled if told else None,
            handed_back=back.get(one.copy_id),
        )
        for one, told in ((one, is_told(one)) for one in takes)
    ]


def _title(head: Any, told: bool) -> str:
    return str((head.of_label or head.of_key) if told else (head.label or head.key))


def read_take(session: Session, take_id: int) -> Take:
    """``get_take`` within a session."""
    row = find_take(session, take_id)
    if row is None:
        raise NotFoundError(f"there is no annotation {take_id}")
    return row
