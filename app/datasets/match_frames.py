"""The frames of one SoccerNet match: members of Frames-v3.zip or loose files, read in place."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path, PurePosixPath

from app.datasets.archive import FileTree, Limits, ZipTree
from app.datasets.report import Report
from app.datasets.sn_calibration import IMAGE_SUFFIXES
from app.errors import DatasetFormatError
from app.soccer.group import Media

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

    def __init__(
        self, tree: FileTree, match: str, names: Collection[str], report: Report, limits: Limits
    ):
        self._tree, self._match = tree, match
        self._loose = {name for name in names if _is_image(name)}
        self._archive: Path | None = None
        self._members: set[str] = set()
        # Names of a folder lead to files inside it; those of a zip cannot be opened in place.
        if ARCHIVE in names and tree.path.is_dir():
            self._open(tree.path / match / ARCHIVE, report, limits)

    def _open(self, path: Path, report: Report, limits: Limits) -> None:
        try:
            archive = ZipTree(path, report, limits)
        except DatasetFormatError as error:
            problem = f"{error.problem} Its match is imported without these frames."
            report.note(error.path, error.record, error.field, problem)
            return
        self._archive = path
        self._members = {name for name in archive.names() if _is_image(name)}
        archive.close()

    @property
    def some(self) -> bool:
        """Whether there are frames at all."""
        return bool(self._members or self._loose)

    def find(self, image: str) -> Media | None:
        """Where the frame of an image name (``7_1.png``) lies, or None."""
        for folder in FOLDERS:
            if folder + image in self._members:
                return Media(str(self._archive), folder + image)
        for folder in FOLDERS:
            if folder + image in self._loose:
                name = self._match + folder + image
                if self._tree.path.is_dir():
                    return Media(self._tree.shown(name))
                return Media(str(self._tree.path), name)
        return None


def _is_image(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in IMAGE_SUFFIXES
