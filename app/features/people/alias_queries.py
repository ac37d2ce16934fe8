"""Aliases: names in the log whose work, up to a moment, is shown as a person's. The log itself stays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from sqlalchemy import ColumnElement, func, insert, select, update

from app.db.log import LogEntry
from app.db.session import Session
from app.features.people.tables import ActorAliasModel, PersonModel
from app.features.queue.tables import QueueModel

_ALIASES = select(ActorAliasModel.actor, ActorAliasModel.at, PersonModel.name.label("shown")).join(
    PersonModel, PersonModel.id == ActorAliasModel.person_id
)


def shown_actor(actor: Any, at: Any) -> ColumnElement[str]:
    """Under which name it is shown what an actor did at a time; both are columns."""
    alias = (
        select(PersonModel.name)
        .join(ActorAliasModel, ActorAliasModel.person_id == PersonModel.id)
        .where(ActorAliasModel.actor == actor, at <= ActorAliasModel.at)
        .scalar_subquery()
    )
    return func.coalesce(alias, actor)


def columns_shown(model: Any) -> list[ColumnElement[Any]]:
    """The columns of a table with ``actor`` and ``created``, the actor under the name that is shown."""
    table = model.__table__
    rest = [column for column in table.columns if column.name != "actor"]
    return [*rest, shown_actor(table.c.actor, table.c.created).label("actor")]


def shown_entries(session: Session, entries: Iterable[LogEntry]) -> list[LogEntry]:
    """Entries of the log under the names that are shown."""
    aliases = {row.actor: row for row in session.execute(_ALIASES)}
    shown = []
    for entry in entries:
        alias = aliases.get(entry.actor)
        if alias is not None and entry.at <= alias.at:
            entry = replace(entry, actor=alias.shown)
        shown.append(entry)
    return shown


def given_aliases(session: Session) -> dict[str, str]:
    """As whose the work of each actor is shown that was given to somebody."""
    return {row.actor: row.shown for row in session.execute(_ALIASES)}


def find_alias(session: Session, actor: str) -> str | None:
    """As whose the work of an actor is shown; None where it was given to nobody."""
    return given_aliases(session).get(actor)


def insert_alias(session: Session, actor: str, person_id: int, name: str, at: str, by: str) -> None:
    """Show what an actor did until now as a person's, in the queue too."""
    values = {"actor": actor, "person_id": person_id, "at": at, "given_by": by}
    session.execute(insert(ActorAliasModel), values)
    session.execute(update(QueueModel).where(QueueModel.reviewer == actor).values(reviewer=name))
