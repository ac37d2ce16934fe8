"""Shot solve: the cameras of all frames of a shot in one least-squares problem.

The paint of one frame hardly tells where its camera stands from how far it zooms; all frames do. Each
camera's position is that of the tripod, plus a slope by pan (a lens turns before its tripod, and no
pitch is quite the plan), plus a deviation of its own; the lens's distortion follows the zoom.
Between neighbours the background says how the camera turned and zoomed.

The normal equations are those of ``shot_equations``. Covariances come from the same
factors; what no pitch has as planned (``solving.paint_noise``) all frames have in common.

A camera that travels (on a rail, on a cable, in a hand) stands on no tripod: on one it would lie beside the
paint on which it was followed. Its positions change from frame to frame instead, and a frame whose camera lies
beside its paint all the same keeps the one with which it was followed.

Where the shot shows its pitch (``solving.tripod_pitch``) it is solved twice: on the plan, whose markings then
lie on the paint, and on that pitch. How far both cameras of a frame are apart is the uncertainty of the first.

Source: Triggs et al., "Bundle adjustment: a modern synthesis", sections 6 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.errors import GeometryError
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
    projection_jacobians,
)
from app.paint.frame_pitch import make_paint_sightings
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.camera_positions import MAIN_MEAN, MAIN_SIGMA, is_main_position
from app.solving.paint_camera import PaintProblem, measure_offsets
from app.solving.paint_noise import (
    TERMS,
    PaintOffsets,
    cautious_point_weights_by_marking,
    paint_derivatives_by_all_terms,
    point_weights_by_marking,
    shift_offsets,
)
from app.solving.resect import ResectionProblem
from app.solving.tripod_pitch import (
    DEVIATION_M,
    KAPPA_DEVIATION,
    KAPPA_SLOPE_SIGMA,
    FrameWithPaint,
    TripodPitch,
    do_cameras_travel,
    find_tripod_pitch,
    project_paint_to_grass,
    second_moment_about_plan,
)
from app.tracking.follow import LOST, TRACKED, TrackedFrame
from app.tracking.motion import AIM, FAR_M, BackgroundMatches, apply_background_motion
from app.tracking.shot_equations import SHARED, ShotEquations

SLOPE_SIGMA, SHOWN_SLOPE_SIGMA = 4.0, 0.1
"""Of the slope of the position by pan, metres a radian: on the plan, and on the pitch that is shown."""
FLOW_PX, FLOW_PLACES = 0.3, 4.0
"""Of what the background says of a turn, pixels at 960 wide, at so many places."""
UNTIED_SIGMA = 1.0
"""Of a step of a frame that nothing else says anything of, radians."""
STEP_M = 0.3
"""By which the position of a camera that travels changes from frame to frame: 7 metres a second at 25 frames."""
ROUNDS, SETTLED_PX = 8, 0.02
LEAST_FRAMES = 3


@dataclass(frozen=True)
class SolvedShot:
    """The cameras that all frames of a shot together determine.

    Attributes:
        frames: With cameras whose markings of the plan lie on the paint.
        shown: The pitch that the shot shows; None where it does not.
        shown_frames: With cameras on that pitch.
    """

    frames: list[TrackedFrame]
    shown: TripodPitch | None
    shown_frames: list[TrackedFrame]


def solve_shot(
    frames: Sequence[TrackedFrame],
    matches: Sequence[BackgroundMatches | None],
    size: ImageSize,
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> SolvedShot:
    """The same frames, with the cameras that all of them together determine.

    Args:
        frames: One for each frame of the clip.
        matches: From the frame before to each frame.
        size: Work size, pixels.
        pitch: The pitch.
        policy: Prior of the distortion.
    """
    chosen = [index for index, frame in enumerate(frames) if frame.outcome != LOST]
    if sum(frames[index].outcome == TRACKED for index in chosen) < LEAST_FRAMES:
        alone = [_take_own_paint_uncertainty(frame) for frame in frames]
        return SolvedShot(alone, None, alone)
    shot = _ShotProblem([frames[index] for index in chosen], chosen, matches, size, pitch, policy)
    painted = shot.sightings_by_place()
    shown = find_tripod_pitch(list(painted.values()), size, pitch, policy)
    shot.minimize_cost()
    if shot.does_camera_travel():
        shot, shown = shot.without_tripod(), None
        shot.minimize_cost()
    if shown is None:
        solved = _replace_cameras(frames, chosen, shot, shot.covariances())
        return SolvedShot(solved, None, solved)
    on_shown = shot.with_shown_pitch(shown)
    on_shown.minimize_cost()
    for place in shot.given:
        on_shown.parameters[place] = shot.parameters[place]
    known = {
        place: shown.covariance_of(frame, on_shown.parameters[place])
        for place, frame in painted.items()
    }
    if len(known) < len(chosen):
        # What the background carries, or somebody drew, is known as on the plan.
        known = dict(enumerate(shot.covariances())) | known
    about = [
        second_moment_about_plan(shot.parameters[place], on_shown.parameters[place], known[place])
        for place in range(len(chosen))
    ]
    return SolvedShot(
        _replace_cameras(frames, chosen, shot, about),
        shown,
        _replace_cameras(frames, chosen, on_shown, [known[place] for place in range(len(chosen))]),
    )


def _replace_cameras(
    frames: Sequence[TrackedFrame],
    chosen: Sequence[int],
    shot: _ShotProblem,
    covariances: Sequence[FloatArray],
) -> list[TrackedFrame]:
    solved = list(frames)
    for place, (index, covariance) in enumerate(zip(chosen, covariances, strict=True)):
        camera, error = shot.camera(place), shot.error_px(place)
        solved[index] = replace(frames[index], camera=camera, covariance=covariance, error_px=error)
    return solved


def _take_own_paint_uncertainty(frame: TrackedFrame) -> TrackedFrame:
    """A frame with what its own paint says."""
    if frame.snapped is None:
        return frame
    own = frame.snapped
    return replace(frame, covariance=own.covariance, error_px=own.error_px)


class _ShotProblem:
    """The problem of one shot, on the plan or on the pitch that it shows."""

    def __init__(
        self,
        frames: Sequence[TrackedFrame],
        numbers: Sequence[int],
        matches: Sequence[BackgroundMatches | None],
        size: ImageSize,
        pitch: Pitch,
        policy: CalibrationPolicy,
    ):
        self.half_diagonal, self._size = size.diagonal / 2, size
        self._pitch, self._slope_sigma = pitch, SLOPE_SIGMA
        self._frames, self._frames_apart, self._has_tripod = frames, np.diff(numbers), True
        first = frames[0].camera
        assert first is not None
        self.principal_point = first.principal_point
        self.parameters = np.array([self._parameters_of_frame(frame) for frame in frames])
        # A turn past half a circle goes on.
        self.parameters[:, PAN] = np.unwrap(self.parameters[:, PAN])
        self._followed = self.parameters
        self._problem = PaintProblem.of(ResectionProblem.of(size, policy), self.parameters[0], None)
        self._sights = [self._make_frame_sightings(frame) for frame in frames]
        self._shifts: dict[int, FloatArray] = {}
        self._seen_from: FloatArray | None = None
        self._kept: list[PaintOffsets | None] = []
        # Without paint an annotated frame is where its lines say.
        self.given = {
            place: (self.parameters[place].copy(), np.linalg.inv(frame.covariance))
            for place, frame in enumerate(frames)
            if frame.snapped is None and frame.covariance is not None
        }
        self._turns = [
            None
            if after != before + 1 or matches[after] is None
            else self._measure_turn(place, matches[after])
            for place, (before, after) in enumerate(pairwise(numbers))
        ]
        self._policy = policy
        self._center = self.parameters.mean(axis=0)
        self.shared: FloatArray = np.zeros(SHARED)
        self.shared[:3] = np.median(self.parameters[:, X : Z + 1], axis=0)
        self.shared[6] = np.median(self.parameters[:, KAPPA])
        self._noise = 1.0

    def with_shown_pitch(self, shown: TripodPitch) -> _ShotProblem:
        """The same problem on the pitch that is shown; lines that somebody drew say nothing of that."""
        other = copy(self)
        other._pitch, other._slope_sigma = shown.pitch, SHOWN_SLOPE_SIGMA
        other._shifts = {
            place: shown.compute_paint_shift_of_frame(each)
            for place, each in self.sightings_by_place().items()
        }
        other.shared = np.zeros(SHARED)
        other.shared[:3], other.shared[6] = shown.tripod_position, self.shared[6]
        other.given, other._noise, other._seen_from = {}, 1.0, None
        return other

    def without_tripod(self) -> _ShotProblem:
        """The same problem from the cameras that were followed, of a camera that travels."""
        other = copy(self)
        other._has_tripod, other.parameters, other._noise = False, self._followed, 1.0
        other.shared = np.zeros(SHARED)
        other.shared[6] = np.median(other.parameters[:, KAPPA])
        return other

    def _parameters_of_frame(self, frame: TrackedFrame) -> FloatArray:
        assert frame.camera is not None
        return parameters_from_camera(frame.camera, self.half_diagonal)

    def _make_frame_sightings(self, frame: TrackedFrame) -> FrameWithPaint | None:
        if frame.outcome != TRACKED or frame.snapped is None:
            return None
        return make_paint_sightings(frame.snapped)

    def _measure_turn(
        self, place: int, match: BackgroundMatches | None
    ) -> tuple[FloatArray, FloatArray] | None:
        """How the camera turned and zoomed to the next frame, shape (4,), and its information; None where the
        background does not tell it."""
        assert match is not None
        camera = self.camera(place)
        try:
            after, apart = apply_background_motion(camera, match, self.half_diagonal)
        except (GeometryError, np.linalg.LinAlgError):
            return None
        turned = parameters_from_camera(after, self.half_diagonal) - self.parameters[place]
        turned[PAN] = (turned[PAN] + np.pi) % (2 * np.pi) - np.pi
        points = camera.position + FAR_M * camera.rays(match.here)
        rows = projection_jacobians(
            np.tile(self.parameters[place], (len(points), 1)),
            points,
            np.full(len(points), self.half_diagonal),
        )[:, :, AIM].reshape(-1, len(AIM))
        sigma = max(FLOW_PX * self._problem.pixels_per_reference_pixel, apart)
        return turned[AIM], FLOW_PLACES / len(points) * rows.T @ rows / sigma**2

    def camera(self, place: int) -> Camera:
        """Of a frame, pixels of the work size."""
        return camera_from_parameters(
            self.parameters[place], self.principal_point, self.half_diagonal
        )

    def sightings_by_place(self) -> dict[int, FrameWithPaint]:
        """The frames with paint, by their place in the shot."""
        return {
            place: replace(sight, parameters=self.parameters[place])
            for place, sight in enumerate(self._sights)
            if sight is not None
        }

    def _measure_all_offsets(self) -> list[PaintOffsets | None]:
        """The paint of each frame beside its markings, worked out once for cameras that stay."""
        if self._seen_from is not self.parameters:
            self._seen_from = self.parameters
            self._kept = [
                self._measure_frame_offsets(place) for place in range(len(self.parameters))
            ]
        return self._kept

    def _measure_frame_offsets(self, place: int) -> PaintOffsets | None:
        sight = self._sights[place]
        if sight is None:
            return None
        seen = measure_offsets(
            self._problem, self.parameters[place], sight.sightings, sight.sigmas, self._pitch
        )
        shift = self._shifts.get(place)
        if shift is None:
            return seen
        return replace(seen, offsets=shift_offsets(seen.offsets, seen.jacobian, shift))

    def _compute_paint_weights(self, seen: PaintOffsets) -> FloatArray:
        robust = self._problem.robust_weights(seen.offsets, seen.sigmas)
        weigh = cautious_point_weights_by_marking if self._shifts else point_weights_by_marking
        weights: FloatArray = robust * weigh(seen.marking, seen.sigmas) / seen.sigmas**2
        return weights / self._noise

    def error_px(self, place: int) -> float | None:
        """Median distance of the paint of a frame, pixels; None where it has none."""
        seen = self._measure_all_offsets()[place]
        return None if seen is None else float(np.median(np.abs(seen.offsets)))

    def does_camera_travel(self) -> bool:
        """Whether it stands on no tripod: on one it left the paint on which it was followed."""
        places = list(self.sightings_by_place())
        errors = np.array([self.error_px(place) for place in places], dtype=float)
        snapped = [self._frames[place].snapped for place in places]
        followed = np.array([each.error_px for each in snapped if each is not None])
        return do_cameras_travel(errors, followed, self._size)

    def _build_equations(self) -> ShotEquations:
        count = len(self.parameters)
        equations = ShotEquations(count)
        for place, seen in enumerate(self._measure_all_offsets()):
            if seen is not None:
                weighted = seen.jacobian * self._compute_paint_weights(seen)[:, None]
                equations.diagonal[place] += weighted.T @ seen.jacobian
                equations.right[place] += weighted.T @ seen.offsets
            self._add_tripod_equations(equations, place)
        for place, turn in enumerate(self._turns):
            if not self._has_tripod:
                self._add_travel_equations(equations, place)
            if turn is not None:
                self._add_turn_equations(equations, place, *turn)
        self._add_priors(equations)
        return equations

    def _shared_parameter_basis(self, place: int) -> FloatArray:
        """What the shot has in common, to the position and distortion of a frame, shape (4, 8)."""
        away = self.parameters[place] - self._center
        basis = np.zeros((4, SHARED))
        basis[:3, :3] = np.eye(3)
        basis[:3, 3:6] = np.eye(3) * away[PAN]
        basis[3, 6], basis[3, 7] = 1.0, away[LOG_FOCAL]
        return basis

    def _add_tripod_equations(self, equations: ShotEquations, place: int) -> None:
        basis, own = self._shared_parameter_basis(place), [X, X + 1, Z, KAPPA]
        rest = self.parameters[place][own] - basis @ self.shared
        weight = np.array([DEVIATION_M, DEVIATION_M, DEVIATION_M, KAPPA_DEVIATION]) ** -2.0
        if not self._has_tripod:
            weight[:3] = 0.0
        equations.diagonal[place][own, own] += weight
        equations.right[place][own] -= weight * rest
        equations.border[place][own] -= weight[:, None] * basis
        equations.corner += basis.T @ (weight[:, None] * basis)
        equations.below += basis.T @ (weight * rest)

    def _add_turn_equations(
        self, equations: ShotEquations, place: int, turned: FloatArray, information: FloatArray
    ) -> None:
        if not self._has_tripod:
            # What is near moves in the picture although nothing turns.
            focal_px = np.exp(self.parameters[place][LOG_FOCAL])
            flow_px = FLOW_PX * self._problem.pixels_per_reference_pixel
            information = information / (1 + (STEP_M / FAR_M * focal_px / flow_px) ** 2)
        rest = turned - (self.parameters[place + 1] - self.parameters[place])[AIM]
        here = np.ix_(AIM, AIM)
        equations.diagonal[place][here] += information
        equations.diagonal[place + 1][here] += information
        equations.beside[place][here] -= information
        equations.right[place][AIM] -= information @ rest
        equations.right[place + 1][AIM] += information @ rest

    def _add_travel_equations(self, equations: ShotEquations, place: int) -> None:
        """The position changes little from a frame to the next one."""
        own = slice(X, Z + 1)
        information = np.eye(3) / (STEP_M**2 * self._frames_apart[place])
        pull = information @ (self.parameters[place + 1] - self.parameters[place])[own]
        equations.diagonal[place][own, own] += information
        equations.diagonal[place + 1][own, own] += information
        equations.beside[place][own, own] -= information
        equations.right[place][own] += pull
        equations.right[place + 1][own] -= pull

    def _add_priors(self, equations: ShotEquations) -> None:
        """What is known of tripods and lenses."""
        sigma = np.full(SHARED, np.inf)
        mean = np.zeros(SHARED)
        sigma[3:6], sigma[7] = self._slope_sigma, KAPPA_SLOPE_SIGMA
        sigma[6], mean[6] = self._policy.distortion_sigma, self._policy.distortion_mean
        if not self._has_tripod:
            sigma[:3] = 1.0
        elif is_main_position(self.shared[:3]):
            sigma[:3], mean[:3] = MAIN_SIGMA[1:], MAIN_MEAN[1:]
        information = sigma**-2.0
        equations.corner[np.diag_indices(SHARED)] += information
        equations.below += information * (mean - self.shared)
        weight = MAIN_SIGMA[0] ** -2.0 / len(self.parameters)
        equations.diagonal[:, ROLL, ROLL] += weight
        equations.right[:, ROLL] -= weight * self.parameters[:, ROLL]
        for place, (given, known) in self.given.items():
            equations.diagonal[place] += known
            equations.right[place] += known @ (given - self.parameters[place])
        # A frame that neither paint nor background ties stays where it is.
        equations.diagonal[:, AIM, AIM] += UNTIED_SIGMA**-2.0

    def minimize_cost(self) -> None:
        """Gauss-Newton steps until no paint moves any more."""
        for _ in range(ROUNDS):
            step, shared = self._build_equations().solve()
            self.parameters = self.parameters + step
            self.shared = self.shared + shared
            moved = [
                np.abs(seen.jacobian @ own).max(initial=0.0)
                for own, seen in zip(step, self._measure_all_offsets(), strict=True)
                if seen is not None
            ]
            if max(moved) < SETTLED_PX:
                break
        rest = [
            seen.offsets / seen.sigmas for seen in self._measure_all_offsets() if seen is not None
        ]
        # Of a normal distribution the median distance is 0.6745 standard deviations.
        self._noise = max(1.0, float(np.median(np.abs(np.concatenate(rest))) / 0.6745) ** 2)

    def covariances(self) -> list[FloatArray]:
        """Of each frame's parameters, with what no pitch has as planned, shape (8, 8)."""
        equations = self._build_equations()
        terms = np.zeros((len(self.parameters), PARAMETERS, TERMS))
        for place, frame in self.sightings_by_place().items():
            seen = self._measure_all_offsets()[place]
            assert seen is not None
            grass = project_paint_to_grass(frame, self._size)
            own = paint_derivatives_by_all_terms(grass, seen.marking, seen.jacobian, self._pitch)
            weighted = seen.jacobian * self._compute_paint_weights(seen)[:, None]
            terms[place] = weighted.T @ own
        return equations.covariances(terms)
