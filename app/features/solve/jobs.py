"""The jobs that solve what has no solution, and all that solving a dataset is."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.features.datasets.queries import list_group_ids, read_dataset_name
from app.features.datasets.service import dataset_id, get_dataset_head, list_datasets
from app.features.jobs.job_run import JobProgress, make_counts_reporter
from app.features.jobs.queries import Job
from app.features.jobs.records import Then
from app.features.jobs.runner import Pool
from app.features.jobs.service import Jobs
from app.features.pitches.service import (
    DatasetPitches,
    change_pitches,
    estimate_pitches,
    list_matches_to_estimate,
)
from app.features.policies.noise import (
    choose_noise_sample,
    is_noise_estimated_when_solving,
    update_policy_noise,
)
from app.features.policies.service import PolicyState, apply_policy
from app.features.solutions.queries import list_unsolved_groups
from app.features.solutions.service import SolveReport, list_stale_groups, solve_dataset
from app.features.what_if.service import AT_ONCE, WhatIfStore
from app.progress import ReportProgress
from app.soccer.actors import LOCAL_USER
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.wording import plural


def solve_fully(
    store: Store,
    dataset: str | int,
    executor: Executor | None,
    progress: ReportProgress,
    stop: Callable[[], bool] = lambda: False,
    *,
    actor: str = LOCAL_USER,
    follow: bool = True,
) -> SolveReport:
    """Solve what is stale, and estimate the pitches of matches; ``refresh_yield_table`` comes after it.

    Where the policy says so the noise of clicks is estimated before: from some groups, so that
    the others are solved once.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where chunks of groups, and matches, are worked on; None: here, one by one.
        progress: Called with groups solved and in all; an error that it raises ends the run, and
            nothing that was saved before is lost.
        stop: Asked every now and then; once it says so, what is done is saved, and no more.
        actor: Who solves it.
        follow: Whether noise is estimated; an edit leaves it as it is.
    """
    ahead = SolveReport()
    if follow and is_noise_estimated_when_solving(store, dataset):
        ahead = solve_dataset(store, dataset, executor, progress, stop, choose_noise_sample)
        if not stop() and update_policy_noise(store, dataset, actor):
            ahead = SolveReport()
    report = solve_dataset(store, dataset, executor, progress, stop).merge_with_earlier(ahead)
    total = report.total
    if not stop():

        def report_estimated(done: int, _total: int | None = None, _said: str = "") -> None:
            report.estimated = done
            # It stays at the groups that are solved, and can be ended all the same.
            progress(total, total)

        found = estimate_pitches(store, dataset, executor, report_estimated, stop)
        report.proposed = len(found.proposals)
    return report


def describe_pending_work(store: Store, dataset: str | int) -> str | None:
    """A sentence about what ``solve_fully`` would do now; None: nothing."""
    groups, matches = (
        len(list_stale_groups(store, dataset)),
        len(list_matches_to_estimate(store, dataset)),
    )
    if groups:
        return f"{groups} are left to do"
    many = plural(matches, "match", "matches")
    return f"the pitch of {many} is left to estimate" if matches else None


def refresh_yield_table(
    store: Store, dataset: str | int, report: SolveReport, progress: ReportProgress
) -> None:
    """Count what a dataset yields where many groups were solved, so that the first look finds it."""
    if report.solved > AT_ONCE:
        found = get_dataset_head(store, dataset)
        progress(report.total, report.total, f"Counting the passing groups of {found.name}.")
        WhatIfStore(store).update_table(found.id)


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
class PolicyStateAndJob:
    """A dataset under another policy, the job that solves what that left stale, and how many groups
    that are."""

    state: PolicyState
    job: Job
    to_solve: int


@dataclass(frozen=True)
class PitchesAndJob:
    """The pitches of a dataset as they are now, and the job that solves what that left stale."""

    state: DatasetPitches
    job: Job


def request_solve_job(
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
        name = read_dataset_name(session, dataset_id)
    return jobs.submit(
        KIND,
        title or f"Solve {name}",
        partial(run_solve_job, store, jobs.pool),
        dataset_id=dataset_id,
        actor=actor,
        request={EDITED: True} if edited else None,
        once=True,
        then=then,
    )


def change_and_request_solve(
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

    def change_and_pass_job(session: Session, job: Job) -> None:
        changed.append(change(session, job))
        session.respond(changed[0])

    request_solve_job(jobs, store, dataset_id, actor=actor, then=change_and_pass_job)
    return changed[0]


def change_and_return_solve_job(
    jobs: Jobs,
    store: Store,
    dataset: str | int,
    change: Callable[[Session], object],
    *,
    actor: str,
) -> Job:
    """``change_and_request_solve`` by a dataset's name or id, answered with the job.

    Raises:
        NotFoundError: There is no such dataset.
    """

    def change_and_pass_job(session: Session, job: Job) -> Job:
        change(session)
        return job

    return change_and_request_solve(
        jobs, store, dataset_id(store, dataset), change_and_pass_job, actor=actor
    )


def request_policy_change(
    jobs: Jobs, store: Store, dataset_id: int, policy: Policy, *, if_match: str, actor: str
) -> PolicyStateAndJob:
    """Judge a dataset by another policy, and solve what that leaves stale, soon.

    Raises:
        StaleRevisionError: It was changed meanwhile.
    """

    def apply_policy_change(session: Session, job: Job) -> PolicyStateAndJob:
        state = apply_policy(session, dataset_id, policy, if_match=if_match, actor=actor)
        return PolicyStateAndJob(state, job, len(list_unsolved_groups(session, dataset_id)))

    return change_and_request_solve(jobs, store, dataset_id, apply_policy_change, actor=actor)


def request_pitch_change(
    jobs: Jobs,
    store: Store,
    dataset_id: int,
    wanted: dict[str, Pitch],
    *,
    if_match: str,
    actor: str,
) -> PitchesAndJob:
    """Give matches of a dataset another pitch, and solve what that leaves stale, soon.

    Raises:
        NotFoundError: There is no such match.
        StaleRevisionError: It was changed meanwhile.
    """

    def apply_pitch_change(session: Session, job: Job) -> PitchesAndJob:
        state = change_pitches(session, dataset_id, wanted, if_match=if_match, actor=actor)
        return PitchesAndJob(state, job)

    return change_and_request_solve(jobs, store, dataset_id, apply_pitch_change, actor=actor)


def register_solve_resume(jobs: Jobs, store: Store) -> None:
    """Let solving that an earlier server was at go on."""
    jobs.register_resume(KIND, partial(run_solve_job, store, jobs.pool))


def request_solve_of_leftovers(jobs: Jobs, store: Store, *, actor: str) -> None:
    """Solve whatever an earlier run, of the server or of a command, left undone."""
    for dataset in list_datasets(store):
        if list_stale_groups(store, dataset.id):
            request_solve_job(jobs, store, dataset.id, actor=actor)


def run_solve_job(store: Store, pool: Pool, progress: JobProgress) -> Json:
    """The work itself: what to do is found in the data when it starts."""
    actor, edited = progress.job.actor, bool((progress.job.request or {}).get(EDITED))
    found = get_dataset_head(store, progress.dataset_id)
    progress(0, None, f"Solving {found.name}.")
    stale, whole = len(list_stale_groups(store, found.id)), _count_groups(store, found.id)
    # A change of the policy may have met an edit's job that waited.
    follow = not edited or stale > MOSTLY * whole
    large = (
        stale >= WORTH_A_POOL
        or len(list_matches_to_estimate(store, found.id)) >= MATCHES_WORTH_A_POOL
    )
    with pool() if large else nullcontext() as executor:
        counter = make_counts_reporter(progress, "groups solved")
        report = solve_fully(store, found.id, executor, counter, actor=actor, follow=follow)
    refresh_yield_table(store, found.id, report, progress)
    progress(report.total, report.total, report.sentence)
    return {"policy": found.policy.name, **_report_values(report)}


def _count_groups(store: Store, dataset_id: int) -> int:
    with store.read() as session:
        return len(list_group_ids(session, dataset_id))


def _report_values(report: SolveReport) -> Json:
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
