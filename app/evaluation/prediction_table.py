"""Tables of predictions, read: CSV in the spellings of many tools, MOT's text files, and the ball in 3D over time.

Delimiters are commas, semicolons or tabs; with the latter two, decimal commas are read. Names of
columns count without capitals. Boxes are in pixels, (0, 0) the centre of the first pixel.

A file ``ball.csv`` for each stretch, alone or in a folder called by the stretch, with ``frame`` or ``time_s`` (or
both) and ``x_m,y_m,z_m``: pitch frame, metres, z down; rows without a place are gaps. ``sigma_m`` (the same in
each direction) or ``sigma_x_m,sigma_y_m,sigma_z_m`` say how sure each is. ``events.csv`` beside it has ``frame`` or
``time_s``, and ``kind``: kick, bounce or out. Other columns are not read.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePosixPath
from typing import get_args

from app.errors import DatasetFormatError, InputError
from app.evaluation.frame import NamedFrame
from app.evaluation.prediction_run import (
    FieldError,
    PredictedTrack,
    PredictionCollector,
    raise_as_field_error,
    read_field,
    report_invalid_record,
)
from app.formats import fields
from app.formats.csv_text import is_missing, parse_number_list, read_rows
from app.formats.fields import id_to_text
from app.formats.file_tree import FileTree, ImportLimits
from app.formats.report import ReaderReport
from app.formats.safe_path import read_regular_file
from app.formats.trees import FolderTree
from app.json_text import quote_text
from app.soccer.choices import BallEventKind
from app.soccer.frames import Box, ImageSize

SCORES = ("score", "confidence", "conf", "probability", "prob")
_BOX = ("ball_bbox", "bbox")
_CORNER_AND_SIZE = (
    ("x", "y", "w", "h"), ("x", "y", "width", "height"), ("left", "top", "width", "height"),
    ("bb_left", "bb_top", "bb_width", "bb_height"), ("bbox_x", "bbox_y", "bbox_w", "bbox_h"),
    ("xmin", "ymin", "width", "height"), ("xmin", "ymin", "w", "h"),
)  # fmt: skip
_CORNERS = (
    ("x1", "y1", "x2", "y2"), ("xmin", "ymin", "xmax", "ymax"), ("x_min", "y_min", "x_max", "y_max"),
    ("left", "top", "right", "bottom"), ("xtl", "ytl", "xbr", "ybr"), ("x0", "y0", "x1", "y1"),
    ("bbox_x1", "bbox_y1", "bbox_x2", "bbox_y2"),
)  # fmt: skip
_CENTERS = tuple(
    (x, y, width, height)
    for x, y in (
        ("cx", "cy"), ("xc", "yc"), ("x_center", "y_center"), ("xcenter", "ycenter"),
        ("center_x", "center_y"), ("x_c", "y_c"),
    )
    for width, height in (("w", "h"), ("width", "height"))
)  # fmt: skip
_FRAME_NUMBERS = ("frame", "frame_id", "frame_number", "frame_num", "frame_no", "frame_index")
_NAMES = (
    "file_name", "filename", "image", "image_name", "image_path", "img", "file", "path", "name",
    "image_id",
)  # fmt: skip
_CLASSES = ("class", "category_id", "class_id", "cls", "label")
_CLASS_NAMES = ("name", "class_name", "label_name")
_MEANT = (
    "a table of predictions has a frame (image, file_name or frame; or match, main_action, replay) and a box "
    "in pixels (x, y, w, h from the upper left corner; x1, y1, x2, y2; cx, cy, w, h; or ball_bbox)"
)
_MOT_FOLDERS = ("gt", "det")
_GAME = "gameinfo.ini"
_TRACKLET = re.compile(r"^\s*trackletID_(\d{1,9})\s*=\s*([^;\r\n]*)", re.MULTILINE | re.ASCII)
_MOT = ("frame", "id", "bb_left", "bb_top", "bb_width", "bb_height", "conf")
_SEPARATOR = re.compile(rb"(?:\xef\xbb\xbf)?sep=.\r?\n", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*", re.ASCII)
_NUMBERS_ONLY = re.compile(rb"\s*[-+.\d][-+.\deE]*(?:\s*,\s*[-+.\d][-+.\deE]*){5,}\s*", re.ASCII)


def is_mot_text(content: bytes) -> bool:
    """Whether a text is MOT's: numbers with commas between them, and no header."""
    first = next((line for line in content[:4096].splitlines() if line.strip()), b"")
    return bool(_NUMBERS_ONLY.fullmatch(first))


def read_table(tree: FileTree, path: Path, run: PredictionCollector, limits: ImportLimits) -> None:
    """Read the one table of a tree, or MOT's tables, one a sequence.

    Raises:
        DatasetFormatError: There is none, or several, or its columns say no frame or no box.
        InputError: A table of MOT does not say which of its tracks is the ball.
    """
    names = [name for name in tree.names() if name.lower().endswith((".csv", ".tsv"))]
    if not names:
        texts = [name for name in tree.names() if name.lower().endswith(".txt")]
        names = [name for name in texts if is_mot_text(tree.read_bytes(name))]
        if len({_find_sequence_folder(name) for name in names}) < len(names):
            listed = ", ".join(names[:4])
            message = (
                f"contains several MOT tables of one sequence ({listed}); give exactly one of each"
            )
            raise DatasetFormatError(str(path), None, None, message)
    elif len(names) > 1:
        listed = ", ".join(names[:4])
        message = f"contains {len(names)} tables ({listed}); give exactly one"
        raise DatasetFormatError(str(path), None, None, message)
    if not names:
        raise DatasetFormatError(str(path), None, None, "contains no table (CSV, or MOT's .txt)")
    for name in names:
        _read_one_table(tree, name, run, limits, alone=len(names) == 1)


def _read_one_table(
    tree: FileTree, name: str, run: PredictionCollector, limits: ImportLimits, *, alone: bool
) -> None:
    shown, content = tree.shown(name), tree.read_bytes(name)
    tracks = _read_mot_tracks(tree, name, content, run) if is_mot_text(content) else None
    columns: list[str] | None = None
    for line, cells in _read_rows(content, shown, limits):
        if columns is None:
            columns = list(cells)
            if problem := _find_column_problem(columns):
                raise DatasetFormatError(shown, None, None, problem)
        run.found.report.read += 1
        with report_invalid_record(run.found.report, shown, f"line {line}"):
            _add_row(run, cells, tracks, alone)
    if columns is None:
        raise DatasetFormatError(
            shown, None, None, "contains no rows; check that the file is complete"
        )


@dataclass(frozen=True)
class _MotTracks:
    """What the place of a table of MOT says.

    Attributes:
        folder: Of the sequence, without ``gt``; empty where there is none.
        labels: What the tracks are by their ids; None where nothing says it and a frame has one at most.
    """

    folder: str
    labels: Mapping[int, str] | None


def _find_sequence_folder(name: str) -> str:
    """The sequence of a table of MOT: ``SNMOT-060`` of ``SNMOT-060/gt/gt.txt`` and ``SNMOT-060.txt``."""
    parts = list(PurePosixPath(name).with_suffix("").parts)
    while parts and parts[-1].lower() in _MOT_FOLDERS:
        parts.pop()
    return "/".join(parts)


def _read_mot_tracks(
    tree: FileTree, name: str, content: bytes, run: PredictionCollector
) -> _MotTracks:
    folder = _find_sequence_folder(name)
    labels = {
        int(number): label.strip() for number, label in _TRACKLET.findall(_read_game(tree, name))
    }
    if labels or (run.category is None and not _has_several_tracks(content)):
        return _MotTracks(folder, labels or None)
    if run.category is None:
        raise InputError(
            f"{tree.shown(name)} has several tracks in a frame and does not say which of them is the ball",
            hint=f"Put the {_GAME} of the sequence beside it, or name the id of the ball's track as category."
            " Where all of them are balls, write a table with a header (frame,x,y,w,h,score).",
            pointer="/category",
        )
    return _MotTracks(folder, labels)


def _read_game(tree: FileTree, name: str) -> str:
    """The text of the gameinfo.ini in the folder of a table of MOT or of its sequence; or empty."""
    for folder in (_find_sequence_folder(name), str(PurePosixPath(name).parent)):
        ini = f"{folder}/{_GAME}" if folder not in ("", ".") else _GAME
        if ini in tree.names():
            return tree.read_bytes(ini).decode("utf-8", "replace")
    # A file alone, and a folder gt, have it outside.
    outside = (tree.path / name).parent if isinstance(tree, FolderTree) else None
    while outside is not None:
        if (outside / _GAME).is_file():
            return read_regular_file(outside / _GAME).decode("utf-8", "replace")
        outside = outside.parent if outside.name.lower() in _MOT_FOLDERS else None
    return ""


def _has_several_tracks(content: bytes) -> bool:
    """Whether a frame of a table of MOT has rows of several tracks."""
    ids: dict[bytes, bytes] = {}
    rows = (line.split(b",", 2) for line in content.splitlines() if line.count(b",") > 1)
    return any(ids.setdefault(frame.strip(), one.strip()) != one.strip() for frame, one, _ in rows)


def _read_rows(
    content: bytes, shown: str, limits: ImportLimits
) -> Iterator[tuple[int, Mapping[str, str]]]:
    """The rows with their line numbers, by the plain name of a column."""
    if is_mot_text(content):
        header = ",".join((*_MOT, "x", "y", "z")).encode()
        for line, cells in read_rows(header + b"\n" + content, shown, (), limits):
            boxed = {name: cells.get(name, "") for name in _MOT}
            # MOT's ground truth and some trackers write -1 where there is no confidence.
            if boxed["conf"].strip() in ("-1", "-1.0"):
                boxed["conf"] = ""
            yield line - 1, boxed
        return
    text, above = _strip_excel_marks(content)
    delimiter, _ = _read_header(text)
    for line, cells in read_rows(text, shown, (), limits, delimiter=delimiter):
        yield (
            line + above,
            {
                _plain_column_name(name): (
                    text.replace(",", ".")
                    if delimiter != "," and _DECIMAL_COMMA.fullmatch(text)
                    else text
                )
                for name, text in cells.items()
            },
        )


def _read_header(content: bytes) -> tuple[str, list[str]]:
    """What stands between the cells of a table, and the plain names of its columns."""
    content, _ = _strip_excel_marks(content)
    first = content[:65536].split(b"\n", 1)[0].decode("utf-8-sig", "replace")
    delimiter = max(",;\t", key=first.count)
    return delimiter, [_plain_column_name(name.strip('"\r ')) for name in first.split(delimiter)]


def _strip_excel_marks(content: bytes) -> tuple[bytes, int]:
    """A table as UTF-8, without Excel's first line ``sep=;``; and how many lines that were."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        content = content.decode("utf-16", "replace").encode()
    first = _SEPARATOR.match(content)
    return (content, 0) if first is None else (content[first.end() :], 1)


def _plain_column_name(name: str) -> str:
    return re.sub(r"[\s.-]+", "_", name.strip().lower())


def _find_column_problem(columns: Iterable[str]) -> str | None:
    """Why a table with these columns cannot be read, in words; None where it can."""
    there = set(columns)
    frame = there & {"main_action", *_FRAME_NUMBERS, *_NAMES}
    boxed = there & set(_BOX) or any(
        there.issuperset(sides) for sides in (*_CORNER_AND_SIZE, *_CORNERS, *_CENTERS)
    )
    if frame and boxed:
        return None
    listed = ", ".join(f'"{name}"' for name in list(columns)[:12] if name) or "no names"
    more = "; x and y alone are a point without a size" if {"x", "y"} <= there and not boxed else ""
    return f"has the columns {listed}{more}; {_MEANT}"


def _add_row(
    run: PredictionCollector, cells: Mapping[str, str], tracks: _MotTracks | None, alone: bool
) -> None:
    box, where = _read_row_box(cells)
    if box is None:
        return
    score_name = next((name for name in SCORES if not is_missing(cells.get(name))), None)
    score = read_field(cells, score_name, fields.parse_number) if score_name else None
    if not _is_ball_row(run, cells, tracks):
        return
    frame = None
    if tracks is not None:
        frame = _find_sequence_frame(run, tracks.folder, cells["frame"], alone)
    if tracks is None or (frame is None and alone):
        frame = _find_row_frame(run, cells)
    elif frame is None:
        name = f"{tracks.folder}/{cells['frame'].strip()}"
        run.count_unknown_frame(name, run.names.explain_unknown_name(name))
    if frame is not None:
        size = None
        if not is_missing(cells.get("img_w")) and not is_missing(cells.get("img_h")):
            size = ImageSize(
                read_field(cells, "img_w", fields.parse_whole_number),
                read_field(cells, "img_h", fields.parse_whole_number),
            )
        with raise_as_field_error(where):
            run.add_detection(frame, box, score, size)


def _find_sequence_frame(
    run: PredictionCollector, folder: str, number: str, alone: bool
) -> NamedFrame | None:
    """The frame of a number in the folder of a sequence, or in the match that is called like it.

    Where the sequence is not alone, its name has to be part of that of the frame.
    """
    for place in (folder, folder.rsplit("/", 1)[-1]) if folder else ():
        depth = len(place.split("/"))
        for picture in dict.fromkeys(number.strip().zfill(digits) for digits in (6, 0, 3, 4, 5, 8)):
            for name in (f"{place}/img1/{picture}", f"{place}/{picture}"):
                if not alone and len(run.names.list_passed_folders(name)) >= depth:
                    continue
                if (found := run.find_frame(name)) is not None:
                    return found
    return None


def _is_ball_row(
    run: PredictionCollector, cells: Mapping[str, str], tracks: _MotTracks | None
) -> bool:
    """Whether the class of a row is the ball's, or its track."""
    if tracks is not None and tracks.labels is not None:
        track = read_field(cells, "id", fields.parse_whole_number)
        return run.count_class_and_check_ball(track, tracks.labels.get(track, ""))
    column = next((name for name in _CLASSES if not is_missing(cells.get(name))), None)
    if column is None:
        return run.count_class_and_check_ball(0, "" if tracks is None else "ball")
    text = cells[column].strip()
    named = next(
        (cells[name].strip() for name in _CLASS_NAMES if not is_missing(cells.get(name))), ""
    )
    try:
        return run.count_class_and_check_ball(fields.parse_whole_number(text), named)
    except ValueError:
        return run.count_class_and_check_ball(text, text)


def _read_row_box(cells: Mapping[str, str]) -> tuple[Box | None, str]:
    """The box of a row, None where the row has none; and the columns that it stands in."""
    for name in _BOX:
        if name in cells:
            if is_missing(cells[name]):
                return None, name
            return read_field(cells, name, lambda text: Box(*parse_number_list(text, 4))), name
    for layouts, made in (
        (_CORNER_AND_SIZE, Box),
        (_CENTERS, lambda x, y, w, h: Box(x - w / 2, y - h / 2, w, h)),
        (_CORNERS, lambda x1, y1, x2, y2: Box(x1, y1, x2 - x1, y2 - y1)),
    ):
        for sides in layouts:
            if all(side in cells for side in sides):
                where = ", ".join(sides)
                if all(is_missing(cells[side]) for side in sides):
                    return None, where
                numbers = (read_field(cells, side, fields.parse_number) for side in sides)
                return made(*numbers), where
    raise FieldError("ball_bbox", "is missing, and so are x, y, w and h")


def _find_row_frame(run: PredictionCollector, cells: Mapping[str, str]) -> NamedFrame | None:
    """The frame of a row; one that is none is counted."""
    number = next((name for name in _FRAME_NUMBERS if not is_missing(cells.get(name))), None)
    if not is_missing(cells.get("main_action")):
        action = read_field(cells, "main_action", fields.parse_whole_number)
        replay = cells.get("replay")
        image = (
            f"{action}" if is_missing(replay) else f"{action}_{fields.parse_whole_number(replay)}"
        )
        parts = [cells.get(name, "").strip() for name in ("league", "season", "match")]
        return run.find_frame_or_count_unknown("/".join([part for part in parts if part] + [image]))
    if number is not None and not is_missing(cells.get("camera")):
        camera = id_to_text((cells["camera"] or "").strip().removeprefix("cam"))
        return run.find_frame_or_count_unknown(f"cam{camera}/{id_to_text(cells[number])}")
    # The name of a picture says more than a number, which tools count from where they like. Beside
    # a class, "name" is that of the class.
    named = any(name in cells for name in _CLASSES)
    for name in _NAMES:
        if not is_missing(cells.get(name)) and not (named and name == "name"):
            text = cells[name].strip()
            return run.find_frame_or_count_unknown(
                id_to_text(text) or text if name == "image_id" else text
            )
    if number is not None:
        return run.find_frame_by_number_or_count_unknown(cells[number].strip())
    raise FieldError("frame", "is missing, and so is every other column that can name the frame")


BALL, EVENTS = "ball.csv", "events.csv"
KINDS: tuple[str, ...] = get_args(BallEventKind)
FARTHEST_M = 1000.0
"""No ball is farther from the centre mark; a number beyond is of another unit."""
_PLACE = ("x_m", "y_m", "z_m")
_SIGMAS = ("sigma_x_m", "sigma_y_m", "sigma_z_m")
_MOST_FRAME = 2**31


def is_ball_track_table(content: bytes) -> bool:
    """Whether a CSV is of balls in 3D over time, by its header."""
    return set(_PLACE) <= {*_read_header(content)[1]}


def read_tracks(
    tree: FileTree, path: Path, report: ReaderReport, limits: ImportLimits
) -> dict[str, PredictedTrack]:
    """Predicted tracks by the folders that they lie in, the file at the top under the empty name.

    Rows that are wrong are noted and left out.

    Raises:
        DatasetFormatError: There is no table of balls, or one has no place.
    """
    tables = [name for name in tree.names() if name.lower().endswith(".csv")]
    names = [name for name in tables if PurePosixPath(name).name.lower() == BALL]
    names = names or [name for name in tables if is_ball_track_table(tree.read_bytes(name))]
    folders = [str(PurePosixPath(name).parent) for name in names]
    if not names or len(set(folders)) < len(folders):
        what = "several tables of balls in one folder" if names else "no ball.csv"
        if any(PurePosixPath(name).name == "ball.parquet" for name in tree.names()):
            what = "ball.parquet and no ball.csv; give ball.csv, which an export of tracks writes beside it"
        raise DatasetFormatError(str(path), None, None, f"contains {what}")
    found = {}
    for name, folder in zip(names, folders, strict=True):
        balls = _PredictedTrackBuilder()
        _process_track_rows(tree, name, (*_PLACE,), report, limits, balls.add)
        beside = EVENTS if folder == "." else f"{folder}/{EVENTS}"
        events: list[tuple[str, int | None, float | None]] | None = None
        if beside in tables:
            events = []
            _process_track_rows(
                tree, beside, ("kind",), report, limits, partial(_add_event, events)
            )
        report.imported += len(balls.position)
        found["" if folder == "." else folder] = balls.build_track(events)
    return found


def _process_track_rows(
    tree: FileTree,
    name: str,
    columns: tuple[str, ...],
    report: ReaderReport,
    limits: ImportLimits,
    add: Callable[[Mapping[str, str]], object],
) -> None:
    """Hand on the rows of a table; what is wrong with one is noted."""
    shown, content = tree.shown(name), tree.read_bytes(name)
    there = _read_header(content)[1]
    missing = [column for column in columns if column not in there]
    if missing:
        raise DatasetFormatError(shown, None, missing[0], "is missing from the columns")
    if not {"frame", "time_s"} & {*there}:
        raise DatasetFormatError(shown, None, "frame", "is missing, and so is time_s")
    for line, row in _read_rows(content, shown, limits):
        report.read += 1
        with report_invalid_record(report, shown, f"line {line}"):
            add(row)


class _PredictedTrackBuilder:
    """The rows of one table, gathered."""

    def __init__(self) -> None:
        self.frames: list[int | None] = []
        self.times: list[float | None] = []
        self.position: list[tuple[float, float, float]] = []
        self.sigma: list[tuple[float, float, float] | None] = []
        self._seen: set[int | float | None] = set()

    def add(self, row: Mapping[str, str]) -> None:
        """A row; without a place it is a gap."""
        if all(is_missing(row.get(name)) for name in _PLACE):
            return
        frame, time = _read_frame_and_time(row)
        if (frame if frame is not None else time) in self._seen:
            raise FieldError("frame", "has a ball in an earlier row; this row is left out")
        x, y, z = (read_field(row, name, _read_metres) for name in _PLACE)
        self._seen.add(frame if frame is not None else time)
        self.frames.append(frame)
        self.times.append(time)
        self.position.append((x, y, z))
        self.sigma.append(None)
        self.sigma[-1] = _read_sigma(row)

    def build_track(
        self, events: list[tuple[str, int | None, float | None]] | None
    ) -> PredictedTrack:
        """All of them."""
        return PredictedTrack(
            tuple(self.frames),
            tuple(self.times),
            tuple(self.position),
            tuple(self.sigma),
            None if events is None else tuple(events),
        )


def _read_frame_and_time(row: Mapping[str, str]) -> tuple[int | None, float | None]:
    frame = (
        None
        if is_missing(row.get("frame"))
        else read_field(row, "frame", fields.parse_whole_number)
    )
    time = None if is_missing(row.get("time_s")) else read_field(row, "time_s", fields.parse_number)
    if frame is None and time is None:
        raise FieldError("frame", "is missing, and so is time_s")
    if frame is not None and not 0 <= frame < _MOST_FRAME:
        raise FieldError("frame", f"is {frame}, which is not the number of a frame")
    return frame, time


def _read_metres(text: str) -> float:
    value = fields.parse_number(text)
    if abs(value) > FARTHEST_M:
        raise ValueError(
            f"is {value:g} m, which is too far away; positions are in metres from the centre mark"
        )
    return value


def _read_sigma(row: Mapping[str, str]) -> tuple[float, float, float] | None:
    names = _SIGMAS if not is_missing(row.get(_SIGMAS[0])) else ("sigma_m",) * 3
    if is_missing(row.get(names[0])):
        return None
    x, y, z = (read_field(row, name, fields.parse_number) for name in names)
    if not min(x, y, z) > 0:
        raise FieldError(names[0], "is not above zero; the position is kept without it")
    return x, y, z


def _add_event(events: list[tuple[str, int | None, float | None]], row: Mapping[str, str]) -> None:
    kind = row["kind"].strip().lower()
    if kind not in KINDS:
        raise FieldError("kind", f"is {quote_text(kind)}; kinds are {', '.join(KINDS)}")
    events.append((kind, *_read_frame_and_time(row)))
