"""Tables of work that is given out: batches, for whom they are, their groups, and who has one open."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, UniqueConstraint, text
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class BatchModel(Base):
    """Groups of a dataset that a lead gives out: what a query found in an order when it was made; or
    tracks of the ball, where ``kind`` is ``tracks`` and not ``groups``.

    ``verdicts`` is how many people judge or annotate each group without seeing the others', where
    ``blind``. One of ``gold_every`` groups on average is a gold one; NULL: none is. ``due`` is a
    day; ``state`` is ``open`` or ``closed``.
    """

    __tablename__ = "batch"
    __table_args__ = (Index("batch_dataset", "dataset_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    name: Mapped[str]
    kind: Mapped[str] = mapped_column(server_default="groups")
    query: Mapped[str]
    sort: Mapped[str]
    verdicts: Mapped[int]
    blind: Mapped[bool]
    gold_every: Mapped[int | None]
    due: Mapped[str | None]
    state: Mapped[str]
    created: Mapped[str]
    created_by: Mapped[str]


class BatchPersonModel(Base):
    """A person to whom a batch is assigned; ``part`` is ``annotator`` or ``reviewer``, or both in two rows."""

    __tablename__ = "batch_person"
    __table_args__ = (Index("batch_person_person", "person_id"),)

    batch_id: Mapped[int] = mapped_column(
        ForeignKey("batch.id", ondelete="CASCADE"), primary_key=True
    )
    person_id: Mapped[int] = mapped_column(ForeignKey("person.id"), primary_key=True)
    part: Mapped[str] = mapped_column(primary_key=True)


class BatchGroupModel(Base):
    """A group of a batch, at its ``place`` (from 1).

    ``submitted`` is when an annotator said that it is done, NULL before; ``submitted_by`` names them,
    also after it was returned to them. ``settled`` is when its work in this batch was over.
    """

    __tablename__ = "batch_group"
    __table_args__ = (
        UniqueConstraint("batch_id", "place", name="batch_group_place"),
        Index("batch_group_group", "group_id"),
        # Each request asks whether something is left, also in a batch of thousands that is done.
        Index(
            "batch_group_free",
            "batch_id",
            sqlite_where=text("settled IS NULL AND handed_in IS NULL"),
            postgresql_where=text("settled IS NULL AND handed_in IS NULL"),
        ),
    )

    batch_id: Mapped[int] = mapped_column(
        ForeignKey("batch.id", ondelete="CASCADE"), primary_key=True
    )
    group_id: Mapped[int] = mapped_column(
        ForeignKey("groups.id", ondelete="CASCADE"), primary_key=True
    )
    place: Mapped[int]
    submitted: Mapped[str | None] = mapped_column("handed_in", key="submitted")
    submitted_by: Mapped[str | None] = mapped_column("handed_in_by", key="submitted_by")
    settled: Mapped[str | None]


class BatchTrackModel(Base):
    """A track of a batch, at its ``place`` (from 1); its own verdict says whether it is done."""

    __tablename__ = "batch_track"
    __table_args__ = (Index("batch_track_track", "track_id"),)

    batch_id: Mapped[int] = mapped_column(
        ForeignKey("batch.id", ondelete="CASCADE"), primary_key=True
    )
    track_id: Mapped[int] = mapped_column(
        ForeignKey("track.id", ondelete="CASCADE"), primary_key=True
    )
    place: Mapped[int]


class LeaseModel(Base):
    """A lease: a person (a name as in the log) has a group of a batch open.

    ``taken`` is since when, ``seen`` when their page last said so, ``until`` when it ends unless
    the page says so again.
    """

    __tablename__ = "lease"
    __table_args__ = (
        UniqueConstraint("batch_id", "group_id", "person", name="lease_person"),
        Index("lease_group", "group_id"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    batch_id: Mapped[int] = mapped_column(ForeignKey("batch.id", ondelete="CASCADE"))
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id", ondelete="CASCADE"))
    person: Mapped[str]
    taken: Mapped[str]
    seen: Mapped[str]
    until: Mapped[str]
