"""Stations in the database: rows to values and back; a shared one belongs to many views."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from sqlalchemy import select, update

from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.group import Station
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.store import codecs
from app.store.digest import station_digest
from app.store.group_rows import station_values
from app.store.session import Session
from app.store.stored_json import as_written, parse
from app.store.tables.groups import GroupModel, StationModel, ViewModel


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
    return {row.id: stored_station(row) for row in session.execute(statement)}


def stored_station(row: Any) -> StoredStation:
    """A station from all columns of its row."""
    station = Station(
        key=row.key,
        size=ImageSize(row.width, row.height),
        shared=row.shared,
        lines=_lines(row.lines),
        given=None if row.given is None else _camera(row.given),
        calibration=row.calibration,
        flipped=row.flipped,
        given_covariance=None if row.given is None else _covariance(row.given),
        picture=None if row.picture is None else _picture(row.picture),
        proposed=() if row.proposed is None else _proposed(row.proposed),
        not_visible=_not_visible(row.lines),
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
    values = {**station_values(station), "revision": stored.revision + 1}
    if source is not None:
        values["source_digest"] = station_digest(source)
    session.execute(update(StationModel).where(StationModel.id == stored.id).values(values))


def groups_of_station(session: Session, station_id: int) -> list[int]:
    """Ids of the groups that a station's views belong to."""
    statement = select(ViewModel.group_id).where(ViewModel.station_id == station_id).distinct()
    return list(session.scalars(statement.order_by(ViewModel.group_id)))


def station_pitches(session: Session, dataset_id: int) -> list[tuple[int, Pitch]]:
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
def _lines(text: str) -> Lines:
    with as_written():
        return codecs.lines_from_json(parse(text))


@lru_cache(maxsize=1024)
def _not_visible(text: str) -> tuple[str, ...]:
    with as_written():
        return codecs.not_visible_from_json(parse(text))


@lru_cache(maxsize=1024)
def _camera(text: str) -> Camera:
    with as_written():
        return codecs.camera_from_json(parse(text))


@lru_cache(maxsize=1024)
def _covariance(text: str) -> tuple[float, ...] | None:
    with as_written():
        return codecs.covariance_from_json(parse(text).get("covariance"))


@lru_cache(maxsize=256)
def _proposed(text: str) -> tuple[str, ...]:
    with as_written():
        return tuple(map(str, parse(text)))


@lru_cache(maxsize=256)
def _picture(text: str) -> PictureGeometry | None:
    with as_written():
        return codecs.picture_from_json(parse(text))
