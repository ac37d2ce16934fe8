"""Detection: the table of average precision, and precision against recall."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from app.evaluation.average_precision import (
    Hits,
    area,
    coco_average_precision,
    curve,
    find_hits,
    interpolated,
    mean_interpolated,
)
from app.evaluation.bootstrap import Resamples
from app.evaluation.figure import Axis, Figure, Panel, Series
from app.evaluation.frame import JudgedFrame
from app.evaluation.table import Cell, Column, FrameRange, Row, Table
from app.geometry.arrays import FloatArray
from app.plural import plural

MAX_PLACES = 400
"""Points of one drawn curve; a curve of ten thousand detections looks the same."""
CURVES = ((0, "0.5"), (5, "0.75"))
"""Index into ``IOUS``, and the words for it."""
COLUMNS = (
    Column("ap_50", "AP@0.5", "", "higher"),
    Column("ap", "AP@[.5:.95]", "", "higher"),
    Column("ap_50_voc", "AP@0.5, VOC area", "", "higher"),
    Column("recall", "Recall at IoU 0.5", "", "higher"),
)


def detection_summary(judged: Sequence[JudgedFrame], resamples: Resamples) -> Table:
    """AP with intervals by match."""
    hits = find_hits(judged)
    place = resamples.places([item.frame.match for item in judged])
    ap_50, ap = coco_average_precision(judged)
    balls = int(hits.balls.sum())

    def cell(value: float | None, low: float | None, high: float | None) -> Cell:
        return Cell(value, low, high, balls, len(judged))

    def spread(weights: FloatArray) -> float:
        return interpolated(curve(hits, 0, weights[place]))

    once = curve(hits)
    recall = float(once.recall[-1]) if balls and len(once.recall) else (0.0 if balls else None)
    cells = (
        cell(ap_50, *resamples.statistic(spread)),
        cell(ap, *resamples.statistic(lambda weights: mean_interpolated(hits, weights[place]))),
        cell(area(once) if balls else None, *resamples.statistic(lambda w: _area(hits, w[place]))),
        cell(recall, *resamples.statistic(lambda w: _recall(hits, w[place]))),
    )
    note = (
        f"{plural(len(judged), 'frame')}: {balls} with a ball, {len(judged) - balls} without; "
        f"{plural(len(hits.scores), 'detection')}."
    )
    row = Row("all", "All frames", cells, FrameRange("detections"))
    return Table("detection", "Detection", COLUMNS, (row,), note)


def precision_recall(judged: Sequence[JudgedFrame]) -> Figure:
    """Precision against recall at IoU 0.5 and 0.75."""
    hits = find_hits(judged)
    balls = int(hits.balls.sum())
    series = tuple(_series(hits, index, words) for index, words in CURVES) if balls else ()
    panel = Panel(
        "Precision and recall",
        Axis("Recall", "", 0.0, 1.0),
        Axis("Precision", "", 0.0, 1.0),
        series,
    )
    note = f"{balls} balls in {len(judged)} frames, {len(hits.scores)} detections."
    return Figure("precision_recall", "Precision against recall", (panel,), note)


def _series(hits: Hits, index: int, words: str) -> Series:
    found = curve(hits, index)
    chosen = np.unique(np.linspace(0, max(len(found.recall) - 1, 0), MAX_PLACES).astype(int))
    if not len(found.recall):
        chosen = np.zeros(0, dtype=int)
    return Series(
        f"iou_{words}",
        f"IoU {words}: AP {interpolated(found):.3f}",
        tuple(found.recall[chosen].tolist()),
        tuple(found.precision[chosen].tolist()),
        count=tuple((chosen + 1).tolist()),
        frames=tuple(FrameRange("score", low=score) for score in hits.scores[chosen].tolist()),
    )


def _area(hits: Hits, weights: FloatArray) -> float:
    return area(curve(hits, 0, weights))


def _recall(hits: Hits, weights: FloatArray) -> float:
    found = curve(hits, 0, weights)
    return float(found.recall[-1]) if len(found.recall) else 0.0
