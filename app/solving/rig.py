"""Rig: the cameras of a stadium that stand still, adjusted together to lines and balls over time.

Each camera on its own is only as good as the lines that it shows. Balls that several cameras see
at the same instant tell how the cameras stand to each other, to a fraction of a pixel; but they
say little about where the pitch lies, and a rig that follows balls alone drifts away by a metre
or two. What holds it in its place are the annotated lines and, weakly, the cameras as they were.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.errors import InputError
from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.bundle import RayPixels, bundle_equations, linearize, optimize_points
from app.geometry.camera import Camera
from app.geometry.least_squares import covariance, levenberg_marquardt
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PARAMETERS,
    GaussianPrior,
    X,
    Z,
    camera_from_parameters,
    curve_distances,
    normal_equations,
    parameters_from_camera,
    projection_jacobians,
)
from app.soccer.annotation import Lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.ball_covariance import CLICK_DIAGONAL
from app.solving.observations import Observations, make_observations, principal_point

MIN_BALLS = 20
"""Instants that a camera must share with others to be adjusted."""
LINE_SIGMA_PX = 3.0
"""Of a clicked line point at 1920 x 1080, at least; more where the lines fit worse."""
ANCHOR_SIGMA_PX = 10.0
"""How far off a camera may show the grass, at 1920 x 1080, before it is adjusted."""
ANCHOR_POINTS = 8.0
"""As many points of the grass hold a camera to that, however many are looked at."""
POSITION_SIGMA_M = 2.0
FOCAL_SIGMA = 0.05
"""How far off a camera's position (metres) and focal length (share) may be before."""
PRIOR_SIGMA = np.full(PARAMETERS, np.inf)
PRIOR_SIGMA[X : Z + 1] = POSITION_SIGMA_M
PRIOR_SIGMA[LOG_FOCAL] = FOCAL_SIGMA
PRIOR_SIGMA[KAPPA] = 0.02
"""Of the parameters; nothing is said of how the camera is turned."""
WIDE, TIGHT = 10.0, 2.0
"""Scales of the robust loss, in sigmas: on the way, and at the end."""
GROSS = 5.0
"""As many times the median error is a gross one, where that is more than tau."""
STEPS = 40
MAX_MODEL_ERROR_PX = 0.5
_GRID_M = 2.5
_NORMAL_MEDIAN = 0.6745
"""Median of the absolute value of a standard normal variable."""


@dataclass(frozen=True)
class RigCamera:
    """A camera that stands still: as it is thought to stand now, and the lines that it shows."""

    key: str
    size: ImageSize
    lines: Lines
    camera: Camera

    @property
    def half_diagonal(self) -> float:
        """Half the image diagonal, pixels."""
        return self.size.diagonal / 2

    @property
    def parameters(self) -> FloatArray:
        """The camera as a row of ``geometry.resection``, shape (8,)."""
        return parameters_from_camera(self.camera, self.half_diagonal)

    @property
    def pixels_per_reference_pixel(self) -> float:
        """Pixels of this image for a pixel at 1920 x 1080."""
        return self.size.diagonal / CLICK_DIAGONAL

    def camera_of_parameters(self, parameters: FloatArray) -> Camera:
        """The camera of a row of parameters, with the principal point that it has."""
        return camera_from_parameters(parameters, self.camera.principal_point, self.half_diagonal)


@dataclass(frozen=True)
class RigFrame:
    """One instant: its time in frames, and where which camera shows the ball."""

    time: int
    balls: Mapping[str, ImagePoint]


@dataclass(frozen=True)
class Rig:
    """Cameras and the balls that at least two of them show.

    Attributes:
        cameras: In the order of the rows of parameters.
        rays: Of the balls.
        times: Of the instants, frames, shape (F,).
        pitch: The pitch, with the goals that lines are fitted to.
    """

    cameras: tuple[RigCamera, ...]
    rays: RayPixels
    times: FloatArray
    pitch: Pitch

    @property
    def initial_parameters(self) -> FloatArray:
        """The cameras as they are thought to stand now, shape (K, 8)."""
        return np.array([camera.parameters for camera in self.cameras])

    def only_instants(self, kept: BoolArray) -> Rig:
        """The same cameras with some of the instants, shape (F,)."""
        return replace(self, rays=self.rays.select_rays_of_points(kept), times=self.times[kept])


@dataclass(frozen=True)
class RigFit:
    """Adjusted cameras.

    Attributes:
        parameters: Shape (K, 8).
        covariance: Of all parameters together, shape (8 K, 8 K).
        ball_sigma: Noise of a ball's click, as a multiple of the policy's.
        line_sigma_px: Noise of a line's point at 1920 x 1080.
    """

    parameters: FloatArray
    covariance: FloatArray
    ball_sigma: float
    line_sigma_px: float

    def covariance_of(self, row: int) -> FloatArray:
        """Covariance of one camera's parameters, shape (8, 8)."""
        own = slice(row * PARAMETERS, (row + 1) * PARAMETERS)
        return self.covariance[own, own]


def make_rig(
    cameras: Sequence[RigCamera], frames: Sequence[RigFrame], pitch: Pitch, policy: Policy
) -> tuple[Rig, int]:
    """The rig of the cameras that share enough balls, and how many instants were left out.

    An instant is left out where a ball lies farther than tau from what the others say: another
    ball, another instant, or a slip of the hand, which the gates refuse as well.

    Raises:
        InputError: Too few cameras share balls, or one has a lens that cannot be adjusted.
    """
    sharing = _find_cameras_sharing_balls(cameras, frames)
    if len(sharing) < 2:
        raise InputError(
            f"no two static cameras with a calibration show the ball together {MIN_BALLS} times",
            hint="Annotate the ball in more frames, or import cameras first.",
        )
    for camera in sharing:
        _require_adjustable(camera)
    fitted = policy.calibration.pitch_for_fitted_lines(pitch)
    rig = Rig(tuple(sharing), *_collect_rays_of_frames(sharing, frames, policy), fitted)
    points = optimize_points(rig.initial_parameters, rig.rays, np.inf)
    at = linearize(rig.initial_parameters, points, rig.rays)
    apart = np.hypot(*at.residuals.T) * rig.rays.sigma
    limits = policy.tau_px(2 * rig.rays.half_diagonals)
    # Where the cameras are far off themselves, most rays pass each other that far.
    limits = np.maximum(limits, GROSS * np.median(apart))
    gross = np.zeros(rig.rays.point_count, bool)
    np.logical_or.at(gross, rig.rays.point, ~(apart < limits[rig.rays.camera]))
    return rig.only_instants(~gross), int(gross.sum())


def adjust_rig(rig: Rig) -> RigFit:
    """The cameras that explain lines and balls best, and how well they are known."""
    anchors = [sample_grass_in_view(camera) for camera in rig.cameras]
    observed = [_make_camera_observations(camera, rig.pitch) for camera in rig.cameras]
    parameters, ball_sigma, line_sigma = rig.initial_parameters, 1.0, LINE_SIGMA_PX
    for scale in (WIDE, TIGHT, TIGHT):
        rays = replace(rig.rays, sigma=rig.rays.sigma * ball_sigma)
        problem = _RigProblem(rig.cameras, rays, observed, anchors, line_sigma, scale)
        fit = levenberg_marquardt(
            problem.compute_normal_equations, parameters.reshape(1, -1), STEPS
        )
        parameters = fit.parameters[0].reshape(-1, PARAMETERS)
        # What clicks and lines are worth is known once the cameras fit.
        ball_sigma = max(1.0, _estimate_click_noise_factor(parameters, rig.rays))
        line_sigma = max(LINE_SIGMA_PX, _line_sigma(parameters, rig.cameras, observed))
    return RigFit(parameters, covariance(fit.information[0]), ball_sigma, line_sigma)


def measure_line_distances(camera: RigCamera, parameters: FloatArray, pitch: Pitch) -> FloatArray:
    """Distance of each annotated point to its projected marking, pixels, shape (N,)."""
    observed = _make_camera_observations(camera, pitch)
    return curve_distances(
        parameters, observed.curves, observed.curve_points(), camera.half_diagonal
    )


def sample_grass_in_view(camera: RigCamera) -> FloatArray:
    """Points of the grass that a camera shows, pitch frame, metres, shape (N, 3)."""
    across, along = np.arange(-65.0, 65.1, _GRID_M), np.arange(-45.0, 45.1, _GRID_M)
    places = np.array([(x, y, 0.0) for x in across for y in along])
    pixels = camera.camera.project(places)
    with np.errstate(invalid="ignore"):
        shown = ((pixels >= 0) & (pixels < (camera.size.width, camera.size.height))).all(axis=1)
    return places[shown]


@dataclass(frozen=True)
class _RigProblem:
    """The sum of squares of a rig, in sigmas."""

    cameras: tuple[RigCamera, ...]
    rays: RayPixels
    observed: list[Observations]
    anchors: list[FloatArray]
    line_sigma_px: float
    scale: float

    def compute_normal_equations(
        self, rows: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """As ``levenberg_marquardt`` asks for them, for the one row that there is."""
        parameters = rows[0].reshape(-1, PARAMETERS)
        cost, gradient, information = bundle_equations(parameters, self.rays, self.scale)
        for place, camera in enumerate(self.cameras):
            own = slice(place * PARAMETERS, (place + 1) * PARAMETERS)
            for part in (self._line_equations, self._prior_equations):
                more, pull, curve = part(place, camera, parameters[place])
                cost += more
                gradient[own] += pull
                information[own, own] += curve
        return np.array([cost]), gradient[None], information[None]

    def _line_equations(
        self, place: int, camera: RigCamera, parameters: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """What the annotated lines of a camera say."""
        observed, sigma = (
            self.observed[place],
            self.line_sigma_px * camera.pixels_per_reference_pixel,
        )
        cost, gradient, information = normal_equations(
            parameters[None],
            observed.curves,
            observed.curve_points(),
            _NO_PRIOR,
            self.scale * sigma,
            camera.half_diagonal,
        )
        return float(cost[0]) / sigma**2, gradient[0] / sigma**2, information[0] / sigma**2

    def _prior_equations(
        self, place: int, camera: RigCamera, parameters: FloatArray
    ) -> tuple[float, FloatArray, FloatArray]:
        """The weak prior: the grass where the camera showed it, the camera where it stood."""
        before, grass = camera.parameters, self.anchors[place]
        off = (parameters - before) / PRIOR_SIGMA
        cost, gradient = 0.5 * float(off @ off), off / PRIOR_SIGMA
        information = np.diag(1 / PRIOR_SIGMA**2)
        if len(grass) == 0:
            return cost, gradient, information
        pixels = camera.camera_of_parameters(parameters).project(grass, folded=True)
        moved = pixels - camera.camera.project(grass, folded=True)
        rows = np.repeat(parameters[None], len(grass), axis=0)
        slopes = projection_jacobians(rows, grass, np.full(len(grass), camera.half_diagonal))
        slopes[np.isnan(moved).any(axis=1)] = 0.0
        moved = np.nan_to_num(moved)
        weight = (
            ANCHOR_POINTS / len(grass) / (ANCHOR_SIGMA_PX * camera.pixels_per_reference_pixel) ** 2
        )
        cost += 0.5 * weight * float((moved**2).sum())
        gradient = gradient + weight * np.einsum("nia,ni->a", slopes, moved)
        information = information + weight * np.einsum("nia,nib->ab", slopes, slopes)
        return cost, gradient, information


_NO_PRIOR = GaussianPrior(np.zeros(PARAMETERS), np.full(PARAMETERS, np.inf))


def _find_cameras_sharing_balls(
    cameras: Sequence[RigCamera], frames: Sequence[RigFrame]
) -> list[RigCamera]:
    """The cameras that share enough balls with each other."""
    left = {camera.key: camera for camera in cameras}
    while left:
        counts = dict.fromkeys(left, 0)
        for frame in frames:
            seen = [key for key in frame.balls if key in left]
            for key in seen if len(seen) > 1 else ():
                counts[key] += 1
        few = [key for key, count in counts.items() if count < MIN_BALLS]
        if not few:
            break
        for key in few:
            del left[key]
    return list(left.values())


def _collect_rays_of_frames(
    cameras: Sequence[RigCamera], frames: Sequence[RigFrame], policy: Policy
) -> tuple[RayPixels, FloatArray]:
    places = {camera.key: place for place, camera in enumerate(cameras)}
    pixels: list[FloatArray] = []
    rows: list[tuple[int, int]] = []
    times: list[int] = []
    for frame in frames:
        seen = [key for key in frame.balls if key in places]
        if len(seen) < 2:
            continue
        for key in seen:
            camera = cameras[places[key]].camera
            pixels.append(np.subtract(frame.balls[key], camera.principal_point))
            rows.append((places[key], len(times)))
        times.append(frame.time)
    camera_rows, point_rows = np.array(rows, dtype=np.int64).reshape(-1, 2).T
    units = np.array([camera.pixels_per_reference_pixel for camera in cameras])
    rays = RayPixels(
        np.array(pixels, float).reshape(-1, 2),
        camera_rows,
        point_rows,
        policy.click_sigma_px * units[camera_rows],
        np.array([camera.half_diagonal for camera in cameras]),
    )
    return rays, np.array(times, float)


def _require_adjustable(camera: RigCamera) -> None:
    """Refuse a camera that the parameters of a rig cannot hold."""
    if camera.camera.is_wide:
        raise InputError(
            f"camera {camera.key} has a {camera.camera.lens} lens, which a rig does not adjust",
            hint="Only one focal length and one radial term can be adjusted: keep this camera as it is.",
        )
    grass = sample_grass_in_view(camera)
    plain = camera.camera_of_parameters(camera.parameters)
    if len(grass) == 0:
        return
    apart = np.abs(plain.project(grass) - camera.camera.project(grass)).max()
    if not apart <= MAX_MODEL_ERROR_PX * camera.pixels_per_reference_pixel:
        raise InputError(
            f"the lens of camera {camera.key} has terms that cannot be adjusted",
            hint="Only one focal length and one radial term can be adjusted: keep this camera as it is.",
        )


def _make_camera_observations(camera: RigCamera, pitch: Pitch) -> Observations:
    """The lines of a camera, relative to its own principal point."""
    observed = make_observations(camera.lines, pitch, camera.size)
    shift = np.subtract(principal_point(camera.size), camera.camera.principal_point)
    return replace(observed, pixels=observed.pixels + shift)


def _estimate_click_noise_factor(parameters: FloatArray, rays: RayPixels) -> float:
    """Noise of the clicks, robustly, as a multiple of what the rays are said to have."""
    points = optimize_points(parameters, rays, np.inf)
    squares = (linearize(parameters, points, rays).residuals ** 2).sum(axis=1)
    total = np.bincount(rays.point, squares, minlength=rays.point_count)
    freedom = 2 * np.bincount(rays.point, minlength=rays.point_count) - 3
    # The median of chi-square (Wilson and Hilferty).
    usual = freedom * (1 - 2 / (9 * freedom)) ** 3
    return float(np.sqrt(np.median(total / usual)))


def _line_sigma(
    parameters: FloatArray, cameras: Sequence[RigCamera], observed: Sequence[Observations]
) -> float:
    """Noise of the line points, robustly, pixels at 1920 x 1080; 0 without lines."""
    apart = [
        curve_distances(row, seen.curves, seen.curve_points(), camera.half_diagonal)
        / camera.pixels_per_reference_pixel
        for row, camera, seen in zip(parameters, cameras, observed, strict=True)
    ]
    every = np.concatenate(apart)
    return float(np.median(every) / _NORMAL_MEDIAN) if len(every) else 0.0
