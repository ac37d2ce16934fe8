"""Tables of webhooks: addresses that are told what happens in a dataset, and what they were told."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, UniqueConstraint
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class WebhookModel(Base):
    """An address that is told; ``kinds`` (JSON list) are the ones of message that it wants.

    ``salt`` makes its secret with a key that lies beside the database. ``log_id`` is up to
    where it has been told of the log; ``jobs_until`` and ``job_id`` when the last job ended that it was
    told of, and which one that is. ``off`` is why nothing is sent any more, NULL while it is.
    """

    __tablename__ = "webhook"
    __table_args__ = (Index("webhook_dataset", "dataset_id"),)

    id: Mapped[int] = mapped_column(primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id", ondelete="CASCADE"))
    url: Mapped[str]
    kinds: Mapped[str]
    salt: Mapped[str]
    off: Mapped[str | None]
    created: Mapped[str]
    created_by: Mapped[str]
    log_id: Mapped[int]
    jobs_until: Mapped[str]
    job_id: Mapped[int]


class DeliveryModel(Base):
    """One message to one webhook, and how its sending goes; ``body`` is the JSON that is sent.

    ``next_at`` is when it is tried (again), NULL once it has arrived or was given up.
    """

    __tablename__ = "webhook_delivery"
    __table_args__ = (
        UniqueConstraint("webhook_id", "message", name="webhook_delivery_message"),
        Index("webhook_delivery_next", "next_at"),
    )

    id: Mapped[int] = mapped_column(primary_key=True)
    webhook_id: Mapped[int] = mapped_column(ForeignKey("webhook.id", ondelete="CASCADE"))
    message: Mapped[str]
    kind: Mapped[str]
    body: Mapped[str]
    created: Mapped[str]
    state: Mapped[str]
    attempts: Mapped[int]
    next_at: Mapped[str | None]
    tried: Mapped[str | None]
    status: Mapped[int | None]
    problem: Mapped[str | None]
