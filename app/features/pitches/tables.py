"""The table of what the lines of a match say about the size of its pitch."""

from __future__ import annotations

from sqlalchemy import ForeignKey
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class PitchEstimateModel(Base):
    """A size that was estimated, metres; ``inputs`` digests what it was estimated from.

    A length or width without a number is unknown; ``problem`` says why both are.
    """

    __tablename__ = "pitch_estimate"

    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"), primary_key=True)
    match: Mapped[str] = mapped_column(primary_key=True)
    inputs: Mapped[str]
    length: Mapped[float | None]
    width: Mapped[float | None]
    length_sigma: Mapped[float | None]
    width_sigma: Mapped[float | None]
    frames: Mapped[int]
    problem: Mapped[str | None]
