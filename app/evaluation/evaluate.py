"""Evaluate: predictions against a dataset, everything the benchmark asks for at once; and a dataset's boxes against
reference boxes (the paper's table 1).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.evaluation import sensitivity
from app.evaluation.average_precision import (
    DISTANCE,
    PARALLAX,
    SIZE,
    make_average_precision_table,
    make_detection_table_by_bin,
    make_error_figure,
    make_precision_recall_figure,
)
from app.evaluation.bootstrap import RESAMPLES, SEED, MatchResamples
from app.evaluation.cameras import Scores, make_cameras_table, make_jac_figure, score_cameras
from app.evaluation.frame import (
    Detection,
    FrameWithDetections,
    GroundTruthFrame,
    iou,
    pair_truth_with_detections,
    size_error_percent,
)
from app.evaluation.localization import (
    make_frame_result,
    make_localization_table,
    make_precision_distance_figure,
)
from app.evaluation.result import (
    Axis,
    Chart,
    Column,
    Evaluation,
    FrameFieldRange,
    FrameResult,
    Panel,
    Row,
    Series,
    Table,
)
from app.geometry.camera import Camera
from app.progress import ReportProgress, make_partial_progress
from app.soccer.frames import Box
from app.wording import plural

COLUMNS = (
    Column("iou", "IoU", "", "higher"),
    Column("size_error_percent", "Size error", "%", "lower"),
)
ROWS = (
    ("annotated", "Original boxes"),
    ("optimized", "Optimised boxes"),
    ("exact", "Exact boxes"),
)


def make_boxes_table(
    frames: Sequence[GroundTruthFrame],
    reference: Mapping[int, Box],
    detections: Mapping[int, Sequence[Detection]],
    resamples: MatchResamples,
    truth: str = "optimized",
) -> Table:
    """IoU and size error of every kind of box, over the same frames for each.

    A frame takes part when it has a reference box and every kind of box that the dataset's frames with one have. Where
    there are detections, one more row measures the surest of each frame that overlaps the reference box.

    Args:
        frames: Of the dataset.
        reference: The reference box by id of the frame.
        detections: By id of the frame.
        resamples: For the intervals.
        truth: The kind of box whose overlap a run keeps of each frame (``box_iou``): its row
            opens the frames.
    """
    kinds = list_kinds_of_boxes(frames, reference)
    compared = _select_comparable_boxes(frames, reference, kinds)
    rows = [
        _make_box_row(kind, label, [(frame, frame.boxes[kind], box) for frame, box in compared if kind in kinds], resamples,
             len(reference), FrameFieldRange("box_iou") if kind == truth else None)
        for kind, label in ROWS
    ]  # fmt: skip
    if detections:
        found = [
            (frame, hit, box)
            for frame, box in compared
            if (hit := _find_overlapping_detection(detections, frame, box))
        ]
        rows.append(
            _make_box_row("detected", "Detected boxes, IoU > 0", found, resamples, len(reference))
        )
    note = (
        f"{len(compared)} frames that have a reference box and every kind of box below, of {len(reference)} reference "
        f"boxes.{_describe_missing_kinds(kinds)} Size error is |d - d reference| in per cent of the reference box's diagonal. "
        f"The row of the run's true box opens its frames; the figure of boxes has every frame of "
        f"every row."
    )
    return Table("boxes", "Boxes against reference boxes", COLUMNS, tuple(rows), note)


def make_boxes_figure(
    frames: Sequence[GroundTruthFrame], reference: Mapping[int, Box], distances: Mapping[int, float]
) -> Chart:
    """IoU and size error of each box of each frame, over the distance of the ball.

    Args:
        frames: Of the dataset.
        reference: The reference box by id of the frame.
        distances: Camera to ball, metres, by id of the frame; frames without one are left out.
    """
    kinds = list_kinds_of_boxes(frames, reference)
    compared = sorted(
        (distances[frame.id], frame.id, frame, box)
        for frame, box in _select_comparable_boxes(frames, reference, kinds)
        if frame.id in distances
    )
    note = f"{plural(len(compared), 'frame')}; a point opens its frame."
    measures = (
        ("Overlap with the reference box", Axis("IoU", low=0.0, high=1.0), iou),
        ("Size against the reference box", Axis("Size error", "%", low=0.0), size_error_percent),
    )
    panels = tuple(
        Panel(
            title,
            Axis("Distance to the camera", "m"),
            axis,
            tuple(
                _make_scatter_series(kind, label, compared, measure)
                for kind, label in ROWS
                if kind in kinds
            ),
        )
        for title, axis, measure in measures
    )
    return Chart("box_overlap", "Boxes against reference boxes", panels, note)


def _make_scatter_series(
    kind: str,
    label: str,
    compared: Sequence[tuple[float, int, GroundTruthFrame, Box]],
    measure: Callable[[Box, Box], float],
) -> Series:
    places = tuple(distance for distance, _, _, _ in compared)
    return Series(
        kind,
        label,
        places,
        tuple(measure(frame.boxes[kind], box) for _, _, frame, box in compared),
        kind="points",
        frames=tuple(
            FrameFieldRange("distance_m", at, math.nextafter(at, math.inf)) for at in places
        ),
    )


def _select_comparable_boxes(
    frames: Sequence[GroundTruthFrame], reference: Mapping[int, Box], kinds: Sequence[str]
) -> list[tuple[GroundTruthFrame, Box]]:
    return [
        (frame, reference[frame.id])
        for frame in frames
        if frame.id in reference and has_boxes(frame, kinds)
    ]


def list_kinds_of_boxes(
    frames: Iterable[GroundTruthFrame], reference: Mapping[int, Box]
) -> tuple[str, ...]:
    """The kinds of box that any frame with a reference box has: a dataset of points has none that was drawn."""
    found = {kind for frame in frames if frame.id in reference for kind in frame.boxes}
    return tuple(kind for kind, _ in ROWS if kind in found)


def has_boxes(frame: GroundTruthFrame, kinds: Sequence[str]) -> bool:
    """Whether it has a box of every kind, so that all rows are over the same frames; not of none."""
    return bool(kinds) and all(kind in frame.boxes for kind in kinds)


def _describe_missing_kinds(kinds: Sequence[str]) -> str:
    missing = [label.lower() for kind, label in ROWS if kind not in kinds]
    return f" No frame has {' or '.join(missing)}." if missing and kinds else ""


def _make_box_row(
    kind: str,
    label: str,
    compared: Sequence[tuple[GroundTruthFrame, Box, Box]],
    resamples: MatchResamples,
    whole: int,
    behind: FrameFieldRange | None = None,
) -> Row:
    matches = [frame.match for frame, _, _ in compared]
    overlaps = [iou(box, reference) for _, box, reference in compared]
    errors = [size_error_percent(box, reference) for _, box, reference in compared]
    cells = (
        resamples.mean_with_interval(overlaps, matches, whole),
        resamples.mean_with_interval(errors, matches, whole),
    )
    return Row(kind, label, cells, behind)


def _find_overlapping_detection(
    detections: Mapping[int, Sequence[Detection]], frame: GroundTruthFrame, reference: Box
) -> Box | None:
    found = sorted(detections.get(frame.id, ()), key=lambda item: -item.score)
    return next((item.box for item in found if iou(item.box, reference) > 0), None)


@dataclass(frozen=True)
class EvaluationOptions:
    """How predictions are judged; a run keeps them beside its result.

    Attributes:
        boxes: Which of a dataset's boxes is the truth, one of ``ball_boxes.BOX_KINDS``.
        min_score: Detections below take no part in localisation; average precision has them all.
        ball_diameter_m: True diameter.
        min_jac: The threshold that the JaC figure marks.
        resamples: How many bootstrap resamples by match.
        seed: Of the bootstrap and of the sensitivity's sample.
    """

    boxes: str = "optimized"
    min_score: float = 0.0
    ball_diameter_m: float = 0.226
    min_jac: float = 0.75
    resamples: int = RESAMPLES
    seed: int = SEED


@dataclass(frozen=True)
class EvaluationInputs:
    """What was predicted, by id of the frame.

    Attributes:
        detections: None where nobody predicted balls at all.
        reference: Boxes that somebody drew with care, or None.
        cameras: Predicted cameras at the annotated size, or None.
    """

    detections: Mapping[int, Sequence[Detection]] | None = None
    reference: Mapping[int, Box] | None = None
    cameras: Mapping[int, Camera] | None = field(default=None)


def evaluate(
    frames: Sequence[GroundTruthFrame],
    inputs: EvaluationInputs,
    options: EvaluationOptions,
    progress: ReportProgress | None = None,
) -> Evaluation:
    """Every table and figure that the inputs allow.

    Args:
        frames: All views of the groups that take part.
        inputs: What was predicted.
        options: How it is judged.
        progress: Called with steps done, steps in all and a sentence.
    """
    say = progress or (lambda _done, _total=None, _sentence="": None)
    resamples = MatchResamples.draw(
        [item.match for item in frames], options.resamples, options.seed
    )
    scores = _score_all_cameras(frames, inputs, say)
    judged = pair_truth_with_detections(frames, inputs.detections or {}, options.boxes)
    say(1, 4, "Placing balls")
    kinds = list_kinds_of_boxes(frames, inputs.reference or {})
    results = _measure_frames(judged, inputs, scores, options, kinds)
    say(2, 4, "Average precision")
    tables, figures = [], []
    if inputs.detections is not None:
        tables += list(_make_detection_and_localization_tables(judged, results, inputs, resamples))
        figures += list(_make_detection_figures(judged, results, inputs))
    if inputs.reference is not None:
        tables.append(
            make_boxes_table(
                frames, inputs.reference, inputs.detections or {}, resamples, options.boxes
            )
        )
        distances = {
            item.frame_id: item.distance_m for item in results if item.distance_m is not None
        }
        figures.append(make_boxes_figure(frames, inputs.reference, distances))
    if scores is not None:
        rows = [
            ("predicted", "Predicted cameras", scores[0]),
            ("dataset", "The dataset's own", scores[1]),
        ]
        tables.append(
            make_cameras_table(rows, frames, resamples, {item.frame.id for item in judged})
        )
        figures.append(make_jac_figure(rows, options.min_jac))
    say(3, 4, "Sensitivity")
    table, figure = _measure_sensitivity(frames, options)
    say(4, 4, "Done")
    return Evaluation(
        _count_denominators(frames, judged, inputs),
        (*tables, table),
        (*figures, figure),
        tuple(results),
    )


def _score_all_cameras(
    frames: Sequence[GroundTruthFrame], inputs: EvaluationInputs, say: ReportProgress
) -> tuple[Scores, Scores] | None:
    """Predicted cameras and the dataset's own against the lines."""
    if inputs.cameras is None:
        return None
    own = {frame.id: frame.camera for frame in frames if frame.camera is not None}
    total = 2 * len(frames)
    sentence = "Measuring cameras"
    first = make_partial_progress(say, sentence, total=total)
    second = make_partial_progress(say, sentence, start=len(frames), total=total)
    predicted = score_cameras(frames, inputs.cameras, first)
    oracle = score_cameras(frames, own, second)
    return predicted, oracle


def _measure_frames(
    judged: Sequence[FrameWithDetections],
    inputs: EvaluationInputs,
    scores: tuple[Scores, Scores] | None,
    options: EvaluationOptions,
    kinds: Sequence[str],
) -> list[FrameResult]:
    cameras, reference = inputs.cameras or {}, inputs.reference or {}
    results = []
    for item in judged:
        frame = item.frame
        result = make_frame_result(
            item, options.ball_diameter_m, cameras.get(frame.id), options.min_score
        )
        box = reference.get(frame.id)
        results.append(
            replace(
                result,
                predicted_jac=_find_frame_jac(scores[0], frame.id) if scores else None,
                box_iou=iou(item.truth, box)
                if item.truth and box and has_boxes(frame, kinds)
                else None,
            )
        )
    return results


def _find_frame_jac(scores: Scores, frame: int) -> float | None:
    """None without lines; lines without a camera count as 0, as they do in the table."""
    if frame not in scores:
        return None
    score = scores[frame]
    return 0.0 if score is None else score.jac[0]


def _make_detection_and_localization_tables(
    judged: Sequence[FrameWithDetections],
    results: Sequence[FrameResult],
    inputs: EvaluationInputs,
    resamples: MatchResamples,
) -> Iterator[Table]:
    yield make_average_precision_table(judged, resamples)
    yield make_localization_table(results, resamples, predicted=inputs.cameras is not None)
    yield make_detection_table_by_bin(judged, results, SIZE)
    yield make_detection_table_by_bin(judged, results, DISTANCE)


def _make_detection_figures(
    judged: Sequence[FrameWithDetections], results: Sequence[FrameResult], inputs: EvaluationInputs
) -> Iterator[Chart]:
    yield make_precision_recall_figure(judged)
    yield make_precision_distance_figure(results, predicted=inputs.cameras is not None)
    for bins in (DISTANCE, PARALLAX, SIZE):
        yield make_error_figure(results, bins)


def _measure_sensitivity(
    frames: Sequence[GroundTruthFrame], options: EvaluationOptions
) -> tuple[Table, Chart]:
    able = len(sensitivity.choose_frames(frames, options.seed, len(frames)))
    chosen = sensitivity.choose_frames(frames, options.seed)
    samples = [
        sensitivity.measure_frame_sensitivity(frame, options.ball_diameter_m) for frame in chosen
    ]
    return sensitivity.make_sensitivity_table(samples, able), sensitivity.make_sensitivity_figure(
        samples
    )


def _count_denominators(
    frames: Sequence[GroundTruthFrame],
    judged: Sequence[FrameWithDetections],
    inputs: EvaluationInputs,
) -> dict[str, int]:
    """Every denominator, by name."""
    detections = inputs.detections or {}
    inside = {item.frame.id for item in judged}
    return {
        "groups": len({frame.group_id for frame in frames}),
        "matches": len({frame.match for frame in frames}),
        "frames": len(frames),
        "judged": len(judged),
        "balls": sum(item.truth is not None for item in judged),
        "without_ball": sum(item.truth is None for item in judged),
        "with_3d_ball": sum(item.frame.point is not None for item in judged),
        "detections": sum(len(item.detections) for item in judged),
        "frames_with_detections": sum(bool(item.detections) for item in judged),
        "detections_not_judged": sum(
            len(found) for frame, found in detections.items() if frame not in inside
        ),
        "careful_boxes": len(inputs.reference or {}),
        "predicted_cameras": len(inputs.cameras or {}),
    }
