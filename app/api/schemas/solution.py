"""A solution as it travels: cameras, residuals, pairs, the 3D ball, gates and findings."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from pydantic import BaseModel, Field

from app.datasets.camera_json import camera_to_json
from app.soccer.camera_sigma import CameraSigma, camera_sigma
from app.soccer.frames import Box, ImagePoint, height_above_grass
from app.soccer.solution import (
    GAMMAS_PERCENT,
    Ball3D,
    BallFit,
    BestBall,
    Calibration,
    ExpectedBall,
    Finding,
    Gate,
    MarkingFit,
    Pair,
    Solution,
    Suspect,
    ViewSolution,
)

Measured = float | None
"""A number that may have no end (the sigma of parallel rays): it travels as null."""
XY = tuple[float, float]
XYZ = tuple[float, float, float]
XYWH = tuple[float, float, float, float]
DRAWN_DECIMALS = 3
"""What is only drawn travels to a thousandth of a pixel; what is edited or judged, exactly."""


def _drawn(points: tuple[ImagePoint, ...]) -> list[XY]:
    return [(round(x, DRAWN_DECIMALS), round(y, DRAWN_DECIMALS)) for x, y in points]


def _xywh(box: Box | None) -> XYWH | None:
    return None if box is None else (box.x, box.y, box.width, box.height)


def _xy(point: ImagePoint | None) -> XY | None:
    return None if point is None else (point.x, point.y)


class CameraDocument(BaseModel):
    """SoccerNet's camera JSON; metres, degrees, pixels of the annotated size."""

    pan_degrees: float
    tilt_degrees: float
    roll_degrees: float
    position_meters: XYZ
    x_focal_length: float
    y_focal_length: float
    principal_point: XY
    rotation_matrix: Annotated[list[list[float]] | None, Field(default=None)]
    radial_distortion: list[float]
    tangential_distortion: list[float]
    thin_prism_distortion: list[float]
    skew: float = 0.0


class MarkingDocument(BaseModel):
    """Where the camera puts a marking, and how far its annotated points are off."""

    marking: str
    outcome: str = Field(description="`tp`, `fp` or `fn`, as JaC counts it.")
    used: bool
    largest_px: float | None
    distances_px: list[Measured]
    nearest: list[XY]
    polyline: list[XY]

    @staticmethod
    def of(fit: MarkingFit) -> MarkingDocument:
        """The document of a fit."""
        return MarkingDocument.model_construct(
            marking=fit.marking,
            outcome=fit.outcome,
            used=fit.used,
            largest_px=fit.largest_px,
            distances_px=list(fit.distances_px),
            nearest=_drawn(fit.nearest),
            polyline=_drawn(fit.polyline),
        )


class SuspectDocument(BaseModel):
    """A marking whose label looks wrong, and what would fit."""

    marking: str
    suggested: str | None
    confidence: float
    error_px: Measured
    suggested_error_px: Measured

    @staticmethod
    def of(suspect: Suspect) -> SuspectDocument:
        """The document of a suspect."""
        return SuspectDocument.model_construct(**vars(suspect))


class CameraSigmaDocument(BaseModel):
    """One standard deviation of each number of a camera."""

    pan_degrees: float
    tilt_degrees: float
    roll_degrees: float
    position_meters: XYZ
    focal_px: float
    k1: float

    @staticmethod
    def of(sigma: CameraSigma) -> CameraSigmaDocument:
        """The document of a camera's standard deviations."""
        return CameraSigmaDocument.model_construct(**vars(sigma))


class CalibrationDocument(BaseModel):
    """The camera of a view and how well it is known."""

    source: str = Field(description="`given` or `lines`.")
    camera: CameraDocument | None
    sigma: CameraSigmaDocument | None = Field(
        description="How well the lines determine the camera; null for a given one."
    )
    reason: str | None = Field(description="Why there is no camera.")
    jac: dict[str, float] | None = Field(
        description="JaC at 0.5, 1 and 2 % of the diagonal.", examples=[{"0.5": 0.94, "1": 1.0}]
    )
    error_px: float | None
    unobservable: list[str]
    markings: list[MarkingDocument]
    suspects: list[SuspectDocument]

    @staticmethod
    def of(calibration: Calibration) -> CalibrationDocument:
        """The document of a calibration."""
        camera = calibration.camera
        jac = calibration.jac
        sigma = camera_sigma(calibration)
        return CalibrationDocument.model_construct(
            source=calibration.source,
            camera=None if camera is None else _camera(camera_to_json(camera)),
            sigma=None if sigma is None else CameraSigmaDocument.of(sigma),
            reason=calibration.reason,
            jac=None
            if jac is None
            else {f"{gamma:g}": value for gamma, value in zip(GAMMAS_PERCENT, jac, strict=True)},
            error_px=calibration.error_px,
            unobservable=list(calibration.unobservable),
            markings=[MarkingDocument.of(fit) for fit in calibration.markings],
            suspects=[SuspectDocument.of(suspect) for suspect in calibration.suspects],
        )


def _camera(values: dict[str, Any]) -> CameraDocument:
    return CameraDocument.model_validate(values)


class BallFitDocument(BaseModel):
    """The 3D ball seen again in one view."""

    reprojected: XY | None
    error_px: float | None
    error_percent: float | None
    optimized_diameter_px: float | None
    optimized_box: XYWH | None
    optimized_error_m: float | None
    exact_box: XYWH | None
    size_ratio: float | None
    depth_m: float | None
    monocular: XYZ | None = Field(description="Where this view alone puts the ball.")
    monocular_error_m: float | None
    depth_per_px_m: float | None = Field(
        description="Metres of depth of the monocular ball for a pixel of diameter."
    )

    @staticmethod
    def of(fit: BallFit, *, included: bool) -> BallFitDocument:
        """The document of a fit; a view outside every valid pair has its errors alone."""
        if not included:
            fit = replace(
                fit,
                optimized_diameter_px=None,
                optimized_box=None,
                exact_box=None,
                size_ratio=None,
            )
        return BallFitDocument.model_construct(
            reprojected=_xy(fit.reprojected),
            error_px=fit.error_px,
            error_percent=fit.error_percent,
            optimized_diameter_px=fit.optimized_diameter_px,
            optimized_box=_xywh(fit.optimized_box),
            optimized_error_m=fit.optimized_error_m,
            exact_box=_xywh(fit.exact_box),
            size_ratio=fit.size_ratio,
            depth_m=fit.depth_m,
            monocular=fit.monocular,
            monocular_error_m=fit.monocular_error_m,
            depth_per_px_m=fit.depth_per_px_m,
        )


class ExpectedBallDocument(BaseModel):
    """Where a view should show the 3D ball, whether or not anybody annotated it there."""

    place: XY
    covariance: list[Measured] = Field(description="2 x 2, row by row, square pixels.")
    box: XYWH | None = Field(description="Tight box of the ball's outline.")

    @staticmethod
    def of(ball: ExpectedBall) -> ExpectedBallDocument:
        """The document of an expected ball."""
        return ExpectedBallDocument.model_construct(
            place=(ball.place.x, ball.place.y),
            covariance=list(ball.covariance),
            box=_xywh(ball.box),
        )


class ViewSolutionDocument(BaseModel):
    """What was computed for one view."""

    view: str
    included: bool
    failed: str | None = Field(description="First gate that dropped this view.")
    calibration: CalibrationDocument
    ball: BallFitDocument | None
    expected: ExpectedBallDocument | None

    @staticmethod
    def of(view: ViewSolution) -> ViewSolutionDocument:
        """The document of a view's solution."""
        return ViewSolutionDocument.model_construct(
            view=view.view,
            included=view.included,
            failed=view.failed,
            calibration=CalibrationDocument.of(view.calibration),
            ball=None
            if view.ball is None
            else BallFitDocument.of(view.ball, included=view.included),
            expected=None if view.expected is None else ExpectedBallDocument.of(view.expected),
        )


class PairDocument(BaseModel):
    """The ball triangulated from two views; pitch frame, metres, z down."""

    a: str
    b: str
    point: XYZ
    errors_px: tuple[Measured, Measured]
    baseline_m: float
    parallax_degrees: Measured
    valid: bool
    failed: str | None

    @staticmethod
    def of(pair: Pair) -> PairDocument:
        """The document of a pair."""
        return PairDocument.model_construct(**vars(pair))


class Ball3DDocument(BaseModel):
    """The triangulated ball; pitch frame, metres, z down."""

    point: XYZ
    height_m: float = Field(description="Above the grass: -z.")
    sigma_m: Measured
    covariance: list[Measured] = Field(description="3 x 3, row by row, square metres.")
    parallax_degrees: Measured
    views: list[str]

    @staticmethod
    def of(ball: Ball3D) -> Ball3DDocument:
        """The document of a 3D ball."""
        return Ball3DDocument.model_construct(
            point=ball.point,
            height_m=height_above_grass(ball.point[2]),
            sigma_m=ball.sigma_m,
            covariance=list(ball.covariance),
            parallax_degrees=ball.parallax_degrees,
            views=list(ball.views),
        )


class BestBallDocument(BaseModel):
    """The maximum-likelihood ball over all views; pitch frame, metres, z down."""

    point: XYZ
    height_m: float = Field(description="Above the grass: -z.")
    sigma_m: Measured
    covariance: list[Measured] = Field(description="3 x 3, row by row, square metres.")
    views: list[str]
    contradicting: list[str] = Field(description="Views left out because they contradict.")
    influence_m: dict[str, float] = Field(
        description="How far the point moves without that view; empty with two views."
    )

    @staticmethod
    def of(ball: BestBall) -> BestBallDocument:
        """The document of a best ball."""
        return BestBallDocument.model_construct(
            point=ball.point,
            height_m=height_above_grass(ball.point[2]),
            sigma_m=ball.sigma_m,
            covariance=list(ball.covariance),
            views=list(ball.views),
            contradicting=list(ball.contradicting),
            influence_m=dict(ball.influence_m),
        )


class GateDocument(BaseModel):
    """One gate as judged for the group."""

    name: str
    passed: bool
    active: bool
    value: float | None
    threshold: float | None
    margin: float | None = Field(
        description="How far the value is from the threshold, as a share of the threshold: 0.25 "
        "is better than asked by a quarter of it, -0.25 worse by as much. null where there is no "
        "share: nothing is asked, not judged, or the threshold is 0."
    )
    sentence: str
    view: str | None

    @staticmethod
    def of(gate: Gate) -> GateDocument:
        """The document of a gate."""
        return GateDocument.model_construct(**vars(gate))


class FailingGate(BaseModel):
    """The gate to name to a person."""

    gate: str
    view: str | None
    sentence: str


class FixDocument(BaseModel):
    """An edit that a finding proposes."""

    action: str
    view: str | None
    marking: str | None
    to: str | None
    index: int | None


class FindingDocument(BaseModel):
    """Something that a person should look at."""

    kind: str
    sentence: str
    view: str | None
    marking: str | None
    suggested: str | None
    number: float | None
    threshold: float | None
    confidence: float | None
    fix: FixDocument | None

    @staticmethod
    def of(finding: Finding) -> FindingDocument:
        """The document of a finding."""
        fix = finding.fix
        values = {
            **vars(finding),
            "fix": None if fix is None else FixDocument.model_construct(**vars(fix)),
        }
        return FindingDocument.model_construct(**values)


class SolutionDocument(BaseModel):
    """Everything computed for one group under one policy."""

    solver_version: str
    policy_hash: str
    passes: bool
    first_failing: FailingGate | None
    gates: list[GateDocument]
    views: list[ViewSolutionDocument]
    pairs: list[PairDocument]
    ball: Ball3DDocument | None = Field(description="Mean of the valid pairs; exported.")
    best_ball: BestBallDocument | None
    findings: list[FindingDocument]

    @staticmethod
    def of(solution: Solution) -> SolutionDocument:
        """The document of a solution."""
        return SolutionDocument.model_construct(
            solver_version=solution.solver_version,
            policy_hash=solution.policy_hash,
            passes=solution.passes,
            first_failing=failing_gate(solution.first_failing),
            gates=[GateDocument.of(gate) for gate in solution.gates],
            views=[ViewSolutionDocument.of(view) for view in solution.views],
            pairs=[PairDocument.of(pair) for pair in solution.pairs],
            ball=None if solution.ball is None else Ball3DDocument.of(solution.ball),
            best_ball=None
            if solution.best_ball is None
            else BestBallDocument.of(solution.best_ball),
            findings=[FindingDocument.of(finding) for finding in solution.findings],
        )


def failing_gate(gate: Gate | None) -> FailingGate | None:
    """The short form of a gate that failed."""
    if gate is None:
        return None
    return FailingGate.model_construct(gate=gate.name, view=gate.view, sentence=gate.sentence)
