"""Images of an export: copied or linked beside the labels, and what the manifest says of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from app.config import Settings
from app.datasets.archive import resolve_inside
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.soccer.group import Group, Media, View
from app.store.media import content_type, media_facts, read_frame

FOLDER = "Frames-v3"
"""Beside the labels of a match, where SoccerNet's readers look for loose frames."""

_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png", "image/webp": ".webp"}
_KNOWN = frozenset({".jpg", ".jpeg", ".png", ".webp"})


class ExportImages:
    """Puts the frames of groups into an export.

    Attributes:
        media: Size and checksum of each frame, for the manifest.
        missing: Frames that could not be had, with the reason.
    """

    def __init__(self, root: Path, images: str, settings: Settings):
        self.media: list[Mapping[str, Any]] = []
        self.missing: list[str] = []
        self._root, self._images, self._settings = root, images, settings

    def add(self, group: Group) -> None:
        """Note the frames of a group, and place them when images are asked for."""
        for view in group.views:
            if view.media is not None:
                self._add(group, view, view.media)

    def _add(self, group: Group, view: View, media: Media) -> None:
        facts = media_facts(media)
        if facts:
            self.media.append({"group": group.key, "view": view.key, **facts})
        if self._images == "none":
            return
        try:
            self._place(group, view, media)
        except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
            self.missing.append(f"{group.key}, {view.key}: {error.message}")

    def _place(self, group: Group, view: View, media: Media) -> None:
        if self._images == "link" and media.member is None and media.frame is None:
            target = self._target(group, view, PurePosixPath(media.path).suffix.lower())
            target.symlink_to(media.path)
            return
        data = read_frame(media, None, view.station.flipped, self._settings)
        target = self._target(group, view, _SUFFIXES[content_type(data)])
        target.write_bytes(data)

    def _target(self, group: Group, view: View, suffix: str) -> Path:
        """Where a frame goes: under its own name in its match, or by frame and camera."""
        name = PurePosixPath(view.key)
        if view.station.shared:
            path = f"{group.match or 'frames'}/{FOLDER}/{view.key}/{group.key}{suffix}"
        elif name.suffix.lower() in _KNOWN:
            path = f"{group.match or 'frames'}/{FOLDER}/{name}"
        else:
            path = f"{group.match or 'frames'}/{FOLDER}/{name}{suffix}"
        target = resolve_inside(self._root, path)
        target.parent.mkdir(parents=True, exist_ok=True)
        return target
