"""Which format a folder, a zip or a file most likely holds, from names alone."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path, PurePosixPath

from app.formats.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_system_file
from app.formats.safe_path import MAX_PART
from app.object_store.path import StoredPath
from app.zip_file import first_names

MAX_NAMES = 2000
"""Names that are looked at; a large folder must not hold a request up."""
MAX_DEPTH = 4
_NAMES: tuple[tuple[str, re.Pattern[str]], ...] = (
    ("touchline", re.compile(r"touchline\.json")),
    ("soccernet-v3d", re.compile(r"Labels-v3D\.json|SNv3D\.csv")),
    ("soccernet-v3", re.compile(r"Labels-v3\.json")),
    ("gamestate", re.compile(r"Labels-GameState\.json")),
    ("issia-3d", re.compile(r"ISSIA-3D\.csv")),
    ("issia", re.compile(r"(?:.*\.xgtf|cam.*\.xml)(?:\.gz)?", re.IGNORECASE)),
    ("parquet", re.compile(r".*\.parquet", re.IGNORECASE)),
    ("coco", re.compile(r"(?:instances_|annotations|(?=.*coco)).*\.json")),
    ("sn-calibration", re.compile(r"(?:\d{1,9}|match_info)\.json")),
    ("cameras", re.compile(r"(?:camera_.*|issia_calibration)\.json")),
)
"""By the last part of a name; the first one that any fits: exports hold cameras beside labels."""
_DOCUMENTS = re.compile(
    r"(?:readme|licen[cs]e|copying|notes?|about)(?:\.\w{1,5})?|.*\.(?:md|pdf|html?|docx?|rtf)",
    re.IGNORECASE,
)
"""What people put beside pictures for other people."""


def guess_format(path: Path | StoredPath) -> str | None:
    """Name of the format for ``touchline import``, or None where nothing looks familiar."""
    return guess_of_names(islice(_names(path), MAX_NAMES))


def guess_of_names(found: Iterable[str]) -> str | None:
    """The same of names of files."""
    parts = (name.rpartition("/")[2] for name in found if not is_system_file(name))
    names = [part for part in parts if 0 < len(part) <= MAX_PART]
    for name, pattern in _NAMES:
        if any(map(pattern.fullmatch, names)):
            return name
    rest = _suffixes(name for name in names if not _DOCUMENTS.fullmatch(name))
    pictures, videos = rest & set(IMAGE_SUFFIXES), set(VIDEO_SUFFIXES)
    return "frames" if pictures and rest <= pictures | videos else None


def holds_videos_alone(path: Path | StoredPath) -> bool:
    """Whether a folder, a zip or a file is a video, or holds nothing but videos and documents."""
    names = [name for name in islice(_names(path), MAX_NAMES) if not is_system_file(name)]
    parts = (name.rpartition("/")[2] for name in names if not name.endswith("/"))
    suffixes = _suffixes(part for part in parts if not _DOCUMENTS.fullmatch(part))
    return bool(suffixes) and suffixes <= set(VIDEO_SUFFIXES)


def _suffixes(names: Iterable[str]) -> set[str]:
    return {PurePosixPath(name).suffix.lower() for name in names}


def _names(path: Path | StoredPath) -> Iterable[str]:
    if isinstance(path, StoredPath):
        return _stored_names(path)
    if path.is_dir():
        return _below(path, "", MAX_DEPTH)
    if path.suffix.lower() != ".zip" or not path.is_file():
        return [path.name]
    try:
        return first_names(path, MAX_NAMES)
    except OSError:
        return []


def _stored_names(path: StoredPath) -> Iterable[str]:
    if not path.is_dir():
        return [path.name]
    start = len(path.key) + 1 if path.key else 0
    return (item.key[start:] for item in path.store.below(path.key))


def _below(root: Path, inside: str, depth: int) -> Iterator[str]:
    """Names below a folder, files before folders; links are not followed."""
    folders = []
    try:
        with os.scandir(root / inside) as entries:
            for entry in islice(entries, MAX_NAMES):
                if entry.is_dir(follow_symlinks=False):
                    folders.append(f"{inside}{entry.name}/")
                elif entry.is_file(follow_symlinks=False):
                    yield inside + entry.name
    except OSError:
        return
    for folder in sorted(folders)[:20] if depth > 1 else ():
        yield from _below(root, folder, depth - 1)
