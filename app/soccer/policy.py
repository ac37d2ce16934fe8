"""Policy: every threshold that decides what is computed and what enters a dataset."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal, TypeVar

from app.geometry.arrays import FloatArray
from app.soccer.pitch import Pitch
from app.soccer.solution import GAMMAS_PERCENT, GATES

Pixels = TypeVar("Pixels", float, FloatArray)

CALIBRATION = "calibration"
"""Name of the policy's part that calibrations depend on; its thresholds are dotted."""
BOXES, FINDINGS, NOISE, PITCH = "boxes", "findings", "noise", "pitch"
FIXED: Literal["fixed"] = "fixed"
ESTIMATED: Literal["estimated"] = "estimated"
SUBJECTS = (*GATES, BOXES, FINDINGS, NOISE, PITCH, CALIBRATION)
"""What a threshold can be about, in the order in which people read a policy."""


def _threshold_field(
    default: float | bool | str | None,
    subject: str,
    label: str,
    unit: str = "",
    minimum: float | None = None,
    maximum: float | None = None,
    choices: tuple[float | str, ...] = (),
    later: bool = False,
    shown: bool = True,
) -> Any:
    """A field of a policy with what ``Threshold`` says of it; ``shown``: whether its ``repr`` has it."""
    known = {
        "subject": subject,
        "label": label,
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "choices": choices,
        "later": later,
    }
    return field(default=default, metadata=known, repr=shown)


@dataclass(frozen=True)
class CalibrationPolicy:
    """The part of the policy that a view's calibration depends on."""

    robust_scale_px: float = _threshold_field(
        2.0, CALIBRATION, "Scale of the robust loss", "px at 960x540", 0.2, 20.0
    )
    """Scale of the soft-L1 loss at 960 x 540; grows with the diagonal."""
    distortion_mean: float = _threshold_field(
        0.025, CALIBRATION, "Expected distortion", "", -0.3, 0.3
    )
    """Mean of the prior on kappa, the displacement at the image's corner as a share of half the
    diagonal: broadcast lenses show pincushion."""
    distortion_sigma: float = _threshold_field(
        0.03, CALIBRATION, "Standard deviation of the distortion", "", 0.001, 0.5
    )
    """Standard deviation of that prior."""
    check_labels: bool = _threshold_field(True, CALIBRATION, "Leave out markings found mislabelled")
    """Leave out markings that are found mislabelled."""
    share_position: bool = _threshold_field(
        False, CALIBRATION, "Use the shared position of a match", later=True, shown=False
    )
    """Where the main camera stands is known from the match's other pictures, where that was
    accepted. Not in the ``repr``, which keys calibrations: they are keyed by the position itself."""
    source: Literal["lines", "paint"] = _threshold_field(
        "lines",
        CALIBRATION,
        "Source of cameras",
        choices=("lines", "paint"),
        later=True,
        shown=False,
    )
    """``lines``: what was clicked; ``paint``: started by the clicks, drawn onto what was read of the
    paint in the picture. Not in the ``repr`` either: calibrations are keyed by what was read."""
    line_sigma_px: float | None = _threshold_field(
        None,
        CALIBRATION,
        "Sigma of a point on a line",
        "px at 960x540",
        0.1,
        10.0,
        later=True,
        shown=False,
    )
    """Of a clicked point across its marking, about which images differ; None: what real annotations
    show, and each image by itself. Not in the ``repr``: ``compute_calibration_key`` knows it where it is set."""
    line_share: float | None = _threshold_field(
        None,
        CALIBRATION,
        "Share of this variance common to a marking",
        "share",
        0.0,
        0.95,
        later=True,
        shown=False,
    )
    """What the points of a marking have in common of that variance; None: weighed image by image."""
    shortest_marking_px: float = _threshold_field(
        0.0,
        CALIBRATION,
        "Shortest undrawn marking that JaC counts as missing",
        "px at 960x540",
        0.0,
        50.0,
        later=True,
        shown=False,
    )
    """0: each one, as the public evaluator does. Stubs of a few pixels at the border of a picture
    are none that people draw. Not in the ``repr``: ``compute_calibration_key`` knows it where it is set."""

    lone_frames: Literal["exact", "professional", "any"] = _threshold_field(
        "exact",
        CALIBRATION,
        "Pitch and picture of single frames",
        choices=("exact", "professional", "any"),
        later=True,
        shown=False,
    )
    """What nobody says of the pitch and the picture of a frame without a match and other views: ``exact``, they are
    as they stand here; ``professional``, the pitch is that of some professional club; ``any``, it is
    as the Laws allow, and the picture may have been stretched or cropped. Not in the ``repr``: what
    it makes of a calibration has a key of its own."""

    goal: Literal["inner", "middle", "laws"] = _threshold_field(
        "inner",
        CALIBRATION,
        "Clicked edge of goals and lines",
        choices=("inner", "middle", "laws"),
        later=True,
        shown=False,
    )
    """``inner``: the inner edges of posts and crossbar, as the public evaluator has them;
    ``middle``: their middle, where people click; ``laws``: that, and lines half their width
    inside the plan, as the Laws measure to outer edges. JaC asks for the inner edges and the plan
    in any case. Not in the ``repr``: ``compute_calibration_key`` knows it where it is another."""

    weighed: Literal["points", "markings"] = _threshold_field(
        "points",
        CALIBRATION,
        "Equal weight in a camera's fit for",
        choices=("points", "markings"),
        later=True,
        shown=False,
    )
    """``points``: each one, as if they erred each by itself; ``markings``: those of a marking err together,
    so that many of one say less than as many of several (``observations.SHARED_SHARE``). Not in the
    ``repr``: ``compute_calibration_key`` knows it where it is set."""

    def pitch_for_fitted_lines(self, pitch: Pitch) -> Pitch:
        """A pitch with the goals and lines that are fitted."""
        return pitch.with_goal_edge(self.goal)

    def pitch_for_paint(self, pitch: Pitch) -> Pitch:
        """A pitch with the lines that paint is fitted to where nothing was clicked; goals are not painted."""
        return pitch.with_goal_edge(self.goal) if self.goal == "laws" else pitch

    @cached_property
    def cached_repr(self) -> str:
        """The ``repr``, which every key of a calibration has: spelt out once."""
        return repr(self)


@dataclass(frozen=True)
class Policy:
    """All thresholds as one hashable value, stored with each solution.

    Per cent are of the image diagonal, so that one value means the same at every resolution.
    """

    name: str = "paper"
    calibration: CalibrationPolicy = field(default_factory=CalibrationPolicy)
    jac_gamma_percent: float = _threshold_field(
        0.5,
        "jac",
        "Tolerance of the field lines",
        "% of diagonal",
        0.1,
        5.0,
        choices=GAMMAS_PERCENT,
    )
    min_jac: float = _threshold_field(
        0.75, "jac", "Smallest share of field lines that fit", "", 0.0, 1.0
    )
    """A view qualifies strictly above."""
    min_agreement: float | None = _threshold_field(
        None, "agreement", "Smallest agreement with the paint", "", 0.0, 1.0, later=True
    )
    """Supported times explained of a view whose paint was read; a view falls below."""
    tau_percent: float = _threshold_field(
        1.0, "reprojection", "Largest reprojection error", "% of diagonal", 0.05, 5.0
    )
    min_baseline_m: float = _threshold_field(1.0, "baseline", "Smallest baseline", "m", 0.0, 50.0)
    ball_diameter_m: float = _threshold_field(0.226, BOXES, "Diameter of the ball", "m", 0.2, 0.25)
    point: Literal["mean", "best"] = _threshold_field(
        "mean", BOXES, "Exported 3D point", choices=("mean", "best"), later=True
    )
    """``mean`` of the valid pairs, as in the paper, or ``best``: the most likely point over all
    views. Boxes, errors and exports follow it; the gates judge the mean."""
    min_parallax_degrees: float | None = _threshold_field(
        None, "parallax", "Smallest parallax", "degrees", 0.0, 45.0
    )
    max_sigma_m: float | None = _threshold_field(
        None, "sigma", "Largest sigma of the position", "m", 0.01, 5.0
    )
    min_p_value: float | None = _threshold_field(
        None, "chi_square", "Smallest p-value of the residuals", "", 0.0, 0.01, later=True
    )
    """How unlikely by chance alone the residuals of the views in valid pairs may be."""
    low_parallax_degrees: float = _threshold_field(
        5.0, FINDINGS, "Finding: parallax below", "degrees", 0.0, 45.0
    )
    """Below: the finding ``low_parallax``; it is no gate of the policy ``paper``."""
    noise: Literal["fixed", "estimated"] = _threshold_field(
        FIXED, NOISE, "Noise of clicks", choices=(FIXED, ESTIMATED), later=True
    )
    """``fixed``: the sigmas of clicks are those that stand here, as in the paper; ``estimated``: they
    are the dataset's own, and solving it sets them."""
    click_sigma_px: float = _threshold_field(
        1.0, NOISE, "Sigma of a clicked ball", "px at 1920x1080", 0.1, 10.0
    )
    """Standard deviation of an annotated ball centre at 1920 x 1080; grows with the diagonal."""
    box_sigma_share: float = _threshold_field(
        0.04, NOISE, "Sigma of a ball, relative to its diameter", "share", 0.0, 0.5
    )
    """What the diameter of a ball's box adds to that standard deviation, as a share of it."""
    given_sigma_px: float = _threshold_field(
        0.0,
        NOISE,
        "Sigma of a ball due to a given camera",
        "px at 1920x1080",
        0.0,
        30.0,
        later=True,
    )
    """What a given camera of unknown exactness adds to it, in pixels of the ball's image."""
    below_grass_m: float = _threshold_field(
        0.5, FINDINGS, "Finding: below the grass by more than", "m", 0.0, 5.0
    )
    max_height_m: float = _threshold_field(40.0, FINDINGS, "Finding: higher than", "m", 1.0, 100.0)
    outside_pitch_m: float = _threshold_field(
        10.0, FINDINGS, "Finding: outside the pitch by more than", "m", 0.0, 50.0
    )
    pitch_length_m: float = _threshold_field(
        105.0, PITCH, "Length of the pitch, without effect: a match has its own", "m", 90.0, 120.0
    )
    pitch_width_m: float = _threshold_field(
        68.0, PITCH, "Width of the pitch, without effect: a match has its own", "m", 45.0, 90.0
    )

    def tau_px(self, diagonal: Pixels) -> Pixels:
        """Largest reprojection error of a valid pair in views of these diagonals, pixels both."""
        return self.tau_percent / 100 * diagonal

    @cached_property
    def hash(self) -> str:
        """Digest of every value but the name."""
        return _digest_of_values(collect_digested_values(self))

    @cached_property
    def calibration_hash(self) -> str:
        """Digest of what a calibration depends on."""
        return _digest_of_values(collect_digested_calibration_values(self.calibration))


def collect_digested_values(policy: Policy) -> dict[str, Any]:
    """What the digests of a policy cover: every value but the name.

    A threshold that came later counts only where it asks for something else than before it came:
    the hash of a policy, and of each version that was frozen with it, stays what it was.
    """
    values = _values_without_later_defaults(policy)
    del values["name"]
    values["calibration"] = collect_digested_calibration_values(policy.calibration)
    return values


def collect_digested_calibration_values(policy: CalibrationPolicy) -> dict[str, Any]:
    """The same of its part for calibrations."""
    return _values_without_later_defaults(policy)


def _values_without_later_defaults(policy: Policy | CalibrationPolicy) -> dict[str, Any]:
    values = asdict(policy)
    for item in fields(policy):
        if item.metadata.get("later") and values[item.name] == item.default:
            del values[item.name]
    return values


PAPER = Policy()
CLICKED = CalibrationPolicy(goal="middle", weighed="markings")
"""How the commands without a dataset calibrate: as ``paper``, with goals where people click them, and
clicks of a marking as they err, together."""
STRICT = Policy(name="strict", calibration=CLICKED, min_parallax_degrees=5.0, max_sigma_m=0.5)
TOUCHLINE = Policy(
    name="touchline",
    noise=ESTIMATED,
    calibration=replace(CLICKED, source="paint", shortest_marking_px=5.0, lone_frames="any"),
)
"""As ``paper``, with cameras from the paint of their pictures, goals where people click them, stubs
that nobody draws not counted as missing, unsure of what nobody says of frames alone, and the noise
that its dataset shows."""
POLICIES = {policy.name: policy for policy in (PAPER, STRICT, TOUCHLINE)}
SIGMAS = ("click_sigma_px", "box_sigma_share", "given_sigma_px")
LINE_SIGMAS = ("line_sigma_px", "line_share")
"""What is estimated of a dataset: of its balls, and of the lines that cameras are made from."""


def copy_click_sigmas(policy: Policy, other: Policy) -> Policy:
    """A policy with the noise of clicks that another one has."""
    lines = {name: getattr(other.calibration, name) for name in LINE_SIGMAS}
    balls = {name: getattr(other, name) for name in SIGMAS}
    return replace(policy, **balls, calibration=replace(policy.calibration, **lines))


def is_builtin_policy(policy: Policy) -> bool:
    """Whether a policy is the shipped one of its name; what is estimated is every dataset's own."""
    shipped = POLICIES.get(policy.name)
    if shipped is not None and shipped.noise == ESTIMATED:
        policy = copy_click_sigmas(policy, shipped)
    return policy == shipped


def _digest_of_values(values: object) -> str:
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
