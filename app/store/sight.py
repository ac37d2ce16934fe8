"""Sight: which datasets a reader sees, for the questions that are asked across all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, and_, or_, select, true

from app.soccer.actors import TOKEN, is_of
from app.store.tables.groups import DatasetModel

COPIES = 10**9
"""Ids of datasets of copies lie above it, and those of all others below: one that is made while
somebody listens is hidden from them from its first entry on."""


@dataclass(frozen=True)
class Sight:
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
            return self.name is None or is_of(actor or "", self.name)
        if self.all_but and self.copies is not None and dataset_id > COPIES:
            return dataset_id in self.copies
        return self.all_but != (dataset_id in self.datasets)


EVERYTHING = Sight()
"""Of an admin, and of whoever runs a server alone."""
