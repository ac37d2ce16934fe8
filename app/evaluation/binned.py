"""Errors by bins of distance, parallax and size, and average precision by size and distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.evaluation.average_precision import coco_average_precision
from app.evaluation.frame import JudgedFrame
from app.evaluation.result import (
    Axis,
    Cell,
    Column,
    Figure,
    FrameRange,
    FrameResult,
    Panel,
    Row,
    Series,
    Table,
)
from app.plural import plural


@dataclass(frozen=True)
class Bins:
    """How frames are sorted into bins [edge, next edge); the last one has no upper end."""

    figure: str
    field: str
    title: str
    label: str
    unit: str
    edges: tuple[float, ...]

    def place(self, value: float | None) -> int | None:
        """Index of the bin of a value."""
        if value is None or value < self.edges[0]:
            return None
        return int(np.searchsorted(self.edges, value, side="right")) - 1

    def bounds(self, index: int) -> tuple[float, float | None]:
        """Lower and upper end; the last bin is open."""
        high = self.edges[index + 1] if index + 1 < len(self.edges) else None
        return self.edges[index], high

    def name(self, index: int) -> str:
        """``20 to 30 m``."""
        low, high = self.bounds(index)
        if high is None:
            return f"{low:g} {self.unit} and more"
        return f"{low:g} to {high:g} {self.unit}"


DISTANCE = Bins(
    "error_by_distance", "distance_m", "Error by distance", "Distance to the camera", "m",
    (0, 20, 30, 40, 50, 60, 70, 80, 100),
)  # fmt: skip
PARALLAX = Bins(
    "error_by_parallax", "parallax_degrees", "Error by parallax", "Parallax of the views", "°",
    (0, 2, 5, 10, 20, 40, 60, 90, 120),
)  # fmt: skip
SIZE = Bins(
    "error_by_size", "diameter_px", "Error by size", "Diameter of the true box", "px",
    (0, 6, 8, 10, 12, 14, 16, 20, 24, 32),
)  # fmt: skip
MAX_NAMED = 500


def error_figure(frames: Sequence[FrameResult], bins: Bins) -> Figure:
    """Median error of hits in each bin, with the quarters around it, and the frames themselves."""
    kept = [frame for frame in frames if frame.error_m is not None]
    inside: dict[int, list[float]] = {}
    for frame in kept:
        place = bins.place(getattr(frame, bins.field))
        if place is not None and frame.error_m is not None:
            inside.setdefault(place, []).append(frame.error_m)
    places = sorted(inside)
    quarters = np.array([np.quantile(inside[place], [0.25, 0.5, 0.75]) for place in places])
    quarters = quarters.reshape(-1, 3)
    middle = Series(
        "median",
        "Median, and the middle half",
        tuple(_bin_center(bins, place) for place in places),
        tuple(quarters[:, 1].tolist()),
        low=tuple(quarters[:, 0].tolist()),
        high=tuple(quarters[:, 2].tolist()),
        count=tuple(len(inside[place]) for place in places),
        frames=tuple(FrameRange(bins.field, *bins.bounds(place)) for place in places),
    )
    panel = Panel(
        bins.title,
        Axis(bins.label, bins.unit, 0.0),
        Axis("Error of the place", "m", 0.0),
        (_scatter_series(kept, bins.field), middle),
    )
    note = f"{plural(len(kept), 'frame')} with a detection of IoU > 0, oracle cameras."
    return Figure(bins.figure, bins.title, (panel,), note)


def detection_table(
    judged: Sequence[JudgedFrame], frames: Sequence[FrameResult], bins: Bins
) -> Table:
    """AP over the frames of each bin, with how many of their balls were found.

    Args:
        judged: Frames with detections.
        frames: The same frames in the same order, measured.
        bins: ``DISTANCE`` or ``SIZE``.
    """
    members: dict[int, list[int]] = {}
    for index, frame in enumerate(frames):
        place = bins.place(getattr(frame, bins.field)) if frame.ball else None
        if place is not None:
            members.setdefault(place, []).append(index)
    rows = []
    for place, indices in sorted(members.items()):
        ap_50, ap = coco_average_precision([judged[index] for index in indices])
        hits = sum(frames[index].hit_iou is not None for index in indices)
        count = len(indices)
        cells = (
            Cell(ap_50, count=count, of=count),
            Cell(ap, count=count, of=count),
            Cell(hits / count, count=count, of=count),
        )
        low, high = bins.bounds(place)
        rows.append(Row(f"{low:g}", bins.name(place), cells, FrameRange(bins.field, low, high)))
    columns = (
        Column("ap_50", "AP@0.5", "", "higher"),
        Column("ap", "AP@[.5:.95]", "", "higher"),
        Column("hit", "Found with IoU > 0", "", "higher"),
    )
    name = {"distance_m": "detection_by_distance", "diameter_px": "detection_by_size"}[bins.field]
    note = "Each row is an evaluation of its own over the frames whose true ball is in the bin."
    return Table(name, f"Detection by {bins.label.lower()}", columns, tuple(rows), note)


def _bin_center(bins: Bins, place: int) -> float:
    low, high = bins.bounds(place)
    return (low + high) / 2 if high is not None else low + (low - bins.edges[place - 1]) / 2


def _scatter_series(frames: Sequence[FrameResult], field: str) -> Series:
    """The frames themselves; of very many an even choice, which shows the same cloud."""
    pairs = [
        (value, frame.error_m)
        for frame in frames
        if (value := getattr(frame, field)) is not None and frame.error_m is not None
    ]
    step = max(math.ceil(len(pairs) / MAX_NAMED), 1)
    series = Series("frames", "Frames", (), (), "points")
    x, y = zip(*pairs[::step], strict=True) if pairs else ((), ())
    # No number lies between a value and the next one: a point opens its own frame.
    only = tuple(FrameRange(field, value, math.nextafter(value, math.inf)) for value in x)
    return replace(series, x=tuple(x), y=tuple(y), frames=only)
