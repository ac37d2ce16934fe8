"""What imports ask of the database: which groups, cameras and verdicts are there already."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import func, select

from app.db.log import LogEntry, LogModel, read_log
from app.db.session import Session
from app.features.datasets.tables import GroupModel, StationModel
from app.features.groups.view_queries import StoredStation, station_from_row
from app.features.verdicts.tables import VerdictModel

VERDICT = (
    "actor",
    "at",
    "state",
    "reason",
    "note",
    "inputs_hash",
    "policy_hash",
    "fixed",
    "override",
)
"""What is carried of a verdict."""


@dataclass(frozen=True)
class KnownGroup:
    """A group that is there; ``source_hash`` is that of what its dataset last brought."""

    id: int
    key: str
    match: str
    source_hash: str


def list_known_groups(
    session: Session, dataset_id: int, keys: Iterable[str] | None = None
) -> list[KnownGroup]:
    """The groups of a dataset in their order, or those of some keys."""
    model = GroupModel
    statement = select(model.id, model.key, model.match, model.source_hash).where(
        model.dataset_id == dataset_id
    )
    if keys is not None:
        statement = statement.where(model.key.in_(list(keys)))
    rows = session.execute(statement.order_by(model.number))
    return [KnownGroup(*row) for row in rows]


def find_newest_imports(session: Session, group_ids: Sequence[int]) -> list[LogEntry]:
    """The last import of each group."""
    newest = (
        select(func.max(LogModel.id))
        .where(LogModel.kind == "import", LogModel.group_id.in_(group_ids))
        .group_by(LogModel.group_id)
    )
    return list(read_log(session, LogModel.id.in_(newest)))


def list_shared_stations(
    session: Session, dataset_id: int, key: str | None = None
) -> list[StoredStation]:
    """The static cameras of a dataset by key, or the one of a key."""
    statement = select(*StationModel.__table__.columns).where(
        StationModel.dataset_id == dataset_id, StationModel.shared
    )
    if key is not None:
        statement = statement.where(StationModel.key == key)
    return [station_from_row(row) for row in session.execute(statement.order_by(StationModel.key))]


def list_verdicts_of_groups(
    session: Session, ids: Iterable[int]
) -> dict[int, list[dict[str, Any]]]:
    """The verdicts of groups to export, by group, oldest first."""
    columns = [getattr(VerdictModel, name) for name in VERDICT]
    statement = (
        select(VerdictModel.group_id, *columns)
        .where(VerdictModel.group_id.in_(list(ids)))
        .order_by(VerdictModel.id)
    )
    verdicts: dict[int, list[dict[str, Any]]] = {}
    for group_id, *values in session.execute(statement):
        verdicts.setdefault(group_id, []).append(dict(zip(VERDICT, values, strict=True)))
    return verdicts
