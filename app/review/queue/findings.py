"""Findings of a whole dataset, group by group."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from app.review.datasets.dataset import dataset_id
from app.review.editing.state import GroupState, read_states
from app.soccer.finding import Dismissal, Finding
from app.soccer.group import Group
from app.store.conditions import Condition, compares, contains, either, lists
from app.store.listing import Listing
from app.store.order import Order
from app.store.solutions import is_solved
from app.store.store import Store

BATCH = 100


@dataclass(frozen=True)
class GroupFindings:
    """What was found in one group."""

    group_id: int
    number: int
    group: Group
    findings: tuple[Finding, ...]
    dismissed: tuple[Dismissal | None, ...]
    """Of each finding: who has checked it; None: nobody."""

    @property
    def values(self) -> list[dict[str, Any]]:
        """The findings as plain values, each with the key of the group."""
        return [
            {
                "kind": finding.kind,
                "group": self.group.key,
                **asdict(finding),
                "dismissed": None
                if said is None
                else {"by": said.actor, "at": said.at, "note": said.note},
            }
            for finding, said in zip(self.findings, self.dismissed, strict=True)
        ]


def count_groups(
    store: Store, dataset_id: int, kind: str | None, *, dismissed: bool | None = None
) -> int:
    """How many groups of a dataset have findings, of a kind, open or dismissed, where these are named."""
    with store.read() as session:
        return Listing(session, dataset_id, _where(kind, dismissed)).count()


def read_findings(
    store: Store,
    dataset_id: int,
    *,
    after: int = 0,
    limit: int,
    kind: str | None = None,
    dismissed: bool | None = None,
) -> list[GroupFindings]:
    """Findings of up to ``limit`` groups, by number of the group, from the one after ``after``.

    ``dismissed`` names those that people have checked (True) or have not (False); None: all.
    """
    with store.read() as session:
        where = [*_where(kind, dismissed), compares("number", ">", after)]
        ids = Listing(session, dataset_id, where).ids(Order("number"), limit)
        states = read_states(session, ids)
    return [_group_findings(state, kind, dismissed) for state in states]


def finding_values(store: Store, dataset: str) -> Iterator[dict[str, Any]]:
    """Every finding of a dataset as plain values, in batches, so that memory does not grow."""
    found, after = dataset_id(store, dataset), 0
    while groups := read_findings(store, found, after=after, limit=BATCH):
        after = groups[-1].number
        for group in groups:
            yield from group.values


def _where(kind: str | None, dismissed: bool | None) -> list[Condition]:
    """What holds of groups with findings that can be read: those of an earlier solver cannot."""
    columns = {None: ("findings", "dismissed"), False: ("findings",), True: ("dismissed",)}
    has = either(
        contains(column, ",") if kind is None else lists(column, kind)
        for column in columns[dismissed]
    )
    return [has, is_solved()]


def _group_findings(state: GroupState, kind: str | None, dismissed: bool | None) -> GroupFindings:
    found = state.solution.findings if state.solution is not None else ()
    chosen = [
        (item, said)
        for item, said in zip(found, state.dismissed, strict=True)
        if (kind is None or item.kind == kind)
        and (dismissed is None or dismissed == (said is not None))
    ]
    findings, checked = tuple(item for item, _ in chosen), tuple(said for _, said in chosen)
    return GroupFindings(state.id, state.number, state.group, findings, checked)
