"""Runs of the ball in the database."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, insert, select, update

from app.db.session import Session, now
from app.features.datasets.tables import ViewModel
from app.features.groups.insert_queries import next_id
from app.features.people.visibility_queries import columns_shown
from app.features.predictions.tables import PredictionModel
from app.features.recordings.camera_queries import FrameView
from app.features.recordings.tables import BallRunModel


def list_run_rows(session: Session, recording_id: int) -> Sequence[Any]:
    """The runs of a recording by their first frames."""
    model = BallRunModel
    statement = select(*columns_shown(model)).where(model.recording_id == recording_id)
    return session.execute(statement.order_by(model.first, model.id)).all()


def find_run(session: Session, run_id: int) -> Any | None:
    """A run by its id."""
    statement = select(*columns_shown(BallRunModel)).where(BallRunModel.id == run_id)
    return session.execute(statement).one_or_none()


def insert_run(session: Session, actor: str, **values: Any) -> int:
    """Insert a run; returns its id."""
    identity = next_id(session, BallRunModel)
    new = {"groups": "{}", "confirmed": "[]", "accepted_by": None, "revision": 0}
    row = {"id": identity, **values, **new, "actor": actor, "created": now()}
    session.execute(insert(BallRunModel), [row])
    return identity


def update_run(session: Session, run_id: int, **values: Any) -> None:
    """Change columns of a run."""
    session.execute(update(BallRunModel).where(BallRunModel.id == run_id).values(values))


def delete_run(session: Session, run_id: int) -> None:
    """Delete a run."""
    session.execute(delete(BallRunModel).where(BallRunModel.id == run_id))


def predicted_in(session: Session, views: Sequence[FrameView]) -> dict[int, list[Any]]:
    """Boxes that detectors predicted in views, by number of the frame that a view shows."""
    numbers = {(view.group, view.key): view.number for view in views}
    model = PredictionModel
    statement = (
        select(
            ViewModel.group_id, ViewModel.key, model.x, model.y, model.width, model.height, model.score
        )
        .join(ViewModel, ViewModel.id == model.view_id)
        .where(ViewModel.group_id.in_(sorted({view.group for view in views})))
        .order_by(model.id)
    )  # fmt: skip
    found: dict[int, list[Any]] = {}
    for row in session.execute(statement):
        if (row.group_id, row.key) in numbers:
            found.setdefault(numbers[row.group_id, row.key], []).append(row)
    return found
