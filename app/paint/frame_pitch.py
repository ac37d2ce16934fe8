"""Frame pitch: the size of the pitch that frames of one film, or of one tripod, show together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.errors import GeometryError
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import CurvePoints, parameters_from_camera
from app.paint.evidence import (
    Image,
    find_paint,
    prepare_picture,
    to_paint_evidence,
    trace_visible_markings,
)
from app.paint.grass import find_field_of_play
from app.paint.snap import SnappedCamera
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.pitch_size import PitchSizeFrameLines, estimate_pitch
from app.solving.tripod_pitch import (
    FrameWithPaint,
    TripodPitch,
    find_tripod_pitch,
    second_moment_about_plan,
)

WINDOW_PX = 20.0
"""At 960 wide, to either side that paint is sought: markings of another pitch lie far off."""
FRAMES = 3
"""Paint is exact; yet no single frame decides a size."""
NEAR_M = 3.0
"""Cameras that stand so near each other, in pictures of one size, may be one."""


def collect_pitch_size_evidence(image: Image, camera: Camera, pitch: Pitch) -> PitchSizeFrameLines:
    """Places of paint on and beside the markings of a proposed camera.

    Args:
        image: Red green blue, shape (H, W, 3).
        camera: Pixels of it.
        pitch: On which the camera was found.
    """
    height, width = image.shape[:2]
    reading = prepare_picture(image, find_field_of_play(image))
    window = WINDOW_PX * max(width / 960, 0.6)
    evidence = find_paint(reading, trace_visible_markings(reading, camera, pitch), window)
    return PitchSizeFrameLines(
        to_paint_evidence(evidence, camera).thin_points(), ImageSize(width, height)
    )


def group_by_position(
    cameras: Sequence[Camera | None], sizes: Sequence[ImageSize | None]
) -> list[list[int]]:
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


def find_differing_agreed_pitch(
    frames: Sequence[PitchSizeFrameLines], pitch: Pitch
) -> Pitch | None:
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


def make_paint_sightings(snapped: SnappedCamera) -> FrameWithPaint:
    """A camera on its paint, as frames are solved together."""
    evidence, camera = snapped.evidence, snapped.camera
    traced = evidence.traced
    pixels = camera.project(traced.places) + evidence.offsets[:, None] * traced.normals
    pixels = np.ascontiguousarray(pixels - camera.principal_point)
    half = float(np.hypot(*snapped.size)) / 2
    sightings = CurvePoints(pixels, traced.marking, np.ones(len(pixels)))
    return FrameWithPaint(parameters_from_camera(camera, half), sightings, evidence.sigmas)


def find_shared_pitch(
    frames: Sequence[SnappedCamera], pitch: Pitch, policy: CalibrationPolicy
) -> tuple[TripodPitch, list[FloatArray]] | None:
    """The pitch that frames of one camera on a tripod show, and what each camera is known to with it.

    Args:
        frames: On their paint, of pictures of one size, in their order.
        pitch: On which the cameras lie.
        policy: Prior of the distortion.

    Returns:
        The pitch, and of each camera the second moment about it, shape (8, 8); None where the frames are
        too few, leave it open, or stand on no tripod.
    """
    if len({frame.size for frame in frames}) != 1:
        return None
    height, width = frames[0].size
    painted = [make_paint_sightings(frame) for frame in frames]
    shown = find_tripod_pitch(painted, ImageSize(width, height), pitch, policy)
    if shown is None:
        return None
    return shown, [
        second_moment_about_plan(frame.parameters, *shown.fit_camera(frame)) for frame in painted
    ]
