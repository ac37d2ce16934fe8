"""Events: what changed, told to every browser that listens.

A thread of its own looks at the log while somebody listens, so that no request waits for it: when
this process has committed, and from time to time for what others have. Each listener has a bounded
queue: one that does not keep up is let go, comes back with the last id that it saw, and misses
nothing.
"""

from __future__ import annotations

import asyncio
import functools
import re
import threading
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from time import monotonic

import structlog
from fastapi.sse import KEEPALIVE_COMMENT, format_sse_event
from pydantic import BaseModel, Field

from app.db.store import Store
from app.errors import OverloadedError, StorageError
from app.features.batches.leases import Lease
from app.features.jobs.queries import Job
from app.features.jobs.schemas import JobDocument
from app.features.jobs.service import Jobs
from app.features.maintenance.service import Banner, read_banner
from app.features.people.visibility_queries import EVERYTHING, Visibility
from app.features.queue.changes import (
    LoggedChange,
    find_newest_entry_and_solution_ids,
    read_new_changes,
)
from app.http.documents import encode_document
from app.http.problem import GroupViewerDocument

log = structlog.get_logger("touchline.events")
PAUSE = 0.05
"""Seconds between two looks at the log while commits follow each other."""
POLL = 2.0
"""Seconds until the log is looked at for what other processes have committed and not told."""
MAX_FEEDS = 100
"""Listeners at a time; a browser has one a window."""
MAX_FEEDS_OF_ONE = 20
"""Listeners of one person at a time: nobody takes the places of all others."""
MAX_WAITING = 1000
"""Events that a listener may be behind."""
_WORK = "work"
"""How what processes tell each other of a lease begins."""
RETRY_MS = 1000
"""How long a browser waits before it comes back."""
PING_SECONDS = 15.0
"""Between two words to a listener whom there is nothing to tell, lest a proxy thinks it gone."""
_ID = re.compile(rb"^id: \d+-\d+$", re.MULTILINE)
"""How an event says its id."""


class GroupEvent(BaseModel):
    """A group has changed; whoever shows it under another ETag reads it again."""

    group: int
    dataset: str | None
    etag: str | None
    kind: str = Field(
        description="What happened: a kind as in the history of the group, or `solved`."
    )
    actor: str | None


class DatasetEvent(BaseModel):
    """A dataset as a whole has changed: its policy, its groups, or whether it exists."""

    dataset: str | None = Field(description="Name of the dataset; null when it is deleted.")
    kind: str
    actor: str | None


class AssignedGroupEvent(BaseModel):
    """A group of a batch was opened, left, taken over or handed in."""

    batch: int
    group: int
    dataset: str | None
    here: list[GroupViewerDocument] = Field(description="People who have the group open now.")


class MaintenanceEvent(BaseModel):
    """The maintenance notice was changed or removed."""

    banner: Banner | None = Field(description="Null: it was removed.")


EVENTS: dict[str, type[BaseModel]] = {
    "group": GroupEvent,
    "dataset": DatasetEvent,
    "job": JobDocument,
    "work": AssignedGroupEvent,
    "maintenance": MaintenanceEvent,
}
"""What the data of each kind of event is."""


@dataclass
class ListenerCounts:
    """Listeners since the server started; ``resumed`` ones came back with the last id they saw."""

    open: int = 0
    opened: int = 0
    resumed: int = 0
    lost: int = 0


class EventListener:
    """One listener: what it has not been told yet.

    Args:
        dataset_id: Tell of this dataset alone; None: of all.
        position: Id of the log entry up to which it knows everything.
        visibility: What its reader sees.
        solution: Id of the solution up to which it knows everything.
        began: Id of the newest log entry when it began to listen.
        numbered: Its events have the ids of log entries and solutions; else they all have 0.
        person: Who listens; None: on a server without accounts.

    Attributes:
        lost: It did not keep up and was let go.
        told: When it was told something last, by the monotonic clock.
        loop: The event loop on which it is read.
    """

    def __init__(
        self,
        dataset_id: int | None,
        position: int,
        solution: int,
        visibility: Visibility,
        began: int,
        numbered: bool = True,
        person: str | None = None,
    ):
        self.person = person
        self.dataset_id, self.position, self._numbered = dataset_id, position, numbered
        self.solution = solution
        self._sight, self._began = visibility, began
        self.lost, self.told = False, monotonic()
        self._events: list[bytes] = []
        self.loop = asyncio.get_running_loop()
        self._ready, self._ended = asyncio.Event(), False

    def wants(self, dataset_id: int | None, actor: str | None = None) -> bool:
        """Whether what happens in a dataset (None: in none, by somebody) is told here."""
        meant = self.dataset_id is None or dataset_id in (None, self.dataset_id)
        return meant and self._sight.sees(dataset_id, actor)

    def listens_to_change(self, change: LoggedChange) -> bool:
        """Whether a change is told here.

        Who saw a dataset that was gone before this one listened, nobody knows any more.
        """
        gone = change.dataset is None and (change.id or 0) <= self._began
        return self.wants(change.dataset_id) and (not gone or self._sight == EVERYTHING)

    def take(self, events: list[bytes], *, ended: bool = False) -> None:
        """Have something to tell, and nothing more where it has ended; on the event loop."""
        self.lost = self.lost or len(self._events) + len(events) > MAX_WAITING
        self._ended = self._ended or ended or self.lost
        if not self._ended:
            plain = events if self._numbered else [_ID.sub(b"id: 0", event) for event in events]
            self._events.extend(plain)
        self.told = monotonic()
        self._ready.set()

    async def read(self) -> AsyncIterator[bytes]:
        """Events as they come, those that came together at once, until the feed ends."""
        while not self._ended or self._events:
            await self._ready.wait()
            self._ready.clear()
            events, self._events = self._events, []
            if events:
                yield b"".join(events)


class EventPublisher:
    """All listeners of one server, and the thread that looks at the log for them."""

    def __init__(self, store: Store, jobs: Jobs):
        self._store, self._jobs = store, jobs
        self._feeds: set[EventListener] = set()
        self._lock = threading.Lock()
        self._wake, self._closing = threading.Event(), threading.Event()
        self._thread: threading.Thread | None = None
        self._banner: Banner | None = None
        self._counts = ListenerCounts()
        jobs.listen(self._publish_job)
        store.listen(self._wake.set)
        store.sharing.subscribe(self._receive_lease)

    def read_position(self) -> tuple[int, int]:
        """Ids of the newest entry of the log and of the newest solution."""
        return find_newest_entry_and_solution_ids(self._store)

    def read_resume_token(self) -> str:
        """How things stand, as a page that begins to read them tells the stream later on."""
        return "-".join(map(str, self.read_position()))

    def read_banner_json(self) -> str:
        """The notice of maintenance as JSON; empty: there is none."""
        banner = read_banner(self._store)
        return "" if banner is None else encode_document(banner).decode()

    @property
    def counts(self) -> ListenerCounts:
        """Listeners since the start."""
        with self._lock:
            return replace(self._counts, open=len(self._feeds))

    def require_free_slot(self, person: str | None = None) -> None:
        """Raise OverloadedError where as many listen as may, or the server stops."""
        with self._lock:
            self._require_free_slot(person)

    def _require_free_slot(self, person: str | None) -> None:
        if len(self._feeds) >= MAX_FEEDS or self._closing.is_set():
            raise OverloadedError("too many browser windows and scripts listen for events")
        own = sum(feed.person == person for feed in self._feeds)
        if person is not None and own >= MAX_FEEDS_OF_ONE:
            raise OverloadedError(
                f"{own} of your browser windows and scripts listen for events",
                hint="Close some of them.",
            )

    def subscribe(self, feed: EventListener, *, resumed: bool = False) -> None:
        """Let somebody listen, or (``resumed``) go on where an earlier stream ended.

        Raises:
            OverloadedError: Too many listen, or the server stops.
        """
        with self._lock:
            self._require_free_slot(feed.person)
            self._feeds.add(feed)
            self._counts.opened += 1
            self._counts.resumed += resumed
            if self._thread is None:
                self._thread = threading.Thread(
                    target=self._publish_until_closed, name="events", daemon=True
                )
                self._thread.start()
        self._wake.set()

    def unsubscribe(self, feed: EventListener) -> None:
        """Stop listening."""
        with self._lock:
            self._feeds.discard(feed)
            self._counts.lost += feed.lost

    def list_open_job_events(self, dataset_id: int | None, visibility: Visibility) -> list[bytes]:
        """Jobs that are under way, for whoever begins to listen."""
        return [_job_event(job) for job in self._jobs.open_jobs(dataset_id, visibility)]

    def close(self) -> None:
        """End every feed, so that the server can stop; may be called twice."""
        self._closing.set()
        self._wake.set()
        _deliver_events({feed: [] for feed in self._list_listeners()}, ended=True)
        thread = self._thread
        if thread is not None and thread is not threading.current_thread():
            thread.join(5)

    def _list_listeners(self) -> list[EventListener]:
        with self._lock:
            return list(self._feeds)

    def _publish_until_closed(self) -> None:
        awake = False
        while not self._closing.is_set():
            if feeds := self._list_listeners():
                try:
                    self._publish_changes(feeds, first=not awake)
                    awake = True
                except StorageError as error:
                    log.warning("the log could not be read", error=str(error))
                except Exception:
                    log.exception("events could not be sent")
                idle = monotonic() - PING_SECONDS
                _deliver_events({feed: [KEEPALIVE_COMMENT] for feed in feeds if feed.told < idle})
                self._closing.wait(PAUSE)
            else:
                awake = False
            self._wake.wait(POLL if feeds else None)
            self._wake.clear()

    def _publish_changes(self, feeds: list[EventListener], *, first: bool) -> None:
        """Tell each listener what has happened since it was told last."""
        self._publish_banner_change(feeds, first=first)
        news = read_new_changes(self._store, {(feed.position, feed.solution) for feed in feeds})
        written = functools.cache(_change_event)
        queued: dict[EventListener, list[bytes]] = {}
        for feed in feeds:
            place = feed.position, feed.solution
            found = [*news.changes.get(feed.position, []), *news.solved.get(place, [])]
            wanted = [item for item in found if feed.listens_to_change(item)]
            # Who has heard a part of it is told of all solutions again.
            events = [
                written(item, None if item.id is None else f"{item.id}-{feed.solution}")
                for item in wanted[:-1]
            ]
            feed.position, feed.solution = max(feed.position, news.entry), news.solution
            if wanted:
                last = written(wanted[-1], f"{feed.position}-{feed.solution}")
                queued[feed] = [*events, last]
        _deliver_events(queued)

    def _publish_banner_change(self, feeds: list[EventListener], *, first: bool) -> None:
        """Tell each listener of another notice of maintenance, whichever process has set it."""
        before, self._banner = self._banner, read_banner(self._store)
        if first or self._banner == before:
            return
        event = _format_event("maintenance", MaintenanceEvent(banner=self._banner))
        _deliver_events({feed: [event] for feed in feeds})

    def publish_lease(self, lease: Lease) -> None:
        """Tell who has a group of a batch open."""
        if lease.group is None:
            return
        here = [GroupViewerDocument.model_validate(one) for one in lease.here]
        event = AssignedGroupEvent(
            batch=lease.batch.id, group=lease.group, dataset=lease.batch.dataset, here=here
        )
        self._publish_work(lease.batch.dataset_id, event)
        self._store.publish(f"{_WORK} {lease.batch.dataset_id} {event.model_dump_json()}")

    def _receive_lease(self, word: str) -> None:
        """Tell of a lease that another process has given."""
        kind, _, rest = word.partition(" ")
        if kind == _WORK:
            dataset_id, _, text = rest.partition(" ")
            self._publish_work(int(dataset_id), AssignedGroupEvent.model_validate_json(text))

    def _publish_work(self, dataset_id: int, document: AssignedGroupEvent) -> None:
        event = _format_event("work", document)
        _deliver_events(
            {feed: [event] for feed in self._list_listeners() if feed.wants(dataset_id)}
        )

    def _publish_job(self, job: Job) -> None:
        event, feeds = _job_event(job), self._list_listeners()
        _deliver_events({feed: [event] for feed in feeds if feed.wants(job.dataset_id, job.actor)})


def _deliver_events(queued: Mapping[EventListener, list[bytes]], *, ended: bool = False) -> None:
    """Tell listeners of something, each loop by one call; from any thread."""

    def queue_events_on_loop(loop: asyncio.AbstractEventLoop) -> None:
        for feed, events in queued.items():
            if feed.loop is loop:
                feed.take(events, ended=ended)

    for loop in {feed.loop for feed in queued}:
        # One of a server that has stopped calls nothing any more.
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(queue_events_on_loop, loop)


def make_first_event(position: str) -> bytes:
    """What a listener gets first: where it stands, should it have to come back."""
    return format_sse_event(comment="listening", id=position, retry=RETRY_MS)


def _change_event(change: LoggedChange, identity: str | None) -> bytes:
    if change.group_id is None:
        document = DatasetEvent(dataset=change.dataset, kind=change.kind, actor=change.actor)
        return _format_event("dataset", document, identity)
    group = GroupEvent(
        group=change.group_id,
        dataset=change.dataset,
        etag=change.etag,
        kind=change.kind,
        actor=change.actor,
    )
    return _format_event("group", group, identity)


def _job_event(job: Job) -> bytes:
    return _format_event("job", JobDocument.model_validate(job))


def _format_event(kind: str, document: BaseModel, identity: str | None = None) -> bytes:
    return format_sse_event(data_str=document.model_dump_json(), event=kind, id=identity)
