"""Verify: a frozen version computed once more from scratch, and compared bit for bit."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from typing import Any

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import DamagedError, JobCancelled, ReviewError, StorageError
from app.features.solutions.queries import decode_calibration, encode_calibration, encode_solution
from app.features.tracks.codec import TRACK_VERSION, recompute_frozen_track
from app.features.versions.frozen_queries import (
    CALIBRATION,
    collect_shared_keys,
    compute_content_key,
    decode_frozen_json,
    decode_frozen_text,
    read_frozen,
    thaw_group,
)
from app.features.versions.queries import (
    VersionGroup,
    iterate_version_group_state_rows,
    read_page,
    read_version_matches,
    save_verification,
)
from app.features.versions.service import (
    Version,
    collect_calibration_keys,
    hash_version,
    read_version,
)
from app.json_text import canonical_json_text, digest_content
from app.progress import ReportProgress
from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import SOLVER_VERSION, Calibration
from app.soccer.split import Splitter
from app.solving.calibrate import calibrate_station, compute_calibration_key
from app.solving.solve import solve_group
from app.wording import plural
from app.workers.executors import run_tasks

CHUNK = 40
"""Groups a task."""
NAMED = 200
"""Differences that a report names; all are counted."""
UNEXPECTED = "something went wrong inside the server; its log says what"
_A_GROUP = 10
"""Of them, in one group."""
_STAMPS = frozenset({"solver_version", "calibration_key", "sentence"})
"""Of a solution, what says which solver made it, and its words: no figure."""
_PX, _METRES = ("px", "nearest", "reprojected"), ("_m", "point")
"""How the names of figures in pixels and in metres end."""
_KEEP = "compute anew and freeze another version, or keep this one as it was frozen"
"""What to do with numbers that an earlier solver made."""


@dataclass(frozen=True)
class VerifyDifference:
    """Something that is not as it was frozen.

    Attributes:
        group: Key of the group; None: the version itself.
        place: Where, ``ball.point.0``.
        frozen: What the version has there.
        now: What came out this time.
    """

    group: str | None
    place: str
    frozen: Json
    now: Json


@dataclass
class VerifyReport:
    """What came of it; ``differences`` are the first ones, ``different`` counts all of them.

    ``older_tracks`` are sound tracks that come out differently because another version of the solver made them: that
    version, by stretch. Each is one difference. ``largest_px`` and ``largest_m`` are the largest differences of figures
    of groups in pixels and metres.
    """

    version: str
    hash: str
    groups: int
    solver_version: str
    equal: int = 0
    different: int = 0
    differences: list[VerifyDifference] = field(default_factory=list)
    older_tracks: dict[str, str] = field(default_factory=dict)
    solver_version_now: str = SOLVER_VERSION
    largest_px: float = 0.0
    largest_m: float = 0.0

    @property
    def ok(self) -> bool:
        """Whether everything came out as it was frozen."""
        return not self.different and self.equal == self.groups

    def to_values(self) -> dict[str, Any]:
        """Everything as plain values."""
        values = {name: value for name, value in vars(self).items() if name != "differences"}
        found = [asdict(item) for item in self.differences]
        return {"ok": self.ok, **values, "differences": found, "sentence": self.sentence}

    @property
    def sentence(self) -> str:
        """The outcome in one sentence, or two where tracks of another version come out differently."""
        older = self._format_older_tracks if self.older_tracks else ""
        other_solver = self.solver_version != self.solver_version_now
        if self.equal < self.groups:
            why = ""
            if self.largest_m or self.largest_px:
                why = f", numbers that both have by at most {self.largest_m:.3g} m and {self.largest_px:.3g} px"
            if other_solver:
                why += (
                    f"; the version was computed by solver {self.solver_version}, "
                    f"this is solver {self.solver_version_now}: {_KEEP}"
                )
            return (
                f"{self.groups - self.equal:,} of {plural(self.groups, 'group')} came out "
                f"differently{why}.{older}"
            )
        if own := self.different - len(self.older_tracks):
            return f"{plural(own, 'value')} of the version itself came out differently.{older}"
        if other_solver:
            return (
                f"The figures of {plural(self.groups, 'group')} are as frozen; only the version of"
                f" the solver differs: {self.solver_version} then, {self.solver_version_now} now."
                f"{older}"
            )
        groups = f"All {self.groups:,} groups" if self.groups != 1 else "The group"
        return f"{groups} and the hash came out as they were frozen.{older}"

    @property
    def _format_older_tracks(self) -> str:
        made = " and ".join(sorted(set(self.older_tracks.values())))
        names = ", ".join(sorted(self.older_tracks)[:_A_GROUP])
        count = plural(len(self.older_tracks), "track comes", "tracks come")
        return (
            f" {count} out differently ({names}): made by version {made} of the track solver, and this is"
            f" version {TRACK_VERSION}: {_KEEP}."
        )

    def add(self, found: Sequence[VerifyDifference]) -> None:
        """Count differences, and keep the first."""
        self.different += len(found)
        self.differences += found[: max(NAMED - len(self.differences), 0)]


@dataclass(frozen=True)
class VerifyTask:
    """A chunk of frozen groups on its way to a worker: plain bytes, so that it travels anywhere.

    ``frozen`` are bodies by key, ``known`` the calibrations of static cameras, computed anew.
    """

    rows: tuple[VersionGroup, ...]
    frozen: Mapping[str, bytes]
    known: Mapping[str, bytes]
    policy: Policy
    splitter: Splitter
    solver_version: str


@dataclass
class GroupComparison:
    """What of a group is not as it was frozen: the first differences, and the largest by unit."""

    differences: list[VerifyDifference] = field(default_factory=list)
    largest_px: float = 0.0
    largest_m: float = 0.0

    def add(self, item: VerifyDifference) -> None:
        """Take a difference up."""
        if len(self.differences) < _A_GROUP:
            self.differences.append(item)
        off = _subtract(item.frozen, item.now)
        name = next((name for name in reversed(item.place.split(".")) if not name.isdigit()), "")
        if name.endswith(_PX):
            self.largest_px = max(self.largest_px, off)
        elif name.endswith(_METRES):
            self.largest_m = max(self.largest_m, off)


def _subtract(frozen: Json, now: Json) -> float:
    """How far two numbers lie apart; 0 where one is none."""
    if isinstance(frozen, float | int) and isinstance(now, float | int):
        return abs(float(frozen) - float(now))
    return 0.0


def verify_version(
    store: Store,
    version_id: int,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
) -> VerifyReport:
    """Compute a version from its frozen annotations and compare all of it.

    Checked are that every frozen part is there, the digest of every frozen part, the hash of the version, its split, and each
    solution and calibration: every number of them, bit for bit. Where another version of the solver froze it, its stamps
    and words are left out.

    Args:
        store: The database.
        version_id: The version.
        executor: Where chunks are solved; None: here.
        progress: Called after each chunk; an error that it raises ends the run.

    Raises:
        NotFoundError: There is no such version.
    """
    with store.read() as session:
        version = read_version(session, version_id)
        report = VerifyReport(
            version.name, version.hash, int(version.counts["groups"]), version.solver_version
        )
        report.add(list(_find_version_hash_difference(session, version)))
        frozen_tracks = read_frozen(session, version.dataset_id, version.tracks.values())
        matches = read_version_matches(session, version.id)
    done = 0
    for results in run_tasks(verify_task, _VerifyTasks(store, version, matches), executor):
        for found in results:
            report.add(found.differences)
            report.equal += not found.differences
            report.largest_px = max(report.largest_px, found.largest_px)
            report.largest_m = max(report.largest_m, found.largest_m)
        done += len(results)
        if progress is not None:
            progress(done, report.groups)
    for stretch, key in version.tracks.items():
        _check_track(report, stretch, key, frozen_tracks.get(key))
        if progress is not None:
            progress(done, report.groups)
    return report


def verify_and_save_report(
    store: Store,
    version_id: int,
    executor: Executor | None = None,
    progress: ReportProgress | None = None,
    *,
    actor: str,
) -> VerifyReport:
    """``verify_version``, with what comes of it kept with the version.

    Raises what ``verify_version`` raises; a failure is kept as such, a cancelled run leaves what was
    kept before.
    """
    with store.read() as session:
        read_version(session, version_id)
    try:
        report = verify_version(store, version_id, executor, progress)
    except JobCancelled:
        raise
    except Exception as error:
        problem = error.message if isinstance(error, ReviewError) else UNEXPECTED
        save_verify_failure(store, version_id, problem, actor=actor)
        raise
    save_verification(store, version_id, actor=actor, report=report.to_values())
    return report


def save_verify_failure(store: Store, version_id: int, problem: str, *, actor: str) -> None:
    """Keep with a version why nothing came of verifying it; what is damaged takes no word of it."""
    with suppress(DamagedError):
        save_verification(store, version_id, actor=actor, problem=problem)


def verify_task(task: VerifyTask) -> list[GroupComparison]:
    """The differences of each group of a task; runs in a worker."""
    known = {key: decode_calibration(body) for key, body in task.known.items()}
    compared = []
    for row in task.rows:
        found = GroupComparison()
        for item in _find_group_differences(row, task, known):
            found.add(item)
        compared.append(found)
    return compared


def _find_version_hash_difference(session: Session, version: Version) -> Iterator[VerifyDifference]:
    """What of the version's own row does not follow from its groups."""
    names = ("key", "member", "split", "splits", "verdict", "said")
    rows = (
        {name: getattr(row, name) for name in names}
        for row in iterate_version_group_state_rows(session, version.id)
    )
    found = hash_version(version.policy, version.solver_version, rows, version.tracks)
    if found != version.hash:
        yield VerifyDifference(None, "hash", version.hash, found)


def _check_track(report: VerifyReport, stretch: str, key: str, body: bytes | None) -> None:
    """Compute a track anew from its frozen inputs, and report what is not as it was frozen."""
    place = f"track {stretch}"
    if body is None or compute_content_key(key, body) != key:
        found = None if body is None else compute_content_key(key, body)
        report.add([VerifyDifference(None, place, key, found)])
        return
    value = decode_frozen_json(body)
    differences = list(_find_track_differences(place, value))
    made_by = str(value["inputs"]["version"])
    if differences and made_by != TRACK_VERSION:
        report.older_tracks[stretch] = made_by
        then, now = f"made by version {made_by}", f"version {TRACK_VERSION} makes another one"
        differences = [VerifyDifference(None, place, then, now)]
    report.add(differences)


def _find_track_differences(place: str, value: Mapping[str, Any]) -> Iterator[VerifyDifference]:
    """What of a sound track comes out differently."""
    try:
        now = recompute_frozen_track(value)
    except Exception as error:
        # One broken track must not hide what the others say.
        yield VerifyDifference(None, place, None, f"{type(error).__name__}: {error}")
        return
    for name, frozen in value["track"].items():
        if canonical_json_text(now[name]) != canonical_json_text(frozen):
            yield VerifyDifference(
                None, f"{place}.{name}", _shorten_value(frozen), _shorten_value(now[name])
            )


def _shorten_value(value: Json) -> Json:
    """A value for a report: long lists are told by their length and digest."""
    text = canonical_json_text(value)
    return (
        value if len(text) < 200 else f"{len(text):,} characters, {digest_content(text.encode())}"
    )


class _VerifyTasks:
    """The tasks of one verification, made as workers become free.

    Each is read in a transaction of its own: what is frozen does not change in between.
    """

    def __init__(self, store: Store, version: Version, matches: set[str]):
        self._store, self._version = store, version
        self._splitter = Splitter.of(version.split, matches)
        self._shared: dict[str, bytes] = {}

    def __iter__(self) -> Iterator[VerifyTask]:
        after = -1
        while True:
            with self._store.read() as session:
                rows = read_page(session, self._version.id, after, CHUNK, members=True)
                frozen = self._read_frozen_chunk(session, rows)
            if not rows:
                return
            after = rows[-1].position
            yield self._make_task(tuple(rows), frozen)

    def _read_frozen_chunk(
        self, session: Session, rows: Sequence[VersionGroup]
    ) -> dict[str, bytes]:
        """Everything that a chunk consists of."""
        wanted = {key for row in rows for key in (row.said, row.solution) if key}
        frozen = read_frozen(session, self._version.dataset_id, wanted)
        more = {name for row in rows for name in _collect_named_keys(row, frozen)}
        return frozen | read_frozen(session, self._version.dataset_id, more)

    def _make_task(self, rows: tuple[VersionGroup, ...], frozen: Mapping[str, bytes]) -> VerifyTask:
        sound = (row for row in rows if not _list_missing_keys(row, frozen))
        annotations = (decode_frozen_json(frozen[row.said or ""]) for row in sound)
        known = self._calibrate_static_cameras(
            [thaw_group(value, _decode_shared_values(value, frozen)) for value in annotations]
        )
        version = self._version
        return VerifyTask(
            rows, frozen, known, version.policy, self._splitter, version.solver_version
        )

    def _calibrate_static_cameras(self, groups: Sequence[Group]) -> dict[str, bytes]:
        """Calibrations of the static cameras of groups, each computed once."""
        policy, keys = self._version.policy.calibration, set()
        for group in groups:
            for station in (view.station for view in group.views if view.station.shared):
                key = compute_calibration_key(station, group.pitch, policy)
                keys.add(key)
                if key not in self._shared:
                    found = calibrate_station(station, group.pitch, policy)
                    self._shared[key] = encode_calibration(found)
        return {key: self._shared[key] for key in keys}


def _collect_named_keys(row: VersionGroup, frozen: Mapping[str, bytes]) -> set[str]:
    """Keys that the annotations and the solution of a group name, as far as those are there."""
    names: set[str] = set()
    if row.said is not None and row.said in frozen:
        names |= collect_shared_keys(decode_frozen_json(frozen[row.said]))
    if row.solution is not None and row.solution in frozen:
        names |= collect_calibration_keys(decode_frozen_json(frozen[row.solution]))
    return names


def _list_missing_keys(row: VersionGroup, frozen: Mapping[str, bytes]) -> list[str]:
    """Keys of frozen parts that a group needs and that are not there."""
    wanted = {key for key in (row.said, row.solution) if key} | _collect_named_keys(row, frozen)
    return sorted(wanted - frozen.keys())


def _decode_shared_values(annotations: Json, frozen: Mapping[str, bytes]) -> dict[str, Json]:
    return {key: decode_frozen_json(frozen[key]) for key in collect_shared_keys(annotations)}


def _find_group_differences(
    row: VersionGroup, task: VerifyTask, known: Mapping[str, Calibration]
) -> Iterator[VerifyDifference]:
    missing = _list_missing_keys(row, task.frozen)
    if missing:
        yield from (VerifyDifference(row.key, "missing", key, None) for key in missing)
        return
    try:
        yield from _find_content_differences(row, task)
        annotations = decode_frozen_json(task.frozen[row.said or ""])
        group = thaw_group(annotations, _decode_shared_values(annotations, task.frozen))
        yield from _find_split_differences(row, group, task.splitter)
        yield from _find_solution_differences(row, group, task, known)
    except Exception as error:
        # One broken group must not hide what the others say.
        yield VerifyDifference(row.key, "error", None, f"{type(error).__name__}: {error}")


def _find_content_differences(row: VersionGroup, task: VerifyTask) -> Iterator[VerifyDifference]:
    """Parts that are not what their key says."""
    annotations, solution = row.said or "", row.solution or ""
    for key in (
        annotations,
        *collect_shared_keys(decode_frozen_json(task.frozen[annotations])),
        solution,
    ):
        found = compute_content_key(key, task.frozen[key])
        if found != key:
            yield VerifyDifference(row.key, "digest", key, found)


def _find_split_differences(
    row: VersionGroup, group: Group, splitter: Splitter
) -> Iterator[VerifyDifference]:
    views = [view.key for view in group.views]
    split = splitter.split_of_group(group.match, group.split, views)
    for place, frozen, now in (
        ("split", row.split, split),
        ("splits", row.splits, splitter.splits_by_view(views)),
    ):
        if frozen != now:
            yield VerifyDifference(row.key, place, frozen, now)


def _find_solution_differences(
    row: VersionGroup, group: Group, task: VerifyTask, known: Mapping[str, Calibration]
) -> Iterator[VerifyDifference]:
    encoded = encode_solution(group, solve_group(group, task.policy, known))
    ignored = _STAMPS if task.solver_version != SOLVER_VERSION else frozenset[str]()
    pairs = [("", task.frozen[row.solution or ""], encoded.body)]
    if ignored:
        # Their keys follow from the version of the solver, too.
        views = decode_frozen_json(task.frozen[row.solution or ""])["views"]
        for at, (view, key) in enumerate(zip(views, encoded.calibration_keys, strict=True)):
            place = f"views.{at}.calibration"
            then = task.frozen.get(f"{CALIBRATION}{view['calibration_key']}")
            now = encoded.calibrations.get(key)
            if then is not None and now is not None:
                pairs.append((f"{place}.", then, now))
            elif then is not now:
                yield VerifyDifference(row.key, place, then and "frozen", now and "computed")
    else:
        for key, body in sorted(encoded.calibrations.items()):
            frozen = task.frozen.get(CALIBRATION + key)
            if frozen is None:
                yield VerifyDifference(row.key, "calibration", None, key)
            else:
                pairs.append(("calibration.", frozen, body))
    for place, then, now in pairs:
        # Texts, not bytes: another zlib may pack the same text in another way.
        if decode_frozen_text(then) != decode_frozen_text(now):
            yield from _find_unequal_leaves(
                row.key, place, _parse_frozen(then), _parse_frozen(now), ignored
            )
    point = decode_frozen_json(encoded.body)["ball"]
    if row.ball != (tuple(point["point"]) if point else None):
        yield VerifyDifference(row.key, "ball", row.ball, point and point["point"])


def _parse_frozen(body: bytes) -> Json:
    try:
        return json.loads(decode_frozen_text(body))
    except ValueError as error:
        raise StorageError(
            "a stored part of the frozen version is damaged: it is not valid JSON"
        ) from error


def _find_unequal_leaves(
    group: str, place: str, then: Json, now: Json, ignored: frozenset[str]
) -> Iterator[VerifyDifference]:
    """Leaves at which two JSON values differ, but for those of ignored names."""
    if isinstance(then, dict) and isinstance(now, dict) and then.keys() == now.keys():
        for name in (name for name in then if name not in ignored):
            yield from _find_unequal_leaves(
                group, f"{place}{name}.", then[name], now[name], ignored
            )
    elif isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        for index, (one, other) in enumerate(zip(then, now, strict=True)):
            yield from _find_unequal_leaves(group, f"{place}{index}.", one, other, ignored)
    elif repr(then) != repr(now):
        yield VerifyDifference(group, place.rstrip("."), then, now)
