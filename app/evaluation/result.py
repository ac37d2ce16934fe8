"""What an evaluation found: tables, figures, and one row per frame that stands behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from app.evaluation.figure import Figure
from app.evaluation.table import Table


@dataclass(frozen=True)
class FrameResult:
    """One judged frame; a number that does not exist is None.

    Attributes:
        frame_id: Id of the view.
        ball: Whether the frame shows a ball.
        detections: How many balls were found in it.
        score: Of the surest detection; ``iou`` is its overlap with the true box.
        hit_score: Of the surest detection that overlaps the true box at all, the one that the
            paper measures; ``hit_iou`` likewise.
        distance_m: From the dataset's camera to the ball.
        diameter_px: Of the true box.
        size_error_percent: By how much the hit is larger than the true box, signed.
        error_m: How far the hit's place is from the ball, with the dataset's camera.
        error_percent: The same, of the distance.
        any_error_m: The same for the surest detection, whether it overlaps or not.
        predicted_error_m: As ``error_m`` with the predicted camera; likewise the two after it.
        predicted_jac: JaC of the predicted camera at 0.5 % of the diagonal; 0 where there are
            annotated lines and no camera.
        box_iou: Overlap of the true box with the careful one; only where the frame has every kind
            of box, as in the table of boxes.
    """

    frame_id: int
    group_id: int
    group: str
    view: str
    match: str
    ball: bool
    detections: int
    score: float | None = None
    iou: float | None = None
    hit_score: float | None = None
    hit_iou: float | None = None
    distance_m: float | None = None
    diameter_px: float | None = None
    parallax_degrees: float | None = None
    size_error_percent: float | None = None
    error_m: float | None = None
    error_percent: float | None = None
    any_error_m: float | None = None
    predicted_error_m: float | None = None
    predicted_error_percent: float | None = None
    predicted_any_error_m: float | None = None
    predicted_jac: float | None = None
    box_iou: float | None = None


NUMBERS = tuple(
    name
    for name in FrameResult.__dataclass_fields__
    if name not in ("frame_id", "group_id", "group", "view", "match", "ball")
)
"""Fields of ``FrameResult`` by which frames are filtered and sorted."""


@dataclass(frozen=True)
class Evaluation:
    """Everything that one run found.

    Attributes:
        counts: Denominators by name: ``frames``, ``balls``, ``detections`` ...
    """

    counts: Mapping[str, int]
    tables: tuple[Table, ...]
    figures: tuple[Figure, ...]
    frames: tuple[FrameResult, ...]

    def table(self, name: str) -> Table | None:
        """The table of that name, or None."""
        return next((table for table in self.tables if table.name == name), None)
