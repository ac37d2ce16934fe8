"""The queue: one row a group, a projection made for filters and sorts."""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, text
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base

QUEUE_NUMBERS = (
    "passes",
    "value",
    "margin",
    "min_jac",
    "agreement",
    "error_px",
    "error_percent",
    "sigma_m",
    "parallax_degrees",
    "size_ratio",
    "height_m",
    "distance_m",
)
"""Columns of the queue with an index of their own."""
QUEUE_SCANNED = (
    "number",
    "status",
    "stale",
    "fixed",
    "solved",
    "views",
    "pictures",
    *QUEUE_NUMBERS,
    "box_px",
    "x_m",
    "y_m",
    "gate",
    "split",
    "findings",
)
"""Columns of the queue that one index holds, in its order: what is asked of every group of a
dataset is read from there, a third of what the rows take."""


class QueueModel(Base):
    """One row a group, for lists: everything that can be filtered or sorted, in plain columns.

    ``findings``, ``dismissed`` and ``view_keys`` are lists between commas:
    ``,low_parallax,bad_point,``; ``findings`` are kinds that are open, ``dismissed`` kinds that
    people have checked.
    ``value`` is the smallest relative distance to a gate's threshold; ``pictures`` counts the
    views that have one.
    """

    __tablename__ = "queue"
    __table_args__ = (
        Index("queue_number", "dataset_id", "number"),
        Index("queue_status", "dataset_id", "status", "number"),
        Index("queue_scanned", "dataset_id", *QUEUE_SCANNED),
        # Sorted by any of them, a page of a million groups is read from where it begins.
        *(Index(f"queue_{name}", "dataset_id", name, "number") for name in QUEUE_NUMBERS),
    )

    group_id: Mapped[int] = mapped_column(ForeignKey("groups.id"), primary_key=True)
    dataset_id: Mapped[int] = mapped_column(ForeignKey("dataset.id"))
    number: Mapped[int]
    key: Mapped[str]
    label: Mapped[str]
    match: Mapped[str]
    split: Mapped[str]
    changed: Mapped[str]
    views: Mapped[int]
    view_keys: Mapped[str]
    pictures: Mapped[int] = mapped_column(server_default=text("0"))
    main_view: Mapped[int | None]
    status: Mapped[str]
    stale: Mapped[bool]
    reason: Mapped[str | None]
    reviewer: Mapped[str | None]
    override: Mapped[str | None]
    fixed: Mapped[bool]
    solved: Mapped[bool]
    passes: Mapped[bool | None]
    gate: Mapped[str | None]
    gate_view: Mapped[str | None]
    gate_sentence: Mapped[str | None]
    margin: Mapped[float | None]
    value: Mapped[float | None]
    min_jac: Mapped[float | None]
    error_px: Mapped[float | None]
    error_percent: Mapped[float | None]
    sigma_m: Mapped[float | None]
    parallax_degrees: Mapped[float | None]
    size_ratio: Mapped[float | None]
    height_m: Mapped[float | None]
    findings: Mapped[str]
    distance_m: Mapped[float | None]
    box_px: Mapped[float | None]
    x_m: Mapped[float | None]
    y_m: Mapped[float | None]
    agreement: Mapped[float | None]
    dismissed: Mapped[str] = mapped_column(server_default=text("''"))
