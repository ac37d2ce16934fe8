"""Output into an object store that appears whole or not at all.

A zip goes out in parts while it is written and becomes an object when it is complete. Of a folder
the manifest comes last: who finds no manifest finds no export.
"""

from __future__ import annotations

import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.durable import PARTIAL
from app.errors import InputError, NotFoundError, StorageError, TooLargeError
from app.formats.file_tree import Root
from app.formats.manifest import MANIFEST
from app.formats.output import (
    MAX_MANIFEST,
    files_in_manifest,
    occupied_output_error,
    output_tree,
    write_zip,
)
from app.object_store.path import StoredPath
from app.progress import ReportProgress, told
from app.zip_file import open_zip

_CHUNK = 1024 * 1024


@contextmanager
def output_in_store(
    out: StoredPath, beside: Path, progress: ReportProgress | None = None
) -> Iterator[Path]:
    """A folder to write into, which becomes ``out`` when the block ends without an error.

    Args:
        out: Where it goes; a zip by its ending.
        beside: Path on this disk after which the folder is called in which the files are gathered;
            the folder of both is made where it is missing.
        progress: Hears how many of its files are on their way.

    Raises:
        InputError: Exports may not be written there, or something else is there.
        StorageError: The store or the disk refuses.
    """
    require_free_output(out)
    try:
        beside.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        prefix = f".{beside.name}."
        staging = Path(tempfile.mkdtemp(prefix=prefix, suffix=PARTIAL, dir=beside.parent))
    except OSError as error:
        raise StorageError(f"the folder of exports cannot be written ({error.strerror})") from error
    try:
        yield staging
        if _is_zip(out):
            with out.store.writing(out.key, "application/zip") as file:
                write_zip(staging, file, progress)
        else:
            _publish_folder(staging, out, progress)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


@contextmanager
def output_anywhere(
    out: Root, exports: Path, beside: Path | None = None, progress: ReportProgress | None = None
) -> Iterator[Path]:
    """``output_tree`` on a disk, ``output_in_store`` in an object store.

    Args:
        out: Where it goes.
        exports: The folder in which what goes into a store is gathered.
        beside: See there; by default a name in ``exports``, or ``out`` itself.
        progress: See there.
    """
    if isinstance(out, StoredPath):
        opened = output_in_store(out, beside or exports / "stored", progress)
    else:
        opened = output_tree(out, beside, progress)
    with opened as folder:
        yield folder


def require_absent(out: StoredPath) -> None:
    """Refuse a place where anything is, and one that is no zip.

    Raises:
        InputError: It is such a place, or exports may not be written there.
        StorageError: The store cannot be asked.
    """
    if not _is_zip(out):
        raise InputError("an export over REST goes into a store as a zip: let its name end in .zip")
    require_free_output(out)
    with suppress(NotFoundError):
        out.store.head(out.key)
        raise occupied_output_error(f"{out} already exists")


def require_free_output(out: StoredPath) -> None:
    """Refuse, before anything is written, a place that an export may not take.

    Raises:
        InputError: Exports may not be written there, or something else is there.
        StorageError: The store cannot be asked.
    """
    if not out.settings.exports:
        raise InputError(
            f'the store "{out.store_name}" is only read from',
            hint='The operator allows it with "exports": true in TOUCHLINE_STORES.',
        )
    if not out.key:
        raise InputError(f"name a folder or a zip in the store, such as {out}league.zip")
    is_ours = _is_earlier_zip(out) if _is_zip(out) else _is_earlier_export(out)
    if not is_ours:
        raise occupied_output_error(f"{out} already exists and is not an earlier export")


def _is_zip(out: StoredPath) -> bool:
    return out.suffix.lower() == ".zip"


def _is_earlier_zip(out: StoredPath) -> bool:
    """Whether there is nothing, or a zip that holds what its manifest lists."""
    try:
        present = out.of(out.store.head(out.key))
    except NotFoundError:
        return True
    try:
        with open_zip(present) as archive:
            if archive.getinfo(MANIFEST).file_size > MAX_MANIFEST:
                return False
            return set(archive.namelist()) <= files_in_manifest(archive.read(MANIFEST))
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return False


def _is_earlier_export(out: StoredPath) -> bool:
    """The same of a folder; one whose manifest never came is somebody's own, too."""
    present = {item.key.removeprefix(f"{out.key}/") for item in out.store.below(out.key)}
    if not present:
        return True
    try:
        return present <= files_in_manifest(
            out.store.read_whole((out / MANIFEST).key, MAX_MANIFEST)[0]
        )
    except (NotFoundError, TooLargeError):
        return False


def _publish_folder(staging: Path, out: StoredPath, progress: ReportProgress | None) -> None:
    """Put files in place, the manifest last; that of an earlier export goes first."""
    store, earlier = out.store, {item.key for item in out.store.below(out.key)}
    manifest = (out / MANIFEST).key
    if manifest in earlier:
        # Until the new one is complete the old files are what an export cut off left behind.
        store.delete(manifest)
    files = sorted(path for path in staging.rglob("*") if path.is_file())
    files.sort(key=lambda path: path == staging / MANIFEST)
    for path in told(files, len(files), progress, "Sending the files to the store."):
        key = (out / path.relative_to(staging).as_posix()).key
        with store.writing(key, _content_type(path)) as target, path.open("rb") as source:
            shutil.copyfileobj(source, target, _CHUNK)
        earlier.discard(key)
    for key in earlier - {manifest}:
        store.delete(key)


def _content_type(path: Path) -> str:
    return {".json": "application/json", ".csv": "text/csv", ".jpg": "image/jpeg"}.get(
        path.suffix.lower(), "application/octet-stream"
    )
