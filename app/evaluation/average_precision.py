"""Average precision of ball detections, its table, precision against recall, and errors by bins of distance, parallax
and size.

The headline numbers come from faster-coco-eval. A frame shows one ball, so its matching is
simple enough to be repeated here, which intervals, curves and VOC's area under the curve need; a
test holds that both give the same numbers.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from app.evaluation.bootstrap import MatchResamples
from app.evaluation.frame import FrameWithDetections, iou
from app.evaluation.result import (
    Axis,
    Cell,
    Chart,
    Column,
    FrameFieldRange,
    FrameResult,
    Panel,
    Row,
    Series,
    Table,
)
from app.geometry.arrays import FloatArray
from app.wording import plural

IOUS = tuple(round(0.5 + 0.05 * step, 2) for step in range(10))
MAX_DETECTIONS = 100
"""Of one frame; COCO's limit."""
RECALLS = np.linspace(0.0, 1.0, 101)


@dataclass(frozen=True)
class MatchedDetections:
    """All detections of all frames, the surest first.

    Attributes:
        scores: Shape (D,).
        frames: Index of each detection's frame, shape (D,).
        found: Whether it finds the ball, at each of ``IOUS``, shape (D, 10).
        balls: Whether each frame has a ball, shape (F,).
    """

    scores: FloatArray
    frames: npt.NDArray[np.int64]
    found: npt.NDArray[np.bool_]
    balls: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class PrecisionRecallCurve:
    """Precision and recall after each detection, and the score there, all of shape (D,)."""

    recall: FloatArray
    precision: FloatArray
    score: FloatArray


def match_detections_to_balls(judged: Sequence[FrameWithDetections]) -> MatchedDetections:
    """Match detections to balls as COCO does: the surest that overlaps enough gets the ball."""
    scores, frames, found = [], [], []
    for index, item in enumerate(judged):
        free = np.ones(len(IOUS), dtype=bool)
        for detection in item.detections[:MAX_DETECTIONS]:
            overlap = iou(detection.box, item.truth) if item.truth is not None else 0.0
            hit = free & (overlap >= np.array(IOUS))
            free &= ~hit
            scores.append(detection.score)
            frames.append(index)
            found.append(hit)
    order = np.argsort(-np.array(scores), kind="stable")
    return MatchedDetections(
        np.array(scores)[order],
        np.array(frames, dtype=np.int64)[order],
        np.array(found, dtype=bool).reshape(-1, len(IOUS))[order],
        np.array([item.truth is not None for item in judged], dtype=bool),
    )


def coco_average_precision(
    judged: Sequence[FrameWithDetections],
) -> tuple[float | None, float | None]:
    """AP at IoU 0.5, and its mean over 0.5 to 0.95, by faster-coco-eval; None without a ball."""
    if not any(item.truth is not None for item in judged):
        return None, None
    if not any(item.detections for item in judged):
        return 0.0, 0.0
    from faster_coco_eval import COCO, COCOeval_faster

    truth = COCO(_build_coco_ground_truth(judged), print_function=_discard_output)
    found = truth.loadRes(_build_coco_results(judged))
    run = COCOeval_faster(truth, found, "bbox", print_function=_discard_output)
    run.evaluate()
    run.accumulate()
    precision = np.asarray(run.eval["precision"])[:, :, 0, 0, -1]
    return float(precision[0].mean()), float(precision.mean())


def precision_recall_curve(
    hits: MatchedDetections, threshold: int = 0, weights: FloatArray | None = None
) -> PrecisionRecallCurve:
    """Precision against recall.

    Args:
        hits: Of all frames.
        threshold: Index into ``IOUS``.
        weights: How often each frame counts, shape (F,); once each by default.
    """
    weights = np.ones(len(hits.balls)) if weights is None else weights
    each, found = weights[hits.frames], hits.found[:, threshold]
    right, wrong = np.cumsum(each * found), np.cumsum(each * ~found)
    balls = float(weights @ hits.balls)
    with np.errstate(invalid="ignore", divide="ignore"):
        precision = right / np.maximum(right + wrong, np.finfo(float).eps)
        recall = right / balls
    return PrecisionRecallCurve(recall, precision, hits.scores)


def interpolated_average_precision(found: PrecisionRecallCurve) -> float:
    """COCO's AP: the mean of the interpolated precision at 101 recalls."""
    return float(_precision_at_recalls(found).mean())


def area_under_curve(found: PrecisionRecallCurve) -> float:
    """VOC's AP since 2010: the area under the interpolated precision."""
    steps = np.diff(found.recall, prepend=0.0)
    return float(np.sum(steps * _precision_envelope(found.precision)))


def mean_average_precision_over_ious(
    hits: MatchedDetections, weights: FloatArray | None = None
) -> float:
    """COCO's AP averaged over ``IOUS``: the same as `interpolated` of each, in one go."""
    weights = np.ones(len(hits.balls)) if weights is None else weights
    each, balls = weights[hits.frames], float(weights @ hits.balls)
    if not len(each) or not balls:
        return np.nan if len(each) else 0.0
    right = np.cumsum(each * hits.found.T, axis=1)
    precision = right / np.maximum(np.cumsum(each), np.finfo(float).eps)
    envelope = np.zeros((len(IOUS), len(each) + 1))
    envelope[:, :-1] = _precision_envelope(precision)
    places = np.stack([np.searchsorted(recall, RECALLS, side="left") for recall in right / balls])
    at = np.take_along_axis(envelope, places, axis=1)
    return float(np.mean(at.mean(axis=1)))


def _precision_at_recalls(found: PrecisionRecallCurve) -> FloatArray:
    if not len(found.recall) or not np.isfinite(found.recall).all():
        return np.full(len(RECALLS), np.nan if len(found.recall) else 0.0)
    places = np.searchsorted(found.recall, RECALLS, side="left")
    envelope = np.append(_precision_envelope(found.precision), 0.0)
    at: FloatArray = envelope[places]
    return at


def _precision_envelope(precision: FloatArray) -> FloatArray:
    """The best precision at this recall or any higher one, along the last axis."""
    best: FloatArray = np.maximum.accumulate(precision[..., ::-1], axis=-1)[..., ::-1]
    return best


def _build_coco_ground_truth(judged: Sequence[FrameWithDetections]) -> dict[str, object]:
    balls = [(image, item.truth) for image, item in enumerate(judged, 1) if item.truth is not None]
    return {
        "images": [
            {"id": image, "width": item.frame.size.width, "height": item.frame.size.height}
            for image, item in enumerate(judged, 1)
        ],
        "annotations": [
            # Ids from 1: the evaluator takes 0 for "matched with nothing".
            {
                "id": number,
                "image_id": image,
                "category_id": 1,
                "bbox": [box.x, box.y, box.width, box.height],
                "area": box.width * box.height,
                "iscrowd": 0,
            }
            for number, (image, box) in enumerate(balls, 1)
        ],
        "categories": [{"id": 1, "name": "ball"}],
    }


def _build_coco_results(judged: Sequence[FrameWithDetections]) -> list[dict[str, object]]:
    return [
        {
            "image_id": image,
            "category_id": 1,
            "bbox": [found.box.x, found.box.y, found.box.width, found.box.height],
            "score": found.score,
        }
        for image, item in enumerate(judged, 1)
        for found in item.detections
    ]


def _discard_output(*_words: object, **_options: object) -> None:
    """Where the evaluator's remarks go: stdout belongs to results."""


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


def make_average_precision_table(
    judged: Sequence[FrameWithDetections], resamples: MatchResamples
) -> Table:
    """AP with intervals by match."""
    hits = match_detections_to_balls(judged)
    place = resamples.find_match_columns([item.frame.match for item in judged])
    ap_50, ap = coco_average_precision(judged)
    balls = int(hits.balls.sum())

    def make_cell(value: float | None, low: float | None, high: float | None) -> Cell:
        return Cell(value, low, high, balls, len(judged))

    def compute_weighted_average_precision(weights: FloatArray) -> float:
        return interpolated_average_precision(precision_recall_curve(hits, 0, weights[place]))

    once = precision_recall_curve(hits)
    recall = float(once.recall[-1]) if balls and len(once.recall) else (0.0 if balls else None)
    cells = (
        make_cell(ap_50, *resamples.compute_interval(compute_weighted_average_precision)),
        make_cell(
            ap,
            *resamples.compute_interval(
                lambda weights: mean_average_precision_over_ious(hits, weights[place])
            ),
        ),
        make_cell(
            area_under_curve(once) if balls else None,
            *resamples.compute_interval(
                lambda w: area_under_curve(precision_recall_curve(hits, 0, w[place]))
            ),
        ),
        make_cell(recall, *resamples.compute_interval(lambda w: _highest_recall(hits, w[place]))),
    )
    note = (
        f"{plural(len(judged), 'frame')}: {balls} with a ball, {len(judged) - balls} without; "
        f"{plural(len(hits.scores), 'detection')}."
    )
    row = Row("all", "All frames", cells, FrameFieldRange("detections"))
    return Table("detection", "Detection", COLUMNS, (row,), note)


def make_precision_recall_figure(judged: Sequence[FrameWithDetections]) -> Chart:
    """Precision against recall at IoU 0.5 and 0.75."""
    hits = match_detections_to_balls(judged)
    balls = int(hits.balls.sum())
    series = (
        tuple(_make_curve_series(hits, index, words) for index, words in CURVES) if balls else ()
    )
    panel = Panel(
        "Precision and recall",
        Axis("Recall", "", 0.0, 1.0),
        Axis("Precision", "", 0.0, 1.0),
        series,
    )
    note = f"{balls} balls in {len(judged)} frames, {len(hits.scores)} detections."
    return Chart("precision_recall", "Precision against recall", (panel,), note)


def _make_curve_series(hits: MatchedDetections, index: int, words: str) -> Series:
    found = precision_recall_curve(hits, index)
    chosen = np.unique(np.linspace(0, max(len(found.recall) - 1, 0), MAX_PLACES).astype(int))
    if not len(found.recall):
        chosen = np.zeros(0, dtype=int)
    return Series(
        f"iou_{words}",
        f"IoU {words}: AP {interpolated_average_precision(found):.3f}",
        tuple(found.recall[chosen].tolist()),
        tuple(found.precision[chosen].tolist()),
        count=tuple((chosen + 1).tolist()),
        frames=tuple(FrameFieldRange("score", low=score) for score in hits.scores[chosen].tolist()),
    )


def _highest_recall(hits: MatchedDetections, weights: FloatArray) -> float:
    found = precision_recall_curve(hits, 0, weights)
    return float(found.recall[-1]) if len(found.recall) else 0.0


@dataclass(frozen=True)
class ErrorBins:
    """How frames are sorted into bins [edge, next edge); the last one has no upper end."""

    figure: str
    field: str
    title: str
    label: str
    unit: str
    edges: tuple[float, ...]

    def find_bin_index(self, value: float | None) -> int | None:
        """Index of the bin of a value."""
        if value is None or value < self.edges[0]:
            return None
        return int(np.searchsorted(self.edges, value, side="right")) - 1

    def bounds(self, index: int) -> tuple[float, float | None]:
        """Lower and upper end; the last bin is open."""
        high = self.edges[index + 1] if index + 1 < len(self.edges) else None
        return self.edges[index], high

    def format_bin_name(self, index: int) -> str:
        """``20 to 30 m``."""
        low, high = self.bounds(index)
        if high is None:
            return f"{low:g} {self.unit} and more"
        return f"{low:g} to {high:g} {self.unit}"


DISTANCE = ErrorBins(
    "error_by_distance", "distance_m", "Error by distance", "Distance to the camera", "m",
    (0, 20, 30, 40, 50, 60, 70, 80, 100),
)  # fmt: skip
PARALLAX = ErrorBins(
    "error_by_parallax", "parallax_degrees", "Error by parallax", "Parallax of the views", "°",
    (0, 2, 5, 10, 20, 40, 60, 90, 120),
)  # fmt: skip
SIZE = ErrorBins(
    "error_by_size", "diameter_px", "Error by size", "Diameter of the true box", "px",
    (0, 6, 8, 10, 12, 14, 16, 20, 24, 32),
)  # fmt: skip
MAX_NAMED = 500


def make_error_figure(frames: Sequence[FrameResult], bins: ErrorBins) -> Chart:
    """Median error of hits in each bin, with the quarters around it, and the frames themselves."""
    kept = [frame for frame in frames if frame.error_m is not None]
    inside: dict[int, list[float]] = {}
    for frame in kept:
        place = bins.find_bin_index(getattr(frame, bins.field))
        if place is not None and frame.error_m is not None:
            inside.setdefault(place, []).append(frame.error_m)
    places = sorted(inside)
    quarters = np.array([np.quantile(inside[place], [0.25, 0.5, 0.75]) for place in places])
    quarters = quarters.reshape(-1, 3)
    middle = Series(
        "median",
        "Median, and the middle half",
        tuple(_bin_center(bins, place) for place in places),
        tuple(quarters[:, 1].tolist()),
        low=tuple(quarters[:, 0].tolist()),
        high=tuple(quarters[:, 2].tolist()),
        count=tuple(len(inside[place]) for place in places),
        frames=tuple(FrameFieldRange(bins.field, *bins.bounds(place)) for place in places),
    )
    panel = Panel(
        bins.title,
        Axis(bins.label, bins.unit, 0.0),
        Axis("Error of the place", "m", 0.0),
        (_make_scatter_series(kept, bins.field), middle),
    )
    note = f"{plural(len(kept), 'frame')} with a detection of IoU > 0, oracle cameras."
    return Chart(bins.figure, bins.title, (panel,), note)


def make_detection_table_by_bin(
    judged: Sequence[FrameWithDetections], frames: Sequence[FrameResult], bins: ErrorBins
) -> Table:
    """AP over the frames of each bin, with how many of their balls were found.

    Args:
        judged: Frames with detections.
        frames: The same frames in the same order, measured.
        bins: ``DISTANCE`` or ``SIZE``.
    """
    members: dict[int, list[int]] = {}
    for index, frame in enumerate(frames):
        place = bins.find_bin_index(getattr(frame, bins.field)) if frame.ball else None
        if place is not None:
            members.setdefault(place, []).append(index)
    rows = []
    for place, indices in sorted(members.items()):
        ap_50, ap = coco_average_precision([judged[index] for index in indices])
        hits = sum(frames[index].hit_iou is not None for index in indices)
        count = len(indices)
        cells = (
            Cell(ap_50, count=count, of=count),
            Cell(ap, count=count, of=count),
            Cell(hits / count, count=count, of=count),
        )
        low, high = bins.bounds(place)
        rows.append(
            Row(
                f"{low:g}",
                bins.format_bin_name(place),
                cells,
                FrameFieldRange(bins.field, low, high),
            )
        )
    columns = (
        Column("ap_50", "AP@0.5", "", "higher"),
        Column("ap", "AP@[.5:.95]", "", "higher"),
        Column("hit", "Found with IoU > 0", "", "higher"),
    )
    name = {"distance_m": "detection_by_distance", "diameter_px": "detection_by_size"}[bins.field]
    note = "Each row is an evaluation of its own over the frames whose true ball is in the bin."
    return Table(name, f"Detection by {bins.label.lower()}", columns, tuple(rows), note)


def _bin_center(bins: ErrorBins, place: int) -> float:
    low, high = bins.bounds(place)
    return (low + high) / 2 if high is not None else low + (low - bins.edges[place - 1]) / 2


def _make_scatter_series(frames: Sequence[FrameResult], field: str) -> Series:
    """The frames themselves; of very many an even choice, which shows the same cloud."""
    pairs = [
        (value, frame.error_m)
        for frame in frames
        if (value := getattr(frame, field)) is not None and frame.error_m is not None
    ]
    step = max(math.ceil(len(pairs) / MAX_NAMED), 1)
    series = Series("frames", "Frames", (), (), "points")
    x, y = zip(*pairs[::step], strict=True) if pairs else ((), ())
    # No number lies between a value and the next one: a point opens its own frame.
    only = tuple(FrameFieldRange(field, value, math.nextafter(value, math.inf)) for value in x)
    return replace(series, x=tuple(x), y=tuple(y), frames=only)
