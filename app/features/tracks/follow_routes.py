"""The ball of a view, followed through the groups before and after; what comes of it is stored by an edit of many views."""

from __future__ import annotations

from typing import Annotated

from anyio import to_thread
from fastapi import APIRouter, Body, Request, Response
from pydantic import Field

from app.features.groups.edit_schemas import BoxNumbers, PointNumbers
from app.features.tracks.follow import (
    EACH_WAY,
    MOST_EACH_WAY,
    FollowedView,
    FollowedViews,
    build_followed_views,
    plan_ball_following,
    submit_follow_task,
)
from app.features.tracks.follow_sequence import FollowedSequence, FollowEnd
from app.http.deps import AppServices, Id
from app.http.documents import Document, RequestBody
from app.http.permissions import Action, OwnedKind, may
from app.http.problem import responses
from app.http.request_limits import TRANSFER, limit
from app.http.route import Route
from app.soccer.frames import ImagePoint
from app.tracking.ball_run import State

router = APIRouter(prefix="/views", tags=["views"], route_class=Route)
CLIENT_GONE = 499


class FollowRequest(RequestBody, examples=[{"frames": 50}]):
    """Which ball is followed, and how far."""

    at: PointNumbers | None = Field(
        default=None,
        description="About the middle of the ball, pixels of the annotated size; null: where it is annotated.",
    )
    frames: Annotated[int, Field(ge=1, le=MOST_EACH_WAY, strict=True)] = Field(
        default=EACH_WAY, description="Frames to either side."
    )


class FollowedViewDocument(Document):
    """A view without a ball, and where the ball was followed to in it."""

    group: int = Field(description="Id of its group.")
    key: str = Field(description="Key of its group.")
    number: int = Field(description="Place of its group in the dataset, from 1.")
    view: int = Field(description="Its id.")
    frame: int = Field(description="Number of its frame.")
    etag: str = Field(description="State of its group, which accepting it builds on.")
    box: BoxNumbers = Field(description="Of the ball, pixels of the annotated size.")
    sigma_px: float = Field(description="Standard deviation of the centre along each axis, pixels.")
    confidence: float = Field(description="How likely it is the ball, 0 to 1.")
    state: State = Field(
        description="`uncertain`: a person has to look at it; it was not seen, or other places look like it."
    )

    @staticmethod
    def of(found: FollowedView) -> FollowedViewDocument:
        """The document of a view."""
        ball, box = found.ball, found.ball.box
        return FollowedViewDocument(
            group=found.group,
            key=found.key,
            number=found.number,
            view=found.view,
            frame=found.frame,
            etag=found.etag,
            box=(box.x, box.y, box.width, box.height),
            sigma_px=round(ball.sigma_px, 3),
            confidence=round(ball.confidence, 3),
            state=ball.state,
        )


class FollowedBallDocument(Document):
    """A ball that was followed through the frames of a camera; nothing of it is stored."""

    view: int = Field(description="Id of the view in which it was.")
    group: str = Field(
        description="Key of its group: `followed_from` of the balls that are accepted."
    )
    camera: str = Field(description="Key of the camera.")
    frame: int = Field(description="Number of its frame.")
    first: int = Field(description="The first frame in which it was followed.")
    last: int = Field(description="The last frame in which it was followed.")
    before: FollowEnd = Field(
        description="Why it begins there: the ball is `lost`, `left` the picture, a group has a ball that is "
        "`known`, there are no more groups (`end`), or no more frames were asked for (`limit`)."
    )
    after: FollowEnd = Field(description="Why it ends there.")
    sized: bool = Field(description="Whether a camera says how large the ball is.")
    unreadable: list[int] = Field(
        description="Numbers of frames that are there and cannot be read; the ball was followed without them."
    )
    items: list[FollowedViewDocument] = Field(
        description="Views that have no ball yet, by frame; those that have one keep it."
    )

    @staticmethod
    def of(found: FollowedViews) -> FollowedBallDocument:
        """The document of what came of it."""
        values = {name: getattr(found, name) for name in _SAME}
        return FollowedBallDocument(
            **values, items=[FollowedViewDocument.of(one) for one in found.items]
        )


_SAME = (
    "view",
    "group",
    "camera",
    "frame",
    "first",
    "last",
    "before",
    "after",
    "sized",
    "unreadable",
)


@router.post("/{view}/ball/follow", response_model=FollowedBallDocument, responses=responses(409))
@may(Action.ANNOTATE, view=OwnedKind.VIEW)
@limit(TRANSFER)
async def follow_ball_of_view(
    view: Id,
    services: AppServices,
    request: Request,
    wanted: Annotated[FollowRequest, Body(default_factory=FollowRequest)],
) -> FollowedBallDocument | Response:
    """Follow the ball of a view through the frames of its camera, into the groups before and after.

    For cameras that stand still, in groups whose keys are numbers of frames. Nothing is stored: send what is
    right to `POST /datasets/{dataset}/edits`, each `box` with `followed_from`.
    """
    at = None if wanted.at is None else ImagePoint(*wanted.at)
    question = await to_thread.run_sync(
        plan_ball_following, services.store, view, at, wanted.frames
    )
    task = await to_thread.run_sync(submit_follow_task, services.settings, services.balls, question)
    found: FollowedSequence | None = await task.result_unless_client_gone(request.is_disconnected)
    if found is None:
        return Response(status_code=CLIENT_GONE)
    return FollowedBallDocument.of(build_followed_views(question, found))
