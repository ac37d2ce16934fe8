"""The noise of a dataset as its own residuals tell."""

from __future__ import annotations

from pydantic import Field

from app.api.schemas.document import Document


class SigmaDocument(Document):
    """An estimated standard deviation, pixels at 1920 x 1080."""

    value: float
    low: float = Field(description="End of the 95 % interval.")
    high: float
    numbers: int = Field(description="Independent numbers that rays leave unexplained.")
    left_out: int = Field(description="Those among them that noise does not explain.")


class BallNoiseDocument(Document):
    """Noise of annotated balls; null where too few groups say anything."""

    click: SigmaDocument | None = Field(description="Of a coordinate of a ball's centre.")
    share: float | None = Field(description="What the ball's diameter adds, as a share of it.")
    given: SigmaDocument | None = Field(
        description="What a given camera of unknown exactness adds."
    )


class LineNoiseDocument(Document):
    """Noise of clicks on field lines: medians over images."""

    sigma_px: float = Field(description="Pixels at 960 x 540.")
    low: float = Field(description="Half of the images lie between this and `high`.")
    high: float
    share: float = Field(description="Of the variance, what points of a marking have in common.")
    views: int


class AdviceDocument(Document):
    """A threshold of the policy and what the dataset says of it."""

    name: str
    label: str
    unit: str
    present: float
    estimate: float
    low: float
    high: float
    agrees: bool = Field(description="The interval holds the present value.")


class NoiseDocument(Document):
    """Estimates, and the thresholds that would make the policy agree."""

    groups: int = Field(description="Groups that were looked at.")
    solved: int = Field(description="Groups with a solution.")
    ball: BallNoiseDocument
    lines: LineNoiseDocument | None
    advice: list[AdviceDocument]
    values: dict[str, float] = Field(
        description="To be sent to the policy; empty where it agrees already."
    )
    notices: list[str] = Field(description="What a person should know.")
