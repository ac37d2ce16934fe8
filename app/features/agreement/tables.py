"""Tables of agreement: what independent annotations of a group came to, and the limits they keep."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, LargeBinary
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class AgreementModel(Base):
    """What the annotations of a group that were submitted came to; ``batch_id`` is 0 for no batch.

    ``state`` is ``agreed``, ``open`` (it waits for somebody to decide) or ``decided``. ``takes`` names
    what was compared, ``pairs`` is how far they lie apart (compressed JSON), ``worst`` how many
    times its limit the worst disagreement is, ``disagreements`` how many there are. ``take_id`` is
    the one that was taken, ``outcome`` ``take`` or ``start`` (it was gone on from).
    """

    __tablename__ = "agreement"
    __table_args__ = (Index("agreement_dataset", "dataset_id", "state"),)

    group_id: Mapped[int] = mapped_column(
        ForeignKey("groups.id", ondelete="CASCADE"), primary_key=True
    )
    batch_id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    state: Mapped[str]
    takes: Mapped[str]
    pairs: Mapped[bytes] = mapped_column(LargeBinary)
    worst: Mapped[float]
    disagreements: Mapped[int]
    found: Mapped[str]
    outcome: Mapped[str | None]
    take_id: Mapped[int | None]
    decided: Mapped[str | None]
    decided_by: Mapped[str | None]


class AgreementLimitsModel(Base):
    """How far annotations of a dataset's groups may lie apart and still agree; no row: defaults."""

    __tablename__ = "agreement_limits"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    line_px: Mapped[float]
    markings: Mapped[int]
    ball_px: Mapped[float]
    diameter_px: Mapped[float]
    ball_m: Mapped[float]
    jac: Mapped[float]
    changed: Mapped[str]
    changed_by: Mapped[str]
