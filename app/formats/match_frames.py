"""The frames of one SoccerNet match: members of Frames-v3.zip or loose files, read in place.

Frames-v3.zip may itself be a member of the zip that was uploaded.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import PurePosixPath

from app.errors import DatasetFormatError
from app.formats.file_tree import FileTree
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.report import Report
from app.soccer.media import Media

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

    def _media_of_member(self, name: str) -> Media:
        """Where a member of the archive is."""
        return self._tree.media_in_zip(self._match + ARCHIVE, self._members[name])

    @property
    def has_frames(self) -> bool:
        """Whether there are frames at all."""
        return bool(self._members or self._loose)

    def find_frame(self, image: str) -> Media | None:
        """Where the frame of an image name (``7_1.png``) lies, or None."""
        for folder in FOLDERS:
            if folder + image in self._members:
                return self._media_of_member(folder + image)
        for folder in FOLDERS:
            if folder + image in self._loose:
                return self._tree.media(self._match + folder + image)
        return None


def _is_image(name: str) -> bool:
    return PurePosixPath(name).suffix.lower() in IMAGE_SUFFIXES
