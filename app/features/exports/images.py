"""Images of an export: copied or linked beside the labels, and what the manifest says of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from app.errors import ImageError, InputError, NotFoundError, StorageError, TooLargeError
from app.formats.frame_names import (
    FrameName,
    fold_file_name,
    frame_identity,
    frame_path_by_match,
    with_export_key,
)
from app.formats.safe_path import resolve_inside
from app.media.files import media_facts, picture_header
from app.media.frames import SentPicture
from app.object_store.address import is_address, unseal
from app.soccer.group import Group, Media, View

ReadPicture = Callable[[Media, int | None, bool], SentPicture]
"""From where a frame lies, its width (None: as it is) and whether it is mirrored."""
_SUFFIXES = {"image/jpeg": ".jpg", "image/png": ".png", "image/webp": ".webp"}


@dataclass(frozen=True)
class _WrittenPicture:
    """A picture that was placed: its path in the export, its frame, its group and view."""

    path: str
    frame: Hashable
    whose: str


class ExportImages:
    """Puts the frames of groups into an export.

    Attributes:
        media: Size and checksum of each frame, for the manifest.
        missing: Frames that could not be had, with the reason.
        placed: Where the frames of the newest group are, by view; relative to the export.
    """

    def __init__(
        self, root: Path, images: str, read: ReadPicture, layout: FrameName = frame_path_by_match
    ):
        self.media: list[Mapping[str, Any]] = []
        self.missing: list[str] = []
        self.placed: dict[str, str] = {}
        self._root, self._images, self._read = root, images, read
        self._layout = layout
        self._splits: Mapping[str, str] = {}
        self._names: Mapping[str, str] = {}
        self._written: dict[str, _WrittenPicture] = {}

    def add(
        self,
        group: Group,
        frozen: Mapping[str, Mapping[str, int]] | None = None,
        splits: Mapping[str, str] | None = None,
        names: Mapping[str, str] | None = None,
    ) -> None:
        """Note the frames of a group, and place them when images are asked for.

        Args:
            group: The group.
            frozen: What was known of its frames when it was frozen, by view; another frame than
                that is missing.
            splits: Split by view, where views of one group are split.
            names: Keys by which views are called, where not by their own (``ExportNames``).
        """
        self.placed, self._splits, self._names = {}, splits or {}, names or {}
        for view in group.views:
            if view.media is None:
                self._note_missing(group, view, "no picture came with it")
            else:
                then = None if frozen is None else frozen.get(view.key, {})
                self._add_view(group, view, view.media, then)

    def _add_view(
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
            self._note_missing(group, view, "not the file that was frozen")
            return
        try:
            self._place_picture(group, view, media)
        except (NotFoundError, ImageError, TooLargeError, StorageError) as error:
            self._note_missing(group, view, error.message)

    @property
    def present(self) -> int:
        """How many pictures lie in the export, looked up there."""
        return sum((self._root / item.path).is_file() for item in self._written.values())

    def _note_missing(self, group: Group, view: View, why: str) -> None:
        """Name a frame that was wanted and cannot be had."""
        if self._images != "none":
            self.missing.append(f"{group.key}, {view.key}: {why}")

    def _place_picture(self, group: Group, view: View, media: Media) -> None:
        is_file = media.member is None and media.frame is None and not is_address(media.path)
        if self._images == "link" and is_file and self._is_upright(view, media):
            if not Path(media.path).is_file():
                raise NotFoundError(f"{PurePosixPath(media.path).name} is not there")
            target = self._picture_path(group, view, PurePosixPath(media.path).suffix.lower())
            if target is not None:
                target.symlink_to(media.path)
            return
        picture = self._read(media, None, view.station.flipped)
        target = self._picture_path(group, view, _SUFFIXES[picture.kind])
        if target is not None:
            target.write_bytes(picture.data)

    def _is_upright(self, view: View, media: Media) -> bool:
        """Whether a link to its file shows a frame as it was annotated: a mirrored picture is
        turned right, and one that EXIF turns would lie on its side where EXIF is not read."""
        header = picture_header(media)
        return not view.station.flipped and (header is None or header.orientation == 1)

    def _picture_path(self, group: Group, view: View, suffix: str) -> Path | None:
        """Where a frame goes, in folders that are there; None where it lies there already.

        Raises:
            InputError: Another frame has its name.
        """
        called = with_export_key(view, self._names.get(view.key))
        path = self._layout(group, called, self._splits.get(view.key, group.split), suffix)
        whose = f"{group.key}, {view.key}"
        first = self._written.get(fold_file_name(path))
        if first is not None and (first.frame, first.path) != (frame_identity(group, view), path):
            raise InputError(
                f"the pictures of two frames ({first.whose} and {whose}) would both be called {path}",
                hint="Export without pictures, or rename one of the views in the source.",
            )
        self.placed[view.key] = path
        if first is not None:
            return None
        target = resolve_inside(self._root, path)
        self._written[fold_file_name(path)] = _WrittenPicture(
            path, frame_identity(group, view), whose
        )
        target.parent.mkdir(parents=True, exist_ok=True)
        return target
