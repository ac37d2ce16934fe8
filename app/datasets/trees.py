"""Opens whatever lies at a path as a tree of files: a folder, a zip, one file, or the same in a store."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext

from app.datasets.file_tree import DEFAULT_LIMITS, FileTree, Limits, Root
from app.datasets.folder_tree import FileAlone, FolderTree
from app.datasets.plain_file import open_plain
from app.datasets.report import Report
from app.datasets.store_tree import StoreTree
from app.datasets.zip_tree import ZipTree
from app.errors import DatasetFormatError
from app.object_store.path import StoredPath


def open_tree(path: Root, report: Report, limits: Limits = DEFAULT_LIMITS) -> FileTree | None:
    """The folder, zip or single file at ``path``; None (and one problem) when it is unreadable.

    Members of an archive that are unsafe are left out, with a problem each.
    """
    if isinstance(path, StoredPath):
        return _open_stored(path, report, limits)
    if path.is_dir():
        return FolderTree(path, report, limits)
    if not path.exists():
        report.note(str(path), None, None, "does not exist")
        return None
    try:
        with open_plain(path) as file:
            # Arrays of numpy are a zip, too, and one file to whoever reads them.
            is_zip = path.suffix.lower() != ".npz" and (
                file.read(2) == b"PK" or path.suffix.lower() == ".zip"
            )
        return ZipTree(path, report, limits) if is_zip else FileAlone(path, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    except OSError as error:
        report.note(str(path), None, None, f"cannot be read ({error.strerror})")
    return None


@contextmanager
def opened_tree(
    path: Root, report: Report, limits: Limits = DEFAULT_LIMITS
) -> Iterator[FileTree | None]:
    """``open_tree`` for as long as somebody reads from it."""
    tree = open_tree(path, report, limits)
    with nullcontext() if tree is None else closing(tree):
        yield tree


def _open_stored(path: StoredPath, report: Report, limits: Limits) -> FileTree | None:
    if path.is_dir() or path.suffix.lower() != ".zip":
        return StoreTree(path, report, limits)
    try:
        return ZipTree(path, report, limits)
    except DatasetFormatError as error:
        report.skip(error)
    return None
