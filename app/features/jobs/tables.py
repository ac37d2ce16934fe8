"""The tables of background work: jobs, and the responses to requests that may come twice."""

from __future__ import annotations

from sqlalchemy import Index, false
from sqlalchemy.orm import Mapped, mapped_column

from app.db.session import Base


class JobModel(Base):
    """A piece of background work and how far it is.

    ``tries`` counts the times that it was begun and neither ended nor was stopped in good order.
    ``ending``: somebody wants the running one to end. ``request`` (JSON) is what it was asked for, enough to start it again where its kind can be;
    ``result`` and ``problem`` (JSON) are what came of it. A dataset may be gone before its jobs.
    """

    __tablename__ = "job"
    __table_args__ = (Index("job_dataset", "dataset_id", "id"), Index("job_kind", "kind", "id"))

    id: Mapped[int] = mapped_column(primary_key=True)
    kind: Mapped[str]
    title: Mapped[str]
    dataset_id: Mapped[int | None]
    state: Mapped[str]
    done: Mapped[int]
    total: Mapped[int | None]
    sentence: Mapped[str]
    request: Mapped[str | None]
    result: Mapped[str | None]
    problem: Mapped[str | None]
    created: Mapped[str]
    started: Mapped[str | None]
    ended: Mapped[str | None]
    actor: Mapped[str]
    tries: Mapped[int] = mapped_column(server_default="0")
    ending: Mapped[bool] = mapped_column(server_default=false())
