"""Views in the database, one by one, each with its group and its camera."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, select

from app.soccer.annotation import BallAnnotation
from app.soccer.media import Media
from app.store.codecs import ball_from_json
from app.store.conditions import Condition
from app.store.session import Session
from app.store.stored_json import as_written, parse
from app.store.tables.groups import GroupModel, StationModel, ViewModel
from app.store.tables.queue import QueueModel


class _Framed:
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


@dataclass(frozen=True)
class StoredView(_Framed):
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
        with as_written():
            return [ball_from_json(value) for value in parse(self.said)]


def dataset_views(
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
    asked = list(conditions)
    if asked:
        asked.append(QueueModel.group_id == GroupModel.id)
    where = [GroupModel.dataset_id == dataset_id, *asked]
    if ids is not None:
        where.append(ViewModel.id.in_(ids))
    if without_ball:
        where.append(ViewModel.balls == "[]")
    return _views(session, *where)


@dataclass(frozen=True)
class NamedView(_Framed):
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


def named_views(session: Session, group_ids: Sequence[int]) -> list[NamedView]:
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
    return [NamedView(*row) for row in rows]


def frame_files(session: Session, dataset_id: int) -> list[str]:
    """The files that the frames of a dataset lie in, each once."""
    statement = select(ViewModel.media_path).where(ViewModel.media_path.is_not(None)).distinct()
    statement = statement.join(GroupModel, GroupModel.id == ViewModel.group_id)
    found = session.scalars(statement.where(GroupModel.dataset_id == dataset_id))
    return [path for path in found if path is not None]


def group_views(session: Session, group_id: int) -> list[StoredView]:
    """The views of a group in their order."""
    return _views(session, ViewModel.group_id == group_id)


def find_view(session: Session, view_id: int) -> StoredView | None:
    """One view by its id."""
    return next(iter(_views(session, ViewModel.id == view_id)), None)


def group_dataset(session: Session, group_id: int) -> int | None:
    """Id of the dataset of a group."""
    return session.scalar(select(GroupModel.dataset_id).where(GroupModel.id == group_id))


def present_ids(
    session: Session, dataset_id: int, keys: Collection[str]
) -> dict[str, tuple[int, dict[str, int]]]:
    """Id of each group and of its views, by their keys."""
    statement = (
        select(GroupModel.key, GroupModel.id, ViewModel.key, ViewModel.id)
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .where(GroupModel.dataset_id == dataset_id, GroupModel.key.in_(keys))
    )
    found: dict[str, tuple[int, dict[str, int]]] = {}
    for group, group_id, view, view_id in session.execute(statement):
        found.setdefault(group, (group_id, {}))[1][view] = view_id
    return found


def _views(session: Session, *where: ColumnElement[bool]) -> list[StoredView]:
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
    return [StoredView(*row) for row in rows]
