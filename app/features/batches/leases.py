"""Leases: who has which group of a batch open, so that two people never meet by accident.

A lease is a courtesy: what somebody says of a group is guarded by ``If-Match``, with or without one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Any

from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, HeldGroupError, NotFoundError
from app.features.batches.own_annotations import (
    begin_next_own_annotation,
    count_own_groups,
    find_own_annotation,
    hide_others_progress,
    list_returned_groups,
    makes_own_annotations,
    submit_own_annotation,
)
from app.features.batches.queries import (
    WaitingGroup,
    delete_ended_leases,
    end_leases,
    end_person_lease,
    find_batch_group,
    find_next_waiting_group,
    list_group_leases,
    save_lease,
    set_group_submission,
)
from app.features.batches.service import WORK, Batch, BatchRole, Presence, read_batch
from app.features.independent_annotations.adopt import log_and_notify_return, strip_and_check_reason
from app.features.independent_annotations.queries import IndependentAnnotation
from app.features.independent_annotations.service import (
    ReturnedGroup,
    read_returned_groups,
    require_reach,
)
from app.features.people.visibility_queries import (
    READER,
    has_hidden_groups,
    is_hidden_from_reader,
)

LASTS = timedelta(minutes=3)
"""A lease whose page says nothing ends after this."""


@dataclass(frozen=True)
class BatchMember:
    """A person who works on a batch.

    Attributes:
        name: As in the log.
        may_annotate, may_review, leads: What their role allows in the dataset.
        alone: Nobody has an account here: they are everybody.
        reaches_copies: Whether they may open copies: a token for one dataset may not.
    """

    name: str
    may_annotate: bool = True
    may_review: bool = True
    alone: bool = False
    leads: bool = False
    reaches_copies: bool = True

    def roles_in_batch(self, batch: Batch) -> set[BatchRole]:
        """The roles of the person in a batch."""
        parts = set()
        if self.name in batch.annotators and self.may_annotate:
            parts.add(BatchRole.ANNOTATOR)
        named = self.name in batch.reviewers or not batch.reviewers or self.alone
        if named and self.may_review:
            parts.add(BatchRole.REVIEWER)
        return parts


@dataclass(frozen=True)
class Lease:
    """A group that somebody has open, and who else has.

    Attributes:
        group: Its id; None: there is none left for them now.
        part: What they do with it.
        until: When it ends unless it is kept.
        here: People who have the group open.
        submitted_by: Who has submitted it; None: nobody.
        returned: Why it was returned to its annotator; None: it was not, or is submitted again.
        place: Of the groups that they annotate on their own: which this is, from 1; None otherwise.
        of: How many these are as the batch stands; None where gold groups are among them, for a
            count that stays would tell them.
    """

    batch: Batch
    group: int | None
    part: BatchRole | None = None
    until: str | None = None
    here: tuple[Presence, ...] = ()
    submitted_by: str | None = None
    returned: ReturnedGroup | None = None
    place: int | None = None
    of: int | None = None


class LeaseService:
    """Everything that is asked of leases.

    Args:
        store: Where they are.
        clock: Says what time it is, in UTC.
    """

    def __init__(self, store: Store, clock: Callable[[], datetime] = lambda: datetime.now(UTC)):
        self._store, self._clock = store, clock

    def lease_next_group(
        self, batch_id: int, worker: BatchMember, *, after: int | None = None
    ) -> Lease:
        """Take a lease on the next group that waits for somebody, and that nobody has open.

        Args:
            batch_id: The batch.
            worker: Who asks.
            after: Id of the group that they come from, which they do not get again.

        Raises:
            NotFoundError: There is no such batch.
            ConflictError: It is given to others, or closed.
            ForbiddenError: They would get a copy, which their token does not reach.
        """
        with self._store.write(lasting=False) as session:
            batch = _read_open_batch(session, batch_id)
            if not makes_own_annotations(batch, worker.roles_in_batch(batch)):
                return self._lease_next_shared_group(session, batch, worker, after)
            require_reach(worker.reaches_copies)
            back = list_returned_groups(session, batch, worker.name)
            mine = next((group for group in back if group != after), None)
            if mine is not None:
                row = _require_batch_group(session, batch, mine)
                return self._renew_lease(session, batch, row, BatchRole.ANNOTATOR, worker)
        annotation = begin_next_own_annotation(self._store, batch, worker.name)
        if annotation is None:
            return Lease(batch, None, BatchRole.ANNOTATOR)
        with self._store.read() as session:
            return _make_lease_of_copy(session, batch, annotation, worker)

    def _lease_next_shared_group(
        self, session: Session, batch: Batch, worker: BatchMember, after: int | None
    ) -> Lease:
        at = self._current_time_text()
        delete_ended_leases(session, at)
        found = find_next_group_to_lease(session, batch, worker, at, after=after)
        if found is None:
            return Lease(batch, None)
        row, part = found
        return self._renew_lease(session, batch, row, part, worker)

    def lease_group(
        self, batch_id: int, group: int, worker: BatchMember, *, take_over: bool = False
    ) -> Lease:
        """Take a lease on a group, or let the one last on that they have.

        Args:
            batch_id: The batch.
            group: The group.
            worker: Who asks.
            take_over: End the leases of others.

        Raises:
            NotFoundError: There is no such batch, or it has no such group.
            HeldGroupError: Somebody else has the group open.
            ForbiddenError: It is a copy, which their token does not reach; so does ``submit_group``.
            ConflictError: The batch is closed or given to others.
        """
        with self._store.write(lasting=False) as session:
            batch = _read_open_batch(session, batch_id)
            own = find_own_annotation(session, batch, group, worker.name)
            if own is not None:
                require_reach(worker.reaches_copies)
                return _make_lease_of_copy(session, batch, own, worker)
            _require_group_access(session, batch, group)
            parts, row = (
                _require_batch_roles(batch, worker),
                _require_batch_group(session, batch, group),
            )
            others = _list_blocking_leases(session, batch, group, worker, self._current_time_text())
            if others and not take_over:
                here = _read_presences(session, batch, group, self._current_time_text())
                raise HeldGroupError(f"{others[0].person} has this group open", here)
            end_leases(session, [row.id for row in others])
            return self._renew_lease(session, batch, row, _choose_batch_role(parts, row), worker)

    def release_group(self, batch_id: int, group: int, worker: BatchMember) -> Lease:
        """End a lease; it does not matter whether there is one.

        Raises:
            NotFoundError: There is no such batch.
        """
        with self._store.write(lasting=False) as session:
            batch = hide_others_progress(session, read_batch(session, batch_id, with_here=False))
            end_person_lease(session, batch_id, group, worker.name)
            if find_own_annotation(session, batch, group, worker.name) is None and (
                find_batch_group(session, batch_id, group) is None
                or _is_hidden_from_reader(session, batch, group)
            ):
                return Lease(batch, None)
            return Lease(
                batch, group, here=_read_presences(session, batch, group, self._current_time_text())
            )

    def submit_group(
        self, batch_id: int, group: int, worker: BatchMember, *, actor: str, done: bool = True
    ) -> Lease:
        """Say that the annotation of a group is done, so that a reviewer gets it; or that it is not.

        Raises:
            NotFoundError: There is no such batch, or it has no such group.
            ConflictError: They are not one of its annotators, somebody else has submitted it, it has a
                verdict, or the batch is closed.
        """
        with self._store.read() as session:
            batch = _read_open_batch(session, batch_id)
            own = find_own_annotation(session, batch, group, worker.name)
        if own is not None:
            require_reach(worker.reaches_copies)
            lease = Lease(batch, group)
            with self._store.write() as session:
                submit_own_annotation(session, own, actor=actor, done=done)
                session.respond(lease)
            return lease
        with self._store.write() as session:
            batch = _read_open_batch(session, batch_id)
            _require_group_access(session, batch, group)
            row = _require_batch_group(session, batch, group)
            if BatchRole.ANNOTATOR not in worker.roles_in_batch(batch):
                raise ConflictError(f'you are not an annotator of the batch "{batch.name}"')
            if row.settled is not None:
                raise ConflictError(
                    "this group already has a verdict", hint="Continue with the next group."
                )
            if row.submitted is not None and row.submitted_by != worker.name:
                raise ConflictError(
                    f"{row.submitted_by} has submitted this group",
                    hint="Continue with the next group.",
                )
            set_group_submission(
                session,
                batch_id,
                group,
                at=self._current_time_text() if done else None,
                by=worker.name,
            )
            did = "handed in" if done else "taken back"
            body = {"batch": batch.id, "dataset": batch.dataset_id, "did": did, "group": group}
            append_entries(session, [NewLogEntry(WORK, actor, self._current_time_text(), body)])
            return self._end_lease(session, batch_id, group, worker)

    def return_group(
        self, batch_id: int, group: int, worker: BatchMember, reason: str = "", *, actor: str
    ) -> Lease:
        """Give a group that was submitted back to who did, and tell them why; they get it next.

        Raises:
            NotFoundError: There is no such batch, or it has no such group.
            ConflictError: They neither review the batch nor lead, it is not submitted, its work is
                over, or the batch is closed.
            InputError: The sentence is too long.
        """
        checked = strip_and_check_reason(reason)
        with self._store.write() as session:
            batch = _read_open_batch(session, batch_id)
            _require_group_access(session, batch, group)
            row = _require_batch_group(session, batch, group)
            if not worker.leads and BatchRole.REVIEWER not in worker.roles_in_batch(batch):
                raise ConflictError(
                    f'you are not a reviewer of the batch "{batch.name}"',
                    hint="A reviewer of the batch or a lead can return the group.",
                )
            if row.settled is not None:
                raise ConflictError(
                    "this group already has a verdict", hint="Undo the verdict first."
                )
            if row.submitted is None:
                raise ConflictError("this group is not submitted")
            person = row.submitted_by
            set_group_submission(session, batch_id, group, at=None, by=person, returned=True)
            log_and_notify_return(
                session, WORK, group, person, checked, actor=actor, batch=batch_id
            )
            return self._end_lease(session, batch_id, group, worker)

    def _end_lease(self, session: Session, batch_id: int, group: int, worker: BatchMember) -> Lease:
        """The response once somebody's lease has ended with what they said of the group."""
        end_person_lease(session, batch_id, group, worker.name)
        batch = hide_others_progress(session, read_batch(session, batch_id))
        lease = Lease(
            batch, group, here=_read_presences(session, batch, group, self._current_time_text())
        )
        session.respond(lease)
        return lease

    def _renew_lease(
        self,
        session: Session,
        batch: Batch,
        row: WaitingGroup,
        part: BatchRole,
        worker: BatchMember,
    ) -> Lease:
        at, group = self._clock(), row.group_id
        until = format_utc_time(at + LASTS)
        save_lease(session, batch.id, group, worker.name, at=format_utc_time(at), until=until)
        here = _read_presences(session, batch, group, format_utc_time(at))
        if row.submitted_by is None:
            return Lease(batch, group, part, until, here)
        if row.submitted is not None:
            return Lease(batch, group, part, until, here, row.submitted_by)
        # Who submitted it has it back; their name stays with it.
        back = read_returned_groups(session, [group]).get(group)
        return Lease(batch, group, part, until, here, returned=back)

    def _current_time_text(self) -> str:
        return format_utc_time(self._clock())


def find_next_group_to_lease(
    session: Session, batch: Batch, worker: BatchMember, at: str, *, after: int | None = None
) -> tuple[Any, BatchRole] | None:
    """The row of the group that somebody gets next of a batch, and what they do with it.

    The one function that decides it, where nobody works on copies of their own. It is called in a
    write session, in which the lease on what it returns is taken, so that nobody else is given the
    same meanwhile.

    Args:
        session: A write session.
        batch: The batch, open.
        worker: Who asks.
        at: Now; leases that end before no longer count.
        after: Id of the group that they come from: never that one, those behind it first, and what
            else they have open last. None: where they have a group open, that one.

    Returns:
        None where there is none for them now.

    Raises:
        ConflictError: The batch is given to others.
    """
    parts = _require_batch_roles(batch, worker)
    row = None if after is None else find_batch_group(session, batch.id, after)
    place = 0 if row is None else int(row.place)
    for part in (BatchRole.ANNOTATOR, BatchRole.REVIEWER):
        if part not in parts:
            continue
        # Where nobody annotates, a reviewer gets everything that waits.
        submitted = (part is BatchRole.REVIEWER) if batch.annotators else None
        found = find_next_waiting_group(
            session, batch.id, batch.dataset_id, worker.name, at, submitted=submitted, after=place
        )
        if found is not None:
            return found, part
    return None


def _make_lease_of_copy(
    session: Session, batch: Batch, annotation: IndependentAnnotation, worker: BatchMember
) -> Lease:
    """Of a copy, which nobody else can have open."""
    of = count_own_groups(session, batch, worker.name)
    return Lease(batch, annotation.copy_id, BatchRole.ANNOTATOR, place=annotation.place, of=of)


def _list_blocking_leases(
    session: Session, batch: Batch, group: int, worker: BatchMember, at: str
) -> list[Any]:
    """The leases of others that stand in somebody's way; none where each has a copy of their own."""
    if batch.verdicts > 1:
        return []
    return [row for row in list_group_leases(session, group, at) if row.person != worker.name]


def _read_presences(session: Session, batch: Batch, group: int, at: str) -> tuple[Presence, ...]:
    return tuple(
        Presence(group, row.person, row.taken, row.seen)
        for row in list_group_leases(session, group, at)
        if row.batch_id == batch.id or batch.verdicts == 1
    )


def _read_open_batch(session: Session, batch_id: int) -> Batch:
    batch = read_batch(session, batch_id, with_here=False)
    if not batch.is_open:
        raise ConflictError(f'the batch "{batch.name}" is closed')
    return hide_others_progress(session, batch)


def _require_batch_roles(batch: Batch, worker: BatchMember) -> set[BatchRole]:
    parts = worker.roles_in_batch(batch)
    if not parts:
        raise ConflictError(
            f'the batch "{batch.name}" is assigned to other people',
            hint="A lead can assign it to you.",
        )
    return parts


def _choose_batch_role(parts: set[BatchRole], row: WaitingGroup) -> BatchRole:
    """What somebody with these parts does with a group of a batch, as far as it is by now."""
    if BatchRole.ANNOTATOR in parts and (row.submitted is None or BatchRole.REVIEWER not in parts):
        return BatchRole.ANNOTATOR
    return BatchRole.REVIEWER


def _require_group_access(session: Session, batch: Batch, group: int) -> None:
    """Who works on copies that tell nothing of their originals opens these by no batch.

    Raises:
        NotFoundError: As of a group that is not in it.
    """
    if _is_hidden_from_reader(session, batch, group):
        raise _make_group_not_found_error(batch, group)


def _is_hidden_from_reader(session: Session, batch: Batch, group: int) -> bool:
    reader = READER.get()
    if reader is None or not has_hidden_groups(batch.dataset_id):
        return False
    return is_hidden_from_reader(session, reader, batch.dataset_id, group=group)


def _make_group_not_found_error(batch: Batch, group: int) -> NotFoundError:
    return NotFoundError(f'the batch "{batch.name}" has no group {group}')


def _require_batch_group(session: Session, batch: Batch, group: int) -> Any:
    row = find_batch_group(session, batch.id, group)
    if row is None:
        raise _make_group_not_found_error(batch, group)
    return row
