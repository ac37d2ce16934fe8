"""Shared positions in the database: what each match has, and who said so last."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.soccer.group import SharedPosition
from app.store.codecs import as_written, parse, positions_from_json
from app.store.digest import digest
from app.store.log import LogEntry, read_log
from app.store.models import GroupModel, LogModel, StationModel, ViewModel

POSITION = "position"
"""Kind of the log's entries that say where a match puts cameras, one for each group."""


@dataclass
class MatchPositions:
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
    def inputs(self) -> str:
        """Digest of the parts, in whatever order they were read."""
        return digest(sorted(self.parts))


def match_positions(session: Session, dataset_id: int) -> list[MatchPositions]:
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
    found: dict[str, MatchPositions] = {}
    for row in session.execute(statement):
        item = found.setdefault(row.match, MatchPositions(row.match))
        item.groups.append(row.id)
        item.views += row.has_lines
        item.parts.append([row.pitch_length, row.pitch_width, row.digest])
        if row.positions is not None:
            item.positions += read_positions(row.positions).values()
    return list(found.values())


def read_positions(text: str) -> Mapping[str, SharedPosition]:
    """The positions of a group from their column."""
    with as_written():
        return positions_from_json(parse(text))


def last_positions(session: Session, dataset_id: int) -> dict[str, list[LogEntry]]:
    """The entries that gave the groups of each match their positions last, all of one time."""
    statement = (
        select(LogModel.id, LogModel.at, GroupModel.match)
        .join(GroupModel, GroupModel.id == LogModel.group_id)
        .where(LogModel.kind == POSITION, GroupModel.dataset_id == dataset_id)
        .order_by(LogModel.id.desc())
    )
    newest: dict[str, str] = {}
    matches: dict[int, str] = {}
    for row in session.execute(statement):
        if row.at == newest.setdefault(row.match, row.at):
            matches[row.id] = row.match
    entries: dict[str, list[LogEntry]] = {}
    for entry in read_log(session, LogModel.id.in_(list(matches))):
        entries.setdefault(matches[entry.id], []).append(entry)
    return entries
