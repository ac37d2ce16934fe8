"""SoccerNet-v3 and v3D: names that their readers and writers share, and the frames of one match."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import PurePosixPath
from typing import Any

from app.errors import DatasetFormatError
from app.formats.file_tree import FileTree
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.report import Report
from app.soccer.group import Media

LABELS = "Labels-v3.json"
SPLITS = ("train", "valid", "test", "challenge")
MATCH_DEPTH = 3
"""League, season, match."""

_MATCH_NAME = re.compile(r"\d{4}-\d\d-\d\d - \d\d-\d\d (.{1,80}?) (\d{1,2}) - (\d{1,2}) (.{1,80})")
_GAME_TIME = re.compile(r"\s*(?:(\d)\s*-\s*)?(\d{1,3}:\d\d)\s*")
IMAGE_NAME = re.compile(r"(\d+)(?:_(\d+))?\.[A-Za-z]+", re.ASCII)
_HALVES = {"1": "first half", "2": "second half", "3": "extra time", "4": "extra time"}
IMAGE_LISTS = ("list_actions", "list_replays")
JOINED_LISTS = (*IMAGE_LISTS, "reconstructions")
"""Lists of image names about the whole file, made anew when it is written."""


def group_label(match: str, action: str, metadata: dict[str, Any]) -> str:
    """What people read: teams, score and time of play.

    Example:
        >>> name = "england_epl/2014-2015/2015-02-21 - 18-00 Chelsea 1 - 1 Burnley"
        >>> group_label(name, "7.png", {"gameTime": "1 - 12:41"})
        'Chelsea 1 – 1 Burnley · 12:41 · first half'
    """
    folder = match.rsplit("/", 1)[-1]
    found = _MATCH_NAME.fullmatch(folder)
    teams = f"{found[1]} {found[2]} – {found[3]} {found[4]}" if found else folder
    time = _GAME_TIME.fullmatch(str(metadata.get("gameTime", "")))
    if time is None:
        return f"{teams} · {PurePosixPath(action).stem}"
    half = _HALVES.get(time[1] or str(metadata.get("half", "")).removesuffix(".0"))
    return " · ".join(part for part in (teams, time[2], half) if part)


def image_numbers(image: str) -> tuple[int, int | None] | None:
    """Action and replay number of an image name (``7_1.png``); None for any other name."""
    found = IMAGE_NAME.fullmatch(image)
    if found is None:
        return None
    return int(found[1]), None if found[2] is None else int(found[2])


LABELS_3D = "Labels-v3D.json"

TABLE = "SNv3D.csv"
SPLIT_FILES = {"train": "SNv3D-train.txt", "test": "SNv3D-test.txt"}


ARCHIVE = "Frames-v3.zip"
FOLDERS = ("", "v3_frames/", "Frames-v3/", "frames/")
"""Where the frames lie below the match or inside the archive, by precedence."""


class MatchFrames:
    """Finds the frame of an image name.

    Args:
        tree: Folder or zip that holds the match.
        match: The match's folder in it, ``""`` or with a slash at its end.
        names: Files of that folder, relative to it.
        report: Takes one problem when the archive is damaged.
    """

    def __init__(self, tree: FileTree, match: str, names: Collection[str], report: Report):
        self._tree, self._match = tree, match
        self._loose = {name for name in names if _is_image(name)}
        self._members: dict[str, str] = {}
        if ARCHIVE in names:
            self._open_archive(report)

    def _open_archive(self, report: Report) -> None:
        try:
            archive = self._tree.open_nested_zip(self._match + ARCHIVE, report)
        except DatasetFormatError as error:
            problem = f"{error.problem} Its match is imported without these frames."
            report.note(error.path, error.record, error.field, problem)
            return
        images = filter(_is_image, archive.names())
        self._members = {name: archive.stored_name(name) for name in images}
        archive.close()

    @property
    def has_frames(self) -> bool:
        """Whether there are frames at all."""
        return bool(self._members or self._loose)

    def find_frame(self, image: str) -> Media | None:
        """Where the frame of an image name (``7_1.png``) lies, or None."""
        for folder in FOLDERS:
            if folder + image in self._members:
                return self._tree.media_in_zip(self._match + ARCHIVE, self._members[folder + image])
        for folder in FOLDERS:
            if folder + image in self._loose:
                return self._tree.media(self._match + folder + image)
        return None


def _is_image(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in IMAGE_SUFFIXES
