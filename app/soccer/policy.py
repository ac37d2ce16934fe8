"""Policy: every threshold that decides what is computed and what enters a dataset."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, fields


@dataclass(frozen=True)
class CalibrationPolicy:
    """The part of the policy that a view's calibration depends on."""

    robust_scale_px: float = 2.0
    """Scale of the soft-L1 loss at 960 x 540; grows with the diagonal."""
    distortion_mean: float = 0.025
    """Mean of the prior on kappa, the displacement at the image's corner as a share of half the
    diagonal: broadcast lenses show pincushion."""
    distortion_sigma: float = 0.03
    """Standard deviation of that prior."""
    check_labels: bool = True
    """Leave out markings that are found mislabelled."""


@dataclass(frozen=True)
class Policy:
    """All thresholds as one hashable value, stored with each solution.

    Per cent are of the image diagonal, so that one value means the same at every resolution.
    """

    name: str = "paper"
    calibration: CalibrationPolicy = field(default_factory=CalibrationPolicy)
    jac_gamma_percent: float = 0.5
    min_jac: float = 0.75
    """A view qualifies strictly above."""
    tau_percent: float = 1.0
    min_baseline_m: float = 1.0
    ball_diameter_m: float = 0.226
    min_parallax_degrees: float | None = None
    max_sigma_m: float | None = None
    low_parallax_degrees: float = 5.0
    """Below: the finding ``low_parallax``; it is no gate of the policy ``paper``."""
    click_sigma_px: float = 1.0
    """Standard deviation of an annotated ball centre at 1920 x 1080; grows with the diagonal."""
    box_sigma_share: float = 0.04
    """What the diameter of a ball's box adds to that standard deviation, as a share of it."""
    below_grass_m: float = 0.5
    max_height_m: float = 40.0
    outside_pitch_m: float = 10.0
    pitch_length_m: float = 105.0
    pitch_width_m: float = 68.0

    @property
    def hash(self) -> str:
        """Digest of every value but the name."""
        values = asdict(self)
        del values["name"]
        return _digest(values)

    @property
    def calibration_hash(self) -> str:
        """Digest of what a calibration depends on."""
        return _digest(asdict(self.calibration))


PAPER = Policy()
STRICT = Policy(name="strict", min_parallax_degrees=5.0, max_sigma_m=0.5)
POLICIES = {policy.name: policy for policy in (PAPER, STRICT)}
THRESHOLDS = tuple(item.name for item in fields(Policy) if item.name not in ("name", "calibration"))


def _digest(values: object) -> str:
    text = json.dumps(values, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:16]
