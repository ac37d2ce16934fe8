"""What an evaluation found: tables of numbers, figures and their PNG, and one row per frame that stands behind them."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from app.errors import InputError
from app.formats.csv_text import Value, format_csv_cell

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
class FrameFieldRange:
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
    frames: FrameFieldRange | None = None


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
    frames: tuple[FrameFieldRange, ...] = ()


@dataclass(frozen=True)
class ReferenceLine:
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
    marks: tuple[ReferenceLine, ...] = ()
    color: Axis | None = None


@dataclass(frozen=True)
class Chart:
    """Panels side by side; ``note`` says over what it was computed."""

    name: str
    title: str
    panels: tuple[Panel, ...]
    note: str = ""


def figure_to_csv(figure: Chart) -> str:
    """The curves of a figure; the header says what the axes show, with their units."""
    x, y = (
        _join_axis_labels([panel.x for panel in figure.panels]),
        _join_axis_labels([panel.y for panel in figure.panels]),
    )
    color = _join_axis_labels([panel.color for panel in figure.panels if panel.color]) or "color"
    header = ("panel", "series", "kind", x or "x", y or "y", "low", "high", "count", color)
    return _format_csv(
        (*header, "group_id"), (row for panel in figure.panels for row in _list_panel_rows(panel))
    )


def table_to_csv(table: Table) -> str:
    """A table, each number followed by its interval and its denominators."""
    header = ["row"]
    for column in table.columns:
        header += [f"{column.name}{end}" for end in ("", "_low", "_high", "_count", "_of")]
    rows = (
        [row.name, *(value for item in row.cells
                     for value in (item.value, item.low, item.high, item.count, item.of))]
        for row in table.rows
    )  # fmt: skip
    return _format_csv(header, rows)


def _join_axis_labels(axes: Sequence[Axis]) -> str:
    """The name of a column; panels whose axes differ stand in it one after the other."""
    names = [f"{axis.label} ({axis.unit})" if axis.unit else axis.label for axis in axes]
    return " / ".join(dict.fromkeys(names))


def _list_panel_rows(panel: Panel) -> Iterator[list[Value]]:
    for series in panel.series:
        for place in range(len(series.x)):
            yield [
                panel.title,
                series.name,
                series.kind,
                series.x[place],
                series.y[place],
                *(_get_series_value(series, name, place) for name in ("low", "high", "count")),
                series.color,
                series.group_id,
            ]


def _get_series_value(series: Series, name: str, place: int) -> Value:
    values: tuple[float, ...] = getattr(series, name)
    return values[place] if values else None


def _format_csv(header: tuple[str, ...] | list[str], rows: Iterator[list[Value]]) -> str:
    file = io.StringIO(newline="")
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([format_csv_cell(value) for value in row] for row in rows)
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
        box_iou: Overlap of the true box with the reference box; only where the frame has every kind
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
    figures: tuple[Chart, ...]
    frames: tuple[FrameResult, ...]

    def table(self, name: str) -> Table | None:
        """The table of that name, or None."""
        return next((table for table in self.tables if table.name == name), None)


WIDTH, HEIGHT = 720, 560
"""Of one panel, pixels."""
DPI = 100
INK, GRAY, GRID = "#202428", "#68707a", "#e2e5e8"
PALETTE = ("#145fb4", "#d76914", "#288c5a", "#8c3c96", "#c83c3c")
"""Blue, orange, green, purple, red: apart for the colour-blind, too."""
MARK = PALETTE[4]
STYLE: Any = {
    "axes.edgecolor": GRAY, "axes.labelcolor": INK, "axes.spines.right": False,
    "axes.spines.top": False, "axes.grid": True, "axes.titlecolor": GRAY, "axes.titlesize": 11,
    "figure.constrained_layout.use": True, "font.size": 10, "grid.color": GRID,
    "legend.framealpha": 0.9, "legend.edgecolor": "none", "text.color": INK, "text.parse_math": False,
    "xtick.color": GRAY, "ytick.color": GRAY,
}  # fmt: skip
MAX_LEGEND = 6

# matplotlib has one style for the whole process.
_STYLED = Lock()


def figure_to_png(figure: Chart) -> bytes:
    """The bytes of a PNG, panels side by side, title above and note below.

    Raises:
        InputError: matplotlib is not installed.
    """
    try:
        from matplotlib import rc_context
        from matplotlib.figure import Figure as Canvas
    except ImportError:
        raise InputError(
            "figures as pictures need the package matplotlib, which is not installed",
            hint="Install Touchline with its extra: pip install 'touchline[charts]'.",
        ) from None
    count = max(len(figure.panels), 1)
    with _STYLED, rc_context(STYLE):
        canvas = Canvas(figsize=(WIDTH * count / DPI, HEIGHT / DPI), dpi=DPI)
        canvas.suptitle(figure.title, x=0.02, ha="left", size=15)
        axes = canvas.subplots(1, count, squeeze=False)[0]
        for place, panel in zip(axes, figure.panels, strict=False):
            _draw_panel(place, panel, panel.title if count > 1 else "")
        canvas.supxlabel(figure.note, size=9, color=GRAY, wrap=True)
        file = BytesIO()
        canvas.savefig(file, format="png")
    return file.getvalue()


def _draw_panel(axes: Axes, panel: Panel, title: str) -> None:
    axes.set(title=title, xlabel=_axis_label(panel.x), ylabel=_axis_label(panel.y))
    colors = [item.color for item in panel.series if item.color is not None]
    scale = _draw_color_bar(axes, colors, panel.color) if colors else None
    for index, item in enumerate(panel.series):
        color = PALETTE[index % len(PALETTE)] if scale is None else scale.to_rgba(item.color)
        _draw_series(axes, item, color, 2.2 if scale is None else 1.1)
    _set_axis_limits(axes, panel)
    for mark in panel.marks:
        _draw_reference_line(axes, mark)
    handles, labels = axes.get_legend_handles_labels()
    if scale is None and handles:
        axes.legend(handles[:MAX_LEGEND], labels[:MAX_LEGEND])


def _draw_series(axes: Axes, item: Series, color: Any, width: float) -> None:
    label = item.label or None
    if item.kind == "points":
        axes.scatter(item.x, item.y, 22, color, alpha=0.55, linewidths=0, label=label)
        return
    dashes = "--" if item.kind == "dashed" else "-"
    marker = "o" if item.low else ""
    axes.plot(item.x, item.y, dashes, color=color, linewidth=width, marker=marker, label=label)
    if item.low:
        axes.vlines(item.x, item.low, item.high, color=color, linewidth=3)


def _draw_color_bar(axes: Axes, colors: list[float], meaning: Axis | None) -> Any:
    """What the colours of the curves mean, as a bar beside the axes."""
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    # From blue (near) over green to red (far), without the ends that are nearly black.
    shades = ListedColormap(colormaps["turbo"](np.linspace(0.1, 0.94, 256)))
    scale = ScalarMappable(Normalize(min(colors), max(colors)), shades)
    figure = axes.get_figure()
    assert figure is not None, "the axes are those of a figure"
    figure.colorbar(scale, ax=axes, label=_axis_label(meaning) if meaning else "")
    return scale


def _set_axis_limits(axes: Axes, panel: Panel) -> None:
    """The ends that the axes shall have, and a few stray points shall not flatten the rest."""
    axes.set_xlim(panel.x.low, panel.x.high)
    axes.set_ylim(panel.y.low, panel.y.high)
    stray = [value for item in panel.series if item.kind == "points" for value in item.y]
    if stray and panel.y.high is None:
        low = min(stray) if panel.y.low is None else panel.y.low
        high = float(np.quantile(stray, 0.97)) * 1.2
        if high > low:
            axes.set_ylim(low, high)


def _draw_reference_line(axes: Axes, mark: ReferenceLine) -> None:
    across = mark.axis == "x"
    (axes.axvline if across else axes.axhline)(mark.at, color=MARK, linestyle="--", linewidth=1.4)
    place = (mark.at, 0.97) if across else (0.01, mark.at)
    axes.annotate(
        mark.label, place, (4, -2 if across else 4), color=MARK,
        xycoords=("data", "axes fraction") if across else ("axes fraction", "data"),
        textcoords="offset points", va="top" if across else "bottom",
    )  # fmt: skip


def _axis_label(axis: Axis) -> str:
    return f"{axis.label} [{axis.unit}]" if axis.unit else axis.label
