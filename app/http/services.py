"""Services: what lives as long as a server, opened over one home, started, and told to stop."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from math import inf
from threading import Event, Thread
from time import monotonic

import structlog

from app.config import Settings
from app.db.store import Store
from app.errors import BusyError
from app.features.agreement.service import compare_left
from app.features.exports.jobs import ExportFolder, resume_exports
from app.features.groups.preview_routes import LargeGroupSolver, PreviewSolver
from app.features.groups.view_paint import PaintFollower
from app.features.imports.jobs import resume_imports
from app.features.jobs.service import Jobs, Pool
from app.features.jobs.shared import SharedJobs
from app.features.maintenance.upkeep import Upkeep
from app.features.match_estimates.jobs import PICTURES, POSITIONS, RIG
from app.features.paint.jobs import PAINT, PROPOSALS
from app.features.policies.noise import NoiseStore
from app.features.practice.service import resume_practice
from app.features.predictions.jobs import resume_evaluations
from app.features.predictions.reader import PredictionReader
from app.features.recordings.camera_jobs import resume_cameras
from app.features.recordings.follow import BallFollower
from app.features.recordings.frames import RecordingFrames
from app.features.recordings.jobs import resume_recordings
from app.features.solve.jobs import resume_solving, solve_leftovers
from app.features.tracks.jobs import TRACKS
from app.features.tracks.link_ball import resume_ball_links
from app.features.versions.jobs import resume_versions
from app.features.webhooks.sender import WebhookSender
from app.features.what_if.service import YieldStore
from app.features.what_if.statistics import StatisticsStore
from app.http.events import Events
from app.media.frames import Frames
from app.soccer.actors import LOCAL_USER
from app.solving.solve import warm_up

log = structlog.get_logger("touchline.api")

LEFTOVERS_AGAIN_S = 2.0
STOP_SECONDS = 10.0
"""A server that is told to stop has ended after so long."""


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
    recordings: RecordingFrames
    balls: BallFollower
    large: LargeGroupSolver
    previews: PreviewSolver
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
        large = LargeGroupSolver(settings)
        return Services(
            settings,
            store,
            frames,
            RecordingFrames(settings),
            BallFollower(settings),
            large,
            PreviewSolver(settings, store, PaintFollower(frames), large),
            PredictionReader(settings),
            exports,
            jobs,
            Events(store, jobs),
            YieldStore(store),
            StatisticsStore(store),
            NoiseStore(store),
            Upkeep(store, jobs),
            WebhookSender(store, leads=jobs.is_leader),
        )

    def start(self) -> None:
        """Load the solver's kernels, and take up the work that an earlier run left undone."""
        Thread(target=warm_up, daemon=True).start()
        Thread(target=self._refresh_large_datasets, name="yield", daemon=True).start()
        self.frames.warm()
        resume_solving(self.jobs, self.store)
        for kind in (PAINT, PROPOSALS, PICTURES, POSITIONS, RIG, TRACKS):
            kind.take_up(self.jobs, self.store)
        resume_exports(self.jobs, self.store, self.exports, self.frames)
        resume_versions(self.jobs, self.store)
        resume_imports(self.jobs, self.store, self.settings)
        resume_recordings(self.jobs, self.store)
        resume_cameras(self.jobs, self.store)
        resume_ball_links(self.jobs, self.store)
        resume_evaluations(self.jobs, self.store)
        resume_practice(self.jobs, self.store)
        self.jobs.on_leadership(self._start_leading)
        self.jobs.start()
        self.store.subscribe()
        self.upkeep.start()
        self.webhooks.start()

    def _start_leading(self) -> None:
        """Begin what one process does for all."""
        if not self._solved_leftovers():
            Thread(target=self._solve_leftovers_later, daemon=True).start()
        Thread(target=self._compare_uncompared_annotations, name="agreement", daemon=True).start()
        self.webhooks.wake()

    def _compare_uncompared_annotations(self) -> None:
        """Compare annotations that an earlier run was stopped before."""
        try:
            compare_left(self.store, self.paint)
        except Exception:
            log.exception("annotations could not be compared")

    def _refresh_large_datasets(self) -> None:
        self.statistics.refresh_large_datasets()
        self.yields.refresh_large_datasets()

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
        self.recordings.close()
        self.balls.close()
        self.predictions.close()
        self.store.close()
