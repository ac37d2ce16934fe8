"""Saved views of the queue, and who has reviewed how much."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Response
from pydantic import Field

from app.features.datasets.service import MAX_TITLE, dataset_id
from app.features.queue.query import MAX_LENGTH
from app.features.saved_views import service as saved_views
from app.features.saved_views.service import SavedView
from app.features.verdicts import service as reviewers
from app.features.verdicts.service import Reviewer
from app.http.cursor import paged
from app.http.deps import Actor, AppStore, DatasetPath, Id
from app.http.documents import ListDocument, RequestBody, make_document_response, respond_with
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route

router = APIRouter(tags=["queue"], route_class=Route)


class NewSavedView(RequestBody, examples=[{"name": "Nearly there", "q": "jac<0.8 jac>0.75"}]):
    """A query and the name that it shall have."""

    name: Annotated[str, Field(min_length=1, max_length=MAX_TITLE)]
    q: Annotated[str, Field(max_length=MAX_LENGTH)]


class SavedViewList(ListDocument[SavedView]):
    """Saved views, by name."""


class ReviewerList(ListDocument[Reviewer]):
    """Everybody who has judged a group, the most active first."""


@router.get("/datasets/{dataset}/saved-views")
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_saved_views(dataset: DatasetPath, store: AppStore) -> SavedViewList:
    """Queries under names, each with the number of groups that match it now."""
    found = saved_views.list_saved_views(store, dataset_id(store, dataset))
    return SavedViewList(items=found)


def _saved_view_response(view: SavedView) -> Response:
    headers = {"Location": f"/api/v1/saved-views/{view.id}"}
    return make_document_response(view, 201, headers)


@router.post(
    "/datasets/{dataset}/saved-views",
    response_model=SavedView,
    status_code=201,
    responses={
        **responses(409),
        201: {
            "headers": {"Location": {"description": "Its address.", "schema": {"type": "string"}}},
            "description": "The saved view.",
        },
    },
)
@may(Action.ANNOTATE, dataset=OwnedKind.DATASET)
@respond_with(_saved_view_response)
def create_saved_view(
    dataset: DatasetPath, view: NewSavedView, store: AppStore, actor: Actor
) -> SavedView:
    """Keep a query under a name; 409 when the name is taken."""
    values = view.model_dump()
    return saved_views.save_view(store, dataset_id(store, dataset), **values, actor=actor)


@router.get("/saved-views/{view}")
@may(Action.READ, view=OwnedKind.SAVED_VIEW)
def get_saved_view(view: Id, store: AppStore) -> SavedView:
    """One saved view."""
    return saved_views.read_saved_view(store, view)


@router.delete("/saved-views/{view}", response_model=SavedView)
@may(Action.ANNOTATE, view=OwnedKind.SAVED_VIEW)
@respond_with(make_document_response)
def delete_saved_view(view: Id, store: AppStore) -> SavedView:
    """Forget a saved view; the answer is what it was, so that it can be saved again."""
    return saved_views.remove_saved_view(store, view)


@router.get("/datasets/{dataset}/reviewers")
@may(Action.READ, dataset=OwnedKind.DATASET)
@paged()
def list_reviewers(dataset: DatasetPath, store: AppStore) -> ReviewerList:
    """The number of groups that each person judged."""
    found = reviewers.list_reviewers(store, dataset_id(store, dataset))
    return ReviewerList(items=found)
