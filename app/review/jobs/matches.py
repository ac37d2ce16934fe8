"""Work over the matches of a dataset, asked for, gone on with, and taken back."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from app.review.datasets.dataset import Dataset, DatasetHead, dataset_id, require_matches
from app.review.jobs.jobs import Jobs
from app.review.jobs.records import need_job
from app.review.jobs.run import JobProgress, Work
from app.review.jobs.solve import solve_after
from app.store.clock import now
from app.store.jobs import Job
from app.store.session import Session
from app.store.store import Store
from app.store.stored_json import Json


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
