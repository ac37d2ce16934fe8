"""Tracing: places along the painted markings of a pitch, as a camera shows them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.geometry.resection import parameters_from_camera
from app.paint.trace_kernels import trace_markings
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.observations import pitch_curves

PAINTED = tuple(name for name in MARKINGS if not name.startswith("Goal"))
"""Markings that are paint on grass; a goal is none."""


@dataclass(frozen=True)
class TracedPlaces:
    """Places along the projected markings of one camera, a few pixels apart.

    Attributes:
        places: Pitch frame, metres, shape (N, 3).
        pixels: The middle of the paint there, shape (N, 2).
        normals: Unit normals of the markings in the picture, shape (N, 2).
        widths: Of the paint across, pixels, shape (N,).
        marking: Index into ``MARKINGS``, shape (N,), increasing.
        jacobian: Derivative along the normal by the camera's parameters, shape (N, 8).
        visible: Places in all, those too that were left out because their paint is too thin.
    """

    places: FloatArray
    pixels: FloatArray
    normals: FloatArray
    widths: FloatArray
    marking: IntArray
    jacobian: FloatArray
    visible: int

    def only(self, chosen: IntArray, visible: int) -> TracedPlaces:
        """Some of the places."""
        return TracedPlaces(
            self.places[chosen], self.pixels[chosen], self.normals[chosen],
            self.widths[chosen], self.marking[chosen], self.jacobian[chosen], visible,
        )  # fmt: skip


def trace_places(
    camera: Camera, pitch: Pitch, width: int, height: int, spacing_px: float, most: int
) -> TracedPlaces:
    """Places along the markings that lie in the picture, hidden ones too.

    Args:
        camera: Pixels of the picture; one focal length and one radial term count.
        pitch: The pitch.
        width: Of the picture, pixels, like ``height``.
        spacing_px: Between places.
        most: After so many no more are looked for.
    """
    curves, half = pitch_curves(pitch), float(np.hypot(width, height)) / 2
    places, pixels, normals = (np.empty((most, n)) for n in (3, 2, 2))
    widths, marking, rows = np.empty(most), np.empty(most, np.int64), np.empty((most, 8))
    count = trace_markings(
        parameters_from_camera(camera, half), curves.kinds, curves.shapes, painted_markings(),
        np.array(camera.principal_point), half, width, height, spacing_px,
        places, pixels, normals, widths, marking, rows,
    )  # fmt: skip
    written = slice(count)
    return TracedPlaces(
        places[written], pixels[written], normals[written],
        widths[written], marking[written], rows[written], count,
    )  # fmt: skip


@lru_cache(maxsize=1)
def painted_markings() -> BoolArray:
    return np.array([name in PAINTED for name in MARKINGS])
