"""Events: a stream of what changes, for every window that is open."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query, Request, Response
from fastapi.responses import StreamingResponse

from app.features.datasets.service import dataset_id
from app.features.people.visibility_queries import hides_groups_from_reader
from app.http.access import get_current_login
from app.http.deps import AppServices, SeesWhole, Services
from app.http.event_stream import EVENTS, EventListener, make_first_event
from app.http.permissions import Action, OwnedKind, RoleScope, may
from app.http.problem import Responses, responses
from app.http.requests import is_head
from app.http.route import Route

_UNBUFFERED = {"Cache-Control": "no-cache", "X-Accel-Buffering": "no"}
"""What a proxy between asks for, which would hold events back otherwise."""
_SEEN = re.compile(r"(\d{1,18})(?:-(\d{1,18}))?", re.ASCII)
_MOMENT = re.compile(r"(\d{1,18})-(\d{1,18})", re.ASCII)

router = APIRouter(prefix="/events", tags=["events"], route_class=Route)

STREAM: Responses = {
    200: {
        "description": "Server-sent events without end; `x-events` says what the data of each is.",
        "content": {
            "text/event-stream": {
                "schema": {"type": "string"},
                "x-events": {
                    kind: {"$ref": f"#/components/schemas/{model.__name__}"}
                    for kind, model in EVENTS.items()
                },
            }
        },
    }
}


async def find_listening_person(request: Request) -> str | None:
    """The login of the request, by session or token; None on a server without accounts."""
    login = get_current_login(request.scope)
    return None if login is None else login.name


Listening = Annotated[str | None, Depends(find_listening_person)]


async def require_listener_slot(services: AppServices, person: Listening) -> Services:
    """The services, unless as many listen as may: who is turned away costs the database nothing."""
    services.events.require_free_slot(person)
    return services


class EventStreamStart:
    """Where a listener begins: all that asks the database, done off the event loop."""

    def __init__(
        self,
        services: Annotated[Services, Depends(require_listener_slot)],
        dataset: Annotated[
            str | None, Query(max_length=200, description="Name or id; default: all datasets.")
        ] = None,
        last_event_id: Annotated[
            str | None,
            Header(
                alias="Last-Event-ID",
                description=(
                    "`id` of the last event received: later events are sent first. It may also be the "
                    "id of a log entry. Anything else is ignored."
                ),
            ),
        ] = None,
        since: Annotated[
            str | None,
            Query(
                max_length=40,
                description=(
                    "`moment` of the session or of the page: later events are sent first, unless "
                    "there is a `Last-Event-ID`. Anything else is ignored."
                ),
            ),
        ] = None,
    ):
        self.dataset_id = None if dataset is None else dataset_id(services.store, dataset)
        self.newest, solution = services.events.read_position()
        seen = _SEEN.fullmatch(last_event_id or "")
        self.resumed = seen is not None and int(seen[1]) <= self.newest
        start = seen if self.resumed else _MOMENT.fullmatch(since or "")
        self.position, self.solution = self.newest, solution
        if start is not None and int(start[1]) <= self.newest:
            self.position = int(start[1])
            self.solution = min(int(start[2] or solution), solution)
        self.numbered = not hides_groups_from_reader()
        if not self.numbered:
            # Whoever is told no id of the log is told all of it that they see.
            self.position, self.solution, self.resumed = 0, 0, False
        self.id = f"{self.position}-{self.solution}" if self.numbered else "0"


async def open_event_feed(
    services: AppServices,
    visibility: SeesWhole,
    person: Listening,
    start: Annotated[EventStreamStart, Depends()],
) -> AsyncIterator[EventListener]:
    """A feed for as long as the request lasts."""
    feed = EventListener(
        start.dataset_id,
        start.position,
        start.solution,
        visibility,
        start.newest,
        start.numbered,
        person,
    )
    services.events.subscribe(feed, resumed=start.resumed)
    try:
        yield feed
    finally:
        services.events.unsubscribe(feed)


def read_current_events(
    services: AppServices,
    visibility: SeesWhole,
    start: Annotated[EventStreamStart, Depends()],
    _feed: Annotated[EventListener, Depends(open_event_feed)],
) -> list[bytes]:
    """Jobs that are under way, read once the feed hears of later ones."""
    return services.events.list_open_job_events(start.dataset_id, visibility)


@router.get("", response_class=Response, responses={**responses(404), **STREAM})
@may(Action.READ, dataset=OwnedKind.DATASET, where=RoleScope.SOMEWHERE)
async def listen_to_events(
    request: Request,
    start: Annotated[EventStreamStart, Depends()],
    feed: Annotated[EventListener, Depends(open_event_feed)],
    first: Annotated[list[bytes], Depends(read_current_events)],
) -> StreamingResponse:
    """What changes, as it changes: by anybody, in a browser or on the command line.

    `group`: a group has another ETag. `dataset`: a dataset changed as a whole. `job`: a job began,
    went on or ended. `work`: who has a group of a batch open. `maintenance`: another
    notice is shown to everybody. The stream begins with the jobs that are under way.
    """

    async def stream_events() -> AsyncIterator[bytes]:
        yield b"".join([make_first_event(start.id), *first])
        if is_head(request.scope):
            return
        async for events in feed.read():
            yield events

    return StreamingResponse(stream_events(), headers=_UNBUFFERED, media_type="text/event-stream")
