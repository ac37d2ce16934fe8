"""Match tripod: main cameras of a match on their paint, and what they say together of the pitch that they show.

The first view of each group of a match is of one camera that stands still. Where that is not so of all,
frames that certainly stand elsewhere than most are left alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray, flatten_covariance
from app.geometry.resection import X, Z
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from app.soccer.paint_evidence import PaintReading, TripodPitchCamera
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import (
    calibrate_view,
    compute_paint_search_key,
    find_wanted_paint_reading,
)
from app.solving.paint_camera import WORST_PX, collect_curve_points
from app.solving.resect import ResectionProblem
from app.solving.tripod_pitch import LEAST_FRAMES, FrameWithPaint, find_tripod_pitch

LEAST_SHARE = 0.5
"""Of the frames, those that stand on one tripod: with fewer it is not known which of them do."""


@dataclass(frozen=True)
class _MainCameraFrame:
    frame: FrameWithPaint
    covariance: FloatArray

    @property
    def position(self) -> FloatArray:
        return self.frame.parameters[X : Z + 1]

    def distance_in_sigmas(self, place: FloatArray) -> float:
        off = self.position - place
        return float(np.sqrt(off @ np.linalg.solve(self.covariance[X : Z + 1, X : Z + 1], off)))


def add_match_tripod_to_readings(
    groups: Mapping[int, Group], policy: CalibrationPolicy
) -> dict[int, PaintReading]:
    """What was read of main cameras, each with what the frames of its match know together.

    Args:
        groups: Of one match, by id.
        policy: Their paint is solved by.

    Returns:
        Of each group whose main view has a camera from its paint, its reading: with ``tripod``, or without
        where the frames are too few or stand on no tripod.
    """
    frames: dict[tuple[ImageSize, Pitch], dict[int, _MainCameraFrame]] = {}
    found: dict[int, PaintReading] = {}
    for number, group in groups.items():
        view = group.views[0]
        reading = find_wanted_paint_reading(group, view, policy)
        if reading is None or reading.reason or not view.included:
            continue
        if reading.sought_for != compute_paint_search_key(group, view, policy):
            continue
        alone = replace(reading, tripod=None)
        calibration = calibrate_view(
            replace(group, paint={**group.paint, view.key: alone}), view, policy
        )
        known = calibration.known_covariance_with_pitch
        if calibration.source != "paint" or calibration.camera is None or known is None:
            continue
        found[number] = alone
        problem = ResectionProblem.of(view.size, policy)
        points, sigmas = collect_curve_points(reading.evidence, view.size)
        frame = FrameWithPaint(problem.parameters(calibration.camera), points, sigmas)
        at = (view.size, policy.pitch_for_fitted_lines(group.pitch))
        frames.setdefault(at, {})[number] = _MainCameraFrame(frame, np.reshape(known, (8, 8)))
    for (size, pitch), some in frames.items():
        for number, tripod in _solve_tripod_cameras(some, size, pitch, policy).items():
            found[number] = replace(found[number], tripod=tripod)
    return found


def _solve_tripod_cameras(
    some: Mapping[int, _MainCameraFrame], size: ImageSize, pitch: Pitch, policy: CalibrationPolicy
) -> dict[int, TripodPitchCamera]:
    if len(some) < LEAST_FRAMES:
        return {}
    middle = np.median([one.position for one in some.values()], axis=0)
    # The farthest first: where no tripod is found it goes.
    left = sorted(some, key=lambda number: -some[number].distance_in_sigmas(middle))
    least = max(LEAST_FRAMES, len(left) * LEAST_SHARE)
    while len(left) >= least:
        frames = {number: some[number].frame for number in sorted(left)}
        shown = find_tripod_pitch([*frames.values()], size, pitch, policy)
        if shown is None:
            left = left[1:]
            continue
        cameras = {number: shown.fit_camera(frame) for number, frame in frames.items()}
        worst = WORST_PX * ResectionProblem.of(size, policy).pixels_per_reference_pixel
        fitting = [
            number for number in left if shown.error_px(frames[number], cameras[number][0]) <= worst
        ]
        if len(fitting) == len(left):
            return {
                number: TripodPitchCamera(
                    tuple(parameters.tolist()), flatten_covariance(covariance)
                )
                for number, (parameters, covariance) in cameras.items()
            }
        left = fitting
    return {}
