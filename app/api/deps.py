"""What routes are given: the store, who acts, and the preconditions of a change.

They are coroutines although they wait for nothing: FastAPI sends a plain function to a thread, which
costs more than all that it does here.
"""

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

from app.api.errors import PreconditionRequiredError
from app.api.events import Events
from app.api.large_edits import LargeEdits
from app.api.previews import Previews
from app.api.security.access import login_of, sight_of
from app.config import Settings
from app.errors import BusyError, InputError
from app.review.agreement.weigh import weigh_left
from app.review.editing.follow_paint import PaintFollower
from app.review.evaluating.prediction_reader import PredictionReader
from app.review.exporting.folder import ExportFolder
from app.review.jobs.evaluations import resume_evaluations
from app.review.jobs.exports import resume_exports
from app.review.jobs.imports import resume_imports
from app.review.jobs.jobs import Jobs, Pool
from app.review.jobs.paint import PAINT
from app.review.jobs.pictures import PICTURES
from app.review.jobs.positions import POSITIONS
from app.review.jobs.proposals import PROPOSALS
from app.review.jobs.rig import make_rigs
from app.review.jobs.shared_jobs import SharedJobs
from app.review.jobs.solve import resume_solving, solve_leftovers
from app.review.jobs.upkeep import Upkeep
from app.review.jobs.versions import resume_versions
from app.review.people.roles import Sight
from app.review.policies.noise_store import NoiseStore
from app.review.practice.practice import resume_practice
from app.review.webhooks.sender import WebhookSender
from app.review.yields.statistics import StatisticsStore
from app.review.yields.store import YieldStore
from app.soccer.actors import LOCAL_USER, script_name
from app.solving.warm import warm_up
from app.store.frames import Frames
from app.store.store import Store

log = structlog.get_logger("touchline.api")

ACTOR_HEADER = "X-Actor"
LEFTOVERS_AGAIN_S = 2.0
MAX_ID = 2**63 - 1
STOP_SECONDS = 10.0
"""A server that is told to stop has ended after so long."""
_STRONG_ETAG = re.compile(r'"[\x21\x23-\x7e]*"')


class Stopping(Event):
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
    frames: Frames
    large: LargeEdits
    previews: Previews
    predictions: PredictionReader
    exports: ExportFolder
    jobs: Jobs
    events: Events
    yields: YieldStore
    statistics: StatisticsStore
    noises: NoiseStore
    upkeep: Upkeep
    webhooks: WebhookSender
    stopping: Stopping = field(default_factory=Stopping)

    @property
    def paint(self) -> PaintFollower:
        """Reads the paint of edited lines again."""
        return PaintFollower(self.frames)

    @staticmethod
    def open(settings: Settings, pool: Pool = nullcontext) -> Services:
        """Open everything over one home; ``pool`` is for jobs that are worth processes."""
        store = Store.open(settings)
        jobs = SharedJobs(store, pool=pool) if store.sharing.is_shared else Jobs(store, pool=pool)
        exports, frames = ExportFolder(settings.exports), Frames(settings)
        large = LargeEdits(settings)
        return Services(
            settings,
            store,
            frames,
            large,
            Previews(settings, store, PaintFollower(frames), large),
            PredictionReader(settings),
            exports,
            jobs,
            Events(store, jobs),
            YieldStore(store),
            StatisticsStore(store),
            NoiseStore(store),
            Upkeep(store, jobs),
            WebhookSender(store, leads=jobs.leads),
        )

    def start(self) -> None:
        """Load the solver's kernels, and take up the work that an earlier run left undone."""
        Thread(target=warm_up, daemon=True).start()
        Thread(target=self._keep_large_up, name="yield", daemon=True).start()
        self.frames.warm()
        resume_solving(self.jobs, self.store)
        for kind in (PAINT, PROPOSALS, PICTURES):
            kind.resume(self.jobs, self.store)
        # Begun again, a share would be one more to take back.
        POSITIONS.make(self.jobs, self.store)
        resume_exports(self.jobs, self.store, self.exports, self.frames)
        resume_versions(self.jobs, self.store)
        resume_imports(self.jobs, self.store, self.settings)
        resume_evaluations(self.jobs, self.store)
        resume_practice(self.jobs, self.store, self.settings)
        make_rigs(self.jobs, self.store)
        self.jobs.on_lead(self._lead)
        self.jobs.start()
        self.store.follow()
        self.upkeep.start()
        self.webhooks.start()

    def _lead(self) -> None:
        """Begin what one process does for all."""
        if not self._solved_leftovers():
            Thread(target=self._solve_leftovers_later, daemon=True).start()
        Thread(target=self._weigh_left, name="agreement", daemon=True).start()
        self.webhooks.wake()

    def _weigh_left(self) -> None:
        """Compare annotations that an earlier run was stopped before."""
        try:
            weigh_left(self.store, self.paint)
        except Exception:
            log.exception("annotations could not be compared")

    def _keep_large_up(self) -> None:
        self.statistics.keep_large_up()
        self.yields.keep_large_up()

    def _solved_leftovers(self) -> bool:
        """Whether what an earlier run left is taken up; not while another process keeps writing."""
        try:
            solve_leftovers(self.jobs, self.store, actor=LOCAL_USER)
        except BusyError:
            return False
        return True

    def _solve_leftovers_later(self) -> None:
        while not self.stopping.wait(LEFTOVERS_AGAIN_S) and not self._solved_leftovers():
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
    said: Annotated[
        str | None,
        Header(
            alias=ACTOR_HEADER,
            description="What a script calls itself: up to 60 letters, digits, spaces and . _ @ + -. "
            "History, verdicts and jobs name it as `script:NAME`. Nobody checks who it is.",
            examples=["nightly import"],
        ),
    ] = None,
) -> str:
    """Who acts: the person who is logged in, or whose token it is; on a server without accounts its single user, or a script
    by its name.

    Raises:
        InputError: The name cannot be one, or a person is known who would hide behind it.
    """
    login = login_of(request.scope)
    if login is not None:
        if said is not None:
            raise InputError(
                f"on a server of a team {ACTOR_HEADER} names nobody",
                hint="Leave it out: the log names the person who is logged in.",
                pointer=f"/{ACTOR_HEADER}",
            )
        return login.actor
    return LOCAL_USER if said is None else script_name(said, pointer=f"/{ACTOR_HEADER}")


async def get_sight(request: Request) -> Sight:
    """What whoever asks sees."""
    return sight_of(request.scope)


async def require_if_match(
    if_match: Annotated[
        str | None,
        Header(
            alias="If-Match",
            description="The ETag of the state that the change builds on. Required: 428 without "
            "it, 412 with the present state when somebody else was faster. `*` is refused.",
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
            "a change must name the state that it builds on",
            hint="Send the ETag of the last answer as If-Match.",
        )
    if not _STRONG_ETAG.fullmatch(if_match.strip()):
        raise InputError(
            "If-Match must be one strong ETag, in its quotes",
            hint='Send the "etag" of the document as it is; * and W/ are refused.',
        )
    return if_match.strip()


AppServices = Annotated[Services, Depends(get_services)]
AppStore = Annotated[Store, Depends(get_store)]
Actor = Annotated[str, Depends(get_actor)]
Sees = Annotated[Sight, Depends(get_sight)]
IfMatch = Annotated[str, Depends(require_if_match)]
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


def etag_matches(request: Request, etag: str) -> bool:
    """Whether If-None-Match says that the caller already has this state."""
    sent = request.headers.get("if-none-match", "")
    return etag in [tag.strip().removeprefix("W/") for tag in sent.split(",")]
