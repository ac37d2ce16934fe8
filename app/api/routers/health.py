"""Health, readiness and metrics, for whoever runs the service."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest

from app.api.deps import AppStore
from app.api.metrics import SharedNumbers
from app.api.problem import responses
from app.api.schemas.health import Health, Readiness
from app.errors import BusyError, OverloadedError, StorageError
from app.review.queue.changes import read_position

router = APIRouter(tags=["health"])


@router.get("/healthz", operation_id="getHealth", responses=responses())
async def get_health(request: Request) -> Health:
    """Whether the process answers; it needs no thread and no database."""
    return Health(status="ok", version=request.app.version)


@router.get("/readyz", operation_id="getReadiness", responses=responses())
def get_readiness(store: AppStore) -> Readiness:
    """Whether the database answers, keeps changes, and was not seen to be damaged; else 503."""
    store.require_undamaged()
    read_position(store)
    try:
        store.require_writable()
    except BusyError:
        # Others are writing: changes are kept.
        pass
    except StorageError as error:
        raise OverloadedError(f"changes are refused: {error.message}", hint=error.hint) from error
    return Readiness(status="ready")


@router.get(
    "/metrics",
    operation_id="getMetrics",
    response_class=Response,
    responses={**responses(), 200: {"content": {CONTENT_TYPE_LATEST: {}}}},
)
def get_metrics(request: Request) -> Response:
    """Requests, lanes, event streams, processes, jobs, files and room, in Prometheus' text format."""
    shared: SharedNumbers | None = getattr(request.app.state, "shared_metrics", None)
    if shared is not None:
        shared.refresh()
    registry: CollectorRegistry = request.app.state.answered_metrics
    return Response(generate_latest(registry), media_type=CONTENT_TYPE_LATEST)
