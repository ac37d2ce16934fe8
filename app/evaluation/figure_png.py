"""Figures as PNG, drawn by matplotlib."""

from __future__ import annotations

from io import BytesIO
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from app.errors import InputError
from app.evaluation.result import Axis, Figure, Mark, Panel, Series

if TYPE_CHECKING:
    from matplotlib.axes import Axes

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


def figure_png(figure: Figure) -> bytes:
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
    scale = _color_scale(axes, colors, panel.color) if colors else None
    for index, item in enumerate(panel.series):
        color = PALETTE[index % len(PALETTE)] if scale is None else scale.to_rgba(item.color)
        _draw_series(axes, item, color, 2.2 if scale is None else 1.1)
    _set_limits(axes, panel)
    for mark in panel.marks:
        _draw_mark(axes, mark)
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


def _color_scale(axes: Axes, colors: list[float], meaning: Axis | None) -> Any:
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


def _set_limits(axes: Axes, panel: Panel) -> None:
    """The ends that the axes shall have, and a few stray points shall not flatten the rest."""
    axes.set_xlim(panel.x.low, panel.x.high)
    axes.set_ylim(panel.y.low, panel.y.high)
    stray = [value for item in panel.series if item.kind == "points" for value in item.y]
    if stray and panel.y.high is None:
        low = min(stray) if panel.y.low is None else panel.y.low
        high = float(np.quantile(stray, 0.97)) * 1.2
        if high > low:
            axes.set_ylim(low, high)


def _draw_mark(axes: Axes, mark: Mark) -> None:
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
