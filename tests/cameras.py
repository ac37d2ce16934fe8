"""Cameras for tests: level ones that look at a place, and a lens with every coefficient."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from app.formats.cameras import camera_file_name, format_camera_file
from app.formats.view_files import write_file_below
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.lens import ARCTAN_POLYNOMIAL, FISHEYE
from app.soccer.frames import ImageSize

SIZE = ImageSize(1280, 720)
CENTER = ((SIZE.width - 1) / 2, (SIZE.height - 1) / 2)
FULL_HD = ImageSize(1920, 1080)

EVERY_COEFFICIENT = Camera(
    rotation=rotation_from_pan_tilt_roll(*np.radians([12.3, 78.9, -0.4])),
    position=np.array([1.25, 61.5, -18.75]),
    focal_length=(2100.5, 2099.25),
    principal_point=CENTER,
    distortion=np.array([0.1, -0.02, 1e-3, 2e-3, 0.3, 0.4, 0.5, 0.6, 1e-4, 2e-4, 3e-4, 4e-4]),
)
"""A main camera of which no number is another's, as files must bring it back."""


def looking(
    position: Sequence[float],
    target: Sequence[float],
    focal: float,
    *,
    bend: float = 0.0,
    size: ImageSize = SIZE,
) -> Camera:
    """A level camera that looks at a point, its principal point in the middle of the image.

    Args:
        position: Of the camera in the pitch frame, metres.
        target: In the pitch frame, metres.
        focal: Focal length, pixels.
        bend: Displacement by the lens at half the diagonal, as a share of it.
        size: Of the image.
    """
    place = np.array(position, dtype=float)
    k1 = bend * (focal / (size.diagonal / 2)) ** 2
    return Camera(
        rotation=_level(place, np.array(target, dtype=float)),
        position=place,
        focal_length=(focal, focal),
        principal_point=((size.width - 1) / 2, (size.height - 1) / 2),
        distortion=np.array([k1, k1 * k1 / 2, *np.zeros(10)]),
    )


WIDE_LENSES = {
    FISHEYE: (0.021, -0.017, 0.006, -0.0011),
    # Of the order of a real one's, with the constant that its fit left; the focal length is the
    # width of the image.
    ARCTAN_POLYNOMIAL: (-7.1e-4, 0.769, -0.119, 0.251, -0.408, 0.037, 0.268, -0.181, 0.037),
}
"""Coefficients of a lens of each kind that is no pinhole."""


def wide(
    position: Sequence[float],
    target: Sequence[float],
    lens: str = FISHEYE,
    *,
    focal: float = 400.0,
    size: ImageSize = SIZE,
) -> Camera:
    """A level camera with a lens for strong wide angle."""
    camera = looking(position, target, focal, size=size)
    return replace(camera, lens=lens, distortion=np.array(WIDE_LENSES[lens]))


def _level(place: FloatArray, target: FloatArray) -> FloatArray:
    """World-to-camera rotation of a camera without roll, shape (3, 3)."""
    forward = target - place
    forward = forward / np.linalg.norm(forward)
    # z points down, so "right" of a level camera is down x forward.
    right = np.cross(np.array([0.0, 0.0, 1.0]), forward)
    right = right / np.linalg.norm(right)
    return np.vstack([right, np.cross(forward, right), forward])


def write_cameras(root: Path, cameras: Mapping[str, Camera]) -> list[Path]:
    """Write ``camera_<stem>.json`` per camera below an existing folder; the paths written."""
    return [
        write_file_below(root, camera_file_name(key), format_camera_file(camera))
        for key, camera in cameras.items()
    ]
