"""The table of recordings: films of a match, from which groups are taken."""

from __future__ import annotations

from sqlalchemy import ForeignKey, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.base import Base


class RecordingModel(Base):
    """A recording, its shots (JSON), and what was found when it was indexed last.

    The file stays where it is, at ``path``; ``stamp`` is its size and time of change when it was
    indexed. ``facts`` (JSON) and ``sha256`` are null until then. ``revision`` counts the changes of
    ``shots``.
    """

    __tablename__ = "recording"
    __table_args__ = (
        UniqueConstraint("dataset_id", "name", name="recording_name"),
        UniqueConstraint("dataset_id", "path", name="recording_path"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    name: Mapped[str]
    path: Mapped[str]
    stamp: Mapped[str | None]
    sha256: Mapped[str | None]
    facts: Mapped[str | None]
    shots: Mapped[str]
    revision: Mapped[int]
    actor: Mapped[str]
    created: Mapped[str]
