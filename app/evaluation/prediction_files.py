"""Prediction files, read: ball boxes with scores, as detectors and people write them.

Three formats, each a file, a folder or a zip:

``coco``  COCO results: ``[{"image_id", "category_id", "bbox": [x, y, w, h], "score"}]``, pixels.
          ``image_id`` is the name of a frame, or an id of the ``images`` of a COCO document (in
          the same file, in another JSON file beside it, or handed over with it).
``yolo``  A text file per frame, a line per ball: ``class cx cy w h [confidence]``, shares of the
          image.
``csv``   A table. The frame stands in ``league, season, match, main_action, replay`` as in
          SNv3D.csv, or in ``frame`` (with ``camera``), ``image`` or ``file_name``; the box in
          ``ball_bbox`` (``[x, y, w, h]``) or in ``x, y, w, h``; ``score`` may be missing.

What is wrong is reported with file, record and field, and left out; frames that the dataset does
not have are counted and listed. Nothing is evaluated.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, get_args

from app.datasets import fields
from app.datasets.cameras_reader import read_cameras
from app.datasets.csv_text import is_missing, numbers_in, read_rows
from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits
from app.datasets.json_text import read_json
from app.datasets.report import Report
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError, InputError
from app.evaluation.frame_names import FrameNames, NamedFrame
from app.evaluation.prediction_run import (
    FieldError,
    PredictionRun,
    ReadPredictions,
    in_field,
    noted,
    read_field,
)
from app.geometry.camera import Camera
from app.soccer.choices import PredictionFormat
from app.soccer.frames import Box, ImageSize

FORMATS: tuple[str, ...] = get_args(PredictionFormat)
AUTO = "auto"
"""In the place of a format: as the endings of the files tell."""
ENDINGS = ((".csv", "csv"), (".json", "coco"), (".txt", "yolo"))
"""Formats by the endings of their files; where several are there, the first."""
_SCORES = ("score", "confidence", "conf")
_NAMES = ("image", "file_name", "image_id", "path", "name")
_SIDES = (("x", "y", "w", "h"), ("x", "y", "width", "height"))
_NUMBER_ALONE = "is a number; the COCO document with its images must come with the results"
_NOT_LABELS = frozenset({"classes.txt", "readme.txt", "license.txt", "licence.txt"})


@dataclass
class ReadPredictedCameras:
    """Cameras by id of the frame, at the annotated size, and what was wrong."""

    cameras: dict[int, Camera] = field(default_factory=dict)
    unknown: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    report: Report = field(default_factory=Report)


def read_predictions(
    path: Path,
    format: str,  # noqa: A002
    names: FrameNames,
    *,
    category: int | None = None,
    size: ImageSize | None = None,
    images: Path | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> ReadPredictions:
    """Read ball boxes.

    Args:
        path: File, folder or zip.
        format: One of ``FORMATS``, or ``auto``: as the endings of the files tell.
        names: The frames of the dataset.
        category: The class that is the ball; None where the file has one class only.
        size: Size of the images that pixels refer to; None: the annotated size of each frame.
        images: The COCO document that the numbers of ``coco`` results refer to.
        limits: Caps on what is read.

    Raises:
        InputError: The format is none, or the file as a whole is not what it should be.
    """
    if format not in (*FORMATS, AUTO):
        raise InputError(
            f'"{format}" is not a format of predictions; formats are {", ".join(FORMATS)} and {AUTO}',
            pointer="/format",
        )
    kind = _told_by_endings(path, limits) if format == AUTO else format
    run = PredictionRun(names, category, size)
    with opened_tree(path, run.found.report, limits) as tree:
        if tree is None:
            raise run.found.report.problems[0]
        run.found.format = kind
        if kind == "coco":
            beside = [] if images is None else _document(images, run, limits)
            _read_coco(_json_documents(tree, path), run, beside)
        elif kind == "yolo":
            _read_yolo(tree, path, run)
        else:
            _read_csv(tree, path, run, limits)
    run.finish(path)
    return run.found


def _told_by_endings(path: Path, limits: Limits) -> str:
    """The format of predictions by the endings of their files; ``coco`` where none tells it."""
    # What is wrong is reported by whoever reads them then.
    with opened_tree(path, Report(), limits) as tree:
        endings = set() if tree is None else {Path(name).suffix.lower() for name in tree.names()}
    return next((kind for ending, kind in ENDINGS if ending in endings), "coco")


def read_predicted_cameras(
    path: Path,
    names: FrameNames,
    *,
    size: ImageSize | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> ReadPredictedCameras:
    """Read SoccerNet camera JSON files; one of a static camera's name serves all its frames.

    Args:
        path: Folder, zip or file.
        names: The frames of the dataset.
        size: Size of the images that the cameras were made for; None: the annotated size.
        limits: Caps on what is read.

    Raises:
        InputError: No camera could be read.
    """
    found = ReadPredictedCameras()
    cameras = read_cameras(path, found.report, limits)
    if not cameras:
        problem = InputError(f"{path.name} holds no camera files")
        raise found.report.problems[0] if found.report.problems else problem
    for name, camera in cameras.items():
        frame = names.find(name)
        ids = (frame.id,) if frame is not None else names.of_station(name)
        if not ids:
            found.unknown[name] += 1
            found.reasons[name] = names.why_not(name)
        for identity in ids:
            found.cameras[identity] = _sized(camera, size, names.frames[identity].size)
    return found


def _sized(camera: Camera, made_for: ImageSize | None, annotated: ImageSize) -> Camera:
    if made_for is None or made_for == annotated:
        return camera
    return camera.scaled(annotated.width / made_for.width, annotated.height / made_for.height)


Documents = list[tuple[str, Any]]
"""JSON lists and objects, each with the name of its file."""


def _document(path: Path, run: PredictionRun, limits: Limits) -> Documents:
    with opened_tree(path, run.found.report, limits) as tree:
        if tree is None:
            raise run.found.report.problems[0]
        return _json_documents(tree, path)


def _read_coco(documents: Documents, run: PredictionRun, beside: Documents) -> None:
    images = _coco_images([*documents, *beside])
    several = any(isinstance(value, list) for _name, value in documents)
    for shown, value in documents:
        # Beside results, a document with annotations is the truth that they belong to.
        annotations = value if isinstance(value, list) else value.get("annotations", [])
        if several and not isinstance(value, list):
            continue
        if not isinstance(annotations, list):
            raise DatasetFormatError(shown, None, "annotations", "is not a list")
        for number, item in enumerate(annotations):
            run.found.report.read += 1
            with noted(run.found.report, shown, f"result {number}"):
                _add_coco(run, item, images)


def _json_documents(tree: FileTree, path: Path) -> Documents:
    found = []
    for name in tree.names():
        if not name.lower().endswith(".json"):
            continue
        value = read_json(tree.read_bytes(name), tree.shown(name))
        if not isinstance(value, (list, dict)):
            raise DatasetFormatError(
                tree.shown(name), None, None, "is neither a list nor an object"
            )
        if isinstance(value, list) or "images" in value or "annotations" in value:
            found.append((tree.shown(name), value))
    if not found:
        raise DatasetFormatError(str(path), None, None, "holds no COCO results")
    return found


def _coco_images(documents: Documents) -> dict[Any, tuple[str, ImageSize | None]]:
    """Name and size of each image of the COCO documents, by its id."""
    images: dict[Any, tuple[str, ImageSize | None]] = {}
    for shown, value in documents:
        listed = value.get("images", []) if isinstance(value, dict) else []
        for number, item in enumerate(listed if isinstance(listed, list) else []):
            try:
                image = fields.mapping(item)
                size = None
                if image.get("width") and image.get("height"):
                    size = ImageSize(fields.whole(image["width"]), fields.whole(image["height"]))
                identity = image.get("id")
                if not isinstance(identity, (int, str)):
                    raise ValueError("has no id")
                images[identity] = (str(image.get("file_name", "")), size)
            except ValueError as error:
                raise DatasetFormatError(shown, f"image {number}", None, str(error)) from error
    return images


def _add_coco(
    run: PredictionRun, item: Any, images: Mapping[Any, tuple[str, ImageSize | None]]
) -> None:
    value = fields.mapping(item)
    identity = value.get("image_id")
    if isinstance(identity, bool) or not isinstance(identity, (int, str)):
        raise FieldError("image_id", "is missing or neither a number nor a name")
    box = read_field(value, "bbox", lambda item: Box(*fields.numbers(item, 4)))
    score = read_field(value, "score", fields.number) if "score" in value else None
    if not run.wants(
        read_field(value, "category_id", fields.whole) if "category_id" in value else 1
    ):
        return
    name, size = images.get(identity, ("", None))
    frame = _coco_frame(run, identity, name)
    if frame is not None:
        with in_field("bbox"):
            run.add(frame, box, score, size)


def _coco_frame(run: PredictionRun, identity: int | str, name: str) -> NamedFrame | None:
    if name or isinstance(identity, str):
        return run.frame(name or str(identity))
    run.miss(f"image {identity}", _NUMBER_ALONE)
    return None


def _read_yolo(tree: FileTree, path: Path, run: PredictionRun) -> None:
    names = [
        name
        for name in tree.names()
        if name.lower().endswith(".txt") and PurePosixPath(name).name.lower() not in _NOT_LABELS
    ]
    if not names:
        raise DatasetFormatError(str(path), None, None, "holds no text files")
    for name in names:
        shown = tree.shown(name)
        try:
            lines = tree.read_bytes(name).decode("utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise DatasetFormatError(shown, None, None, "is not UTF-8 text") from error
        boxes = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]
        frame = run.names.find(name)
        if frame is None:
            run.found.unknown[name] += len(boxes)
            run.found.reasons[name] = run.names.why_not(name)
        for number, cells in boxes:
            run.found.report.read += 1
            with noted(run.found.report, shown, f"line {number}"):
                _add_yolo(run, frame, cells)


def _add_yolo(run: PredictionRun, frame: NamedFrame | None, cells: list[str]) -> None:
    if len(cells) not in (5, 6):
        raise ValueError(
            f"has {len(cells)} numbers, not class, cx, cy, w, h and maybe a confidence"
        )
    category = fields.whole(cells[0])
    x, y, width, height = (fields.number(cell) for cell in cells[1:5])
    if not all(-1 <= value <= 2 for value in (x, y, width, height)):
        raise ValueError("is in pixels; YOLO's numbers are shares of the image")
    score = fields.number(cells[5]) if len(cells) == 6 else None
    if not run.wants(category) or frame is None:
        return
    across, down = frame.size.width, frame.size.height
    box = Box((x - width / 2) * across, (y - height / 2) * down, width * across, height * down)
    with in_field("cx, cy, w, h"):
        run.add(frame, box, score, frame.size)


def _read_csv(tree: FileTree, path: Path, run: PredictionRun, limits: Limits) -> None:
    names = [name for name in tree.names() if name.lower().endswith(".csv")]
    if len(names) != 1:
        what = "no CSV file" if not names else f"{len(names)} CSV files; one is read"
        raise DatasetFormatError(str(path), None, None, f"holds {what}")
    shown = tree.shown(names[0])
    for line, cells in read_rows(tree.read_bytes(names[0]), shown, (), limits):
        run.found.report.read += 1
        with noted(run.found.report, shown, f"line {line}"):
            _add_row(run, cells)
    if not run.found.report.read:
        raise DatasetFormatError(shown, None, None, "holds no row: is it complete?")


def _add_row(run: PredictionRun, cells: Mapping[str, str]) -> None:
    box = _row_box(cells)
    if box is None:
        return
    score_name = next((name for name in _SCORES if not is_missing(cells.get(name))), None)
    score = read_field(cells, score_name, fields.number) if score_name else None
    category = cells.get("class", cells.get("category_id"))
    if not run.wants(fields.whole(category) if not is_missing(category) else 0):
        return
    frame = run.frame(_row_name(cells))
    if frame is not None:
        size = None
        if not is_missing(cells.get("img_w")) and not is_missing(cells.get("img_h")):
            size = ImageSize(
                read_field(cells, "img_w", fields.whole), read_field(cells, "img_h", fields.whole)
            )
        with in_field("ball_bbox" if "ball_bbox" in cells else "x, y, w, h"):
            run.add(frame, box, score, size)


def _row_box(cells: Mapping[str, str]) -> Box | None:
    """The box of a row; None where the row has none."""
    if "ball_bbox" in cells:
        if is_missing(cells["ball_bbox"]):
            return None
        return read_field(cells, "ball_bbox", lambda text: Box(*numbers_in(text, 4)))
    for sides in _SIDES:
        if all(side in cells for side in sides):
            if all(is_missing(cells[side]) for side in sides):
                return None
            return Box(*(read_field(cells, side, fields.number) for side in sides))
    raise FieldError("ball_bbox", "is missing, and so are x, y, w and h")


def _row_name(cells: Mapping[str, str]) -> str:
    """How a row calls its frame."""
    if not is_missing(cells.get("main_action")):
        action = read_field(cells, "main_action", fields.whole)
        replay = cells.get("replay")
        image = f"{action}" if is_missing(replay) else f"{action}_{fields.whole(replay)}"
        parts = [cells.get(name, "").strip() for name in ("league", "season", "match")]
        return "/".join([part for part in parts if part] + [image])
    if not is_missing(cells.get("frame")):
        camera = cells.get("camera")
        if is_missing(camera):
            return cells["frame"].strip()
        number = (camera or "").strip().removeprefix("cam")
        return f"cam{number}/{cells['frame'].strip().removesuffix('.0')}"
    for name in _NAMES:
        if not is_missing(cells.get(name)):
            return cells[name].strip()
    raise FieldError("frame", "is missing, and so is every other name of the frame")
