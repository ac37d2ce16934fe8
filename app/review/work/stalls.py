"""Stalls: batches that are not done and in which nobody does anything any more, or whose day is over."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime, timedelta
from enum import StrEnum

from app.review.work.batches import Batch, read_batch
from app.store.clock import text_of
from app.store.session import Session
from app.store.store import Store
from app.store.webhook_outbox import STALLED, announce, listeners, stamp
from app.store.webhooks import webhooks_on
from app.store.work import batches_that_wait, last_work

BY_ITSELF = "script:batches"
"""Who tells of it."""


class Why(StrEnum):
    """Why a batch has stalled."""

    IDLE = "idle"
    """Nobody did anything in it for as long as the setting ``stalled_hours`` says."""
    OVERDUE = "overdue"
    """Its due day is over, in UTC."""


@dataclass(frozen=True)
class Stall:
    """Since when a batch stands still, and why."""

    why: Why
    since: str


def last_of(session: Session, batch: Batch) -> str:
    """When somebody did something in a batch last, opening a group included; else when it was made."""
    times = [batch.created, batch.last, last_work(session, batch.id)]
    times += [one.seen for one in batch.here]
    return max(time for time in times if time is not None)


def stall_of(batch: Batch, last: str, at: datetime, hours: float) -> Stall | None:
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
        return Stall(Why.IDLE, last)
    if batch.due is not None and batch.due < at.date().isoformat():
        return Stall(Why.OVERDUE, batch.due)
    return None


def tell_stalls(store: Store, at: datetime) -> int:
    """Tell webhooks of the batches that have stalled, of each stall once; returns how many messages."""
    with store.read() as session:
        wanted = {row.dataset_id for row in webhooks_on(session)}
        datasets = [one for one in sorted(wanted) if listeners(session, one, STALLED)]
        found = _stalls(session, datasets, at, store.settings.stalled_hours)
    if not found:
        return 0
    with store.write() as session:
        return sum(_tell(session, batch, stall, at) for batch, stall in found)


def _stalls(
    session: Session, datasets: list[int], at: datetime, hours: float
) -> list[tuple[Batch, Stall]]:
    batches = [read_batch(session, one) for one in batches_that_wait(session, datasets)]
    found = [(one, stall_of(one, last_of(session, one), at, hours)) for one in batches]
    return [(batch, stall) for batch, stall in found if stall is not None]


def _tell(session: Session, batch: Batch, stall: Stall, at: datetime) -> int:
    event = f"batch{batch.id}_{stall.why}{stamp(stall.since)}"
    told = {"why": str(stall.why), "since": stall.since}
    return announce(
        session,
        batch.dataset_id,
        STALLED,
        event,
        actor=BY_ITSELF,
        at=text_of(at),
        batch_id=batch.id,
        also=told,
    )
