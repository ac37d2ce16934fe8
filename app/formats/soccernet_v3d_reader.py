"""Reads SoccerNet-v3D: the table, and the labels that it points to."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError, UnsafePathError
from app.formats import fields
from app.formats.camera_json import camera_from_json
from app.formats.csv_text import is_missing, parse_number_list, read_rows
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root, list_files_in_folder
from app.formats.frame_names import compose_name
from app.formats.json_reader import parse_literal
from app.formats.report import ReaderReport
from app.formats.safe_path import require_safe_path
from app.formats.soccernet_v3 import (
    GAME,
    IMAGE,
    MATCH_DEPTH,
    SPLIT_FILES,
    TABLE,
    MatchFrameFinder,
    group_label,
    parse_image_numbers,
)
from app.formats.soccernet_v3 import LABELS_3D as LABELS
from app.formats.soccernet_v3_reader import MatchReader
from app.formats.split_names import read_split_name
from app.formats.trees import open_tree_context
from app.geometry.camera import Camera
from app.json_text import quote_text
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import MAX_SIDE, Box, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.wording import plural

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
        ball: The annotated box, or the point of a box without area; None where the row has none.
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
        return _make_row_image_name(self.action, self.replay)

    @property
    def action_image(self) -> str:
        """Name of the action's image."""
        return _make_row_image_name(self.action, None)


def _make_row_image_name(action: int, replay: int | None) -> str:
    return f"{action}.png" if replay is None else f"{action}_{replay}.png"


def _find_row_image_name(image: str) -> str:
    """What the table calls an image, of which it has the numbers alone: ``7.png`` for ``0007.jpg``."""
    numbers = parse_image_numbers(image)
    return image if numbers is None else _make_row_image_name(*numbers)


def _find_listed_stem(image: str) -> str:
    return PurePosixPath(_find_row_image_name(image)).stem


@dataclass(frozen=True)
class SoccerNetV3DTable:
    """The rows of a table by match, action image and image; and the split lists.

    ``folder`` is where the table lies in its tree, ``""`` or with a slash at its end.
    """

    folder: str
    rows: Mapping[str, Mapping[str, Mapping[str, TableRow]]]
    lists: Mapping[tuple[str, str], str]
    asked: set[tuple[str, str]] = field(default_factory=set)
    """Entries of the lists that some group has asked for."""

    def find_split_of_group(self, match: str, main: str) -> str:
        """Split of a group: as the lists have it, else as its rows do."""
        folder, stem = PurePosixPath(match).name, _find_listed_stem(main)
        self.asked.add((folder, stem))
        if (folder, stem) in self.lists:
            return self.lists[folder, stem]
        rows = self.rows.get(match, {}).get(main, {}).values()
        return next((row.split for row in rows if row.split), "")

    def unused_split_entries(self) -> list[str]:
        """Actions of the split lists that no group is; replays are listed with their action."""
        known = {(match, stem.partition("_")[0]) for match, stem in self.asked}
        entries = ((match, stem.partition("_")[0]) for match, stem in self.lists)
        return [
            f"{match}/{stem}"
            for match, stem in dict.fromkeys(entries)
            if (match, stem) not in known
        ]


def read_snv3d_table(
    tree: FileTree, names: list[str], report: ReaderReport, limits: ImportLimits
) -> SoccerNetV3DTable:
    """The table of a tree and its split lists; empty where there is none.

    A row that is wrong is reported with its line and left out, an unreadable cell alone is.
    """
    tables = [name for name in names if PurePosixPath(name).name == TABLE]
    if not tables:
        return SoccerNetV3DTable("", {}, {})
    for name in tables[1:]:
        report.add_problem_at(
            tree.shown(name), None, None, f"is a second {TABLE}; {tables[0]} is used"
        )
    folder = tables[0][: -len(TABLE)]
    rows: dict[str, dict[str, dict[str, TableRow]]] = {}
    try:
        _read_table(tree, tables[0], rows, report, limits)
    except DatasetFormatError as error:
        report.add_problem(error)
    return SoccerNetV3DTable(folder, rows, _read_split_lists(tree, names, folder, report))


def _read_table(
    tree: FileTree,
    name: str,
    rows: dict[str, dict[str, dict[str, TableRow]]],
    report: ReaderReport,
    limits: ImportLimits,
) -> None:
    shown = tree.shown(name)
    for line, cells in read_rows(tree.read_bytes(name), shown, REQUIRED, limits):
        try:
            row = _TableRowParser(cells, shown, f"line {line}", report).to_table_row()
        except DatasetFormatError as error:
            report.add_problem(error)
            continue
        views = rows.setdefault(row.match, {}).setdefault(row.action_image, {})
        if row.image in views:
            report.add_problem_at(shown, f"line {line}", None, f"is a second row of {row.image}")
        views.setdefault(row.image, row)


class _TableRowParser:
    """The cells of one row."""

    def __init__(self, cells: Mapping[str, str], path: str, line: str, report: ReaderReport):
        self._cells, self._path, self._line, self._report = cells, path, line, report

    def to_table_row(self) -> TableRow:
        """The row; raises DatasetFormatError where it does not say which image it is of."""
        action, replay = self._read_whole_number("main_action"), None
        if not self._read_truth_value("action"):
            replay = self._read_whole_number("replay")
        return TableRow(
            match=compose_name(
                "/".join(map(self._read_folder_name, ("league", "season", "match")))
            ),
            action=action,
            replay=replay,
            size=ImageSize(self._read_side_length("img_w"), self._read_side_length("img_h")),
            ball=self._read_ball_annotation(),
            camera=self._read_given_camera(),
            split=read_split_name(self._read_optional_text("set"), self._report),
        )

    def _read_optional_text(self, name: str) -> str:
        text = self._cells.get(name)
        return "" if text is None or is_missing(text) else text.strip()

    def _make_cell_error(self, name: str, problem: str) -> DatasetFormatError:
        return DatasetFormatError(self._path, self._line, name, problem)

    def _read_folder_name(self, name: str) -> str:
        text = self._cells.get(name, "")
        try:
            if "/" in require_safe_path(text) or text.strip() in ("", "."):
                raise self._make_cell_error(name, "is not the name of a folder")
        except UnsafePathError as error:
            raise self._make_cell_error(name, error.message) from error
        return text

    def _read_whole_number(self, name: str) -> int:
        try:
            number = fields.parse_whole_number(self._cells.get(name, ""))
        except ValueError as error:
            raise self._make_cell_error(name, str(error)) from error
        if number < 0:
            raise self._make_cell_error(name, "is negative")
        return number

    def _read_side_length(self, name: str) -> int:
        side = self._read_whole_number(name)
        if not 2 <= side <= MAX_SIDE:
            raise self._make_cell_error(name, f"is {side} pixels, not 2 to {MAX_SIDE:,}")
        return side

    def _read_truth_value(self, name: str) -> bool:
        text = self._cells.get(name, "").strip().lower()
        if text not in (*_TRUE, *_FALSE):
            raise self._make_cell_error(name, f"is {quote_text(text, 20)}, neither True nor False")
        return text in _TRUE

    def _read_ball_annotation(self) -> BallAnnotation | None:
        text = self._read_optional_text("ball_bbox")
        if not text:
            return None
        try:
            x, y, width, height = map(fields.parse_pixel_coordinate, parse_number_list(text, 4))
            if width == height == 0:
                return BallAnnotation(point=ImagePoint(x, y))
            if width <= 0 or height <= 0:
                raise ValueError("is a box whose width or height is not positive")
        except ValueError as error:
            self._report.add_problem(self._make_cell_error("ball_bbox", f"{error}; left out"))
            return None
        return BallAnnotation(box=Box(x, y, width, height))

    def _read_given_camera(self) -> Camera | None:
        text = self._read_optional_text("calibration")
        if not text:
            return None
        try:
            value = parse_literal(text, self._path, self._line)
            return camera_from_json(value, self._path, self._line)
        except DatasetFormatError as error:
            where = f"calibration, {error.field}" if error.field else "calibration"
            self._report.add_problem(self._make_cell_error(where, f"{error.problem}; left out"))
            return None


def _map_match_folders(names: Iterable[str], folder: str) -> dict[str, str]:
    """The folders of matches below another as they are spelt, by the composed key of the match."""
    found: dict[str, str] = {}
    for name in names:
        parts = name.removeprefix(folder).split("/")
        if name.startswith(folder) and len(parts) > MATCH_DEPTH:
            match = "/".join(parts[:MATCH_DEPTH])
            found.setdefault(compose_name(match), f"{folder}{match}/")
    return found


def _read_split_lists(
    tree: FileTree, names: list[str], folder: str, report: ReaderReport
) -> dict[tuple[str, str], str]:
    """Split by (match folder, stem of the image)."""
    found: dict[tuple[str, str], str] = {}
    for split, name in SPLIT_FILES.items():
        if folder + name in names:
            try:
                _read_split_list(tree, folder + name, split, found, report)
            except DatasetFormatError as error:
                report.add_problem(error)
    return found


def _read_split_list(
    tree: FileTree,
    name: str,
    split: str,
    found: dict[tuple[str, str], str],
    report: ReaderReport,
) -> None:
    shown = tree.shown(name)
    lines = tree.read_bytes(name).decode("utf-8-sig", "replace").splitlines()[:_MAX_LINES]
    for number, line in enumerate(lines, 1):
        match, slash, stem = line.strip().rpartition("/")
        if not line.strip():
            continue
        if not slash:
            report.add_problem_at(
                shown, f"line {number}", None, "is not <match>/<action>[_<replay>]"
            )
        elif found.setdefault(_make_list_key(match, stem), split) != split:
            report.add_problem_at(
                shown,
                f"line {number}",
                None,
                "is in the list of another split already; the first one counts",
            )


def _make_list_key(match: str, stem: str) -> tuple[str, str]:
    return compose_name(PurePosixPath(match).name), _find_listed_stem(f"{stem}.png")


COMPUTED = (
    "calibration",
    "JaC",
    "calibrated_replays",
    "ball_3D",
    "rep_error",
    "optimized_error",
    "optimized_d",
    "verdict",
)
"""What Labels-v3D.json adds to an image's metadata; it is computed and never goes stale here."""


def read_soccernet_v3d(
    root: Root,
    report: ReaderReport,
    *,
    calibration: str = "given",
    limits: ImportLimits = DEFAULT_LIMITS,
) -> Iterator[Group]:
    """The groups of every match below ``root``, with the released cameras as given ones.

    Args:
        root: Dataset folder, or any folder in it down to one match; or a zip of such a tree.
        report: Takes what had to be left out.
        calibration: What counts for a view that has a camera and lines.
        limits: Caps on what is read.
    """
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        table = read_snv3d_table(tree, names, report, limits)
        folders = [name[: -len(LABELS)] for name in names if PurePosixPath(name).name == LABELS]
        if not folders and not table.rows:
            report.add_problem_at(str(root), None, None, f"holds neither {LABELS} nor {TABLE}")
        reader = _DatasetReader(table, calibration, report)
        matches = MatchReader(tree, names, report, limits, LABELS)
        for folder in folders:
            for group in matches.read_match(folder):
                yield reader.add_table_to_group(group, tree.shown(folder + LABELS))
        yield from reader.read_table_only_groups(tree, names, limits)
        if unused := table.unused_split_entries():
            count = plural(len(unused), "action")
            shown = ", ".join(unused[:5]) + (", ..." if len(unused) > 5 else "")
            report.add_remark(f"{count} of the split lists did not come: {shown}")


class _DatasetReader:
    """Brings labels and table together."""

    def __init__(self, table: SoccerNetV3DTable, calibration: str, report: ReaderReport):
        self._table, self._calibration, self._report = table, calibration, report
        self._seen: set[tuple[str, str]] = set()

    def add_table_to_group(self, group: Group, path: str) -> Group:
        """A group of Labels-v3D.json with its cameras, and what the table knows of it."""
        main = _find_row_image_name(group.views[0].key)
        self._seen.add((group.match, main))
        rows = self._table.rows.get(group.match, {}).get(main, {})
        images = [_find_row_image_name(view.key) for view in group.views]
        for image in sorted(rows.keys() - set(images)):
            self._report.add_problem_at(
                path,
                image,
                None,
                f"has a row in {TABLE} and is not in this file; the row is not used",
            )
        views = tuple(
            self._add_row_to_view(view, rows.get(image), path)
            for view, image in zip(group.views, images, strict=True)
        )
        split = self._table.find_split_of_group(group.match, main) or group.split
        return replace(group, views=views, split=split)

    def _add_row_to_view(self, view: View, row: TableRow | None, path: str) -> View:
        metadata = dict(view.extras.metadata)
        image = metadata[IMAGE]
        metadata[IMAGE] = {name: item for name, item in image.items() if name not in COMPUTED}
        if GAME in metadata:
            kept = {k: v for k, v in metadata[GAME].items() if k != "reconstructions"}
            metadata[GAME] = kept
        given = self._read_released_camera(image, view.key, path) or (row.camera if row else None)
        station = replace(view.station, given=given, calibration=self._calibration)
        balls = view.balls
        # The labels may hold the optimised box; the table always has the annotated one.
        if row is not None and row.ball is not None and len(balls) <= 1:
            occluded = bool(balls) and balls[0].occluded
            balls = (replace(row.ball, occluded=occluded),)
        extras = replace(view.extras, metadata=metadata)
        return replace(view, station=station, balls=balls, extras=extras)

    def _read_released_camera(self, image: Mapping[str, Any], record: str, path: str) -> Any:
        if image.get("calibration") is None:
            return None
        try:
            return camera_from_json(image["calibration"], path, record)
        except DatasetFormatError as error:
            where = f"calibration, {error.field}" if error.field else "calibration"
            self._report.add_problem_at(path, record, where, f"{error.problem}; left out")
            return None

    def read_table_only_groups(
        self, tree: FileTree, names: list[str], limits: ImportLimits
    ) -> Iterator[Group]:
        """The groups that stand in the table alone: balls and cameras, no lines."""
        folders = _map_match_folders(names, self._table.folder)
        for match, actions in self._table.rows.items():
            new = [main for main in actions if (match, main) not in self._seen]
            if not new:
                continue
            folder = folders.get(match, f"{self._table.folder}{match}/")
            inside = list_files_in_folder(names, folder)
            frames = MatchFrameFinder(tree, folder, inside, self._report)
            for main in new:
                self._report.read += 1
                group = self._make_group_from_rows(match, main, actions[main], frames)
                if group is not None:
                    self._report.imported += 1
                    yield group

    def _make_group_from_rows(
        self, match: str, main: str, rows: Mapping[str, TableRow], frames: MatchFrameFinder
    ) -> Group | None:
        if main not in rows:
            problem = "has rows of replays and none of the main picture; the group is left out"
            self._report.add_problem_at(
                f"{self._table.folder}{TABLE}", f"{match}/{main}", None, problem
            )
            return None
        ordered = sorted(rows.values(), key=lambda row: -1 if row.replay is None else row.replay)
        views = []
        for row in ordered:
            station = Station(
                f"{match}/{row.image}", row.size, given=row.camera, calibration=self._calibration
            )
            balls = (row.ball,) if row.ball else ()
            views.append(View(row.image, station, balls, frames.find_frame_by_numbers(row.image)))
        return Group(
            key=f"{match}/{main}",
            views=tuple(views),
            match=match,
            split=self._table.find_split_of_group(match, main),
            label=group_label(match, main, {}),
        )
