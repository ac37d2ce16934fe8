"""A detector (an ONNX model such as YOLO) looks at every frame of a dataset; what it finds stays a prediction.

The layout is that of Ultralytics' ONNX export: the input is RGB in [0, 1], letterboxed on grey;
the output is (1, 4 + classes, N) with cx, cy, w, h in input pixels and a score per class, or,
from an export with its own suppression, (1, N, 6) with x1, y1, x2, y2, score, class.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.db.session import Session
from app.db.store import Store
from app.errors import ImageError, InputError, NotFoundError, StorageError, TooLargeError
from app.evaluation.frame import Detection
from app.features.datasets.service import read_dataset_head, require_valid_name
from app.features.groups.view_queries import StoredView, list_dataset_views
from app.features.predictions.queries import PredictionSet
from app.features.predictions.service import (
    LISTED,
    read_frame_names,
    require_unused_set_name,
    save_predictions,
)
from app.features.queue.query import parse_query
from app.formats.ball_names import is_ball_name
from app.geometry.arrays import FloatArray
from app.media.files import decode_frame
from app.progress import ReportProgress
from app.soccer.frames import Box, ImageSize, box_from_corner_origin
from app.wording import plural

GRAY = 114
"""What Ultralytics fills the border with."""
SUPPRESS_IOU = 0.7
MAX_CANDIDATES = 3000
"""Of one picture, before suppression; the surest ones."""

Picture = Any


@dataclass(frozen=True)
class Letterbox:
    """How a picture lies in the network's input: scaled by ``scale``, then moved."""

    scale: float
    left: int
    top: int
    input: ImageSize
    picture: ImageSize

    @staticmethod
    def fit(picture: ImageSize, network: ImageSize) -> Letterbox:
        """The picture as large as it fits, in the middle."""
        scale = min(network.width / picture.width, network.height / picture.height)
        across, down = round(picture.width * scale), round(picture.height * scale)
        # Ultralytics' own rounding: of an odd border, the smaller half comes first.
        left = round((network.width - across) / 2 - 0.1)
        top = round((network.height - down) / 2 - 0.1)
        return Letterbox(scale, left, top, network, picture)

    def prepare(self, picture: Picture) -> npt.NDArray[np.float32]:
        """The network's input for a BGR picture of 8 bits, shape (1, 3, height, width)."""
        across = round(self.picture.width * self.scale)
        down = round(self.picture.height * self.scale)
        if (across, down) != (self.picture.width, self.picture.height):
            picture = cv2.resize(picture, (across, down), interpolation=cv2.INTER_LINEAR)
        filled = np.full((self.input.height, self.input.width, 3), GRAY, np.uint8)
        filled[self.top : self.top + down, self.left : self.left + across] = picture
        planes = filled[:, :, ::-1].transpose(2, 0, 1)[None]
        return np.ascontiguousarray(planes, dtype=np.float32) / np.float32(255)

    def restore(self, corners: FloatArray) -> FloatArray:
        """Corners x1, y1, x2, y2 of the input as corners of the picture, both shape (N, 4)."""
        moved = corners - np.array([self.left, self.top, self.left, self.top])
        width, height = self.picture.width, self.picture.height
        result: FloatArray = np.clip(moved / self.scale, 0, [width, height, width, height])
        return result


def decode_output(
    output: FloatArray, box: Letterbox, category: int, min_score: float, most: int
) -> list[Detection]:
    """The balls of one picture, the surest first.

    Args:
        output: Of the network, shape (1, 4 + classes, N) or (1, N, 6).
        box: How the picture was prepared.
        category: The class that is the ball.
        min_score: Less sure ones are left out.
        most: How many at most.

    Raises:
        InputError: The output has another shape, or not that many classes.
    """
    corners, scores = _decode_candidate_boxes(np.asarray(output, dtype=float), category)
    order = np.argsort(-scores, kind="stable")
    order = order[scores[order] >= min_score][:MAX_CANDIDATES]
    kept = suppress_overlapping(corners[order], SUPPRESS_IOU, most)
    places = box.restore(corners[order][kept])
    found = []
    for (x1, y1, x2, y2), score in zip(places.tolist(), scores[order][kept].tolist(), strict=True):
        if x2 > x1 and y2 > y1:
            found.append(Detection(Box(x1, y1, x2 - x1, y2 - y1), min(max(score, 0.0), 1.0)))
    return found


def suppress_overlapping(corners: FloatArray, limit: float, most: int) -> list[int]:
    """Non-maximum suppression of boxes x1, y1, x2, y2, the surest first, shape (N, 4).

    Returns:
        Places of those that are kept, in order.
    """
    area = (corners[:, 2] - corners[:, 0]) * (corners[:, 3] - corners[:, 1])
    left = np.ones(len(corners), dtype=bool)
    kept: list[int] = []
    for place in range(len(corners)):
        if not left[place] or len(kept) >= most:
            continue
        kept.append(place)
        low = np.maximum(corners[place, :2], corners[:, :2])
        high = np.minimum(corners[place, 2:], corners[:, 2:])
        shared = np.clip(high - low, 0, None).prod(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            left &= ~(shared / (area[place] + area - shared) > limit)
    return kept


def find_ball_category(names: Sequence[str]) -> int | None:
    """The class that is a ball, by the names in a model; None where none or several could be.

    Example:
        >>> find_ball_category(["person", "bicycle", "sports ball"])
        2
    """
    if len(names) == 1:
        return 0
    balls = [place for place, name in enumerate(names) if is_ball_name(name)]
    return balls[0] if len(balls) == 1 else None


def _decode_candidate_boxes(output: FloatArray, category: int) -> tuple[FloatArray, FloatArray]:
    if output.ndim != 3 or output.shape[0] != 1:
        raise InputError(
            f"the model's output has the shape {output.shape}, not (1, 4 + classes, N)"
        )
    rows = output[0]
    # Raw output has 4 + classes rows; with the suppression inside it has 6 columns. Both at once
    # fit only a raw output of six candidates, which no detector has.
    if rows.shape[1] == 6:
        return rows[:, :4], np.where(rows[:, 5] == category, rows[:, 4], -1.0)
    if rows.shape[0] < 5 + category:
        raise InputError(
            f"the model has {max(rows.shape[0] - 4, 0)} classes, so the ball cannot be class {category}",
            pointer="/category",
        )
    center, half = rows[:2].T, rows[2:4].T / 2
    return np.hstack([center - half, center + half]), rows[4 + category]


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
        chosen = find_ball_category(names) if category is None else category
        if chosen is None and names:
            raise InputError(
                f"it is not clear from their names which of the {len(names)} classes of"
                f" {path.name} is the ball",
                hint="Name the class of the ball with --category.",
                pointer="/category",
            )
        if names and category is not None and category >= len(names):
            raise InputError(
                f"{path.name} has {plural(len(names), 'class', 'classes')}, so the ball cannot be class {category}",
                pointer="/category",
            )
        return OnnxModel(
            path=path,
            digest=hashlib.sha256(path.read_bytes()).hexdigest(),
            input=_find_input_size(path, first.shape, meta.get("imgsz", ""), side),
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
                f"the model {self.path.name} failed on a picture ({_extract_first_error_line(error)})"
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
            f"{path.name} is not an ONNX model that can be run ({_extract_first_error_line(error)})",
            hint="docs/detector.md has the command that exports one.",
        ) from error


def _extract_first_error_line(error: Exception) -> str:
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


def _find_input_size(path: Path, shape: list[Any], text: str, side: int | None) -> ImageSize:
    """Height and width of the input: the model's, else what it says, else the caller's."""
    if len(shape) != 4:
        raise InputError(
            f"{path.name} is not an image detector: its input has the shape {shape}, not (1, 3, H, W)"
        )
    height, width = (item if isinstance(item, int) and item > 0 else None for item in shape[2:])
    if side and height is not None and width is not None:
        raise InputError(
            f"{path.name} needs pictures of {width} x {height} pixels, so --side has no effect",
            hint="Leave --side out.",
            pointer="/side",
        )
    if height is None or width is None:
        sides = [int(part) for part in text.strip("[]() ").split(",") if part.strip().isdigit()]
        chosen = [side, side] if side else (sides * 2)[:2] or [DEFAULT_SIDE, DEFAULT_SIDE]
        height, width = height or chosen[0], width or chosen[1]
    if not (1 <= height <= MAX_SIDE and 1 <= width <= MAX_SIDE):
        raise InputError(
            f"{path.name} needs pictures of {width} x {height} pixels, and {MAX_SIDE:,} a side are possible"
        )
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
    require_valid_name(request.name, "a set of predictions", digits=True)
    with store.read() as session:
        found = read_dataset_head(session, dataset)
        require_unused_set_name(session, found.id, request.name)
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
        detections[row.id] = _detect_in_annotated_pixels(row, picture, model, request)
    if not detections:
        raise _no_readable_frame_error(rows, problems)
    return save_predictions(
        store,
        found.id,
        request.name,
        {view: boxes for view, boxes in detections.items() if boxes},
        {},
        names=read_frame_names(store, found.id),
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
    return list_dataset_views(session, dataset_id, conditions, without_ball=request.missing)


def _read_frame(row: StoredView, settings: Settings) -> Any:
    if row.media is None:
        raise NotFoundError("this view has no frame that could be read")
    return decode_frame(row.media, row.flipped, settings)[:, :, ::-1]


def _detect_in_annotated_pixels(
    row: StoredView, picture: Any, model: OnnxModel, request: DetectRequest
) -> list[Detection]:
    """Detections in pixels of the annotated size, which need not be the frame's own."""
    height, width = picture.shape[:2]
    x, y = row.width / width, row.height / height
    return [
        Detection(
            # YOLO counts from the corner of the first pixel.
            box_from_corner_origin(
                Box(item.box.x * x, item.box.y * y, item.box.width * x, item.box.height * y)
            ),
            item.score,
        )
        for item in model.detect(picture, min_score=request.min_score, most=MOST)
    ]


def _make_problem(row: StoredView, problem: str) -> dict[str, Any]:
    return {"file": row.group, "record": row.key, "field": None, "problem": problem}


def _no_readable_frame_error(rows: list[StoredView], problems: list[dict[str, Any]]) -> InputError:
    if not rows:
        return InputError(
            "there is no view to search: the query matches none, or all that match already have a ball",
            hint="Use another query, or leave out --missing.",
        )
    return InputError(
        f"none of the {len(rows)} frames could be read: {problems[0]['problem']}",
        hint="Import the dataset with its frames.",
    )
