"""The bell: what somebody is told: mentions, replies, jobs that ended, work that is theirs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query, Response

from app.api.deps import AppStore
from app.api.problem import responses
from app.api.reply import AskedUnder, Reply, document
from app.api.routers.sessions import Me
from app.api.schemas.bell import BellDocument, BellRead
from app.api.team import AppTeam
from app.finite import MAX_ID
from app.review.people import bell
from app.review.people.bell import Bell

router = APIRouter(prefix="/bell", tags=["comments"])


@router.get("", operation_id="getBell", response_model=BellDocument, responses=responses(401, 409))
def get_bell(
    store: AppStore,
    _team: AppTeam,
    me: Me,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
    before: Annotated[
        int | None, Query(ge=1, le=MAX_ID, description="Only what came before this id.")
    ] = None,
) -> Bell:
    """What one was told in the last 90 days, of what one sees now, the newest first."""
    return bell.read_bell(store, me, limit, before)


@router.post(
    "/read",
    operation_id="readBell",
    response_model=BellDocument,
    responses=responses(401, 409, 413, 415),
)
def read_bell(
    said: BellRead, store: AppStore, _team: AppTeam, me: Me, asked: AskedUnder
) -> Response:
    """One has seen some of it, or all."""
    reply = Reply[Bell](asked, lambda seen: document(BellDocument.model_validate(seen)))
    return reply.of(bell.read_all(store, me, said.ids, keep=reply.keep))
