"""How far work is, how fast a team gets on, and batches that stall."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from enum import StrEnum
from itertools import pairwise
from typing import Any

from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.features.batches.leases import BatchMember
from app.features.batches.own_annotations import (
    count_own_groups_left,
    hide_others_progress,
    makes_own_annotations,
    with_own_counts,
)
from app.features.batches.queries import (
    NumberedBatchGroup,
    find_last_work_time,
    list_datasets_with_open_batches,
    list_returned_batch_groups,
    list_unfinished_batches,
    list_work_entries,
    read_batch_groups,
)
from app.features.batches.service import Batch, BatchRole, read_batch, read_batches
from app.features.datasets.service import dataset_id
from app.features.independent_annotations.queries import (
    list_annotations_of_batch,
    list_open_annotations,
)
from app.features.independent_annotations.service import ReturnedGroup, read_returned_groups
from app.features.people.visibility_queries import EVERYTHING, Visibility, hides_batch_groups
from app.features.webhooks.queries import (
    STALLED,
    list_active_webhooks,
    list_subscribed_webhooks,
    make_time_suffix,
    queue_webhook_messages,
)
from app.soccer.actors import person_of_actor

BY_ITSELF = "script:batches"
"""Who tells of it."""


class StallReason(StrEnum):
    """Why a batch has stalled."""

    IDLE = "idle"
    """The batch had no activity for ``stalled_hours`` (a setting)."""
    OVERDUE = "overdue"
    """Its due day is over, in UTC."""


@dataclass(frozen=True)
class BatchStall:
    """Since when a batch stands still, and why."""

    why: StallReason
    since: str


def find_last_activity(session: Session, batch: Batch) -> str:
    """When somebody did something in a batch last, opening a group included; else when it was made."""
    times = [batch.created, batch.last, find_last_work_time(session, batch.id)]
    times += [one.seen for one in batch.here]
    return max(time for time in times if time is not None)


def find_stall(batch: Batch, last: str, at: datetime, hours: float) -> BatchStall | None:
    """Whether a batch has stalled at a time; None: it has not, is done, or is closed.

    Args:
        batch: The batch.
        last: When somebody did something in it last.
        at: Now, in UTC.
        hours: So long may nobody do anything.
    """
    if not batch.is_open or batch.settled >= batch.groups:
        return None
    if at - datetime.fromisoformat(last) > timedelta(hours=hours):
        return BatchStall(StallReason.IDLE, last)
    if batch.due is not None and batch.due < at.date().isoformat():
        return BatchStall(StallReason.OVERDUE, batch.due)
    return None


def notify_of_stalled_batches(store: Store, at: datetime) -> int:
    """Tell webhooks of the batches that have stalled, of each stall once; returns how many messages."""
    with store.read() as session:
        wanted = {row.dataset_id for row in list_active_webhooks(session)}
        datasets = [
            one for one in sorted(wanted) if list_subscribed_webhooks(session, one, STALLED)
        ]
        found = _find_stalled_batches(session, datasets, at, store.settings.stalled_hours)
    if not found:
        return 0
    with store.write() as session:
        return sum(_notify_of_stall(session, batch, stall, at) for batch, stall in found)


def _find_stalled_batches(
    session: Session, datasets: list[int], at: datetime, hours: float
) -> list[tuple[Batch, BatchStall]]:
    batches = [read_batch(session, one) for one in list_unfinished_batches(session, datasets)]
    found = [(one, find_stall(one, find_last_activity(session, one), at, hours)) for one in batches]
    return [(batch, stall) for batch, stall in found if stall is not None]


def _notify_of_stall(session: Session, batch: Batch, stall: BatchStall, at: datetime) -> int:
    event = f"batch{batch.id}_{stall.why}{make_time_suffix(stall.since)}"
    details = {"why": str(stall.why), "since": stall.since}
    return queue_webhook_messages(
        session,
        batch.dataset_id,
        STALLED,
        event,
        actor=BY_ITSELF,
        at=format_utc_time(at),
        batch_id=batch.id,
        also=details,
    )


PAUSE = timedelta(minutes=10)
"""Who does nothing for longer is taken not to work meanwhile."""


@dataclass(frozen=True)
class MyBatch:
    """A batch of somebody's: ``left`` groups wait for them or for others beside them, and
    ``returned`` are those that they had submitted and have back. ``hides_groups``: they annotate copies
    of its groups, which are hidden from them."""

    batch: Batch
    parts: list[BatchRole]
    left: int
    returned: list[ReturnedGroup] = field(default_factory=list)
    hides_groups: bool = False


@dataclass(frozen=True)
class WorkPace:
    """What somebody has done in a batch.

    Attributes:
        submitted, judged: Groups.
        minutes: How long they worked: the time between any two things that they did, pauses left out.
    """

    name: str
    submitted: int
    judged: int
    groups: int
    minutes: float

    @property
    def minutes_a_group(self) -> float | None:
        """None where it cannot be known: what they did took less than a minute."""
        return self.minutes / self.groups if self.groups and self.minutes >= 1 else None

    @property
    def groups_an_hour(self) -> float | None:
        """The same the other way round."""
        return 60 * self.groups / self.minutes if self.groups and self.minutes >= 1 else None


@dataclass(frozen=True)
class TeamBatch:
    """A batch and who has done what of it; ``stalled``: since when nobody does anything, or None."""

    batch: Batch
    stalled: str | None
    people: list[WorkPace] = field(default_factory=list)


def list_own_batches(
    store: Store, worker_in: Callable[[int], BatchMember], visibility: Visibility = EVERYTHING
) -> list[MyBatch]:
    """Open batches that are somebody's, those that are due first, first.

    Args:
        store: The database.
        worker_in: What somebody is in a dataset, by its id.
        visibility: Which datasets they see.
    """
    with store.read() as session:
        ids = [one for one in list_datasets_with_open_batches(session) if visibility.sees(one)]
        found = []
        for batch in read_batches(session, ids):
            worker = worker_in(batch.dataset_id)
            parts = worker.roles_in_batch(batch)
            if batch.is_open and parts:
                own = makes_own_annotations(batch, parts)
                left = (
                    count_own_groups_left(session, batch, worker.name)
                    if own
                    else _count_groups_left(hide_others_progress(session, batch), parts)
                )
                back = _list_returned_groups(session, batch, worker.name)
                seen = with_own_counts(session, batch, worker.name) if own else batch
                found.append(
                    MyBatch(
                        hide_others_progress(session, seen),
                        sorted(parts),
                        left,
                        back,
                        hides_batch_groups(batch.dataset_id, batch.id),
                    )
                )
        return found


def _list_returned_groups(session: Session, batch: Batch, name: str) -> list[ReturnedGroup]:
    """What of a batch somebody has back, in its order."""
    person = person_of_actor(name)
    waiting = [row.group_id for row in list_returned_batch_groups(session, [batch.id], person)]
    waiting += [copy.group_id for copy in list_open_annotations(session, [batch.id], person)]
    back = read_returned_groups(session, waiting) if waiting else {}
    return [back[group] for group in waiting if group in back]


def list_team_batches(
    store: Store, dataset: str | int, *, at: datetime | None = None
) -> list[TeamBatch]:
    """Every batch of a dataset with who has done what of it."""
    moment = datetime.now(UTC) if at is None else at
    with store.read() as session:
        batches = read_batches(session, [dataset_id(store, dataset)])
        hours = store.settings.stalled_hours
        return [_build_team_batch(session, batch, moment, hours) for batch in batches]


def _count_groups_left(batch: Batch, parts: Iterable[BatchRole]) -> int:
    """Groups that somebody with these parts may still get."""
    left = batch.waiting if BatchRole.ANNOTATOR in parts or not batch.annotators else 0
    return left + (batch.submitted if BatchRole.REVIEWER in parts else 0)


def _build_team_batch(session: Session, batch: Batch, at: datetime, hours: float) -> TeamBatch:
    stall = find_stall(batch, find_last_activity(session, batch), at, hours)
    since = stall.since if stall is not None and stall.why is StallReason.IDLE else None
    entries = list_work_entries(session, batch.id, batch.created)
    annotations = list_annotations_of_batch(session, batch.id, batch.dataset_id)
    return TeamBatch(
        batch, since, _measure_paces(entries, read_batch_groups(session, batch.id), annotations)
    )


def _measure_paces(
    entries: Sequence[Any], groups: Sequence[NumberedBatchGroup], annotations: Sequence[Any]
) -> list[WorkPace]:
    """What each person did, from the log and from what was submitted; of groups, and of own copies.

    What stands in the original under the name of somebody who has a copy was taken over from it: it
    says nothing of when they worked.
    """
    times: dict[str, list[str]] = defaultdict(list)
    judged: dict[str, set[int]] = defaultdict(set)
    submitted: dict[str, set[int]] = defaultdict(set)
    taken_over = {(annotation.person, annotation.group_id) for annotation in annotations}
    for row in entries:
        name = person_of_actor(row.actor)
        if (name, row.group_id) in taken_over:
            continue
        times[name].append(row.at)
        if row.kind == "verdict":
            judged[name].add(row.group_id)
    given: list[tuple[str | None, int, str | None]] = [
        (row.submitted_by, row.group_id, row.submitted) for row in groups
    ]
    given += [
        (annotation.person, annotation.copy_id, annotation.submitted) for annotation in annotations
    ]
    for worker, group, at in given:
        if worker is not None and at is not None:
            submitted[worker].add(group)
            times[worker].append(at)
    return [_measure_pace(name, times[name], judged, submitted) for name in sorted(times)]


def _measure_pace(
    name: str,
    times: Iterable[str],
    judged: Mapping[str, set[int]],
    submitted: Mapping[str, set[int]],
) -> WorkPace:
    done, given = judged.get(name, set()), submitted.get(name, set())
    return WorkPace(
        name, len(given), len(done), len(done | given), sum_working_time(times).total_seconds() / 60
    )


def sum_working_time(times: Iterable[str]) -> timedelta:
    """How long somebody worked who did something at these times: the time between each two that
    follow each other, where that is no longer than ``PAUSE``.

    Example:
        >>> day = "2026-11-20T"
        >>> str(sum_working_time([day + "10:00", day + "10:04", day + "12:00", day + "12:06"]))
        '0:10:00'
    """
    found = sorted(datetime.fromisoformat(one) for one in times)
    gaps = (later - earlier for earlier, later in pairwise(found))
    return sum((gap for gap in gaps if gap <= PAUSE), timedelta())
