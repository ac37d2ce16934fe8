"""Observations: annotated lines as the resection uses them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import ARC, SEGMENT, CurvePoints, Curves, IntArray
from app.geometry.resection_kernels import select_farthest_points
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Arc, Pitch, Segment, mirrored_marking

SHARED_SHARE = 0.5
"""Of the variance of clicks, what the points of a marking have in common: 727 real frames show 0.49 to 0.63
(``line_noise``)."""


@dataclass(frozen=True)
class Observations:
    """Points of one image, each on a marking of the pitch.

    Attributes:
        curves: All markings, in the order of ``MARKINGS``.
        pixels: Relative to the principal point, shape (N, 2).
        marking: Index into ``MARKINGS`` of each point, shape (N,), increasing.
    """

    curves: Curves
    pixels: FloatArray
    marking: IntArray

    @property
    def markings(self) -> tuple[str, ...]:
        """Names of the markings that are seen."""
        return tuple(MARKINGS[index] for index in np.unique(self.marking))

    def curve_points(self, share: float = 0.0) -> CurvePoints:
        """All points, with the weight of each where the points of a marking have so much of their variance
        in common: n of them count as n / (1 + share (n - 1)). Without a share each has weight one."""
        return CurvePoints(self.pixels, self.marking, compute_point_weights(self.marking, share))

    def without(self, *markings: str) -> Observations:
        """The same without the points of some markings."""
        keep = ~np.isin(self.marking, [MARKINGS.index(marking) for marking in markings])
        return Observations(self.curves, self.pixels[keep], self.marking[keep])

    def only(self, marking: str, as_marking: str | None = None) -> Observations:
        """The points of one marking alone, if asked under another label."""
        keep = self.marking == MARKINGS.index(marking)
        label = MARKINGS.index(as_marking or marking)
        return Observations(self.curves, self.pixels[keep], np.full(int(keep.sum()), label))

    def mirrored(self) -> Observations:
        """The same under the names that they have once left and right are exchanged."""
        other = np.array([MARKINGS.index(mirrored_marking(name)) for name in MARKINGS])
        marking = other[self.marking]
        order = np.argsort(marking, kind="stable")
        return Observations(self.curves, self.pixels[order], marking[order])

    def thin_points(self, straight: int, circular: int) -> Observations:
        """At most so many points of each straight marking and of each circle.

        The points farthest apart are kept: they say nearly all there is.
        """
        limits = np.where(self.curves.kinds == ARC, circular, straight)
        keep = np.empty(len(self.pixels), dtype=np.bool_)
        select_farthest_points(self.pixels, self.marking, limits, keep)
        return Observations(self.curves, self.pixels[keep], self.marking[keep])


def compute_point_weights(marking: IntArray, share: float) -> FloatArray:
    """Weight of each point beside those of its marking, shape (N,) (``Observations.curve_points``)."""
    count = np.bincount(marking, minlength=len(MARKINGS))[marking]
    return np.asarray(1 / (1 + share * (count - 1)))


def make_observations(lines: Lines, pitch: Pitch, size: ImageSize) -> Observations:
    """Observations of annotated lines; points far outside the image are kept.

    Args:
        lines: Points by marking, pixels.
        pitch: The pitch.
        size: Annotated size; its centre is the principal point.
    """
    x0, y0 = principal_point(size)
    pixels, marking = [], []
    for index, name in enumerate(MARKINGS):
        for point in lines.get(name, ()):
            pixels.append((point.x - x0, point.y - y0))
            marking.append(index)
    return Observations(
        pitch_curves(pitch),
        np.array(pixels, dtype=np.float64).reshape(-1, 2),
        np.array(marking, dtype=np.int64),
    )


def principal_point(size: ImageSize) -> tuple[float, float]:
    """Centre of the image in pixels: (W - 1) / 2, (H - 1) / 2."""
    return (size.width - 1) / 2, (size.height - 1) / 2


@lru_cache(maxsize=8)
def pitch_curves(pitch: Pitch) -> Curves:
    """The markings as curves, in the order of ``MARKINGS``."""
    shapes = [pitch.shapes[marking] for marking in MARKINGS]
    kinds = [ARC if isinstance(shape, Arc) else SEGMENT for shape in shapes]
    return Curves(
        np.array(kinds, dtype=np.int64), np.array([_shape_to_numbers(item) for item in shapes])
    )


def _shape_to_numbers(shape: Segment | Arc) -> tuple[float, ...]:
    if isinstance(shape, Arc):
        return (*shape.center, shape.radius, shape.first, shape.last, 0.0)
    return (*shape.start, *shape.end)
