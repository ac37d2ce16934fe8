"""Dismissed findings in the database, in the log, and which findings of groups they still cover."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from sqlalchemy import Table, insert, select

from app.soccer.finding import Dismissal, Finding
from app.store.aliases import shown_actor
from app.store.group_rows import next_id
from app.store.log import Entry, append
from app.store.session import Session
from app.store.tables.dismissals import DismissalModel

DISMISSAL = "dismissal"
"""Kind of the log's entries."""
_TABLE = cast(Table, DismissalModel.__table__)
SHOWN = (
    *(_TABLE.c[name] for name in ("marking", "suggested", "number", "at", "dismissed", "note")),
    shown_actor(_TABLE.c.actor, _TABLE.c.at).label("actor"),
)
"""What ``standing`` asks of a row besides ``group``, ``id``, ``kind``, ``view`` and ``sentence``."""


@dataclass(frozen=True)
class GroupDismissals:
    """What people dismissed in a group.

    Attributes:
        last: Id of the newest row; 0: nobody dismissed anything, ever.
        standing: The dismissals that were not taken back.
    """

    last: int = 0
    standing: tuple[Dismissal, ...] = ()

    def of(self, findings: Sequence[Finding]) -> tuple[Dismissal | None, ...]:
        """The dismissal of each finding; None: it is open."""
        return tuple(
            next((item for item in self.standing if item.covers(finding)), None)
            for finding in findings
        )


NOTHING_DISMISSED = GroupDismissals()
"""Of a group in which nobody ever dismissed anything."""


def standing(rows: Iterable[Any]) -> dict[int, GroupDismissals]:
    """What people dismissed, by group id; groups in which nobody ever did are left out.

    ``rows`` are those of the table, the oldest first (``store.queue.read_noticed`` reads them).
    """
    found: dict[int, GroupDismissals] = {}
    for row in rows:
        names = (row.kind, row.view, row.marking, row.suggested)
        said = Dismissal(*names, row.number, row.sentence, row.actor, row.at, row.note)
        before = found.get(row.group, NOTHING_DISMISSED).standing
        others = tuple(item for item in before if not item.covers(said))
        found[row.group] = GroupDismissals(row.id, (*others, said) if row.dismissed else others)
    return found


CARRIED = tuple(column.name for column in _TABLE.columns if column.name not in ("id", "group_id"))
"""What is carried of a row to another installation."""


def carried_dismissals(session: Session, ids: Iterable[int]) -> dict[int, list[dict[str, Any]]]:
    """What is carried of the dismissals of groups, by group, oldest first."""
    columns = [_TABLE.c[name] for name in CARRIED]
    statement = select(_TABLE.c.group_id, *columns).where(_TABLE.c.group_id.in_(list(ids)))
    found: dict[int, list[dict[str, Any]]] = {}
    for group_id, *values in session.execute(statement.order_by(_TABLE.c.id)):
        found.setdefault(group_id, []).append(dict(zip(CARRIED, values, strict=True)))
    return found


def insert_dismissal(
    session: Session,
    dataset_id: int,
    group_id: int,
    said: Dismissal,
    *,
    dismissed: bool,
    brought: tuple[str, str] | None = None,
) -> int:
    """Insert that a finding was dismissed, or opened again, and log it; returns the row's id.

    ``brought`` is who brought it from another installation, and when; the log has it under them.
    """
    identity = next_id(session, DismissalModel)
    body = {name: value for name, value in vars(said).items() if name not in ("actor", "at")}
    body |= {"dismissed": dismissed}
    row = {"id": identity, "group_id": group_id, "actor": said.actor, "at": said.at, **body}
    session.execute(insert(_TABLE), [row])
    actor, at = brought or (said.actor, said.at)
    if brought is not None:
        body |= {"actor": said.actor, "at": said.at}
    append(session, [Entry(DISMISSAL, actor, at, body, dataset_id, group_id)])
    return identity


def dismissed_kinds(
    findings: Sequence[Finding], dismissals: GroupDismissals
) -> tuple[list[str], list[str]]:
    """Kinds of findings that are open, and of those that are dismissed; a kind may be both."""
    found = dismissals.of(findings)
    pairs = list(zip(findings, found, strict=True))
    opened = dict.fromkeys(finding.kind for finding, said in pairs if said is None)
    closed = dict.fromkeys(finding.kind for finding, said in pairs if said is not None)
    return list(opened), list(closed)
