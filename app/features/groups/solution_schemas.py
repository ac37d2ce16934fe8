"""A solution as it travels: cameras, residuals, pairs, the 3D ball, gates and findings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo, field_validator, model_validator

from app.features.groups.edit_codec import edit_to_json
from app.features.groups.suggested_edits import find_guide_of_finding, list_edits_of_finding
from app.formats.camera_json import camera_to_json, covariance_to_json
from app.geometry.camera import Camera
from app.geometry.lens import BROWN_CONRADY
from app.http.documents import Document, IdentityCache
from app.soccer.finding import Dismissal, Finding, SuggestedFix
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group
from app.soccer.pitch import Pitch
from app.soccer.solution import (
    GAMMAS_PERCENT,
    BallFit,
    Calibration,
    Gate,
    Solution,
    SuspectLabel,
    TriangulatedPair,
)
from app.solving.calibrate import DRAWN_DIGITS
from app.solving.jaccard import project_markings


@dataclass(frozen=True)
class CameraSigma:
    """One standard deviation of each number of a camera.

    Attributes:
        position_meters: Of x, y and z in the pitch frame.
        k1: Of the first radial distortion coefficient.
    """

    pan_degrees: float
    tilt_degrees: float
    roll_degrees: float
    position_meters: tuple[float, float, float]
    focal_px: float
    k1: float


def camera_sigma(calibration: Calibration, size: ImageSize) -> CameraSigma | None:
    """The standard deviations of a camera whose covariance is known, those that its file says.

    Args:
        calibration: Of a view.
        size: Annotated size.

    Returns:
        None for a given camera of which nothing more is known, and where the lines leave a combination open.

    Example:
        Of a parameter log f with sigma 0.01, a focal length of 2000 px has a sigma of 20 px.
    """
    camera, covariance = calibration.camera, calibration.known_covariance_with_pitch
    if camera is None or covariance is None:
        return None
    variances = np.diag(covariance_to_json(covariance, camera, size))
    x, y, z, pan, tilt, roll, focal, k1 = np.sqrt(np.maximum(variances, 0.0)).tolist()
    return CameraSigma(pan, tilt, roll, (x, y, z), focal, k1)


def _box_to_numbers(box: Any) -> Any:
    return (box.x, box.y, box.width, box.height) if isinstance(box, Box) else box


def _map_values_by_gamma(values: Any) -> Any:
    if not isinstance(values, tuple):
        return values
    return {f"{gamma:g}": value for gamma, value in zip(GAMMAS_PERCENT, values, strict=True)}


def _camera_to_json(camera: Any) -> Any:
    return camera_to_json(camera) if isinstance(camera, Camera) else camera


Measured = float | None
"""A number that may have no end (the sigma of parallel rays): it travels as null."""
XY = tuple[float, float]
XYZ = tuple[float, float, float]
XYWH = Annotated[tuple[float, float, float, float], BeforeValidator(_box_to_numbers)]
Jac = Annotated[dict[str, float], BeforeValidator(_map_values_by_gamma)]
"""By gamma in per cent of the diagonal."""
_NOT_SEEN = np.empty((0, 2))


class CameraDocument(Document):
    """SoccerNet's camera JSON; metres, degrees, pixels of the annotated size."""

    pan_degrees: float
    tilt_degrees: float
    roll_degrees: float
    position_meters: XYZ
    x_focal_length: float
    y_focal_length: float
    principal_point: XY
    rotation_matrix: Annotated[list[list[float]] | None, Field(default=None)]
    radial_distortion: list[float] = Field(
        default=[], description="k1 .. k6; empty where `lens` names another model."
    )
    tangential_distortion: list[float] = Field(default=[])
    thin_prism_distortion: list[float] = Field(default=[])
    skew: float = 0.0
    lens: str = Field(
        default=BROWN_CONRADY,
        description="`brown_conrady` (OpenCV's full model), `fisheye` or `arctan_polynomial`.",
    )
    lens_coefficients: list[float] | None = Field(
        default=None,
        description="fisheye: k1 .. k4; arctan_polynomial: a0 .. a8; else null.",
    )
    covariance: list[list[float]] | None = Field(
        default=None,
        description="How well it is known: 8 x 8, of x, y, z (metres), pan, tilt, roll (degrees), "
        "focal length (pixels) and k1, as in camera files; null: unknown.",
    )


class MarkingFitDocument(Document):
    """Where the camera puts a marking, and how far its annotated points are off."""

    marking: str
    outcome: str = Field(
        description="`tp`, `fp` or `fn`, as JaC counts it at 0.5 % of the diagonal."
    )
    used: bool
    largest_px: float | None
    distances_px: list[Measured]
    nearest: list[XY] = Field(description="The closest place on the marking for each point.")
    polyline: list[XY] = Field(
        description="The marking as it is seen, ending at the image border; empty where it is not."
    )


class SuspectMarkingDocument(Document, shows=SuspectLabel):
    """A marking whose label looks wrong, and what would fit."""

    error_px: Measured


class PaintFitDocument(Document):
    """How a camera and the paint of its picture agree."""

    supported: float | None = Field(
        description="Share of the visible markings that have paint; null: not measured."
    )
    explained: float | None = Field(
        description="Share of the line-like paint that lies near a marking; null: not measured."
    )
    agreement: float | None = Field(description="Supported times explained; null: not measured.")
    points: int = Field(description="Places of paint that were read along the markings.")
    error_px: float | None = Field(
        description="Median distance of the paint from the markings; null where it places no camera."
    )
    reason: str | None = Field(
        description="Why the camera is that of the clicks: `no_paint`, `paint_disagrees` or "
        "`no_frame`; null where it is the paint's."
    )


class CalibrationDocument(Document):
    """The camera of a view and how well it is known."""

    source: str = Field(description="`given`, `lines` or `paint`.")
    camera: Annotated[CameraDocument, BeforeValidator(_camera_to_json)] | None
    sigma: CameraSigma | None = Field(
        description="How well the camera is known; null for a given one of which nothing more is known."
    )
    reason: str | None = Field(description="Why there is no camera.")
    jac: Jac | None = Field(
        description="JaC at 0.5, 1 and 2 % of the diagonal.", examples=[{"0.5": 0.94, "1": 1.0}]
    )
    error_px: float | None
    unobservable: list[str]
    markings: list[MarkingFitDocument]
    suspects: list[SuspectMarkingDocument]
    paint: PaintFitDocument | None = Field(
        description="How it and the paint agree; null where none was read for these lines."
    )


def _make_calibration_document(
    calibration: Calibration, pitch: Pitch, size: ImageSize
) -> CalibrationDocument:
    """The document of a calibration, with its markings where they are seen."""
    seen = {}
    if calibration.camera is not None:
        drawn = pitch.with_goal_edge(calibration.goal)
        seen = project_markings(calibration.camera, drawn, size)
    markings = [
        {
            **vars(fit),
            "largest_px": fit.largest_px,
            "polyline": np.round(seen.get(fit.marking, _NOT_SEEN), DRAWN_DIGITS).tolist(),
        }
        for fit in calibration.markings
    ]
    camera = calibration.camera
    return CalibrationDocument.model_validate(
        {
            **vars(calibration),
            "camera": camera
            and camera_to_json(camera, calibration.known_covariance_with_pitch, size),
            "sigma": camera_sigma(calibration, size),
            "markings": markings,
        }
    )


_kept_document: IdentityCache[Calibration, CalibrationDocument] = IdentityCache(
    _make_calibration_document, size=256
)


def _convert_calibration(value: Any, info: ValidationInfo) -> Any:
    if not isinstance(value, Calibration):
        return value
    group: Any = info.context
    return _kept_document(value, group.pitch, group.view(info.data["view"]).size)


class BallFitDocument(Document, shows=BallFit):
    """The 3D ball seen again in one view."""

    reprojected: XY | None
    optimized_box: XYWH | None
    exact_box: XYWH | None
    monocular: XYZ | None = Field(
        description="The ball as this view alone places it, from the size of its box."
    )
    depth_per_px_m: float | None = Field(
        description="Metres of depth of the monocular ball for a pixel of diameter."
    )


class ExpectedBallDocument(Document):
    """Where a view should show the 3D ball, whether or not anybody annotated it there."""

    place: XY
    covariance: list[Measured] = Field(description="2 x 2, row by row, square pixels.")
    box: XYWH | None = Field(description="Tight box of the ball's outline.")


class ViewSolutionDocument(Document):
    """What was computed for one view."""

    view: str
    included: bool
    failed: str | None = Field(description="First gate that dropped this view.")
    calibration: Annotated[CalibrationDocument, BeforeValidator(_convert_calibration)]
    ball: BallFitDocument | None
    expected: ExpectedBallDocument | None

    @field_validator("ball", mode="before")
    @classmethod
    def _keep_errors_only(cls, fit: Any, info: ValidationInfo) -> Any:
        """What a view outside every valid pair says of the ball: its errors, and no size."""
        if not isinstance(fit, BallFit) or info.data["included"]:
            return fit
        return replace(
            fit, optimized_diameter_px=None, optimized_box=None, exact_box=None, size_ratio=None
        )


class PairDocument(Document, shows=TriangulatedPair):
    """The ball triangulated from two views; pitch frame, metres, z down."""

    errors_px: tuple[Measured, Measured]
    parallax_degrees: Measured


class Ball3DDocument(Document):
    """The triangulated ball; pitch frame, metres, z down."""

    point: XYZ
    height_m: float = Field(description="Height of the ball above the grass, metres.")
    sigma_m: Measured
    covariance: list[Measured] = Field(description="3 x 3, row by row, square metres.")
    parallax_degrees: Measured
    views: list[str]


class ChiSquareDocument(Document):
    """Whether the residuals of the most likely ball are as small as their uncertainty says."""

    value: Measured = Field(
        description="Sum of the squared residuals over the views of valid pairs, each in units of "
        "its sigma."
    )
    freedom: int = Field(description="Two for each view, less three of the ball.")
    p_value: float = Field(description="How often chance alone makes residuals as large as these.")
    views: list[str]


class BestBallDocument(Document):
    """The maximum-likelihood ball over all views; pitch frame, metres, z down."""

    point: XYZ
    height_m: float = Field(description="Height of the ball above the grass, metres.")
    sigma_m: Measured
    covariance: list[Measured] = Field(description="3 x 3, row by row, square metres.")
    views: list[str]
    contradicting: list[str] = Field(description="Views left out because they contradict.")
    influence_m: Annotated[dict[str, float], BeforeValidator(dict)] = Field(
        description="How far the point moves without that view; empty with two views."
    )


class FailingGate(Document):
    """The gate to name to a person."""

    gate: str = Field(validation_alias="name")
    view: str | None
    sentence: str


def _edit_to_json(edit: Any) -> Any:
    return edit if isinstance(edit, dict) else edit_to_json(edit)


class EditOfferDocument(Document):
    """An edit that carries a fix out."""

    label: str = Field(description="What a button for it says.")
    edit: Annotated[dict[str, Any], BeforeValidator(_edit_to_json)] = Field(
        description="As the history writes edits: `set_lines`, `set_balls`, "
        "`set_picture` or `include_view`."
    )
    caption: str = Field(
        description="Words beside the marking or the point that it changes in the picture, or over "
        "the whole view; empty: none."
    )


class FixGuideDocument(Document):
    """Where a person is led who has to look or draw: what no edit can do for them."""

    label: str = Field(description="What a button for it says.")
    caption: str = Field(description="Words beside the place in the picture; empty: none.")
    draws: str | None = Field(description="The marking to draw; null: none.")
    looks: XY | None = Field(
        description="Where the ball would have to be, pixels; null: there is no place to look at."
    )
    reads: bool = Field(
        description="Whether the picture is to be read again, with those of its match: "
        "`POST /datasets/{id}/paint`."
    )


class DismissalDocument(Document):
    """The dismissal of a finding: by whom and when."""

    by: str = Field(validation_alias="actor")
    at: datetime
    note: str | None


class FindingDocument(Document, shows=Finding):
    """Something that a person should look at."""

    fix: SuggestedFix | None
    unusable_ball: bool = Field(
        description="Whether the ball is unusable: accepting the group then needs a note."
    )
    offers: list[EditOfferDocument] = Field(
        description=(
            "Edits that correct it; empty when only a person can correct it, several to choose "
            "from."
        )
    )
    guide: FixGuideDocument | None = Field(
        description="Where a person has to look or draw; null if edits are offered, or nothing."
    )
    dismissed: DismissalDocument | None = Field(
        default=None,
        description="Person who dismissed the finding, while it has not changed; null: not dismissed.",
    )

    @staticmethod
    def of(finding: Finding, group: Group, dismissed: Dismissal | None) -> FindingDocument:
        """The document of a finding of a group."""
        document = FindingDocument.model_validate(finding, context=group)
        if dismissed is not None:
            document.dismissed = DismissalDocument.model_validate(dismissed)
        return document

    @model_validator(mode="before")
    @classmethod
    def _add_suggested_edits(cls, value: Any, info: ValidationInfo) -> Any:
        group: Any = info.context
        if isinstance(value, Finding):
            found = {
                "offers": list_edits_of_finding(group, value),
                "guide": find_guide_of_finding(value),
            }
            return {**vars(value), **found, "unusable_ball": value.is_unusable_ball}
        return value


class SolutionDocument(Document):
    """Everything computed for one group under one policy."""

    solver_version: str
    policy_hash: str
    passes: bool
    first_failing: FailingGate | None
    gates: list[Gate]
    views: list[ViewSolutionDocument]
    pairs: list[PairDocument]
    point: str = Field(
        description="Which ball is exported, as the policy says: `mean` of the valid pairs, or "
        "`best`, the most likely point."
    )
    ball: Ball3DDocument | None = Field(description="The 3D ball that is exported.")
    mean_ball: Ball3DDocument | None = Field(
        description="Mean of the valid pairs where the most likely point is exported in its place."
    )
    best_ball: BestBallDocument | None
    chi_square: ChiSquareDocument | None
    findings: list[FindingDocument]

    @staticmethod
    def of(
        solution: Solution, group: Group, dismissed: Sequence[Dismissal | None] = ()
    ) -> SolutionDocument:
        """The document of a solution; what its findings offer are edits of the group.

        ``dismissed`` says of each finding who has checked it.
        """
        document = SolutionDocument.model_validate(solution, context=group)
        for finding, dismissal in zip(document.findings, dismissed, strict=False):
            if dismissal is not None:
                finding.dismissed = DismissalDocument.model_validate(dismissal)
        return document
