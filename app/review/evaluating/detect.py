"""Detect: a detector looks at every frame of a dataset; what it finds stays a prediction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from app.config import Settings
from app.datasets.corner_origin import box_from_corner
from app.errors import ImageError, InputError, NotFoundError, StorageError, TooLargeError
from app.evaluation.frame import Detection
from app.progress import TellProgress
from app.review.datasets.dataset import read_dataset_head
from app.review.datasets.naming import require_name
from app.review.evaluating.onnx_model import OnnxModel
from app.review.evaluating.predictions import (
    LISTED,
    frame_names,
    require_free,
    save_predictions,
)
from app.review.queue.query import parse_query
from app.soccer.frames import Box
from app.store.media import decode_frame
from app.store.predictions import PredictionSet
from app.store.session import Session
from app.store.store import Store
from app.store.views import StoredView, dataset_views

MIN_SCORE = 0.05
MOST = 20
"""Detections of a frame that are kept."""


@dataclass(frozen=True)
class DetectRequest:
    """What a detector shall look at.

    Attributes:
        name: Of the set of predictions that comes of it.
        query: Groups, as the queue's text has it; empty: all.
        missing: Only views that have no ball yet.
        min_score: Less sure detections are not kept.
    """

    name: str
    query: str = ""
    missing: bool = False
    min_score: float = MIN_SCORE


def detect(
    store: Store,
    dataset: str | int,
    model: OnnxModel,
    request: DetectRequest,
    *,
    actor: str,
    progress: TellProgress | None = None,
) -> PredictionSet:
    """Run a detector over frames; the set appears whole, when all of them were looked at.

    Frames that cannot be read are named in the set's report and count as not looked at.

    Raises:
        InputError: The name or the query is impossible, the model does not run, or no frame
            could be read.
        ConflictError: There is a set of that name.
    """
    require_name(request.name, "a set of predictions", digits=True)
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        require_free(session, found.id, request.name)
        rows = _views(session, found.id, request)
    detections: dict[int, list[Detection]] = {}
    problems: list[dict[str, Any]] = []
    for number, row in enumerate(rows):
        if progress is not None:
            progress(number, len(rows), f"Looking for balls with {model.path.name}.")
        try:
            picture = _picture(row, store.settings)
        except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
            problems.append(_problem(row, error.message))
            continue
        detections[row.id] = _in_annotated(row, picture, model, request)
    if not detections:
        raise _nothing_seen(rows, problems)
    return save_predictions(
        store,
        found.id,
        request.name,
        {view: boxes for view, boxes in detections.items() if boxes},
        {},
        names=frame_names(store, found.id),
        format="detect",
        source=model.path.name,
        report={
            "model": model.digest,
            "read": sum(map(len, detections.values())),
            "looked_at": len(detections),
            "min_score": request.min_score,
            "problems": problems[:LISTED],
            "more_problems": max(len(problems) - LISTED, 0),
        },
        actor=actor,
    )


def _views(session: Session, dataset_id: int, request: DetectRequest) -> list[StoredView]:
    conditions = parse_query(request.query).conditions
    return dataset_views(session, dataset_id, conditions, without_ball=request.missing)


def _picture(row: StoredView, settings: Settings) -> Any:
    if row.media is None:
        raise NotFoundError("this view has no frame that could be read")
    return decode_frame(row.media, row.flipped, settings)[:, :, ::-1]


def _in_annotated(
    row: StoredView, picture: Any, model: OnnxModel, request: DetectRequest
) -> list[Detection]:
    """Detections in pixels of the annotated size, which need not be the frame's own."""
    height, width = picture.shape[:2]
    x, y = row.width / width, row.height / height
    return [
        Detection(
            # YOLO counts from the corner of the first pixel.
            box_from_corner(
                Box(item.box.x * x, item.box.y * y, item.box.width * x, item.box.height * y)
            ),
            item.score,
        )
        for item in model.detect(picture, min_score=request.min_score, most=MOST)
    ]


def _problem(row: StoredView, problem: str) -> dict[str, Any]:
    return {"file": row.group, "record": row.key, "field": None, "problem": problem}


def _nothing_seen(rows: list[StoredView], problems: list[dict[str, Any]]) -> InputError:
    if not rows:
        return InputError(
            "no view is to be looked at: the query finds none, or all that it finds have a ball",
            hint="Ask with another query, or without --missing.",
        )
    return InputError(
        f"none of the {len(rows)} frames could be read: {problems[0]['problem']}",
        hint="Import the dataset with its frames.",
    )
