"""Prediction files, read: ball boxes with scores, as detectors and people write them.

Four formats, each a file, a folder or a zip:

``coco``  COCO results: ``[{"image_id", "category_id", "bbox": [x, y, w, h], "score"}]``, pixels
          from the corner of the first pixel. ``file_name`` names the frame where it is there; else
          ``image_id`` does, or is an id of the ``images`` of a COCO document (in the same file, in
          another JSON file beside it, or handed over with it).
``yolo``  A text file per frame, a line per ball: ``class cx cy w h [confidence] [track]``, shares
          of the image.
``csv``   A table (``prediction_table``). The frame stands in ``league, season, match, main_action,
          replay`` as in SNv3D.csv, in ``image`` or ``file_name``, or in ``frame`` (with ``camera``);
          the box in ``ball_bbox`` (``[x, y, w, h]``), ``x, y, w, h``, corners or centre and size;
          ``score`` may be missing. MOT's text files, too.
``tracks`` The ball in 3D over time (``prediction_table``).

Names count before numbers. What is wrong is reported with file, record and field, and left out; frames that the dataset does
not have are counted and listed. Nothing is evaluated.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any, get_args

from app.errors import DatasetFormatError, InputError
from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.evaluation.prediction_run import (
    FieldError,
    LoadedPredictions,
    PredictionCollector,
    raise_as_field_error,
    read_field,
    report_invalid_record,
)
from app.evaluation.prediction_table import (
    is_ball_track_table,
    is_mot_text,
    read_table,
    read_tracks,
)
from app.formats import fields
from app.formats.ball_names import is_ball_name
from app.formats.cameras import read_cameras
from app.formats.fields import IdIndex, id_to_text
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits
from app.formats.json_reader import describe_document, read_json, read_json_lines
from app.formats.report import ReaderReport
from app.formats.trees import open_tree_context
from app.geometry.camera import Camera
from app.json_text import quote_text
from app.soccer.choices import PredictionFormat
from app.soccer.frames import Box, ImageSize
from app.soccer.picture import size_centred_on_principal_point

FORMATS: tuple[str, ...] = get_args(PredictionFormat)
AUTO = "auto"
"""In the place of a format: as the endings of the files tell."""
ENDINGS = (
    (".csv", "csv"),
    (".tsv", "csv"),
    (".json", "coco"),
    (".jsonl", "coco"),
    (".txt", "yolo"),
    (".parquet", "tracks"),
)
"""Formats by the endings of their files; where several are there, the first."""
_NAMES = ("file_name", "filename", "image_name", "image_path", "image", "path")
_LISTS = ("predictions", "results", "detections")
_NUMBER_ALONE = "is a number; give each result a file_name, or hand over the COCO document with its images (--images)"
_NOT_LABELS = frozenset({"classes.txt", "readme.txt", "license.txt", "licence.txt"})


@dataclass
class LoadedPredictedCameras:
    """Cameras by id of the frame, at the annotated size, and what was wrong."""

    cameras: dict[int, Camera] = field(default_factory=dict)
    unknown: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    report: ReaderReport = field(default_factory=ReaderReport)


def read_predictions(
    path: Path,
    format: str,  # noqa: A002
    names: FrameNameIndex,
    *,
    category: int | None = None,
    size: ImageSize | None = None,
    images: Path | None = None,
    limits: ImportLimits = DEFAULT_LIMITS,
) -> LoadedPredictions:
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
    kind = _guess_format_from_suffixes(path, limits) if format == AUTO else format
    run = PredictionCollector(names, category, size)
    with open_tree_context(path, run.found.report, limits) as tree:
        if tree is None:
            raise run.found.report.problems[0]
        run.found.format = kind
        if images is not None and kind != "coco":
            raise _make_unused_option_error("images", "a COCO document with the image list", kind)
        if size is not None and kind == "yolo":
            raise _make_unused_option_error(
                "size", "an image size: its coordinates are fractions of the image size", kind
            )
        if kind == "tracks":
            if size is not None or category is not None:
                option = "size" if size is not None else "category"
                raise _make_unused_option_error(
                    option, f"a {option}: its rows are positions on the pitch", kind
                )
            run.found.tracks = read_tracks(tree, path, run.found.report, limits)
            return run.found
        if kind == "coco":
            beside = [] if images is None else _read_json_documents(images, run, limits)
            _read_coco(_parse_json_documents(tree, path, run.found.report), run, beside)
        elif kind == "yolo":
            _read_yolo(tree, path, run)
        else:
            read_table(tree, path, run, limits)
    run.validate_predictions(path)
    return run.found


def _make_unused_option_error(option: str, what: str, kind: str) -> InputError:
    return InputError(
        f"predictions in the format {kind} do not use {what}",
        hint=f"Leave {option} out.",
        pointer=f"/{option}",
    )


def _guess_format_from_suffixes(path: Path, limits: ImportLimits) -> str:
    """The format of predictions by the endings of their files; ``coco`` where none tells it."""
    # What is wrong is reported by whoever reads them then.
    with open_tree_context(path, ReaderReport(), limits) as tree:
        names = [] if tree is None else tree.names()
        endings = {PurePosixPath(name).suffix.lower() for name in names}
        kind = next((kind for ending, kind in ENDINGS if ending in endings), "coco")
        if tree is not None and kind == "csv":
            tables = (name for name in names if name.lower().endswith(".csv"))
            return (
                "tracks"
                if any(is_ball_track_table(tree.read_bytes(name)) for name in tables)
                else kind
            )
        if tree is not None and kind == "yolo":
            first = next(name for name in names if name.lower().endswith(".txt"))
            # MOT's files end as YOLO's do.
            return "csv" if is_mot_text(tree.read_bytes(first)) else kind
    return kind


def read_predicted_cameras(
    path: Path,
    names: FrameNameIndex,
    *,
    size: ImageSize | None = None,
    limits: ImportLimits = DEFAULT_LIMITS,
) -> LoadedPredictedCameras:
    """Read camera files; one called like a static camera, or like views of one match, serves all of them.

    Args:
        path: Folder, zip or file.
        names: The frames of the dataset.
        size: Size of the images that the cameras were made for; None: the annotated size.
        limits: Caps on what is read.

    Raises:
        InputError: No camera could be read.
    """
    found = LoadedPredictedCameras()
    sizes: dict[str, ImageSize] = {}
    cameras = read_cameras(path, found.report, limits, sizes)
    if not cameras:
        problem = InputError(f"{path.name} contains no camera files (camera_<frame>.json)")
        raise found.report.problems[0] if found.report.problems else problem
    meant: dict[str, tuple[int, ...]] = {}
    for name in cameras:
        meant[name] = _find_frames_of_camera(names, name, path.stem)
        if not meant[name]:
            found.unknown[name] += 1
            found.reasons[name] = names.explain_unknown_name(name)
    # A camera of one frame counts before that of its rig.
    for name in sorted(meant, key=lambda name: len(meant[name])):
        camera = cameras[name]
        ids = [identity for identity in meant[name] if identity not in found.cameras]
        if meant[name] and not ids:
            message = "is a second camera of its view; the first one is used"
            found.report.add_problem_at(path.name, name, None, message)
        for identity in ids:
            annotated = names.frames[identity].size
            made_for = sizes.get(name) or size
            if (
                other := size_centred_on_principal_point(camera, made_for or annotated)
            ) is not None:
                message = (
                    f"was made for {other.width} x {other.height}: its principal point is the middle of "
                    f"that; say so (--cameras-size {other.width}x{other.height})"
                )
                found.report.add_problem_at(path.name, name, "principal_point", message)
            found.cameras[identity] = _resize_camera(camera, made_for, annotated)
    return found


def _find_frames_of_camera(names: FrameNameIndex, name: str, top_folder: str) -> tuple[int, ...]:
    """Ids of the frames that a camera is of; folders of a place on a disk count where they name something."""
    place = name.lstrip("/")
    for meant in dict.fromkeys((place, name.rsplit("/", 1)[-1] if place != name else place)):
        if (frame := names.find(meant)) is not None:
            return (frame.id,)
        if found := names.find_station_frames(meant, top_folder):
            return found
    return ()


def _resize_camera(camera: Camera, made_for: ImageSize | None, annotated: ImageSize) -> Camera:
    if made_for is None or made_for == annotated:
        return camera
    return camera.scaled(annotated.width / made_for.width, annotated.height / made_for.height)


Documents = list[tuple[str, Any]]
"""JSON lists and objects, each with the name of its file."""


def _read_json_documents(path: Path, run: PredictionCollector, limits: ImportLimits) -> Documents:
    with open_tree_context(path, run.found.report, limits) as tree:
        if tree is None:
            raise run.found.report.problems[0]
        return _parse_json_documents(tree, path, run.found.report)


def _read_coco(documents: Documents, run: PredictionCollector, beside: Documents) -> None:
    # What was handed over counts before what lies beside the results.
    known = _CocoImages.of([*beside, *documents], run.found.report)
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
            with report_invalid_record(run.found.report, shown, f"result {number}"):
                _add_coco_result(run, item, known)


def _parse_json_documents(tree: FileTree, path: Path, report: ReaderReport) -> Documents:
    found = []
    other = None
    for name in tree.names():
        if not name.lower().endswith((".json", ".jsonl")):
            continue
        shown, content = tree.shown(name), tree.read_bytes(name)
        try:
            value = read_json(content, shown, nan="keep")
        except DatasetFormatError:
            value = read_json_lines(content, shown, report)
            if value is None:
                raise
        if not isinstance(value, (list, dict)):
            raise DatasetFormatError(shown, None, None, "is neither a list nor an object")
        if isinstance(value, dict):
            listed = (value[name] for name in _LISTS if isinstance(value.get(name), list))
            value = next(listed, value)
        if isinstance(value, list) or "images" in value or "annotations" in value:
            found.append((shown, value))
        else:
            other = f"{describe_document(value)}; {_RESULTS}"
    if not found:
        problem = other or "contains no COCO results"
        raise DatasetFormatError(str(path), None, None, problem)
    return found


_RESULTS = 'COCO results are [{"file_name", "category_id", "bbox": [x, y, w, h], "score"}, ...]'


@dataclass(frozen=True)
class _CocoImages:
    """Images and classes of COCO documents.

    Attributes:
        names: Name of the file by id.
        sizes: Size by name of the file, where the document says it.
        classes: Name by id; empty where no class is called ball.
    """

    names: IdIndex[str]
    sizes: Mapping[str, ImageSize]
    classes: IdIndex[str]

    @staticmethod
    def of(documents: Documents, report: ReaderReport) -> _CocoImages:
        names, classes = IdIndex[str](), IdIndex[str]()
        sizes: dict[str, ImageSize] = {}
        balls = False
        for shown, value in documents:
            for number, item in enumerate(_get_list_field(value, "images")):
                with report_invalid_record(report, shown, f"image {number}"):
                    image = fields.require_object(item)
                    name = str(image.get("file_name", ""))
                    with report_invalid_record(report, shown, f"image {number}"):
                        if image.get("width") and image.get("height"):
                            sides = (
                                read_field(image, side, fields.parse_whole_number)
                                for side in ("width", "height")
                            )
                            sizes[name] = ImageSize(*sides)
                    _index_name_by_id(names, image, name)
            for number, item in enumerate(_get_list_field(value, "categories")):
                with report_invalid_record(report, shown, f"category {number}"):
                    category = fields.require_object(item)
                    name = str(category.get("name", ""))
                    _index_name_by_id(classes, category, name)
                    balls = balls or is_ball_name(name)
        return _CocoImages(names, sizes, classes if balls else IdIndex())


def _get_list_field(value: Any, name: str) -> list[Any]:
    found = value.get(name) if isinstance(value, dict) else None
    return found if isinstance(found, list) else []


def _index_name_by_id(index: IdIndex[str], item: Mapping[str, Any], name: str) -> None:
    """Add the name of an image or a class by its id.

    Raises:
        FieldError: The id is none, or that of another one.
    """
    value = item.get("id")
    if not index.add(value, name) and (known := index.find(value)) != name:
        known_as = (
            None
            if known is None
            else f"is {id_to_text(value)}, which is {quote_text(known)} already"
        )
        raise FieldError(
            "id", f"{known_as or 'must be a number or a string'}; this entry is left out"
        )


def _format_image_id(value: Any) -> str:
    """An id of an image as text, 1.0 like 1.

    Raises:
        ValueError: It is neither a number nor a name.
    """
    text = id_to_text(value)
    if text is None or (isinstance(value, float) and not value.is_integer()):
        raise ValueError("is missing or neither a number nor a name")
    return text


def _read_class(value: Mapping[str, Any], known: _CocoImages) -> tuple[int | str, str]:
    """The id of the class of a result, and what a document calls it."""
    if "category_id" not in value:
        return 1, known.classes.find(1) or ""
    label, text = known.classes.find(value["category_id"]), id_to_text(value["category_id"])
    try:
        return read_field(value, "category_id", fields.parse_whole_number), label or ""
    except FieldError:
        # A class may be called by a word, where the document lists it so.
        if label is None or text is None:
            raise
        return text, label


def _add_coco_result(run: PredictionCollector, item: Any, known: _CocoImages) -> None:
    value = fields.require_object(item)
    own = next((name for field in _NAMES if isinstance(name := value.get(field), str) and name), "")
    identity = ""
    if not own or value.get("image_id") is not None:
        with raise_as_field_error("image_id"):
            identity = _format_image_id(value.get("image_id"))
    box = read_field(value, "bbox", lambda item: Box(*fields.parse_numbers(item, 4)))
    score = read_field(value, "score", fields.parse_number) if "score" in value else None
    if not run.count_class_and_check_ball(*_read_class(value, known)):
        return
    named = known.names.find(identity) or ""
    if own:
        frame = run.find_frame_or_count_unknown(own)
        if problem := _describe_contradiction(run, own, identity, named, frame):
            raise FieldError("file_name", problem)
    elif named or isinstance(value["image_id"], str):
        frame = run.find_frame_or_count_unknown(named or identity)
    else:
        frame = None
        run.count_unknown_frame(f"image {identity}", _NUMBER_ALONE)
    if frame is not None:
        with raise_as_field_error("bbox"):
            run.add_detection(frame, box, score, known.sizes.get(own or named), from_corner=True)


def _describe_contradiction(
    run: PredictionCollector, own: str, identity: str, named: str, frame: NamedFrame | None
) -> str | None:
    """Why the name and the number of a result mean two frames, in words; None where they do not."""
    # Ultralytics' number is that of the name, and no id of a document.
    stem = PurePosixPath(own.replace("\\", "/")).stem
    if frame is None or not identity or identity.lstrip("0") == stem.lstrip("0"):
        return None
    other = run.names.find(named or identity)
    if other is None or other.id == frame.id:
        return None
    found = (
        f'image {identity} of the COCO document is "{named}"'
        if named
        else f'image_id is "{identity}"'
    )
    return f'is "{own}", but {found}: two frames'


def _read_yolo(tree: FileTree, path: Path, run: PredictionCollector) -> None:
    names = [
        name
        for name in tree.names()
        if name.lower().endswith(".txt") and PurePosixPath(name).name.lower() not in _NOT_LABELS
    ]
    if not names:
        raise DatasetFormatError(str(path), None, None, "contains no text files")
    rows: list[tuple[str, int, NamedFrame | None, list[str]]] = []
    for name in names:
        shown = tree.shown(name)
        try:
            lines = tree.read_bytes(name).decode("utf-8-sig").splitlines()
        except UnicodeDecodeError as error:
            raise DatasetFormatError(shown, None, None, "is not UTF-8 text") from error
        if is_mot_text("\n".join(lines[:20]).encode()):
            raise DatasetFormatError(
                shown, None, None, "is a comma-separated table (MOT): choose the format csv"
            )
        boxes = [(number, line.split()) for number, line in enumerate(lines, 1) if line.strip()]
        frame = run.find_frame(name)
        if frame is None:
            run.found.unknown[name] += len(boxes)
            run.found.reasons[name] = run.names.explain_unknown_name(name)
        rows.extend((shown, number, frame, cells) for number, cells in boxes)
    tracked = _has_track_ids([cells for _, _, _, cells in rows])
    if tracked:
        run.found.report.add_problem_at(str(path), None, None, _TRACKED)
    for shown, number, frame, cells in rows:
        run.found.report.read += 1
        with report_invalid_record(run.found.report, shown, f"line {number}"):
            _add_yolo_row(run, frame, cells, tracked)


_TRACK = re.compile(r"\d{1,18}", re.ASCII)
_TRACKED = "the sixth number is the id of a track and no confidence: its boxes count as sure"


def _has_track_ids(rows: list[list[str]]) -> bool:
    """Whether the last of six numbers is the id of a track, as a tracker writes it without confidence.

    All of them are whole then, and one is beyond 1.
    """
    last = [cells[5] for cells in rows if len(cells) == 6]
    return bool(last) and all(map(_TRACK.fullmatch, last)) and any(int(cell) > 1 for cell in last)


def _add_yolo_row(
    run: PredictionCollector, frame: NamedFrame | None, cells: list[str], tracked: bool
) -> None:
    if len(cells) not in (5, 6, 7):
        raise ValueError(
            f"has {len(cells)} numbers, not class, cx, cy, w, h, and maybe a confidence and a track"
        )
    category = fields.parse_whole_number(cells[0])
    x, y, width, height = (fields.parse_number(cell) for cell in cells[1:5])
    if not all(-1 <= value <= 2 for value in (x, y, width, height)):
        raise ValueError("is in pixels; YOLO's numbers are fractions of the image size")
    score = fields.parse_number(cells[5]) if len(cells) > 5 and not tracked else None
    if not run.count_class_and_check_ball(category) or frame is None:
        return
    across, down = frame.size.width, frame.size.height
    box = Box((x - width / 2) * across, (y - height / 2) * down, width * across, height * down)
    with raise_as_field_error("cx, cy, w, h"):
        run.add_detection(frame, box, score, frame.size, from_corner=True)
