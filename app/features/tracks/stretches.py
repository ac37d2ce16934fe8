"""Stretches: groups that follow each other in time, and what their views measure of the ball.

A static rig makes one stretch of each match, its groups numbered by frame; a recording one of each shot,
its groups at the time stamps of their frames.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Protocol, TypeVar

import numpy as np

from app.errors import InputError
from app.features.tracks.run_measurements import AcceptedRunObservation, format_linked_view_name
from app.formats.export_record import ExportRecord
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.camera import Camera
from app.soccer.group import Group, View
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.ball_covariance import observation_pixel_covariances
from app.solving.triangulate import BallObservation, collect_clicked_balls
from app.tracking.ball_track import BallMeasurements

RATE = 25.0
"""Frames a second of a static rig, whose groups are numbered and say no time: ISSIA's."""
LONGEST_GAP_S = 2.0
"""Between two groups of a recording whose shots are not known, beyond which another stretch begins."""
MOST_FRAMES = 200_000
"""Of a stretch: a half of a match at 60 a second has 162,000."""
_NUMBER = re.compile(r"(?:.*/)?(\d{1,9})(?:\.\w+)?", re.ASCII)
UNSURE = ("calibratable", "jac", "agreement")
"""Gates on cameras; a view that fails one measures nothing."""
_ROUGH_HEIGHT_M, _ROUGH_DEPTH_M, _ROUGH_FARTHEST_M = 1.0, 60.0, 300.0
"""Where a ball that no two views placed is taken to be, to carry its camera's covariance there."""

Shots = Mapping[str, Sequence[tuple[int, int]]]
"""First and last frames of a recording's shots in their order, by the recording's name."""


@dataclass(frozen=True)
class Instant:
    """A group in time.

    Attributes:
        frame: Its number in its stretch.
        time: Seconds.
        key: Of the group.
    """

    frame: int
    time: float
    key: str


@dataclass(frozen=True)
class Stretch:
    """Frames in time order, one row each, with what views measured of the ball.

    Attributes:
        key: Unique in its dataset: the match; of a recording with the first and last frame of the shot,
            or of the groups where no shot is known.
        match: Of its groups.
        rate: Frames a second, of a variable rate the mean.
        frames: Every number from the first group to the last, shape (N,).
        times: Seconds, shape (N,).
        pitch: Of its first group.
        measurements: What views show, by frame and view.
        groups: Key of the group of each frame that has one.
        cameras: Cameras of views that have one, by frame, by view.
        unused: Balls that are no measurement, counted by reason.
    """

    key: str
    match: str
    rate: float
    frames: IntArray
    times: FloatArray
    pitch: Pitch
    measurements: BallMeasurements
    groups: Mapping[int, str]
    cameras: Mapping[str, Mapping[int, Camera]]
    unused: Mapping[str, int]

    @property
    def first(self) -> int:
        """Number of its first frame."""
        return int(self.frames[0])

    @property
    def last(self) -> int:
        """Number of its last frame."""
        return int(self.frames[-1])


class StoredStretch(Protocol):
    """A stretch as it was when something was stored of it: its key, its match, its frames."""

    @property
    def key(self) -> str: ...
    @property
    def match(self) -> str: ...
    @property
    def first(self) -> int: ...
    @property
    def last(self) -> int: ...


Stored = TypeVar("Stored", bound=StoredStretch)


@lru_cache(maxsize=2**16)
def parse_frame_number(key: str) -> int | None:
    """The number of a group's frame, which ends its key; None where none does."""
    number = _NUMBER.fullmatch(key)
    return None if number is None else int(number[1])


def find_group_instant(group: Group) -> tuple[Instant, bool] | None:
    """When a group was, and whether a recording says so; None where nothing does."""
    for view in group.views:
        if (found := _get_recording_metadata(view)) and "link" not in found:
            try:
                frame, seconds = int(found["frame"]), float(found["seconds"])
            except (KeyError, TypeError, ValueError):
                continue
            return Instant(frame, seconds, group.key), True
    number = parse_frame_number(group.key)
    if number is None or not all(view.station.shared for view in group.views):
        return None
    return Instant(number, number / RATE, group.key), False


@dataclass(frozen=True)
class GroupMeasurements:
    """What one group gives to a stretch.

    Attributes:
        recorded: Whether a recording says when it was.
        observations: Name of a view, its time, and what it measures.
    """

    match: str
    instant: Instant
    recorded: bool
    pitch: Pitch
    observations: list[tuple[str, float, BallObservation]]
    point: tuple[float, float, float] | None
    cameras: dict[str, Camera]
    unused: Counter[str]


@dataclass
class _MatchMeasurements:
    recorded: bool
    rows: list[GroupMeasurements] = field(default_factory=list)


def gather_stretches(
    records: Iterable[ExportRecord],
    policy: Policy,
    shots: Shots | None = None,
    followed: Mapping[str, Sequence[AcceptedRunObservation]] | None = None,
) -> list[Stretch]:
    """The stretches of groups, by match and time; groups that say no time are in none.

    Args:
        records: Groups with their solutions, in any order.
        policy, shots, followed: As of ``build_stretches``.
    """
    known: dict[bytes, Camera] = {}
    measured = (measure_group(record, known) for record in records)
    return build_stretches(filter(None, measured), policy, shots, followed)


def build_stretches(
    measured: Iterable[GroupMeasurements],
    policy: Policy,
    shots: Shots | None = None,
    followed: Mapping[str, Sequence[AcceptedRunObservation]] | None = None,
) -> list[Stretch]:
    """The stretches of groups that were measured, by match and time.

    Args:
        measured: What the groups give, in any order.
        policy: Says how noisy clicks and cameras are.
        shots: Of recordings, where they are known.
        followed: Balls of accepted runs in frames that are of no group, by match: of the frames of a stretch,
            and beyond its groups of those of its shot.
    """
    matches: dict[str, _MatchMeasurements] = {}
    for one in measured:
        matches.setdefault(one.match, _MatchMeasurements(one.recorded)).rows.append(one)
    stretches = []
    for name, match in sorted(matches.items()):
        match.rows.sort(key=lambda row: row.instant.frame)
        of_match = (shots or {}).get(name)
        for rows in _split_into_stretches(match, of_match):
            key, beside = name, list[AcceptedRunObservation]()
            if match.recorded:
                first, last = rows[0].instant.frame, rows[-1].instant.frame
                first, last = find_shot_at_frame(first, of_match) or (first, last)
                key = f"{name} {first}-{last}"
                every = (followed or {}).get(name, ())
                beside = [one for one in every if first <= one.frame <= last]
            stretches.append(_build_stretch(key, name, rows, beside, match, policy))
    return stretches


def match_stored_to_stretches(
    stretches: Iterable[Stretch], stored: Iterable[Stored]
) -> dict[str, Stored]:
    """The stored tracks of stretches, by the keys of the stretches.

    A stretch is what was stored under its key, or else what shares the most frames with it in its match: one
    more group, or another cut, makes it no other. Nothing is of two stretches.
    """
    pairs = [
        (item.key != stretch.key, -shared, stretch, item)
        for item in stored
        for stretch in stretches
        if item.match == stretch.match
        and (
            (shared := min(stretch.last, item.last) - max(stretch.first, item.first) + 1) > 0
            or item.key == stretch.key
        )
    ]
    found: dict[str, Stored] = {}
    taken: set[str] = set()
    for *_, stretch, item in sorted(pairs, key=lambda pair: pair[:2]):
        if stretch.key not in found and item.key not in taken:
            found[stretch.key] = item
            taken.add(item.key)
    return found


def require_any_stretch(dataset: str, stretches: Sequence[Stretch]) -> None:
    """Raises InputError where no groups follow each other in time."""
    if not stretches:
        raise InputError(
            f'no groups of "{dataset}" follow each other in time, so there is no track of the ball',
            hint="Tracks are made of static cameras whose groups are numbered by frame, as ISSIA's, and of "
            "groups that were taken from a recording.",
        )


def measure_group(
    record: ExportRecord, known: dict[bytes, Camera] | None = None
) -> GroupMeasurements | None:
    """What a group gives to a stretch; None where it says no time.

    Args:
        record: With its solution.
        known: Cameras by their numbers, to which those of the group are added: equal ones are one object.
    """
    found = find_group_instant(record.group)
    if found is None:
        return None
    known, (instant, recorded) = {} if known is None else known, found
    group, solution, unused = record.group, record.solution, Counter[str]()
    views, calibrations = [], []
    cameras = {}
    for view in group.views:
        ball = view.ball is not None and view.ball.center is not None
        solved = record.view_solution(view)
        camera = None if solved is None else solved.calibration.camera
        if solved is None or camera is None or solved.failed in UNSURE:
            unused["no camera that passes its gates" if solution else "not solved"] += ball
            continue
        camera = known.setdefault(_camera_to_bytes(camera), camera)
        cameras[make_view_name(view)] = camera
        if not view.included:
            unused["view left out"] += ball
            continue
        if _get_recording_metadata(view).get("repeated"):
            unused["frame that repeats the one before"] += ball
            continue
        if solved.calibration.is_left_open:
            unused["camera whose lines leave it open"] += ball
            continue
        views.append(view)
        # A static camera's equal values are one object, so that a solver sees six and not thousands.
        calibrations.append(replace(solved.calibration, camera=camera))
    by_key = {view.key: view for view in views}
    observations = [
        (
            make_view_name(by_key[item.view]),
            instant.time + _get_replay_time_offset(by_key[item.view]),
            item,
        )
        for item in collect_clicked_balls(views, calibrations)
    ]
    return GroupMeasurements(
        group.match,
        instant,
        recorded,
        group.pitch,
        observations,
        record.ball_point,
        cameras,
        unused,
    )


def _get_recording_metadata(view: View) -> Mapping[str, Any]:
    """Which frame of which recording a view shows; empty where it is of none."""
    found = view.extras.metadata.get("recording")
    return found if isinstance(found, Mapping) else {}


def make_view_name(view: View) -> str:
    """What a view is called through a stretch: its recording, of a replay with its link, or its camera."""
    found = _get_recording_metadata(view)
    if "name" not in found:
        return view.key
    return (
        format_linked_view_name(found["name"], found["link"])
        if "link" in found
        else str(found["name"])
    )


def _get_replay_time_offset(view: View) -> float:
    """Live seconds by which a frame of a replay is later than the instant that it was taken for."""
    off = _get_recording_metadata(view).get("off_s")
    return float(off) if isinstance(off, (int, float)) else 0.0


def _camera_to_bytes(camera: Camera) -> bytes:
    numbers = (*camera.focal_length, *camera.principal_point, camera.skew)
    parts = camera.rotation, camera.position, np.array(numbers), camera.distortion
    return b"".join(np.asarray(part).tobytes() for part in parts) + camera.lens.encode()


def _split_into_stretches(
    match: _MatchMeasurements, shots: Sequence[tuple[int, int]] | None
) -> list[list[GroupMeasurements]]:
    """Rows that belong together: a whole rig, or the shots of a recording."""
    parts: list[list[GroupMeasurements]] = []
    last: GroupMeasurements | None = None
    place: object = None
    for row in match.rows:
        frame = row.instant.frame
        if match.recorded and shots:
            here: object = find_shot_at_frame(frame, shots)
            new = here is None or here != place
            place = here
        else:
            new = last is None or (
                match.recorded
                and (
                    row.instant.time - last.instant.time > LONGEST_GAP_S
                    or frame - parts[-1][0].instant.frame >= MOST_FRAMES
                )
            )
        if last is not None and frame == last.instant.frame:
            raise InputError(
                f"the groups {last.instant.key} and {row.instant.key} are both frame {frame}",
                hint="A stretch has one group for each frame; give one of them another match.",
            )
        if new or not parts:
            parts.append([])
        parts[-1].append(row)
        last = row
    return parts


def find_shot_at_frame(
    frame: int, shots: Sequence[tuple[int, int]] | None
) -> tuple[int, int] | None:
    """The shot that a frame is of; None: none, as in a transition."""
    return next((shot for shot in shots or () if shot[0] <= frame <= shot[1]), None)


def _build_stretch(
    key: str,
    name: str,
    rows: Sequence[GroupMeasurements],
    beside: Sequence[AcceptedRunObservation],
    match: _MatchMeasurements,
    policy: Policy,
) -> Stretch:
    shown = {one.frame: one.frame_time for one in beside}
    shown |= {row.instant.frame: row.instant.time for row in rows}
    numbers, seconds = (np.array(column) for column in zip(*sorted(shown.items()), strict=True))
    count = int(numbers[-1] - numbers[0]) + 1
    if count > MOST_FRAMES:
        raise InputError(
            f"the stretch {key} has {count:,} frames from its first group to its last; a track"
            f" can have {MOST_FRAMES:,} at most"
        )
    frames = np.arange(numbers[0], numbers[-1] + 1)
    span = float(seconds[-1] - seconds[0])
    cameras: dict[str, dict[int, Camera]] = {}
    unused = sum((row.unused for row in rows), Counter[str]())
    for row in rows:
        for view, camera in row.cameras.items():
            cameras.setdefault(view, {})[row.instant.frame] = camera
    for one in beside:
        cameras.setdefault(one.view, {}).setdefault(one.frame, one.ball.camera)
    return Stretch(
        key=key,
        match=name,
        rate=(count - 1) / span if match.recorded and span > 0 else RATE,
        frames=frames,
        # Time stamps of frames without a group lie between those of their neighbours.
        times=np.interp(frames, numbers, seconds),
        pitch=rows[0].pitch,
        measurements=_build_measurements(rows, beside, policy),
        groups={row.instant.frame: row.instant.key for row in rows},
        cameras=cameras,
        unused={reason: number for reason, number in unused.items() if number},
    )


def _build_measurements(
    rows: Sequence[GroupMeasurements], beside: Sequence[AcceptedRunObservation], policy: Policy
) -> BallMeasurements:
    found = [
        (row.instant.frame, name, time, item, row.point)
        for row in rows
        for name, time, item in row.observations
    ]
    found += [(one.frame, one.view, one.time, one.ball, None) for one in beside]
    rays = _compute_unit_rays([item for *_, item, _ in found])
    # Beyond the radius where a lens folds the picture there is no ray.
    good = np.flatnonzero(np.isfinite(rays).all(axis=1)).tolist()
    found, rays = [found[row] for row in good], rays[good]
    observations = [item for *_, item, _ in found]
    points = _estimate_ball_positions(observations, rays, [place for *_, place in found])
    spread = (
        observation_pixel_covariances(observations, points, policy)
        if found
        else np.zeros((0, 2, 2))
    )
    sizes = np.array([item.diameter_px or np.nan for item in observations])
    share = np.hypot(policy.box_sigma_share * sizes, policy.click_sigma_px)
    return BallMeasurements(
        np.array([frame for frame, *_ in found], dtype=np.int64),
        np.array([time for _, _, time, *_ in found], dtype=float),
        tuple(name for _, name, *_ in found),
        np.array([[*item.center] for item in observations], dtype=float).reshape(-1, 2),
        np.sqrt(np.trace(spread, axis1=1, axis2=2) / 2),
        tuple(item.camera for item in observations),
        sizes,
        share,
    )


def _compute_unit_rays(observations: Sequence[BallObservation]) -> FloatArray:
    """Unit directions in the pitch frame, NaN where a pixel has none, shape (N, 3)."""
    by_camera: dict[int, list[int]] = {}
    for row, item in enumerate(observations):
        by_camera.setdefault(id(item.camera), []).append(row)
    rays = np.full((len(observations), 3), np.nan)
    for rows in by_camera.values():
        pixels = np.array([observations[row].center for row in rows], dtype=float)
        rays[rows] = observations[rows[0]].camera.rays(pixels)
    unit: FloatArray = rays / np.linalg.norm(rays, axis=1, keepdims=True)
    return unit


def _estimate_ball_positions(
    observations: Sequence[BallObservation],
    rays: FloatArray,
    places: Sequence[tuple[float, float, float] | None],
) -> FloatArray:
    """About where balls are: where their groups put them, else a metre above the grass, or some way off, (N, 3)."""
    positions = np.array([item.camera.position for item in observations]).reshape(-1, 3)
    down = np.where(rays[:, 2] > 1e-3, rays[:, 2], np.nan)
    depth = (-_ROUGH_HEIGHT_M - positions[:, 2]) / down
    near = (depth > 0) & (depth < _ROUGH_FARTHEST_M)
    points = positions + rays * np.where(near, depth, _ROUGH_DEPTH_M)[:, None]
    for row, place in enumerate(places):
        if place is not None:
            points[row] = place
    return np.asarray(points)
