"""Parquet, read: the views of an export as the groups that they were."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import DatasetFormatError
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root, limited_chunks
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.json_text import read_json
from app.formats.parquet_writer import import_pyarrow
from app.formats.report import Report
from app.formats.trees import FolderTree, opened_tree
from app.formats.view_state import PlacedView, StateReader, ViewGroups, extras_from_json
from app.soccer.group import Group, Media

NEEDED = ("group", "view", "width", "height", "lines", "balls", "given", "extras", "station")
OPTIONAL = (
    "position",
    "match",
    "split",
    "group_split",
    "views",
    "label",
    "pitch_length",
    "pitch_width",
    "included",
    "left_out_reason",
    "left_out_note",
    "shared",
    "flipped",
    "calibration",
    "given_covariance",
    "picture",
    "proposed",
    "file_name",
)
_BATCH = 512


def read_parquet(root: Root, report: Report, *, limits: Limits = DEFAULT_LIMITS) -> Iterator[Group]:
    """The groups of every Parquet file below ``root`` that has the columns of our exports.

    What was said is read, what was computed is computed again.

    Raises:
        InputError: pyarrow is not installed.
    """
    with opened_tree(root, report, limits) as tree:
        if tree is None:
            return
        names = tree.names()
        tables = [name for name in names if name.lower().endswith(".parquet")]
        if not tables:
            report.note(str(root), None, None, "holds no Parquet file")
        groups = ViewGroups(report)
        for name in tables:
            for view in _read_views(tree, name, names, report, limits):
                yield from groups.add(view, tree.shown(name))
        yield from groups.incomplete_groups()


def _read_views(
    tree: FileTree, name: str, names: list[str], report: Report, limits: Limits
) -> Iterator[PlacedView]:
    shown, present, number = tree.shown(name), set(names), 0
    try:
        for row in _read_rows(tree, name, limits):
            number += 1
            report.read += 1
            try:
                placed = _view_of_row(row, shown, f"row {number}")
            except DatasetFormatError as error:
                report.skip(error)
                continue
            media = _media_of_row(tree, str(row.get("file_name") or ""), present)
            yield replace(placed, view=replace(placed.view, media=media))
    except DatasetFormatError as error:
        report.skip(error)


def _read_rows(tree: FileTree, name: str, limits: Limits) -> Iterator[Mapping[str, Any]]:
    pyarrow, parquet = import_pyarrow()
    shown = tree.shown(name)
    with _file_on_disk(tree, name, limits) as path:
        try:
            with parquet.ParquetFile(path) as file:
                columns = file.schema_arrow.names
                missing = [column for column in NEEDED if column not in columns]
                if missing:
                    problem = "is missing from the columns"
                    raise DatasetFormatError(shown, None, missing[0], problem)
                wanted = [column for column in (*NEEDED, *OPTIONAL) if column in columns]
                for batch in file.iter_batches(_BATCH, columns=wanted):
                    yield from batch.to_pylist()
        except (pyarrow.ArrowException, OSError, ValueError) as error:
            problem = "is not a sound Parquet file"
            raise DatasetFormatError(shown, None, None, problem) from error


@contextmanager
def _file_on_disk(tree: FileTree, name: str, limits: Limits) -> Iterator[Path]:
    """A file that can be read from its end; a member of a zip is unpacked for that."""
    if isinstance(tree, FolderTree):
        with tree.open(name) as source:
            yield Path(source.name)
        return
    with tempfile.NamedTemporaryFile(prefix="touchline-", suffix=".parquet") as file:
        if PurePosixPath(tree.path.name).suffix.lower() == ".parquet":
            with tree.open(name) as source:
                shutil.copyfileobj(source, file)
        else:
            with tree.open(name) as source:
                for chunk in limited_chunks(source, limits.file_bytes, tree.shown(name)):
                    file.write(chunk)
        file.flush()
        yield Path(file.name)


def _view_of_row(row: Mapping[str, Any], path: str, record: str) -> PlacedView:
    parsed = {
        name: None
        if not isinstance(row.get(name), str)
        else read_json(row[name].encode(), path, record=f"{record}, {name}")
        for name in ("lines", "balls", "given", "picture", "proposed", "extras")
    }
    pitch = [row.get("pitch_length"), row.get("pitch_width")]
    split = row.get("group_split") or row.get("split") or ""
    value = {**row, **parsed, "pitch": None if None in pitch else pitch, "split": split}
    if row.get("left_out_reason") is not None:
        value["left_out"] = {"reason": row["left_out_reason"], "note": row.get("left_out_note")}
    state = StateReader(value, path, record)
    view = state.view(state.size(), extras_from_json(parsed["extras"]))
    return PlacedView(state.head(), state.count("position"), view)


def _media_of_row(tree: FileTree, name: str, present: set[str]) -> Media | None:
    if name not in present or PurePosixPath(name).suffix.lower() not in IMAGE_SUFFIXES:
        return None
    return tree.media(name)
