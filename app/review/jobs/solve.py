"""The job that solves what a change of a station, a policy or an import left without a solution."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TypeVar

from app.review.datasets.dataset import get_dataset_head, list_datasets
from app.review.editing.pitches import DatasetPitches, apply_pitches, stale_matches
from app.review.editing.recompute import SolveReport, stale_groups
from app.review.jobs.full_solve import count_yield, solve_fully
from app.review.jobs.jobs import Jobs, Pool
from app.review.jobs.records import Then
from app.review.jobs.run import JobProgress, Work, counting
from app.review.policies.policy import PolicyState, apply_policy
from app.soccer.actors import LOCAL_USER
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.store.datasets import dataset_name, group_ids
from app.store.jobs import Job
from app.store.session import Session
from app.store.solutions import unsolved_groups
from app.store.store import Store
from app.store.stored_json import Json

KIND, EDITED = "solve", "edited"
Changed = TypeVar("Changed")
WORTH_A_POOL = 400
"""Groups from which on starting processes costs less than it saves the requests."""
MATCHES_WORTH_A_POOL = 4
"""The same in matches whose pitch is estimated: that looks at all lines of a match."""
MOSTLY = 0.5
"""Of a dataset's groups: where more are stale, it was no edit that left them so."""
NAMED = 20
"""Groups whose solving broke that are named in a result; all are counted."""


@dataclass(frozen=True)
class PolicyJob:
    """A dataset under another policy, the job that solves what that left stale, and how many groups
    that are."""

    state: PolicyState
    job: Job
    to_solve: int


@dataclass(frozen=True)
class PitchJob:
    """The pitches of a dataset as they are now, and the job that solves what that left stale."""

    state: DatasetPitches
    job: Job


def request_solve(
    jobs: Jobs,
    store: Store,
    dataset_id: int,
    *,
    actor: str,
    title: str | None = None,
    edited: bool = False,
    then: Then = Session.respond,
) -> Job:
    """Solve what is stale in a dataset, soon; one job a dataset waits at most.

    ``edited``: by an edit, with which no noise is estimated anew.
    """
    with store.read() as session:
        name = dataset_name(session, dataset_id)
    return jobs.submit(
        KIND,
        title or f"Solve {name}",
        solve_work(store, dataset_id, jobs.pool, actor=actor, edited=edited),
        dataset_id=dataset_id,
        actor=actor,
        request={EDITED: True} if edited else None,
        once=True,
        then=then,
    )


def solve_after(
    jobs: Jobs,
    store: Store,
    dataset_id: int,
    change: Callable[[Session, Job], Changed],
    *,
    actor: str,
) -> Changed:
    """Change something of a dataset and solve what that leaves stale, soon: both, or neither.

    Args:
        jobs: Where the job is queued.
        store: The database.
        dataset_id: The dataset.
        change: Makes the change, in the transaction of the job's record; the request is
            answered with what it returns.
        actor: Who says so.
    """
    changed: list[Changed] = []

    def both(session: Session, job: Job) -> None:
        changed.append(change(session, job))
        session.respond(changed[0])

    request_solve(jobs, store, dataset_id, actor=actor, then=both)
    return changed[0]


def request_policy(
    jobs: Jobs, store: Store, dataset_id: int, policy: Policy, *, if_match: str, actor: str
) -> PolicyJob:
    """Judge a dataset by another policy, and solve what that leaves stale, soon.

    Raises:
        StaleRevisionError: Somebody else was faster.
    """

    def change(session: Session, job: Job) -> PolicyJob:
        state = apply_policy(session, dataset_id, policy, if_match=if_match, actor=actor)
        return PolicyJob(state, job, len(unsolved_groups(session, dataset_id)))

    return solve_after(jobs, store, dataset_id, change, actor=actor)


def request_pitches(
    jobs: Jobs,
    store: Store,
    dataset_id: int,
    wanted: dict[str, Pitch],
    *,
    if_match: str,
    actor: str,
) -> PitchJob:
    """Give matches of a dataset another pitch, and solve what that leaves stale, soon.

    Raises:
        NotFoundError: There is no such match.
        StaleRevisionError: Somebody else was faster.
    """

    def change(session: Session, job: Job) -> PitchJob:
        state = apply_pitches(session, dataset_id, wanted, if_match=if_match, actor=actor)
        return PitchJob(state, job)

    return solve_after(jobs, store, dataset_id, change, actor=actor)


def request_estimates(jobs: Jobs, store: Store, dataset: str | int, *, actor: str) -> Job:
    """Estimate the pitches of a dataset's matches that are not estimated yet, soon.

    That is a part of solving; where the dataset is being solved already, that job does it.

    Raises:
        NotFoundError: There is no such dataset.
    """
    found = get_dataset_head(store, dataset)
    title = f"Estimate the pitches of {found.name}"
    return request_solve(jobs, store, found.id, actor=actor, title=title)


def resume_solving(jobs: Jobs, store: Store) -> None:
    """Let solving that an earlier server was at go on."""

    def work(job: Job) -> Work:
        edited = bool(job.request and job.request.get(EDITED))
        return solve_work(store, job.dataset_id or 0, jobs.pool, actor=job.actor, edited=edited)

    jobs.resumes(KIND, work)


def solve_leftovers(jobs: Jobs, store: Store, *, actor: str) -> None:
    """Solve whatever an earlier run, of the server or of a command, left undone."""
    for dataset in list_datasets(store):
        if stale_groups(store, dataset.id):
            request_solve(jobs, store, dataset.id, actor=actor)


def solve_work(
    store: Store,
    dataset_id: int,
    pool: Pool = nullcontext,
    *,
    actor: str = LOCAL_USER,
    edited: bool = False,
) -> Work:
    """The work itself: what to do is found in the data when it starts."""

    def work(progress: JobProgress) -> Json:
        found = get_dataset_head(store, dataset_id)
        progress(0, None, f"Solving {found.name}.")
        stale, whole = len(stale_groups(store, dataset_id)), _group_count(store, dataset_id)
        # A change of the policy may have met an edit's job that waited.
        follow = not edited or stale > MOSTLY * whole
        large = (
            stale >= WORTH_A_POOL or len(stale_matches(store, dataset_id)) >= MATCHES_WORTH_A_POOL
        )
        with pool() if large else nullcontext() as executor:
            told = counting(progress, "groups solved")
            report = solve_fully(store, dataset_id, executor, told, actor=actor, follow=follow)
        count_yield(store, dataset_id, report, progress)
        progress(report.total, report.total, report.sentence)
        return {"policy": found.policy.name, **_report(report)}

    return work


def _group_count(store: Store, dataset_id: int) -> int:
    with store.read() as session:
        return len(group_ids(session, dataset_id))


def _report(report: SolveReport) -> Json:
    named = [{"group": key, "problem": problem} for key, problem in report.failed[:NAMED]]
    return {
        "groups": report.total,
        "solved": report.solved,
        "passed": report.passed,
        "failed": len(report.failed),
        "failures": named,
        "estimated": report.estimated,
        "proposed": report.proposed,
        "failing": dict(report.failing),
        "advice": report.advice,
    }
