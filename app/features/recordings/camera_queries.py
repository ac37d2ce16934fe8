"""Cameras of the shots of recordings in the database."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, NamedTuple

from sqlalchemy import delete, insert, select

from app.db.session import Session, now
from app.features.datasets.tables import GroupModel, StationModel, ViewModel
from app.features.groups.insert_queries import next_id
from app.features.people.visibility_queries import shown_actor
from app.features.recordings.tables import ShotCamerasModel


class FrameView(NamedTuple):
    """A view that shows a frame of a recording: number of the frame, id of its group, and its key."""

    number: int
    group: int
    key: str
    has_lines: bool


def list_cameras_rows(session: Session, recording_id: int) -> Sequence[Any]:
    """The stretches of a recording that have cameras, in their order."""
    model = ShotCamerasModel
    columns = [column for column in model.__table__.columns if column.name != "actor"]
    actor = shown_actor(model.actor, model.created).label("actor")
    statement = select(*columns, actor).where(model.recording_id == recording_id)
    return session.execute(statement.order_by(model.first)).all()


def views_of_video(session: Session, dataset_id: int, sha256: str) -> list[FrameView]:
    """The views of a dataset that show a frame of a video, in any group: their pictures are kept below its sha256."""
    kept = ViewModel.media_path
    statement = (
        select(kept, ViewModel.group_id, ViewModel.key, StationModel.lines != "{}")
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(GroupModel.dataset_id == dataset_id, kept.contains(f"/{sha256}/"))
        .order_by(ViewModel.id)
    )
    found = []
    for path, group, key, has_lines in session.execute(statement):
        number = PurePath(path or "").stem
        if number.isascii() and number.isdigit():
            found.append(FrameView(int(number), group, key, has_lines))
    return found


def delete_overlapping(session: Session, recording_id: int, first: int, last: int) -> Sequence[Any]:
    """Delete what shares a frame with a stretch; returns its rows."""
    rows = list_cameras_rows(session, recording_id)
    gone = [row for row in rows if row.first <= last and first <= row.last]
    ids = [row.id for row in gone]
    session.execute(delete(ShotCamerasModel).where(ShotCamerasModel.id.in_(ids)))
    return gone


def insert_cameras(session: Session, **values: Any) -> None:
    """Insert the cameras of a stretch."""
    row = {"id": next_id(session, ShotCamerasModel), "created": now(), **values}
    session.execute(insert(ShotCamerasModel), [row])


def digests_of(session: Session) -> set[str]:
    """The digests of all files of cameras that are in use."""
    rows = session.execute(select(ShotCamerasModel.digest, ShotCamerasModel.before))
    return {digest for row in rows for digest in row if digest is not None}
