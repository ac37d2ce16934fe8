"""A list of frames: where the frame of each view lies, apart from the labels.

``{"frames": [{"group": ..., "view": ..., "path": "s3://NAME/...", "member": ..., "sha256": ...}]}``. A path is an
address in a configured store, or relative to the list's own folder there; ``member`` names a member of a zip,
``sha256`` the digest of the frame's bytes, which is checked when it is read first.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from app.config import Settings
from app.errors import DatasetFormatError, InputError, NotFoundError
from app.formats.file_tree import DEFAULT_LIMITS, Limits, Root
from app.formats.json_text import read_json
from app.formats.report import Report
from app.formats.safe_path import read_regular_file, require_safe_path
from app.object_store.path import StoredPath, find_path, is_address, seal_address, target_path
from app.plural import plural
from app.soccer.group import Group, Media, View

_SHA256 = re.compile(r"[0-9a-f]{64}")


class FrameList:
    """Frames by group and view.

    Args:
        content: The list, JSON.
        shown: What people call it.
        settings: Which stores there are.
        folder: What relative paths are relative to; None: they are refused.
        report: Takes one problem for each entry that cannot be used.
        limits: Caps on what is read.

    Raises:
        DatasetFormatError: It is no such list.
        StorageError: A store cannot be asked for what is there under a path without a digest.
    """

    def __init__(
        self,
        content: bytes,
        shown: str,
        settings: Settings,
        folder: StoredPath | None,
        report: Report,
        limits: Limits = DEFAULT_LIMITS,
    ):
        self._settings, self._folder = settings, folder
        self._shown, self._report = shown, report
        self._sealed: dict[str, str] = {}
        self._media: dict[tuple[str, str], Media] = {}
        value = read_json(content, shown, max_bytes=limits.file_bytes)
        items = value.get("frames") if isinstance(value, dict) else None
        if not isinstance(items, list):
            raise DatasetFormatError(shown, None, "frames", "is missing or not a list")
        for number, item in enumerate(items):
            try:
                self._add_frame(item)
            except (InputError, NotFoundError) as error:
                report.note(shown, f"frames/{number}", None, error.message)

    def _add_frame(self, item: Any) -> None:
        def text(name: str) -> str | None:
            found = item.get(name) if isinstance(item, dict) else None
            if found is not None and not (isinstance(found, str) and 0 < len(found) <= 1000):
                raise InputError(f"{name} is not a text of 1 to 1000 characters")
            return found

        group, view, path = text("group"), text("view"), text("path")
        member, digest = text("member"), text("sha256")
        if group is None or view is None or path is None:
            raise InputError("needs group, view and path")
        if digest is not None and not _SHA256.fullmatch(digest):
            raise InputError("sha256 is not 64 hexadecimal digits")
        address = self._resolve_address(path)
        if member is not None:
            require_safe_path(member)
        sealed = f"{address}#sha256={digest}" if digest else self._add_entity_tag(address)
        self._media[group, view] = Media(sealed, member)

    def _resolve_address(self, path: str) -> str:
        if not is_address(path):
            if self._folder is None:
                raise InputError(
                    f"{path[:200]} is not an address in an object store (s3://NAME/...)"
                )
            return str(self._folder / require_safe_path(path))
        require_safe_path(path.removeprefix("s3://"))
        return str(target_path(self._settings, path))

    def _add_entity_tag(self, address: str) -> str:
        """The address with the entity tag of what is there now; asked once for each zip."""
        if address not in self._sealed:
            stored = find_path(self._settings, address).stored
            if stored is None:
                raise InputError(f"{address} is a folder, not a file")
            self._sealed[address] = seal_address(address, stored.etag)
        return self._sealed[address]

    def with_listed_frames(self, groups: Iterator[Group]) -> Iterator[Group]:
        """The groups, each view with the frame that the list names for it; others keep theirs.

        Entries that name no view are reported in the end.
        """
        unused = dict.fromkeys(self._media)
        for group in groups:
            for view in group.views:
                unused.pop((group.key, view.key), None)
            views = tuple(self._with_listed_frame(group.key, view) for view in group.views)
            yield replace(group, views=views)
        if unused:
            count = plural(len(unused), "entry names", "entries name")
            names = ", ".join(f"{group}/{view}" for group, view in list(unused)[:5])
            more = ", ..." if len(unused) > 5 else ""
            problem = f"{count} no view of what was read: {names}{more}"
            self._report.note(self._shown, None, "frames", problem)

    def _with_listed_frame(self, group: str, view: View) -> View:
        media = self._media.get((group, view.key))
        return view if media is None else replace(view, media=media)


def read_frame_list(
    place: Root, settings: Settings, report: Report, limits: Limits = DEFAULT_LIMITS
) -> FrameList:
    """The list at a place, on a disk or in a store.

    Raises:
        DatasetFormatError, NotFoundError, StorageError: It cannot be read.
    """
    if isinstance(place, StoredPath):
        content = place.store.read_whole(place.key, limits.file_bytes)[0]
        return FrameList(content, str(place), settings, place.parent, report, limits)
    return FrameList(
        read_regular_file(place, limits.file_bytes), str(place), settings, None, report, limits
    )
