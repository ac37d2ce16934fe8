"""Shot solve: the cameras of all frames of a shot in one least-squares problem.

The paint of one frame hardly tells where its camera stands from how far it zooms; all frames do. Each
camera's position is that of the tripod, plus a slope by pan (a lens turns before its tripod, and no
pitch is quite the plan), plus a deviation of its own; the lens's distortion follows the zoom.
Between neighbours the background says how the camera turned and zoomed.

The normal equations are block tridiagonal, one block of eight parameters for each frame, bordered by what the
shot has in common, which is eliminated last (Schur complement). Covariances come from the same
factors; what no pitch has as planned (``solving.paint_terms``) all frames have in common.

Source: Triggs et al., "Bundle adjustment: a modern synthesis", sections 6 and 7.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    CurvePoints,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
    projection_jacobians,
)
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.main_position import MAIN_MEAN, MAIN_SIGMA, is_main_position
from app.solving.paint_camera import PaintProblem, offsets_of
from app.solving.paint_noise import PaintOffsets, marking_weights
from app.solving.paint_terms import pitch_terms
from app.solving.resect import ResectionProblem
from app.tracking.follow import LOST, TRACKED, TrackedFrame
from app.tracking.motion import AIM, FAR_M, BackgroundMatches, rotate_camera

DEVIATION_M = 0.3
"""Standard deviation of a frame's position from where tripod and pan put it."""
SLOPE_SIGMA = 4.0
"""Of the slope of the position by pan, metres a radian."""
KAPPA_DEVIATION, KAPPA_SLOPE_SIGMA = 0.002, 0.03
"""Of the distortion from what the zoom says, and of its slope by the logarithm of the focal length."""
FLOW_PX, FLOW_PLACES = 0.3, 4.0
"""Of what the background says of a turn, pixels at 960 wide, at so many places."""
UNTIED_SIGMA = 1.0
"""Of a step of a frame that nothing else says anything of, radians."""
ROUNDS, SETTLED_PX = 8, 0.02
LEAST_FRAMES = 3
SCALE = np.array([1e-3, 1e-3, 1e-3, 1.0, 1.0, 1.0, 1e-3, 1e-3])
"""Units in which the equations are solved."""
SHARED = 8
"""What a shot has in common: place (3), slope by pan (3), distortion and its slope by zoom."""
TERMS = len(MARKINGS) + 4
"""Crown, inward, each marking, length and width."""


@dataclass(frozen=True)
class _Sight:
    """The paint of a frame: places from the principal point and their sigmas, pixels."""

    sightings: CurvePoints
    sigmas: FloatArray


def solve_shot(
    frames: Sequence[TrackedFrame],
    matches: Sequence[BackgroundMatches | None],
    size: ImageSize,
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> list[TrackedFrame]:
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
        return [_alone(frame) for frame in frames]
    shot = _Shot([frames[index] for index in chosen], chosen, matches, size, pitch, policy)
    shot.descend()
    solved = list(frames)
    for place, (index, covariance) in enumerate(zip(chosen, shot.covariances(), strict=True)):
        camera, error = shot.camera(place), shot.error_px(place)
        solved[index] = replace(frames[index], camera=camera, covariance=covariance, error_px=error)
    return solved


def _alone(frame: TrackedFrame) -> TrackedFrame:
    """A frame with what its own paint says."""
    if frame.snapped is None:
        return frame
    own = frame.snapped
    return replace(frame, covariance=own.covariance, error_px=own.error_px)


class _Shot:
    """The problem of one shot."""

    def __init__(
        self,
        frames: Sequence[TrackedFrame],
        numbers: Sequence[int],
        matches: Sequence[BackgroundMatches | None],
        size: ImageSize,
        pitch: Pitch,
        policy: CalibrationPolicy,
    ):
        self.half_diagonal = size.diagonal / 2
        self._pitch = pitch
        first = frames[0].camera
        assert first is not None
        self.principal_point = first.principal_point
        self.parameters = np.array([self._row(frame) for frame in frames])
        # A turn past half a circle goes on.
        self.parameters[:, PAN] = np.unwrap(self.parameters[:, PAN])
        self._problem = PaintProblem.of(ResectionProblem.of(size, policy), self.parameters[0], None)
        self._sights = [self._sight(frame) for frame in frames]
        # Without paint an annotated frame is where its lines say.
        self._given = {
            place: (self.parameters[place].copy(), np.linalg.inv(frame.covariance))
            for place, frame in enumerate(frames)
            if frame.snapped is None and frame.covariance is not None
        }
        self._turns = [
            None
            if after != before + 1 or matches[after] is None
            else self._turn(place, matches[after])
            for place, (before, after) in enumerate(pairwise(numbers))
        ]
        self._policy = policy
        self._center = self.parameters.mean(axis=0)
        self.shared: FloatArray = np.zeros(SHARED)
        self.shared[:3] = np.median(self.parameters[:, X : Z + 1], axis=0)
        self.shared[6] = np.median(self.parameters[:, KAPPA])
        self._noise = 1.0

    def _row(self, frame: TrackedFrame) -> FloatArray:
        assert frame.camera is not None
        return parameters_from_camera(frame.camera, self.half_diagonal)

    def _sight(self, frame: TrackedFrame) -> _Sight | None:
        if frame.outcome != TRACKED or frame.snapped is None:
            return None
        evidence = frame.snapped.evidence
        traced = evidence.traced
        middle = frame.snapped.camera.project(traced.places)
        pixels = middle + evidence.offsets[:, None] * traced.normals - self.principal_point
        sightings = CurvePoints(np.ascontiguousarray(pixels), traced.marking, np.ones(len(pixels)))
        return _Sight(sightings, evidence.sigmas)

    def _turn(self, place: int, match: BackgroundMatches | None) -> tuple[FloatArray, FloatArray]:
        """How the camera turned and zoomed to the next frame, shape (4,), and its information."""
        assert match is not None
        camera = self.camera(place)
        after, apart = rotate_camera(camera, match, self.half_diagonal)
        turned = parameters_from_camera(after, self.half_diagonal) - self.parameters[place]
        turned[PAN] = (turned[PAN] + np.pi) % (2 * np.pi) - np.pi
        points = camera.position + FAR_M * camera.rays(match.here)
        rows = projection_jacobians(
            np.tile(self.parameters[place], (len(points), 1)),
            points,
            np.full(len(points), self.half_diagonal),
        )[:, :, AIM].reshape(-1, len(AIM))
        sigma = max(FLOW_PX * self._problem.unit, apart)
        return turned[AIM], FLOW_PLACES / len(points) * rows.T @ rows / sigma**2

    def camera(self, place: int) -> Camera:
        """Of a frame, pixels of the work size."""
        return camera_from_parameters(
            self.parameters[place], self.principal_point, self.half_diagonal
        )

    def _seen(self, place: int) -> PaintOffsets | None:
        sight = self._sights[place]
        if sight is None:
            return None
        return offsets_of(
            self._problem, self.parameters[place], sight.sightings, sight.sigmas, self._pitch
        )

    def _weights(self, seen: PaintOffsets) -> FloatArray:
        robust = self._problem.robust(seen.offsets, seen.sigmas, strict=True)
        weights: FloatArray = robust * marking_weights(seen.marking, seen.sigmas) / seen.sigmas**2
        return weights / self._noise

    def error_px(self, place: int) -> float | None:
        """Median distance of the paint of a frame, pixels; None where it has none."""
        seen = self._seen(place)
        return None if seen is None else float(np.median(np.abs(seen.offsets)))

    def _equations(self) -> _Equations:
        count = len(self.parameters)
        equations = _Equations(count)
        for place in range(count):
            seen = self._seen(place)
            if seen is not None:
                weighted = seen.jacobian * self._weights(seen)[:, None]
                equations.diagonal[place] += weighted.T @ seen.jacobian
                equations.right[place] += weighted.T @ seen.offsets
            self._add_tripod(equations, place)
        for place, turn in enumerate(self._turns):
            if turn is not None:
                self._add_turn(equations, place, *turn)
        self._add_priors(equations)
        return equations

    def _basis(self, place: int) -> FloatArray:
        """What the shot has in common, to the position and distortion of a frame, shape (4, 8)."""
        away = self.parameters[place] - self._center
        basis = np.zeros((4, SHARED))
        basis[:3, :3] = np.eye(3)
        basis[:3, 3:6] = np.eye(3) * away[PAN]
        basis[3, 6], basis[3, 7] = 1.0, away[LOG_FOCAL]
        return basis

    def _add_tripod(self, equations: _Equations, place: int) -> None:
        basis, own = self._basis(place), [X, X + 1, Z, KAPPA]
        rest = self.parameters[place][own] - basis @ self.shared
        weight = np.array([DEVIATION_M, DEVIATION_M, DEVIATION_M, KAPPA_DEVIATION]) ** -2.0
        equations.diagonal[place][own, own] += weight
        equations.right[place][own] -= weight * rest
        equations.border[place][own] -= weight[:, None] * basis
        equations.corner += basis.T @ (weight[:, None] * basis)
        equations.below += basis.T @ (weight * rest)

    def _add_turn(
        self, equations: _Equations, place: int, turned: FloatArray, information: FloatArray
    ) -> None:
        rest = turned - (self.parameters[place + 1] - self.parameters[place])[AIM]
        here = np.ix_(AIM, AIM)
        equations.diagonal[place][here] += information
        equations.diagonal[place + 1][here] += information
        equations.beside[place][here] -= information
        equations.right[place][AIM] -= information @ rest
        equations.right[place + 1][AIM] += information @ rest

    def _add_priors(self, equations: _Equations) -> None:
        """What is known of tripods and lenses."""
        sigma = np.full(SHARED, np.inf)
        mean = np.zeros(SHARED)
        sigma[3:6], sigma[7] = SLOPE_SIGMA, KAPPA_SLOPE_SIGMA
        sigma[6], mean[6] = self._policy.distortion_sigma, self._policy.distortion_mean
        if is_main_position(self.shared[:3]):
            sigma[:3], mean[:3] = MAIN_SIGMA[1:], MAIN_MEAN[1:]
        information = sigma**-2.0
        equations.corner[np.diag_indices(SHARED)] += information
        equations.below += information * (mean - self.shared)
        weight = MAIN_SIGMA[0] ** -2.0 / len(self.parameters)
        equations.diagonal[:, ROLL, ROLL] += weight
        equations.right[:, ROLL] -= weight * self.parameters[:, ROLL]
        for place, (given, known) in self._given.items():
            equations.diagonal[place] += known
            equations.right[place] += known @ (given - self.parameters[place])
        # A frame that neither paint nor background ties stays where it is.
        equations.diagonal[:, AIM, AIM] += UNTIED_SIGMA**-2.0

    def descend(self) -> None:
        """Gauss-Newton steps until no paint moves any more."""
        for _ in range(ROUNDS):
            step, shared = self._equations().solve()
            self.parameters = self.parameters + step
            self.shared = self.shared + shared
            moved = [
                np.abs(seen.jacobian @ step[place]).max(initial=0.0)
                for place in range(len(step))
                if (seen := self._seen(place)) is not None
            ]
            if max(moved) < SETTLED_PX:
                break
        rest = [
            (seen.offsets / seen.sigmas)
            for place in range(len(self.parameters))
            if (seen := self._seen(place)) is not None
        ]
        # Of a normal distribution the median distance is 0.6745 standard deviations.
        self._noise = max(1.0, float(np.median(np.abs(np.concatenate(rest))) / 0.6745) ** 2)

    def covariances(self) -> list[FloatArray]:
        """Of each frame's parameters, with what no pitch has as planned, shape (8, 8)."""
        equations = self._equations()
        terms = np.zeros((len(self.parameters), PARAMETERS, TERMS))
        for place in range(len(self.parameters)):
            seen = self._seen(place)
            if seen is None:
                continue
            camera = self.camera(place)
            sight = self._sights[place]
            assert sight is not None
            grass = np.nan_to_num(camera.on_ground(sight.sightings.pixels + self.principal_point))
            own = pitch_terms(grass, seen.marking, seen.jacobian, self._pitch)
            columns = [0, 1, *(2 + np.unique(seen.marking)), TERMS - 2, TERMS - 1]
            weighted = seen.jacobian * self._weights(seen)[:, None]
            terms[place][:, columns] = weighted.T @ own
        return equations.covariances(terms)


class _Equations:
    """Normal equations: a block tridiagonal matrix with a border.

    Attributes:
        diagonal: Shape (N, 8, 8).
        beside: Block between each frame and the next one, shape (N - 1, 8, 8).
        border: Between each frame and what is shared, shape (N, 8, S).
        corner: Of what is shared, shape (S, S).
        right: Shape (N, 8).
        below: Shape (S,).
    """

    def __init__(self, count: int):
        self.diagonal = np.zeros((count, PARAMETERS, PARAMETERS))
        self.beside = np.zeros((max(count - 1, 0), PARAMETERS, PARAMETERS))
        self.border = np.zeros((count, PARAMETERS, SHARED))
        self.corner = np.zeros((SHARED, SHARED))
        self.right = np.zeros((count, PARAMETERS))
        self.below = np.zeros(SHARED)

    def _scaled(self) -> tuple[FloatArray, FloatArray]:
        both = SCALE[:, None] * SCALE
        return self.diagonal * both, self.beside * both

    def solve(self) -> tuple[FloatArray, FloatArray]:
        """The step of the frames, shape (N, 8), and of what is shared, shape (S,)."""
        right = np.concatenate([self.right[:, :, None], self.border], axis=2)
        found = solve_tridiagonal(*self._scaled(), right * SCALE[:, None]) * SCALE[:, None]
        alone, border = found[:, :, 0], found[:, :, 1:]
        rest = self.corner - np.einsum("nis,nit->st", self.border, border)
        below = self.below - np.einsum("nis,ni->s", self.border, alone)
        shared = np.linalg.solve(rest, below)
        return alone - border @ shared, shared

    def covariances(self, terms: FloatArray) -> list[FloatArray]:
        """Diagonal blocks of the inverse, and what terms that all have in common add to them.

        Args:
            terms: Right sides of one standard deviation of each term, shape (N, 8, K).
        """
        diagonal, beside = self._scaled()
        right = np.concatenate([self.border, terms], axis=2) * SCALE[:, None]
        found = solve_tridiagonal(diagonal, beside, right) * SCALE[:, None]
        border, moved = found[:, :, :SHARED], found[:, :, SHARED:]
        rest = self.corner - np.einsum("nis,nit->st", self.border, border)
        shared = np.linalg.inv(rest)
        below = shared @ -np.einsum("nis,nik->sk", self.border, moved)
        moved = moved - border @ below
        inverses = invert_diagonal(diagonal, beside) * (SCALE[:, None] * SCALE)
        covariances = inverses + border @ shared @ border.transpose(0, 2, 1)
        covariances += moved @ moved.transpose(0, 2, 1)
        return [0.5 * (each + each.T) for each in covariances]


def solve_tridiagonal(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of a symmetric block tridiagonal system.

    Args:
        diagonal: Shape (N, B, B).
        beside: Above the diagonal, shape (N - 1, B, B).
        right: Shape (N, B, K).

    Returns:
        Shape (N, B, K).

    Raises:
        numpy.linalg.LinAlgError: A block is singular.
    """
    count = len(diagonal)
    pivots, rest = diagonal.copy(), right.copy()
    for n in range(1, count):
        share = np.linalg.solve(pivots[n - 1], beside[n - 1]).T
        pivots[n] -= share @ beside[n - 1]
        rest[n] -= share @ rest[n - 1]
    found = np.empty_like(rest)
    for n in range(count - 1, -1, -1):
        if n < count - 1:
            rest[n] -= beside[n] @ found[n + 1]
        found[n] = np.linalg.solve(pivots[n], rest[n])
    return found


def invert_diagonal(diagonal: FloatArray, beside: FloatArray) -> FloatArray:
    """Diagonal blocks of the inverse of such a system, shape (N, B, B)."""
    count = len(diagonal)
    before, after = diagonal.copy(), diagonal.copy()
    for n in range(1, count):
        before[n] -= beside[n - 1].T @ np.linalg.solve(before[n - 1], beside[n - 1])
    for n in range(count - 2, -1, -1):
        after[n] -= beside[n] @ np.linalg.solve(after[n + 1], beside[n].T)
    return np.asarray(np.linalg.inv(before + after - diagonal))
