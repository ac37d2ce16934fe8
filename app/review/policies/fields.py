"""What each threshold of a policy is called, measured in, and between which ends it makes sense."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.soccer.policy import PAPER, Policy

CALIBRATION = "calibration"
"""Name of the policy's part that calibrations depend on; its fields are dotted."""


@dataclass(frozen=True)
class PolicyField:
    """One threshold.

    Attributes:
        name: As in the policy; those of the calibration's part as ``calibration.name``.
        gate: The gate that it decides, or None.
        optional: Whether it can be null, which asks for nothing.
    """

    name: str
    label: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    gate: str | None = None
    optional: bool = False

    @property
    def default(self) -> float | bool | None:
        """Its value in the policy ``paper``."""
        value: float | bool | None = value_of(PAPER, self.name)
        return value


def value_of(policy: Policy, name: str) -> Any:
    """A threshold of a policy by its dotted name."""
    value: Any = policy
    for part in name.split("."):
        value = getattr(value, part)
    return value


FIELDS = (
    PolicyField(
        "jac_gamma_percent", "Tolerance of the field lines", "% of diagonal", 0.1, 5.0, "jac"
    ),
    PolicyField("min_jac", "Share of field lines that fit", "", 0.0, 1.0, "jac"),
    PolicyField("min_baseline_m", "Smallest baseline", "m", 0.0, 50.0, "baseline"),
    PolicyField(
        "tau_percent", "Largest reprojection error", "% of diagonal", 0.05, 5.0, "reprojection"
    ),
    PolicyField(
        "min_parallax_degrees", "Smallest parallax", "degrees", 0.0, 45.0, "parallax", True
    ),
    PolicyField("max_sigma_m", "Largest sigma of the position", "m", 0.01, 5.0, "sigma", True),
    PolicyField("ball_diameter_m", "Diameter of the ball", "m", 0.2, 0.25),
    PolicyField("low_parallax_degrees", "Finding: parallax below", "degrees", 0.0, 45.0),
    PolicyField("below_grass_m", "Finding: below the grass by more than", "m", 0.0, 5.0),
    PolicyField("max_height_m", "Finding: higher than", "m", 1.0, 100.0),
    PolicyField("outside_pitch_m", "Finding: outside the pitch by more than", "m", 0.0, 50.0),
    PolicyField("click_sigma_px", "Sigma of a clicked ball", "px at 1920x1080", 0.1, 10.0),
    PolicyField("box_sigma_share", "Sigma of a ball, of its diameter", "share", 0.0, 0.5),
    PolicyField("pitch_length_m", "Length of the pitch, where none is known", "m", 90.0, 120.0),
    PolicyField("pitch_width_m", "Width of the pitch, where none is known", "m", 45.0, 90.0),
    PolicyField(
        "calibration.robust_scale_px", "Scale of the robust loss", "px at 960x540", 0.2, 20
    ),
    PolicyField("calibration.distortion_mean", "Distortion that is expected", "", -0.3, 0.3),
    PolicyField("calibration.distortion_sigma", "Its standard deviation", "", 0.001, 0.5),
    PolicyField("calibration.check_labels", "Leave out markings found mislabelled"),
)
"""Every threshold, those of the gates first and in their order."""
BY_NAME = {field.name: field for field in FIELDS}
