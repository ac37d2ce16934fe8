"""Frames, read: pictures without annotations, each a group of one view or grouped by their names, and lists
that say where the frame of each view lies.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import PurePosixPath
from typing import Any

from app.config import Settings
from app.errors import DatasetFormatError, ImageError, InputError, NotFoundError, TooLargeError
from app.formats.file_tree import BROKEN, DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_system_file
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.formats.safe_path import read_regular_file, require_safe_path
from app.formats.trees import StoreTree, open_tree_context
from app.object_store.path import (
    StoredPath,
    find_path,
    is_address,
    pin_address_to_content,
    resolve_target_path,
)
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.wording import plural

_HEADS = (16 * 1024, 1024 * 1024)
"""Bytes of a picture in which its size is looked for."""
_TAIL, _MOST = 4096, 256 * 2**20
"""Bytes at the end of a JPEG among which its picture usually ends, and that are read of a picture at most."""
IS_VIDEO = (
    "is a video: bring it in as a recording (import video, or the page Recordings), and take frames "
    "from it"
)

BY_FOLDER = "folder"
"""Grouping: the pictures of one folder are a group."""
AT_THE_TOP = "pictures"
"""What the group of pictures that lie in no folder is called."""
SizeOf = Callable[[bytes, str], ImageSize]
"""From the beginning of a picture and its name to its size as people see it; raises ImageError and
TooLargeError."""


def parse_grouping_pattern(grouping: str) -> re.Pattern[str] | None:
    """What the names of pictures must look like to be grouped by them; None: they need not.

    Example:
        >>> parse_grouping_pattern("{instant}_{camera}.jpg").fullmatch("12_main.jpg")["instant"]
        '12'

    Raises:
        InputError: A pattern does not name ``{instant}`` and ``{camera}`` once each.
    """
    if grouping in ("", BY_FOLDER):
        return None
    parts = re.split(r"(\{instant\}|\{camera\})", grouping)
    if sorted(parts[1::2]) != ["{camera}", "{instant}"] or re.search(r"[{}/]", "".join(parts[::2])):
        raise InputError(
            'grouping must be "folder" or a pattern of file names that contains {instant}'
            " and {camera} once each",
            hint="For example {instant}_{camera}.jpg: 12_main.jpg and 12_goal.jpg are one group.",
            pointer="/options/grouping",
        )
    spelt = (
        f"(?P<{part[1:-1]}>.+?)" if part.startswith("{") else re.escape(part) for part in parts
    )
    return re.compile("".join(spelt), re.IGNORECASE)


def read_frames(
    root: Root,
    size_of: SizeOf,
    report: ReaderReport,
    limits: ImportLimits = DEFAULT_LIMITS,
    grouping: str = "",
) -> Iterator[Group]:
    """Every picture of a folder, a zip or a store, or one alone, in the order of their names.

    A group of one picture is called as that is, with the folders where it lies in some. What is no
    picture is reported.

    Args:
        root: Folder, zip or one picture.
        size_of: Reads the size.
        report: Takes what had to be left out, and says how pictures were grouped.
        limits: Caps on what is read.
        grouping: Empty: each picture is a group; ``folder``: those of a folder are one; else a pattern
            of their names with ``{instant}`` and ``{camera}``, by instant and folder.
    """
    pattern = parse_grouping_pattern(grouping)
    with open_tree_context(root, report, limits) as tree:
        if tree is None:
            return
        pictures = []
        for name in tree.names():
            suffix = PurePosixPath(name).suffix.lower()
            if suffix in IMAGE_SUFFIXES:
                pictures.append(name)
            elif suffix in VIDEO_SUFFIXES:
                report.add_problem_at(tree.shown(name), None, None, IS_VIDEO)
            elif not is_system_file(name):
                report.add_problem_at(
                    tree.shown(name), None, None, "is not a JPEG, PNG or WebP picture"
                )
        groups = _group_by_name(pictures, grouping, pattern)
        if grouping and pictures:
            _report_groups(report, groups, grouping)
        for key, names in groups.items():
            views = list(_read_views(tree, names, names != [key], size_of, report))
            if views:
                label = PurePosixPath(key).name
                yield Group(key, tuple(views), label=f"Image {label}" if names == [key] else label)
        if not pictures and not report.problems:
            report.add_problem_at(str(root), None, None, "contains no picture (JPEG, PNG or WebP)")


def _group_by_name(
    names: Iterable[str], grouping: str, pattern: re.Pattern[str] | None
) -> dict[str, list[str]]:
    """Names of pictures by the key of their group; what fits no pattern is one of its own."""
    groups: dict[str, list[str]] = {}
    for name in names:
        folder, _, last = name.rpartition("/")
        key = name
        if grouping == BY_FOLDER:
            key = folder or AT_THE_TOP
        elif pattern is not None and (found := pattern.fullmatch(last)) is not None:
            key = f"{folder}/{found['instant']}".removeprefix("/")
        groups.setdefault(key, []).append(name)
    return groups


def _report_groups(report: ReaderReport, groups: dict[str, list[str]], grouping: str) -> None:
    """Say in one sentence what the grouping made, with the largest group as an example."""
    key, names = max(groups.items(), key=lambda item: len(item[1]))
    shown = ", ".join(PurePosixPath(name).name for name in names[:4])
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    how = "by folder" if grouping == BY_FOLDER else f"by {grouping}"
    count = plural(sum(map(len, groups.values())), "picture")
    example = "" if names == [key] else f"; for example {key}: {shown}{more}"
    report.add_remark(f"Grouped {how}: {count} in {plural(len(groups), 'group')}{example}.")
    alone = sum(names == [key] for key, names in groups.items())
    if alone and grouping != BY_FOLDER:
        fit = plural(alone, "picture does", "pictures do")
        report.add_remark(f"{fit} not fit {grouping}: each is a group of its own.")


def _read_views(
    tree: FileTree, names: Iterable[str], short: bool, size_of: SizeOf, report: ReaderReport
) -> Iterator[View]:
    for name in names:
        report.read += 1
        try:
            size = _read_image_size(tree, name, size_of)
            # Of a store only the beginning is read.
            if not isinstance(tree, StoreTree):
                _require_whole_picture(tree, name)
        except DatasetFormatError as error:
            report.add_problem(error)
            continue
        report.imported += 1
        key = PurePosixPath(name).name if short else name
        yield View(key, Station(name, size), media=tree.media(name))


def _read_image_size(tree: FileTree, name: str, size_of: SizeOf) -> ImageSize:
    shown, problem = tree.shown(name), "cannot be read"
    for count in _HEADS:
        try:
            with tree.open(name) as file:
                return size_of(file.read(count), PurePosixPath(name).name)
        except (ImageError, TooLargeError) as error:
            problem = error.message.removeprefix(f"{PurePosixPath(name).name} ")
        except BROKEN as error:
            raise DatasetFormatError(shown, None, None, "is damaged, or its zip file is") from error
    raise DatasetFormatError(shown, None, None, problem)


def _require_whole_picture(tree: FileTree, name: str) -> None:
    """Raise where a file ends before its picture: of a JPEG decoders fill the rest with grey and do not
    say so, a PNG cannot be shown. A WebP says its length, which its header is checked with."""
    try:
        with tree.open(name) as file:
            data = file.read(_MOST)
    except BROKEN as error:
        raise DatasetFormatError(
            tree.shown(name), None, None, "is damaged, or its zip file is"
        ) from error
    if not _ends_with_picture(data):
        raise DatasetFormatError(
            tree.shown(name), None, None, "is cut off: the end of its picture is missing"
        )


def _ends_with_picture(data: bytes) -> bool:
    """Whether a file has all of its picture, as far as its format tells."""
    if data.startswith(b"\x89PNG"):
        return len(data) == _MOST or b"IEND" in data
    if not data.startswith(b"\xff\xd8") or b"\xff\xd9" in data[-_TAIL:]:
        return True
    # A small picture among the headers ends with the same two bytes.
    place = 2
    while data[place : place + 1] == b"\xff" and data[place + 1 : place + 2] != b"\xda":
        place += 2 + max(int.from_bytes(data[place + 2 : place + 4], "big"), 2)
    return b"\xff\xd9" in data[place:]


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
        report: ReaderReport,
        limits: ImportLimits = DEFAULT_LIMITS,
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
                report.add_problem_at(shown, f"frames/{number}", None, error.message)

    def _add_frame(self, item: Any) -> None:
        def read_text_field(name: str) -> str | None:
            found = item.get(name) if isinstance(item, dict) else None
            if found is not None and not (isinstance(found, str) and 0 < len(found) <= 1000):
                raise InputError(f"{name} is not a text of 1 to 1000 characters")
            return found

        group, view, path = (
            read_text_field("group"),
            read_text_field("view"),
            read_text_field("path"),
        )
        member, digest = read_text_field("member"), read_text_field("sha256")
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
        return str(resolve_target_path(self._settings, path))

    def _add_entity_tag(self, address: str) -> str:
        """The address with the entity tag of what is there now; asked once for each zip."""
        if address not in self._sealed:
            stored = find_path(self._settings, address).stored
            if stored is None:
                raise InputError(f"{address} is a folder, not a file")
            self._sealed[address] = pin_address_to_content(address, stored.etag)
        return self._sealed[address]

    def replace_listed_frames(self, groups: Iterator[Group]) -> Iterator[Group]:
        """The groups, each view with the frame that the list names for it; others keep theirs.

        Entries that name no view are reported in the end.
        """
        unused = dict.fromkeys(self._media)
        for group in groups:
            for view in group.views:
                unused.pop((group.key, view.key), None)
            views = tuple(self._replace_listed_frame(group.key, view) for view in group.views)
            yield replace(group, views=views)
        if unused:
            count = plural(len(unused), "entry names", "entries name")
            names = ", ".join(f"{group}/{view}" for group, view in list(unused)[:5])
            more = ", ..." if len(unused) > 5 else ""
            problem = f"{count} no view of what was read: {names}{more}"
            self._report.add_problem_at(self._shown, None, "frames", problem)

    def _replace_listed_frame(self, group: str, view: View) -> View:
        media = self._media.get((group, view.key))
        return view if media is None else replace(view, media=media)


def read_frame_list(
    place: Root, settings: Settings, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
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
