"""What exports ask of the database: which groups go out, which do not, and how new it all is."""

from __future__ import annotations

from sqlalchemy import false, func, not_, or_, select

from app.db.log import AUDIT_KINDS, LogModel
from app.db.session import Session
from app.features.queue.queries import GroupListing, RowOrder
from app.features.queue.tables import QueueModel
from app.features.solutions.queries import is_group_solved

_NO_WORD = ("freeze", "comment", *AUDIT_KINDS)
_ACCEPTED = QueueModel.status == "accepted"
_CURRENT = not_(QueueModel.stale)
_SOLVED = is_group_solved()
_OVERRIDDEN = func.coalesce(QueueModel.override == QueueModel.gate, false())
"""An override speaks of the gate that failed then, of no other that fails now."""
_QUALIFIES = or_(QueueModel.passes.is_(True), _OVERRIDDEN)


def find_newest_entry_time(session: Session, dataset_id: int) -> str | None:
    """Time of the newest thing that was said about a dataset; freezing it, and comments, say nothing of it."""
    statement = select(func.max(LogModel.at)).where(
        LogModel.dataset_id == dataset_id, LogModel.kind.not_in(_NO_WORD)
    )
    return session.scalar(statement)


def list_exported_groups(session: Session, dataset_id: int, everything: bool) -> list[int]:
    """Ids of the groups that an export takes: all, or the accepted ones that may go out."""
    where = () if everything else (_ACCEPTED, _CURRENT, _SOLVED, _QUALIFIES)
    return GroupListing(session, dataset_id, where).ids(RowOrder("number"))


def count_left_out_groups(session: Session, dataset_id: int) -> dict[str, int]:
    """Accepted groups that are not exported, counted by the first reason that holds."""
    reasons = {
        "stale": [not_(_CURRENT)],
        "unsolved": [_CURRENT, not_(_SOLVED)],
        "failing": [_CURRENT, _SOLVED, not_(_QUALIFIES)],
    }
    counts = {
        reason: GroupListing(session, dataset_id, [_ACCEPTED, *where]).count()
        for reason, where in reasons.items()
    }
    return {reason: count for reason, count in counts.items() if count}
