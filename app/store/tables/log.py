"""Log: everything that was said, in order; it only grows."""

from __future__ import annotations

from sqlalchemy import Index, LargeBinary, text
from sqlalchemy.orm import Mapped, mapped_column

from app.store.tables.base import Base


class LogModel(Base):
    """Everything that was ever said, in order; each row's hash covers the row before."""

    __tablename__ = "log"
    __table_args__ = (
        Index("log_group", "group_id", "id"),
        Index("log_station", "station_id"),
        Index(
            "log_policy",
            "dataset_id",
            "id",
            sqlite_where=text("kind IN ('dataset', 'policy')"),
            postgresql_where=text("kind IN ('dataset', 'policy')"),
        ),
        Index(
            "log_deleted",
            "dataset_id",
            sqlite_where=text("kind = 'dataset_deleted'"),
            postgresql_where=text("kind = 'dataset_deleted'"),
        ),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[str]
    actor: Mapped[str]
    kind: Mapped[str]
    dataset_id: Mapped[int | None]
    group_id: Mapped[int | None]
    station_id: Mapped[int | None]
    body: Mapped[bytes] = mapped_column(LargeBinary)
    hash: Mapped[str]
