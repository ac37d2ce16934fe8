"""One tripod: frames of one camera that stands still, each drawn onto its paint, say together which pitch they show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.resection import CurvePoints, parameters_from_camera
from app.paint.snap import SnappedCamera
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.tripod_pitch import PaintedFrame, TripodPitch, about_plan, find_tripod_pitch


def painted_frame(snapped: SnappedCamera) -> PaintedFrame:
    """A camera on its paint, as frames are solved together."""
    evidence, camera = snapped.evidence, snapped.camera
    traced = evidence.traced
    pixels = camera.project(traced.places) + evidence.offsets[:, None] * traced.normals
    pixels = np.ascontiguousarray(pixels - camera.principal_point)
    half = float(np.hypot(*snapped.size)) / 2
    sightings = CurvePoints(pixels, traced.marking, np.ones(len(pixels)))
    return PaintedFrame(parameters_from_camera(camera, half), sightings, evidence.sigmas)


def share_tripod(
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
    painted = [painted_frame(frame) for frame in frames]
    shown = find_tripod_pitch(painted, ImageSize(width, height), pitch, policy)
    if shown is None:
        return None
    return shown, [about_plan(frame.parameters, *shown.camera(frame)) for frame in painted]
