"""Monocular: the 3D ball from one view, and how far that is from the ball triangulated from all."""

from __future__ import annotations

import numpy as np

from app.errors import DegenerateGeometryError
from app.evaluation.frame import Detection, Frame, JudgedFrame
from app.evaluation.overlap import iou
from app.evaluation.result import FrameResult
from app.geometry.camera import Camera
from app.geometry.sphere import position_from_diameter


def measure_frame(
    item: JudgedFrame, diameter_m: float, predicted: Camera | None = None, min_score: float = 0.0
) -> FrameResult:
    """Everything that is known about one frame.

    Args:
        item: The frame with its detections, the surest first.
        diameter_m: True diameter of the ball, metres.
        predicted: The camera that somebody predicted for it, at the annotated size.
        min_score: Detections below take no part in localisation.
    """
    frame, truth = item.frame, item.truth
    sure = [found for found in item.detections if found.score >= min_score]
    best = sure[0] if sure else None
    hit = next((found for found in sure if truth is not None and iou(found.box, truth) > 0), None)
    distance = _distance(frame)
    own, other = (
        _errors(frame, camera, best, hit, diameter_m) for camera in _both(frame, predicted)
    )
    return FrameResult(
        frame_id=frame.id,
        group_id=frame.group_id,
        group=frame.group,
        view=frame.view,
        match=frame.match,
        ball=truth is not None,
        detections=len(item.detections),
        score=best.score if best else None,
        iou=iou(best.box, truth) if best and truth else None,
        hit_score=hit.score if hit else None,
        hit_iou=iou(hit.box, truth) if hit and truth else None,
        distance_m=distance,
        diameter_px=truth.diameter if truth else None,
        parallax_degrees=frame.parallax_degrees,
        size_error_percent=100 * (hit.box.diameter / truth.diameter - 1) if hit and truth else None,
        error_m=own[0],
        error_percent=_share(own[0], distance),
        any_error_m=own[1],
        predicted_error_m=other[0],
        predicted_error_percent=_share(other[0], distance),
        predicted_any_error_m=other[1],
    )


def place_error(
    frame: Frame, camera: Camera | None, found: Detection | None, diameter_m: float
) -> float | None:
    """Metres between where one view puts a detection and the triangulated ball.

    None where there is no detection, no camera, no 3D ball, or the detection has no place.
    """
    if found is None or camera is None or frame.point is None or not found.box.diameter > 0:
        return None
    center = np.array(found.box.center)
    try:
        place = position_from_diameter(camera, center, found.box.diameter, diameter_m)
    except DegenerateGeometryError:
        return None
    error = float(np.linalg.norm(place - frame.point))
    return error if np.isfinite(error) else None


def _both(frame: Frame, predicted: Camera | None) -> tuple[Camera | None, Camera | None]:
    return frame.camera, predicted


def _errors(
    frame: Frame,
    camera: Camera | None,
    best: Detection | None,
    hit: Detection | None,
    diameter_m: float,
) -> tuple[float | None, float | None]:
    """Error of the hit, and of the surest detection, which mostly is the same."""
    error = place_error(frame, camera, hit, diameter_m)
    return error, error if best is hit else place_error(frame, camera, best, diameter_m)


def _distance(frame: Frame) -> float | None:
    if frame.camera is None or frame.point is None:
        return None
    return float(np.linalg.norm(frame.camera.position - frame.point))


def _share(error: float | None, distance: float | None) -> float | None:
    return 100 * error / distance if error is not None and distance else None
