"""Frame pitch: the size of the pitch that proposed cameras of one film show together.

A camera is sought on 105 x 68 m. On another pitch single markings lie beside their paint, and the
frames of one main camera say together where the paint has them (``solving.pitch_size``).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.errors import GeometryError
from app.geometry.camera import Camera
from app.paint.evidence import Image, read_picture, seek, to_paint_evidence, trace
from app.paint.grass import field_of_play
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.pitch_size import PitchFrame, estimate_pitch

WINDOW_PX = 20.0
"""At 960 wide, to either side that paint is sought: markings of another pitch lie far off."""
FRAMES = 3
"""Paint is exact; yet no single frame decides a size."""
NEAR_M = 3.0
"""Cameras that stand so near each other, in pictures of one size, may be one."""


def pitch_frame(image: Image, camera: Camera, pitch: Pitch) -> PitchFrame:
    """Places of paint on and beside the markings of a proposed camera.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: Pixels of it.
        pitch: On which the camera was found.
    """
    height, width = image.shape[:2]
    reading = read_picture(image, field_of_play(image))
    window = WINDOW_PX * max(width / 960, 0.6)
    evidence = seek(reading, trace(reading, camera, pitch), window)
    return PitchFrame(to_paint_evidence(evidence, camera).some_points(), ImageSize(width, height))


def films(cameras: Sequence[Camera | None], sizes: Sequence[ImageSize | None]) -> list[list[int]]:
    """Indices of frames that one main camera may have taken, by where it stands, shape as told."""
    found: list[list[int]] = []
    for index, (camera, size) in enumerate(zip(cameras, sizes, strict=True)):
        if camera is None:
            continue
        for film in found:
            near = (cameras[other] for other in film)
            if sizes[film[0]] == size and any(_is_near(camera, other) for other in near):
                film.append(index)
                break
        else:
            found.append([index])
    return found


def pitch_of(frames: Sequence[PitchFrame], pitch: Pitch) -> Pitch | None:
    """The size that all frames certainly show where it is another one; None otherwise.

    Args:
        frames: Of cameras that may be one.
        pitch: In use.
    """
    policy = CalibrationPolicy()
    try:
        found = estimate_pitch(frames, policy, one_match=False, least=FRAMES)
    except (GeometryError, np.linalg.LinAlgError):
        return None
    return found.proposal(pitch)


def _is_near(camera: Camera, other: Camera | None) -> bool:
    return other is not None and bool(np.linalg.norm(camera.position - other.position) < NEAR_M)
