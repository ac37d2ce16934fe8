"""Frames, read: pictures without annotations, each a group of one view, or grouped by their names."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import PurePosixPath

from app.errors import DatasetFormatError, ImageError, InputError, TooLargeError
from app.formats.file_tree import BROKEN, DEFAULT_LIMITS, FileTree, Limits, Root
from app.formats.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_system_file
from app.formats.report import Report
from app.formats.trees import opened_tree
from app.plural import plural
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

_HEADS = (16 * 1024, 1024 * 1024)
"""Bytes of a picture in which its size is looked for."""
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


def check_grouping(grouping: str) -> re.Pattern[str] | None:
    """What the names of pictures must look like to be grouped by them; None: they need not.

    Example:
        >>> check_grouping("{instant}_{camera}.jpg").fullmatch("12_main.jpg")["instant"]
        '12'

    Raises:
        InputError: A pattern does not name ``{instant}`` and ``{camera}`` once each.
    """
    if grouping in ("", BY_FOLDER):
        return None
    parts = re.split(r"(\{instant\}|\{camera\})", grouping)
    if sorted(parts[1::2]) != ["{camera}", "{instant}"] or re.search(r"[{}/]", "".join(parts[::2])):
        raise InputError(
            "pictures are grouped by folder, or by a pattern of their names with {instant} and {camera}",
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
    report: Report,
    limits: Limits = DEFAULT_LIMITS,
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
    pattern = check_grouping(grouping)
    with opened_tree(root, report, limits) as tree:
        if tree is None:
            return
        pictures = []
        for name in tree.names():
            suffix = PurePosixPath(name).suffix.lower()
            if suffix in IMAGE_SUFFIXES:
                pictures.append(name)
            elif suffix in VIDEO_SUFFIXES:
                report.note(tree.shown(name), None, None, IS_VIDEO)
            elif not is_system_file(name):
                report.note(tree.shown(name), None, None, "is no JPEG, PNG or WebP picture")
        groups = _group_by_name(pictures, grouping, pattern)
        if grouping and pictures:
            _report_groups(report, groups, grouping)
        for key, names in groups.items():
            views = list(_read_views(tree, names, names != [key], size_of, report))
            if views:
                label = PurePosixPath(key).name
                yield Group(key, tuple(views), label=f"Image {label}" if names == [key] else label)
        if not pictures and not report.problems:
            report.note(str(root), None, None, "holds no picture (JPEG, PNG or WebP)")


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


def _report_groups(report: Report, groups: dict[str, list[str]], grouping: str) -> None:
    """Say in one sentence what the grouping made, with the largest group as an example."""
    key, names = max(groups.items(), key=lambda item: len(item[1]))
    shown = ", ".join(PurePosixPath(name).name for name in names[:4])
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    how = "by folder" if grouping == BY_FOLDER else f"by {grouping}"
    count = plural(sum(map(len, groups.values())), "picture")
    example = "" if names == [key] else f"; for example {key}: {shown}{more}"
    report.remark(f"Grouped {how}: {count} in {plural(len(groups), 'group')}{example}.")
    alone = sum(names == [key] for key, names in groups.items())
    if alone and grouping != BY_FOLDER:
        fit = plural(alone, "picture does", "pictures do")
        report.remark(f"{fit} not fit {grouping}: each is a group of its own.")


def _read_views(
    tree: FileTree, names: Iterable[str], short: bool, size_of: SizeOf, report: Report
) -> Iterator[View]:
    for name in names:
        report.read += 1
        try:
            size = _read_image_size(tree, name, size_of)
        except DatasetFormatError as error:
            report.skip(error)
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
            raise DatasetFormatError(
                shown, None, None, "is damaged, here or in its zip file"
            ) from error
    raise DatasetFormatError(shown, None, None, problem)
