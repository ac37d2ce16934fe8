"""Resect: the camera parameters that fit observations best, from a cold start.

A bank of stands, each aimed at what is seen, is refined side by side with a wide robust scale;
the best go on with narrower ones. No earlier camera is looked at, so the same lines always
give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.camera import Camera
from app.geometry.least_squares import LeastSquaresResult, require_determined_parameters
from app.geometry.resection import (
    ARC,
    KAPPA,
    PARAMETERS,
    ROLL,
    GaussianPrior,
    X,
    Z,
    camera_from_parameters,
    curve_distances,
    curve_residuals,
    fit_camera_to_curves,
    parameters_from_camera,
)
from app.soccer.frames import ImageSize
from app.soccer.pitch import CIRCLES
from app.soccer.policy import CalibrationPolicy
from app.solving.camera_positions import (
    MAIN_FREEDOM,
    MAIN_MEAN,
    MAIN_SIGMA,
    STADIUM,
    STANDS,
    PositionPrior,
    is_main_position,
    make_starts_at_typical_positions,
)
from app.solving.line_noise import LineNoise, LinePrior, compute_line_noise
from app.solving.observations import (
    SHARED_SHARE,
    Observations,
    compute_point_weights,
    principal_point,
)

REFERENCE_DIAGONAL = float(np.hypot(960, 540))
"""Scales in pixels hold for 960 x 540 and grow with the diagonal."""

CLICK_SIGMA_PX = 1.0
"""What is expected of clicks before any is seen, at 960 x 540."""

WIDE = 4.0
"""Scale of the robust weights in the covariance, in units of the fit's."""

MIN_CLICK_SIGMA_PX = 0.5
"""Clicks are not trusted to be better than this, however well they fit, at 960 x 540."""


@dataclass(frozen=True)
class ResectionStage:
    """One round of refinement: how many starts go in, how far, how forgiving."""

    starts: int
    steps: int
    scale_px: float
    tolerance: float


FINAL = ResectionStage(starts=1, steps=25, scale_px=0.0, tolerance=1e-6)
"""Its scale is the policy's."""


@dataclass(frozen=True)
class SearchPlan:
    """How a camera is sought: each stage goes on with the best of the one before.

    Attributes:
        scout: From every stand.
        search: On few points of each marking, like the scouts.
        narrow: On all points.
        final: Likewise, under the policy's scale.
    """

    scout: ResectionStage
    search: ResectionStage
    narrow: ResectionStage
    final: ResectionStage


QUICK = SearchPlan(
    scout=ResectionStage(starts=len(STANDS), steps=1, scale_px=30.0, tolerance=1e-3),
    search=ResectionStage(starts=12, steps=8, scale_px=30.0, tolerance=1e-3),
    narrow=ResectionStage(starts=4, steps=10, scale_px=8.0, tolerance=1e-4),
    final=FINAL,
)
"""For what its lines determine well: wherever it begins, it ends in one camera."""
THOROUGH = SearchPlan(
    scout=replace(QUICK.scout, steps=5),
    search=QUICK.search,
    narrow=replace(QUICK.narrow, starts=6),
    final=replace(FINAL, starts=2),
)
"""For what is nearly undetermined, or fits badly: there the best of several minima is sought."""
FEW_MEASUREMENTS = 10
"""With fewer, several cameras fit nearly as well."""
MAIN_ROUNDS = 3
POOR_PX = 8.0
"""A fit is poor when a point lies farther than this from its marking, at 960 x 540."""
POINTS_PER_LINE, POINTS_PER_CIRCLE = 4, 8
"""Points that the search looks at; the later stages use them all."""


CONTRADICTION = 64.0
"""A prior of the position that costs the lines more than this, in clicks' variances, is dropped."""
ROLLED, ROLL_SIGMAS = float(np.radians(2)), 4.0
"""A camera is rolled beyond this (radians) that is known to so many standard deviations."""


@dataclass(frozen=True)
class Resection:
    """A camera as parameters of ``geometry.resection``, shape (8,), and its robust cost."""

    parameters: FloatArray
    cost: float


@dataclass(frozen=True)
class ResectionProblem:
    """What all resections of one image share.

    Attributes:
        size: Annotated size.
        robust_scale_px: Scale of the final soft-L1 loss at 960 x 540.
        distortion_mean: Mean of the prior on kappa.
        distortion_sigma: Its standard deviation.
        line_sigma_px: Noise of the clicks of the dataset at 960 x 540, where that is known.
        line_share: Of its variance, what the points of a marking have in common, if known.
        fit_share: The same as the fit weighs points, whatever is known: noise moves no camera.
    """

    size: ImageSize
    robust_scale_px: float
    distortion_mean: float
    distortion_sigma: float
    line_sigma_px: float | None = None
    line_share: float | None = None
    fit_share: float = 0.0

    @staticmethod
    def of(size: ImageSize, policy: CalibrationPolicy) -> ResectionProblem:
        """The problem of one image under a policy."""
        return ResectionProblem(
            size,
            policy.robust_scale_px,
            policy.distortion_mean,
            policy.distortion_sigma,
            policy.line_sigma_px,
            policy.line_share,
            SHARED_SHARE if policy.weighed == "markings" else 0.0,
        )

    @property
    def pixels_per_reference_pixel(self) -> float:
        """Pixels of this image for a pixel at 960 x 540."""
        return self.size.diagonal / REFERENCE_DIAGONAL

    @property
    def click_noise_prior(self) -> LinePrior:
        """What is known of the noise of its clicks before any is seen, pixels of this image."""
        sigma, floor = self.line_sigma_px or CLICK_SIGMA_PX, MIN_CLICK_SIGMA_PX
        return LinePrior(
            sigma * self.pixels_per_reference_pixel,
            min(floor, sigma) * self.pixels_per_reference_pixel,
            self.line_share,
        )

    def resect(self, observations: Observations) -> Resection:
        """The best camera; where it fits badly, also sought thoroughly, and without the circles first.

        Points of a circle of which little is seen can settle on its wrong side and hold the
        camera there; straight markings have no wrong side.

        Args:
            observations: N annotated points in pixels from the middle of the picture, with the
                pitch curve (metres) on which each lies.

        Returns:
            Parameters, shape (8,), of least soft-L1 cost (pixels squared) of the distances between
            points and projected curves, and that cost.
        """
        fit = self.search(observations)
        if (
            self.distances(fit.parameters, observations).max()
            <= POOR_PX * self.pixels_per_reference_pixel
        ):
            return fit
        fits = [fit]
        if not has_few_measurements(observations):
            fits.append(self._search_all_stages(observations, THOROUGH))
        straight = observations.without(*CIRCLES)
        if (
            len(straight.pixels) < len(observations.pixels)
            and count_measurements(straight) >= PARAMETERS
        ):
            fits.append(self.refine(observations, self.search(straight).parameters[None]))
        return min(fits, key=lambda item: item.cost)

    def search(self, observations: Observations) -> Resection:
        """The best camera from the whole bank of stands."""
        plan = THOROUGH if has_few_measurements(observations) else QUICK
        return self._search_all_stages(observations, plan)

    def _search_all_stages(self, observations: Observations, plan: SearchPlan) -> Resection:
        thinned = observations.thin_points(POINTS_PER_LINE, POINTS_PER_CIRCLE)
        starts = make_starts_at_typical_positions(observations, self.size.diagonal)
        scouted = self._run_stage(thinned, starts, plan.scout, damping=1e-2)
        searched = self._run_stage(
            thinned, choose_best_starts(scouted, plan.search.starts), plan.search
        )
        return self.refine(observations, choose_best_starts(searched, plan.narrow.starts), plan)

    def refine(
        self, observations: Observations, starts: FloatArray, plan: SearchPlan = QUICK
    ) -> Resection:
        """The best camera from some starts near a minimum, shape (B, 8)."""
        narrowed = self._run_stage(observations, starts, plan.narrow)
        fit = self._run_stage(
            observations, choose_best_starts(narrowed, plan.final.starts), plan.final
        )
        return Resection(choose_best_starts(fit, 1)[0], float(fit.cost.min()))

    def refine_with_main_prior(self, fit: Resection, observations: Observations) -> Resection:
        """The camera once more with what is known of main cameras, where it stands like one.

        Where the lines determine the camera this changes nothing; where they leave a direction
        open the stadium closes it. A replay, which may stand anywhere, is left alone.
        """
        return self._refine_main_camera(fit, observations, STADIUM)

    def refine_with_match_position(
        self, alone: Resection, observations: Observations, near: PositionPrior
    ) -> Resection:
        """The camera once more with what other frames of its match say of the position."""
        return self._refine_main_camera(alone, observations, near)

    def _refine_main_camera(
        self, alone: Resection, observations: Observations, near: PositionPrior
    ) -> Resection:
        """The camera once more with a prior of its roll and position.

        A camera that does not stand like a main camera or is clearly rolled is left alone, and so
        is one whose lines contradict the prior.
        """
        if not is_main_position(alone.parameters[X : Z + 1]):
            return alone
        if self._is_clearly_rolled(alone, observations):
            return alone
        refined = self._refine_near_position(alone, observations, near)
        variance = self.click_variance(alone.parameters, observations)
        loss = self._data_cost(refined, observations) - self._data_cost(alone, observations)
        return refined if 2 * loss <= CONTRADICTION * variance else alone

    def _is_clearly_rolled(self, fit: Resection, observations: Observations) -> bool:
        """Whether the lines say that the camera is rolled, as no main camera is."""
        roll = abs(float(fit.parameters[ROLL]))
        if roll <= ROLLED:
            return False
        try:
            covariance = self.line_noise(fit.parameters, observations).parameters
        except DegenerateGeometryError:
            return False
        return roll > ROLL_SIGMAS * float(np.sqrt(covariance[ROLL, ROLL]))

    def _refine_near_position(
        self, fit: Resection, observations: Observations, near: PositionPrior
    ) -> Resection:
        """Reweighted rounds with a Student prior of roll and position."""
        variance = self.click_variance(fit.parameters, observations)
        offset = np.zeros(len(MAIN_MEAN))
        for _ in range(MAIN_ROUNDS):
            prior = self.main_camera_prior(near, offset, variance)
            found = self._run_stage(observations, fit.parameters[None], FINAL, prior=prior)
            fit = Resection(found.parameters[0], float(found.cost[0]))
            offset = fit.parameters[ROLL : Z + 1] - prior.mean[ROLL : Z + 1]
        return fit

    def _data_cost(self, fit: Resection, observations: Observations) -> float:
        """Robust cost of the points alone, pixels squared."""
        scale = self.robust_scale_px * self.pixels_per_reference_pixel
        apart = self.distances(fit.parameters, observations)
        robust = scale**2 * (np.sqrt(1 + (apart / scale) ** 2) - 1)
        return float(self.weights(observations) @ robust)

    def weights(self, observations: Observations) -> FloatArray:
        """Weight of each observed point in the fit, shape (N,)."""
        return compute_point_weights(observations.marking, self.fit_share)

    def row_weights(self, observations: Observations, marking: IntArray) -> FloatArray:
        """The same of rows as ``compute_line_noise_inputs`` has them, by the marking of each, shape (M,)."""
        points = np.where(marking < 0, -1 - marking, np.arange(len(marking)))
        return self.weights(observations)[points]

    def distances(self, parameters: FloatArray, observations: Observations) -> FloatArray:
        """Distance of each observed point to its marking, pixels, shape (N,)."""
        return curve_distances(
            parameters, observations.curves, observations.curve_points(), self.size.diagonal / 2
        )

    def line_noise(self, parameters: FloatArray, observations: Observations) -> LineNoise:
        """Noise of the clicks, and the covariance of the parameters at a minimum, shape (8, 8).

        Only the distortion keeps its prior: what the lines do not determine must show.

        Args:
            parameters: At the minimum, shape (8,).
            observations: N annotated points with their curves, pixels.

        Raises:
            DegenerateGeometryError: The lines leave a combination of parameters open.
        """
        rows = self.compute_line_noise_inputs(parameters, observations)
        return compute_line_noise(
            *rows, self.click_noise_prior, self.row_weights(observations, rows[2])
        )

    def compute_line_noise_inputs(
        self, parameters: FloatArray, observations: Observations
    ) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
        """Residuals, Jacobian, marking and prior at a minimum as ``compute_line_noise`` takes them.

        Args:
            parameters: At the minimum, shape (8,).
            observations: N annotated points with their curves, pixels.

        Returns:
            Residuals across the lines, and along them beyond an end, pixels, shape (M,) with
            N <= M <= 2 N; their derivatives, shape (M, 8); the marking of each, negative and its
            own for one along, shape (M,); the prior's information, a diagonal, shape (8,).

        Raises:
            DegenerateGeometryError: The lines leave a combination of parameters open.
        """
        offsets, jacobians = curve_residuals(
            parameters, observations.curves, observations.curve_points(), self.size.diagonal / 2
        )
        # At a wider scale honest clicks weigh one, as the formula for the covariance has it.
        scale = WIDE * self.robust_scale_px * self.pixels_per_reference_pixel
        weight = (1 + (offsets**2).sum(axis=1) / scale**2) ** -0.25
        beyond = np.flatnonzero(offsets[:, 1])
        # What lies along the line has nothing in common with what lies across.
        jacobian = np.vstack([jacobians[:, 0], jacobians[beyond, 1]])
        rows = np.append(np.arange(len(offsets)), beyond)
        prior = np.zeros(PARAMETERS)
        prior[KAPPA] = self.distortion_sigma**-2
        jacobian *= weight[rows, None]
        require_determined_parameters(jacobian.T @ jacobian + np.diag(prior))
        apart = np.append(offsets[:, 0], offsets[beyond, 1]) * weight[rows]
        return apart, jacobian, np.append(observations.marking, -1 - beyond), prior

    def click_variance(self, parameters: FloatArray, observations: Observations) -> float:
        """Variance of the clicks' distances, from the robust fit, pixels squared."""
        scale = self.robust_scale_px * self.pixels_per_reference_pixel
        apart = self.distances(parameters, observations)
        freedom = max(len(apart) - PARAMETERS + 1, 1)
        robust = 2 * scale**2 * (np.sqrt(1 + (apart / scale) ** 2) - 1)
        return max(
            float(robust.sum()) / freedom,
            (MIN_CLICK_SIGMA_PX * self.pixels_per_reference_pixel) ** 2,
        )

    def camera(self, parameters: FloatArray) -> Camera:
        """Camera of one row of parameters, shape (8,), in pixels of this picture and the pitch frame."""
        return camera_from_parameters(
            parameters, principal_point(self.size), self.size.diagonal / 2
        )

    def parameters(self, camera: Camera) -> FloatArray:
        """Row of parameters of one camera, shape (8,)."""
        return parameters_from_camera(camera, self.size.diagonal / 2)

    def _run_stage(
        self,
        observations: Observations,
        starts: FloatArray,
        stage: ResectionStage,
        damping: float = 1e-3,
        prior: GaussianPrior | None = None,
    ) -> LeastSquaresResult:
        return fit_camera_to_curves(
            starts,
            observations.curves,
            observations.curve_points(self.fit_share),
            prior or self.prior(),
            (stage.scale_px or self.robust_scale_px) * self.pixels_per_reference_pixel,
            self.size.diagonal / 2,
            stage.steps,
            tolerance=stage.tolerance,
            damping=damping,
        )

    def prior(self) -> GaussianPrior:
        """Wide enough to decide nothing that a few points decide; it keeps the rest on earth."""
        focal = np.log(2000.0 * self.pixels_per_reference_pixel)
        mean = np.array([0.0, 0.0, 0.0, 0.0, 0.0, -15.0, focal, self.distortion_mean])
        level = np.radians(2)
        sigma = np.array([np.inf, np.inf, level, 300.0, 300.0, 60.0, 3.0, self.distortion_sigma])
        return GaussianPrior(mean, sigma)

    def main_camera_prior(
        self, near: PositionPrior, offset: FloatArray, variance: float = 1.0
    ) -> GaussianPrior:
        """Student prior of main cameras, reweighted for an offset from its mean.

        The better the clicks fit and the more they insist on an offset, the less it weighs.

        Args:
            near: What is known of the position.
            offset: Of roll (radians) and position (metres) from the mean, shape (4,).
            variance: Of the residuals, in units of what the cost counts as one.
        """
        prior = self.prior()
        sigma = np.array([MAIN_SIGMA[0], *near.sigma])
        freedom = np.array([MAIN_FREEDOM, *[near.freedom] * 3])
        prior.mean[ROLL : Z + 1] = [MAIN_MEAN[0], *near.mean]
        prior.sigma[ROLL : Z + 1] = sigma * np.sqrt(1 + (offset / sigma) ** 2 / freedom)
        # The cost counts pixels as if a click's standard deviation were one.
        prior.sigma[[ROLL, KAPPA]] /= np.sqrt(variance)
        prior.sigma[X : Z + 1] /= np.sqrt(variance * near.clicks)
        return prior


def choose_best_starts(fit: LeastSquaresResult, count: int) -> FloatArray:
    """Parameters of the ``count`` starts of lowest cost, lowest first."""
    return fit.parameters[np.argsort(fit.cost, kind="stable")[:count]]


def has_few_measurements(observations: Observations) -> bool:
    """Whether several cameras may fit nearly as well."""
    return count_measurements(observations) < FEW_MEASUREMENTS


def count_measurements(observations: Observations) -> int:
    """Independent numbers that the observations give: two a line, at most five a circle, two a place.

    Points in one pixel are one place.
    """
    # Clicks lie on whole and half pixels: no cell of the grid ends there.
    cells = np.round(observations.pixels + 0.25)
    places = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
    total = 0
    for index in np.unique(observations.marking):
        points = len(np.unique(places[observations.marking == index]))
        total += min(points, 5 if observations.curves.kinds[index] == ARC else 2)
    return min(total, 2 * len(np.unique(places)))
