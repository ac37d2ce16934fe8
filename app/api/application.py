"""The application: settings in, an ASGI application out."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext
from pathlib import Path

from anyio.to_thread import current_default_thread_limiter
from fastapi import Depends, FastAPI

from app.api.errors import install_handlers
from app.api.idempotency import Idempotency
from app.api.metrics import SharedNumbers, install_metrics
from app.api.openapi import describe
from app.api.pages import install_pages
from app.api.request_log import RequestLog
from app.api.routers import (
    agreement,
    audit,
    bell,
    bulk_edits,
    datasets,
    evaluations,
    events,
    exports,
    findings,
    gold,
    groups,
    guidelines,
    health,
    imports,
    insight,
    jobs,
    maintenance,
    members,
    noise,
    paint,
    passkeys,
    pictures,
    pitch,
    pitches,
    policies,
    positions,
    practice,
    predictions,
    proposals,
    query_fields,
    rig,
    saved_views,
    second_factors,
    sessions,
    sign_on,
    stations,
    statistics,
    takes,
    threads,
    timeline,
    tokens,
    uploads,
    users,
    verdicts,
    versions,
    view_paint,
    views,
    webhooks,
    work,
    yields,
)
from app.api.security.access import Access, require_decided
from app.api.security.bodies import MAX_JSON_BYTES, JsonBodies
from app.api.security.headers import SecurityHeaders
from app.api.security.lanes import THREADS, Doors, Lanes
from app.api.security.origin import KnownHosts, SameOrigin
from app.api.security.requests import HeadAsGet, OneLength, OneRange
from app.api.services import Services
from app.api.site import STATIC, Site
from app.api.team import Team, allowed_hosts
from app.api.unknown_names import refuse_unknown_parameters
from app.config import Settings
from app.datasets.manifest import software_version
from app.review.jobs.jobs import Pool
from app.soccer.actors import LOCAL_USER

PREFIX = "/api/v1"
ROUTERS = (
    # A request is compared with every route before its own, twice: what people ask all the time is first.
    groups,
    views,
    verdicts,
    bulk_edits,
    work,
    events,
    sessions,
    bell,
    datasets,
    gold,
    guidelines,
    threads,
    view_paint,
    stations,
    rig,
    timeline,
    findings,
    insight,
    exports,
    pitch,
    pitches,
    pictures,
    paint,
    proposals,
    positions,
    jobs,
    noise,
    policies,
    yields,
    versions,
    predictions,
    evaluations,
    uploads,
    imports,
    saved_views,
    query_fields,
    statistics,
    takes,
    practice,
    sign_on,
    passkeys,
    second_factors,
    maintenance,
    tokens,
    users,
    members,
    audit,
    webhooks,
    agreement,
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
    site = Site(static, team=settings.team)
    app = FastAPI(
        title="Touchline",
        version=software_version(),
        summary="Multi-view soccer frames into a trusted 3D ball dataset.",
        openapi_url=f"{PREFIX}/openapi.json",
        # Both pages load scripts from elsewhere, which the content policy refuses.
        docs_url=None,
        redoc_url=None,
        redirect_slashes=False,
        lifespan=_lifespan,
    )
    app.state.services = services
    team = app.state.team = Team.of(settings, services.store)
    install_handlers(app)
    app.include_router(health.router, dependencies=[Depends(require_decided)])
    # Before the API: nobody asks for as much at once as somebody who opens the first page.
    events = services.events
    install_pages(app, site, None if settings.team else events.moment, events.banner)
    for router in ROUTERS:
        app.include_router(
            router.router,
            prefix=PREFIX,
            dependencies=[Depends(require_decided), Depends(refuse_unknown_parameters)],
        )
    describe(app)
    _add_middleware(app, settings, site, team)
    return app


def _add_middleware(app: FastAPI, settings: Settings, site: Site, team: Team | None) -> None:
    """The first one added is the innermost."""
    doors = Doors(app.state.services.store.sharing.is_shared, settings.solves_apart)
    app.add_middleware(Lanes, doors=doors)
    # Outside of the lanes: a repetition that waits for the first response takes nobody's place.
    app.add_middleware(Idempotency, actor=LOCAL_USER)
    if team is not None:
        # Inside of what makes HEAD a GET, outside of whatever could answer.
        app.add_middleware(Access, team=team, store=app.state.services.store)
    app.add_middleware(OneRange)
    app.add_middleware(HeadAsGet)
    app.add_middleware(
        JsonBodies,
        max_bytes=min(MAX_JSON_BYTES, settings.max_upload_bytes),
        streamed=frozenset({f"{PREFIX}/uploads"}),
    )
    app.add_middleware(OneLength)
    app.add_middleware(SameOrigin, url=settings.url, required=team is not None)
    app.add_middleware(KnownHosts, allowed=allowed_hosts(settings))
    install_metrics(app, doors)
    app.add_middleware(RequestLog)
    app.add_middleware(SecurityHeaders, policy=site.policy)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    current_default_thread_limiter().total_tokens = THREADS
    app.state.services.start()
    shared: SharedNumbers | None = getattr(app.state, "shared_metrics", None)
    keeping = None if shared is None else asyncio.create_task(shared.keep_fresh())
    yield
    if keeping is not None:
        keeping.cancel()
    app.state.services.close()
