"""Maintenance: the notice that admins show to everybody; the session's answer and an event have it."""

from __future__ import annotations

from fastapi import APIRouter, Response

from app.api.deps import Actor, AppStore
from app.api.problem import responses
from app.api.schemas.maintenance import BannerDocument, NewBanner
from app.errors import NotFoundError
from app.review.people.maintenance import clear_banner, set_banner

router = APIRouter(prefix="/maintenance", tags=["sessions"])


@router.put("", operation_id="setMaintenance", responses=responses(413, 415))
def put_maintenance(new: NewBanner, store: AppStore, actor: Actor) -> BannerDocument:
    """Show a notice on every page, in place of the one before.

    Windows that are open show it within some seconds; the login page has it, too.
    """
    banner = set_banner(store, new.text, starts=new.starts, until=new.until, actor=actor)
    return BannerDocument.model_validate(banner)


@router.delete(
    "",
    operation_id="clearMaintenance",
    status_code=204,
    response_class=Response,
    responses={**responses(404), 204: {"description": "It is gone."}},
)
def delete_maintenance(store: AppStore, actor: Actor) -> Response:
    """Take the notice away."""
    if not clear_banner(store, actor=actor):
        raise NotFoundError("there is no notice of maintenance")
    return Response(status_code=204)
