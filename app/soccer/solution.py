"""Solution: everything computed for one group, from cameras to findings.

Nothing here is edited by anybody; a solution is inserted, or deleted and computed again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from app.geometry.camera import Camera
from app.soccer.choices import GoalEdge
from app.soccer.finding import Finding
from app.soccer.frames import Box, ImagePoint, height_above_grass

SOLVER_VERSION = "12"
"""Part of every solution's key; raised by one whenever a number changes."""

GAMMAS_PERCENT = (0.5, 1.0, 2.0)

GATES = (
    "calibratable",
    "jac",
    "agreement",
    "two_views",
    "ball",
    "baseline",
    "reprojection",
    "parallax",
    "sigma",
    "chi_square",
)
"""Names of the gates in the order in which they are judged."""


@dataclass(frozen=True)
class MarkingFit:
    """One marking of one view: where the camera puts it and how far the annotation is off.

    Attributes:
        outcome: ``tp``, ``fp`` or ``fn`` as JaC counts it at the first of ``GAMMAS_PERCENT``.
        distances_px: Distance of each annotated point to the projected polyline; empty when
            the marking is not annotated or not visible.
        nearest: The closest place on the polyline for each annotated point, to a thousandth of a
            pixel.
        length_px: Length of the projected marking inside the image, pixels; 0 when not visible.
            Where it lies follows from camera and pitch (``solving.jaccard.project_markings``).
        used: False when the solver left the marking out.
        judged_px: Largest distance of an annotated point from the marking as the public evaluator
            has it, pixels, infinite where that is not visible; None where it is ``largest_px``.
    """

    marking: str
    outcome: str
    distances_px: tuple[float, ...] = ()
    nearest: tuple[ImagePoint, ...] = ()
    length_px: float = 0.0
    used: bool = True
    judged_px: float | None = field(default=None, metadata={"later": True})

    @property
    def largest_px(self) -> float | None:
        """Largest distance of an annotated point, pixels; None without one."""
        return max(self.distances_px, default=None)

    @property
    def counted_px(self) -> float:
        """Largest distance by which JaC counts, pixels; infinite without one."""
        counted = self.largest_px if self.judged_px is None else self.judged_px
        return math.inf if counted is None else counted


@dataclass(frozen=True)
class SuspectLabel:
    """A marking whose label looks wrong: the solver left it out and says what fits.

    ``suggested`` is the class that fits, or None when none does.
    """

    marking: str
    suggested: str | None
    confidence: float
    error_px: float
    """Largest distance of its points under the annotated class, pixels."""
    suggested_error_px: float | None = None


@dataclass(frozen=True)
class PictureDistortion:
    """What seems to have been done to a picture since a camera took it.

    Attributes:
        stretch: How much too wide its pixels are, as a share; negative: too narrow.
        shift: Of the optical axis from the middle of the picture, right and down, in half
            diagonals.
        sigma: Standard deviations of the three.
        ratio: F ratio of what they explain: about 1 by chance.
    """

    stretch: float
    shift: tuple[float, float]
    sigma: tuple[float, ...]
    ratio: float


@dataclass(frozen=True)
class OtherPitch:
    """Another size of the pitch, which the lines of a frame alone show.

    Attributes:
        size: Length and width that they show, metres.
        used: Length and width that the camera was found on, metres.
        off_m: How far the one of both that is clearer lies from the one in use.
        threshold_m: It counts beyond this.
        explains: Markings that look mislabelled on the one in use and lie where this pitch has them.
    """

    size: tuple[float, float]
    used: tuple[float, float]
    off_m: float
    threshold_m: float
    explains: tuple[str, ...] = ()


@dataclass(frozen=True)
class PaintFit:
    """How a camera and the paint of its picture agree.

    Attributes:
        supported: Share of the visible markings that have paint; None where it was not measured.
        explained: Share of the line-like paint that lies near a marking.
        points: Places of paint that were read along the markings.
        error_px: Median distance of them from the markings, pixels; None where the camera is not
            that of the paint.
        reason: Why it is not: ``no_paint``, ``paint_disagrees`` or ``no_frame``.
    """

    supported: float | None
    explained: float | None
    points: int
    error_px: float | None = None
    reason: str | None = None

    @property
    def agreement(self) -> float | None:
        """Supported times explained, 0 to 1; None where nothing was measured."""
        if self.supported is None or self.explained is None:
            return None
        return self.supported * self.explained


@dataclass(frozen=True)
class Calibration:
    """The camera of one view (or station), and how well it is known.

    Attributes:
        source: ``given``, ``lines`` or ``paint``.
        camera: None when the lines do not determine one; ``reason`` then says why.
        jac: JaC for each of ``GAMMAS_PERCENT``; None when there are no lines to measure it.
        error_px: Median distance of the annotated points, pixels.
        covariance: Of pan, tilt, roll, position, log focal length and kappa (see
            ``geometry.resection``), 8 x 8, row by row; None for a given camera of which
            nothing more is known, or where the lines leave a combination open.
        unobservable: Parameters that the lines do not determine, in words.
        picture: How the picture was stretched or cropped, where the lines say so; the camera is
            found as if it were not.
        paint: How it and the paint agree, where that was read for the same clicks.
        picture_covariance: Of a stretched or cropped picture: of the eight numbers of the camera as
            the picture was taken, the logarithm of the aspect and both shifts, 11 x 11, row by row.
            ``covariance`` is the nearest that eight numbers can say.
        pitch_covariance: What ``covariance`` lacks where a camera was placed by paint: what nobody
            knows of the pitch (its size, how it is laid and painted), 8 x 8, row by row. All cameras
            of a match have it in common, so it says nothing of how their rays miss each other.
        goal: Which line of the goals and of the paint the distances are to; JaC is told by inner edges
            and the plan.
        mirrored_px: Largest distance of its points, pixels, once left and right are exchanged in the
            names of its markings, where only then a camera can stand where it does.
        other_pitch: The one that the lines of a frame alone show; the camera is found on that in use.
    """

    source: str
    camera: Camera | None
    reason: str | None = None
    jac: tuple[float, ...] | None = None
    error_px: float | None = None
    markings: tuple[MarkingFit, ...] = ()
    suspects: tuple[SuspectLabel, ...] = ()
    covariance: tuple[float, ...] | None = None
    unobservable: tuple[str, ...] = ()
    picture: PictureDistortion | None = None
    paint: PaintFit | None = field(default=None, metadata={"later": True})
    picture_covariance: tuple[float, ...] | None = field(default=None, metadata={"later": True})
    pitch_covariance: tuple[float, ...] | None = field(default=None, metadata={"later": True})
    goal: GoalEdge = field(default="inner", metadata={"later": True})
    mirrored_px: float | None = field(default=None, metadata={"later": True})
    other_pitch: OtherPitch | None = field(default=None, metadata={"later": True})

    @property
    def has_known_covariance(self) -> bool:
        """Whether a covariance says how exact the camera is; one of zeros says nothing."""
        return self.covariance is not None and sum(self.covariance[::9]) > 0

    @property
    def known_covariance_with_pitch(self) -> tuple[float, ...] | None:
        """How exact the camera is, with what is not known of the pitch: as files and documents say it."""
        known = self.covariance if self.camera is not None and self.has_known_covariance else None
        if known is None or not all(map(math.isfinite, known)):
            return None
        return tuple(map(sum, zip(known, self.pitch_covariance or [0.0] * 64, strict=True)))

    @property
    def is_left_open(self) -> bool:
        """Whether its lines leave the camera open: they have no covariance that says how exact it is."""
        found = self.camera is not None and self.source != "given"
        return found and not self.has_known_covariance

    @property
    def is_given_without_uncertainty(self) -> bool:
        """Whether the camera came with the data and nobody says how exact it is."""
        return self.source == "given" and not self.has_known_covariance

    @property
    def agreement(self) -> float | None:
        """Of the camera with its paint, 0 to 1; None where none was read for the same clicks."""
        return None if self.paint is None or self.camera is None else self.paint.agreement

    @property
    def position_sigma_m(self) -> float | None:
        """Standard deviation of the camera's position, all axes together; None if unknown."""
        if self.covariance is None:
            return None
        return math.sqrt(sum(self.covariance[axis * 9] for axis in (3, 4, 5)))


@dataclass(frozen=True)
class TriangulatedPair:
    """The ball triangulated from two views.

    Attributes:
        a: Key of the first view; ``b`` of the second.
        point: Pitch frame, metres.
        errors_px: Reprojection error in view a and in view b.
        valid: Both errors below tau and the cameras far enough apart.
        failed: Name of the gate that made it invalid, or None.
    """

    a: str
    b: str
    point: tuple[float, float, float]
    errors_px: tuple[float, float]
    baseline_m: float
    parallax_degrees: float
    valid: bool
    failed: str | None = None


@dataclass(frozen=True)
class Ball3D:
    """The triangulated ball: mean of the valid pairs, pitch frame, metres, z down."""

    point: tuple[float, float, float]
    covariance: tuple[float, ...]
    """3 x 3, row by row, square metres."""
    sigma_m: float
    """Standard deviation along the longest axis of the covariance."""
    parallax_degrees: float
    """The largest over the valid pairs, at ``point``."""
    views: tuple[str, ...]
    """Views in a valid pair."""

    @property
    def height_m(self) -> float:
        """Above the grass, metres."""
        return height_above_grass(self.point[2])


@dataclass(frozen=True)
class ChiSquare:
    """Whether the residuals of the most likely ball are as small as their uncertainty says."""

    value: float
    """Sum of the squared residuals over the views of valid pairs, each in units of its sigma."""
    freedom: int
    """Degrees of freedom: two for each view, less three of the ball."""
    p_value: float
    """How often chance alone makes residuals as large as these, 0 to 1."""
    views: tuple[str, ...]
    """Views that were tested together."""


@dataclass(frozen=True)
class BestBall:
    """The maximum-likelihood ball over all views, pitch frame, metres, z down."""

    point: tuple[float, float, float]
    covariance: tuple[float, ...]
    """3 x 3, row by row, square metres."""
    sigma_m: float
    """Standard deviation along the longest axis of the covariance."""
    views: tuple[str, ...]
    """Views that the point rests on."""
    contradicting: tuple[str, ...] = ()
    """Views left out because they contradict the others."""
    influence_m: tuple[tuple[str, float], ...] = ()
    """How far the point moves when that view is left out; empty with two views."""

    @property
    def height_m(self) -> float:
        """Above the grass, metres."""
        return height_above_grass(self.point[2])


@dataclass(frozen=True)
class BallFit:
    """The 3D ball seen again in one view."""

    reprojected: ImagePoint | None
    error_px: float | None
    """Annotated centre to reprojection."""
    error_percent: float | None
    """The same in per cent of the diagonal."""
    optimized_diameter_px: float | None
    """d* of the paper's square; None when the point lies behind the camera."""
    optimized_box: Box | None
    """Square of side d* around the annotated centre."""
    optimized_error_m: float | None
    """Distance of the point from the ray of the annotated centre."""
    exact_box: Box | None
    """Tight box of the sphere's outline."""
    size_ratio: float | None
    """Annotated diameter over optimised diameter; None for a point annotation."""
    depth_m: float | None
    """Distance of the ball along the optical axis."""
    monocular: tuple[float, float, float] | None = None
    """Where this view alone puts the ball, from its annotated box; None for a point."""
    monocular_error_m: float | None = None
    """Distance of that place from the triangulated ball."""
    depth_per_px_m: float | None = None
    """Metres that the monocular ball moves along the axis for one pixel of diameter."""


@dataclass(frozen=True)
class ExpectedBall:
    """Where a view should show the 3D ball, whether or not anybody annotated it there."""

    place: ImagePoint
    covariance: tuple[float, ...]
    """Of ``place``, 2 x 2, row by row, square pixels: the ball's and the camera's uncertainty."""
    box: Box | None
    """Tight box of the ball's outline."""


@dataclass(frozen=True)
class ViewSolution:
    """What was computed for one view.

    ``compute_calibration_key`` names the calibration among others of the same lines and policy.
    """

    view: str
    calibration: Calibration
    calibration_key: str
    included: bool
    """In a valid pair."""
    failed: str | None
    """First gate that dropped this view, or None."""
    ball: BallFit | None = None
    """How the annotated ball agrees with the 3D ball."""
    expected: ExpectedBall | None = None
    """Where the 3D ball is to be seen; None without a camera, and where it is not in front of it."""


def compute_margin(value: float, threshold: float | None, *, at_most: bool = False) -> float | None:
    """How far a value is from its threshold, as a share of the threshold.

    Shares of different gates compare with each other, which metres and pixels do not.

    Args:
        value: What was measured.
        threshold: What is asked, in the unit of the value; None when nothing is asked.
        at_most: Whether less is better: the threshold is the largest value that is allowed.

    Returns:
        0.25 when the value is better than asked by a quarter of the threshold, -0.25 when it
        is worse by as much, 0 at the threshold. None where there is no share: nothing is asked,
        the threshold is 0, or the value is infinite or NaN.

    Example:
        >>> compute_margin(15.0, 10.0), compute_margin(15.0, 10.0, at_most=True), compute_margin(15.0, 0.0)
        (0.5, -0.5, None)
    """
    if not threshold:
        return None
    share = (threshold - value if at_most else value - threshold) / abs(threshold)
    return float(share) if math.isfinite(share) else None


@dataclass(frozen=True)
class Gate:
    """One gate as judged for the group.

    ``margin`` is how far the value is from the threshold, as a share of it.

    Attributes:
        margin: Distance of the value from the threshold, as a share of the threshold: 0.25 is
            better than required by a quarter of the threshold, -0.25 worse by a quarter. None if
            the gate is off or not judged, or if the threshold is 0.
    """

    name: str
    passed: bool
    value: float | None
    threshold: float | None
    margin: float | None
    sentence: str
    view: str | None = None
    active: bool = True
    """False when the policy does not ask for it."""


@dataclass(frozen=True)
class Solution:
    """Everything computed for one group under one policy.

    ``ball`` is the one that leaves, and that boxes and errors follow. Where the policy asks for
    the most likely point, ``compute_mean_ball`` is the mean of the valid pairs in whose place it stands.
    """

    views: tuple[ViewSolution, ...]
    pairs: tuple[TriangulatedPair, ...]
    ball: Ball3D | None
    gates: tuple[Gate, ...]
    findings: tuple[Finding, ...] = ()
    best_ball: BestBall | None = None
    chi_square: ChiSquare | None = None
    mean_ball: Ball3D | None = None
    policy_hash: str = ""
    solver_version: str = field(default=SOLVER_VERSION)

    @property
    def point(self) -> str:
        """Which 3D ball leaves, as the policy names it: ``mean`` or ``best``."""
        return "mean" if self.mean_ball is None else "best"

    @property
    def passes(self) -> bool:
        """Whether every active gate is passed."""
        return all(gate.passed for gate in self.gates if gate.active)

    @property
    def unusable_ball_finding(self) -> Finding | None:
        """Why nobody can use the ball, or None."""
        return next((item for item in self.findings if item.is_unusable_ball), None)

    @property
    def first_failing(self) -> Gate | None:
        """The gate to name to a person, or None when the group passes.

        The solver orders it: where a group is short of views because some fell at the first
        gates of views, that earlier gate is the one that failed.
        """
        return next((gate for gate in self.gates if gate.active and not gate.passed), None)

    def view(self, key: str) -> ViewSolution | None:
        """The solution of the view of that key, or None."""
        return next((view for view in self.views if view.view == key), None)
