"""Recordings, their cameras, balls and links in the database."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath
from typing import Any, NamedTuple, Protocol, cast

from sqlalchemy import Select, delete, func, insert, or_, select, update
from sqlalchemy.orm import aliased

from app.db.session import Session, now
from app.features.datasets.tables import DatasetModel, GroupModel, StationModel, ViewModel
from app.features.groups.insert_queries import find_next_row_id, reserve_row_ids
from app.features.people.visibility_queries import list_columns_with_shown_actor, shown_actor_column
from app.features.predictions.tables import PredictionModel
from app.features.recordings.tables import (
    BallRunModel,
    RecordingModel,
    ShotCamerasModel,
    ShotLinkModel,
)


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


def _select_recordings() -> Select[Any]:
    columns = (
        column for column in RecordingModel.__table__.columns if column.name not in ("actor",)
    )
    actor = shown_actor_column(RecordingModel.actor, RecordingModel.created).label("actor")
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


def list_recording_rows(session: Session, dataset_id: int | None = None) -> Sequence[RecordingRow]:
    """The recordings of a dataset, or of all, the newest first."""
    statement = _select_recordings().order_by(RecordingModel.id.desc())
    if dataset_id is not None:
        statement = statement.where(RecordingModel.dataset_id == dataset_id)
    return cast(Sequence[RecordingRow], session.execute(statement).all())


def find_recording(session: Session, recording_id: int) -> RecordingRow | None:
    """A recording by its id."""
    found = session.execute(
        _select_recordings().where(RecordingModel.id == recording_id)
    ).one_or_none()
    return cast(RecordingRow | None, found)


def list_names_and_paths(session: Session, dataset_id: int) -> Sequence[Any]:
    """``id``, ``name``, ``path`` and ``stamp`` of a dataset's recordings."""
    columns = (RecordingModel.id, RecordingModel.name, RecordingModel.path, RecordingModel.stamp)
    return session.execute(select(*columns).where(RecordingModel.dataset_id == dataset_id)).all()


def list_group_keys_of_recording(session: Session, dataset_id: int, name: str) -> Sequence[Any]:
    """``key`` and ``id`` of the groups that were taken from a recording."""
    statement = select(GroupModel.key, GroupModel.id).where(
        GroupModel.dataset_id == dataset_id, GroupModel.match == name
    )
    return session.execute(statement).all()


def list_match_names(session: Session, dataset_id: int) -> set[str]:
    """The matches of a dataset's groups."""
    statement = select(GroupModel.match).where(GroupModel.dataset_id == dataset_id).distinct()
    return set(session.scalars(statement))


def list_matches_of_video(session: Session, dataset_id: int, sha256: str) -> list[str]:
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
    identity = find_next_row_id(session, RecordingModel)
    values = {"id": identity, "dataset_id": dataset_id, "name": name, "path": path}
    empty = {"stamp": None, "sha256": None, "facts": None, "shots": "[]", "revision": 0}
    empty |= {"clocks": None}
    session.execute(insert(RecordingModel), [{**values, **empty, "actor": actor, "created": now()}])
    return identity


def update_recording(session: Session, recording_id: int, **values: Any) -> None:
    """Change columns of a recording."""
    session.execute(update(RecordingModel).where(RecordingModel.id == recording_id).values(values))


def delete_recording(session: Session, recording_id: int) -> None:
    """Delete a recording with its cameras, links and ball runs; the groups that were taken from it stay."""
    reserve_row_ids(session, RecordingModel, ShotLinkModel, BallRunModel)
    session.execute(delete(RecordingModel).where(RecordingModel.id == recording_id))


class ViewShowingFrame(NamedTuple):
    """A view that shows a frame of a recording: number of the frame, id of its group, and its key."""

    number: int
    group: int
    key: str
    has_lines: bool


def list_tracked_stretches(session: Session, recording_id: int) -> Sequence[Any]:
    """The stretches of a recording that have cameras, in their order."""
    model = ShotCamerasModel
    columns = [column for column in model.__table__.columns if column.name != "actor"]
    actor = shown_actor_column(model.actor, model.created).label("actor")
    statement = select(*columns, actor).where(model.recording_id == recording_id)
    return session.execute(statement.order_by(model.first)).all()


def list_views_of_video(session: Session, dataset_id: int, sha256: str) -> list[ViewShowingFrame]:
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
            found.append(ViewShowingFrame(int(number), group, key, has_lines))
    return found


def delete_overlapping_cameras(
    session: Session, recording_id: int, first: int, last: int
) -> Sequence[Any]:
    """Delete what shares a frame with a stretch; returns its rows, with the actors as they are stored."""
    table = ShotCamerasModel.__table__
    mine = (table.c.recording_id == recording_id, table.c.first <= last, first <= table.c.last)
    gone = session.execute(select(table).where(*mine).order_by(table.c.first)).all()
    ids = [row.id for row in gone]
    session.execute(delete(ShotCamerasModel).where(ShotCamerasModel.id.in_(ids)))
    return gone


def insert_cameras(session: Session, **values: Any) -> None:
    """Insert the cameras of a stretch."""
    row = {"id": find_next_row_id(session, ShotCamerasModel), "created": now(), **values}
    session.execute(insert(ShotCamerasModel), [row])


def list_camera_digests(session: Session) -> set[str]:
    """The digests of all files of cameras that are in use."""
    rows = session.execute(select(ShotCamerasModel.digest, ShotCamerasModel.before))
    return {digest for row in rows for digest in row if digest is not None}


def list_ball_run_rows(session: Session, recording_id: int) -> Sequence[Any]:
    """The runs of a recording by their first frames."""
    model = BallRunModel
    statement = select(*list_columns_with_shown_actor(model)).where(
        model.recording_id == recording_id
    )
    return session.execute(statement.order_by(model.first, model.id)).all()


def find_ball_run(session: Session, run_id: int) -> Any | None:
    """A run by its id."""
    statement = select(*list_columns_with_shown_actor(BallRunModel)).where(
        BallRunModel.id == run_id
    )
    return session.execute(statement).one_or_none()


def insert_ball_run(session: Session, actor: str, **values: Any) -> int:
    """Insert a run; returns its id."""
    identity = find_next_row_id(session, BallRunModel)
    new = {"groups": "{}", "confirmed": "[]", "accepted_by": None, "revision": 0}
    row = {"id": identity, **values, **new, "actor": actor, "created": now()}
    session.execute(insert(BallRunModel), [row])
    return identity


def update_ball_run(session: Session, run_id: int, **values: Any) -> None:
    """Change columns of a run."""
    session.execute(update(BallRunModel).where(BallRunModel.id == run_id).values(values))


def delete_ball_run(session: Session, run_id: int) -> None:
    """Delete a run."""
    reserve_row_ids(session, BallRunModel)
    session.execute(delete(BallRunModel).where(BallRunModel.id == run_id))


def read_predicted_boxes(
    session: Session, views: Sequence[ViewShowingFrame]
) -> dict[int, list[Any]]:
    """Boxes that detectors predicted in views, by number of the frame that a view shows."""
    numbers = {(view.group, view.key): view.number for view in views}
    model = PredictionModel
    statement = (
        select(
            ViewModel.group_id, ViewModel.key, model.x, model.y, model.width, model.height, model.score
        )
        .join(ViewModel, ViewModel.id == model.view_id)
        .where(ViewModel.group_id.in_(sorted({view.group for view in views})))
        .order_by(model.id)
    )  # fmt: skip
    found: dict[int, list[Any]] = {}
    for row in session.execute(statement):
        if (row.group_id, row.key) in numbers:
            found.setdefault(numbers[row.group_id, row.key], []).append(row)
    return found


_LIVE, _REPLAY = aliased(RecordingModel), aliased(RecordingModel)


def _select_links() -> Select[Any]:
    columns = (column for column in ShotLinkModel.__table__.columns if column.name != "actor")
    actor = shown_actor_column(ShotLinkModel.actor, ShotLinkModel.created).label("actor")
    sides = (
        column.label(f"{side}_{word}")
        for side, table in (("live", _LIVE), ("replay", _REPLAY))
        for word, column in (("name", table.name), ("sha256", table.sha256))
    )
    return (
        select(*columns, actor, *sides)
        .join_from(ShotLinkModel, _LIVE, _LIVE.id == ShotLinkModel.live_id)
        .join(_REPLAY, _REPLAY.id == ShotLinkModel.replay_id)
    )


def list_link_rows(session: Session, recording_id: int) -> Sequence[Any]:
    """The links whose live shot or whose replay is of a recording, by their live frames."""
    mine = or_(ShotLinkModel.live_id == recording_id, ShotLinkModel.replay_id == recording_id)
    order = (ShotLinkModel.live_id, ShotLinkModel.live_first, ShotLinkModel.id)
    return session.execute(_select_links().where(mine).order_by(*order)).all()


def find_link(session: Session, link_id: int) -> Any | None:
    """A link by its id."""
    return session.execute(_select_links().where(ShotLinkModel.id == link_id)).one_or_none()


def insert_link(session: Session, actor: str, **values: Any) -> int:
    """Insert a link; returns its id."""
    identity = find_next_row_id(session, ShotLinkModel)
    row = {"id": identity, **values, "revision": 0, "actor": actor, "created": now()}
    session.execute(insert(ShotLinkModel), [row])
    return identity


def update_link(session: Session, link_id: int, **values: Any) -> None:
    """Change columns of a link."""
    session.execute(update(ShotLinkModel).where(ShotLinkModel.id == link_id).values(values))


def delete_link(session: Session, link_id: int) -> None:
    """Delete a link."""
    reserve_row_ids(session, ShotLinkModel)
    session.execute(delete(ShotLinkModel).where(ShotLinkModel.id == link_id))


def delete_links(session: Session, recording_id: int) -> int:
    """Delete all links of a recording; returns how many there were."""
    reserve_row_ids(session, ShotLinkModel)
    mine = or_(ShotLinkModel.live_id == recording_id, ShotLinkModel.replay_id == recording_id)
    gone = delete(ShotLinkModel).where(mine).returning(ShotLinkModel.id)
    return len(session.scalars(gone).all())
