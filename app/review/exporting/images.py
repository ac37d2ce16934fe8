"""Images of an export: copied or linked beside the labels, and what the manifest says of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

from app.datasets.frame_names import FrameName, match_frame
from app.datasets.safe_path import resolve_inside
from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.object_store.address import is_address, unseal
from app.soccer.group import Group, View
from app.soccer.media import Media
from app.store.frames import SentPicture
from app.store.media import media_facts, picture_header

ReadPicture = Callable[[Media, int | None, bool], SentPicture]
"""From where a frame lies, its width (None: as it is) and whether it is mirrored."""
_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png", "image/webp": ".webp"}


class ExportImages:
    """Puts the frames of groups into an export.

    Attributes:
        media: Size and checksum of each frame, for the manifest.
        missing: Frames that could not be had, with the reason.
        placed: Where the frames of the newest group are, by view; relative to the export.
    """

    def __init__(self, root: Path, images: str, read: ReadPicture, layout: FrameName = match_frame):
        self.media: list[Mapping[str, Any]] = []
        self.missing: list[str] = []
        self.placed: dict[str, str] = {}
        self._root, self._images, self._read = root, images, read
        self._layout = layout
        self._splits: Mapping[str, str] = {}

    def add(
        self,
        group: Group,
        frozen: Mapping[str, Mapping[str, int]] | None = None,
        splits: Mapping[str, str] | None = None,
    ) -> None:
        """Note the frames of a group, and place them when images are asked for.

        Args:
            group: The group.
            frozen: What was known of its frames when it was frozen, by view; another frame than
                that is missing.
            splits: Split by view, where views of one group are split.
        """
        self.placed, self._splits = {}, splits or {}
        for view in group.views:
            if view.media is None:
                self._miss(group, view, "no picture came with it")
            else:
                then = None if frozen is None else frozen.get(view.key, {})
                self._add(group, view, view.media, then)

    def _add(
        self, group: Group, view: View, media: Media, frozen: Mapping[str, int] | None
    ) -> None:
        facts = media_facts(media) if frozen is None else frozen
        if facts:
            self.media.append({"group": group.key, "view": view.key, **facts})
        elif is_address(media.path):
            _, kind, value = unseal(media.path)
            self.media.append(
                {"group": group.key, "view": view.key, **({kind: value} if kind else {})}
            )
        if self._images == "none":
            return
        if frozen and frozen != media_facts(media):
            self._miss(group, view, "not the file that was frozen")
            return
        try:
            self._place(group, view, media)
        except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
            self._miss(group, view, error.message)

    def _miss(self, group: Group, view: View, why: str) -> None:
        """Name a frame that was wanted and cannot be had."""
        if self._images != "none":
            self.missing.append(f"{group.key}, {view.key}: {why}")

    def _place(self, group: Group, view: View, media: Media) -> None:
        is_file = media.member is None and media.frame is None and not is_address(media.path)
        if self._images == "link" and is_file and self._is_upright(view, media):
            target = self._target(group, view, PurePosixPath(media.path).suffix.lower())
            target.symlink_to(media.path)
            return
        picture = self._read(media, None, view.station.flipped)
        target = self._target(group, view, _SUFFIXES[picture.kind])
        target.write_bytes(picture.data)

    def _is_upright(self, view: View, media: Media) -> bool:
        """Whether a link to its file shows a frame as it was annotated: a mirrored picture is
        turned right, and one that EXIF turns would lie on its side where EXIF is not read."""
        header = picture_header(media)
        return not view.station.flipped and (header is None or header.orientation == 1)

    def _target(self, group: Group, view: View, suffix: str) -> Path:
        """Where a frame goes, in folders that are there."""
        path = self._layout(group, view, self._splits.get(view.key, group.split), suffix)
        target = resolve_inside(self._root, path)
        target.parent.mkdir(parents=True, exist_ok=True)
        self.placed[view.key] = path
        return target
