"""The application: settings in, an ASGI application out."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext
from pathlib import Path

from anyio.to_thread import current_default_thread_limiter
from fastapi import Depends, FastAPI

from app.config import Settings
from app.features.agreement import routes as agreement
from app.features.audit import routes as audit
from app.features.batches import routes as batches
from app.features.comments import routes as comments
from app.features.datasets import routes as datasets
from app.features.exports import routes as exports
from app.features.findings import routes as findings
from app.features.groups import bulk_routes as groups_bulk
from app.features.groups import routes as groups
from app.features.groups import view_routes as groups_view
from app.features.guidelines import routes as guidelines
from app.features.imports import routes as imports
from app.features.independent_annotations import routes as independent_annotations
from app.features.jobs import routes as jobs
from app.features.jobs.runner import Pool
from app.features.maintenance import routes as maintenance
from app.features.match_estimates import routes as match_estimates
from app.features.notifications import routes as notifications
from app.features.paint import routes as paint
from app.features.people import login_routes as people_login
from app.features.people import routes as people
from app.features.people import session_routes as people_session
from app.features.pitches import routes as pitches
from app.features.policies import routes as policies
from app.features.practice import routes as practice
from app.features.predictions import evaluation_routes as predictions_evaluation
from app.features.predictions import routes as predictions
from app.features.queue import routes as queue
from app.features.recordings import ball_run_routes as recording_balls
from app.features.recordings import camera_routes as recording_cameras
from app.features.recordings import link_routes as recording_links
from app.features.recordings import routes as recordings
from app.features.saved_views import routes as saved_views
from app.features.stations import routes as stations
from app.features.tracks import follow_routes as follow
from app.features.tracks import routes as tracks
from app.features.verdicts import routes as verdicts
from app.features.versions import routes as versions
from app.features.webhooks import routes as webhooks
from app.features.what_if import routes as what_if
from app.formats.manifest import read_software_version
from app.http import event_routes as http_event
from app.http import openapi
from app.http.access import AccessControl
from app.http.deps import Services
from app.http.errors import install_error_handlers
from app.http.headers import HostNameGuard, SameOriginGuard, SecurityHeaders
from app.http.idempotency import IdempotencyHandler
from app.http.metrics import SharedProcessMetrics, install_metrics
from app.http.openapi import install_openapi_document
from app.http.pages import STATIC, BrowserSite, install_pages
from app.http.request_limits import THREADS, RequestLimits
from app.http.request_log import RequestLog
from app.http.requests import (
    MAX_JSON_BYTES,
    AmbiguousLengthGuard,
    HeadAsGet,
    SingleRangeFilter,
    refuse_unknown_parameters,
)
from app.http.route import RequestPipeline, Route, require_permissions, respond_to_unknown_route
from app.http.team import TeamLogin, list_allowed_hosts

PREFIX = "/api/v1"
ROUTERS = (
    # A request is compared with every route before its own, twice: what people ask all the time is first.
    groups.router,
    groups_view.router,
    verdicts.router,
    groups_bulk.router,
    batches.router,
    http_event.router,
    people_session.router,
    notifications.router,
    datasets.router,
    independent_annotations.gold_router,
    guidelines.router,
    comments.router,
    paint.view_paint_router,
    stations.router,
    match_estimates.rig_router,
    queue.timeline_router,
    findings.router,
    queue.insight_router,
    exports.router,
    pitches.pitch_router,
    pitches.pitches_router,
    match_estimates.pictures_router,
    paint.paint_router,
    paint.proposals_router,
    match_estimates.positions_router,
    jobs.router,
    match_estimates.noise_router,
    policies.router,
    what_if.router,
    versions.router,
    predictions.router,
    predictions_evaluation.router,
    imports.uploads_router,
    imports.imports_router,
    recordings.router,
    tracks.router,
    follow.router,
    recording_balls.router,
    recording_cameras.router,
    recording_links.router,
    saved_views.router,
    queue.query_fields_router,
    queue.statistics_router,
    independent_annotations.annotations_router,
    practice.router,
    people_session.sign_on_router,
    people_login.passkeys_router,
    people_login.second_factors_router,
    people_login.team_router,
    maintenance.maintenance_router,
    people_login.tokens_router,
    people.users_router,
    people.members_router,
    audit.router,
    webhooks.router,
    agreement.router,
    openapi.router,
)


def create_app(settings: Settings, *, static: Path = STATIC, pool: Pool = nullcontext) -> FastAPI:
    """The whole service over one home.

    The database must exist in the present schema (``touchline migrate``); it is opened here, so
    that a fault shows at start and not at the first request.

    Args:
        settings: Where things live and how much is allowed.
        static: Folder of the browser application.
        pool: Makes the processes that large jobs solve in; without any they share this one.

    Raises:
        StorageError: The database cannot be used.
    """
    services = Services.open(settings, pool)
    site = BrowserSite(static, team=settings.team)
    app = FastAPI(
        title="Touchline",
        version=read_software_version(),
        summary="Multi-view soccer frames into a trusted 3D ball dataset.",
        openapi_url=None,
        # Both pages load scripts from elsewhere, which the content policy refuses.
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=_lifespan,
    )
    app.state.services = services
    team = app.state.team = TeamLogin.of(settings, services.store)
    app.state.gate = RequestPipeline(
        None if team is None else AccessControl(team, services.store),
        IdempotencyHandler(),
        RequestLimits(team=team is not None),
        min(MAX_JSON_BYTES, settings.max_upload_bytes),
    )
    install_error_handlers(app)
    app.router.route_class, app.router.default = Route, respond_to_unknown_route
    app.include_router(maintenance.health_router)
    # Before the API: nobody asks for as much at once as somebody who opens the first page.
    events = services.events
    install_pages(
        app, site, None if settings.team else events.read_resume_token, events.read_banner_json
    )
    for router in ROUTERS:
        app.include_router(
            router,
            prefix=PREFIX,
            dependencies=[Depends(refuse_unknown_parameters)],
        )
    install_openapi_document(app)
    require_permissions(app)
    _add_middleware(app, settings, site)
    return app


def _add_middleware(app: FastAPI, settings: Settings, site: BrowserSite) -> None:
    """The first one added is the innermost."""
    app.add_middleware(SingleRangeFilter)
    app.add_middleware(HeadAsGet)
    app.add_middleware(AmbiguousLengthGuard)
    app.add_middleware(SameOriginGuard, url=settings.url, required=settings.team)
    app.add_middleware(HostNameGuard, allowed=list_allowed_hosts(settings))
    install_metrics(app, app.state.gate.limits)
    app.add_middleware(RequestLog)
    app.add_middleware(SecurityHeaders, policy=site.get_security_policy)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    current_default_thread_limiter().total_tokens = THREADS
    app.state.services.start()
    shared: SharedProcessMetrics | None = getattr(app.state, "shared_metrics", None)
    keeping = None if shared is None else asyncio.create_task(shared.refresh_forever())
    yield
    if keeping is not None:
        keeping.cancel()
    app.state.services.close()
