"""Tracks of the ball, written: ``ball.csv``, ``ball.parquet`` and ``events.csv``, and FIFA-like ``npz``."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol
from xml.sax.saxutils import quoteattr

import numpy as np

from app.errors import InputError
from app.formats.camera_matrix import cameras_to_arrays
from app.formats.csv_text import format_csv_line
from app.formats.parquet import import_pyarrow
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.json_text import json_text
from app.soccer.pitch import Pitch

BALL, EVENTS, NPZ = "ball.csv", "events.csv", "ball.npz"
TRACK_TABLE, EVENT_TABLE = "tracks.parquet", "events.parquet"
COLUMNS = ("frame", "time_s", "x_m", "y_m", "z_m", "sigma_m", "state", "cameras")
EVENT_COLUMNS = ("frame", "time_s", "kind", "x_m", "y_m", "z_m", "sigma_s")
_TO_Z_UP = np.array([1.0, -1.0, -1.0])
_UNSAFE = re.compile(r"[^\w .()-]+")


class TrackedEvent(Protocol):
    """What happened to the ball: a kick, a bounce, the ball out.

    Attributes:
        frame: Of the stretch, the nearest.
        time_s: Seconds.
        kind: ``kick``, ``bounce`` or ``out``.
        position: Pitch frame, metres, shape (3,).
        sigma_s: Standard deviation of its time, seconds.
    """

    @property
    def frame(self) -> int: ...
    @property
    def time_s(self) -> float: ...
    @property
    def kind(self) -> str: ...
    @property
    def position(self) -> FloatArray: ...
    @property
    def sigma_s(self) -> float: ...


class TrackedJump(Protocol):
    """Where views that take over put the ball elsewhere.

    Attributes:
        frame: Of the stretch, the nearest.
        metres: How far.
    """

    @property
    def frame(self) -> int: ...
    @property
    def metres(self) -> float: ...


class TrackValues(Protocol):
    """A track as the solver makes it: everything in the pitch frame, metres, seconds, z down.

    Attributes:
        frames: Numbers of the frames of the stretch, increasing, shape (N,).
        times: Seconds, shape (N,).
        position: NaN in gaps, shape (N, 3).
        velocity: Metres per second, NaN in gaps, shape (N, 3).
        covariance: Of position and velocity, NaN in gaps, shape (N, 6, 6).
        state: ``measured``, ``one_view``, ``predicted``, ``bridged`` or ``gap``, of each frame.
        mode: ``roll``, ``flight`` and so on, of each frame.
        views: Names of the cameras that measured the ball, of each frame.
        events: In the order of time.
        jumps: In the order of time.
    """

    @property
    def frames(self) -> IntArray: ...
    @property
    def times(self) -> FloatArray: ...
    @property
    def position(self) -> FloatArray: ...
    @property
    def velocity(self) -> FloatArray: ...
    @property
    def covariance(self) -> FloatArray: ...
    @property
    def state(self) -> Sequence[str]: ...
    @property
    def mode(self) -> Sequence[str]: ...
    @property
    def views(self) -> Sequence[Sequence[str]]: ...
    @property
    def events(self) -> Sequence[TrackedEvent]: ...
    @property
    def jumps(self) -> Sequence[TrackedJump]: ...


@dataclass(frozen=True)
class TrackRecord:
    """A track on its way out.

    Attributes:
        key: Of the stretch; unique in an export.
        track: Its values.
        pitch: Where it lies.
        rate: Frames a second.
        cameras: The camera of each frame that has one, by frame number, by name of the view.
        verdict: ``accepted`` or ``unreviewed``.
    """

    key: str
    track: TrackValues
    pitch: Pitch
    rate: float
    cameras: Mapping[str, Mapping[int, Camera]] = field(default_factory=dict)
    verdict: str = "unreviewed"

    @property
    def has_position(self) -> BoolArray:
        """Frames in which the track has a place, shape (N,)."""
        return np.asarray(np.isfinite(self.track.position).all(axis=1))


def position_sigma(covariance: FloatArray) -> FloatArray:
    """Major axis of the positions' covariances, metres, NaN where there is none, shape (N,).

    Args:
        covariance: Of position and velocity, shape (N, 6, 6), or of position, (N, 3, 3).
    """
    part = covariance[:, :3, :3]
    sigma = np.full(len(part), np.nan)
    known = np.isfinite(part).all(axis=(1, 2))
    if known.any():
        sigma[known] = np.sqrt(np.maximum(np.linalg.eigvalsh(part[known])[:, -1], 0.0))
    return sigma


def write_tracks(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``ball.csv``, ``events.csv`` and, where pyarrow is installed, ``ball.parquet``.

    One track lies below ``root`` itself, several have a folder each, called by their keys.

    Returns:
        Counts: ``tracks``, ``frames``, ``frames_with_ball`` (those with a place) and ``events``.

    Raises:
        InputError: Two tracks would have one folder.
    """
    counts = {"tracks": 0, "frames": 0, "frames_with_ball": 0, "events": 0}
    for folder, record in create_track_folders(root, records):
        track = record.track
        lines = [format_csv_line(COLUMNS), *map(format_csv_line, _track_rows(record))]
        (folder / BALL).write_text("".join(lines), encoding="utf-8")
        lines = [format_csv_line(EVENT_COLUMNS), *map(format_csv_line, _event_rows(record))]
        (folder / EVENTS).write_text("".join(lines), encoding="utf-8")
        if find_spec("pyarrow") is not None:
            _write_parquet(folder / "ball.parquet", record)
        counts["tracks"] += 1
        counts["frames"] += len(track.frames)
        counts["frames_with_ball"] += int(record.has_position.sum())
        counts["events"] += len(track.events)
    return counts


def write_track_arrays(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``ball.npz`` of each track: the ball and its cameras, as FIFA's skeletal kit has cameras.

    The world is x along the pitch, y across it away from the main stand, z up. A row is a frame of the
    stretch: ``frame`` (F,), ``time`` (F,) in seconds, ``ball`` (F, 3) in metres, NaN in gaps, ``sigma`` (F,);
    and for each view ``<view>/K`` (F, 3, 3), ``<view>/R`` (F, 3, 3), ``<view>/t`` (F, 3), ``<view>/k``, NaN where
    it has no camera.

    Returns:
        Counts: ``tracks``, ``frames``, ``frames_with_ball`` and ``cameras`` (views that have one).
    """
    counts = {"tracks": 0, "frames": 0, "frames_with_ball": 0, "cameras": 0}
    for folder, record in create_track_folders(root, records):
        track = record.track
        rows = {int(frame): row for row, frame in enumerate(track.frames)}
        arrays: dict[str, Any] = {
            "frame": track.frames,
            "time": track.times,
            "ball": track.position * _TO_Z_UP,
            "sigma": position_sigma(track.covariance),
        }
        for view, cameras in sorted(record.cameras.items()):
            placed = {rows[frame]: camera for frame, camera in cameras.items() if frame in rows}
            found = cameras_to_arrays(placed, f"{NPZ}/{view}")
            for name, values in found.items():
                whole = np.full((len(rows), *values.shape[1:]), np.nan)
                whole[: len(values)] = values
                arrays[f"{view}/{name}"] = whole
            counts["cameras"] += bool(placed)
        with (folder / NPZ).open("wb") as file:
            np.savez_compressed(file, **arrays)
        counts["tracks"] += 1
        counts["frames"] += len(rows)
        counts["frames_with_ball"] += int(record.has_position.sum())
    return counts


def make_track_folder_name(key: str) -> str:
    """What the folder of a stretch is called where an export has several."""
    return _UNSAFE.sub("_", key).strip(" .") or "track"


def create_track_folders(
    root: Path, records: Iterable[TrackRecord]
) -> Iterator[tuple[Path, TrackRecord]]:
    """Where each track goes: a single one to ``root``."""
    whole = list(records)
    taken: dict[str, str] = {}
    for record in whole:
        if len(whole) == 1:
            yield root, record
            continue
        name = make_track_folder_name(record.key)
        other = taken.setdefault(name.casefold(), record.key)
        if other != record.key:
            raise InputError(
                f'the tracks "{other}" and "{record.key}" would be written to the same folder,'
                f" {name}",
                hint="Export each of them separately.",
            )
        (root / name).mkdir()
        yield root / name, record


def _track_rows(record: TrackRecord) -> Iterator[tuple[Any, ...]]:
    track, sigmas = record.track, position_sigma(record.track.covariance)
    for row, (frame, time) in enumerate(zip(track.frames, track.times, strict=True)):
        place = track.position[row].tolist()
        cameras = " ".join(name.replace(" ", "_") for name in track.views[row])
        yield int(frame), float(time), *place, float(sigmas[row]), track.state[row], cameras


def _event_rows(record: TrackRecord) -> Iterator[tuple[Any, ...]]:
    for event in record.track.events:
        place = (float(value) for value in event.position)
        yield int(event.frame), float(event.time_s), event.kind, *place, float(event.sigma_s)


def _write_parquet(path: Path, record: TrackRecord) -> None:
    _, parquet = import_pyarrow()
    table = _make_frames_table(record).replace_schema_metadata({"verdict": record.verdict})
    parquet.write_table(table, path, compression="zstd")


def write_track_tables(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``tracks.parquet`` and ``events.parquet``: all tracks, each row with its stretch.

    Returns:
        Counts: ``tracks`` and ``events``.

    Raises:
        InputError: pyarrow is not installed.
    """
    pyarrow, parquet = import_pyarrow()
    whole = list(records)
    numbers, text = pyarrow.float64(), pyarrow.string()
    tables = []
    rows: list[dict[str, Any]] = []
    for record in whole:
        frames = _make_frames_table(record)
        stretch = pyarrow.array([record.key] * frames.num_rows, text)
        tables.append(frames.add_column(0, "stretch", stretch))
        rows += [
            dict(zip(("stretch", *EVENT_COLUMNS), (record.key, *row), strict=True))
            for row in _event_rows(record)
        ]
    kinds = {"stretch": text, "kind": text, "frame": pyarrow.int32()}
    fields = [(name, kinds.get(name, numbers)) for name in ("stretch", *EVENT_COLUMNS)]
    events = pyarrow.Table.from_pylist(rows, pyarrow.schema(fields))
    parquet.write_table(pyarrow.concat_tables(tables), root / TRACK_TABLE, compression="zstd")
    parquet.write_table(events, root / EVENT_TABLE, compression="zstd")
    return {"tracks": len(whole), "events": len(rows)}


def _make_frames_table(record: TrackRecord) -> Any:
    """A row a frame, as an Arrow table."""
    pyarrow, _ = import_pyarrow()
    track = record.track
    jumps = np.full(len(track.frames), np.nan)
    for jump in track.jumps:
        jumps[jump.frame - track.frames[0]] = jump.metres
    numbers, whole, text = pyarrow.float64(), pyarrow.int32(), pyarrow.string()

    def make_nullable_number_array(values: FloatArray) -> Any:
        return pyarrow.array(
            [None if value != value else value for value in values.tolist()], numbers
        )

    def make_nullable_list_array(values: FloatArray, length: int) -> Any:
        flat = values.reshape(len(values), length)
        known = np.asarray(np.isfinite(flat).all(axis=1))
        rows = [row if there else None for row, there in zip(flat.tolist(), known, strict=True)]
        return pyarrow.array(rows, pyarrow.list_(numbers, length))

    return pyarrow.table(
        {
            "frame": pyarrow.array(track.frames.tolist(), whole),
            "time_s": pyarrow.array(track.times.tolist(), numbers),
            **{
                name: make_nullable_number_array(track.position[:, axis])
                for axis, name in enumerate(("x_m", "y_m", "z_m"))
            },
            "sigma_m": make_nullable_number_array(position_sigma(track.covariance)),
            **{
                name: make_nullable_number_array(track.velocity[:, axis])
                for axis, name in enumerate(("vx_m_s", "vy_m_s", "vz_m_s"))
            },
            "covariance": make_nullable_list_array(track.covariance, 36),
            "state": pyarrow.array(list(track.state), text),
            "mode": pyarrow.array([mode or None for mode in track.mode], text),
            "jump_m": make_nullable_number_array(jumps),
            "cameras": pyarrow.array([list(names) for names in track.views], pyarrow.list_(text)),
        }
    )


DATA, METADATA, CDF = "tracab.dat", "tracab_metadata.xml", "tracking.jsonl"
ZERO = datetime(1970, 1, 1, tzinfo=UTC)
"""Where times count from: no dataset says when its match was played."""
CDF_LIMITS = 65.0, 42.5
"""Farthest x and y that the Common Data Format has room for, metres."""


def write_tracab(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``tracab.dat`` and ``tracab_metadata.xml`` of each track, the ball alone.

    Centimetres from the centre spot, x along the pitch, y across it away from the main stand, height
    up; speed in metres a second. Frames in gaps are left out: the format has no missing ball. It has
    nobody in possession either, so that ``H`` stands there. A rate that is not a whole number is rounded.

    Returns:
        Counts: ``tracks``, ``frames`` and ``frames_with_ball``.

    Source: TRACAB's file specification as kloppy reads it (``TracabDatParser``).
    """
    counts = {"tracks": 0, "frames": 0, "frames_with_ball": 0}
    for folder, record in create_track_folders(root, records):
        track, lines = record.track, []
        speed = np.linalg.norm(track.velocity, axis=1)
        for row in np.flatnonzero(record.has_position).tolist():
            x, y, z = np.rint(100 * track.position[row] * (1, -1, -1)).astype(int).tolist()
            alive = "Dead" if track.mode[row] == "out" else "Alive"
            lines.append(f"{track.frames[row]}::{x},{y},{z},{speed[row]:.2f},H,{alive};:\n")
        (folder / DATA).write_text("".join(lines), encoding="ascii")
        (folder / METADATA).write_text(_format_tracab_metadata(record), encoding="utf-8")
        counts["tracks"] += 1
        counts["frames"] += len(track.frames)
        counts["frames_with_ball"] += len(lines)
    return counts


def write_cdf(root: Path, records: Iterable[TrackRecord]) -> dict[str, int]:
    """Write ``tracking.jsonl`` of each track: a JSON object a frame, the ball alone.

    Metres from the centre spot, x along the pitch, y across it away from the main stand, z up. Frames in
    gaps, and with a ball beyond what the format has room for, are left out: its validator takes no null.
    Frames count from 0, the first that is written; times of the stretch from 1970-01-01; both teams
    have no players.

    Returns:
        Counts: ``tracks``, ``frames``, ``frames_with_ball``, ``balls_too_far_away`` (left out) and
        ``balls_raised_to_the_grass`` (below it, written with z = 0).

    Source: Common Data Format 0.3.2 (arXiv 2505.15820), tracking.
    """
    counts = {"tracks": 0, "frames": 0, "frames_with_ball": 0}
    counts |= {"balls_too_far_away": 0, "balls_raised_to_the_grass": 0}
    for folder, record in create_track_folders(root, records):
        near = _is_within_cdf_limits(record)
        counts["balls_too_far_away"] += int((record.has_position & ~near).sum())
        counts["balls_raised_to_the_grass"] += int((record.track.position[near, 2] > 0).sum())
        lines = [f"{json_text(line)}\n" for line in _make_cdf_frames(record)]
        (folder / CDF).write_text("".join(lines), encoding="utf-8")
        counts["tracks"] += 1
        counts["frames"] += len(record.track.frames)
        counts["frames_with_ball"] += len(lines)
    return counts


def _format_tracab_metadata(record: TrackRecord) -> str:
    pitch, frames = record.pitch, record.track.frames
    return (
        '<?xml version="1.0" encoding="utf-8"?>\n'
        '<TracabMetaData sVersion="1.0">\n'
        f' <match iId={quoteattr(record.key)} dtDate="{ZERO:%Y-%m-%d %H:%M:%S}"'
        f' iFrameRateFps="{round(record.rate)}"'
        f' fPitchXSizeMeters="{pitch.length:.2f}" fPitchYSizeMeters="{pitch.width:.2f}"'
        f' fTrackingAreaXSizeMeters="{pitch.length + 20:.2f}"'
        f' fTrackingAreaYSizeMeters="{pitch.width + 20:.2f}">\n'
        f'  <period iId="1" iStartFrame="{frames[0]}" iEndFrame="{frames[-1]}"/>\n'
        " </match>\n"
        "</TracabMetaData>\n"
    )


def _make_cdf_frames(record: TrackRecord) -> Iterator[dict[str, Any]]:
    track = record.track
    nobody = {side: {"id": side, "players": list[Any]()} for side in ("home", "away")}
    rows = np.flatnonzero(_is_within_cdf_limits(record)).tolist()
    for row in rows:
        x, y, z = (track.position[row] * (1, -1, -1)).tolist()
        yield {
            "frame_id": int(track.frames[row] - track.frames[rows[0]]),
            "timestamp": _timestamp(float(track.times[row])),
            "period": "first_half",
            "match": {"id": record.key},
            "teams": nobody,
            "ball": {"x": x, "y": y, "z": max(z, 0.0), "status": track.mode[row] != "out"},
        }


def _is_within_cdf_limits(record: TrackRecord) -> BoolArray:
    """Frames whose ball the Common Data Format has room for, shape (N,)."""
    place = np.abs(np.nan_to_num(record.track.position[:, :2]))
    return np.asarray(record.has_position & (place <= CDF_LIMITS).all(axis=1))


def _timestamp(seconds: float) -> str:
    return (ZERO + timedelta(seconds=seconds)).isoformat(timespec="milliseconds")
