"""What an evaluation found: tables of numbers, figures, and one row per frame that stands behind them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from app.formats.csv_text import Value, csv_cell

TABLES = (
    "detection",
    "localization",
    "detection_by_size",
    "detection_by_distance",
    "boxes",
    "calibration",
    "sensitivity",
    "tracks",
    "track_events",
)


@dataclass(frozen=True)
class Cell:
    """One number.

    Attributes:
        value: None when there is nothing to compute it from.
        low: Lower end of the 95 % interval; None where there is none.
        high: Upper end.
        count: How many items the number was computed from.
        of: How many there were to compute it from; at least ``count``.
    """

    value: float | None
    low: float | None = None
    high: float | None = None
    count: int = 0
    of: int = 0


@dataclass(frozen=True)
class Column:
    """What a column holds; ``better`` is ``higher``, ``lower`` or empty."""

    name: str
    label: str
    unit: str = ""
    better: str = ""


@dataclass(frozen=True)
class FrameRange:
    """The frames behind a row: those whose ``field`` lies in [low, high), a missing bound open.

    Fields are those of ``result.FrameResult``.
    """

    field: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Row:
    """One line of a table, its cells in the order of the columns."""

    name: str
    label: str
    cells: tuple[Cell, ...]
    frames: FrameRange | None = None


@dataclass(frozen=True)
class Table:
    """A table; ``note`` says over what it was computed, in a sentence."""

    name: str
    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    note: str = ""

    def row(self, name: str) -> Row | None:
        """The row of that name, or None."""
        return next((row for row in self.rows if row.name == name), None)

    def cell(self, row: str, column: str) -> Cell:
        """One cell by the names of its row and column."""
        place = [item.name for item in self.columns].index(column)
        return next(item for item in self.rows if item.name == row).cells[place]


FIGURES = (
    "precision_recall",
    "precision_distance",
    "error_by_distance",
    "error_by_parallax",
    "error_by_size",
    "sensitivity",
    "jac",
    "box_overlap",
    "track_distance",
)


@dataclass(frozen=True)
class Axis:
    """What an axis shows; ``low`` and ``high`` fix its ends where the data shall not."""

    label: str
    unit: str = ""
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Series:
    """One curve, or one set of points.

    Attributes:
        name: For machines; unique in its panel.
        kind: ``line``, ``dashed`` or ``points``.
        low: Lower end of a band or of error bars, per place; empty where there is none.
        count: Items behind each place; empty where that says nothing.
        color: Value that the colour stands for (see ``Panel.color``), or None.
        group_id: The group behind a whole series, or None.
        frames: The frames behind each place; empty where none of its numbers was kept.
    """

    name: str
    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: Literal["line", "dashed", "points"] = "line"
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    count: tuple[int, ...] = ()
    color: float | None = None
    group_id: int | None = None
    frames: tuple[FrameRange, ...] = ()


@dataclass(frozen=True)
class Mark:
    """A dashed line across the panel; ``axis`` is ``x`` or ``y``."""

    axis: Literal["x", "y"]
    at: float
    label: str


@dataclass(frozen=True)
class Panel:
    """One pair of axes with its curves; ``color`` names what the colours of the series mean."""

    title: str
    x: Axis
    y: Axis
    series: tuple[Series, ...]
    marks: tuple[Mark, ...] = ()
    color: Axis | None = None


@dataclass(frozen=True)
class Figure:
    """Panels side by side; ``note`` says over what it was computed."""

    name: str
    title: str
    panels: tuple[Panel, ...]
    note: str = ""


def figure_csv(figure: Figure) -> str:
    """The curves of a figure; the header says what the axes show, with their units."""
    x, y = (
        _axes_name([panel.x for panel in figure.panels]),
        _axes_name([panel.y for panel in figure.panels]),
    )
    color = _axes_name([panel.color for panel in figure.panels if panel.color]) or "color"
    header = ("panel", "series", "kind", x or "x", y or "y", "low", "high", "count", color)
    return _csv_text(
        (*header, "group_id"), (row for panel in figure.panels for row in _panel_rows(panel))
    )


def table_csv(table: Table) -> str:
    """A table, each number followed by its interval and its denominators."""
    header = ["row"]
    for column in table.columns:
        header += [f"{column.name}{end}" for end in ("", "_low", "_high", "_count", "_of")]
    rows = (
        [row.name, *(value for item in row.cells
                     for value in (item.value, item.low, item.high, item.count, item.of))]
        for row in table.rows
    )  # fmt: skip
    return _csv_text(header, rows)


def _axes_name(axes: Sequence[Axis]) -> str:
    """The name of a column; panels whose axes differ stand in it one after the other."""
    names = [f"{axis.label} ({axis.unit})" if axis.unit else axis.label for axis in axes]
    return " / ".join(dict.fromkeys(names))


def _panel_rows(panel: Panel) -> Iterator[list[Value]]:
    for series in panel.series:
        for place in range(len(series.x)):
            yield [
                panel.title,
                series.name,
                series.kind,
                series.x[place],
                series.y[place],
                *(_value_at(series, name, place) for name in ("low", "high", "count")),
                series.color,
                series.group_id,
            ]


def _value_at(series: Series, name: str, place: int) -> Value:
    values: tuple[float, ...] = getattr(series, name)
    return values[place] if values else None


def _csv_text(header: tuple[str, ...] | list[str], rows: Iterator[list[Value]]) -> str:
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([csv_cell(value) for value in row] for row in rows)
    return file.getvalue()


@dataclass(frozen=True)
class FrameResult:
    """One judged frame; a number that does not exist is None.

    Attributes:
        frame_id: Id of the view.
        ball: Whether the frame shows a ball.
        detections: How many balls were found in it.
        score: Of the surest detection; ``iou`` is its overlap with the true box.
        hit_score: Of the surest detection that overlaps the true box at all, the one that the
            paper measures; ``hit_iou`` likewise.
        distance_m: From the dataset's camera to the ball.
        diameter_px: Of the true box.
        size_error_percent: By how much the hit is larger than the true box, signed.
        error_m: How far the hit's place is from the ball, with the dataset's camera.
        error_percent: The same, of the distance.
        any_error_m: The same for the surest detection, whether it overlaps or not.
        predicted_error_m: As ``error_m`` with the predicted camera; likewise the two after it.
        predicted_jac: JaC of the predicted camera at 0.5 % of the diagonal; 0 where there are
            annotated lines and no camera.
        box_iou: Overlap of the true box with the careful one; only where the frame has every kind
            of box, as in the table of boxes.
    """

    frame_id: int
    group_id: int
    group: str
    view: str
    match: str
    ball: bool
    detections: int
    score: float | None = None
    iou: float | None = None
    hit_score: float | None = None
    hit_iou: float | None = None
    distance_m: float | None = None
    diameter_px: float | None = None
    parallax_degrees: float | None = None
    size_error_percent: float | None = None
    error_m: float | None = None
    error_percent: float | None = None
    any_error_m: float | None = None
    predicted_error_m: float | None = None
    predicted_error_percent: float | None = None
    predicted_any_error_m: float | None = None
    predicted_jac: float | None = None
    box_iou: float | None = None


NUMBERS = tuple(
    name
    for name in FrameResult.__dataclass_fields__
    if name not in ("frame_id", "group_id", "group", "view", "match", "ball")
)
"""Fields of ``FrameResult`` by which frames are filtered and sorted."""


@dataclass(frozen=True)
class Evaluation:
    """Everything that one run found.

    Attributes:
        counts: Denominators by name: ``frames``, ``balls``, ``detections`` ...
    """

    counts: Mapping[str, int]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]
    frames: tuple[FrameResult, ...]

    def table(self, name: str) -> Table | None:
        """The table of that name, or None."""
        return next((table for table in self.tables if table.name == name), None)
