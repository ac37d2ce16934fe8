"""Tables of independent annotations: copies of groups, gold groups, and guidelines for annotators."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, LargeBinary, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class CopyDatasetModel(Base):
    """A dataset that holds one person's own copies of groups of another one, of one batch.

    ``of_id`` is that other one. ``batch_id`` is 0 for copies of no batch. Only the person, the leads
    of the other dataset and admins see it, and no list of datasets has it.
    """

    __tablename__ = "copy_dataset"
    __table_args__ = (
        UniqueConstraint("of_id", "batch_id", "person", name="copy_dataset_person"),
        Index("copy_dataset_person_name", "person"),
    )

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    of_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    batch_id: Mapped[int]
    person: Mapped[str]


class IndependentAnnotationModel(Base):
    """One person's own annotation of a group: ``copy_id`` is the copy, ``group_id`` the original.

    ``kind`` is ``independent`` or ``gold`` (the original is a gold group, whose truth is known).
    ``place`` counts the independent annotations of a person in a batch, from 1. ``verdict`` is what they judged,
    NULL where they did not; ``settled`` is when a result was taken over or set aside.
    """

    __tablename__ = "take"
    __table_args__ = (
        UniqueConstraint("batch_id", "group_id", "person", name="take_person"),
        UniqueConstraint("copy_id", name="take_copy"),
        Index("take_group", "group_id"),
        # Each request asks what its sender has begun, also in a batch of thousands.
        Index("take_of_person", "batch_id", "person", "submitted", "settled"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    batch_id: Mapped[int | None]
    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id", ondelete="CASCADE"))
    copy_id: Mapped[int] = mapped_column(ForeignKey("groups.id", ondelete="CASCADE"))
    person: Mapped[str]
    kind: Mapped[str]
    place: Mapped[int]
    begun: Mapped[str]
    submitted: Mapped[str | None] = mapped_column("handed_in", key="submitted")
    verdict: Mapped[str | None]
    settled: Mapped[str | None]


class GoldModel(Base):
    """A group whose truth is known: what was said of it when a lead marked it (compressed JSON).

    ``start`` is what a person begins with: ``imported`` (as the dataset brought it),
    ``without_balls``, or ``bare`` (no lines either).
    """

    __tablename__ = "gold"
    __table_args__ = (Index("gold_dataset", "dataset_id"),)

    group_id: Mapped[int] = mapped_column(
        ForeignKey("groups.id", ondelete="CASCADE"), primary_key=True
    )
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    start: Mapped[str]
    truth: Mapped[bytes] = mapped_column(LargeBinary)
    marked: Mapped[str]
    marked_by: Mapped[str]


class GuidelineModel(Base):
    """What annotators of a dataset are told (Markdown); the highest ``number`` counts."""

    __tablename__ = "guideline"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    number: Mapped[int] = mapped_column(primary_key=True)
    text: Mapped[str]
    written: Mapped[str]
    written_by: Mapped[str]


class GuidelinePictureModel(Base):
    """A picture of a dataset's guidelines, under the SHA-256 of its bytes."""

    __tablename__ = "guideline_picture"

    dataset_id: Mapped[int] = mapped_column(
        ForeignKey("dataset.id", ondelete="CASCADE"), primary_key=True
    )
    digest: Mapped[str] = mapped_column(primary_key=True)
    type: Mapped[str]
    body: Mapped[bytes] = mapped_column(LargeBinary)
