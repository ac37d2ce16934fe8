"""Sensitivity of the ball placed from one view (the paper's figure 6), and its derivative.

From the optimised box, whose place is the ball but for the last centimetres, the size is changed
by up to ten per cent, or the centre moved along the image's rows by up to two per cent of the
diagonal. The dashed lines are the slopes at zero, from the camera's own Jacobian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.evaluation.frame import GroundTruthFrame
from app.evaluation.result import Axis, Cell, Chart, Column, Panel, Row, Series, Table
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.sphere import position_from_diameter
from app.soccer.frames import Box

SAMPLE = 100
SIZE_PERCENT = 10.0
SHIFT_PERCENT = 2.0
STEPS = 21


@dataclass(frozen=True)
class BallSensitivity:
    """One ball of the sample.

    Attributes:
        distance_m: From the camera.
        by_size: Metres that the ball moves, at each of ``make_box_size_percents()``.
        by_shift: The same at ``make_box_shift_percents()``.
        size_slope: Derivative at zero, metres per per cent of the size.
        shift_slope: Metres per per cent of the diagonal.
    """

    frame: GroundTruthFrame
    distance_m: float
    by_size: FloatArray
    by_shift: FloatArray
    size_slope: float
    shift_slope: float


def make_box_size_percents() -> FloatArray:
    """Changes of the size, per cent."""
    return np.linspace(-SIZE_PERCENT, SIZE_PERCENT, STEPS)


def make_box_shift_percents() -> FloatArray:
    """Shifts of the centre, per cent of the diagonal."""
    return np.linspace(-SHIFT_PERCENT, SHIFT_PERCENT, STEPS)


def choose_frames(
    frames: Sequence[GroundTruthFrame], seed: int, size: int = SAMPLE
) -> list[GroundTruthFrame]:
    """A seeded sample of the frames that have a camera, an optimised box and a 3D ball."""
    able = [
        frame
        for frame in frames
        if frame.camera is not None and frame.point is not None and "optimized" in frame.boxes
    ]
    able.sort(key=lambda frame: (frame.group, frame.view))
    if len(able) <= size:
        return able
    chosen = np.random.default_rng(seed).choice(len(able), size, replace=False)
    return [able[index] for index in sorted(chosen.tolist())]


def measure_frame_sensitivity(frame: GroundTruthFrame, diameter_m: float) -> BallSensitivity:
    """The curves of one ball; the frame is one of ``choose_frames``."""
    camera, box = frame.camera, frame.boxes["optimized"]
    assert camera is not None
    center, diameter = np.array(box.center), box.diameter
    origin = position_from_diameter(camera, center, diameter, diameter_m)
    step = np.array([frame.size.diagonal / 100, 0.0])

    def measure_displacement(shift: float, percent: float) -> float:
        place = position_from_diameter(
            camera, center + shift * step, diameter * (1 + percent / 100), diameter_m
        )
        return float(np.linalg.norm(place - origin))

    size_slope, shift_slope = error_slopes(camera, box, diameter_m)
    return BallSensitivity(
        frame,
        float(np.linalg.norm(origin - camera.position)),
        np.array([measure_displacement(0.0, percent) for percent in make_box_size_percents()]),
        np.array([measure_displacement(shift, 0.0) for shift in make_box_shift_percents()]),
        size_slope * diameter / 100,
        shift_slope * frame.size.diagonal / 100,
    )


def error_slopes(camera: Camera, box: Box, diameter_m: float) -> tuple[float, float]:
    """How fast the ball moves: metres per pixel of diameter, and per pixel along a row.

    With p = C + phi / g R^T q, q the ideal ray of the centre and g the ideal distance of the two
    ends of the diameter, dp = phi / g R^T (dq - q dg / g). The ideal coordinates follow a pixel
    through the inverse of the distortion's Jacobian.
    """
    half = np.array([0.0, box.diameter / 2])
    center = np.array(box.center)
    if camera.is_wide:
        return _error_slopes_of_wide_lens(camera, center, box.diameter, diameter_m)
    pixels = np.vstack([center, center + half, center - half])
    ideal = camera.pixel_to_ideal(pixels)
    inverse = np.linalg.inv(camera.model.jacobian(ideal, camera.distortion)) @ np.linalg.inv(
        camera.K[:2, :2]
    )
    apart = ideal[1] - ideal[2]
    gap = float(np.linalg.norm(apart))
    ray = np.append(ideal[0], 1.0)

    def compute_slope(of_ray: FloatArray, of_ends: FloatArray) -> float:
        of_gap = float(apart @ of_ends) / gap
        return float(np.linalg.norm(np.append(of_ray, 0.0) - ray * of_gap / gap)) * diameter_m / gap

    down, along = np.array([0.0, 0.5]), np.array([1.0, 0.0])
    by_diameter = compute_slope(np.zeros(2), inverse[1] @ down + inverse[2] @ down)
    by_shift = compute_slope(inverse[0] @ along, (inverse[1] - inverse[2]) @ along)
    return by_diameter, by_shift


def _error_slopes_of_wide_lens(
    camera: Camera, center: FloatArray, diameter: float, diameter_m: float
) -> tuple[float, float]:
    """``error_slopes`` through a wide lens: along the ray exactly, along a row by central differences."""

    def locate_ball(shift: float) -> FloatArray:
        moved = center + np.array([shift, 0.0])
        return position_from_diameter(camera, moved, diameter, diameter_m)

    away = float(np.linalg.norm(locate_ball(0.0) - camera.position))
    return away / diameter, float(np.linalg.norm(locate_ball(0.5) - locate_ball(-0.5)))


def make_sensitivity_figure(samples: Sequence[BallSensitivity]) -> Chart:
    """Both panels, a curve per ball coloured by its distance, the derivative dashed beside it."""
    color = Axis("Distance to the camera", "m")
    size = Panel(
        "Size of the box",
        Axis("Change of the size", "%"),
        Axis("Ball moves by", "m", 0.0),
        tuple(
            line
            for item in samples
            for line in _make_curve_and_slope_series(
                item, make_box_size_percents(), item.by_size, item.size_slope
            )
        ),
        color=color,
    )
    shift = Panel(
        "Centre of the box",
        Axis("Shift along a row", "% of the diagonal"),
        Axis("Ball moves by", "m", 0.0),
        tuple(
            line
            for item in samples
            for line in _make_curve_and_slope_series(
                item, make_box_shift_percents(), item.by_shift, item.shift_slope
            )
        ),
        color=color,
    )
    note = f"{len(samples)} balls, from their optimised boxes; dashed: the analytic derivative."
    return Chart("sensitivity", "Sensitivity of the ball from one view", (size, shift), note)


def make_sensitivity_table(samples: Sequence[BallSensitivity], able: int) -> Table:
    """How far the ball moves at the ends of both curves, and what that has to do with distance."""
    rows = (
        _make_sensitivity_row("size", f"Size ± {SIZE_PERCENT:g} %", samples, able, SIZE_PERCENT),
        _make_sensitivity_row(
            "shift", f"Centre ± {SHIFT_PERCENT:g} % of the diagonal", samples, able, SHIFT_PERCENT
        ),
    )
    columns = (
        Column("smallest_m", "Smallest", "m"),
        Column("median_m", "Median", "m"),
        Column("largest_m", "Largest", "m"),
        Column("predicted_m", "Median by the derivative", "m"),
        Column("correlation", "Correlation with distance"),
    )
    note = (
        f"{len(samples)} of {able} frames with a 3D ball, a seeded sample. "
        f"Each curve of the figure opens the group of its ball."
    )
    return Table("sensitivity", "Sensitivity", columns, rows, note)


def _make_sensitivity_row(
    name: str, label: str, samples: Sequence[BallSensitivity], able: int, percent: float
) -> Row:
    curves = [item.by_size if name == "size" else item.by_shift for item in samples]
    slope = [item.size_slope if name == "size" else item.shift_slope for item in samples]
    ends = np.array([max(line[0], line[-1]) for line in curves])
    far = np.array([item.distance_m for item in samples])
    values: list[float | None] = [None] * 5
    if len(ends):
        values[:4] = [
            float(ends.min()),
            float(np.median(ends)),
            float(ends.max()),
            float(np.median(slope)) * percent,
        ]
    if len(ends) > 2 and ends.std() > 0 and far.std() > 0:
        values[4] = float(np.corrcoef(ends, far)[0, 1])
    cells = tuple(Cell(value, count=len(ends), of=able) for value in values)
    return Row(name, label, cells)


def _make_curve_and_slope_series(
    item: BallSensitivity, places: FloatArray, moved: FloatArray, slope: float
) -> tuple[Series, ...]:
    name = f"{item.frame.group} {item.frame.view}"
    x = tuple(places.round(9).tolist())
    predicted = tuple((slope * np.abs(places)).tolist())
    shared = {"color": item.distance_m, "group_id": item.frame.group_id}
    return (
        Series(name, item.frame.view, x, tuple(moved.tolist()), "line", **shared),  # type: ignore[arg-type]
        Series(f"{name} derivative", "derivative", x, predicted, "dashed", **shared),  # type: ignore[arg-type]
    )
