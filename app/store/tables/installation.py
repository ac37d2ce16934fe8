"""The table that tells one installation's database from all others."""

from __future__ import annotations

from sqlalchemy.orm import Mapped, mapped_column

from app.store.tables.base import Base


class InstallationModel(Base):
    """Its one row: a random key, and when the installation began."""

    __tablename__ = "installation"

    key: Mapped[str] = mapped_column(primary_key=True)
    created: Mapped[str]
