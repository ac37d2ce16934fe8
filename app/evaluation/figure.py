"""Figures as values: panels, axes and series; drawing them is somebody else's work."""

from __future__ import annotations

from dataclasses import dataclass

from app.evaluation.table import FrameRange

FIGURES = (
    "precision_recall",
    "precision_distance",
    "error_by_distance",
    "error_by_parallax",
    "error_by_size",
    "sensitivity",
    "jac",
    "box_overlap",
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
        frames: The frames behind each place; empty where no number of theirs was kept.
    """

    name: str
    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    kind: str = "line"
    low: tuple[float, ...] = ()
    high: tuple[float, ...] = ()
    count: tuple[int, ...] = ()
    color: float | None = None
    group_id: int | None = None
    frames: tuple[FrameRange, ...] = ()


@dataclass(frozen=True)
class Mark:
    """A dashed line across the panel; ``axis`` is ``x`` or ``y``."""

    axis: str
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
