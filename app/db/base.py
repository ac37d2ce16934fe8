"""The base of every table.

It has the table that tells one installation from all others, and the ids that are used up.
"""

from __future__ import annotations

from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column


class Base(DeclarativeBase):
    """Base of all tables."""


class InstallationModel(Base):
    """Its one row: a random key, and when the installation began."""

    __tablename__ = "installation"

    key: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[str]


COPIES_USED = "copy_dataset"
"""Under which name the ids of datasets of copies are remembered, which are counted by themselves."""


class UsedIdModel(Base):
    """The largest id of a table that a deleted dataset had; ids are given once and for all."""

    __tablename__ = "used_id"

    table: Mapped[str] = mapped_column(primary_key=True)
    id: Mapped[int]
