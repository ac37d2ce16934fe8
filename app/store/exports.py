"""What exports ask of the database: which groups go out, which do not, and how new it all is."""

from __future__ import annotations

from sqlalchemy import ColumnElement, false, func, not_, or_, select
from sqlalchemy.orm import Session

from app.store.models import LogModel, QueueModel

_CURRENT = not_(QueueModel.stale)
_OVERRIDDEN = func.coalesce(QueueModel.override == QueueModel.gate, false())
"""An override speaks of the gate that failed then, of no other that fails now."""
_QUALIFIES = or_(QueueModel.passes.is_(True), _OVERRIDDEN)


def newest_word(session: Session, dataset_id: int) -> str | None:
    """Time of the newest thing that was said about a dataset; freezing it says nothing."""
    statement = select(func.max(LogModel.at)).where(
        LogModel.dataset_id == dataset_id, LogModel.kind != "freeze"
    )
    return session.scalar(statement)


def exported_groups(session: Session, dataset_id: int, everything: bool) -> list[int]:
    """Ids of the groups that an export takes: all, or the accepted ones that may go out."""
    where = [QueueModel.dataset_id == dataset_id]
    if not everything:
        where += [
            QueueModel.status == "accepted",
            _CURRENT,
            QueueModel.solved.is_(True),
            _QUALIFIES,
        ]
    statement = select(QueueModel.group_id).where(*where).order_by(QueueModel.number)
    return list(session.scalars(statement))


def left_out_groups(session: Session, dataset_id: int) -> dict[str, int]:
    """Accepted groups that are not exported, counted by the first reason that holds."""
    reasons: dict[str, list[ColumnElement[bool]]] = {
        "stale": [not_(_CURRENT)],
        "unsolved": [_CURRENT, not_(QueueModel.solved)],
        "failing": [_CURRENT, QueueModel.solved.is_(True), not_(_QUALIFIES)],
    }
    counts = {}
    for reason, where in reasons.items():
        statement = select(func.count()).where(
            QueueModel.dataset_id == dataset_id, QueueModel.status == "accepted", *where
        )
        counts[reason] = int(session.execute(statement).scalar_one())
    return {reason: count for reason, count in counts.items() if count}
