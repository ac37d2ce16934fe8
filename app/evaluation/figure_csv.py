"""Figures as CSV: one row per place of a curve, every digit, nothing for what is missing."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence

from app.datasets.csv_text import Value, cell
from app.evaluation.figure import Axis, Figure, Panel, Series
from app.evaluation.table import Table


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
                *(_at(series, name, place) for name in ("low", "high", "count")),
                series.color,
                series.group_id,
            ]


def _at(series: Series, name: str, place: int) -> Value:
    values: tuple[float, ...] = getattr(series, name)
    return values[place] if values else None


def _text(header: tuple[str, ...] | list[str], rows: Iterator[list[Value]]) -> str:
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([cell(value) for value in row] for row in rows)
    return file.getvalue()
