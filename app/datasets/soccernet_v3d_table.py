"""SNv3D.csv read: one row a view, with its ball box, its camera and its split."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePosixPath

from app.datasets import fields
from app.datasets.camera_json import camera_from_json
from app.datasets.csv_text import is_missing, numbers_in, read_rows
from app.datasets.file_tree import FileTree, Limits
from app.datasets.json_text import parse_literal
from app.datasets.report import Report
from app.datasets.safe_path import check_name
from app.datasets.soccernet_v3d import SPLIT_FILES, TABLE
from app.errors import DatasetFormatError, UnsafePathError
from app.finite import quoted
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import MAX_SIDE, Box, ImageSize

REQUIRED = ("league", "season", "match", "main_action", "action", "replay", "img_w", "img_h")
_TRUE, _FALSE = ("true", "1", "1.0"), ("false", "0", "0.0")
_MAX_LINES = 1_000_000


@dataclass(frozen=True)
class TableRow:
    """One view as the table has it.

    Attributes:
        match: ``<league>/<season>/<match>``.
        action: Number of the action image.
        replay: Number of the replay, or None for the action itself.
        ball: The annotated box; None where the row has none.
        camera: None where the row has none.
        split: Empty where the row has none.
    """

    match: str
    action: int
    replay: int | None
    size: ImageSize
    ball: BallAnnotation | None
    camera: Camera | None
    split: str

    @property
    def image(self) -> str:
        """Name of the view's image: ``7_1.png``."""
        return f"{self.action}.png" if self.replay is None else f"{self.action}_{self.replay}.png"

    @property
    def main(self) -> str:
        """Name of the action's image."""
        return f"{self.action}.png"


@dataclass(frozen=True)
class SnTable:
    """The rows of a table by match, action image and image; and the split lists.

    ``folder`` is where the table lies in its tree, ``""`` or with a slash at its end.
    """

    folder: str
    rows: Mapping[str, Mapping[str, Mapping[str, TableRow]]]
    lists: Mapping[tuple[str, str], str]
    asked: set[tuple[str, str]] = field(default_factory=set)
    """Entries of the lists that some group has asked for."""

    def split(self, match: str, main: str) -> str:
        """Split of a group: as the lists have it, else as its rows do."""
        folder, stem = PurePosixPath(match).name, PurePosixPath(main).stem
        self.asked.add((folder, stem))
        if (folder, stem) in self.lists:
            return self.lists[folder, stem]
        rows = self.rows.get(match, {}).get(main, {}).values()
        return next((row.split for row in rows if row.split), "")

    def unused(self) -> list[str]:
        """Actions of the split lists that no group is; replays are listed with their action."""
        known = {(match, stem.partition("_")[0]) for match, stem in self.asked}
        entries = ((match, stem.partition("_")[0]) for match, stem in self.lists)
        return [
            f"{match}/{stem}"
            for match, stem in dict.fromkeys(entries)
            if (match, stem) not in known
        ]


def read_snv3d_table(tree: FileTree, names: list[str], report: Report, limits: Limits) -> SnTable:
    """The table of a tree and its split lists; empty where there is none.

    A row that is wrong is reported with its line and left out, an unreadable cell alone is.
    """
    tables = [name for name in names if PurePosixPath(name).name == TABLE]
    if not tables:
        return SnTable("", {}, {})
    for name in tables[1:]:
        report.note(tree.shown(name), None, None, f"is a second {TABLE}; {tables[0]} is used")
    folder = tables[0][: -len(TABLE)]
    rows: dict[str, dict[str, dict[str, TableRow]]] = {}
    try:
        _read_table(tree, tables[0], rows, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    return SnTable(folder, rows, _read_lists(tree, names, folder, report))


def _read_table(
    tree: FileTree,
    name: str,
    rows: dict[str, dict[str, dict[str, TableRow]]],
    report: Report,
    limits: Limits,
) -> None:
    shown = tree.shown(name)
    for line, cells in read_rows(tree.read_bytes(name), shown, REQUIRED, limits):
        try:
            row = _Cells(cells, shown, f"line {line}", report).row()
        except DatasetFormatError as error:
            report.skip(error)
            continue
        views = rows.setdefault(row.match, {}).setdefault(row.main, {})
        if row.image in views:
            report.note(shown, f"line {line}", None, f"is a second row of {row.image}")
        views.setdefault(row.image, row)


class _Cells:
    """The cells of one row."""

    def __init__(self, cells: Mapping[str, str], path: str, line: str, report: Report):
        self._cells, self._path, self._line, self._report = cells, path, line, report

    def row(self) -> TableRow:
        """The row; raises DatasetFormatError where it does not say which image it is of."""
        action, replay = self._whole("main_action"), None
        if not self._flag("action"):
            replay = self._whole("replay")
        return TableRow(
            match="/".join(map(self._folder, ("league", "season", "match"))),
            action=action,
            replay=replay,
            size=ImageSize(self._side("img_w"), self._side("img_h")),
            ball=self._ball(),
            camera=self._camera(),
            split=self._optional("set"),
        )

    def _optional(self, name: str) -> str:
        text = self._cells.get(name)
        return "" if text is None or is_missing(text) else text.strip()

    def _error(self, name: str, problem: str) -> DatasetFormatError:
        return DatasetFormatError(self._path, self._line, name, problem)

    def _folder(self, name: str) -> str:
        text = self._cells.get(name, "")
        try:
            if "/" in check_name(text) or text.strip() in ("", "."):
                raise self._error(name, "is not the name of a folder")
        except UnsafePathError as error:
            raise self._error(name, error.message) from error
        return text

    def _whole(self, name: str) -> int:
        try:
            number = fields.whole(self._cells.get(name, ""))
        except ValueError as error:
            raise self._error(name, str(error)) from error
        if number < 0:
            raise self._error(name, "is negative")
        return number

    def _side(self, name: str) -> int:
        side = self._whole(name)
        if not 2 <= side <= MAX_SIDE:
            raise self._error(name, f"is {side} pixels")
        return side

    def _flag(self, name: str) -> bool:
        text = self._cells.get(name, "").strip().lower()
        if text not in (*_TRUE, *_FALSE):
            raise self._error(name, f"is {quoted(text, 20)}, neither True nor False")
        return text in _TRUE

    def _ball(self) -> BallAnnotation | None:
        text = self._optional("ball_bbox")
        if not text:
            return None
        try:
            x, y, width, height = map(fields.pixel, numbers_in(text, 4))
            if width <= 0 or height <= 0:
                raise ValueError("is a box without area")
        except ValueError as error:
            self._report.skip(self._error("ball_bbox", f"{error}; left out"))
            return None
        return BallAnnotation(box=Box(x, y, width, height))

    def _camera(self) -> Camera | None:
        text = self._optional("calibration")
        if not text:
            return None
        try:
            value = parse_literal(text, self._path, self._line)
            return camera_from_json(value, self._path, self._line)
        except DatasetFormatError as error:
            where = f"calibration, {error.field}" if error.field else "calibration"
            self._report.skip(self._error(where, f"{error.problem}; left out"))
            return None


def _read_lists(
    tree: FileTree, names: list[str], folder: str, report: Report
) -> dict[tuple[str, str], str]:
    """Split by (match folder, stem of the image)."""
    found: dict[tuple[str, str], str] = {}
    for split, name in SPLIT_FILES.items():
        if folder + name in names:
            try:
                _read_list(tree, folder + name, split, found, report)
            except DatasetFormatError as error:
                report.skip(error)
    return found


def _read_list(
    tree: FileTree,
    name: str,
    split: str,
    found: dict[tuple[str, str], str],
    report: Report,
) -> None:
    shown = tree.shown(name)
    lines = tree.read_bytes(name).decode("utf-8-sig", "replace").splitlines()[:_MAX_LINES]
    for number, line in enumerate(lines, 1):
        match, slash, stem = line.strip().rpartition("/")
        if not line.strip():
            continue
        if not slash:
            report.note(shown, f"line {number}", None, "is not <match>/<action>[_<replay>]")
        elif found.setdefault((PurePosixPath(match).name, stem), split) != split:
            report.note(shown, f"line {number}", None, "is in another split already")
