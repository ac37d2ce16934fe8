"""Counts and challenges that last for minutes, where several processes have to know them."""

from __future__ import annotations

from typing import cast

from sqlalchemy import Index, LargeBinary, Table, delete, func, insert, select
from sqlalchemy.orm import Mapped, mapped_column

from app.db.dialects.statements import insert as insert_or_update
from app.db.session import Base, Session


class AttemptModel(Base):
    """A try that counts against a limit (``at``: seconds since 1970), where several processes count."""

    __tablename__ = "attempt"
    __table_args__ = (Index("attempt_whose", "whose", "at"), Index("attempt_at", "at"))

    id: Mapped[int] = mapped_column(primary_key=True)
    whose: Mapped[str]
    at: Mapped[float]


class PendingActionModel(Base):
    """What somebody has begun and finishes within minutes, maybe at another process.

    ``name`` is a hash, ``value`` is encrypted with a key of the home.
    """

    __tablename__ = "begun"
    __table_args__ = (Index("begun_ends", "ends"),)

    name: Mapped[str] = mapped_column(primary_key=True)
    value: Mapped[bytes] = mapped_column(LargeBinary)
    ends: Mapped[str]


KEPT_SECONDS = 3600.0
"""No limit looks back further."""
_BEGUN = cast(Table, PendingActionModel.__table__)


def oldest_attempt(session: Session, whose: str, since: float, most: int) -> float | None:
    """When the oldest try since a time was (both: seconds since 1970), where there are too many."""
    mine = (AttemptModel.whose == whose, AttemptModel.at > since)
    statement = select(func.count(), func.min(AttemptModel.at)).where(*mine)
    count, oldest = session.execute(statement).one()
    return float(oldest) if count >= most else None


def note_attempt(session: Session, whose: str, at: float) -> None:
    """Count a try; those that no limit looks back to are forgotten."""
    session.execute(delete(AttemptModel).where(AttemptModel.at <= at - KEPT_SECONDS))
    session.execute(insert(AttemptModel), [{"whose": whose, "at": at}])


def store_pending(session: Session, name: str, value: bytes, ends: str, at: str, most: int) -> None:
    """Keep what somebody has begun, in the place of what they had; what has ended goes.

    Args:
        session: One that writes.
        name: Of it.
        value: What it is.
        ends: Until when it is good, and ``at``, what time it is, as ISO text in UTC.
        most: So many are kept; beyond it the oldest makes room.
    """
    session.execute(delete(PendingActionModel).where(PendingActionModel.ends <= at))
    count = session.scalar(select(func.count()).select_from(PendingActionModel)) or 0
    if count >= most:
        oldest = (
            select(PendingActionModel.name)
            .order_by(PendingActionModel.ends)
            .limit(count - most + 1)
        )
        session.execute(delete(PendingActionModel).where(PendingActionModel.name.in_(oldest)))
    new = insert_or_update(_BEGUN).values(name=name, value=value, ends=ends)
    same = {"value": new.excluded.value, "ends": new.excluded.ends}
    session.execute(new.on_conflict_do_update(index_elements=[_BEGUN.c.name], set_=same))


def take_pending(session: Session, name: str, at: str) -> bytes | None:
    """What was begun under a name, which is gone then; None where nothing is that is good."""
    gone = delete(PendingActionModel).where(PendingActionModel.name == name)
    row = session.execute(
        gone.returning(PendingActionModel.value, PendingActionModel.ends)
    ).one_or_none()
    return None if row is None or row.ends <= at else bytes(row.value)
