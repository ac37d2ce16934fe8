"""Reference boxes of a set of predictions: one a frame, which the dataset's are measured with."""

from __future__ import annotations

from app.errors import InputError
from app.soccer.frames import Box
from app.store.predictions import PredictionSet, read_boxes
from app.store.session import Session
from app.store.views import StoredView, dataset_views

LISTED = 5
"""Frames that a refusal names; all are counted."""


def careful_boxes(session: Session, careful: PredictionSet) -> dict[int, Box]:
    """The reference box of each view, by its id.

    Raises:
        InputError: A frame has several; nobody can tell which one would be the truth.
    """
    found = read_boxes(session, careful.id)
    several = {view for view, boxes in found.items() if len(boxes) > 1}
    if several:
        rows = dataset_views(session, careful.dataset_id)
        names = [_frame_name(row) for row in rows if row.id in several]
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise InputError(
            f'frames of the reference boxes "{careful.name}" have more than one box: '
            f"{', '.join(names[:LISTED])}{more}",
            hint="Keep the one box of each frame that is the ball.",
            pointer="/careful",
        )
    return {view: Box(box.x, box.y, box.width, box.height) for view, (box,) in found.items()}


def _frame_name(row: StoredView) -> str:
    """A view as files of predictions call it."""
    if row.shared:
        return f"{row.key}/{row.group}"
    return f"{row.match}/{row.key}" if row.match else f"{row.group}/{row.key}"
