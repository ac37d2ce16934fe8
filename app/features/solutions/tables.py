"""Solutions: what was computed from what was said; inserted and never changed."""

from __future__ import annotations

from sqlalchemy import ForeignKey, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class CalibrationModel(Base):
    """A calibration under the key that the solver gives it (compressed JSON)."""

    __tablename__ = "calibration"

    key: Mapped[str] = mapped_column(primary_key=True)
    body: Mapped[bytes] = mapped_column(LargeBinary)


class SolutionModel(Base):
    """A solution without its calibrations, which ``calibrations`` (JSON list) names.

    ``summary`` (JSON) is what the queue shows of it. ``facts`` is what the gates read of the group
    (``solving.facts_codec``), NULL for a solution from before they were kept.
    """

    __tablename__ = "solution"
    __table_args__ = (
        UniqueConstraint(
            "group_id", "inputs_hash", "policy_hash", "solver_version", name="solution_key"
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"))
    inputs_hash: Mapped[str]
    policy_hash: Mapped[str]
    solver_version: Mapped[str]
    calibrations: Mapped[str]
    summary: Mapped[str]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    facts: Mapped[bytes | None] = mapped_column(LargeBinary)
