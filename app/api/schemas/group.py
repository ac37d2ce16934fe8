"""The group document: one instant with all its views, its solution and its verdict."""

from __future__ import annotations

from datetime import datetime
from typing import Any

from pydantic import Field

from app.api.schemas.annotation import Ball, LineDocuments, lines_document
from app.api.schemas.document import Document
from app.api.schemas.policy import PolicyDocument
from app.api.schemas.solution import SolutionDocument
from app.review.editing.state import GroupState
from app.soccer.choices import CalibrationChoice, VerdictState
from app.soccer.frame_number import counts_time
from app.soccer.group import Group, View, view_letter
from app.soccer.reasons import LeftOut


class DatasetName(Document):
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


class PictureDocument(Document):
    """What was done to a picture since it was taken; `sigma` is wide where its lines say it."""

    aspect: float = Field(description="Width of a pixel by its height: 1.05 is stretched by 5 %.")
    shift: tuple[float, float] = Field(
        description="Of the optical axis from the middle, right and down, in half diagonals."
    )
    sigma: tuple[float, float, float] = Field(
        description="Standard deviations of the aspect and of both shifts."
    )


class StationDocument(Document):
    """The camera station of a view; a shared one is a static camera."""

    id: int
    key: str
    shared: bool
    calibration: CalibrationChoice = Field(description="Which calibration counts when both exist.")
    has_given: bool
    picture: PictureDocument | None = Field(
        description="What was done to the picture, where somebody said that something was."
    )
    etag: str = Field(description="For If-Match on `/stations/{id}/lines`.")


class LeftOutDocument(Document, shows=LeftOut):
    """Why a person left a view out of its group."""


class ViewDocument(Document):
    """One image of the instant, as annotated."""

    id: int
    key: str
    letter: str
    label: str
    width: int
    height: int
    included: bool
    left_out: LeftOutDocument | None = Field(
        description="Why a person left the view out, where they said so."
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
    dataset: DatasetName
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
            dataset=DatasetName(id=state.dataset_id, name=state.dataset),
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
                _view(state, view, index, label)
                for index, (view, label) in enumerate(
                    zip(group.views, view_labels(group), strict=True)
                )
            ],
            solution=None
            if state.solution is None
            else SolutionDocument.of(state.solution, group, state.dismissed),
        )


def view_labels(group: Group) -> list[str]:
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


def image_address(view_id: int) -> str:
    """Where the frame of a view is served."""
    return f"/api/v1/views/{view_id}/image"


def _view(state: GroupState, view: View, index: int, label: str) -> ViewDocument:
    view_id, why = state.view_ids[view.key], view.left_out
    return ViewDocument.model_construct(
        id=view_id,
        key=view.key,
        letter=view_letter(index),
        label=label,
        width=view.size.width,
        height=view.size.height,
        included=view.included,
        left_out=None if why is None else LeftOutDocument.model_validate(why),
        station=_station(state, view),
        lines=lines_document(view.station.lines),
        proposed=[*view.station.proposed],
        not_visible=[*view.station.not_visible],
        balls=[Ball.of(ball, edited=view.key in state.stored.edited_views) for ball in view.balls],
        image=None if view.media is None else image_address(view_id),
        neighbours=_neighbours(state.key, view, view_id),
    )


def _neighbours(group: str, view: View, view_id: int) -> str | None:
    media = view.media
    if media is None or not counts_time(media, group, view.station.shared):
        return None
    return f"/api/v1/views/{view_id}/neighbours"


def _station(state: GroupState, view: View) -> StationDocument:
    station = view.station
    values: dict[str, Any] = {
        "id": state.station_ids[station.key],
        "key": station.key,
        "shared": station.shared,
        "calibration": station.calibration,
        "has_given": station.given is not None,
        "picture": None
        if station.picture is None
        else PictureDocument.model_validate(station.picture),
        "etag": state.station_etags[station.key],
    }
    return StationDocument.model_construct(**values)
