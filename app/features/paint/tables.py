"""The table of proposals: predictions from the paint, beside what people said.

Nothing here is read by a solve. A proposal belongs to a view and goes with it; what a person
accepts becomes an edit of the view's lines, in the log like any other.
"""

from __future__ import annotations

from sqlalchemy import ForeignKey, Index, text
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class ProposalModel(Base):
    """What was proposed for one view when its picture was looked at last; ``lines`` are JSON.

    ``frame`` is the digest of the picture's bytes (empty: there were none), ``sought_with`` that
    of all else that was known, ``version`` that of what read the picture. ``beside`` is the digest
    of the station whose lines determined no camera then (empty: it had none); it is open beside those.
    """

    __tablename__ = "proposal"
    __table_args__ = (Index("proposal_outcome", "outcome"),)

    view_id: Mapped[int] = mapped_column(
        ForeignKey("view.id", ondelete="CASCADE"), primary_key=True
    )
    outcome: Mapped[str]
    sentence: Mapped[str]
    supported: Mapped[float | None]
    explained: Mapped[float | None]
    points: Mapped[int]
    error_px: Mapped[float | None]
    runner_up: Mapped[float | None]
    lines: Mapped[str]
    frame: Mapped[str]
    sought_with: Mapped[str]
    version: Mapped[str]
    beside: Mapped[str] = mapped_column(server_default=text("''"))
