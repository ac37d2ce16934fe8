"""A detector (an ONNX model) looks at every frame of a dataset; what it finds stays a prediction."""

from __future__ import annotations

import ast
import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.errors import ImageError, InputError, NotFoundError, StorageError, TooLargeError
from app.evaluation.frame import Detection
from app.evaluation.yolo import Letterbox, Picture, ball_category, decode_output
from app.features.datasets.service import read_dataset_head, require_name
from app.features.groups.view_queries import StoredView, dataset_views
from app.features.predictions.queries import PredictionSet
from app.features.predictions.service import LISTED, frame_names, require_free, save_predictions
from app.features.queue.query import parse_query
from app.media.files import decode_frame
from app.progress import ReportProgress
from app.soccer.frames import Box, ImageSize, box_from_corner

DEFAULT_SIDE = 640
"""Of the input, where the model leaves it open and does not say."""
MAX_SIDE = 4096
MAX_NAMES = 10_000
MAX_BYTES = 2 * 1024**3


@dataclass(frozen=True)
class OnnxModel:
    """A model that is ready to run.

    Attributes:
        digest: SHA-256 of the file.
        input: Size of its pictures.
        names: Of its classes, in order; empty where it does not say.
        category: The class that is the ball.
    """

    path: Path
    digest: str
    input: ImageSize
    names: tuple[str, ...]
    category: int
    _session: Any
    _input_name: str

    @staticmethod
    def open(
        path: Path, *, category: int | None = None, side: int | None = None, threads: int = 1
    ) -> OnnxModel:
        """Open a model.

        Args:
            path: ``MODEL.onnx``.
            category: The class that is the ball; None: the one that is called so.
            side: Longest side of the input, where the model leaves it open.
            threads: How many the network may use.

        Raises:
            InputError: onnxruntime is not installed, the file is no such model, or its ball class
                cannot be told.
        """
        session = _open_model(path, threads)
        (first, *_) = session.get_inputs()
        meta = dict(session.get_modelmeta().custom_metadata_map)
        names = _parse_class_names(meta.get("names", ""))
        chosen = ball_category(names) if category is None else category
        if chosen is None and names:
            raise InputError(
                f"{path.name} has {len(names)} classes and several or none of them are balls",
                hint="Say which one is the ball (--category).",
                pointer="/category",
            )
        return OnnxModel(
            path=path,
            digest=hashlib.sha256(path.read_bytes()).hexdigest(),
            input=_input_size(path, first.shape, meta.get("imgsz", ""), side),
            names=names,
            category=chosen or 0,
            _session=session,
            _input_name=first.name,
        )

    def detect(self, picture: Picture, *, min_score: float, most: int) -> list[Detection]:
        """The balls of a BGR picture, in its own pixels, the surest first."""
        height, width = picture.shape[:2]
        box = Letterbox.fit(ImageSize(width, height), self.input)
        try:
            (output, *_) = self._session.run(None, {self._input_name: box.prepare(picture)})
        except Exception as error:
            raise InputError(
                f"{self.path.name} does not run on a picture ({_first_line(error)})"
            ) from error
        return decode_output(np.asarray(output), box, self.category, min_score, most)


def _open_model(path: Path, threads: int) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise InputError(
            "a detector needs onnxruntime, which is not installed",
            hint="Install it with: pip install 'touchline[detect]'",
        ) from error
    if not path.is_file():
        raise InputError(f"there is no model {path}")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path.name} is larger than {MAX_BYTES:,} bytes")
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4
    options.intra_op_num_threads = threads
    try:
        return onnxruntime.InferenceSession(str(path), options, ["CPUExecutionProvider"])
    except Exception as error:
        raise InputError(
            f"{path.name} is no ONNX model that can be run ({_first_line(error)})",
            hint="docs/detector.md has the command that exports one.",
        ) from error


def _first_line(error: Exception) -> str:
    """The first line of what the runtime says, without its address in the source."""
    return str(error).strip().splitlines()[0].split(" : ")[-1][:200]


def _parse_class_names(text: str) -> tuple[str, ...]:
    """Class names as Ultralytics writes them into a model: ``{0: 'ball', 1: 'player'}``."""
    if not text or len(text) > 1_000_000:
        return ()
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return ()
    if isinstance(value, list):
        value = dict(enumerate(value))
    if not isinstance(value, dict) or not 0 < len(value) <= MAX_NAMES:
        return ()
    return tuple(str(value.get(place, "")) for place in range(len(value)))


def _input_size(path: Path, shape: list[Any], text: str, side: int | None) -> ImageSize:
    """Height and width of the input: the model's, else what it says, else the caller's."""
    if len(shape) != 4:
        raise InputError(f"{path.name} takes no picture: its input has the shape {shape}")
    height, width = (item if isinstance(item, int) and item > 0 else None for item in shape[2:])
    if height is None or width is None:
        sides = [int(part) for part in text.strip("[]() ").split(",") if part.strip().isdigit()]
        chosen = [side, side] if side else (sides * 2)[:2] or [DEFAULT_SIDE, DEFAULT_SIDE]
        height, width = height or chosen[0], width or chosen[1]
    if not (1 <= height <= MAX_SIDE and 1 <= width <= MAX_SIDE):
        raise InputError(f"{path.name} takes pictures of {width} x {height} pixels")
    return ImageSize(width, height)


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


def run_detector(
    store: Store,
    dataset: str | int,
    model: OnnxModel,
    request: DetectRequest,
    *,
    actor: str,
    progress: ReportProgress | None = None,
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
        rows = _read_views(session, found.id, request)
    detections: dict[int, list[Detection]] = {}
    problems: list[dict[str, Any]] = []
    for number, row in enumerate(rows):
        if progress is not None:
            progress(number, len(rows), f"Looking for balls with {model.path.name}.")
        try:
            picture = _read_frame(row, store.settings)
        except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
            problems.append(_make_problem(row, error.message))
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


def _read_views(session: Session, dataset_id: int, request: DetectRequest) -> list[StoredView]:
    conditions = parse_query(request.query).conditions
    return dataset_views(session, dataset_id, conditions, without_ball=request.missing)


def _read_frame(row: StoredView, settings: Settings) -> Any:
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


def _make_problem(row: StoredView, problem: str) -> dict[str, Any]:
    return {"file": row.group, "record": row.key, "field": None, "problem": problem}


def _nothing_seen(rows: list[StoredView], problems: list[dict[str, Any]]) -> InputError:
    if not rows:
        return InputError(
            "there is no view to search: the query matches none, or all that match already have a ball",
            hint="Use another query, or leave out --missing.",
        )
    return InputError(
        f"none of the {len(rows)} frames could be read: {problems[0]['problem']}",
        hint="Import the dataset with its frames.",
    )
