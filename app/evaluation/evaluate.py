"""Evaluate: predictions against a dataset, everything the benchmark asks for at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from app.evaluation import sensitivity
from app.evaluation.average_precision import detection_summary, precision_recall
from app.evaluation.binned import DISTANCE, PARALLAX, SIZE, detection_table, error_figure
from app.evaluation.bootstrap import RESAMPLES, SEED, Resamples
from app.evaluation.cameras import Scores, cameras_table, jac_figure, score_cameras
from app.evaluation.frame import Detection, Frame, JudgedFrame, iou, judge_detections
from app.evaluation.localization import localization_table, measure_frame, precision_distance
from app.evaluation.reference_boxes import boxes_figure, boxes_table, has_every_box
from app.evaluation.result import Evaluation, Figure, FrameResult, Table
from app.geometry.camera import Camera
from app.progress import ReportProgress, partial_progress
from app.soccer.frames import Box


@dataclass(frozen=True)
class Options:
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
class Inputs:
    """What was predicted, by id of the frame.

    Attributes:
        detections: None where nobody predicted balls at all.
        careful: Boxes that somebody drew with care, or None.
        cameras: Predicted cameras at the annotated size, or None.
    """

    detections: Mapping[int, Sequence[Detection]] | None = None
    careful: Mapping[int, Box] | None = None
    cameras: Mapping[int, Camera] | None = field(default=None)


def evaluate(
    frames: Sequence[Frame],
    inputs: Inputs,
    options: Options,
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
    resamples = Resamples.draw([item.match for item in frames], options.resamples, options.seed)
    scores = _score_all_cameras(frames, inputs, say)
    judged = judge_detections(frames, inputs.detections or {}, options.boxes)
    say(1, 4, "Placing balls")
    results = _measure_frames(judged, inputs, scores, options)
    say(2, 4, "Average precision")
    tables, figures = [], []
    if inputs.detections is not None:
        tables += list(_detection_tables(judged, results, inputs, resamples))
        figures += list(_detection_figures(judged, results, inputs))
    if inputs.careful is not None:
        tables.append(
            boxes_table(frames, inputs.careful, inputs.detections or {}, resamples, options.boxes)
        )
        distances = {
            item.frame_id: item.distance_m for item in results if item.distance_m is not None
        }
        figures.append(boxes_figure(frames, inputs.careful, distances))
    if scores is not None:
        rows = [
            ("predicted", "Predicted cameras", scores[0]),
            ("dataset", "The dataset's own", scores[1]),
        ]
        tables.append(cameras_table(rows, frames, resamples, {item.frame.id for item in judged}))
        figures.append(jac_figure(rows, options.min_jac))
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
    frames: Sequence[Frame], inputs: Inputs, say: ReportProgress
) -> tuple[Scores, Scores] | None:
    """Predicted cameras and the dataset's own against the lines."""
    if inputs.cameras is None:
        return None
    own = {frame.id: frame.camera for frame in frames if frame.camera is not None}
    total = 2 * len(frames)
    sentence = "Measuring cameras"
    first = partial_progress(say, sentence, total=total)
    second = partial_progress(say, sentence, start=len(frames), total=total)
    predicted = score_cameras(frames, inputs.cameras, first)
    oracle = score_cameras(frames, own, second)
    return predicted, oracle


def _measure_frames(
    judged: Sequence[JudgedFrame],
    inputs: Inputs,
    scores: tuple[Scores, Scores] | None,
    options: Options,
) -> list[FrameResult]:
    cameras, careful = inputs.cameras or {}, inputs.careful or {}
    results = []
    for item in judged:
        frame = item.frame
        result = measure_frame(
            item, options.ball_diameter_m, cameras.get(frame.id), options.min_score
        )
        box = careful.get(frame.id)
        results.append(
            replace(
                result,
                predicted_jac=_jac_of_frame(scores[0], frame.id) if scores else None,
                box_iou=iou(item.truth, box)
                if item.truth and box and has_every_box(frame)
                else None,
            )
        )
    return results


def _jac_of_frame(scores: Scores, frame: int) -> float | None:
    """None without lines; lines without a camera count as 0, as they do in the table."""
    if frame not in scores:
        return None
    score = scores[frame]
    return 0.0 if score is None else score.jac[0]


def _detection_tables(
    judged: Sequence[JudgedFrame],
    results: Sequence[FrameResult],
    inputs: Inputs,
    resamples: Resamples,
) -> Iterator[Table]:
    yield detection_summary(judged, resamples)
    yield localization_table(results, resamples, predicted=inputs.cameras is not None)
    yield detection_table(judged, results, SIZE)
    yield detection_table(judged, results, DISTANCE)


def _detection_figures(
    judged: Sequence[JudgedFrame], results: Sequence[FrameResult], inputs: Inputs
) -> Iterator[Figure]:
    yield precision_recall(judged)
    yield precision_distance(results, predicted=inputs.cameras is not None)
    for bins in (DISTANCE, PARALLAX, SIZE):
        yield error_figure(results, bins)


def _measure_sensitivity(frames: Sequence[Frame], options: Options) -> tuple[Table, Figure]:
    able = len(sensitivity.choose_frames(frames, options.seed, len(frames)))
    chosen = sensitivity.choose_frames(frames, options.seed)
    samples = [
        sensitivity.measure_frame_sensitivity(frame, options.ball_diameter_m) for frame in chosen
    ]
    return sensitivity.sensitivity_table(samples, able), sensitivity.sensitivity_figure(samples)


def _count_denominators(
    frames: Sequence[Frame], judged: Sequence[JudgedFrame], inputs: Inputs
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
        "careful_boxes": len(inputs.careful or {}),
        "predicted_cameras": len(inputs.cameras or {}),
    }
