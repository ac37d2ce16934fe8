"""Patch: a small picture with its own transparency, drawn large and laid over a frame."""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.sample.fixture import Colour

Image = npt.NDArray[np.uint8]
Paint = tuple[float, float, float, float]
_SHIFT = 4
_SUB = 1 << _SHIFT


class Patch:
    """Shapes in image pixels, drawn ``fine`` times larger and averaged down: soft, true edges.

    Colours are multiplied by their opacity when drawn, so that averaging is right.
    """

    def __init__(self, low: FloatArray, high: FloatArray, fine: int, image: Image) -> None:
        rows, columns = image.shape[:2]
        self.left = int(np.clip(np.floor(low[0]), 0, columns))
        self.top = int(np.clip(np.floor(low[1]), 0, rows))
        self.right = int(np.clip(np.ceil(high[0]) + 1, self.left, columns))
        self.bottom = int(np.clip(np.ceil(high[1]) + 1, self.top, rows))
        self.fine = fine
        self.image = image
        shape = ((self.bottom - self.top) * fine, (self.right - self.left) * fine, 4)
        self.pixels = np.zeros(shape, np.uint8)

    @property
    def is_empty(self) -> bool:
        """Whether it lies outside the frame."""
        return self.pixels.size == 0

    def to_fine(self, points: FloatArray) -> npt.NDArray[np.int32]:
        """Image pixels in the fixed-point coordinates of the enlarged picture."""
        # The centre of pixel 0 is at 0, that of the enlarged pixel 0 at (0.5 / fine) - 0.5.
        local = (points - (self.left - 0.5, self.top - 0.5)) * self.fine - 0.5
        return np.asarray(np.round(local * _SUB), np.int32)

    def polygon(self, points: FloatArray, colour: Colour) -> None:
        """Fill a convex polygon, image pixels, shape (N, 2)."""
        cv2.fillConvexPoly(
            self.pixels, self.to_fine(points), _premultiplied_colour(colour, 1.0), 8, _SHIFT
        )

    def disc(self, center: FloatArray, radius: float, colour: Colour) -> None:
        """Fill a circle; centre and radius in image pixels."""
        self._draw_disc(
            float(center[0]), float(center[1]), radius, _premultiplied_colour(colour, 1.0)
        )

    def capsule(
        self, a: FloatArray, b: FloatArray, radius_a: float, radius_b: float, colour: Colour
    ) -> None:
        """Fill a limb: two circles and what lies between them, image pixels."""
        # Plain numbers: a frame has thousands of limbs, and arrays of two are slow.
        ax, ay, bx, by = float(a[0]), float(a[1]), float(b[0]), float(b[1])
        paint = _premultiplied_colour(colour, 1.0)
        self._draw_disc(ax, ay, radius_a, paint)
        self._draw_disc(bx, by, radius_b, paint)
        length = math.hypot(bx - ax, by - ay)
        if length < 1e-6:
            return
        nx, ny = (ay - by) / length, (bx - ax) / length
        quad = [
            self._to_fixed_point(ax + nx * radius_a, ay + ny * radius_a),
            self._to_fixed_point(bx + nx * radius_b, by + ny * radius_b),
            self._to_fixed_point(bx - nx * radius_b, by - ny * radius_b),
            self._to_fixed_point(ax - nx * radius_a, ay - ny * radius_a),
        ]
        cv2.fillConvexPoly(self.pixels, np.array(quad, np.int32), paint, 8, _SHIFT)

    def _draw_disc(self, x: float, y: float, radius: float, paint: Paint) -> None:
        size = max(1, round(radius * self.fine * _SUB))
        cv2.circle(self.pixels, self._to_fixed_point(x, y), size, paint, -1, 8, _SHIFT)

    def _to_fixed_point(self, x: float, y: float) -> tuple[int, int]:
        """As ``to_fine``, for one point."""
        return (
            round(((x - self.left + 0.5) * self.fine - 0.5) * _SUB),
            round(((y - self.top + 0.5) * self.fine - 0.5) * _SUB),
        )

    def polyline(self, points: FloatArray, colour: Colour, opacity: float, thickness: int) -> None:
        """A thin line through image pixels, ``thickness`` in enlarged pixels."""
        path = [self.to_fine(points).reshape(-1, 1, 2)]
        cv2.polylines(
            self.pixels, path, False, _premultiplied_colour(colour, opacity), thickness, 8, _SHIFT
        )

    def draw_on_frame(self, gain: Colour = (1.0, 1.0, 1.0)) -> None:
        """Put it on the frame.

        Args:
            gain: Light on it, per channel.
        """
        if self.is_empty:
            return
        size = (self.right - self.left, self.bottom - self.top)
        small = cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        area = self.image[self.top : self.bottom, self.left : self.right]
        keep = 1.0 - small[..., 3:] / 255.0
        mixed = area * keep + small[..., :3] * np.array(gain, np.float32)
        area[...] = np.clip(mixed, 0, 255).astype(np.uint8)


def _premultiplied_colour(colour: Colour, opacity: float) -> Paint:
    b, g, r = colour
    return b * opacity, g * opacity, r * opacity, 255.0 * opacity
