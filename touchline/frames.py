"""Frames: where the pictures of views come from: an export, a folder, a zip, or a server."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Protocol

from touchline.errors import DataError, HashError
from touchline.files import Export, Files

if TYPE_CHECKING:
    from touchline.client import Client
    from touchline.view import View

ARCHIVE, FOLDER = "Frames-v3.zip", "Frames-v3"
"""Where SoccerNet has the frames of a match."""
AS_STORED = "Touchline-As-Stored"
"""Header of a frame that is sent as its file holds it."""
_INSIDE = ("", "v3_frames/", "Frames-v3/", "frames/")


class Frames(Protocol):
    """Reads the frame of a view."""

    def read(self, view: View) -> bytes:
        """The file's content; DataError where it is not there."""


class NoFrames:
    """Nobody said where the frames are."""

    def read(self, view: View) -> bytes:
        """Raises DataError."""
        raise DataError(
            f"no place is configured for the frame of {view.key}",
            "Give the folder, zip or server that has the frames: touchline.open(..., frames=...).",
        )


class ExportFrames:
    """Frames that were exported along (``--images copy``), checked by their hash."""

    def __init__(self, export: Export):
        self._export = export

    def read(self, view: View) -> bytes:
        """The file's content; DataError where it is not there."""
        if not self._export.lists(view.file_name):
            return NoFrames().read(view)
        return self._export.read(view.file_name)


class FileFrames:
    """Frames in a folder or zip, named as an export names them, or as SoccerNet does.

    Args:
        path: Folder or zip; its matches may have their frames in ``Frames-v3.zip``.
    """

    def __init__(self, path: Path):
        self._files = Files(path)
        self._archives: dict[str, Files] = {}
        self._owners: dict[str, str] = {}

    def read(self, view: View) -> bytes:
        """The file's content; DataError where it is not there."""
        for name in _places(view.file_name):
            if self._files.holds(name):
                self._require_one(name, view.file_name)
                return self._files.read(name)
        match, _, name = view.file_name.partition(f"/{FOLDER}/")
        archive = self._archive(match)
        for folder in _INSIDE:
            if archive is not None and archive.holds(folder + name):
                return archive.read(folder + name)
        raise DataError(f"{self._files.path} has no frame {view.file_name}")

    def _require_one(self, name: str, wanted: str) -> None:
        """Refuse a file that is called so briefly that it would be the frame of two views."""
        other = self._owners.setdefault(name, wanted)
        if other != wanted:
            raise DataError(
                f"{name} of {self._files.path} fits two frames ({other} and {wanted})",
                "Lay the frames into the folders that the export names.",
            )

    def _archive(self, match: str) -> Files | None:
        """The zip of a match's frames, opened once; those inside a zip are not looked into."""
        if match not in self._archives and self._files.path.is_dir():
            if not self._files.holds(f"{match}/{ARCHIVE}"):
                return None
            self._archives[match] = Files(self._files.locate(f"{match}/{ARCHIVE}"))
        return self._archives.get(match)


class ServerFrames:
    """Frames as a server has them; asked for one by one.

    Args:
        client: The server.
        dataset: Name of the dataset.
        manifest: Of the export whose views are read: says what their frames were.
    """

    def __init__(self, client: Client, dataset: str, manifest: Mapping[str, Any] | None = None):
        self._client, self._dataset = client, dataset
        self._known = {
            (item.get("group"), item.get("view")): item
            for item in (manifest or {}).get("media", ())
        }
        self._groups: dict[str, int] = {}
        self._views: dict[tuple[str, str], str] = {}

    def read(self, view: View) -> bytes:
        """The file's content.

        Raises:
            DataError: It is not there.
            HashError: It is another file than the one that was exported.
        """
        if not self._groups:
            rows = self._client.pages("groups", dataset=self._dataset)
            self._groups = {row["key"]: row["id"] for row in rows}
        if view.group not in self._groups:
            raise DataError(f'"{self._dataset}" no longer has the group {view.group}')
        if (view.group, view.key) not in self._views:
            document = self._client.get(f"groups/{self._groups[view.group]}")
            for item in document["views"]:
                self._views[view.group, item["key"]] = item["image"]
        address = self._views.get((view.group, view.key))
        if address is None:
            raise DataError(f"{view.group} no longer has the view {view.key}")
        answer = self._client.send("GET", address)
        content: bytes = answer.content
        # What the server made of a file (turned, of a video) says nothing of the file.
        if answer.headers.get(AS_STORED) == "true":
            self._require_same(view, content)
        return content

    def _require_same(self, view: View, content: bytes) -> None:
        known = self._known.get((view.group, view.key), {})
        found = {"bytes": len(content), "crc32": zlib.crc32(content)}
        if any(name in known and known[name] != value for name, value in found.items()):
            raise HashError(
                f"the frame of {view.key} of {view.group} is not the one that was exported: its file"
                f' was changed on the server, or "{self._dataset}" was imported again with another',
                "Open the frames that were annotated (frames=), or freeze and open a newer version.",
            )


def _places(name: str) -> Iterator[str]:
    """Where a frame may lie: under its name, beside the folder of frames, or flat."""
    yield name
    yield name.replace(f"/{FOLDER}/", "/", 1)
    yield PurePosixPath(name).name
