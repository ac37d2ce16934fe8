"""The table of tracks: the ball over a stretch, and what people said of it."""

from __future__ import annotations

from sqlalchemy import ForeignKey, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class TrackModel(Base):
    """The track of one stretch, as it was computed last.

    ``inputs`` (compressed JSON) is all that it was computed from, ``digest`` theirs, ``body`` (compressed
    JSON) the track without corrections, ``summary`` (JSON) what lists say of it. ``stamp`` is a digest of
    the stretch's groups, by which it is known to be stale. ``corrections`` (JSON) are events that people
    added and removed, ``patches`` (compressed JSON) the parts of the track that they change, NULL without any;
    ``revision`` counts what people said. ``verdict`` (``accepted`` or ``rejected``) with
    ``note``, ``judged_by`` and ``judged_at`` holds for what was computed then: another track has none.
    """

    __tablename__ = "track"
    __table_args__ = (UniqueConstraint("dataset_id", "key", name="track_key"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    key: Mapped[str]
    match: Mapped[str]
    first: Mapped[int]
    last: Mapped[int]
    stamp: Mapped[str]
    digest: Mapped[str]
    inputs: Mapped[bytes] = mapped_column(LargeBinary)
    body: Mapped[bytes] = mapped_column(LargeBinary)
    patches: Mapped[bytes | None] = mapped_column(LargeBinary)
    summary: Mapped[str]
    corrections: Mapped[str]
    revision: Mapped[int]
    verdict: Mapped[str | None]
    note: Mapped[str | None]
    judged_by: Mapped[str | None]
    judged_at: Mapped[str | None]
    actor: Mapped[str]
    created: Mapped[str]
