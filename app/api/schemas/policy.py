"""A policy as it travels: every threshold, its name and its hash."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

from app.soccer.policy import THRESHOLDS, CalibrationPolicy, Policy


class PolicyEdit(BaseModel):
    """The policy that a dataset shall be judged by, by its name."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{"name": "strict"}]})

    name: Literal["paper", "strict"]


class PolicyDocument(BaseModel):
    """All thresholds; per cent are of the image diagonal."""

    name: str
    hash: str = Field(description="Digest of every value but the name.")
    calibration: CalibrationPolicy = Field(description="What a view's calibration depends on.")
    jac_gamma_percent: float
    min_jac: float
    tau_percent: float
    min_baseline_m: float
    ball_diameter_m: float
    min_parallax_degrees: float | None
    max_sigma_m: float | None
    low_parallax_degrees: float
    click_sigma_px: float
    box_sigma_share: float
    below_grass_m: float
    max_height_m: float
    outside_pitch_m: float
    pitch_length_m: float
    pitch_width_m: float

    @staticmethod
    def of(policy: Policy) -> PolicyDocument:
        """The document of a policy."""
        values = {name: getattr(policy, name) for name in THRESHOLDS}
        return PolicyDocument.model_construct(
            name=policy.name,
            hash=policy.hash,
            calibration=policy.calibration,
            **values,
        )
