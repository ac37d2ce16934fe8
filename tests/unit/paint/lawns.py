"""Pictures that tests of paint look at: drawn lines on plain grass, and one rendered frame."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.camera import Camera
from app.paint.search import PictureToScore
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.jaccard import project_markings
from tests.cameras import looking

SMALL = ImageSize(960, 540)
PITCH = Pitch()
TRUE = looking((2.0, 62.0, -16.0), (36.0, -4.0, 0.0), 1500.0, size=SMALL)
"""A main camera that looks at the right penalty area."""


def drawn(camera: Camera, broad: int = 1, pitch: Pitch = PITCH) -> npt.NDArray[np.bool_]:
    """The grass markings as thin lines, shape (540, 960)."""
    names = [name for name in MARKINGS if not name.startswith("Goal")]
    return marked(camera, *names, broad=broad, pitch=pitch)


def marked(
    camera: Camera, *names: str, broad: int = 3, pitch: Pitch = PITCH
) -> npt.NDArray[np.bool_]:
    """These markings alone, shape (540, 960)."""
    mask = np.zeros((SMALL.height, SMALL.width), np.uint8)
    for name, polyline in project_markings(camera, pitch, SMALL).items():
        if name in names and len(polyline) > 1:
            cv2.polylines(mask, [np.round(polyline).astype(np.int32)], False, 1, broad)
    return mask.astype(np.bool_)


def lawn(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """A picture of grass with noise and white where the mask is, red green blue."""
    rng = np.random.default_rng(1)
    picture = np.empty((SMALL.height, SMALL.width, 3))
    picture[:] = (48, 120, 50)
    picture[mask] = (225, 230, 225)
    noisy = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0, 2, picture.shape)
    return np.clip(noisy, 0, 255).astype(np.uint8)


def picture_of(camera: Camera) -> PictureToScore:
    """The drawn markings of a camera as scoring reads them."""
    mask = drawn(camera)
    return PictureToScore.of(mask, np.ones(mask.shape, np.bool_), camera.principal_point)
