"""Pictures of matches in the database: what was done to those of each main camera."""

from __future__ import annotations

from dataclasses import dataclass

from sqlalchemy import func, select

from app.soccer.picture import PictureGeometry
from app.store.codecs import picture_from_json
from app.store.session import Session
from app.store.stored_json import as_written, parse
from app.store.tables.groups import GroupModel, StationModel, ViewModel


@dataclass(frozen=True)
class MatchPictures:
    """The pictures of a match's main camera as they are in use.

    Attributes:
        frames: How many have lines.
        picture: What was done to most of them; None: they are as they were taken.
        mixed: They are not all alike.
    """

    match: str
    frames: int
    picture: PictureGeometry | None
    mixed: bool


def match_pictures(session: Session, dataset_id: int) -> list[MatchPictures]:
    """Every match of a dataset whose main camera has lines, by name."""
    group, station, count = GroupModel, StationModel, func.count()
    statement = (
        select(group.match, station.picture, count)
        .join(ViewModel, ViewModel.group_id == group.id)
        .join(station, station.id == ViewModel.station_id)
        .where(
            group.dataset_id == dataset_id,
            group.match != "",
            ViewModel.position == 0,
            station.shared.is_(False),
            station.lines != "{}",
        )
        .group_by(group.match, station.picture)
        .order_by(group.match, count.desc(), station.picture.nulls_first())
    )
    found: dict[str, list[tuple[str | None, int]]] = {}
    for match, picture, frames in session.execute(statement):
        found.setdefault(match, []).append((picture, frames))
    return [
        MatchPictures(match, sum(frames for _, frames in rows), _picture(rows[0][0]), len(rows) > 1)
        for match, rows in found.items()
    ]


def _picture(text: str | None) -> PictureGeometry | None:
    if text is None:
        return None
    with as_written():
        return picture_from_json(parse(text))
