"""Documents of field lines, in the shapes that tools give them: of one image, or of many."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError
from app.formats.fields import stated_size
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.json_text import describe_document, read_json, read_json_lines
from app.formats.report import Report
from app.soccer.frames import ImageSize
from app.soccer.pitch import WITHOUT_GEOMETRY, find_marking_like

MEANT = (
    'lines are {"Side line top": [{"x": 0.1, "y": 0.2}, ...], ...} (docs/formats.md#sn-calibration)'
)
_WITHIN = ("lines", "annotations", "annotation", "markings", "field_lines")
"""Fields in which tools keep the lines beside what else they say of an image."""
_NAMES = ("file_name", "filename", "image_name", "image", "image_id", "frame", "name")


@dataclass(frozen=True)
class LineDocument:
    """The lines of one image as they were parsed.

    Attributes:
        lines: Points by name of a marking, not yet read.
        name: Stem of the image where the document names it, else None.
        size: Size of the image where the document says it, else None.
    """

    lines: Mapping[str, Any]
    name: str | None = None
    size: ImageSize | None = None


def read_line_documents(content: bytes, path: str, report: Report) -> list[LineDocument]:
    """``line_documents`` of the text of a file, JSON or JSON lines.

    Raises:
        DatasetFormatError: It is neither, or holds something else.
    """
    try:
        value = read_json(content, path, nan="keep")
    except DatasetFormatError:
        value = read_json_lines(content, path, report)
        if value is None:
            raise
    return line_documents(value, path, report)


def line_documents(value: Any, path: str, report: Report) -> list[LineDocument]:
    """The images of a parsed file of lines.

    An object of markings, the same inside another object (``lines``), an object or a list of many
    images. Images of many that hold no lines are reported.

    Args:
        value: The parsed file.
        path: File as the user knows it, for errors.
        report: Takes images that were left out.

    Raises:
        DatasetFormatError: It is something else; the sentence says what.
    """
    alone = _read_document(value)
    if alone is not None:
        return [alone]
    if isinstance(value, dict):
        items = [(str(name), item) for name, item in value.items()]
    elif isinstance(value, list):
        items = [(_line_name(item) or "", item) for item in value]
    else:
        items = []
    found, problems = [], []
    for number, (name, item) in enumerate(items):
        document = _read_document(item)
        if document is None or not name:
            why = (
                f"{describe_document(item)}; {MEANT}"
                if name
                else "has no name of its image (file_name)"
            )
            problems.append(DatasetFormatError(path, name or f"image {number}", None, why))
        else:
            found.append(LineDocument(document.lines, _image_stem(name), document.size))
    if not any(document.lines for document in found):
        raise DatasetFormatError(path, None, None, f"{describe_document(value)}; {MEANT}")
    for problem in problems:
        report.read += 1
        report.skip(problem)
    return found


def _read_document(value: Any) -> LineDocument | None:
    """The lines of one image; None where the value is something else."""
    if not isinstance(value, dict):
        return None
    if not value or any(map(_is_line_name, value)):
        return LineDocument(value)
    for name in _WITHIN:
        inner = value.get(name)
        lines = _lines_of_list(inner) if isinstance(inner, list) else inner
        if isinstance(lines, dict) and any(map(_is_line_name, lines)):
            named = _line_name(value)
            return LineDocument(
                lines, None if named is None else _image_stem(named), stated_size(value)
            )
    return None


def _is_line_name(name: str) -> bool:
    return find_marking_like(name) is not None or name.replace("_", " ").strip() in WITHOUT_GEOMETRY


def _lines_of_list(items: list[Any]) -> dict[str, Any] | None:
    """Lines of a list of objects with a class and points, by name; None where it is another list."""
    found: dict[str, Any] = {}
    for item in items:
        if not isinstance(item, dict) or not isinstance(item.get("points"), list):
            return None
        name = item.get("class") or item.get("label") or item.get("name")
        points = item["points"]
        known = found.setdefault(str(name), [])
        if len(points) % 2 == 0 and all(isinstance(one, (int, float)) for one in points):
            points = list(zip(points[::2], points[1::2], strict=True))
        known.extend(points)
    return found


def _line_name(value: Any) -> str | None:
    if not isinstance(value, dict):
        return None
    found = (value.get(name) for name in _NAMES)
    return next((str(name) for name in found if isinstance(name, (str, int)) and str(name)), None)


def _image_stem(name: str) -> str:
    place = PurePosixPath(name.replace("\\", "/"))
    return place.stem if place.suffix.lower() in IMAGE_SUFFIXES else place.name
