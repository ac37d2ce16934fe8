"""Paint in the database: what was read of pictures, and which reading gave it to which groups."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

from sqlalchemy import BindParameter, ForeignKey, Index, Table, bindparam, func, select, text, true
from sqlalchemy.orm import Mapped, mapped_column
from zlib_ng import zlib_ng

from app.db.dialects.dialect import any_value_of, insert, select_json_object_values
from app.db.json_columns import decompress, parse_json_column, translate_shape_errors_to_damage
from app.db.log import LogEntry, LogModel, read_entries
from app.db.session import Base, Session
from app.features.datasets.tables import GroupModel, PaintEvidenceModel, StationModel, ViewModel
from app.soccer.paint_evidence import PaintReading, reading_from_canonical_json

PAINT = "paint"
"""Kind of the log's entries that say what was read of a group's pictures."""
FOLLOWS = "follows"
"""In the body of such an entry: the edit beside which it was read, and with which it goes."""
_EVIDENCE = cast(Table, PaintEvidenceModel.__table__)
_DIGESTS: BindParameter[Any] = bindparam("digests", expanding=True)
_READINGS = (
    select(_EVIDENCE.c.digest, any_value_of(_EVIDENCE.c.body).label("body"))
    .where(_EVIDENCE.c.digest.in_(_DIGESTS))
    .group_by(_EVIDENCE.c.digest)
)
_WITHOUT_PICTURE = func.count(StationModel.id).filter(ViewModel.media_path.is_(None))
_BATCH = 500


class ProposalModel(Base):
    """What was proposed for one view when its picture was looked at last; ``lines`` are JSON.

    ``frame`` is the digest of the picture's bytes (empty: there were none), ``sought_with`` that
    of all else that was known, ``version`` that of what read the picture. ``beside`` is the digest
    of the station whose lines determined no camera then (empty: it had none); it is open beside those.
    """

    __tablename__ = "proposal"
    __table_args__ = (Index("proposal_outcome", "outcome"),)

    view_id: Mapped[int] = mapped_column(
        ForeignKey("view.id", ondelete="CASCADE"), primary_key=True
    )
    outcome: Mapped[str]
    sentence: Mapped[str]
    supported: Mapped[float | None]
    explained: Mapped[float | None]
    points: Mapped[int]
    error_px: Mapped[float | None]
    runner_up: Mapped[float | None]
    lines: Mapped[str]
    frame: Mapped[str]
    sought_with: Mapped[str]
    version: Mapped[str]
    beside: Mapped[str] = mapped_column(server_default=text("''"))


def insert_paint_readings(
    session: Session, dataset_id: int, readings: Iterable[PaintReading]
) -> None:
    """Keep readings under their digests; what is there already stays."""
    unique = {reading.digest: reading for reading in readings}
    if unique:
        session.execute(
            insert(_EVIDENCE).on_conflict_do_nothing(),
            [
                {
                    "digest": digest,
                    "dataset_id": dataset_id,
                    "reason": reading.reason,
                    "body": zlib_ng.compress(reading.canonical_json.encode()),
                }
                for digest, reading in unique.items()
            ],
        )


def read_paint_readings(session: Session, digests: Iterable[str]) -> dict[str, PaintReading]:
    """Readings by digest; unknown ones are left out.

    Raises:
        DamagedError: A reading is not what its digest says.
    """
    wanted, found = sorted(set(digests)), {}
    for start in range(0, len(wanted), _BATCH):
        some = wanted[start : start + _BATCH]
        for row in session.execute(_READINGS, {"digests": some}):
            found[row.digest] = decode_paint_reading(row.digest, row.body)
    return found


@lru_cache(maxsize=64)
def decode_paint_reading(digest: str, body: bytes) -> PaintReading:
    with translate_shape_errors_to_damage():
        reading = reading_from_canonical_json(decompress(body).decode())
        if reading.digest != digest:
            raise ValueError(f"the paint measurement stored under {digest} has another digest")
    return reading


def read_paint_digests(text: str | None) -> dict[str, str]:
    """Digest of what was read by view, from the column of a group."""
    if text is None:
        return {}
    with translate_shape_errors_to_damage():
        return dict(parse_json_column(text))


@dataclass(frozen=True)
class MatchPaintCounts:
    """What was read of the pictures of one match.

    Attributes:
        groups: Ids of its groups.
        views: Views of moving cameras with lines, of which paint could place the camera.
        without_picture: How many of them have no picture.
        painted: Ids of the groups of which something was read.
        reasons: How many readings there are by the reason why they are not solved with, or None.
    """

    match: str
    groups: tuple[int, ...]
    views: int
    without_picture: int
    painted: tuple[int, ...]
    reasons: Mapping[str | None, int]


def count_paint_by_match(session: Session, dataset_id: int) -> list[MatchPaintCounts]:
    """The counts of paint readings of each match of a dataset, by name."""
    group = GroupModel
    statement = (
        select(
            group.id,
            group.match,
            group.paint.is_not(None).label("painted"),
            func.count(StationModel.id).label("views"),
            _WITHOUT_PICTURE.label("without_picture"),
        )
        .outerjoin(ViewModel, ViewModel.group_id == group.id)
        .outerjoin(
            StationModel,
            (StationModel.id == ViewModel.station_id)
            & StationModel.shared.is_(False)
            & (StationModel.lines != "{}")
            & StationModel.picture.is_(None)
            & (StationModel.given.is_(None) | (StationModel.calibration != "given")),
        )
        .where(group.dataset_id == dataset_id)
        .group_by(group.id)
        .order_by(group.match, group.number)
    )
    reasons = _count_readings_by_reason(session, dataset_id)
    rows: dict[str, list[Any]] = {}
    for row in session.execute(statement):
        rows.setdefault(row.match, []).append(row)
    return [
        MatchPaintCounts(
            match,
            tuple(row.id for row in some),
            sum(row.views for row in some),
            sum(row.without_picture for row in some),
            tuple(row.id for row in some if row.painted),
            reasons.get(match, {}),
        )
        for match, some in rows.items()
    ]


def _count_readings_by_reason(
    session: Session, dataset_id: int
) -> dict[str, dict[str | None, int]]:
    """How many readings each match has by their reason; nothing of them is decoded."""
    group = GroupModel
    named = select_json_object_values(group.paint)
    statement = (
        select(group.match, _EVIDENCE.c.reason, func.count())
        .select_from(group)
        .join(named, true())
        .join(
            _EVIDENCE,
            (_EVIDENCE.c.digest == named.c.value) & (_EVIDENCE.c.dataset_id == group.dataset_id),
        )
        .where(group.dataset_id == dataset_id, group.paint.is_not(None))
        .group_by(group.match, _EVIDENCE.c.reason)
    )
    found: dict[str, dict[str | None, int]] = {}
    for match, reason, count in session.execute(statement):
        found.setdefault(match, {})[reason] = count
    return found


def find_last_paint_run_entries(session: Session, dataset_id: int) -> list[LogEntry]:
    """The entries of a dataset's newest reading that was not taken back; none where there is none."""
    taken_back: set[str] = set()
    runs: dict[str, list[LogEntry]] = {}
    for entry in _read_paint_log_entries(session, dataset_id):
        if FOLLOWS in entry.body:
            continue
        back = entry.body.get("takes_back")
        if back is not None:
            taken_back.add(back)
        else:
            runs.setdefault(entry.body["run"], []).append(entry)
    left = [run for run in runs if run not in taken_back]
    return runs[left[-1]] if left else []


def _read_paint_log_entries(session: Session, dataset_id: int) -> Iterator[LogEntry]:
    """Of the groups that a dataset has, oldest first."""
    statement = (
        select(LogModel.id)
        .join(GroupModel, GroupModel.id == LogModel.group_id)
        .where(LogModel.kind == PAINT, GroupModel.dataset_id == dataset_id)
        .order_by(LogModel.id)
    )
    return read_entries(session, list(session.scalars(statement)))
