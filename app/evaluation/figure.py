"""Curves and bars of an evaluation, and the same as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from app.evaluation.table import FrameRange, Table
from app.formats.csv_text import Value, csv_cell

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
    x, y = _axes([panel.x for panel in figure.panels]), _axes([panel.y for panel in figure.panels])
    color = _axes([panel.color for panel in figure.panels if panel.color]) or "color"
    header = ("panel", "series", "kind", x or "x", y or "y", "low", "high", "count", color)
    return _text((*header, "group_id"), (row for panel in figure.panels for row in _rows(panel)))


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
    return _text(header, rows)


def _axes(axes: Sequence[Axis]) -> str:
    """The name of a column; panels whose axes differ stand in it one after the other."""
    names = [f"{axis.label} ({axis.unit})" if axis.unit else axis.label for axis in axes]
    return " / ".join(dict.fromkeys(names))


def _rows(panel: Panel) -> Iterator[list[Value]]:
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


def _text(header: tuple[str, ...] | list[str], rows: Iterator[list[Value]]) -> str:
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([csv_cell(value) for value in row] for row in rows)
    return file.getvalue()
