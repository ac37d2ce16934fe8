"""Recompute: solves the groups of a dataset that have no solution under the present key.

Killed anywhere it loses nothing but the chunks in hand.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field

from app.plural import plural
from app.progress import TellProgress
from app.review.datasets.dataset import (
    DatasetHead,
    get_dataset_head,
    need_dataset,
    read_dataset_head,
)
from app.review.datasets.fan_out import fan_out
from app.review.editing.known import calibration_keys
from app.review.editing.smaller_tau import retell_task, retell_tasks
from app.review.editing.solve_encoded import Result, solve_encoded
from app.soccer.group import Group, Station
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate_station, calibration_key
from app.store.codecs import group_from_json, group_to_json
from app.store.groups import read_groups
from app.store.queue import refresh_queue
from app.store.session import Session
from app.store.solutions import (
    SolutionKey,
    decode_calibration,
    encode_calibration,
    insert_calibrations,
    insert_solutions,
    read_calibration_bodies,
    unsolved_groups,
)
from app.store.stations import read_stations, station_pitches
from app.store.store import Store
from app.store.stored_json import pack, unpack

FIRST_CHUNK, CHUNK, CHUNK_HERE = 2, 40, 8
"""Groups a task: a second of work, or a few when lines must be calibrated. The first ones are
small, so that a run that is killed early, again and again, comes to its end all the same. Without
other processes a chunk is what Ctrl+C has to wait for."""


@dataclass
class SolveReport:
    """What was done; ``failed`` are groups whose solving itself broke, with the reason.

    Attributes:
        estimated: Matches whose pitch was estimated.
        proposed: Matches of the dataset for which another pitch is proposed, then.
    """

    total: int = 0
    solved: int = 0
    passed: int = 0
    failed: list[tuple[str, str]] = field(default_factory=list)
    estimated: int = 0
    proposed: int = 0

    @property
    def sentence(self) -> str:
        """How many groups pass, how many do not, and how many could not be solved."""
        return outcome_sentence(self.solved, self.passed, len(self.failed))


def outcome_sentence(solved: int, passed: int, errors: int) -> str:
    """How many groups pass, how many do not, and how many could not be solved.

    Example:
        >>> outcome_sentence(solved=60, passed=52, errors=1)
        '52 pass, 8 do not; 1 error'
    """
    rest = solved - passed
    return f"{passed} pass, {rest} do not; {plural(errors, 'error')}"


@dataclass(frozen=True)
class Task:
    """A chunk of groups on its way to a worker: plain bytes, so that it travels anywhere."""

    groups: tuple[tuple[SolutionKey, bytes], ...]
    policy: Policy
    calibrations: Mapping[str, bytes]


def stale_groups(store: Store, dataset: str | int) -> list[int]:
    """Ids of groups without a solution for their present state, policy and solver, in order."""
    with store.read() as session:
        return unsolved_groups(session, need_dataset(session, dataset))


def solve_dataset(
    store: Store,
    dataset: str | int,
    executor: Executor | None = None,
    progress: TellProgress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> SolveReport:
    """Solve what is stale in a dataset.

    Args:
        store: The database.
        dataset: Name or id.
        executor: Where chunks are solved; None: here, one after the other.
        progress: Called after each chunk; an error that it raises ends the run, and nothing
            that was saved before is lost.
        stop: Asked every now and then; once it says so, what is done is saved, and no more.
    """
    found, ids = get_dataset_head(store, dataset), stale_groups(store, dataset)
    report = SolveReport(total=len(ids))

    def keep(results: Sequence[Result]) -> None:
        _save(store, results, report)
        if progress is not None:
            progress(report.solved + len(report.failed), report.total)

    keep([])
    for results in fan_out(retell_task, retell_tasks(store, found, ids), executor, stop):
        keep(results)
    if report.solved:
        ids = stale_groups(store, dataset)
    _calibrate_shared(store, found)
    largest = CHUNK if executor is not None else min(CHUNK, CHUNK_HERE)
    tasks = (_task(store, found, chunk) for chunk in _chunks(ids, largest))
    for results in fan_out(solve_task, tasks, executor, stop):
        keep(results)
    return report


def _chunks(ids: Sequence[int], largest: int) -> Iterator[Sequence[int]]:
    start, size = 0, FIRST_CHUNK
    while start < len(ids):
        yield ids[start : start + size]
        start, size = start + size, min(2 * size, largest)


def solve_task(task: Task) -> list[Result]:
    """Solve the groups of a task; runs in a worker."""
    known = {key: decode_calibration(body) for key, body in task.calibrations.items()}
    return [
        _solve_one(key, group_from_json(unpack(body)), task, known) for key, body in task.groups
    ]


def _solve_one(key: SolutionKey, group: Group, task: Task, known: dict[str, Calibration]) -> Result:
    try:
        solution, encoded = solve_encoded(group, task.policy, known)
    except Exception as error:
        # One broken group must not stop the others; it stays stale and is reported by name.
        return Result(key, group.key, problem=f"{type(error).__name__}: {error}")
    return Result(key, group.key, solution.passes, encoded)


def _save(store: Store, results: Sequence[Result], report: SolveReport) -> None:
    solutions = [(item.key, item.solution) for item in results if item.solution is not None]
    if not results:
        return
    with store.write() as session:
        insert_solutions(session, solutions)
        refresh_queue(session, [key.group_id for key, _ in solutions])
    report.solved += len(solutions)
    report.passed += sum(item.passes for item in results)
    report.failed += [(item.group, item.problem) for item in results if item.solution is None]


def _task(store: Store, dataset: DatasetHead, ids: Sequence[int]) -> Task:
    with store.read() as session:
        policy = read_dataset_head(session, dataset.id).policy
        stored = read_groups(session, ids, extras=False).values()
        keys = calibration_keys((item.group for item in stored), policy)
        known = read_calibration_bodies(session, keys)
    groups = tuple(
        (SolutionKey(item.id, item.inputs_hash, policy.hash), pack(group_to_json(item.group)))
        for item in stored
    )
    return Task(groups, policy, known)


def _calibrate_shared(store: Store, dataset: DatasetHead) -> None:
    """Calibrate each static camera once, before the chunks that all need it are sent out."""
    policy = dataset.policy
    with store.read() as session:
        cameras = {
            calibration_key(station, pitch, policy.calibration): (station, pitch)
            for station, pitch in _shared(session, dataset.id)
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


def _shared(session: Session, dataset_id: int) -> Iterable[tuple[Station, Pitch]]:
    """Static cameras with each size of pitch that their groups have."""
    places = station_pitches(session, dataset_id)
    stations = read_stations(session, {station for station, _ in places})
    return [(stations[station].station, pitch) for station, pitch in places]
