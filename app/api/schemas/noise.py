"""The noise of a dataset as its own residuals tell."""

from __future__ import annotations

from pydantic import Field

from app.api.schemas.document import Document
from app.review.policies.noise import Advice
from app.solving.ball_noise import Sigma
from app.solving.line_noise import Interval


class SigmaDocument(Document, shows=Sigma):
    """An estimated standard deviation, pixels at 1920 x 1080."""

    low: float = Field(description="End of the 95 % interval.")
    numbers: int = Field(description="Independent numbers that rays leave unexplained.")
    left_out: int = Field(description="Those among them that noise does not explain.")


class BallNoiseDocument(Document):
    """Noise of annotated balls; null where no groups say anything."""

    click: SigmaDocument | None = Field(description="Of a coordinate of a ball's centre.")
    share: float | None = Field(description="What the ball's diameter adds, as a share of it.")
    given: SigmaDocument | None = Field(
        description="What a given camera of unknown exactness adds."
    )


class SourceNoiseDocument(Document):
    """Noise of the balls of a static camera or of a person, drawn towards the dataset's."""

    source: str = Field(description="Key of the station, or name of the person.")
    sigma_px: float = Field(description="Of a coordinate of a ball, pixels at 1920 x 1080.")
    low: float = Field(description="End of the 95 % interval.")
    high: float
    ratio: float = Field(description="Of that to the dataset's.")
    numbers: float = Field(description="Independent numbers that speak of it alone.")
    differs: bool = Field(description="The interval leaves out the dataset's sigma.")


class IntervalDocument(Document, shows=Interval):
    """A number with the ends of its 95 % interval."""


class LineEstimateDocument(Document):
    """Noise of clicks on field lines, from all images together."""

    sigma: IntervalDocument = Field(description="Of a point, pixels at 960 x 540.")
    share: IntervalDocument = Field(
        description="Of its variance, what the points of a marking have in common."
    )
    views: int = Field(description="Images that it rests on.")


class AdviceDocument(Document, shows=Advice):
    """A threshold of the policy and what the dataset says of it."""

    present: float | None = Field(description="Null: the policy leaves it to each image.")
    agrees: bool = Field(description="The interval holds the present value.")


class FactorDocument(Document):
    """How noisy balls of a camera that a person places are beside the dataset's."""

    camera: str | None = Field(description="Key of a static camera; null: any other.")
    person: str | None = Field(description="Who places the ball; null: anybody else.")
    ratio: float = Field(description="Of both sigmas; one where they may be alike.")


class NoiseDocument(Document):
    """Estimates, and the thresholds that would make the policy agree."""

    groups: int = Field(description="Groups that were looked at.")
    solved: int = Field(description="Groups with a solution.")
    ball: BallNoiseDocument
    stations: list[SourceNoiseDocument] = Field(
        description="Static cameras of which enough is seen, the noisiest first."
    )
    people: list[SourceNoiseDocument] = Field(description="The same of who placed balls last.")
    factors: list[FactorDocument] = Field(
        description="Of cameras and people together; empty where all may be like the dataset."
    )
    used: list[FactorDocument] = Field(description="Those that sigma uses now.")
    is_new: bool = Field(description="`factors` say something else than `used`.")
    line_estimate: LineEstimateDocument | None = Field(
        description="Null where no lines make a camera."
    )
    follows: bool = Field(
        description="The policy uses the estimates: each solve of the dataset sets them."
    )
    advice: list[AdviceDocument]
    values: dict[str, float] = Field(
        description="To be sent to the policy; empty where it agrees already."
    )
    notices: list[str] = Field(description="What a person should know.")
