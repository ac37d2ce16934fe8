"""Jobs that estimate something of matches, accept it or take it back.

Each of them solves what it leaves stale.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass

from app.db.idempotency import without_response
from app.db.json_columns import Json
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError
from app.features.datasets.service import (
    Dataset,
    DatasetHead,
    dataset_id,
    get_dataset_head,
    require_matches,
)
from app.features.groups.ball_noise import give_factors
from app.features.groups.codecs import picture_to_json
from app.features.jobs.queries import Job
from app.features.jobs.records import need_job
from app.features.jobs.run import JobProgress, Work, counting
from app.features.jobs.service import Jobs
from app.features.match_estimates.pictures import apply_pictures, estimate_pictures
from app.features.match_estimates.positions import (
    apply_take_back,
    require_sharable,
    share_positions,
)
from app.features.match_estimates.rig import accept, adjustable, proposal_values, propose, take_back
from app.features.policies.noise import Noise, accept_noise
from app.features.policies.service import read_policy
from app.features.solve.jobs import request_solve, solve_after
from app.soccer.picture import PictureGeometry


@dataclass(frozen=True)
class MatchesAsked:
    """What one job was asked for.

    Attributes:
        jobs: Where it runs, and where what follows from it is queued.
        store: The database.
        dataset_id: The dataset.
        match: By name; None: all.
        actor: Who wants it.
        run: The job's name for itself, the same after a restart; None unless its kind has one.
    """

    jobs: Jobs
    store: Store
    dataset_id: int
    match: str | None
    actor: str
    run: str | None = None

    @property
    def matches(self) -> list[str] | None:
        """The matches by name; None: all."""
        return None if self.match is None else [self.match]


def with_matches(store: Store, dataset: str | int, matches: Collection[str] | None) -> DatasetHead:
    """The dataset that has all of these matches.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    with store.read() as session:
        return require_matches(session, dataset, matches)


@dataclass(frozen=True)
class MatchJob:
    """A kind of job over one match of a dataset, or all.

    Attributes:
        kind: What it is, for programs.
        title: What it is, for people; braces stand for the dataset's name.
        work: Does it, and returns its result.
        require: The dataset, unless such a job is refused.
        has_runs: Whether what a job gives bears a name, by which it is taken back.
    """

    kind: str
    title: str
    work: Callable[[MatchesAsked, JobProgress], Json]
    require: Callable[[Store, str | int, Collection[str] | None], Dataset | DatasetHead] = (
        with_matches
    )
    has_runs: bool = False

    def request(
        self, jobs: Jobs, store: Store, dataset: str | int, match: str | None, *, actor: str
    ) -> Job:
        """Have it done soon, in one match or all.

        Raises:
            ConflictError, NotFoundError: As ``require`` does, at once.
        """
        found = self.require(store, dataset, None if match is None else [match])
        run = now() if self.has_runs else None
        asked = MatchesAsked(jobs, store, found.id, match, actor, run)
        return jobs.submit(
            self.kind,
            self.title.format(found.name),
            self._work(asked),
            dataset_id=found.id,
            actor=actor,
            request={"match": match} if run is None else {"match": match, "run": run},
        )

    def resume(self, jobs: Jobs, store: Store) -> None:
        """Let what an earlier server was at go on; its work leaves alone what is done."""
        jobs.resumes(self.kind, self._work_of(jobs, store))

    def make(self, jobs: Jobs, store: Store) -> None:
        """Let another process carry out what this one is asked for; after a death nothing goes on."""
        jobs.makes(self.kind, self._work_of(jobs, store))

    def _work_of(self, jobs: Jobs, store: Store) -> Callable[[Job], Work]:
        def work_of(job: Job) -> Work:
            match, run = job.request["match"], job.request.get("run")
            return self._work(MatchesAsked(jobs, store, job.dataset_id or 0, match, job.actor, run))

        return work_of

    def take_back(
        self,
        jobs: Jobs,
        store: Store,
        dataset: str | int,
        apply: Callable[[Session, int, list[Job]], list[Job]],
        *,
        actor: str,
    ) -> Job:
        """Take back what such jobs gave, end those at it, and solve what that leaves stale, soon:
        all of it, or nothing.

        Args:
            jobs: Where they wait or run.
            store: The database.
            dataset: By name or id.
            apply: Takes back from the dataset of an id, given the jobs that wait or run; returns
                those of them that end.
            actor: Who wants it.
        """
        number = dataset_id(store, dataset)
        ended: list[int] = []

        def change(session: Session, job: Job) -> Job:
            present = [need_job(session, other) for other in jobs.ids_of(number, self.kind)]
            ended.extend(item.id for item in apply(session, number, present))
            # Whoever is at it waits for this transaction, and asks in the next whether to go on.
            jobs.end_with(session, ended)
            return job

        job = solve_after(jobs, store, number, change, actor=actor)
        jobs.cancel_each(ended)
        return job

    def _work(self, asked: MatchesAsked) -> Work:
        return lambda progress: self.work(asked, progress)


def request_noise(jobs: Jobs, store: Store, noise: Noise, *, actor: str) -> Job:
    """Judge a dataset by the noise that was estimated, and solve it, soon.

    Raises:
        StaleRevisionError: The policy is another by now.
    """
    state = read_policy(store, noise.dataset_id)

    def change(session: Session, job: Job) -> Job:
        accept_noise(session, noise, state, actor)
        return job

    return solve_after(jobs, store, noise.dataset_id, change, actor=actor)


def request_noise_back(jobs: Jobs, store: Store, dataset: str | int, *, actor: str) -> Job:
    """Take all balls to be as noisy as their dataset's, and solve it, soon.

    Raises:
        NotFoundError: There is no such dataset.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        give_factors(session, number, (), actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor)


def request_pictures(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    wanted: Mapping[str, PictureGeometry | None],
    *,
    actor: str,
) -> Job:
    """Say what main cameras' pictures of matches are, and solve what that leaves stale, soon.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    number = dataset_id(store, dataset)

    def change(session: Session, job: Job) -> Job:
        apply_pictures(session, number, wanted, actor=actor)
        return job

    return solve_after(jobs, store, number, change, actor=actor)


def _estimate(asked: MatchesAsked, progress: JobProgress) -> Json:
    with asked.jobs.pool() as executor:
        told = counting(progress, "matches")
        found = estimate_pictures(asked.store, asked.dataset_id, executor, told, asked.matches)
    return {
        "items": [
            {
                "match": item.match,
                "frames": item.frames,
                "estimate": None
                if item.estimate is None
                else picture_to_json(item.estimate.picture),
                "proposed": picture_to_json(item.proposed),
                "sentence": item.sentence,
            }
            for item in found
        ]
    }


PICTURES = MatchJob("pictures", "Estimate the pictures of {}", _estimate)


def take_positions_back(
    jobs: Jobs, store: Store, dataset: str | int, match: str, *, actor: str
) -> Job:
    """Take shared positions of a match back, and solve its dataset, soon.

    A share of it, or of all matches, that waits or runs is cancelled and gives nothing afterwards;
    it is the last one.

    Raises:
        ConflictError, NotFoundError: As ``editing.positions.take_back_positions`` does.
    """

    def apply(session: Session, number: int, present: list[Job]) -> list[Job]:
        ended = [job for job in present if job.request["match"] in (None, match)]
        stopped = [job.started for job in ended]
        apply_take_back(session, number, match, actor=actor, stopped=stopped)
        return ended

    return POSITIONS.take_back(jobs, store, dataset, apply, actor=actor)


def _share(asked: MatchesAsked, progress: JobProgress) -> Json:
    try:
        with asked.jobs.pool() as executor:
            found = share_positions(
                asked.store,
                asked.dataset_id,
                asked.matches,
                actor=asked.actor,
                executor=executor,
                progress=counting(progress, "matches"),
                require_wanted=progress.require_wanted,
            )
    finally:
        # What some matches were given before it ended is solved, however it ended.
        request_solve(asked.jobs, asked.store, asked.dataset_id, actor=asked.actor)
    return {"matches": len(found.items), "shared": sum(item.shared for item in found.items)}


POSITIONS = MatchJob(
    "positions", "Share the main cameras' positions of {}", _share, require_sharable
)


KIND = "rig"


def request_rig(
    jobs: Jobs, store: Store, dataset: str, *, what: str | None, inputs: str | None, actor: str
) -> Job:
    """Adjust the static cameras of a dataset, soon; what can be refused is refused at once.

    Args:
        jobs: Where it is queued.
        store: The database.
        dataset: Name or id.
        what: What of the proposal is saved, as ``editing.rig.accept`` takes it; None: nothing.
        inputs: Of the proposal that a person saw; no other one is saved.
        actor: Who wants it.

    Raises:
        InputError, ConflictError: As ``editing.rig.adjustable`` does.
    """
    found = get_dataset_head(store, dataset)
    adjustable(store, found.id)
    return jobs.submit(
        KIND,
        f"Adjust the cameras of {found.name}",
        rig_work(jobs, store, found.id, what, inputs, actor),
        dataset_id=found.id,
        actor=actor,
        request={"what": what, "inputs": inputs},
    )


def make_rigs(jobs: Jobs, store: Store) -> None:
    """Let another process adjust the cameras than the one that was asked."""

    def work_of(job: Job) -> Work:
        what, inputs = job.request["what"], job.request["inputs"]
        return rig_work(jobs, store, job.dataset_id or 0, what, inputs, job.actor)

    jobs.makes(KIND, work_of)


def take_rig_back(jobs: Jobs, store: Store, dataset: str, *, actor: str) -> int:
    """Take an accepted rig back, and solve its dataset, soon; returns the number of cameras.

    Raises:
        ConflictError: There is nothing to take back.
    """
    found = get_dataset_head(store, dataset)
    count = take_back(store, found.id, actor=actor)
    with without_response():
        request_solve(jobs, store, found.id, actor=actor)
    return count


def rig_work(
    jobs: Jobs, store: Store, dataset_id: int, what: str | None, inputs: str | None, actor: str
) -> Work:
    """The work itself; its result is the proposal and what of it was saved."""

    def work(progress: JobProgress) -> Json:
        progress(0, None, "Adjusting cameras to lines and balls.")
        with jobs.pool() as executor:
            proposed = propose(store, dataset_id, executor=executor)
        progress.check()
        if what is not None:
            if inputs != proposed.inputs:
                raise ConflictError(
                    "balls, lines or cameras have changed since that proposal",
                    hint="Look at a new one, and accept that.",
                )
            accept(store, proposed, what, actor=actor)
            request_solve(jobs, store, dataset_id, actor=actor)
        return {**proposal_values(proposed), "accepted": what}

    return work
