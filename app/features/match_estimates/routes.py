"""Estimates of a match: position, rig, noise, picture."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter, Query, Response
from pydantic import BaseModel, Field, model_validator

from app.db.session import Session
from app.features.groups.edit_schemas import PictureGeometryEdit
from app.features.jobs.queries import Job
from app.features.jobs.schemas import describe_job_response_for_openapi, make_job_response
from app.features.match_estimates.jobs import PICTURES, POSITIONS, RIG, undo_rig_adjustment
from app.features.match_estimates.pictures import read_picture_geometries, set_picture_geometries
from app.features.match_estimates.positions import SharedPositionState, get_main_camera_positions
from app.features.match_estimates.queries import MatchPictureGeometry
from app.features.policies import noise as noises
from app.features.policies.noise import ThresholdAdvice
from app.features.policies.service import read_policy
from app.features.solve.jobs import change_and_return_solve_job
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath
from app.http.documents import (
    Document,
    ListDocument,
    RequestBody,
    make_document_response,
    respond_with,
)
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import COMPUTE, limit
from app.http.route import Route
from app.solving.ball_noise import SigmaEstimate
from app.solving.line_noise import LineEstimate

positions_router = APIRouter(
    prefix="/datasets/{dataset}/positions", tags=["datasets"], route_class=Route
)
rig_router = APIRouter(tags=["stations"], route_class=Route)
noise_router = APIRouter(prefix="/datasets/{dataset}/noise", tags=["policies"], route_class=Route)
pictures_router = APIRouter(
    prefix="/datasets/{dataset}/pictures", tags=["datasets"], route_class=Route
)


class MatchPictureGeometriesDocument(ListDocument[MatchPictureGeometry]):
    """The pictures of a dataset's matches, by name of the match."""


class MatchSelection(RequestBody, examples=[{}]):
    """Which matches a job is to look at."""

    match: str | None = Field(
        default=None, min_length=1, max_length=1000, description="This match alone; null: all."
    )


class MatchPictureGeometryChange(RequestBody, examples=[{"match": "a/b/c", "picture": None}]):
    """Say what was done to the pictures of a match's main camera."""

    match: str = Field(min_length=1, max_length=1000)
    picture: PictureGeometryEdit | None = Field(
        description="As proposed; null: as they were taken."
    )


class SharedPositionsDocument(ListDocument[SharedPositionState]):
    """The shared positions of a dataset's matches, by name of the match."""

    used: bool = Field(description="Whether the policy uses them: `calibration.share_position`.")


class RigRequest(RequestBody, examples=[{}]):
    """Adjust the static cameras of a dataset; without `accept` that is a proposal."""

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
    def _require_inputs_to_accept(self) -> RigRequest:
        if self.accept is not None and self.inputs is None:
            raise ValueError("to accept a proposal, send the `inputs` of that proposal")
        return self


class RigTakenBack(BaseModel):
    """An accepted rig that was undone."""

    taken_back: int = Field(description="How many cameras are what they were.")


class BallNoiseDocument(Document):
    """Noise of annotated balls; null where no groups say anything."""

    click: SigmaEstimate | None = Field(description="Of a coordinate of a ball's centre.")
    share: float | None = Field(description="What the ball's diameter adds, as a share of it.")
    given: SigmaEstimate | None = Field(
        description="What a given camera of unknown exactness adds."
    )


class CameraOrPersonNoiseDocument(Document):
    """Noise of the balls of a static camera or of a person, drawn towards the dataset's."""

    source: str = Field(description="Key of the station, or name of the person.")
    sigma_px: float = Field(description="Of a coordinate of a ball, pixels at 1920 x 1080.")
    low: float = Field(description="End of the 95 % interval.")
    high: float
    ratio: float = Field(description="Of that to the dataset's.")
    numbers: float = Field(description="Independent numbers that speak of it alone.")
    differs: bool = Field(description="The interval leaves out the dataset's sigma.")


class ThresholdAdviceDocument(Document, shows=ThresholdAdvice):
    """A threshold of the policy and what the dataset says of it."""

    present: float | None = Field(description="Null: the policy leaves it to each image.")
    agrees: bool = Field(description="The interval holds the present value.")


class NoiseFactorDocument(Document):
    """How noisy balls of a camera that a person places are beside the dataset's."""

    camera: str | None = Field(description="Key of a static camera; null: any other.")
    person: str | None = Field(description="Who places the ball; null: anybody else.")
    ratio: float = Field(description="Of both sigmas; one where they may be alike.")


class NoiseDocument(Document):
    """Estimates, and the thresholds that would make the policy agree."""

    groups: int = Field(description="Groups that were looked at.")
    solved: int = Field(description="Groups with a solution.")
    ball: BallNoiseDocument
    stations: list[CameraOrPersonNoiseDocument] = Field(
        description="Static cameras of which enough is seen, the noisiest first."
    )
    people: list[CameraOrPersonNoiseDocument] = Field(
        description="The same for the people who placed the balls last."
    )
    factors: list[NoiseFactorDocument] = Field(
        description="Of cameras and people together; empty where all may be like the dataset."
    )
    used: list[NoiseFactorDocument] = Field(description="Those that sigma uses now.")
    is_new: bool = Field(description="`factors` say something else than `used`.")
    line_estimate: LineEstimate | None = Field(description="Null where no lines make a camera.")
    follows: bool = Field(
        description="The policy uses the estimates: each solve of the dataset sets them."
    )
    advice: list[ThresholdAdviceDocument]
    values: dict[str, float] = Field(
        description="To be sent to the policy; empty where it agrees already."
    )
    notices: list[str] = Field(description="What a person should know.")


@positions_router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_positions(dataset: DatasetPath, store: AppStore) -> SharedPositionsDocument:
    """Where each match's main camera stands, as far as that is shared with its pictures."""
    return SharedPositionsDocument.model_validate(get_main_camera_positions(store, dataset))


@positions_router.post("", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def share_positions(
    dataset: DatasetPath, request: MatchSelection, services: AppServices, actor: Actor
) -> Job:
    """Estimate where main cameras stand and give each picture what its match's others say of it.

    Without a match it is shared in all where what it was estimated from has changed. Their groups
    are solved again. An edit of lines never renews it; this does. 409 while the policy does not
    use it.
    """
    return POSITIONS.request(services.jobs, services.store, dataset, request.match, actor=actor)


@positions_router.delete("", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def revert_positions(
    dataset: DatasetPath,
    services: AppServices,
    actor: Actor,
    match: Annotated[str, Query(min_length=1, max_length=1000, description="Name of the match.")],
) -> Job:
    """Give a match the positions that it had before they were shared last; the job solves it.

    Once more takes back the share before that one; 409 when nothing is shared any more.
    """
    return POSITIONS.undo_last_job(services.jobs, services.store, dataset, match, actor=actor)


@rig_router.post("/datasets/{dataset}/rig", **describe_job_response_for_openapi(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def adjust_rig(
    dataset: DatasetPath, request: RigRequest, services: AppServices, actor: Actor
) -> Job:
    """Adjust the static cameras of a dataset to lines and balls over time.

    The job's result is the proposal: each camera and each pair before and after, on instants that
    were used and on instants that were held out. With `accept` and the `inputs` of the
    proposal that was looked at it is saved as an edit of each camera.
    """
    return RIG.request(
        services.jobs,
        services.store,
        dataset,
        actor=actor,
        what=request.accept,
        inputs=request.inputs,
    )


def _make_take_back_response(count: int) -> Response:
    return make_document_response(RigTakenBack(taken_back=count))


@rig_router.delete("/datasets/{dataset}/rig", response_model=RigTakenBack, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(_make_take_back_response)
def revert_rig(dataset: DatasetPath, services: AppServices, actor: Actor) -> int:
    """Take an accepted rig back, all its cameras at once; 409 when there is none."""
    return undo_rig_adjustment(services.jobs, services.store, dataset, actor=actor)


@noise_router.get("", response_model=NoiseDocument)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(COMPUTE)
def get_noise(dataset: DatasetPath, services: AppServices) -> noises.NoiseReport:
    """Sigma of balls, given cameras and field lines with intervals, and what the policy says.

    Changes nothing: to judge by the estimates, `POST` here, or send `values` alone to the dataset's
    policy.
    """
    return services.noises.read(dataset)


@noise_router.post("", **describe_job_response_for_openapi(412))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@limit(COMPUTE)
@respond_with(make_job_response)
def accept_noise(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Judge by the estimates: `values` go into the policy, `factors` to the balls; the job solves.

    A ball that is placed later has the factor of its camera and of who places it.
    """
    found, store = services.noises.read(dataset), services.store
    state = read_policy(store, found.dataset_id)

    def adopt_noise(session: Session) -> None:
        noises.adopt_estimated_noise_in_session(session, found, state, actor)

    return change_and_return_solve_job(
        services.jobs, store, found.dataset_id, adopt_noise, actor=actor
    )


@noise_router.delete("", **describe_job_response_for_openapi())
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@limit(COMPUTE)
@respond_with(make_job_response)
def revert_noise(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Take the balls of all cameras and people to be as noisy as the dataset's; the job solves.

    The policy stays as it is.
    """

    def reset_noise(session: Session) -> None:
        noises.reset_noise_factors(session, dataset, actor=actor)

    return change_and_return_solve_job(
        services.jobs, services.store, dataset, reset_noise, actor=actor
    )


@pictures_router.get("")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_match_pictures(dataset: DatasetPath, store: AppStore) -> MatchPictureGeometriesDocument:
    """What the pictures of each match's main camera are taken to be: stretched, cropped or neither."""
    return MatchPictureGeometriesDocument.model_validate(
        {"items": read_picture_geometries(store, dataset)}
    )


@pictures_router.post("", **describe_job_response_for_openapi())
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def estimate_match_pictures(
    dataset: DatasetPath, request: MatchSelection, services: AppServices, actor: Actor
) -> Job:
    """Look at up to thirty frames of each match together; changes nothing.

    `result.items` of the job has what they show (`estimate`), what to use instead (`proposed`, null
    where nothing certainly happened), and both in words.
    """
    return PICTURES.request(services.jobs, services.store, dataset, request.match, actor=actor)


@pictures_router.patch("", **describe_job_response_for_openapi())
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_job_response)
def set_match_picture(
    dataset: DatasetPath, change: MatchPictureGeometryChange, services: AppServices, actor: Actor
) -> Job:
    """Say what was done to the pictures of a match's main camera; the job solves its groups.

    Each group gets an edit that it can undo. Replays are left alone: each shot has its own.
    """
    picture = None if change.picture is None else change.picture.picture()

    def apply_picture_change(session: Session) -> None:
        set_picture_geometries(session, dataset, {change.match: picture}, actor=actor)

    return change_and_return_solve_job(
        services.jobs, services.store, dataset, apply_picture_change, actor=actor
    )
