"""Localisation: MAE in metres and per cent, the share within two metres, its curve; and from one view alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.errors import DegenerateGeometryError
from app.evaluation.bootstrap import MatchResamples
from app.evaluation.frame import Detection, FrameWithDetections, GroundTruthFrame, iou
from app.evaluation.result import (
    Axis,
    Cell,
    Chart,
    Column,
    FrameFieldRange,
    FrameResult,
    Panel,
    ReferenceLine,
    Row,
    Series,
    Table,
)
from app.geometry.camera import Camera
from app.geometry.sphere import position_from_diameter
from app.wording import plural


def make_frame_result(
    item: FrameWithDetections,
    diameter_m: float,
    predicted: Camera | None = None,
    min_score: float = 0.0,
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
    distance = _distance_from_camera(frame)
    own, other = (
        _measure_hit_and_best_errors(frame, camera, best, hit, diameter_m)
        for camera in (frame.camera, predicted)
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
        error_percent=_percent_of_distance(own[0], distance),
        any_error_m=own[1],
        predicted_error_m=other[0],
        predicted_error_percent=_percent_of_distance(other[0], distance),
        predicted_any_error_m=other[1],
    )


def measure_position_error(
    frame: GroundTruthFrame, camera: Camera | None, found: Detection | None, diameter_m: float
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


def _measure_hit_and_best_errors(
    frame: GroundTruthFrame,
    camera: Camera | None,
    best: Detection | None,
    hit: Detection | None,
    diameter_m: float,
) -> tuple[float | None, float | None]:
    """Error of the hit, and of the surest detection, which mostly is the same."""
    error = measure_position_error(frame, camera, hit, diameter_m)
    return error, error if best is hit else measure_position_error(frame, camera, best, diameter_m)


def _distance_from_camera(frame: GroundTruthFrame) -> float | None:
    if frame.camera is None or frame.point is None:
        return None
    return float(np.linalg.norm(frame.camera.position - frame.point))


def _percent_of_distance(error: float | None, distance: float | None) -> float | None:
    return 100 * error / distance if error is not None and distance else None


NEAR_M = 2.0
"""The paper's threshold of P_2m."""
FARTHEST_M, STEP_M = 20.0, 0.1
COLUMNS = (
    Column("mae_m", "MAE", "m", "lower"),
    Column("mae_percent", "MAE", "%", "lower"),
    Column("p_2m", "P 2 m", "", "higher"),
    Column("median_m", "Median", "m", "lower"),
)
OVERLAPPING = "over detections with IoU > 0, the paper's rule"
EVERYWHERE = "over every frame with a ball, whatever was found"
SOURCES = (
    ("oracle", "oracle cameras", "error_m", "error_percent", "any_error_m"),
    (
        "predicted",
        "predicted cameras",
        "predicted_error_m",
        "predicted_error_percent",
        "predicted_any_error_m",
    ),
)
"""Name, words, and the fields of ``FrameResult`` for the two ways to choose a detection."""


def make_localization_table(
    frames: Sequence[FrameResult], resamples: MatchResamples, *, predicted: bool
) -> Table:
    """Two rows per kind of camera: as the paper counts, and over all frames.

    As the paper counts, a frame takes part when a detection overlaps its true box; the surest
    such detection is measured. Over all frames the surest detection is measured wherever it is,
    and a frame without any place counts as missed in P_2m.

    Args:
        frames: As ``place.make_frame_result`` made them.
        resamples: For the intervals.
        predicted: Whether there are predicted cameras.
    """
    balls = [frame for frame in frames if frame.ball and frame.distance_m is not None]
    rows = []
    for name, label, error, percent, any_error in SOURCES[: 1 + predicted]:
        rows.append(_make_hits_row(balls, name, label, error, percent, resamples))
        rows.append(_make_all_frames_row(balls, name, label, any_error, resamples))
    note = (
        f"{plural(len(balls), 'frame')} with a 3D ball. MAE and median are over the frames whose detection "
        f"has a place; IoU > 0 rows leave out frames without an overlapping detection."
    )
    return Table("localization", "3D from one view", COLUMNS, tuple(rows), note)


def make_precision_distance_figure(frames: Sequence[FrameResult], *, predicted: bool) -> Chart:
    """Share of frames within a distance, against the distance."""
    balls = [frame for frame in frames if frame.ball and frame.distance_m is not None]
    places = (np.arange(0, round(FARTHEST_M / STEP_M) + 1) * STEP_M).round(6)
    series = []
    for name, label, error, _percent, any_error in SOURCES[: 1 + predicted]:
        placed = _list_known_values(balls, error)
        missed = _list_known_values(balls, any_error)
        series.append(
            _make_share_within_distance_series(name, label, placed, len(placed), places, error)
        )
        everywhere = _make_share_within_distance_series(
            f"{name}_all", f"{label}, all frames", missed, len(balls), places, any_error
        )
        series.append(replace(everywhere, kind="dashed"))
    panel = Panel(
        "Share within a distance",
        Axis("Distance from the ball", "m", 0.0, FARTHEST_M),
        Axis("Share of frames", "", 0.0, 1.0),
        tuple(series),
        (ReferenceLine("x", NEAR_M, "2 m"),),
    )
    note = f"Solid: {OVERLAPPING}. Dashed: {EVERYWHERE} ({len(balls)})."
    return Chart("precision_distance", "Precision against distance", (panel,), note)


def _make_hits_row(
    balls: Sequence[FrameResult],
    name: str,
    label: str,
    error: str,
    percent: str,
    resamples: MatchResamples,
) -> Row:
    kept = [frame for frame in balls if getattr(frame, error) is not None]
    matches = [frame.match for frame in kept]
    values, shares = _list_known_values(kept, error), _list_known_values(kept, percent)
    near = [float(value < NEAR_M) for value in values]
    cells = (
        resamples.mean_with_interval(values, matches, len(balls)),
        resamples.mean_with_interval(shares, matches, len(balls)),
        resamples.mean_with_interval(near, matches, len(balls)),
        _make_median_cell(values, len(balls)),
    )
    return Row(name, f"{label}, IoU > 0", cells, FrameFieldRange(error))


def _make_all_frames_row(
    balls: Sequence[FrameResult], name: str, label: str, error: str, resamples: MatchResamples
) -> Row:
    kept = [frame for frame in balls if getattr(frame, error) is not None]
    values, matches = _list_known_values(kept, error), [frame.match for frame in kept]
    percent = [
        100 * value / frame.distance_m
        for value, frame in zip(values, kept, strict=True)
        if frame.distance_m
    ]
    near = [float(_is_error_within_limit(getattr(frame, error))) for frame in balls]
    cells = (
        resamples.mean_with_interval(values, matches, len(balls)),
        resamples.mean_with_interval(percent, matches, len(balls)),
        resamples.mean_with_interval(near, [frame.match for frame in balls]),
        _make_median_cell(values, len(balls)),
    )
    return Row(f"{name}_all", f"{label}, all frames", cells, FrameFieldRange("distance_m"))


def _is_error_within_limit(error: float | None) -> bool:
    return error is not None and error < NEAR_M


def _list_known_values(frames: Sequence[FrameResult], field: str) -> list[float]:
    found = (getattr(frame, field) for frame in frames)
    return [value for value in found if value is not None]


def _make_median_cell(values: Sequence[float], whole: int) -> Cell:
    return Cell(float(np.median(values)) if values else None, count=len(values), of=whole)


def _make_share_within_distance_series(
    name: str, label: str, values: Sequence[float], of: int, places: np.ndarray, field: str
) -> Series:
    ordered = np.sort(np.asarray(values, dtype=float))
    below = np.searchsorted(ordered, places, side="left")
    share = below / of if of else np.zeros(len(places))
    return Series(
        name,
        f"{label} (of {of})",
        tuple(places.tolist()),
        tuple(share.tolist()),
        count=tuple(below.tolist()),
        frames=tuple(FrameFieldRange(field, high=place) for place in places.tolist()),
    )
