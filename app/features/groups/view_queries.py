"""Views and stations: rows to values and back."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, TypeVar

from sqlalchemy import ColumnElement, select, update

from app.db.dialects.dialect import select_from_number_list
from app.db.home_paths import find_stored_path
from app.db.json_columns import parse_json_column, translate_shape_errors_to_damage
from app.db.session import Session
from app.features.datasets.tables import GroupModel, StationModel, ViewModel
from app.features.groups.insert_queries import station_to_columns
from app.features.people.visibility_queries import visible_groups_condition
from app.features.queue.queries import Condition
from app.features.queue.tables import QueueModel
from app.geometry.camera import Camera
from app.soccer import codec
from app.soccer.annotation import BallAnnotation, Lines
from app.soccer.codec import ball_from_json, station_digest
from app.soccer.frames import ImageSize
from app.soccer.group import Media, Station
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch

FrameRow = TypeVar("FrameRow", "StoredView", "ViewFileFields")


class _FrameRow:
    """A row with the place of a frame."""

    media_path: str | None
    media_member: str | None
    media_frame: int | None

    @property
    def media(self) -> Media | None:
        """Its frame, where it has one."""
        if self.media_path is None:
            return None
        return Media(self.media_path, self.media_member, self.media_frame)


def _find_frames(session: Session, rows: list[FrameRow]) -> list[FrameRow]:
    """Rows with the places where their files lie in this home."""
    found = []
    for row in rows:
        path = row.media_path and find_stored_path(session, row.media_path)
        found.append(row if path == row.media_path else replace(row, media_path=path))
    return found


@dataclass(frozen=True)
class StoredView(_FrameRow):
    """A view with its annotated size in pixels, its frame, and its balls as they are stored.

    Attributes:
        group: Key; ``station`` that of its camera, which is ``shared`` where it stands still.
    """

    id: int
    key: str
    group_id: int
    group: str
    match: str
    station_id: int
    station: str
    shared: bool
    width: int
    height: int
    flipped: bool
    media_path: str | None
    media_member: str | None
    media_frame: int | None
    said: str

    @property
    def balls(self) -> list[BallAnnotation]:
        """The balls that were annotated in it."""
        with translate_shape_errors_to_damage():
            return [ball_from_json(value) for value in parse_json_column(self.said)]


def list_dataset_views(
    session: Session,
    dataset_id: int,
    conditions: Iterable[Condition] = (),
    *,
    ids: Collection[int] | None = None,
    without_ball: bool = False,
) -> list[StoredView]:
    """The views of a dataset in its order.

    Args:
        session: Any session.
        dataset_id: The dataset.
        conditions: Of a query, on the group's row in the queue.
        ids: Only these views; None: all.
        without_ball: Only those in which nobody annotated a ball.
    """
    wanted = list(conditions)
    if wanted:
        wanted.append(QueueModel.group_id == GroupModel.id)
    where = [GroupModel.dataset_id == dataset_id, *wanted]
    if ids is not None:
        where.append(ViewModel.id.in_(select_from_number_list(ids)))
    if without_ball:
        where.append(ViewModel.balls == "[]")
    return _read_views(session, *where)


@dataclass(frozen=True)
class ViewFileFields(_FrameRow):
    """What names the files of a view in an export."""

    group_id: int
    group: str
    match: str
    split: str
    key: str
    station: str
    shared: bool
    width: int
    height: int
    flipped: bool
    media_path: str | None
    media_member: str | None
    media_frame: int | None


def list_view_file_fields(session: Session, group_ids: Sequence[int]) -> list[ViewFileFields]:
    """The views of a few hundred groups in the order of their dataset."""
    view, group, station = ViewModel, GroupModel, StationModel
    statement = (
        select(
            group.id, group.key, group.match, group.split, view.key, station.key,
            station.shared, station.width, station.height, station.flipped, view.media_path,
            view.media_member, view.media_frame,
        )
        .join(group, group.id == view.group_id)
        .join(station, station.id == view.station_id)
        .where(group.id.in_(group_ids))
        .order_by(group.number, view.position)
    )  # fmt: skip
    rows: Iterable[Any] = session.execute(statement)
    return _find_frames(session, [ViewFileFields(*row) for row in rows])


def list_frame_files(session: Session, dataset_id: int) -> list[str]:
    """The files that the frames of a dataset lie in, each once."""
    statement = select(ViewModel.media_path).where(ViewModel.media_path.is_not(None)).distinct()
    statement = statement.join(GroupModel, GroupModel.id == ViewModel.group_id)
    found = session.scalars(statement.where(GroupModel.dataset_id == dataset_id))
    return [find_stored_path(session, path) for path in found if path is not None]


def list_group_views(session: Session, group_id: int) -> list[StoredView]:
    """The views of a group in their order."""
    return _read_views(session, ViewModel.group_id == group_id)


def find_view(session: Session, view_id: int) -> StoredView | None:
    """One view by its id."""
    return next(iter(_read_views(session, ViewModel.id == view_id)), None)


def list_views_of_camera(
    session: Session, dataset_id: int, match: str, station_id: int
) -> list[StoredView]:
    """The views of a match that a camera shows, of groups that whoever asks may see."""
    return _read_views(
        session,
        GroupModel.dataset_id == dataset_id,
        GroupModel.match == match,
        ViewModel.station_id == station_id,
        *visible_groups_condition(dataset_id, GroupModel.id),
    )


def find_dataset_of_group(session: Session, group_id: int) -> int | None:
    """Id of the dataset of a group."""
    return session.scalar(select(GroupModel.dataset_id).where(GroupModel.id == group_id))


def find_dataset_of_view(session: Session, view_id: int) -> int | None:
    """Id of the dataset of a view's group."""
    return session.scalar(
        select(GroupModel.dataset_id)
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .where(ViewModel.id == view_id)
    )


def find_group_and_view_ids(
    session: Session, dataset_id: int, keys: Collection[str]
) -> dict[str, tuple[int, dict[str, int]]]:
    """Id of each group that whoever asks may see, and of its views, by their keys."""
    statement = (
        select(GroupModel.key, GroupModel.id, ViewModel.key, ViewModel.id)
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .where(GroupModel.dataset_id == dataset_id, GroupModel.key.in_(keys))
        .where(*visible_groups_condition(dataset_id, GroupModel.id))
    )
    found: dict[str, tuple[int, dict[str, int]]] = {}
    for group, group_id, view, view_id in session.execute(statement):
        found.setdefault(group, (group_id, {}))[1][view] = view_id
    return found


def _read_views(session: Session, *where: ColumnElement[bool]) -> list[StoredView]:
    view, group, station = ViewModel, GroupModel, StationModel
    statement = (
        select(
            view.id, view.key, group.id, group.key, group.match, station.id, station.key,
            station.shared, station.width, station.height, station.flipped, view.media_path,
            view.media_member, view.media_frame, view.balls,
        )
        .join(group, group.id == view.group_id)
        .join(station, station.id == view.station_id)
        .where(*where)
        .order_by(group.number, view.position)
    )  # fmt: skip
    rows: Iterable[Any] = session.execute(statement)
    return _find_frames(session, [StoredView(*row) for row in rows])


@dataclass(frozen=True)
class StoredStation:
    """A station with its row's keeping; ``edited`` says that a person changed it."""

    id: int
    dataset_id: int
    revision: int
    station: Station
    digest: str
    source_digest: str

    @property
    def edited(self) -> bool:
        """Whether it differs from what its dataset brought."""
        return self.digest != self.source_digest


def read_stations(session: Session, ids: Iterable[int]) -> dict[int, StoredStation]:
    """Stations by id."""
    statement = select(*StationModel.__table__.columns).where(StationModel.id.in_(list(ids)))
    return {row.id: station_from_row(row) for row in session.execute(statement)}


def station_from_row(row: Any) -> StoredStation:
    """A station from all columns of its row."""
    station = Station(
        key=row.key,
        size=ImageSize(row.width, row.height),
        shared=row.shared,
        lines=_lines_from_text(row.lines),
        given=None if row.given is None else _parse_camera(row.given),
        calibration=row.calibration,
        flipped=row.flipped,
        given_covariance=None if row.given is None else _covariance_from_text(row.given),
        picture=None if row.picture is None else _picture_geometry_from_text(row.picture),
        proposed=() if row.proposed is None else _proposed_markings_from_text(row.proposed),
        not_visible=_not_visible_markings_from_text(row.lines),
    )
    return StoredStation(
        row.id, row.dataset_id, row.revision, station, row.digest, row.source_digest
    )


def save_station(
    session: Session, stored: StoredStation, station: Station, *, source: Station | None = None
) -> None:
    """Write the next revision of a station; its groups' hashes are the caller's to refresh.

    ``source`` is the station as it would be had nobody edited it, where the dataset changed.
    """
    values = {**station_to_columns(station), "revision": stored.revision + 1}
    if source is not None:
        values["source_digest"] = station_digest(source)
    session.execute(update(StationModel).where(StationModel.id == stored.id).values(values))


def list_groups_of_station(
    session: Session, station_id: int, visible_in: int | None = None
) -> list[int]:
    """Ids of the groups that a station's views belong to.

    Args:
        session: Any session.
        station_id: Which station.
        visible_in: Id of its dataset, for those alone that whoever asks may see.
    """
    where = [] if visible_in is None else visible_groups_condition(visible_in, ViewModel.group_id)
    statement = select(ViewModel.group_id).where(ViewModel.station_id == station_id, *where)
    return list(session.scalars(statement.distinct().order_by(ViewModel.group_id)))


def list_station_pitches(session: Session, dataset_id: int) -> list[tuple[int, Pitch]]:
    """Ids of a dataset's static cameras with each size of pitch that their groups have."""
    statement = (
        select(StationModel.id, GroupModel.pitch_length, GroupModel.pitch_width)
        .join(ViewModel, ViewModel.station_id == StationModel.id)
        .join(GroupModel, GroupModel.id == ViewModel.group_id)
        .where(StationModel.dataset_id == dataset_id, StationModel.shared)
        .distinct()
    )
    return [(station, Pitch(*size)) for station, *size in session.execute(statement)]


@lru_cache(maxsize=1024)
def _lines_from_text(text: str) -> Lines:
    with translate_shape_errors_to_damage():
        return codec.lines_from_json(parse_json_column(text))


@lru_cache(maxsize=1024)
def _not_visible_markings_from_text(text: str) -> tuple[str, ...]:
    with translate_shape_errors_to_damage():
        return codec.not_visible_markings_from_json(parse_json_column(text))


@lru_cache(maxsize=1024)
def _parse_camera(text: str) -> Camera:
    with translate_shape_errors_to_damage():
        return codec.camera_from_json(parse_json_column(text))


@lru_cache(maxsize=1024)
def _covariance_from_text(text: str) -> tuple[float, ...] | None:
    with translate_shape_errors_to_damage():
        return codec.covariance_from_json(parse_json_column(text).get("covariance"))


@lru_cache(maxsize=256)
def _proposed_markings_from_text(text: str) -> tuple[str, ...]:
    with translate_shape_errors_to_damage():
        return tuple(map(str, parse_json_column(text)))


@lru_cache(maxsize=256)
def _picture_geometry_from_text(text: str) -> PictureGeometry | None:
    with translate_shape_errors_to_damage():
        return codec.picture_geometry_from_json(parse_json_column(text))
