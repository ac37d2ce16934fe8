"""Frames, read: pictures without annotations, each a group of one view."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import PurePosixPath

from app.datasets.file_tree import BROKEN, DEFAULT_LIMITS, FileTree, Limits, Root
from app.datasets.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES, is_system_file
from app.datasets.report import Report
from app.datasets.trees import opened_tree
from app.errors import DatasetFormatError, ImageError, TooLargeError
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

_HEADS = (16 * 1024, 1024 * 1024)
"""Bytes of a picture in which its size is looked for."""
IS_VIDEO = (
    "is a video, and recordings are not read yet: export stills from it as PNG or JPEG, and import "
    "those as frames"
)

SizeOf = Callable[[bytes, str], ImageSize]
"""From the beginning of a picture and its name to its size as people see it; raises ImageError and
TooLargeError."""


def read_frames(
    root: Root, size_of: SizeOf, report: Report, limits: Limits = DEFAULT_LIMITS
) -> Iterator[Group]:
    """Every picture of a folder, a zip or a store, or one alone, in the order of their names.

    A group is called as its picture is, with the folders where it lies in some. What is no
    picture is reported.

    Args:
        root: Folder, zip or one picture.
        size_of: Reads the size.
        report: Takes what had to be left out.
        limits: Caps on what is read.
    """
    with opened_tree(root, report, limits) as tree:
        if tree is None:
            return
        found = False
        for name in tree.names():
            suffix = PurePosixPath(name).suffix.lower()
            if suffix in IMAGE_SUFFIXES:
                found = True
                report.read += 1
                try:
                    size = _size(tree, name, size_of)
                except DatasetFormatError as error:
                    report.skip(error)
                    continue
                report.imported += 1
                yield _group(tree, name, size)
            elif suffix in VIDEO_SUFFIXES:
                report.note(tree.shown(name), None, None, IS_VIDEO)
            elif not is_system_file(name):
                report.note(tree.shown(name), None, None, "is no JPEG, PNG or WebP picture")
        if not found and not report.problems:
            report.note(str(root), None, None, "holds no picture (JPEG, PNG or WebP)")


def _group(tree: FileTree, name: str, size: ImageSize) -> Group:
    view = View(name, Station(name, size), media=tree.media(name))
    return Group(name, (view,), label=f"Image {PurePosixPath(name).name}")


def _size(tree: FileTree, name: str, size_of: SizeOf) -> ImageSize:
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
