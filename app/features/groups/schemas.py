"""Documents of groups, views and annotations."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Any, Literal

from fastapi import Response
from pydantic import BaseModel, Field

from app.features.groups.edit_schemas import BoxNumbers, Point, PointNumbers
from app.features.groups.solution_schemas import SolutionDocument
from app.features.groups.state import GroupState
from app.features.policies.schemas import PolicyDocument
from app.http.documents import Document, IdentityCache, ListDocument, make_document_response
from app.soccer.annotation import BallAnnotation, Lines
from app.soccer.choices import CalibrationChoice, VerdictState
from app.soccer.group import Group, View, ViewExclusion, is_numbered_in_time, make_view_letter
from app.soccer.picture import PictureGeometry
from app.wording import plural


class Ball(BaseModel):
    """One ball as annotated."""

    box: BoxNumbers | None
    point: PointNumbers | None
    occluded: bool
    out_of_view: bool
    source: Literal["dataset", "person", "prediction"] = Field(
        description="Who says so; `prediction`: a person accepted it from `predicted_by`."
    )
    predicted_by: str | None = Field(
        description="Name of the set of predictions, a `ball run` of a recording, or `followed from` with the "
        "key of a group."
    )
    inferred: bool = Field(
        description="Put where the 3D ball of the other views is seen; it confirms nothing."
    )

    @staticmethod
    def of(ball: BallAnnotation, *, edited: bool = False) -> Ball:
        """The document of an annotation; ``edited``: a person has changed it."""
        box, point = ball.box, ball.point
        return Ball.model_construct(
            box=None if box is None else (box.x, box.y, box.width, box.height),
            point=None if point is None else (point.x, point.y),
            occluded=ball.occluded,
            out_of_view=ball.out_of_view,
            source="prediction" if ball.predicted_by else "person" if edited else "dataset",
            predicted_by=ball.predicted_by or None,
            inferred=ball.inferred,
        )


LineDocuments = dict[str, list[Point]]


def _build_line_documents(lines: Lines) -> LineDocuments:
    return {
        marking: [Point.model_construct(x=point.x, y=point.y) for point in points]
        for marking, points in lines.items()
    }


_kept_documents: IdentityCache[Lines, LineDocuments] = IdentityCache(
    _build_line_documents, size=1024
)


def lines_to_document(lines: Lines) -> LineDocuments:
    """Lines as they travel."""
    return _kept_documents(lines)


class DatasetReference(Document):
    """The dataset that a group belongs to."""

    id: int
    name: str


class PitchSize(Document):
    """Length and width of the pitch, metres."""

    length: float
    width: float


class VerdictDocument(Document):
    """What people decided; `stale` when the group changed afterwards."""

    state: VerdictState
    reason: str | None
    note: str | None
    by: str | None = Field(validation_alias="actor")
    at: datetime | None
    stale: bool
    fixed: bool = Field(description="Mended: edited, accepted as such, and it fails no gate.")
    override: str | None = Field(description="The gate that it was accepted against.")


class StationDocument(Document):
    """The camera station of a view; a shared one is a static camera."""

    id: int
    key: str
    shared: bool
    calibration: CalibrationChoice = Field(description="Which calibration counts when both exist.")
    has_given: bool
    picture: PictureGeometry | None = Field(
        description="What was done to the picture since the camera took it; null: nothing is recorded."
    )
    etag: str = Field(description="For If-Match on `/stations/{id}/lines`.")


class ViewDocument(Document):
    """One image of the instant, as annotated."""

    id: int
    key: str
    letter: str
    label: str
    width: int
    height: int
    included: bool
    left_out: ViewExclusion | None = Field(
        description="Reason why a person left the view out, if they gave one."
    )
    station: StationDocument
    lines: LineDocuments
    proposed: list[str] = Field(
        description="Markings whose source is `proposed`: a person accepted their points as they "
        "were proposed from the paint."
    )
    not_visible: list[str] = Field(
        description="Markings that a person says the picture does not show: JaC does not count them "
        "as missing."
    )
    balls: list[Ball]
    image: str | None = Field(description="Address of the frame, where there is one.")
    neighbours: str | None = Field(
        description="Address of the list of frames just before and after; null where the "
        "dataset's frames are not numbered by time."
    )


class GroupDocument(Document):
    """A group, complete: what people said and what follows from it."""

    id: int
    number: int = Field(description="Place in the dataset, from 1.")
    dataset: DatasetReference
    key: str
    label: str
    match: str
    split: str
    pitch: PitchSize
    revision: int
    etag: str = Field(description="The ETag header again, quotes included.")
    can_undo: bool
    can_redo: bool
    verdict: VerdictDocument
    verdicts: list[VerdictDocument] = Field(description="The last verdict of every person.")
    policy: PolicyDocument
    views: list[ViewDocument]
    solution: SolutionDocument | None

    @staticmethod
    def of(state: GroupState) -> GroupDocument:
        """The document of a group's state."""
        group = state.group
        return GroupDocument.model_construct(
            id=state.id,
            number=state.number,
            dataset=DatasetReference(id=state.dataset_id, name=state.dataset),
            key=group.key,
            label=group.label or group.key,
            match=group.match,
            split=group.split,
            pitch=PitchSize.model_validate(group.pitch),
            revision=state.revision,
            etag=state.etag,
            can_undo=state.can_undo,
            can_redo=state.can_redo,
            verdict=VerdictDocument.model_validate(state.verdict),
            verdicts=[VerdictDocument.model_validate(verdict) for verdict in state.verdicts],
            policy=PolicyDocument.model_validate(state.policy),
            views=[
                _build_view_document(state, view, index, label)
                for index, (view, label) in enumerate(
                    zip(group.views, make_view_labels(group), strict=True)
                )
            ],
            solution=None
            if state.solution is None
            else SolutionDocument.of(state.solution, group, state.dismissed),
        )


def make_group_response(state: GroupState) -> Response:
    """The document of a group, its ETag in the header."""
    headers = {"ETag": state.etag, "Cache-Control": "private, no-cache"}
    return make_document_response(GroupDocument.of(state), headers=headers)


def make_view_labels(group: Group) -> list[str]:
    """What people call the views: the camera's number, or the main camera and its replays."""
    labels = []
    for index, view in enumerate(group.views):
        camera = view.station.key.removeprefix("cam") if view.station.shared else ""
        if camera.isdigit():
            labels.append(f"Camera {camera}")
        elif index == 0:
            labels.append("Main camera")
        else:
            labels.append(f"Replay {index}")
    return labels


def url_of_image(view_id: int) -> str:
    """Where the frame of a view is served."""
    return f"/api/v1/views/{view_id}/image"


def _build_view_document(state: GroupState, view: View, index: int, label: str) -> ViewDocument:
    view_id, why = state.view_ids[view.key], view.left_out
    return ViewDocument.model_construct(
        id=view_id,
        key=view.key,
        letter=make_view_letter(index),
        label=label,
        width=view.size.width,
        height=view.size.height,
        included=view.included,
        left_out=None if why is None else why,
        station=_build_station_document(state, view),
        lines=lines_to_document(view.station.lines),
        proposed=[*view.station.proposed],
        not_visible=[*view.station.not_visible],
        balls=[Ball.of(ball, edited=view.key in state.stored.edited_views) for ball in view.balls],
        image=None if view.media is None else url_of_image(view_id),
        neighbours=_build_neighbours_url(state.key, view, view_id),
    )


def _build_neighbours_url(group: str, view: View, view_id: int) -> str | None:
    media = view.media
    if media is None or not is_numbered_in_time(media, group, view.station.shared):
        return None
    return f"/api/v1/views/{view_id}/neighbours"


def _build_station_document(state: GroupState, view: View) -> StationDocument:
    station = view.station
    values: dict[str, Any] = {
        "id": state.station_ids[station.key],
        "key": station.key,
        "shared": station.shared,
        "calibration": station.calibration,
        "has_given": station.given is not None,
        "picture": None if station.picture is None else station.picture,
        "etag": state.station_etags[station.key],
    }
    return StationDocument.model_construct(**values)


class NeighbourFrame(BaseModel):
    """A frame of the same camera just before or after that of a view."""

    offset: int = Field(description="Frames later; below zero: before.")
    label: str
    image: str = Field(description="Address of the frame.")


class NeighbourFrameList(ListDocument[NeighbourFrame]):
    """The frames around a view's, in their order; `sentence` says why there are none."""

    sentence: str | None

    @staticmethod
    def of(view: int, offsets: Sequence[int], why_none: str) -> NeighbourFrameList:
        """The document for a view and the offsets that there are."""
        items = [
            NeighbourFrame(
                offset=offset,
                label=describe_frame_offset(offset),
                image=f"{url_of_image(view)}?offset={offset}",
            )
            for offset in offsets
        ]
        return NeighbourFrameList(items=items, sentence=None if items else why_none)


def describe_frame_offset(offset: int) -> str:
    """``1 frame later``, ``3 frames before``."""
    return f"{plural(abs(offset), 'frame')} {'later' if offset > 0 else 'before'}"
