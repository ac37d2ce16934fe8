"""Jobs that estimate something of matches, accept it or take it back.

Each of them solves what it leaves stale.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Protocol

from app.db.idempotency import without_pending_response
from app.db.json_columns import Json
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.datasets.service import (
    Dataset,
    DatasetHead,
    dataset_id,
    get_dataset_head,
    require_dataset_with_matches,
)
from app.features.jobs.job_run import JobProgress, Work, make_counts_reporter
from app.features.jobs.queries import Job
from app.features.jobs.records import require_job
from app.features.jobs.service import Jobs
from app.features.match_estimates.pictures import estimate_picture_geometries
from app.features.match_estimates.positions import (
    require_shareable_positions,
    share_positions,
    undo_position_sharing,
)
from app.features.match_estimates.rig import (
    accept_rig,
    propose_adjustment,
    require_adjustable_cameras,
    rig_proposal_to_json,
    undo_accepted_rig,
)
from app.features.solve.jobs import change_and_return_solve_job, request_solve_job
from app.soccer.codec import picture_geometry_to_json


@dataclass(frozen=True)
class MatchJobContext:
    """What one job was asked for.

    Attributes:
        jobs: Where it runs, and where what follows from it is queued.
        store: The database.
        job: Its ``request`` has ``match`` by name (none: all), and what else its kind takes.
    """

    jobs: Jobs
    store: Store
    job: Job

    @property
    def dataset_id(self) -> int:
        """The dataset."""
        return self.job.dataset_id or 0

    @property
    def matches(self) -> list[str] | None:
        """The matches by name; None: all."""
        match = self.job.request.get("match")
        return None if match is None else [match]

    def request_solve_of_stale_groups(self) -> None:
        """Solve what it leaves stale, soon."""
        request_solve_job(self.jobs, self.store, self.dataset_id, actor=self.job.actor)


def get_dataset_with_matches(
    store: Store, dataset: str | int, matches: Collection[str] | None
) -> DatasetHead:
    """The dataset that has all of these matches.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        return require_dataset_with_matches(session, dataset, matches)


class UndoCallback(Protocol):
    """Takes back what jobs of a kind gave last.

    Args:
        session: A write session.
        dataset: Id of the dataset.
        match: By name; None: all.
        actor: Who wants it.
        stopped: Jobs that waited or ran, and end with it: the last of them is what is taken back
            as far as it came, and where none came to anything no earlier one is.
    """

    def __call__(
        self,
        session: Session,
        dataset: int,
        match: str | None,
        /,
        *,
        actor: str,
        stopped: Sequence[Job],
    ) -> None: ...


@dataclass(frozen=True)
class MatchJobType:
    """A kind of job over one match of a dataset, or all.

    Attributes:
        kind: What it is, for programs.
        title: What it is, for people; braces stand for the dataset's name.
        work: Does it, and returns its result.
        require: The dataset, unless such a job is refused.
        undo: Takes its work back, where that can be.
        has_runs: Whether what a job gives bears a name, by which it is taken back.
        resumes: Whether the next server goes on with it; its work leaves alone what is done.
    """

    kind: str
    title: str
    work: Callable[[MatchJobContext, JobProgress], Json]
    require: Callable[[Store, str | int, Collection[str] | None], Dataset | DatasetHead] = (
        get_dataset_with_matches
    )
    undo: UndoCallback | None = None
    has_runs: bool = False
    resumes: bool = True

    def request(
        self,
        jobs: Jobs,
        store: Store,
        dataset: str | int,
        match: str | None = None,
        *,
        actor: str,
        follows: bool = False,
        **beside: Json,
    ) -> Job:
        """Have it done soon, in one match or all; ``beside`` is what else its work is asked for,
        ``follows`` as in ``Jobs.submit``.

        Raises:
            ReviewError: As ``require`` does, at once.
        """
        found = self.require(store, dataset, None if match is None else [match])
        request = {"match": match, **beside, **({"run": now()} if self.has_runs else {})}
        return jobs.submit(
            self.kind,
            self.title.format(found.name),
            self._make_work(jobs, store),
            dataset_id=found.id,
            actor=actor,
            request=request,
            follows=follows,
        )

    def register_with_jobs(self, jobs: Jobs, store: Store) -> None:
        """Let another process carry out what this one is asked for, or the next one go on with it."""
        (jobs.register_resume if self.resumes else jobs.register_work)(
            self.kind, self._make_work(jobs, store)
        )

    def undo_last_job(
        self, jobs: Jobs, store: Store, dataset: str | int, match: str | None = None, *, actor: str
    ) -> Job:
        """Take back what such jobs gave, end those at it, and solve what that leaves stale, soon:
        all of it, or nothing.

        Raises:
            ConflictError, NotFoundError: As ``undo`` does.
        """
        number, undo = dataset_id(store, dataset), self.undo
        assert undo is not None
        ended: list[int] = []

        def undo_in_session(session: Session) -> None:
            present = [
                require_job(session, other) for other in jobs.list_open_job_ids(number, self.kind)
            ]
            wanted = (None, match)
            stopped = [job for job in present if match is None or job.request["match"] in wanted]
            undo(session, number, match, actor=actor, stopped=stopped)
            ended.extend(job.id for job in stopped)
            # Whoever is at it waits for this transaction, and asks in the next whether to go on.
            jobs.cancel_on_commit(session, ended)

        job = change_and_return_solve_job(jobs, store, number, undo_in_session, actor=actor)
        jobs.cancel_each(ended)
        return job

    def _make_work(self, jobs: Jobs, store: Store) -> Work:
        return lambda progress: self.work(MatchJobContext(jobs, store, progress.job), progress)


def _estimate_picture_geometries(call: MatchJobContext, progress: JobProgress) -> Json:
    with call.jobs.pool() as executor:
        counter = make_counts_reporter(progress, "matches")
        found = estimate_picture_geometries(
            call.store, call.dataset_id, executor, counter, call.matches
        )
    return {
        "items": [
            {
                "match": item.match,
                "frames": item.frames,
                "estimate": None
                if item.estimate is None
                else picture_geometry_to_json(item.estimate.picture),
                "proposed": picture_geometry_to_json(item.proposed),
                "sentence": item.sentence,
            }
            for item in found
        ]
    }


PICTURES = MatchJobType("pictures", "Estimate the pictures of {}", _estimate_picture_geometries)


def _share_positions(call: MatchJobContext, progress: JobProgress) -> Json:
    try:
        with call.jobs.pool() as executor:
            found = share_positions(
                call.store,
                call.dataset_id,
                call.matches,
                actor=call.job.actor,
                executor=executor,
                progress=make_counts_reporter(progress, "matches"),
                require_wanted=progress.require_not_cancelled,
            )
    finally:
        # What some matches were given before it ended is solved, however it ended.
        call.request_solve_of_stale_groups()
    return {"matches": len(found.items), "shared": sum(item.shared for item in found.items)}


# Begun again, a share would be one more to take back.
POSITIONS = MatchJobType(
    "positions",
    "Share the main cameras' positions of {}",
    _share_positions,
    require_shareable_positions,
    undo_position_sharing,
    resumes=False,
)


def _adjust_rig(call: MatchJobContext, progress: JobProgress) -> Json:
    """The proposal and what of it was saved; ``what`` is asked for as ``rig.accept_rig`` takes it (none:
    nothing), with the ``inputs`` of the proposal that a person saw: no other one is saved."""
    what, inputs = call.job.request["what"], call.job.request["inputs"]
    progress(0, None, "Adjusting cameras to lines and balls.")
    with call.jobs.pool() as executor:
        proposed = propose_adjustment(call.store, call.dataset_id, executor=executor)
    progress.check()
    if what is not None:
        if inputs != proposed.inputs:
            raise ConflictError(
                "balls, lines or cameras have changed since that proposal",
                hint="Make a new proposal, and accept that.",
            )
        accept_rig(call.store, proposed, what, actor=call.job.actor)
        call.request_solve_of_stale_groups()
    return {**rig_proposal_to_json(proposed), "accepted": what}


RIG = MatchJobType(
    "rig", "Adjust the cameras of {}", _adjust_rig, require_adjustable_cameras, resumes=False
)


def undo_rig_adjustment(jobs: Jobs, store: Store, dataset: str, *, actor: str) -> int:
    """Take an accepted rig back, and solve its dataset, soon; returns the number of cameras.

    Raises:
        ConflictError: There is nothing to take back.
    """
    found = get_dataset_head(store, dataset)
    count = undo_accepted_rig(store, found.id, actor=actor)
    with without_pending_response():
        request_solve_job(jobs, store, found.id, actor=actor)
    return count
