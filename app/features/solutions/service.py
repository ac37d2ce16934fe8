"""Solve the groups of a dataset that have no solution under the present policy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace

import numpy as np

from app.db.json_columns import compress_json, decompress_json
from app.db.session import Session
from app.db.store import Store
from app.errors import DamagedError
from app.features.datasets.service import (
    DatasetHead,
    get_dataset_head,
    read_dataset_head,
    require_dataset_id,
)
from app.features.groups.queries import read_groups
from app.features.groups.view_queries import list_station_pitches, read_stations
from app.features.policies.queries import read_policy_history
from app.features.queue.refresh_queries import refresh_queue
from app.features.solutions.queries import (
    EncodedSolution,
    SolutionKey,
    decode_calibration,
    encode_calibration,
    encode_solution,
    insert_calibrations,
    insert_solutions,
    list_unsolved_groups,
    read_calibration_bodies,
    read_calibrations,
)
from app.features.solutions.stored_queries import ReusableSolution, list_reusable_solutions
from app.progress import ReportProgress
from app.soccer.codec import group_from_json, group_to_json
from app.soccer.group import Group, Station
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Calibration, Solution
from app.solving.calibrate import (
    calibrate_station,
    compute_calibration_key,
    compute_view_calibration_keys,
)
from app.solving.facts import facts_from_bytes, facts_to_bytes
from app.solving.solve import (
    differs_only_in_smaller_tau,
    has_unchanged_pairs,
    rethreshold_solution,
    solve_and_collect_facts,
)
from app.wording import plural
from app.workers.executors import run_tasks


def find_contradicted_cameras(
    stations: Iterable[tuple[Station, Pitch]], policy: Policy
) -> dict[str, float]:
    """JaC of the static cameras whose lines do not fit the camera that was given, by their keys.

    Args:
        stations: Cameras, each with a pitch that it shows.
        policy: With the gate of JaC that they fail.
    """
    found = dict[str, float]()
    for station, pitch in stations:
        is_given = station.given is not None and station.calibration == "given"
        if not (station.shared and station.lines and is_given):
            continue
        fitted = calibrate_station(station, pitch, policy.calibration)
        if fitted.jac is None:
            continue
        gamma_px = policy.jac_gamma_percent / 100 * station.size.diagonal
        close = sum(fit.counted_px < gamma_px for fit in fitted.markings)
        jac = close / max(len(fitted.markings), 1)
        if jac <= policy.min_jac:
            found[station.key] = jac
    return found


def describe_contradiction(off: Mapping[str, float], where: str, how: str) -> str:
    """What ``find_contradicted_cameras`` found, and what to do.

    Args:
        off: What it found.
        where: Which groups that concerns.
        how: What imports again without the lines.
    """
    low, high = (f"{jac:.2f}" for jac in (min(off.values()), max(off.values())))
    return (
        f"The lines of {', '.join(sorted(off))} do not fit the given "
        f"calibration (JaC {low if low == high else f'{low} to {high}'}): "
        f"{where}. If they were drawn for another day, {how} uses the given cameras as they are and "
        "ignores the lines."
    )


def list_calibration_keys(groups: Iterable[Group], policy: Policy) -> set[str]:
    """Keys of the calibrations that groups need under a policy, or that those start from."""
    part = policy.calibration
    return {
        key
        for group in groups
        for view in group.views
        for key in compute_view_calibration_keys(group, view, part)
    }


def read_known_calibrations(
    session: Session, groups: Iterable[Group], policy: Policy
) -> dict[str, Calibration]:
    """The stored ones among the calibrations that groups need."""
    return read_calibrations(session, list_calibration_keys(groups, policy))


Solve = Callable[[Group, Policy, Mapping[str, Calibration]], tuple[Solution, EncodedSolution]]
"""``solve_and_encode``, or who has another process do it."""


@dataclass(frozen=True)
class SolveResult:
    """What a worker sends back for one group: a solution, or the reason why there is none."""

    key: SolutionKey
    group: str
    passes: bool = False
    solution: EncodedSolution | None = None
    problem: str = ""


def solve_and_encode(
    group: Group, policy: Policy, known: Mapping[str, Calibration]
) -> tuple[Solution, EncodedSolution]:
    """The solution of a group, and its bytes; calibrations that are known are not encoded again."""
    solution, facts = solve_and_collect_facts(group, policy, known)
    return solution, encode_solution(group, solution, known, facts_to_bytes(facts))


RETHRESHOLDED_AT_ONCE = 200
"""Groups a task: a fraction of a second."""


@dataclass(frozen=True)
class RethresholdTask:
    """Groups on their way to a worker: solutions under policies of before, those by their hash."""

    kept: tuple[ReusableSolution, ...]
    before: Mapping[str, Policy]
    policy: Policy


def make_rethreshold_tasks(
    store: Store, dataset: DatasetHead, ids: Sequence[int]
) -> Iterator[RethresholdTask]:
    """What can be retold of groups that have no solution under the policy of their dataset."""
    with store.read() as session:
        history = read_policy_history(session, dataset.id)
    policy = dataset.policy
    before = {
        item.policy.hash: item.policy
        for item in history
        if differs_only_in_smaller_tau(policy, item.policy)
    }
    for start in range(0, len(ids) if before else 0, RETHRESHOLDED_AT_ONCE):
        with store.read() as session:
            kept = list_reusable_solutions(
                session, ids[start : start + RETHRESHOLDED_AT_ONCE], before
            )
        if kept:
            yield RethresholdTask(tuple(kept), before, policy)


def run_rethreshold_task(task: RethresholdTask) -> list[SolveResult]:
    """The solutions of those groups of which tau decides nothing new; runs in a worker.

    What is damaged is left out, like all others: it is solved.
    """
    try:
        return [
            result
            for kept in _group_solutions_by_policy(task)
            for result in _apply_thresholds(task, kept)
        ]
    except DamagedError:
        return []


def _group_solutions_by_policy(task: RethresholdTask) -> Iterator[list[ReusableSolution]]:
    for digest in task.before:
        kept = [item for item in task.kept if item.policy_hash == digest]
        if kept:
            yield kept


def _apply_thresholds(
    task: RethresholdTask, kept: Sequence[ReusableSolution]
) -> Iterator[SolveResult]:
    policy = task.policy
    facts = facts_from_bytes([item.facts for item in kept])
    same = has_unchanged_pairs(facts, task.before[kept[0].policy_hash], policy)
    ends = np.cumsum(np.bincount(facts.view_group, minlength=facts.groups))
    diagonals = np.split(facts.view_diagonal, ends[:-1])
    for place in np.flatnonzero(same).tolist():
        item = kept[place]
        solution = rethreshold_solution(item.solution, diagonals[place].tolist(), policy)
        if solution is not None:
            key = SolutionKey(item.group_id, item.inputs_hash, policy.hash)
            yield SolveResult(key, item.group, solution.passes, item.encode(solution))


_AGAIN = "importing the files again with `--calibration given`"
FIRST_CHUNK, CHUNK, CHUNK_HERE = 2, 40, 8
"""Groups a task: a second of work, or a few when lines must be calibrated. The first ones are
small, so that a run that is killed early, again and again, comes to its end all the same. Without
other processes a chunk is what Ctrl+C has to wait for."""


@dataclass
class SolveReport:
    """What was done.

    Attributes:
        failed: Groups whose solving itself broke, with the reason.
        estimated: Matches whose pitch was estimated.
        proposed: Matches of the dataset for which another pitch is proposed, then.
        failing: How many of those that do not pass fail first at a gate, by its name.
        advice: What to do about them; empty where nothing is known.
    """

    total: int = 0
    solved: int = 0
    passed: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    estimated: int = 0
    proposed: int = 0
    failing: Counter[str] = field(default_factory=Counter)
    advice: str = ""

    def merge_with_earlier(self, other: SolveReport) -> SolveReport:
        """Both together; the other was made before, and what failed there was tried again."""
        return replace(
            self,
            total=other.total - len(other.failed) + self.total,
            solved=other.solved + self.solved,
            passed=other.passed + self.passed,
            failed=[*{**dict(other.failed), **dict(self.failed)}.items()],
            failing=other.failing + self.failing,
        )

    @property
    def sentence(self) -> str:
        """How many groups pass, how many do not and why, and how many could not be solved."""
        outcome = describe_outcome(self.solved, self.passed, len(self.failed), self.failing)
        return f"{outcome}. {self.advice}" if self.advice else outcome


def describe_outcome(
    solved: int, passed: int, errors: int, failing: Mapping[str, int] | None = None
) -> str:
    """How many groups pass, how many do not and at which gates, and how many could not be solved.

    Example:
        >>> describe_outcome(solved=60, passed=52, errors=1, failing={"jac": 8})
        '52 pass, 8 do not (first failing gate: jac 8); 1 error'
    """
    ranked = sorted((failing or {}).items(), key=lambda item: -item[1])
    gates = ", ".join(f"{gate} {count:,}" for gate, count in ranked)
    why = f" (first failing gate: {gates})" if gates else ""
    return f"{passed} pass, {solved - passed} do not{why}; {plural(errors, 'error')}"


@dataclass(frozen=True)
class SolveTask:
    """A chunk of groups on its way to a worker: plain bytes, so that it travels anywhere."""

    groups: tuple[tuple[SolutionKey, bytes], ...]
    policy: Policy
    calibrations: Mapping[str, bytes]


def list_stale_groups(store: Store, dataset: str | int) -> list[int]:
    """Ids of groups without a solution for their present state, policy and solver, in order."""
    with store.read() as session:
        return list_unsolved_groups(session, require_dataset_id(session, dataset))


def solve_dataset(
    store: Store,
    dataset: str | int,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
    stop: Callable[[], bool] = lambda: False,
    chosen: Callable[[Sequence[int]], Sequence[int]] = lambda ids: ids,
) -> SolveReport:
    """Solve what is stale in a dataset.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where chunks are solved; None: here, one after the other.
        progress: Called after each chunk; an error that it raises ends the run, and nothing
            that was saved before is lost.
        stop: Asked every now and then; once it says so, what is done is saved, and no more.
        chosen: Of the ids of stale groups those that are solved.
    """
    found, ids = get_dataset_head(store, dataset), chosen(list_stale_groups(store, dataset))
    report = SolveReport(total=len(ids))

    def save_and_report(results: Sequence[SolveResult]) -> None:
        _save_results(store, results, report)
        if progress is not None:
            progress(report.solved + len(report.failed), report.total)

    save_and_report([])
    for results in run_tasks(
        run_rethreshold_task, make_rethreshold_tasks(store, found, ids), executor, stop
    ):
        save_and_report(results)
    if report.solved:
        left = set(list_stale_groups(store, dataset))
        ids = [number for number in ids if number in left]
    _calibrate_static_cameras(store, found)
    largest = CHUNK if executor is not None else min(CHUNK, CHUNK_HERE)
    tasks = (_make_task(store, found, chunk) for chunk in _split_into_chunks(ids, largest))
    for results in run_tasks(solve_task, tasks, executor, stop):
        save_and_report(results)
    if report.failing["jac"]:
        with store.read() as session:
            off = find_contradicted_cameras(
                _static_cameras_with_pitches(session, found.id), found.policy
            )
        where = f"{report.failing['jac']:,} of {report.solved:,} groups fail first at the gate jac"
        report.advice = describe_contradiction(off, where, _AGAIN) if off else ""
    return report


def _split_into_chunks(ids: Sequence[int], largest: int) -> Iterator[Sequence[int]]:
    start, size = 0, FIRST_CHUNK
    while start < len(ids):
        yield ids[start : start + size]
        start, size = start + size, min(2 * size, largest)


def solve_task(task: SolveTask) -> list[SolveResult]:
    """Solve the groups of a task; runs in a worker."""
    known = {key: decode_calibration(body) for key, body in task.calibrations.items()}
    return [
        _solve_group(key, group_from_json(decompress_json(body)), task, known)
        for key, body in task.groups
    ]


def _solve_group(
    key: SolutionKey, group: Group, task: SolveTask, known: dict[str, Calibration]
) -> SolveResult:
    try:
        solution, encoded = solve_and_encode(group, task.policy, known)
    except Exception as error:
        # One broken group must not stop the others; it stays stale and is reported by name.
        return SolveResult(key, group.key, problem=f"{type(error).__name__}: {error}")
    return SolveResult(key, group.key, solution.passes, encoded)


def _save_results(store: Store, results: Sequence[SolveResult], report: SolveReport) -> None:
    solutions = [(item.key, item.solution) for item in results if item.solution is not None]
    if not results:
        return
    with store.write() as session:
        insert_solutions(session, solutions)
        refresh_queue(session, [key.group_id for key, _ in solutions])
    report.solved += len(solutions)
    report.passed += sum(item.passes for item in results)
    gates = (item.solution.summary.gate for item in results if item.solution is not None)
    report.failing.update(gate for gate in gates if gate is not None)
    report.failed += [(item.group, item.problem) for item in results if item.solution is None]


def _make_task(store: Store, dataset: DatasetHead, ids: Sequence[int]) -> SolveTask:
    with store.read() as session:
        policy = read_dataset_head(session, dataset.id).policy
        stored = read_groups(session, ids, extras=False).values()
        keys = list_calibration_keys((item.group for item in stored), policy)
        known = read_calibration_bodies(session, keys)
    groups = tuple(
        (
            SolutionKey(item.id, item.inputs_hash, policy.hash),
            compress_json(group_to_json(item.group)),
        )
        for item in stored
    )
    return SolveTask(groups, policy, known)


def _calibrate_static_cameras(store: Store, dataset: DatasetHead) -> None:
    """Calibrate each static camera once, before the chunks that all need it are sent out."""
    policy = dataset.policy
    with store.read() as session:
        cameras = {
            compute_calibration_key(station, pitch, policy.calibration): (station, pitch)
            for station, pitch in _static_cameras_with_pitches(session, dataset.id)
        }
        known = read_calibration_bodies(session, cameras)
    bodies = {
        key: encode_calibration(calibrate_station(station, pitch, policy.calibration))
        for key, (station, pitch) in cameras.items()
        if key not in known
    }
    if bodies:
        with store.write() as session:
            insert_calibrations(session, bodies)


def _static_cameras_with_pitches(
    session: Session, dataset_id: int
) -> Iterable[tuple[Station, Pitch]]:
    """Static cameras with each size of pitch that their groups have."""
    places = list_station_pitches(session, dataset_id)
    stations = read_stations(session, {station for station, _ in places})
    return [(stations[station].station, pitch) for station, pitch in places]
