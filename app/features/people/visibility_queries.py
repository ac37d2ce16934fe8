"""Which datasets and groups the person of a request may see, and under which names others are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any

from sqlalchemy import ColumnElement, and_, func, insert, not_, or_, select, true, update

from app.db.log import LogEntry
from app.db.session import Session
from app.features.batches.tables import BatchGroupModel
from app.features.datasets.tables import DatasetModel, GroupModel, ViewModel
from app.features.independent_annotations.tables import GoldModel, IndependentAnnotationModel
from app.features.people.tables import ActorAliasModel, PersonModel
from app.features.queue.tables import QueueModel
from app.soccer.actors import TOKEN, is_actor_of

COPIES = 10**9
"""Ids of datasets of copies lie above it, and those of all others below: one that is made while
somebody listens is hidden from them from its first entry on."""
_ALIASES = select(ActorAliasModel.actor, ActorAliasModel.at, PersonModel.name.label("shown")).join(
    PersonModel, PersonModel.id == ActorAliasModel.person_id
)


@dataclass(frozen=True)
class RestrictedReader:
    """The person of a request who is not an admin.

    Attributes:
        person: Their name.
        batches: Open batches of copies that they annotate blind, by their dataset's id.
        judges: Whether they judge groups of a dataset: who does not may not know what people made of
            groups independently.
    """

    person: str
    batches: Mapping[int, frozenset[int]]
    judges: Callable[[int], bool]

    def hidden_group_condition(self, dataset_id: int, group: Any) -> ColumnElement[bool]:
        """Whether a group of a dataset is hidden from them, by the column of its id."""
        ids = sorted(self.batches[dataset_id])
        own = (
            IndependentAnnotationModel.batch_id.in_(ids),
            IndependentAnnotationModel.person == self.person,
        )
        returned = (
            BatchGroupModel.batch_id.in_(ids),
            BatchGroupModel.submitted_by == self.person,
            BatchGroupModel.submitted.is_(None),
            BatchGroupModel.settled.is_(None),
        )
        inside = select(BatchGroupModel.group_id).where(BatchGroupModel.batch_id.in_(ids))
        gold = select(GoldModel.group_id).where(GoldModel.dataset_id == dataset_id)
        copied = select(IndependentAnnotationModel.group_id).where(*own)
        back = select(BatchGroupModel.group_id).where(*returned)
        return and_(or_(group.in_(inside), group.in_(gold), group.in_(copied)), group.not_in(back))


READER: ContextVar[RestrictedReader | None] = ContextVar("reader", default=None)
"""Who asks; None: an admin, the server itself or a command, from whom nothing is hidden."""


def has_hidden_groups(dataset_id: int) -> bool:
    """Whether groups of a dataset are hidden from whoever asks."""
    reader = READER.get()
    return reader is not None and dataset_id in reader.batches


def hides_batch_groups(dataset_id: int, batch_id: int) -> bool:
    """Whether whoever asks annotates copies of a batch of a dataset, and does not see its groups."""
    reader = READER.get()
    return reader is not None and batch_id in reader.batches.get(dataset_id, ())


def hides_groups_from_reader() -> bool:
    """Whether groups of any dataset are hidden from whoever asks.

    How much is written to the log between two of their steps tells them of what a submission leads
    to, and nothing is led to by one of a gold group: they are not told ids of the log.
    """
    reader = READER.get()
    return reader is not None and bool(reader.batches)


def sees_independent_work(dataset_id: int) -> bool:
    """Whether whoever asks may know what people made of groups independently."""
    reader = READER.get()
    return reader is None or reader.judges(dataset_id)


def visible_groups_condition(dataset_id: int, group: Any) -> list[ColumnElement[bool]]:
    """What holds of those groups of a dataset that whoever asks may see, by the column of their id."""
    reader = READER.get()
    if reader is None or dataset_id not in reader.batches:
        return []
    return [not_(reader.hidden_group_condition(dataset_id, group))]


def visible_groups_across_datasets_condition(dataset: Any, group: Any) -> list[ColumnElement[bool]]:
    """The same of groups of several datasets, by the columns of both ids; also where there is no group."""
    reader = READER.get()
    if reader is None:
        return []
    return [
        or_(
            dataset.is_(None),
            dataset != one,
            group.is_(None),
            not_(reader.hidden_group_condition(one, group)),
        )
        for one in sorted(reader.batches)
    ]


def is_hidden_from_reader(
    session: Session, reader: RestrictedReader, dataset_id: int, **named: int
) -> bool:
    """Whether a group is hidden from somebody, or that of a view, or every one of a static camera.

    Args:
        session: Any session.
        reader: Theirs.
        dataset_id: Where it is.
        named: ``group``, ``view`` or ``station``, and its id.
    """
    ((kind, identity),) = named.items()
    which = {
        "group": GroupModel.id == identity,
        "view": GroupModel.id.in_(select(ViewModel.group_id).where(ViewModel.id == identity)),
        "station": GroupModel.id.in_(
            select(ViewModel.group_id).where(ViewModel.station_id == identity)
        ),
    }[kind]
    groups = select(GroupModel.id).where(which).limit(1)
    hides = reader.hidden_group_condition(dataset_id, GroupModel.id)
    hidden = session.scalar(groups.where(hides)) is not None
    if kind != "station":
        return hidden
    # What other groups show of a camera that they share is no secret.
    return hidden and session.scalar(groups.where(not_(hides))) is None


@dataclass(frozen=True)
class Visibility:
    """Which datasets somebody sees: all but some, or some alone; and what else is theirs.

    Attributes:
        all_but: ``datasets`` are those that they do not see; else the only ones.
        name: Whose things they see that belong to no dataset yet: a person's with those of their
            tokens, or one token's; None: everybody's.
        copies: Where ``all_but`` counts: the datasets of copies that they see; None: every one.
    """

    all_but: bool = True
    datasets: frozenset[int] = frozenset()
    name: str | None = None
    copies: frozenset[int] | None = None

    def condition(self, dataset_id: Any, actor: Any) -> ColumnElement[bool] | None:
        """The same of rows, by these columns; None: every row.

        What is left of a dataset that is gone is of none, and nobody knows who saw it.
        """
        if self == EVERYTHING:
            return None
        named = sorted(self.datasets)
        seen = dataset_id.not_in(named) if self.all_but else dataset_id.in_(named)
        if self.all_but and self.copies is not None:
            seen = and_(seen, or_(dataset_id <= COPIES, dataset_id.in_(sorted(self.copies))))
        mine: ColumnElement[bool] = true()
        if self.name is not None:
            begins = actor.startswith(f"{self.name}{TOKEN}", autoescape=True)
            mine = or_(actor == self.name, begins)
        there = dataset_id.in_(select(DatasetModel.id))
        return or_(and_(there, seen), and_(dataset_id.is_(None), mine))

    def sees(self, dataset_id: int | None, actor: str | None = None) -> bool:
        """Whether they see what belongs to a dataset, or (None) what somebody has made."""
        if dataset_id is None:
            return self.name is None or is_actor_of(actor or "", self.name)
        if self.all_but and self.copies is not None and dataset_id > COPIES:
            return dataset_id in self.copies
        return self.all_but != (dataset_id in self.datasets)


EVERYTHING = Visibility()
"""Of an admin, and of whoever runs a server alone."""


def shown_actor_column(actor: Any, at: Any) -> ColumnElement[str]:
    """Under which name it is shown what an actor did at a time; both are columns."""
    alias = (
        select(PersonModel.name)
        .join(ActorAliasModel, ActorAliasModel.person_id == PersonModel.id)
        .where(ActorAliasModel.actor == actor, at <= ActorAliasModel.at)
        .scalar_subquery()
    )
    return func.coalesce(alias, actor)


def list_columns_with_shown_actor(model: Any) -> list[ColumnElement[Any]]:
    """The columns of a table with ``actor`` and ``created``, the actor under the name that is shown."""
    table = model.__table__
    rest = [column for column in table.columns if column.name != "actor"]
    return [*rest, shown_actor_column(table.c.actor, table.c.created).label("actor")]


def show_entries_under_aliases(session: Session, entries: Iterable[LogEntry]) -> list[LogEntry]:
    """Entries of the log under the names that are shown."""
    aliases = {row.actor: row for row in session.execute(_ALIASES)}
    shown = []
    for entry in entries:
        alias = aliases.get(entry.actor)
        if alias is not None and entry.at <= alias.at:
            entry = replace(entry, actor=alias.shown)
        shown.append(entry)
    return shown


def read_aliases(session: Session) -> dict[str, str]:
    """As whose the work of each actor is shown that was given to somebody."""
    return {row.actor: row.shown for row in session.execute(_ALIASES)}


def find_alias(session: Session, actor: str) -> str | None:
    """As whose the work of an actor is shown; None where it was given to nobody."""
    return read_aliases(session).get(actor)


def insert_alias(session: Session, actor: str, person_id: int, name: str, at: str, by: str) -> None:
    """Show what an actor did until now as a person's, in the queue too."""
    values = {"actor": actor, "person_id": person_id, "at": at, "given_by": by}
    session.execute(insert(ActorAliasModel), values)
    session.execute(update(QueueModel).where(QueueModel.reviewer == actor).values(reviewer=name))
