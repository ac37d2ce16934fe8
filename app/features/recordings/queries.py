"""Recordings in the database."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, cast

from sqlalchemy import Select, delete, func, insert, select, update

from app.db.session import Session, now
from app.features.datasets.tables import DatasetModel, GroupModel, ViewModel
from app.features.groups.insert_queries import next_id
from app.features.people.visibility_queries import shown_actor
from app.features.recordings.tables import RecordingModel


class RecordingRow(Protocol):
    """A row of a recording, with the name of its dataset and how many groups were taken from it."""

    id: int
    dataset_id: int
    dataset: str
    name: str
    path: str
    stamp: str | None
    sha256: str | None
    facts: str | None
    shots: str
    revision: int
    actor: str
    created: str
    clocks: str | None
    groups: int


def _rows() -> Select[Any]:
    columns = (
        column for column in RecordingModel.__table__.columns if column.name not in ("actor",)
    )
    actor = shown_actor(RecordingModel.actor, RecordingModel.created).label("actor")
    # Keys of groups that were taken from it begin with its name.
    taken = (
        select(func.count())
        .where(
            GroupModel.dataset_id == RecordingModel.dataset_id,
            GroupModel.match == RecordingModel.name,
        )
        .scalar_subquery()
    )
    return select(
        *columns, actor, DatasetModel.name.label("dataset"), taken.label("groups")
    ).join_from(RecordingModel, DatasetModel, DatasetModel.id == RecordingModel.dataset_id)


def list_rows(session: Session, dataset_id: int | None = None) -> Sequence[RecordingRow]:
    """The recordings of a dataset, or of all, the newest first."""
    statement = _rows().order_by(RecordingModel.id.desc())
    if dataset_id is not None:
        statement = statement.where(RecordingModel.dataset_id == dataset_id)
    return cast(Sequence[RecordingRow], session.execute(statement).all())


def find_recording(session: Session, recording_id: int) -> RecordingRow | None:
    """A recording by its id."""
    found = session.execute(_rows().where(RecordingModel.id == recording_id)).one_or_none()
    return cast(RecordingRow | None, found)


def names_and_paths(session: Session, dataset_id: int) -> Sequence[Any]:
    """``id``, ``name``, ``path`` and ``sha256`` of a dataset's recordings."""
    columns = (RecordingModel.id, RecordingModel.name, RecordingModel.path, RecordingModel.sha256)
    return session.execute(select(*columns).where(RecordingModel.dataset_id == dataset_id)).all()


def taken_frames(session: Session, dataset_id: int, name: str) -> Sequence[Any]:
    """``key`` and ``id`` of the groups that were taken from a recording."""
    statement = select(GroupModel.key, GroupModel.id).where(
        GroupModel.dataset_id == dataset_id, GroupModel.match == name
    )
    return session.execute(statement).all()


def match_names(session: Session, dataset_id: int) -> set[str]:
    """The matches of a dataset's groups."""
    statement = select(GroupModel.match).where(GroupModel.dataset_id == dataset_id).distinct()
    return set(session.scalars(statement))


def matches_of_video(session: Session, dataset_id: int, sha256: str) -> list[str]:
    """The matches of groups whose first view shows a frame of a video, that with most of them first."""
    statement = (
        select(GroupModel.match)
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .where(
            GroupModel.dataset_id == dataset_id,
            ViewModel.position == 0,
            ViewModel.media_path.contains(f"/{sha256}/"),
        )
        .group_by(GroupModel.match)
        .order_by(func.count().desc(), GroupModel.match)
    )
    return list(session.scalars(statement))


def insert_recording(session: Session, dataset_id: int, name: str, path: str, *, actor: str) -> int:
    """Insert a recording that is not indexed yet; returns its id."""
    identity = next_id(session, RecordingModel)
    values = {"id": identity, "dataset_id": dataset_id, "name": name, "path": path}
    empty = {"stamp": None, "sha256": None, "facts": None, "shots": "[]", "revision": 0}
    empty |= {"clocks": None}
    session.execute(insert(RecordingModel), [{**values, **empty, "actor": actor, "created": now()}])
    return identity


def update_recording(session: Session, recording_id: int, **values: Any) -> None:
    """Change columns of a recording."""
    session.execute(update(RecordingModel).where(RecordingModel.id == recording_id).values(values))


def delete_recording(session: Session, recording_id: int) -> None:
    """Delete a recording; the groups that were taken from it stay."""
    session.execute(delete(RecordingModel).where(RecordingModel.id == recording_id))
