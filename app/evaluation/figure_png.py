"""Figures as PNG, drawn at twice their size and made small again, so that lines are smooth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from app.evaluation.figure import Axis, Figure, Panel, Series
from app.geometry.arrays import FloatArray

WIDTH, HEIGHT = 720, 520
"""Of one panel, pixels."""
LEFT, RIGHT, TOP, BOTTOM = 84, 24, 84, 104
SCALE = 2
INK, GRAY, GRID, PAPER = (40, 36, 32), (120, 112, 104), (232, 229, 226), (255, 255, 255)
PALETTE = ((180, 95, 20), (20, 105, 215), (90, 140, 40), (150, 60, 140), (60, 60, 200))
"""Blue, orange, green, purple, red as BGR: apart for the colour-blind, too."""
DASH = (9.0, 6.0)
MAX_LEGEND = 6

Picture = Any


def figure_png(figure: Figure) -> bytes:
    """The bytes of a PNG, panels side by side, title above and note below."""
    count = max(len(figure.panels), 1)
    height, width = HEIGHT + 40, WIDTH * count
    picture: Picture = np.full((height * SCALE, width * SCALE, 3), PAPER, np.uint8)
    _write(picture, figure.title, (LEFT, 34), 21, INK)
    for index, panel in enumerate(figure.panels):
        _Drawing(picture, panel, WIDTH * index).draw(with_title=count > 1)
    _note(picture, figure.note, width, height)
    small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".png", small, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    assert done, "a picture of our own can be encoded"
    return bytes(data)


@dataclass(frozen=True)
class _Span:
    """The range of an axis, and its ticks."""

    low: float
    high: float
    ticks: tuple[float, ...]

    @staticmethod
    def of(axis: Axis, values: Sequence[float]) -> _Span:
        finite = [value for value in values if math.isfinite(value)]
        low = axis.low if axis.low is not None else min(finite, default=0.0)
        high = axis.high if axis.high is not None else max(finite, default=1.0)
        if axis.high is None:
            high += 0.04 * (high - low)
        if not high > low:
            high = low + 1.0
        step = _step((high - low) / 6)
        first = math.ceil(low / step - 1e-9)
        last = math.floor(high / step + 1e-9)
        return _Span(low, high, tuple(step * place for place in range(first, last + 1)))


class _Drawing:
    """One panel under way."""

    def __init__(self, picture: Picture, panel: Panel, offset: int):
        self.picture, self.panel = picture, panel
        self.left, self.right = offset + LEFT, offset + WIDTH - RIGHT
        self.top, self.bottom = TOP, HEIGHT - BOTTOM + 20
        every = panel.series
        self.x = _Span.of(panel.x, [value for item in every for value in item.x])
        heights = [value for item in every for value in (item.high or item.y)]
        self.y = _Span.of(panel.y, _without_outliers(heights, panel.series))
        colors = [item.color for item in every if item.color is not None]
        self.colors = (min(colors), max(colors)) if colors else None

    def draw(self, with_title: bool) -> None:
        """Grid, curves, marks, then everything that is written."""
        self._grid()
        for index, item in enumerate(self.panel.series):
            self._series(item, self._color(item, index))
        for mark in self.panel.marks:
            self._mark(mark.axis, mark.at, mark.label)
        self._frame()
        if with_title:
            _write(self.picture, self.panel.title, (self.left, self.top - 14), 15, GRAY)
        if self.colors:
            self._color_bar()
        else:
            self._legend()

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Pixel of a value, clipped just outside the axes."""
        across = (x - self.x.low) / (self.x.high - self.x.low)
        up = (y - self.y.low) / (self.y.high - self.y.low)
        return (
            self.left + min(max(across, 0.0), 1.0) * (self.right - self.left),
            self.bottom - min(max(up, 0.0), 1.0) * (self.bottom - self.top),
        )

    def _grid(self) -> None:
        for tick in self.x.ticks:
            x, _ = self.place(tick, self.y.low)
            _line(self.picture, (x, self.top), (x, self.bottom), GRID)
            _write(self.picture, _number(tick), (x, self.bottom + 20), 13, GRAY, align=0.5)
        for tick in self.y.ticks:
            _, y = self.place(self.x.low, tick)
            _line(self.picture, (self.left, y), (self.right, y), GRID)
            _write(self.picture, _number(tick), (self.left - 8, y + 5), 13, GRAY, align=1.0)

    def _frame(self) -> None:
        _line(self.picture, (self.left, self.bottom), (self.right, self.bottom), GRAY)
        _line(self.picture, (self.left, self.top), (self.left, self.bottom), GRAY)
        middle = (self.left + self.right) / 2
        _write(self.picture, _axis(self.panel.x), (middle, self.bottom + 44), 15, INK, align=0.5)
        _upright(self.picture, _axis(self.panel.y), (self.left - 62, (self.top + self.bottom) / 2))

    def _series(self, item: Series, color: tuple[int, int, int]) -> None:
        points = [self.place(x, y) for x, y in zip(item.x, item.y, strict=True)]
        if item.low and item.high:
            ends = zip(item.x, item.low, item.high, strict=True)
            for x, low, high in ends:
                _line(self.picture, self.place(x, low), self.place(x, high), color, 3.0)
        if item.kind == "points":
            for x, y in points:
                _dot(self.picture, (x, y), _mixed(color, 0.55), 2.4)
            return
        thin = self.colors is not None
        _curve(self.picture, points, color, 1.1 if thin else 2.2, dashed=item.kind == "dashed")
        if item.low:
            for x, y in points:
                _dot(self.picture, (x, y), color, 4.5)

    def _mark(self, axis: str, at: float, label: str) -> None:
        if axis == "x":
            (x, _), words = self.place(at, self.y.low), (6, self.top + 16)
            _curve(self.picture, [(x, self.top), (x, self.bottom)], PALETTE[4], 1.4, dashed=True)
            _write(self.picture, label, (x + words[0], words[1]), 13, PALETTE[4])
            return
        _, y = self.place(self.x.low, at)
        _curve(self.picture, [(self.left, y), (self.right, y)], PALETTE[4], 1.4, dashed=True)
        _write(self.picture, label, (self.left + 6, y - 6), 13, PALETTE[4])

    def _color(self, item: Series, index: int) -> tuple[int, int, int]:
        if self.colors is None or item.color is None:
            return PALETTE[index % len(PALETTE)]
        low, high = self.colors
        return _scale((item.color - low) / (high - low) if high > low else 0.5)

    def _legend(self) -> None:
        shown = [item for item in enumerate(self.panel.series) if item[1].label][:MAX_LEGEND]
        widest = max((_width(item.label, 13) for _, item in shown), default=0.0)
        high = 20 * len(shown) + 8
        corner = self._quiet_corner(widest + 44, high)
        for row, (index, item) in enumerate(shown):
            y = corner[1] + 18 + 20 * row
            color = self._color(item, index)
            if item.kind == "points":
                _dot(self.picture, (corner[0] + 20, y - 4), _mixed(color, 0.55), 3.5)
            else:
                ends = [(corner[0] + 8, y - 4), (corner[0] + 32, y - 4)]
                _curve(self.picture, ends, color, 2.2, dashed=item.kind == "dashed")
            _write(self.picture, item.label, (corner[0] + 40, y), 13, INK)

    def _quiet_corner(self, width: float, height: float) -> tuple[float, float]:
        """The corner of the axes where the fewest places lie; its box is made white."""
        corners = [
            (x, y)
            for y in (self.top + 6, self.bottom - height - 6)
            for x in (self.right - width - 6, self.left + 6)
        ]
        points = [
            self.place(x, y)
            for item in self.panel.series
            for x, y in zip(item.x, item.y, strict=True)
        ]

        def crowd(corner: tuple[float, float]) -> int:
            left, top = corner
            return sum(left <= x <= left + width and top <= y <= top + height for x, y in points)

        best = min(corners, key=crowd)
        _box(self.picture, best, (best[0] + width, best[1] + height), PAPER)
        return best

    def _color_bar(self) -> None:
        """What the colours of the curves mean, along the top edge."""
        assert self.colors is not None
        low, high = self.colors
        label = _axis(self.panel.color) if self.panel.color else ""
        right, left, y = self.right - 34, self.right - 174, self.top - 20
        for step in range(140):
            _box(self.picture, (left + step, y), (left + step + 1, y + 8), _scale(step / 139))
        _write(self.picture, f"{label}  {low:.0f}", (left - 6, y + 9), 12, GRAY, align=1.0)
        _write(self.picture, f"{high:.0f}", (right + 6, y + 9), 12, GRAY)


def _without_outliers(values: Sequence[float], series: Sequence[Series]) -> list[float]:
    """Heights for the range: a few stray points shall not flatten everything else."""
    stray = [value for item in series if item.kind == "points" for value in item.y]
    if not stray:
        return list(values)
    limit = float(np.quantile(stray, 0.97)) * 1.15
    return [value for value in values if value <= limit] or list(values)


def _step(rough: float) -> float:
    """1, 2 or 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(rough))
    return next(power * part for part in (1, 2, 5, 10) if power * part >= rough * (1 - 1e-9))


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return "0" if text == "-0" else text.replace("-", "−")


def _axis(axis: Axis) -> str:
    return f"{axis.label} [{axis.unit}]" if axis.unit else axis.label


def _scale(share: float) -> tuple[int, int, int]:
    """From blue (near) over green to red (far), by cv2's turbo."""
    row = np.array([[round(25 + 215 * min(max(share, 0.0), 1.0))]], np.uint8)
    blue, green, red = cv2.applyColorMap(row, cv2.COLORMAP_TURBO)[0, 0].tolist()
    return blue, green, red


def _mixed(color: tuple[int, int, int], share: float) -> tuple[int, int, int]:
    """A colour on white paper, thinned."""
    blue, green, red = (round(255 - share * (255 - part)) for part in color)
    return blue, green, red


def _fixed(point: tuple[float, float]) -> tuple[int, int]:
    """cv2's fixed point: sixteenths of a pixel."""
    return round(point[0] * SCALE * 16), round(point[1] * SCALE * 16)


def _line(
    picture: Picture,
    a: tuple[float, float],
    b: tuple[float, float],
    color: tuple[int, int, int],
    width: float = 1.0,
) -> None:
    cv2.line(picture, _fixed(a), _fixed(b), color, round(width * SCALE), cv2.LINE_AA, 4)


def _box(
    picture: Picture,
    a: tuple[float, float],
    b: tuple[float, float],
    color: tuple[int, int, int],
) -> None:
    cv2.rectangle(picture, _fixed(a), _fixed(b), color, cv2.FILLED, cv2.LINE_8, 4)


def _dot(
    picture: Picture, at: tuple[float, float], color: tuple[int, int, int], radius: float
) -> None:
    size = round(radius * SCALE * 16)
    cv2.circle(picture, _fixed(at), size, color, cv2.FILLED, cv2.LINE_AA, 4)


def _curve(
    picture: Picture,
    points: Sequence[tuple[float, float]],
    color: tuple[int, int, int],
    width: float,
    *,
    dashed: bool,
) -> None:
    parts = _dashes(np.array(points)) if dashed and len(points) > 1 else [np.array(points)]
    for part in parts:
        if len(part) > 1:
            path = np.array([_fixed((x, y)) for x, y in part.tolist()], np.int32)
            cv2.polylines(
                picture, [path], False, color, max(round(width * SCALE), 1), cv2.LINE_AA, 4
            )


def _dashes(points: FloatArray) -> list[FloatArray]:
    """A polyline cut into dashes of equal length along itself."""
    lengths = np.append(0.0, np.cumsum(np.hypot(*np.diff(points, axis=0).T)))
    dashes = []
    start = 0.0
    while start < lengths[-1]:
        end = min(start + DASH[0], float(lengths[-1]))
        inside = lengths[(lengths > start) & (lengths < end)]
        at = np.concatenate([[start], inside, [end]])
        ends = (np.interp(at, lengths, points[:, axis]) for axis in (0, 1))
        dashes.append(np.column_stack(list(ends)))
        start = end + DASH[1]
    return dashes


def _face() -> Any:
    return cv2.FontFace("sans")


def _width(text: str, size: int) -> float:
    box = cv2.getTextSize((8, 8), text, (0, 0), _face(), size * SCALE, 400)
    width: float = float(box[2]) / SCALE
    return width


def _write(
    picture: Picture,
    text: str,
    at: tuple[float, float],
    size: int,
    color: tuple[int, int, int],
    align: float = 0.0,
) -> None:
    """Text on its baseline; ``align`` is the share of its width that lies left of ``at``."""
    x = at[0] - align * _width(text, size) if align else at[0]
    place = (round(x * SCALE), round(at[1] * SCALE))
    cv2.putText(picture, text, place, color, _face(), size * SCALE, 400)


def _upright(picture: Picture, text: str, center: tuple[float, float]) -> None:
    """Text that reads upwards, centred."""
    long, high = round(_width(text, 15) * SCALE) + 8, 22 * SCALE
    strip: Picture = np.full((high, long, 3), PAPER, np.uint8)
    cv2.putText(strip, text, (2, 16 * SCALE), INK, _face(), 15 * SCALE, 400)
    turned = cv2.rotate(strip, cv2.ROTATE_90_COUNTERCLOCKWISE)
    left = max(round(center[0] * SCALE) - high // 2, 0)
    top = max(round(center[1] * SCALE) - long // 2, 0)
    room = picture[top : top + turned.shape[0], left : left + turned.shape[1]]
    room[:] = turned[: room.shape[0], : room.shape[1]]


def _note(picture: Picture, text: str, width: int, height: int) -> None:
    """The note below, broken into lines that fit."""
    lines, line = [], ""
    for word in text.split():
        longer = f"{line} {word}".strip()
        if _width(longer, 13) > width - LEFT - RIGHT and line:
            lines.append(line)
            line = word
        else:
            line = longer
    lines.append(line)
    for row, part in enumerate(lines[:3]):
        _write(picture, part, (LEFT, height - 48 + 18 * row), 13, GRAY)
