"""Reference boxes: the paper's table 1, a dataset's boxes against boxes drawn with care."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from app.evaluation.bootstrap import Resamples
from app.evaluation.frame import Detection, Frame, iou, size_error_percent
from app.evaluation.result import Axis, Column, Figure, FrameRange, Panel, Row, Series, Table
from app.plural import plural
from app.soccer.frames import Box

COLUMNS = (
    Column("iou", "IoU", "", "higher"),
    Column("size_error_percent", "Size error", "%", "lower"),
)
ROWS = (
    ("annotated", "Original boxes"),
    ("optimized", "Optimised boxes"),
    ("exact", "Exact boxes"),
)


def boxes_table(
    frames: Sequence[Frame],
    careful: Mapping[int, Box],
    detections: Mapping[int, Sequence[Detection]],
    resamples: Resamples,
    truth: str = "optimized",
) -> Table:
    """IoU and size error of every kind of box, over the same frames for each.

    A frame takes part when it has a reference box and all three boxes of the dataset. Where there
    are detections, one more row measures the surest of each frame that overlaps the reference box.

    Args:
        frames: Of the dataset.
        careful: The reference box by id of the frame.
        detections: By id of the frame.
        resamples: For the intervals.
        truth: The kind of box whose overlap a run keeps of each frame (``box_iou``): its row
            opens the frames.
    """
    compared = _comparable_boxes(frames, careful)
    rows = [
        _box_row(kind, label, [(frame, frame.boxes[kind], box) for frame, box in compared], resamples,
             len(careful), FrameRange("box_iou") if kind == truth else None)
        for kind, label in ROWS
    ]  # fmt: skip
    if detections:
        found = [
            (frame, hit, box)
            for frame, box in compared
            if (hit := _overlapping_detection(detections, frame, box))
        ]
        rows.append(_box_row("detected", "Detected boxes, IoU > 0", found, resamples, len(careful)))
    note = (
        f"{len(compared)} frames that have a reference box and a 3D ball, of {len(careful)} reference "
        f"boxes. Size error is |d - d reference| in per cent of the reference box's diagonal. "
        f"The row of the run's true box opens its frames; the figure of boxes has every frame of "
        f"every row."
    )
    return Table("boxes", "Boxes against reference boxes", COLUMNS, tuple(rows), note)


def boxes_figure(
    frames: Sequence[Frame], careful: Mapping[int, Box], distances: Mapping[int, float]
) -> Figure:
    """IoU and size error of each box of each frame, over the distance of the ball.

    Args:
        frames: Of the dataset.
        careful: The reference box by id of the frame.
        distances: Camera to ball, metres, by id of the frame; frames without one are left out.
    """
    compared = sorted(
        (distances[frame.id], frame.id, frame, box)
        for frame, box in _comparable_boxes(frames, careful)
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
            tuple(_scatter_series(kind, label, compared, measure) for kind, label in ROWS),
        )
        for title, axis, measure in measures
    )
    return Figure("box_overlap", "Boxes against reference boxes", panels, note)


def _scatter_series(
    kind: str,
    label: str,
    compared: Sequence[tuple[float, int, Frame, Box]],
    measure: Callable[[Box, Box], float],
) -> Series:
    places = tuple(distance for distance, _, _, _ in compared)
    return Series(
        kind,
        label,
        places,
        tuple(measure(frame.boxes[kind], box) for _, _, frame, box in compared),
        kind="points",
        frames=tuple(FrameRange("distance_m", at, math.nextafter(at, math.inf)) for at in places),
    )


def _comparable_boxes(
    frames: Sequence[Frame], careful: Mapping[int, Box]
) -> list[tuple[Frame, Box]]:
    return [
        (frame, careful[frame.id])
        for frame in frames
        if frame.id in careful and has_every_box(frame)
    ]


def has_every_box(frame: Frame) -> bool:
    """Whether it has every kind of box, so that all rows are over the same frames."""
    return all(kind in frame.boxes for kind, _ in ROWS)


def _box_row(
    kind: str,
    label: str,
    compared: Sequence[tuple[Frame, Box, Box]],
    resamples: Resamples,
    whole: int,
    behind: FrameRange | None = None,
) -> Row:
    matches = [frame.match for frame, _, _ in compared]
    overlaps = [iou(box, careful) for _, box, careful in compared]
    errors = [size_error_percent(box, careful) for _, box, careful in compared]
    cells = (resamples.mean(overlaps, matches, whole), resamples.mean(errors, matches, whole))
    return Row(kind, label, cells, behind)


def _overlapping_detection(
    detections: Mapping[int, Sequence[Detection]], frame: Frame, careful: Box
) -> Box | None:
    found = sorted(detections.get(frame.id, ()), key=lambda item: -item.score)
    return next((item.box for item in found if iou(item.box, careful) > 0), None)
