"""Guidelines of a dataset: what its annotators are told."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from app.features.guidelines import service as guidelines
from app.features.guidelines.service import Guidelines
from app.features.independent_annotations.routes import (
    GuidelinePictureDocument,
    GuidelinesEdit,
    NewGuidelinePicture,
)
from app.http.deps import Actor, AppServices, AppStore, DatasetPath, is_not_modified
from app.http.documents import make_document_responder, make_document_response, respond_with
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.route import Route

router = APIRouter(
    prefix="/datasets/{dataset}/guidelines", tags=["independent annotations"], route_class=Route
)

Digest = Annotated[str, Path(pattern=r"^[0-9a-f]{64}$", description="SHA-256 of its bytes.")]


@router.get("", response_model=Guidelines)
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_guidelines(
    dataset: DatasetPath,
    store: AppStore,
    number: Annotated[
        int | None, Query(ge=1, le=2**31, description="Of a version; else the newest.")
    ] = None,
) -> guidelines.Guidelines:
    """The guidelines of the dataset, with the author of each version."""
    return guidelines.read_guidelines(store, dataset, number)


@router.put("", response_model=Guidelines, responses=responses(409))
@may(Action.LEAD, dataset=OwnedKind.DATASET)
@respond_with(make_document_response)
def write_guidelines(
    dataset: DatasetPath, edit: GuidelinesEdit, store: AppStore, actor: Actor
) -> guidelines.Guidelines:
    """Write another version; 409 where somebody wrote one meanwhile."""
    return guidelines.write_guidelines(
        store, dataset, edit.text, based_on=edit.based_on, actor=actor
    )


@router.post(
    "/pictures", response_model=GuidelinePictureDocument, status_code=201, responses=responses(409)
)
@may(Action.LEAD, dataset=OwnedKind.DATASET, body={"upload": OwnedKind.UPLOAD})
@respond_with(make_document_responder(GuidelinePictureDocument.model_validate, 201))
def add_guideline_picture(
    dataset: DatasetPath, new: NewGuidelinePicture, services: AppServices
) -> guidelines.GuidelinePicture:
    """Keep an uploaded picture; the text shows it by its digest."""
    return guidelines.add_picture(services.store, dataset, new.upload, services.frames)


@router.get(
    "/pictures/{digest}",
    response_class=Response,
    responses={
        200: {
            "description": "The picture.",
            "content": {
                kind: {"schema": {"type": "string", "format": "binary"}}
                for kind in ("image/jpeg", "image/png", "image/webp")
            },
        },
        304: {"description": "Not changed."},
    },
)
@may(Action.READ, dataset=OwnedKind.DATASET)
def get_guideline_picture(
    dataset: DatasetPath, digest: Digest, store: AppStore, request: Request
) -> Response:
    """A picture of the guidelines."""
    picture = guidelines.read_picture(store, dataset, digest)
    headers = {"ETag": f'"{digest[:16]}"', "Cache-Control": "private, max-age=86400"}
    if is_not_modified(request, headers["ETag"]):
        return Response(status_code=304, headers=headers)
    return Response(picture.body, media_type=picture.type, headers=headers)
