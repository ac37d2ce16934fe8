"""Estimates of a match: position, rig, noise, picture."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.db.session import Session
from app.features.jobs.queries import Job
from app.features.match_estimates.jobs import PICTURES, POSITIONS, RIG, take_rig_back
from app.features.match_estimates.pictures import change_pictures, read_pictures
from app.features.match_estimates.positions import get_positions
from app.features.match_estimates.schemas import (
    MatchPictureChange,
    MatchPicturesDocument,
    MatchRequest,
    NoiseDocument,
    RigRequest,
    RigTakenBack,
    SharedPositionsDocument,
)
from app.features.policies import noise as noises
from app.features.policies.service import read_policy
from app.features.solve.jobs import change_and_solve
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath
from app.http.job_responses import by_job, job_answer
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import QUESTIONS, limit
from app.http.respond import document, responds
from app.http.route import Route

positions_router = APIRouter(
    prefix="/datasets/{dataset}/positions", tags=["datasets"], route_class=Route
)


@positions_router.get("", operation_id="listPositions", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_positions(dataset: DatasetPath, store: AppStore) -> SharedPositionsDocument:
    """Where each match's main camera stands, as far as that is shared with its pictures."""
    return SharedPositionsDocument.model_validate(get_positions(store, dataset))


@positions_router.post("", operation_id="sharePositions", **by_job(404, 409, 413, 415))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def share_positions(
    dataset: DatasetPath, request: MatchRequest, services: AppServices, actor: Actor
) -> Job:
    """Estimate where main cameras stand and give each picture what its match's others say of it.

    Without a match it is shared in all where what it was estimated from has changed. Their groups
    are solved again. An edit of lines never renews it; this does. 409 while the policy does not
    use it.
    """
    return POSITIONS.request(services.jobs, services.store, dataset, request.match, actor=actor)


@positions_router.delete("", operation_id="revertPositions", **by_job(404, 409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def take_back_positions(
    dataset: DatasetPath,
    services: AppServices,
    actor: Actor,
    match: Annotated[str, Query(min_length=1, max_length=1000, description="Name of the match.")],
) -> Job:
    """Give a match the positions that it had before they were shared last; the job solves it.

    Once more takes back the share before that one; 409 when nothing is shared any more.
    """
    return POSITIONS.take_back(services.jobs, services.store, dataset, match, actor=actor)


rig_router = APIRouter(tags=["stations"], route_class=Route)


@rig_router.post("/datasets/{dataset}/rig", operation_id="adjustRig", **by_job(404, 409, 413, 415))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def adjust_rig(
    dataset: DatasetPath, request: RigRequest, services: AppServices, actor: Actor
) -> Job:
    """Adjust the static cameras of a dataset to lines and balls over time.

    The job's result is the proposal: each camera and each pair before and after, on instants that
    were used and on instants that were held out. With `accept` and the `inputs` of the
    proposal that was looked at it is saved as an edit of each camera.
    """
    subject = {"what": request.accept, "inputs": request.inputs}
    return RIG.request(services.jobs, services.store, dataset, actor=actor, **subject)


def _taken_back(count: int) -> Response:
    return document(RigTakenBack(taken_back=count))


@rig_router.delete(
    "/datasets/{dataset}/rig",
    operation_id="revertRig",
    response_model=RigTakenBack,
    responses=responses(404, 409),
)
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(_taken_back)
def delete_rig(dataset: DatasetPath, services: AppServices, actor: Actor) -> int:
    """Take an accepted rig back, all its cameras at once; 409 when there is none."""
    return take_rig_back(services.jobs, services.store, dataset, actor=actor)


noise_router = APIRouter(prefix="/datasets/{dataset}/noise", tags=["policies"], route_class=Route)


@noise_router.get(
    "", operation_id="getNoise", response_model=NoiseDocument, responses=responses(404)
)
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@limit(QUESTIONS)
def get_noise(dataset: DatasetPath, services: AppServices) -> noises.Noise:
    """Sigma of balls, given cameras and field lines with intervals, and what the policy says.

    Changes nothing: to judge by the estimates, `POST` here, or send `values` alone to the dataset's
    policy.
    """
    return services.noises.read(dataset)


@noise_router.post("", operation_id="acceptNoise", **by_job(404, 412))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@limit(QUESTIONS)
@responds(job_answer)
def accept_noise(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Judge by the estimates: `values` go into the policy, `factors` to the balls; the job solves.

    A ball that is placed later has the factor of its camera and of who places it.
    """
    found, store = services.noises.read(dataset), services.store
    state = read_policy(store, found.dataset_id)

    def change(session: Session) -> None:
        noises.accept_noise(session, found, state, actor)

    return change_and_solve(services.jobs, store, found.dataset_id, change, actor=actor)


@noise_router.delete("", operation_id="revertNoise", **by_job(404))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@limit(QUESTIONS)
@responds(job_answer)
def take_noise_back(dataset: DatasetPath, services: AppServices, actor: Actor) -> Job:
    """Take the balls of all cameras and people to be as noisy as the dataset's; the job solves.

    The policy stays as it is.
    """

    def change(session: Session) -> None:
        noises.take_noise_back(session, dataset, actor=actor)

    return change_and_solve(services.jobs, services.store, dataset, change, actor=actor)


pictures_router = APIRouter(
    prefix="/datasets/{dataset}/pictures", tags=["datasets"], route_class=Route
)


@pictures_router.get("", operation_id="listMatchPictures", responses=responses(404))
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_match_pictures(dataset: DatasetPath, store: AppStore) -> MatchPicturesDocument:
    """What the pictures of each match's main camera are taken to be: stretched, cropped or neither."""
    return MatchPicturesDocument.model_validate({"items": read_pictures(store, dataset)})


@pictures_router.post("", operation_id="estimateMatchPictures", **by_job(404, 413, 415))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def estimate_match_pictures(
    dataset: DatasetPath, request: MatchRequest, services: AppServices, actor: Actor
) -> Job:
    """Look at up to thirty frames of each match together; changes nothing.

    `result.items` of the job has what they show (`estimate`), what to use instead (`proposed`, null
    where nothing certainly happened), and both in words.
    """
    return PICTURES.request(services.jobs, services.store, dataset, request.match, actor=actor)


@pictures_router.patch("", operation_id="setMatchPicture", **by_job(404, 413, 415))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@responds(job_answer)
def set_match_picture(
    dataset: DatasetPath, change: MatchPictureChange, services: AppServices, actor: Actor
) -> Job:
    """Say what was done to the pictures of a match's main camera; the job solves its groups.

    Each group gets an edit that it can undo. Replays are left alone: each shot has its own.
    """
    picture = None if change.picture is None else change.picture.picture()

    def changed(session: Session) -> None:
        change_pictures(session, dataset, {change.match: picture}, actor=actor)

    return change_and_solve(services.jobs, services.store, dataset, changed, actor=actor)
