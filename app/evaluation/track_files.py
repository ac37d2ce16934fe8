"""Predicted tracks, read: the ball in 3D over time, as ``export --format tracks`` writes it.

A file ``ball.csv`` for each stretch, alone or in a folder called by the stretch, with ``frame`` or ``time_s`` (or
both) and ``x_m,y_m,z_m``: pitch frame, metres, z down; rows without a place are gaps. ``sigma_m`` (the same in
each direction) or ``sigma_x_m,sigma_y_m,sigma_z_m`` say how sure each is. ``events.csv`` beside it has ``frame`` or
``time_s``, and ``kind``: kick, bounce or out. Other columns are not read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path, PurePosixPath
from typing import get_args

from app.errors import DatasetFormatError
from app.evaluation.prediction_run import FieldError, PredictedTrack, noted, read_field
from app.finite import quoted
from app.formats import fields
from app.formats.csv_text import is_missing, read_rows
from app.formats.file_tree import FileTree, Limits
from app.formats.report import Report
from app.soccer.choices import BallEventKind

BALL, EVENTS = "ball.csv", "events.csv"
KINDS: tuple[str, ...] = get_args(BallEventKind)
FARTHEST_M = 1000.0
"""No ball is farther from the centre mark; a number beyond is of another unit."""
_PLACE = ("x_m", "y_m", "z_m")
_SIGMAS = ("sigma_x_m", "sigma_y_m", "sigma_z_m")
_MOST_FRAME = 2**31


def is_ball_table(content: bytes) -> bool:
    """Whether a CSV is of balls in 3D over time, by its header."""
    header = content[:4096].split(b"\n", 1)[0].decode("utf-8", "replace").lower()
    return set(_PLACE) <= {name.strip() for name in header.split(",")}


def read_tracks(
    tree: FileTree, path: Path, report: Report, limits: Limits
) -> dict[str, PredictedTrack]:
    """Predicted tracks by the folders that they lie in, the file at the top under the empty name.

    Rows that are wrong are noted and left out.

    Raises:
        DatasetFormatError: There is no table of balls, or one has no place.
    """
    tables = [name for name in tree.names() if name.lower().endswith(".csv")]
    names = [name for name in tables if PurePosixPath(name).name.lower() == BALL]
    names = names or [name for name in tables if is_ball_table(tree.read_bytes(name))]
    folders = [str(PurePosixPath(name).parent) for name in names]
    if not names or len(set(folders)) < len(folders):
        what = "no ball.csv" if not names else "several tables of balls in one folder"
        raise DatasetFormatError(str(path), None, None, f"holds {what}")
    found = {}
    for name, folder in zip(names, folders, strict=True):
        balls = _Balls()
        _rows_by_track(tree, name, (*_PLACE,), report, limits, balls.add)
        beside = EVENTS if folder == "." else f"{folder}/{EVENTS}"
        events: list[tuple[str, int | None, float | None]] | None = None
        if beside in tables:
            events = []
            _rows_by_track(tree, beside, ("kind",), report, limits, partial(_add_event, events))
        report.imported += len(balls.position)
        found["" if folder == "." else folder] = balls.track(events)
    return found


def _rows_by_track(
    tree: FileTree,
    name: str,
    columns: tuple[str, ...],
    report: Report,
    limits: Limits,
    add: Callable[[Mapping[str, str]], object],
) -> None:
    """Hand on the rows of a table; what is wrong with one is noted."""
    shown = tree.shown(name)
    for line, row in read_rows(tree.read_bytes(name), shown, columns, limits):
        if "frame" not in row and "time_s" not in row:
            raise DatasetFormatError(shown, None, "frame", "is missing, and so is time_s")
        report.read += 1
        with noted(report, shown, f"line {line}"):
            add(row)


class _Balls:
    """The rows of one table, gathered."""

    def __init__(self) -> None:
        self.frames: list[int | None] = []
        self.times: list[float | None] = []
        self.position: list[tuple[float, float, float]] = []
        self.sigma: list[tuple[float, float, float] | None] = []
        self._seen: set[int | float | None] = set()

    def add(self, row: Mapping[str, str]) -> None:
        """A row; without a place it is a gap."""
        if all(is_missing(row.get(name)) for name in _PLACE):
            return
        frame, time = _read_instant(row)
        if (frame if frame is not None else time) in self._seen:
            raise FieldError("frame", "has a ball already")
        x, y, z = (read_field(row, name, _read_metres) for name in _PLACE)
        sigma = _read_sigma(row)
        self._seen.add(frame if frame is not None else time)
        self.frames.append(frame)
        self.times.append(time)
        self.position.append((x, y, z))
        self.sigma.append(sigma)

    def track(self, events: list[tuple[str, int | None, float | None]] | None) -> PredictedTrack:
        """All of them."""
        return PredictedTrack(
            tuple(self.frames),
            tuple(self.times),
            tuple(self.position),
            tuple(self.sigma),
            None if events is None else tuple(events),
        )


def _read_instant(row: Mapping[str, str]) -> tuple[int | None, float | None]:
    frame = None if is_missing(row.get("frame")) else read_field(row, "frame", fields.whole_number)
    time = None if is_missing(row.get("time_s")) else read_field(row, "time_s", fields.number)
    if frame is None and time is None:
        raise FieldError("frame", "is missing, and so is time_s")
    if frame is not None and not 0 <= frame < _MOST_FRAME:
        raise FieldError("frame", f"is {frame}, which is not the number of a frame")
    return frame, time


def _read_metres(text: str) -> float:
    value = fields.number(text)
    if abs(value) > FARTHEST_M:
        raise ValueError(f"is {value:g} m; places are in metres from the centre mark")
    return value


def _read_sigma(row: Mapping[str, str]) -> tuple[float, float, float] | None:
    names = _SIGMAS if not is_missing(row.get(_SIGMAS[0])) else ("sigma_m",) * 3
    if is_missing(row.get(names[0])):
        return None
    x, y, z = (read_field(row, name, fields.number) for name in names)
    if not min(x, y, z) > 0:
        raise FieldError(names[0], "is not above zero")
    return x, y, z


def _add_event(events: list[tuple[str, int | None, float | None]], row: Mapping[str, str]) -> None:
    kind = row["kind"].strip().lower()
    if kind not in KINDS:
        raise FieldError("kind", f"is {quoted(kind)}; kinds are {', '.join(KINDS)}")
    events.append((kind, *_read_instant(row)))
