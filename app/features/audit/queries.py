"""The log as the audit asks for it: the newest entries first, of whom and of what is asked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, literal, or_, select

from app.db.json_columns import decompress_json
from app.db.log import LogModel
from app.db.session import Session
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.people.visibility_queries import Visibility, shown_actor_column
from app.soccer.actors import TOKEN


@dataclass(frozen=True)
class AuditQuery:
    """What is asked of the log; None: everything.

    Attributes:
        person: A person, with all of their tokens, or one actor.
        kinds: Kinds of entries.
        since: From this time on (UTC, ISO 8601).
        until: Before this time.
    """

    dataset_id: int | None = None
    group_id: int | None = None
    person: str | None = None
    kinds: tuple[str, ...] | None = None
    since: str | None = None
    until: str | None = None


@dataclass(frozen=True)
class AuditRow:
    """An entry under the names that are shown; ``dataset`` and ``label`` are None where they are gone."""

    id: int
    at: str
    actor: str
    kind: str
    dataset_id: int | None
    dataset: str | None
    group_id: int | None
    label: str | None
    station_id: int | None
    body: Any
    hash: str


_SHOWN = shown_actor_column(LogModel.actor, LogModel.at)


def list_audit_rows(
    session: Session, query: AuditQuery, visibility: Visibility, before: int | None, limit: int
) -> list[AuditRow]:
    """Entries that fit, the newest first, of the datasets that somebody sees."""
    statement = (
        select(
            LogModel.id,
            LogModel.at,
            _SHOWN.label("actor"),
            LogModel.kind,
            LogModel.dataset_id,
            DatasetModel.name.label("dataset"),
            LogModel.group_id,
            GroupModel.label,
            GroupModel.key,
            LogModel.station_id,
            LogModel.body,
            LogModel.hash,
        )
        .outerjoin(DatasetModel, DatasetModel.id == LogModel.dataset_id)
        .outerjoin(GroupModel, GroupModel.id == LogModel.group_id)
        .where(*_query_conditions(query, visibility, before))
        .order_by(LogModel.id.desc())
        .limit(limit)
    )
    rows: Sequence[Any] = session.execute(statement).all()
    return [_build_audit_row(row) for row in rows]


def _build_audit_row(row: Any) -> AuditRow:
    values = dict(row._mapping)
    key = values.pop("key")
    return AuditRow(**{**values, "label": row.label or key, "body": decompress_json(row.body)})


def _query_conditions(
    query: AuditQuery, visibility: Visibility, before: int | None
) -> list[ColumnElement[bool]]:
    where: list[ColumnElement[bool]] = []
    seen = visibility.condition(LogModel.dataset_id, literal("somebody"))
    if seen is not None:
        where.append(seen)
    if before is not None:
        where.append(LogModel.id < before)
    if query.dataset_id is not None:
        where.append(LogModel.dataset_id == query.dataset_id)
    if query.group_id is not None:
        where.append(LogModel.group_id == query.group_id)
    if query.person is not None:
        tokens = _SHOWN.startswith(f"{query.person}{TOKEN}", autoescape=True)
        where.append(or_(_SHOWN.in_([query.person]), tokens))
    if query.kinds is not None:
        where.append(LogModel.kind.in_(query.kinds))
    if query.since is not None:
        where.append(LogModel.at >= query.since)
    if query.until is not None:
        where.append(LogModel.at < query.until)
    return where
