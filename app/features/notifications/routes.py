"""The bell: what somebody is told: mentions, replies, jobs that ended, work that is theirs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from app.features.notifications import service as bell
from app.features.notifications.queries import Notification
from app.features.notifications.service import NotificationPage
from app.features.people.session_routes import Me
from app.http.cursor import Before, Cursor, parse_descending_cursor
from app.http.deps import AppStore
from app.http.documents import ListDocument, RequestBody, make_document_responder, respond_with
from app.http.permissions import Action, may
from app.http.problem import responses
from app.http.route import Route
from app.http.team import AppTeam
from app.json_text import MAX_ID

router = APIRouter(prefix="/notifications", tags=["comments"], route_class=Route)


class NotificationsDocument(ListDocument[Notification]):
    """What somebody was told in the last 90 days, of what they see now, the newest first."""

    unread: int = Field(description="How much of all of it they have not seen yet.")


class SeenNotifications(RequestBody, examples=[{"ids": [12, 15]}, {"ids": None}]):
    """What somebody has seen."""

    ids: list[Annotated[int, Field(ge=1, le=MAX_ID)]] | None = Field(
        default=None, max_length=200, description="null: everything."
    )


@router.get("", responses=responses(409))
@may(Action.ACCOUNT)
def get_notifications(
    store: AppStore,
    _team: AppTeam,
    me: Me,
    limit: Annotated[int, Query(ge=1, le=200)] = 50,
    cursor: Cursor = None,
    before: Before = None,
) -> NotificationsDocument:
    """What one was told in the last 90 days, of what one sees now, the newest first."""
    found = bell.read_notifications(store, me, limit + 1, parse_descending_cursor(cursor, before))
    document = NotificationsDocument.model_validate(found)
    if len(document.items) > limit:
        document.items = document.items[:limit]
        document.next = str(document.items[-1].id)
    return document


@router.post("/read", response_model=NotificationsDocument, responses=responses(409))
@may(Action.ACCOUNT)
@respond_with(make_document_responder(NotificationsDocument.model_validate))
def mark_notifications_read(
    body: SeenNotifications, store: AppStore, _team: AppTeam, me: Me
) -> NotificationPage:
    """One has seen some of it, or all."""
    return bell.mark_as_read(store, me, body.ids)
