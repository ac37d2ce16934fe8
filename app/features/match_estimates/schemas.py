"""Documents of estimates of a match: picture, position, rig, noise."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from app.features.groups.schemas import PictureEdit
from app.features.match_estimates.positions import PositionState
from app.features.match_estimates.queries import MatchPictures
from app.features.policies.noise import Advice
from app.http.documents import Document, ListDocument
from app.solving.ball_noise import Sigma
from app.solving.line_noise import LineEstimate


class MatchPicturesDocument(ListDocument[MatchPictures]):
    """The pictures of a dataset's matches, by name of the match."""


class MatchRequest(BaseModel):
    """Which matches a job is to look at."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    match: str | None = Field(
        default=None, min_length=1, max_length=1000, description="This match alone; null: all."
    )


class MatchPictureChange(BaseModel):
    """Say what was done to the pictures of a match's main camera."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"match": "a/b/c", "picture": None}]}
    )

    match: str = Field(min_length=1, max_length=1000)
    picture: PictureEdit | None = Field(description="As proposed; null: as they were taken.")


class SharedPositionsDocument(ListDocument[PositionState]):
    """The shared positions of a dataset's matches, by name of the match."""

    used: bool = Field(description="Whether the policy uses them: `calibration.share_position`.")


class RigRequest(BaseModel):
    """Adjust the static cameras of a dataset; without `accept` that is a proposal."""

    model_config = ConfigDict(extra="forbid", json_schema_extra={"examples": [{}]})

    accept: Literal["cameras", "sigma"] | None = Field(
        default=None,
        description="Save the adjusted cameras, or only how far the cameras in use may be off.",
    )
    inputs: Annotated[str, Field(pattern="^[0-9a-f]{32}$")] | None = Field(
        default=None,
        description="`inputs` of the proposal that was looked at: another one is not saved. "
        "`accept` needs it.",
    )

    @model_validator(mode="after")
    def _seen(self) -> RigRequest:
        if self.accept is not None and self.inputs is None:
            raise ValueError("to accept a proposal, give the inputs of the one that was looked at")
        return self


class RigTakenBack(BaseModel):
    """An accepted rig that was undone."""

    taken_back: int = Field(description="How many cameras are what they were.")


class BallNoiseDocument(Document):
    """Noise of annotated balls; null where no groups say anything."""

    click: Sigma | None = Field(description="Of a coordinate of a ball's centre.")
    share: float | None = Field(description="What the ball's diameter adds, as a share of it.")
    given: Sigma | None = Field(description="What a given camera of unknown exactness adds.")


class SourceNoiseDocument(Document):
    """Noise of the balls of a static camera or of a person, drawn towards the dataset's."""

    source: str = Field(description="Key of the station, or name of the person.")
    sigma_px: float = Field(description="Of a coordinate of a ball, pixels at 1920 x 1080.")
    low: float = Field(description="End of the 95 % interval.")
    high: float
    ratio: float = Field(description="Of that to the dataset's.")
    numbers: float = Field(description="Independent numbers that speak of it alone.")
    differs: bool = Field(description="The interval leaves out the dataset's sigma.")


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
    people: list[SourceNoiseDocument] = Field(
        description="The same for the people who placed the balls last."
    )
    factors: list[FactorDocument] = Field(
        description="Of cameras and people together; empty where all may be like the dataset."
    )
    used: list[FactorDocument] = Field(description="Those that sigma uses now.")
    is_new: bool = Field(description="`factors` say something else than `used`.")
    line_estimate: LineEstimate | None = Field(description="Null where no lines make a camera.")
    follows: bool = Field(
        description="The policy uses the estimates: each solve of the dataset sets them."
    )
    advice: list[AdviceDocument]
    values: dict[str, float] = Field(
        description="To be sent to the policy; empty where it agrees already."
    )
    notices: list[str] = Field(description="What a person should know.")
