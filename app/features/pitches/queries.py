"""Pitches in the database: the size that each match has, and the one that its lines show."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ForeignKey, and_, delete, func, insert, select
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.dialect import insert_or_replace, select_from_number_list
from app.db.json_columns import decompress_json, parse_json_column
from app.db.log import LogEntry, LogModel, read_log
from app.db.session import Base, Session
from app.features.datasets.tables import GroupModel, ImportFindingModel, StationModel, ViewModel
from app.soccer.annotation import Lines
from app.soccer.codec import digest_json, lines_from_json, picture_geometry_from_json
from app.soccer.finding import PITCH_SIZE
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch

PITCH = "pitch"
"""Kind of the log's entries that say how long and wide a pitch is, one for each group."""


class PitchEstimateModel(Base):
    """A size that was estimated, metres; ``inputs`` digests what it was estimated from.

    A length or width without a number is unknown; ``problem`` says why both are.
    """

    __tablename__ = "pitch_estimate"

    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"), primary_key=True)
    match: Mapped[str] = mapped_column(primary_key=True)
    inputs: Mapped[str]
    length: Mapped[float | None]
    width: Mapped[float | None]
    length_sigma: Mapped[float | None]
    width_sigma: Mapped[float | None]
    frames: Mapped[int]
    problem: Mapped[str | None]


@dataclass(frozen=True)
class MatchPitch:
    """The pitch that a match has now.

    Attributes:
        group_id: Of its first group, like ``group`` (the key).
        groups: How many it has.
        pitches: The sizes that they have: one, but for a dataset that brought several.
    """

    match: str
    group_id: int
    group: str
    groups: int
    pitches: tuple[Pitch, ...]


def read_match_pitches(session: Session, dataset_id: int) -> list[MatchPitch]:
    """Every match of a dataset, by name; groups without a match are one, without a name."""
    model = GroupModel
    statement = (
        select(model.match, model.pitch_length, model.pitch_width, func.count(), func.min(model.id))
        .where(model.dataset_id == dataset_id)
        .group_by(model.match, model.pitch_length, model.pitch_width)
        .order_by(model.match, func.count().desc())
    )
    rows: dict[str, list[Any]] = {}
    for row in session.execute(statement):
        rows.setdefault(row[0], []).append(row)
    first = {match: min(row[4] for row in found) for match, found in rows.items()}
    keys = _group_keys(session, first.values())
    return [
        MatchPitch(
            match,
            first[match],
            keys[first[match]],
            sum(row[3] for row in found),
            tuple(Pitch(row[1], row[2]) for row in found),
        )
        for match, found in rows.items()
    ]


def list_groups_of_match(session: Session, dataset_id: int, match: str) -> list[int]:
    """Ids of the groups of a match."""
    model = GroupModel
    where = (model.dataset_id == dataset_id, model.match == match)
    return list(session.scalars(select(model.id).where(*where).order_by(model.id)))


def digest_lines_of_matches(session: Session, dataset_id: int) -> dict[str, str]:
    """Digest of the lines of each match's cameras."""
    rows = session.execute(_select_cameras_with_lines(StationModel.digest, dataset_id=dataset_id))
    digests: dict[str, list[str]] = {}
    for match, value in rows:
        digests.setdefault(match, []).append(value)
    return {match: digest_json(sorted(values)) for match, values in digests.items()}


def read_lines_of_match(
    session: Session, dataset_id: int, match: str
) -> list[tuple[Lines, ImageSize]]:
    """Lines and size of every camera that shows the pitch of a match, as its picture was taken."""
    columns = (
        StationModel.id,
        StationModel.lines,
        StationModel.width,
        StationModel.height,
        StationModel.picture,
    )
    statement = _select_cameras_with_lines(*columns, dataset_id=dataset_id).where(
        GroupModel.match == match
    )
    rows = session.execute(statement.order_by(StationModel.id)).all()
    seen = (_restore_original_lines(row) for row in rows)
    return [item for item in seen if item is not None]


def _restore_original_lines(row: Any) -> tuple[Lines, ImageSize] | None:
    """What a camera's lines are without what was done to its picture; None where nobody knows that."""
    lines, size = lines_from_json(parse_json_column(row.lines)), ImageSize(row.width, row.height)
    picture = (
        None if row.picture is None else picture_geometry_from_json(parse_json_column(row.picture))
    )
    if picture is None:
        return lines, size
    return (picture.lines_in_original_picture(lines, size), size) if picture.is_known else None


def _select_cameras_with_lines(*columns: Any, dataset_id: int) -> Any:
    """Each match's cameras that have lines, once."""
    return (
        select(GroupModel.match, *columns)
        .join(ViewModel, ViewModel.group_id == GroupModel.id)
        .join(StationModel, StationModel.id == ViewModel.station_id)
        .where(GroupModel.dataset_id == dataset_id, StationModel.lines != "{}")
        .distinct()
    )


def read_pitch_estimates(session: Session, dataset_id: int) -> dict[str, Any]:
    """The rows of what was estimated, by match."""
    model = PitchEstimateModel
    rows = session.execute(select(*model.__table__.columns).where(model.dataset_id == dataset_id))
    return {row.match: row for row in rows}


def save_pitch_estimate(session: Session, dataset_id: int, match: str, **values: Any) -> None:
    """Put an estimate in the place of the one before."""
    statement = insert_or_replace(PitchEstimateModel)
    session.execute(statement, [{"dataset_id": dataset_id, "match": match, **values}])


def read_edited_pitches(
    session: Session, dataset_id: int, matches: Iterable[str]
) -> dict[str, Pitch]:
    """The size that a person gave to matches last, where one did.

    Groups without a match have none in common: nobody knows whether others come from that pitch.
    """
    newest = _select_newest_pitch_entries(dataset_id).where(
        GroupModel.match.in_(set(matches) - {""})
    )
    statement = (
        select(GroupModel.match, GroupModel.pitch_length, GroupModel.pitch_width)
        .join(LogModel, LogModel.group_id == GroupModel.id)
        .where(LogModel.id.in_(newest))
    )
    return {match: Pitch(*size) for match, *size in session.execute(statement)}


def is_pitch_edited(session: Session, group_id: int) -> bool:
    """Whether a person gave a group the size of its pitch."""
    statement = select(LogModel.id).where(LogModel.group_id == group_id, LogModel.kind == PITCH)
    return session.scalar(statement.limit(1)) is not None


def find_last_pitch_changes(session: Session, dataset_id: int) -> dict[str, LogEntry]:
    """The newest log entry that said how large the pitch of each match is, where one did.

    Only where all groups of the match had one size before, so that the entry tells it of all of
    them; of groups without a match, only where it was said of all that there are.
    """
    entries = {
        entry.group_id: entry
        for entry in read_log(session, LogModel.id.in_(_select_newest_pitch_entries(dataset_id)))
    }
    model = GroupModel
    rows = session.execute(
        select(model.id, model.match).where(
            model.id.in_(select_from_number_list(key for key in entries if key is not None))
        )
    )
    changes = {row.match: entries[row.id] for row in rows}
    return {
        match: entry
        for match, entry in changes.items()
        if _had_one_size_before(session, dataset_id, match, entry.body)
    }


def _had_one_size_before(
    session: Session, dataset_id: int, match: str, body: Mapping[str, Any]
) -> bool:
    """Whether each group of a match changed as the last one did, or still has the size of before.

    They need not have changed at once: an import changes one after the other. Those without a match all have to.
    """
    model = GroupModel
    newest = (
        select(func.max(LogModel.id))
        .join(model, model.id == LogModel.group_id)
        .where(LogModel.kind == PITCH, model.dataset_id == dataset_id, model.match == match)
        .group_by(LogModel.group_id)
    )
    statement = (
        select(LogModel.body, model.pitch_length, model.pitch_width)
        .select_from(model)
        .outerjoin(LogModel, and_(LogModel.group_id == model.id, LogModel.id.in_(newest)))
        .where(model.dataset_id == dataset_id, model.match == match)
    )
    before = Pitch(body["inverse"]["length"], body["inverse"]["width"])
    for changed, *size in session.execute(statement.distinct()):
        same = changed is not None and decompress_json(changed) == body
        if not same and (not match or Pitch(*size) != before):
            return False
    return True


def _select_newest_pitch_entries(dataset_id: int) -> Any:
    """Ids of the newest entry about the pitch of each match."""
    return (
        select(func.max(LogModel.id))
        .join(GroupModel, GroupModel.id == LogModel.group_id)
        .where(LogModel.kind == PITCH, GroupModel.dataset_id == dataset_id)
        .group_by(GroupModel.match)
    )


def replace_pitch_findings(
    session: Session, dataset_id: int, found: Iterable[tuple[int, str]]
) -> list[int]:
    """Put findings (group and sentence) in the place of a dataset's; returns groups concerned."""
    model = ImportFindingModel
    mine = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    where = (model.kind == PITCH_SIZE, model.group_id.in_(mine))
    present = {
        (row.group_id, row.sentence)
        for row in session.execute(select(model.group_id, model.sentence).where(*where))
    }
    wanted = set(found)
    if present == wanted:
        return []
    session.execute(delete(model).where(*where))
    if wanted:
        rows = [
            {"group_id": group, "view": None, "kind": PITCH_SIZE, "sentence": sentence}
            for group, sentence in sorted(wanted)
        ]
        session.execute(insert(model), rows)
    return sorted({group for group, _ in present ^ wanted})


def _group_keys(session: Session, ids: Iterable[int]) -> dict[int, str]:
    model = GroupModel
    rows = session.execute(
        select(model.id, model.key).where(model.id.in_(select_from_number_list(ids)))
    )
    return {row.id: row.key for row in rows}
