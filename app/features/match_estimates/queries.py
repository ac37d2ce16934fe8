"""Matches in the database: pictures, shared positions, and accepted noise of balls."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, NamedTuple

from sqlalchemy import func, select, update

from app.db.json_columns import Json, parse_json_column, translate_shape_errors_to_damage
from app.db.log import LogEntry, LogModel, read_entries
from app.db.session import Session
from app.features.datasets.tables import DatasetModel, GroupModel, StationModel, ViewModel
from app.json_text import canonical_json_text
from app.soccer.codec import digest_json, picture_geometry_from_json, positions_from_json
from app.soccer.group import SharedPosition
from app.soccer.picture import PictureGeometry

NOISE = "noise"
"""Kind of the log's entries on noise: what is accepted for a dataset, and one for each group."""


class NoiseFactor(NamedTuple):
    """How noisy balls of a camera that a person places are beside the dataset's.

    Attributes:
        camera: Key of a static camera; None: any other.
        person: Who places the ball; None: anybody else, or the dataset itself.
        ratio: Of both sigmas; one where they may be alike.
    """

    camera: str | None
    person: str | None
    ratio: float


Factors = tuple[NoiseFactor, ...]


def read_noise_factors(session: Session, dataset_id: int) -> Factors:
    """The factors that are accepted for a dataset; none where all balls are alike."""
    return noise_factors_from_text(
        session.scalar(select(DatasetModel.noise).where(DatasetModel.id == dataset_id))
    )


def noise_factors_from_text(text: str | None) -> Factors:
    """The factors that a dataset's row holds."""
    if text is None:
        return ()
    with translate_shape_errors_to_damage():
        return tuple(NoiseFactor(*row) for row in parse_json_column(text))


def write_noise_factors(session: Session, dataset_id: int, factors: Factors) -> None:
    """Accept factors for a dataset; its groups are the caller's to change."""
    text = canonical_json_text(noise_factors_to_json(factors)) if factors else None
    mine = DatasetModel.id == dataset_id
    session.execute(update(DatasetModel).where(mine).values(noise=text))


def noise_factors_to_json(factors: Factors) -> Json:
    """``[[camera, person, ratio], ...]``."""
    return [list(item) for item in factors]


def find_noise_factor(
    factors: Sequence[NoiseFactor], camera: str | None, person: str | None
) -> float:
    """How noisy a ball is beside the dataset's; a camera or person that is not named is any other."""
    known = {(item.camera, item.person): item.ratio for item in factors}
    cameras, people = {item.camera for item in factors}, {item.person for item in factors}
    place = camera if camera in cameras else None, person if person in people else None
    return known.get(place, 1.0)


@dataclass(frozen=True)
class MatchPictureGeometry:
    """The pictures of a match's main camera as they are in use.

    Attributes:
        match: Name of the match.
        frames: How many of them have lines.
        picture: What was done to most of them; None: they are as they were taken.
        mixed: They are not all alike.
    """

    match: str
    frames: int
    picture: PictureGeometry | None
    mixed: bool


def read_match_picture_geometries(session: Session, dataset_id: int) -> list[MatchPictureGeometry]:
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
        MatchPictureGeometry(
            match,
            sum(frames for _, frames in rows),
            _picture_geometry_from_text(rows[0][0]),
            len(rows) > 1,
        )
        for match, rows in found.items()
    ]


def _picture_geometry_from_text(text: str | None) -> PictureGeometry | None:
    if text is None:
        return None
    with translate_shape_errors_to_damage():
        return picture_geometry_from_json(parse_json_column(text))


POSITION = "position"
"""Kind of the log's entries that say where a match puts cameras, one for each group."""


@dataclass
class MatchCameraPositions:
    """The pictures of a match's main camera.

    Attributes:
        parts: What their positions are estimated from, but for the policy: digests.
        groups: Ids of its groups.
        views: How many have lines.
        positions: Those that are shared.
    """

    match: str
    parts: list[list[Any]] = field(default_factory=list)
    groups: list[int] = field(default_factory=list)
    views: int = 0
    positions: list[SharedPosition] = field(default_factory=list)

    @property
    def inputs_digest(self) -> str:
        """Digest of the parts, in whatever order they were read."""
        return digest_json(sorted(self.parts))


def read_match_camera_positions(session: Session, dataset_id: int) -> list[MatchCameraPositions]:
    """Every match of a dataset, by name; the main camera is that of each group's first view."""
    group = GroupModel
    statement = (
        select(
            group.id, group.match, group.pitch_length, group.pitch_width, group.positions,
            StationModel.digest, (StationModel.lines != "{}").label("has_lines"),
        )
        .join(ViewModel, ViewModel.group_id == group.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(
            group.dataset_id == dataset_id,
            group.match != "",
            ViewModel.position == 0,
            StationModel.shared.is_(False),
        )
        .order_by(group.match, group.id)
    )  # fmt: skip
    found: dict[str, MatchCameraPositions] = {}
    for row in session.execute(statement):
        item = found.setdefault(row.match, MatchCameraPositions(row.match))
        item.groups.append(row.id)
        item.views += row.has_lines
        item.parts.append([row.pitch_length, row.pitch_width, row.digest])
        if row.positions is not None:
            item.positions += parse_positions_column(row.positions).values()
    return list(found.values())


def parse_positions_column(text: str) -> Mapping[str, SharedPosition]:
    """The positions of a group from their column."""
    with translate_shape_errors_to_damage():
        return positions_from_json(parse_json_column(text))


def read_position_input_digests(
    session: Session, dataset_id: int, match: str | None = None
) -> dict[str, str | None]:
    """What the positions of each match are estimated from, where any were ever given.

    Args:
        session: Any session.
        dataset_id: Of the dataset.
        match: This match alone; None: all.

    Returns:
        Keys by match; None for one whose first share was taken back.
    """
    rows = session.execute(
        _select_sharing_entries(
            func.max(LogModel.id), GroupModel.match, dataset_id=dataset_id, match=match
        ).group_by(GroupModel.match)
    ).all()
    newest = {entry.id: entry for entry in read_entries(session, [number for number, _ in rows])}
    found: dict[str, str | None] = {}
    for number, name in rows:
        entry: LogEntry | None = newest[number]
        if not _was_group_in_match(newest[number], name):
            # Its group was given that in another match.
            entry = next(
                (of[0] for of in _group_sharing_entries_by_time(session, dataset_id, name)), None
            )
        if entry is not None:
            found[name] = entry.body["inputs"]
    return found


def find_last_position_sharing(session: Session, dataset_id: int, match: str) -> list[LogEntry]:
    """The entries of a match's newest share that was not taken back; none where there is none."""
    taken_back = set()
    for entries in _group_sharing_entries_by_time(session, dataset_id, match):
        first = entries[0]
        if first.at in taken_back:
            continue
        if first.body["inputs"] is None:
            break
        if first.body.get("takes_back") is None:
            return entries
        taken_back.add(first.body["takes_back"])
    return []


def _group_sharing_entries_by_time(
    session: Session, dataset_id: int, match: str
) -> Iterator[list[LogEntry]]:
    """The entries that groups were given while in a match, by time, the newest first."""
    statement = _select_sharing_entries(
        LogModel.id, LogModel.at, dataset_id=dataset_id, match=match
    )
    rows = session.execute(statement.order_by(LogModel.id.desc())).all()
    for _, of_time in groupby(rows, key=lambda row: row.at):
        ids = sorted(row.id for row in of_time)
        entries = [
            entry for entry in read_entries(session, ids) if _was_group_in_match(entry, match)
        ]
        if entries:
            yield entries


def _select_sharing_entries(*columns: Any, dataset_id: int, match: str | None) -> Any:
    """Columns of the entries about the groups of a match, or of all, as these are now."""
    statement = (
        select(*columns)
        .join(GroupModel, GroupModel.id == LogModel.group_id)
        .where(LogModel.kind == POSITION, GroupModel.dataset_id == dataset_id)
    )
    return statement if match is None else statement.where(GroupModel.match == match)


def _was_group_in_match(entry: LogEntry, match: str) -> bool:
    """Whether the group was in the match then; the first entries did not say."""
    return bool(entry.body.get("match", match) == match)
