"""Services of a server, opened over one home, and what routes are given: these, who acts, and preconditions.

What routes are given are coroutines although they wait for nothing: FastAPI sends a plain function to a
thread, which costs more than all that it does here."""

from __future__ import annotations

import re
from contextlib import nullcontext
from dataclasses import dataclass, field
from math import inf
from threading import Event, Thread
from time import monotonic
from typing import Annotated

import structlog
from fastapi import Depends, Header, Path, Query, Request

from app.config import Settings
from app.db.store import Store
from app.errors import BusyError, InputError
from app.features.agreement.service import compare_uncompared_groups
from app.features.exports.jobs import ExportFolder, resume_exports
from app.features.groups.preview_routes import LargeGroupSolver, PreviewSolver
from app.features.groups.view_paint import PaintUpdater
from app.features.imports.jobs import resume_imports
from app.features.jobs.runner import Pool
from app.features.jobs.service import Jobs
from app.features.jobs.shared import SharedJobs
from app.features.maintenance.upkeep import UpkeepScheduler
from app.features.match_estimates.jobs import PICTURES, POSITIONS, RIG
from app.features.paint.jobs import PAINT, PROPOSALS
from app.features.people.visibility_queries import Visibility
from app.features.policies.noise import NoiseCache
from app.features.practice.service import register_practice_resume
from app.features.predictions.jobs import register_prediction_jobs
from app.features.predictions.reader import PredictionReader
from app.features.recordings.camera_jobs import register_camera_jobs
from app.features.recordings.follow import BallFollower
from app.features.recordings.frames import RecordingFrameDecoder
from app.features.recordings.jobs import register_recording_jobs
from app.features.solve.jobs import register_solve_resume, request_solve_of_leftovers
from app.features.tracks.jobs import TRACKS
from app.features.tracks.link_ball import register_link_by_ball_jobs
from app.features.versions.jobs import register_version_jobs
from app.features.webhooks.sender import WebhookSender
from app.features.what_if.service import WhatIfStore
from app.features.what_if.statistics import StatisticsCache
from app.http.access import (
    get_current_login,
    get_current_visibility,
    get_current_visibility_of_whole_datasets,
)
from app.http.errors import PreconditionRequiredError
from app.http.event_stream import EventPublisher
from app.json_text import MAX_ID
from app.media.frames import FrameProvider
from app.soccer.actors import LOCAL_USER, parse_script_name
from app.solving.solve import warm_up_solver

log = structlog.get_logger("touchline.api")

LEFTOVERS_AGAIN_S = 2.0
STOP_SECONDS = 10.0
"""A server that is told to stop has ended after so long."""


ACTOR_HEADER = "X-Actor"
STRONG_ETAG = re.compile(r'"[\x21\x23-\x7e]*"')
Id = Annotated[int, Path(ge=1, le=MAX_ID)]
DatasetPath = Annotated[str, Path(max_length=200, description="Name or id of the dataset.")]
DatasetQuery = Annotated[
    str, Query(alias="dataset", max_length=200, description="Name or id of the dataset.")
]
DryRun = Annotated[bool, Query(description="Only report what would happen.")]
QueryText = Annotated[
    str,
    Query(
        alias="q",
        max_length=1000,
        description="Filters and order, as in the browser: "
        "`status:unreviewed jac<0.95 sigma>0.5 finding:low_parallax sort:value`; "
        "`id:12,15,19` names groups.",
    ),
]


class StopSignal(Event):
    """Set when the server is told to stop; from then on its time is counted."""

    _until = inf

    def set(self) -> None:
        """Begin to stop."""
        self._until = min(self._until, monotonic() + STOP_SECONDS)
        super().set()

    def seconds_left(self) -> float:
        """Until the server shall have ended."""
        return max(self._until - monotonic(), 0.0)


@dataclass(frozen=True)
class Services:
    """What lives as long as the application.

    Attributes:
        stopping: Set when the server is told to stop, before it waits for open requests.
    """

    settings: Settings
    store: Store
    frames: FrameProvider
    recordings: RecordingFrameDecoder
    balls: BallFollower
    large: LargeGroupSolver
    previews: PreviewSolver
    predictions: PredictionReader
    exports: ExportFolder
    jobs: Jobs
    events: EventPublisher
    yields: WhatIfStore
    statistics: StatisticsCache
    noises: NoiseCache
    upkeep: UpkeepScheduler
    webhooks: WebhookSender
    stopping: StopSignal = field(default_factory=StopSignal)

    @property
    def paint(self) -> PaintUpdater:
        """Reads the paint of edited lines again."""
        return PaintUpdater(self.frames)

    @staticmethod
    def open(settings: Settings, pool: Pool = nullcontext) -> Services:
        """Open everything over one home; ``pool`` is for jobs that are worth processes."""
        store = Store.open(settings)
        jobs = SharedJobs(store, pool=pool) if store.sharing.is_shared else Jobs(store, pool=pool)
        exports, frames = ExportFolder(settings.exports), FrameProvider(settings)
        large = LargeGroupSolver(settings)
        return Services(
            settings,
            store,
            frames,
            RecordingFrameDecoder(settings),
            BallFollower(settings),
            large,
            PreviewSolver(settings, store, PaintUpdater(frames), large),
            PredictionReader(settings),
            exports,
            jobs,
            EventPublisher(store, jobs),
            WhatIfStore(store),
            StatisticsCache(store),
            NoiseCache(store),
            UpkeepScheduler(store, jobs),
            WebhookSender(store, leads=jobs.is_leader),
        )

    def start(self) -> None:
        """Load the solver's kernels, and take up the work that an earlier run left undone."""
        Thread(target=warm_up_solver, daemon=True).start()
        Thread(target=self._refresh_large_datasets, name="yield", daemon=True).start()
        self.frames.warm()
        register_solve_resume(self.jobs, self.store)
        for kind in (PAINT, PROPOSALS, PICTURES, POSITIONS, RIG, TRACKS):
            kind.register_with_jobs(self.jobs, self.store)
        resume_exports(self.jobs, self.store, self.exports, self.frames)
        register_version_jobs(self.jobs, self.store)
        resume_imports(self.jobs, self.store, self.settings)
        register_recording_jobs(self.jobs, self.store)
        register_camera_jobs(self.jobs, self.store)
        register_link_by_ball_jobs(self.jobs, self.store)
        register_prediction_jobs(self.jobs, self.store)
        register_practice_resume(self.jobs, self.store)
        self.jobs.call_on_leadership(self._start_leader_work)
        self.jobs.start()
        self.store.subscribe()
        self.upkeep.start()
        self.webhooks.start()

    def _start_leader_work(self) -> None:
        """Begin what one process does for all."""
        if not self._try_request_solve_of_leftovers():
            Thread(target=self._retry_leftovers_until_requested, daemon=True).start()
        Thread(target=self._compare_uncompared_annotations, name="agreement", daemon=True).start()
        self.webhooks.wake()

    def _compare_uncompared_annotations(self) -> None:
        """Compare annotations that an earlier run was stopped before."""
        try:
            compare_uncompared_groups(self.store, self.paint)
        except Exception:
            log.exception("annotations could not be compared")

    def _refresh_large_datasets(self) -> None:
        self.statistics.refresh_large_datasets()
        self.yields.refresh_large_datasets()

    def _try_request_solve_of_leftovers(self) -> bool:
        """Whether what an earlier run left is taken up; not while another process keeps writing."""
        try:
            request_solve_of_leftovers(self.jobs, self.store, actor=LOCAL_USER)
        except BusyError:
            return False
        return True

    def _retry_leftovers_until_requested(self) -> None:
        while (
            not self.stopping.wait(LEFTOVERS_AGAIN_S) and not self._try_request_solve_of_leftovers()
        ):
            pass

    def stop(self) -> None:
        """Tell all work to end after its next step; requests that are open go on."""
        self.stopping.set()
        self.events.close()
        self.webhooks.stop()
        self.upkeep.stop()
        self.jobs.stop()

    def close(self) -> None:
        """Let the running work end, and close processes and database."""
        self.stop()
        for work in (self.webhooks, self.jobs, self.upkeep):
            work.close(self.stopping.seconds_left())
        self.previews.close()
        self.large.close()
        self.frames.close()
        self.recordings.close()
        self.balls.close()
        self.predictions.close()
        self.store.close()


async def get_services(request: Request) -> Services:
    """The services of the running application."""
    services: Services = request.app.state.services
    return services


async def get_store(services: Annotated[Services, Depends(get_services)]) -> Store:
    """The database."""
    return services.store


async def get_actor(
    request: Request,
    name: Annotated[
        str | None,
        Header(
            alias=ACTOR_HEADER,
            description=(
                "Name of the script: up to 60 letters, digits, spaces and . _ @ + -. History, "
                "verdicts and jobs show it as `script:NAME`. It is not verified."
            ),
            examples=["nightly import"],
        ),
    ] = None,
) -> str:
    """The actor of the request: the person who is logged in, or the owner of the token.

    On a server without accounts it is the single user, or a script by its name.

    Raises:
        InputError: The name cannot be one, or a person is known who would hide behind it.
    """
    login = get_current_login(request.scope)
    if login is not None:
        if name is not None:
            raise InputError(
                f"{ACTOR_HEADER} is not accepted on a server with logins",
                hint="Leave it out: the log names the logged-in person.",
                pointer=f"/{ACTOR_HEADER}",
            )
        return login.actor
    return LOCAL_USER if name is None else parse_script_name(name, pointer=f"/{ACTOR_HEADER}")


async def get_visibility(request: Request) -> Visibility:
    """What whoever asks sees."""
    return get_current_visibility(request.scope)


async def get_visibility_of_whole_datasets(request: Request) -> Visibility:
    """What whoever asks sees and nothing of which is hidden from them."""
    return get_current_visibility_of_whole_datasets(request.scope)


async def require_if_match(
    if_match: Annotated[
        str | None,
        Header(
            alias="If-Match",
            description="The ETag of the state that the change builds on. Required: 428 without "
            "it, 412 with the present state when another person changed it first. `*` is refused.",
            examples=['"9f2c61d0a4"'],
        ),
    ] = None,
) -> str:
    """The one strong ETag that a change builds on.

    Raises:
        PreconditionRequiredError: There is none.
        InputError: It is ``*``, weak, a list or no ETag.
    """
    if if_match is None:
        raise PreconditionRequiredError(
            "the request needs If-Match with the ETag of the state that it changes",
            hint="Load the current state, and send its ETag as If-Match.",
        )
    if not STRONG_ETAG.fullmatch(if_match.strip()):
        raise InputError(
            "If-Match must be one strong ETag, in its quotes",
            hint='Send the "etag" of the document as it is; * and W/ are refused.',
        )
    return if_match.strip()


AppServices = Annotated[Services, Depends(get_services)]
AppStore = Annotated[Store, Depends(get_store)]
Actor = Annotated[str, Depends(get_actor)]
Sees = Annotated[Visibility, Depends(get_visibility)]
SeesWhole = Annotated[Visibility, Depends(get_visibility_of_whole_datasets)]
IfMatch = Annotated[str, Depends(require_if_match)]


def is_not_modified(request: Request, etag: str) -> bool:
    """Whether If-None-Match says that the caller already has this state."""
    sent = request.headers.get("if-none-match", "")
    return etag in [tag.strip().removeprefix("W/") for tag in sent.split(",")]
