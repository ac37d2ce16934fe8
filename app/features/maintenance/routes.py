"""The notice for everybody, and the health of the server."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from pydantic import AwareDatetime, BaseModel, Field

from app.errors import BusyError, NotFoundError, OverloadedError, StorageError
from app.features.maintenance.service import LONGEST, Banner, clear_banner, set_banner
from app.features.queue.changes import read_newest_entry_id
from app.http.deps import Actor, AppStore
from app.http.documents import RequestBody
from app.http.metrics import SharedProcessMetrics
from app.http.permissions import Action, may, open_to_all
from app.http.problem import responses
from app.http.request_limits import limit
from app.http.route import Route

maintenance_router = APIRouter(prefix="/maintenance", tags=["sessions"], route_class=Route)
health_router = APIRouter(tags=["health"], route_class=Route)


class NewBanner(
    RequestBody,
    examples=[{"text": "Upgrade at 18:00, ten minutes.", "until": "2099-11-28T18:10:00Z"}],
):
    """A notice, and when it is shown."""

    text: Annotated[str, Field(min_length=1, max_length=LONGEST)] = Field(
        description="One line, shown on every page, also before people log in."
    )
    starts: AwareDatetime | None = Field(
        default=None, description="When it begins to be shown; null: at once."
    )
    until: AwareDatetime | None = Field(
        default=None, description="When it is no longer shown; null: when it is deleted."
    )


class Health(BaseModel):
    """The process answers."""

    status: Literal["ok"]
    version: str


class Readiness(BaseModel):
    """The database answers."""

    status: Literal["ready"]


@maintenance_router.put("")
@may(Action.ADMINISTER)
def set_maintenance(new: NewBanner, store: AppStore, actor: Actor) -> Banner:
    """Show a notice on every page, in place of the one before.

    Windows that are open show it within some seconds; the login page has it, too.
    """
    return set_banner(store, new.text, starts=new.starts, until=new.until, actor=actor)


@maintenance_router.delete(
    "",
    status_code=204,
    response_class=Response,
    responses={**responses(404), 204: {"description": "It is gone."}},
)
@may(Action.ADMINISTER)
def clear_maintenance(store: AppStore, actor: Actor) -> Response:
    """Take the notice away."""
    if not clear_banner(store, actor=actor):
        raise NotFoundError("no maintenance notice is set")
    return Response(status_code=204)


@health_router.get("/healthz")
@open_to_all
@limit(None)
async def get_health(request: Request) -> Health:
    """Whether the process answers; it needs no thread and no database."""
    return Health(status="ok", version=request.app.version)


@health_router.get("/readyz")
@open_to_all
@limit(None)
def get_readiness(store: AppStore) -> Readiness:
    """Whether the database answers, keeps changes, and was not seen to be damaged; else 503."""
    store.require_undamaged()
    read_newest_entry_id(store)
    try:
        store.require_writable()
    except BusyError:
        # Others are writing: changes are kept.
        pass
    except StorageError as error:
        raise OverloadedError(f"changes are refused: {error.message}", hint=error.hint) from error
    return Readiness(status="ready")


@health_router.get(
    "/metrics", response_class=Response, responses={200: {"content": {CONTENT_TYPE_LATEST: {}}}}
)
@may(Action.ADMINISTER)
@limit(None)
def get_metrics(request: Request) -> Response:
    """Requests, request limits, event streams, processes, jobs, files and room, in Prometheus' text format."""
    shared: SharedProcessMetrics | None = getattr(request.app.state, "shared_metrics", None)
    if shared is not None:
        shared.refresh()
    registry: CollectorRegistry = request.app.state.answered_metrics
    return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)
