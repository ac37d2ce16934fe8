"""Batches: groups of a dataset that a lead gives to people, and what becomes of them."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date
from enum import StrEnum
from typing import Any, Literal

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.batches.completion_queries import follow_verdicts_given_while_closed
from app.features.batches.queries import (
    CLOSED,
    OPEN,
    BatchRow,
    count_work,
    delete_batch,
    find_batch,
    find_dataset_batches,
    insert_batch,
    insert_groups,
    insert_tracks,
    list_batch_people,
    list_batches_of_tracks,
    list_groups_in_open_batches,
    list_leases,
    read_batch_groups,
    set_batch_people,
    update_batch,
)
from app.features.datasets.service import dataset_id, strip_and_check_title
from app.features.independent_annotations.queries import list_gold_heads
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import notify_person
from app.features.people.roles import Action, role_allows
from app.features.people.service import list_members
from app.features.queue.queries import GroupListing
from app.features.queue.query import MAX_LISTED_LENGTH, Query, parse_query
from app.features.tracks.queries import list_track_rows
from app.features.webhooks.queries import GIVEN_OUT, HANDED_ON, queue_messages_about_batch
from app.json_text import Moment
from app.soccer.actors import person_of_actor
from app.wording import plural

BatchKind = Literal["groups", "tracks"]
GROUPS: BatchKind = "groups"
TRACKS: BatchKind = "tracks"
MOST_GROUPS = 10_000
"""Of one batch."""
MOST_BATCHES = 500
"""Of one dataset: a list that people read."""
MOST_VERDICTS = 5
"""So many independent verdicts can a batch ask for."""
RAREST_GOLD = 1000
"""One of so many groups of a batch is a gold one at least, where any are."""
WORK = "work"
"""Kind of the log's entries about batches; they change no group."""


class BatchRole(StrEnum):
    """What somebody does in a batch."""

    ANNOTATOR = "annotator"
    REVIEWER = "reviewer"


_NEEDS = {BatchRole.ANNOTATOR: Action.ANNOTATE, BatchRole.REVIEWER: Action.REVIEW}


@dataclass(frozen=True)
class NewBatch:
    """What a lead asks for; people go by their names.

    Attributes:
        query: Which groups, as in the queue; with the order in which they are given out.
        size: So many of them, the first ones; None: all.
        skip_given: Skip groups that are in another open batch.
        verdicts, blind, gold_every: As ``BatchModel`` has them.
        tracks: Ids of tracks of the ball in place of groups, in the order in which they are given out.
    """

    name: str
    query: str = ""
    size: int | None = None
    annotators: Sequence[str] = ()
    reviewers: Sequence[str] = ()
    due: date | None = None
    skip_given: bool = True
    verdicts: int = 1
    blind: bool = True
    gold_every: int | None = None
    tracks: Sequence[int] | None = None


@dataclass(frozen=True)
class Presence:
    """A person who has a group open, and since when."""

    group: int
    person: str
    since: str
    seen: str


@dataclass(frozen=True)
class Batch:
    """A batch as it is now.

    Attributes:
        annotators, reviewers: Names; nobody: every reviewer of the dataset may review, and nobody
            is asked to annotate.
        kind: ``groups`` or ``tracks``.
        groups, submitted, settled: How many there are (or tracks), wait for a verdict, and are done.
        last: When one of them was submitted or done last.
        here: Who has which group open.
    """

    id: int
    dataset_id: int
    dataset: str
    name: str
    kind: BatchKind
    query: str
    sort: str
    verdicts: int
    blind: bool
    gold_every: int | None
    due: str | None
    state: str
    created: str
    created_by: str
    annotators: list[str] = field(default_factory=list)
    reviewers: list[str] = field(default_factory=list)
    groups: int = 0
    submitted: int = 0
    settled: int = 0
    last: str | None = None
    here: list[Presence] = field(default_factory=list)

    @property
    def is_open(self) -> bool:
        """Whether there is still work to be had from it."""
        return self.state == OPEN

    @property
    def waiting(self) -> int:
        """Groups that are neither submitted nor judged."""
        return self.groups - self.submitted - self.settled


@dataclass(frozen=True)
class BatchGroup:
    """A group of a batch; ``here`` are the names of those who have it open.

    Attributes:
        number: Its place in the dataset.
        place: Its place in the batch, from 1.
        submitted_by: Also after it was returned to them: then ``submitted`` is None.
        here: Who has it open.
    """

    group: int
    number: int
    place: int
    submitted: Moment | None
    submitted_by: str | None
    settled: Moment | None
    here: list[str]


def list_batches(store: Store, dataset: str | int) -> list[Batch]:
    """The batches of a dataset: open ones and those that are due first come first."""
    with store.read() as session:
        return read_batches(session, [dataset_id(store, dataset)])


def get_batch(store: Store, batch_id: int) -> Batch:
    """A batch; raises NotFoundError when there is none."""
    with store.read() as session:
        return read_batch(session, batch_id)


def find_dataset_of_batch(store: Store, batch_id: int) -> int:
    """Id of the dataset of a batch; raises NotFoundError when there is no such batch."""
    with store.read_for_one_statement() as session:
        row = find_batch(session, batch_id)
    if row is None:
        raise NotFoundError(f"there is no batch {batch_id}")
    return int(row.dataset_id)


def list_batch_groups(store: Store, batch_id: int) -> list[BatchGroup]:
    """The groups of a batch in the order in which they are given out."""
    with store.read() as session:
        batch = read_batch(session, batch_id)
        here: dict[int, list[str]] = defaultdict(list)
        for one in batch.here:
            here[one.group].append(one.person)
        return [
            BatchGroup(
                row.group_id, row.number, row.place, row.submitted, row.submitted_by,
                row.settled, here[row.group_id],
            )
            for row in read_batch_groups(session, batch_id)
        ]  # fmt: skip


def make_batch(store: Store, dataset: str | int, new: NewBatch, *, actor: str) -> Batch:
    """Give out what a query finds now; what comes to match later is not part of it.

    Raises:
        InputError: The query cannot be understood or finds nothing, or somebody named may not.
        ConflictError: The dataset has as many batches as it may, or no gold group to mix in.
    """
    query = parse_query(new.query, longest=MAX_LISTED_LENGTH)
    _check_request(new)
    if new.tracks is not None:
        _check_track_batch(new)
    number = dataset_id(store, dataset)
    people = {
        BatchRole.ANNOTATOR: _person_ids(store, number, BatchRole.ANNOTATOR, new.annotators),
        BatchRole.REVIEWER: _person_ids(store, number, BatchRole.REVIEWER, new.reviewers),
    }
    with store.write() as session:
        if len(find_dataset_batches(session, [number])) >= MOST_BATCHES:
            raise ConflictError(
                f"a dataset has at most {MOST_BATCHES} batches", hint="Delete a closed batch first."
            )
        ids = _find_ids_to_assign(session, number, new, query)
        if new.gold_every is not None:
            _require_gold_groups(session, number)
        values = {
            "dataset_id": number,
            "name": new.name.strip(),
            "kind": GROUPS if new.tracks is None else TRACKS,
            "query": new.query.strip(),
            "sort": f"{query.sort}-desc" if query.descending else query.sort,
            "verdicts": new.verdicts,
            "blind": new.blind,
            "gold_every": new.gold_every,
            "due": None if new.due is None else new.due.isoformat(),
            "state": OPEN,
            "created": now(),
            "created_by": actor,
        }
        made = insert_batch(session, values)
        (insert_groups if new.tracks is None else insert_tracks)(session, made, ids)
        for part, chosen in people.items():
            set_batch_people(session, made, part, chosen)
        batch = read_batch(session, made)
        _log_change(session, batch, "made", actor)
        _notify_assigned_people(session, batch, (*batch.annotators, *batch.reviewers), actor)
        queue_messages_about_batch(session, made, GIVEN_OUT, actor=actor, at=batch.created)
        session.respond(batch)
        return batch


def _find_ids_to_assign(session: Session, dataset: int, new: NewBatch, query: Query) -> list[int]:
    """Ids of the groups or tracks that are given out."""
    if new.tracks is None:
        found = GroupListing(session, dataset, query.conditions).ids(query.order)
        given: Collection[int] = (
            list_groups_in_open_batches(session, dataset) if new.skip_given else set()
        )
    else:
        found = list(dict.fromkeys(new.tracks))
        known = {row.id for row in list_track_rows(session, dataset)}
        if strange := [one for one in found if one not in known]:
            raise InputError(
                f"track {strange[0]} does not belong to this dataset", pointer="/tracks"
            )
        given = list_batches_of_tracks(session, dataset) if new.skip_given else set()
    ids = [one for one in found if one not in given][: new.size or MOST_GROUPS]
    if not ids:
        raise _no_tracks_error(found) if new.tracks is not None else _no_groups_error(found)
    return ids


def change_batch(
    store: Store,
    batch_id: int,
    *,
    actor: str,
    name: str | None = None,
    due: date | None = None,
    never_due: bool = False,
    annotators: Sequence[str] | None = None,
    reviewers: Sequence[str] | None = None,
    state: str | None = None,
    gold_every: int | None = None,
    no_gold: bool = False,
) -> Batch:
    """Give a batch on to others, close or open it, or name it otherwise; None leaves as it is.

    Who has a part already keeps it, also where they could not get it any more. ``gold_every`` counts from the next group on that somebody begins, ``no_gold``: none is one.

    Raises:
        NotFoundError: There is none.
        InputError: Somebody newly named may not do that part, or gold groups would be too rare.
        ConflictError: The dataset has no gold group to mix in.
    """
    _check_gold_interval(gold_every)
    before = get_batch(store, batch_id)
    values: dict[str, Any] = {}
    if name is not None:
        values["name"] = strip_and_check_title(name, "a batch")
    if due is not None or never_due:
        values["due"] = None if due is None else due.isoformat()
    if state is not None:
        values["state"] = state
    if gold_every is not None or no_gold:
        values["gold_every"] = gold_every
    named = {BatchRole.ANNOTATOR: annotators, BatchRole.REVIEWER: reviewers}
    with store.read() as session:
        there = list_batch_people(session, [batch_id])
    people = {
        part: _person_ids(
            store,
            before.dataset_id,
            part,
            names,
            {one.name: one.id for one in there if one.part == part},
        )
        for part, names in named.items()
        if names is not None
    }
    with store.write() as session:
        closed = not read_batch(session, batch_id).is_open
        if gold_every not in (None, before.gold_every):
            _require_gold_groups(session, before.dataset_id)
        if values:
            update_batch(session, batch_id, values)
        if closed and state == OPEN and before.verdicts == 1:
            follow_verdicts_given_while_closed(session, batch_id, before.created)
        for part, chosen in people.items():
            set_batch_people(session, batch_id, part, chosen)
        batch = read_batch(session, batch_id)
        _log_change(session, batch, "closed" if state == CLOSED else "changed", actor)
        known = (*before.annotators, *before.reviewers)
        new = [name for name in (*batch.annotators, *batch.reviewers) if name not in known]
        _notify_assigned_people(session, batch, new, actor)
        if known != (*batch.annotators, *batch.reviewers):
            queue_messages_about_batch(session, batch_id, HANDED_ON, actor=actor, at=now())
        session.respond(batch)
        return batch


def remove_batch(store: Store, batch_id: int, *, actor: str) -> Batch:
    """Delete a batch; verdicts and edits of its groups stay. Returns what it was."""
    with store.write() as session:
        batch = read_batch(session, batch_id)
        delete_batch(session, batch_id)
        _log_change(session, batch, "deleted", actor)
        session.respond(batch)
        return batch


def read_batch(session: Session, batch_id: int, *, with_here: bool = True) -> Batch:
    """A batch within a session; raises NotFoundError when there is none.

    ``with_here``: False: nobody asks who has which group open.
    """
    row = find_batch(session, batch_id)
    if row is None:
        raise NotFoundError(f"there is no batch {batch_id}")
    return _build_batches(session, [row], with_here)[0]


def read_batches(session: Session, dataset_ids: Collection[int]) -> list[Batch]:
    """The batches of datasets within a session."""
    return _build_batches(session, find_dataset_batches(session, dataset_ids))


def _build_batches(
    session: Session, rows: Sequence[BatchRow], with_here: bool = True
) -> list[Batch]:
    ids = [row.id for row in rows]
    counts = count_work(session, ids)
    names: dict[tuple[int, str], list[str]] = defaultdict(list)
    for person in list_batch_people(session, ids):
        names[person.batch_id, person.part].append(person.name)
    here: dict[int, list[Presence]] = defaultdict(list)
    for lease in list_leases(session, ids, now()) if with_here else ():
        here[lease.batch_id].append(Presence(lease.group_id, lease.person, lease.taken, lease.seen))
    found = []
    for row in rows:
        count = counts.get(row.id)
        found.append(
            Batch(
                **row._asdict(),
                annotators=names[row.id, BatchRole.ANNOTATOR],
                reviewers=names[row.id, BatchRole.REVIEWER],
                # A dataset that begins again leaves a batch without groups.
                groups=count.groups if count else 0,
                submitted=count.submitted if count else 0,
                settled=count.settled if count else 0,
                last=count.last if count else None,
                here=here[row.id],
            )
        )
    return found


def _person_ids(
    store: Store,
    dataset: int,
    part: BatchRole,
    names: Iterable[str],
    kept: Mapping[str, int] | None = None,
) -> list[int]:
    """Ids of people who may do a part in a dataset; ``kept``, by name, are not asked whether they may."""
    wanted = {name.strip().lower() for name in names}
    if not wanted:
        return []
    members = list_members(store, dataset)
    able = {one.name: one.id for one in members if role_allows(one.role, _NEEDS[part])}
    able |= kept or {}
    missing = sorted(wanted - set(able))
    if missing and missing[0] not in {one.name for one in members}:
        raise InputError(
            f"{missing[0]} is disabled or has no account",
            hint="Enable or invite them first, or choose another person.",
            pointer=f"/{part}s",
        )
    if missing:
        raise InputError(
            f"{missing[0]} does not have the role {part} in this dataset",
            hint=f"Give them the role {part} first, or choose another person.",
            pointer=f"/{part}s",
        )
    return [able[name] for name in sorted(wanted)]


def _check_request(new: NewBatch) -> None:
    strip_and_check_title(new.name, "a batch")
    if not 1 <= new.verdicts <= MOST_VERDICTS:
        raise InputError(
            f"a batch needs 1 to {MOST_VERDICTS} verdicts on each group", pointer="/verdicts"
        )
    _check_gold_interval(new.gold_every)


def _check_track_batch(new: NewBatch) -> None:
    """Tracks are judged, each by one reviewer."""
    if new.annotators:
        raise InputError(
            "a batch of tracks has reviewers only, no annotators", pointer="/annotators"
        )
    if new.query or new.verdicts != 1 or new.gold_every is not None:
        raise InputError(
            "a batch of tracks cannot have a query or gold groups, and each of its tracks"
            " gets one verdict",
            hint="Send only the tracks, or leave out `tracks` to assign groups.",
            pointer="/tracks",
        )


def _check_gold_interval(every: int | None) -> None:
    if every is not None and not 1 <= every <= RAREST_GOLD:
        raise InputError(f"gold_every must be from 1 to {RAREST_GOLD}", pointer="/gold_every")


def _require_gold_groups(session: Session, dataset: int) -> None:
    """Raise ConflictError where a dataset has no gold group to mix in."""
    if not list_gold_heads(session, dataset):
        raise ConflictError(
            "no group of this dataset is a gold group",
            hint="Mark gold groups first, mark those of a sample or a frozen version, or create"
            " the batch without gold groups.",
        )


def _no_groups_error(found: Sequence[int]) -> InputError:
    if not found:
        return InputError("no group matches that query", pointer="/q")
    return InputError(
        "every group that matches is in an open batch already",
        hint="Assign them anyway, or choose other groups.",
        pointer="/q",
    )


def _no_tracks_error(found: Sequence[int]) -> InputError:
    if not found:
        return InputError("the list of tracks is empty", pointer="/tracks")
    return InputError(
        "every one of these tracks is in an open batch already",
        hint="Assign them anyway, or choose other tracks.",
        pointer="/tracks",
    )


def _notify_assigned_people(
    session: Session, batch: Batch, people: Iterable[str], actor: str
) -> None:
    """Tell people that work was given to them."""
    by = person_of_actor(actor)
    due = "" if batch.due is None else f", due {batch.due}"
    # Who is told how many groups it has counts how many gold ones are mixed in.
    groups = "groups" if batch.gold_every is not None else plural(batch.groups, batch.kind[:-1])
    sentence = f"{by} assigned you work: {batch.name}, {groups} of {batch.dataset}{due}"
    for name in dict.fromkeys(people):
        notify_person(
            session, name, NotificationKind.ASSIGNED, sentence,
            actor=actor, address="/work", dataset_id=batch.dataset_id,
        )  # fmt: skip


def _log_change(session: Session, batch: Batch, did: str, actor: str) -> None:
    """Write what became of a batch into the log."""
    body = {
        "batch": batch.id,
        "dataset": batch.dataset_id,
        "did": did,
        "name": batch.name,
        "groups": batch.groups,
        "annotators": batch.annotators,
        "reviewers": batch.reviewers,
    }
    append_entries(session, [NewLogEntry(WORK, actor, now(), body)])
