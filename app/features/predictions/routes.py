"""Predictions: brought in, listed, thrown away, and accepted by a person."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.config import Settings
from app.features.groups.routes import CHANGED, load_group_document_of_view
from app.features.groups.schemas import GroupDocument, make_group_response
from app.features.groups.state import GroupState
from app.features.groups.submit import find_view_location
from app.features.jobs.queries import Job
from app.features.jobs.schemas import ACCEPTED, JobDocument, make_job_response
from app.features.predictions import service as review
from app.features.predictions.accept import (
    AcceptReport,
    accept_box,
    accept_predicted_balls,
    plan_accept,
    read_group_predictions,
)
from app.features.predictions.jobs import request_accept
from app.features.predictions.reader import PredictionFiles, resolve_uploaded_files
from app.features.predictions.schemas import (
    AcceptBody,
    AcceptOutcome,
    GroupPredictionsDocument,
    PredictionFilesRequest,
    PredictionSetDocument,
    PredictionSetList,
    ViewPrediction,
    ViewPredictions,
    parse_image_size,
)
from app.http.cursor import paged
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, DryRun, Id, IfMatch
from app.http.documents import make_document_response, make_empty_response, respond_with
from app.http.errors import add_current_state_to_conflicts
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route

router = APIRouter(tags=["predictions"], route_class=Route)

LOCATION = {"Location": {"description": "Of the set.", "schema": {"type": "string"}}}


@router.get("/datasets/{dataset}/predictions")
@may(Action.READ, dataset=OwnedKind.DATASET, whole=True)
@paged()
def list_predictions(dataset: DatasetPath, store: AppStore) -> PredictionSetList:
    """The sets of predictions of a dataset, the newest first."""
    found = review.list_prediction_sets(store, dataset)
    return PredictionSetList(items=found)


def _make_added_response(found: review.PredictionSet) -> Response:
    headers = {"Location": f"/api/v1/predictions/{found.id}"}
    return make_document_response(PredictionSetDocument.model_validate(found), 201, headers)


@router.post(
    "/datasets/{dataset}/predictions",
    response_model=PredictionSetDocument,
    status_code=201,
    responses={
        **responses(409),
        201: {"headers": LOCATION, "description": "The set, with what could not be read."},
    },
)
@may(
    Action.LEAD,
    dataset=OwnedKind.DATASET,
    body={
        "upload": OwnedKind.UPLOAD,
        "images_upload": OwnedKind.UPLOAD,
        "cameras_upload": OwnedKind.UPLOAD,
    },
)
@respond_with(_make_added_response)
def add_predictions(
    dataset: DatasetPath, request: PredictionFilesRequest, services: AppServices, actor: Actor
) -> review.PredictionSet:
    """Read uploaded files into a new set of predictions, or find the set that they gave before.

    What is wrong is left out and listed with file, record and field; frames that the dataset does
    not have are counted and listed. 400 where nothing can be used, 413 where reading takes too
    much memory or time, 503 while too many others are read. No solve reads predictions.
    """
    return review.add_predictions(
        services.store,
        dataset,
        request.name,
        _resolve_prediction_files(services.settings, request),
        actor=actor,
        read=services.predictions.read,
    )


def _make_accepted_response(found: AcceptReport | Job) -> Response:
    return (
        make_job_response(found)
        if isinstance(found, Job)
        else make_document_response(AcceptOutcome.of_report(found))
    )


@router.post(
    "/predictions/accept",
    response_model=AcceptOutcome,
    responses={
        **responses(409),
        **ACCEPTED,
        202: {**ACCEPTED[202], "model": JobDocument},
        200: {
            "description": "What a dry run found, or what was accepted in views that were named."
        },
    },
)
@may(Action.LEAD, body={"dataset": OwnedKind.DATASET, "predictions": OwnedKind.PREDICTIONS})
@respond_with(_make_accepted_response)
def accept_predictions(
    request: AcceptBody, services: AppServices, actor: Actor, dry_run: DryRun = False
) -> AcceptReport | Job | Response:
    """Make annotations of predictions, as edits in the log that can be undone.

    Only the surest prediction of a view counts. Named views are changed at once (200); a query
    makes a job (202), whose result has `changed`, `groups` and `refused`.
    """
    store, value = services.store, request.to_accept_request()
    if dry_run or request.dry_run:
        return make_document_response(
            AcceptOutcome.of_plan(plan_accept(store, request.dataset, value))
        )
    if request.views is not None:
        return accept_predicted_balls(store, request.dataset, value, actor=actor)
    return request_accept(services.jobs, store, request.dataset, value, actor=actor)


@router.get("/predictions/{predictions}", response_model=PredictionSetDocument)
@may(Action.READ, predictions=OwnedKind.PREDICTIONS)
def get_predictions(predictions: Id, store: AppStore) -> review.PredictionSet:
    """One set of predictions."""
    return review.get_predictions(store, predictions)


@router.delete("/predictions/{predictions}", status_code=204)
@may(Action.LEAD, predictions=OwnedKind.PREDICTIONS)
@respond_with(make_empty_response)
def delete_predictions(predictions: Id, store: AppStore, actor: Actor) -> None:
    """Throw a set away; evaluations of it stay, and so do balls that were accepted from it."""
    review.delete_predictions(store, predictions, actor=actor)


@router.get("/views/{view}/predictions")
@may(Action.READ, view=OwnedKind.VIEW)
@paged()
def get_view_predictions(view: Id, store: AppStore) -> ViewPredictions:
    """The predictions for a view."""
    find_view_location(store, view)
    found = review.read_predictions_of_view(store, view)
    return ViewPredictions(
        items=[ViewPrediction.of(item, box) for item, boxes in found for box in boxes]
    )


@router.get("/groups/{group}/predictions")
@may(Action.READ, group=OwnedKind.GROUP)
@paged()
def get_group_predictions(group: Id, store: AppStore) -> GroupPredictionsDocument:
    """What was predicted for all views of a group, and where its accepted balls come from."""
    return GroupPredictionsDocument.of(read_group_predictions(store, group))


@router.post(
    "/views/{view}/predictions/{prediction}/accept",
    response_model=GroupDocument,
    responses={**CHANGED, **responses(413, 415)},
)
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@respond_with(make_group_response)
def accept_prediction(
    view: Id,
    prediction: Id,
    store: AppStore,
    actor: Actor,
    if_match: IfMatch,
    replace: Annotated[
        bool, Query(description="Also where the view has another ball; else that is a 409.")
    ] = False,
) -> GroupState:
    """Make this very prediction the ball of its view: an edit that can be undone."""
    with add_current_state_to_conflicts(lambda: load_group_document_of_view(store, view)):
        return accept_box(store, view, prediction, if_match=if_match, actor=actor, replace=replace)


def _resolve_prediction_files(
    settings: Settings, request: PredictionFilesRequest
) -> PredictionFiles:
    how = PredictionFiles(
        None,
        format=request.format,
        category=request.category,
        size=parse_image_size(request.size),
        cameras_size=parse_image_size(request.cameras_size),
    )
    uploads = (request.upload, request.images_upload, request.cameras_upload)
    return resolve_uploaded_files(settings, how, *uploads)
