"""Predictions of a group: what was predicted in its views, and which balls were taken from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from app.db.log import LogEntry, group_entries, single_edits
from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError
from app.features.groups.codecs import ball_from_json
from app.features.groups.view_queries import StoredView, group_dataset, group_views
from app.features.predictions.queries import (
    PredictedBox,
    PredictionSet,
    count_prediction_sets,
    read_group_boxes,
    read_prediction_sets,
)
from app.soccer.annotation import BallAnnotation


@dataclass(frozen=True)
class AcceptedBall:
    """A ball that a person took from a set of predictions.

    Attributes:
        name: Of the set, which may be gone since.
        score: As predicted; None where the set is gone.
        actor: Who accepted it, and ``at`` when; None where it was imported so.
    """

    view_id: int
    view: str
    name: str
    score: float | None
    actor: str | None
    at: str | None


@dataclass(frozen=True)
class GroupPredictions:
    """What was predicted for a group.

    Attributes:
        sets: How many sets its dataset has.
        boxes: By view, the newest set first, the surest box first.
        accepted: Balls of the group as it is now that come from a prediction.
    """

    sets: int
    boxes: tuple[tuple[PredictionSet, PredictedBox], ...]
    accepted: tuple[AcceptedBall, ...]


def group_predictions(store: Store, group_id: int) -> GroupPredictions:
    """What was predicted for a group, and what was accepted of it.

    Raises:
        NotFoundError: There is no such group.
    """
    with store.read() as session:
        dataset = group_dataset(session, group_id)
        if dataset is None:
            raise NotFoundError.group(group_id)
        boxes = _with_sets(session, read_group_boxes(session, group_id))
        taken = list(_taken(session, group_id))
        entries = group_entries(session, group_id) if taken else []
        count = count_prediction_sets(session, dataset)
    return GroupPredictions(
        count, boxes, tuple(_accepted(row, ball, boxes, entries) for row, ball in taken)
    )


def _with_sets(
    session: Session, boxes: Sequence[PredictedBox]
) -> tuple[tuple[PredictionSet, PredictedBox], ...]:
    found = read_prediction_sets(session, {box.set_id for box in boxes})
    sets = {item.id: item for item in found}
    return tuple((sets[box.set_id], box) for box in boxes)


def _taken(session: Session, group_id: int) -> Iterator[tuple[StoredView, BallAnnotation]]:
    for view in group_views(session, group_id):
        yield from ((view, ball) for ball in view.balls if ball.predicted_by)


def _accepted(
    row: StoredView,
    ball: BallAnnotation,
    boxes: Iterable[tuple[PredictionSet, PredictedBox]],
    entries: Sequence[LogEntry],
) -> AcceptedBall:
    scores = [
        box.score
        for item, box in boxes
        if (box.view_id, item.name) == (row.id, ball.predicted_by)
        and ball.box is not None
        and (box.x, box.y, box.width, box.height)
        == (ball.box.x, ball.box.y, ball.box.width, ball.box.height)
    ]
    entry = next((one for one in reversed(entries) if _places_ball(one, row.key, ball)), None)
    return AcceptedBall(
        view_id=row.id,
        view=row.key,
        name=ball.predicted_by,
        score=max(scores, default=None),
        actor=None if entry is None else entry.actor,
        at=None if entry is None else entry.at,
    )


def _places_ball(entry: LogEntry, view: str, ball: BallAnnotation) -> bool:
    """Whether an edit put that ball there; undo and redo only bring back what one said."""
    if entry.kind != "edit":
        return False
    return any(
        (edit["edit"], edit.get("view")) == ("set_balls", view)
        and ball in [ball_from_json(value) for value in edit["balls"]]
        for edit in single_edits(entry.body["edit"])
    )
