"""Output that appears whole or not at all: a folder, a zip by its ending, or either in an object store."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.durable import PARTIAL, sync_to_disk
from app.errors import InputError, NotFoundError, StorageError, TooLargeError
from app.formats.file_tree import Root
from app.formats.manifest import MANIFEST, SOFTWARE
from app.formats.view_files import FilesToPack
from app.object_store.path import StoredPath
from app.progress import ReportProgress, report_each_item
from app.zip_file import open_zip

MAX_MANIFEST = 1 << 30
"""Bytes of a manifest that is read; that of a hundred thousand frames has a tenth of it."""
LEVEL = 4
"""Of compression: half of the usual one's time, and a tenth more bytes."""
WHOLE = 32 << 20
"""Bytes of a file that is read at once; a larger one passes through in pieces, compressed as usual."""
_DATE = (1980, 1, 1, 0, 0, 0)
"""Of every zip entry, so that the same content makes the same file."""


@contextmanager
def open_output_folder(
    out: Path, beside: Path | None = None, progress: ReportProgress | None = None
) -> Iterator[Path]:
    """A folder to write into, which becomes ``out`` when the block ends without an error.

    The files are written beside it under a temporary name, synced and renamed. An error inside the
    block leaves nothing behind and an earlier ``out`` as it was.

    Args:
        out: Folder, or file that ends in ``.zip``. An earlier export there is replaced.
        beside: A path of the same folder, after which the temporary names are called; by default
            ``out`` itself.
        progress: Hears how many of its files are in a zip.

    Raises:
        InputError: Something else than an earlier export is there.
        StorageError: The disk refuses.
    """
    out = Path.cwd() / out
    _require_free_output(out)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        prefix = f".{(beside or out).name}."
        staging = Path(tempfile.mkdtemp(prefix=prefix, suffix=PARTIAL, dir=out.parent))
    except OSError as error:
        raise StorageError(
            f"the folder {out.parent} cannot be written ({error.strerror})"
        ) from error
    try:
        yield staging
        if out.suffix.lower() == ".zip":
            _publish_zip(staging, out, prefix, progress)
        else:
            _publish_folder(staging, out)
    except OSError as error:
        raise StorageError(f"{out.name} cannot be written ({error.strerror or error})") from error
    finally:
        shutil.rmtree(staging, ignore_errors=True)


def _require_free_output(out: Path) -> None:
    if out.suffix.lower() == ".zip":
        if out.is_dir():
            raise InputError(f"{out} is a folder, not a zip file")
        if os.path.lexists(out) and not _is_earlier_zip(out):
            raise make_occupied_output_error(f"{out} already exists and is not an earlier export")
        return
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder or a file that ends in .zip")
    if out.is_dir() and any(out.iterdir()) and not _is_earlier_export(out):
        raise make_occupied_output_error(f"{out} holds other files and is not an earlier export")


def make_occupied_output_error(sentence: str) -> InputError:
    """The refusal of a place that holds something else."""
    return InputError(sentence, hint="Name another place; an earlier export would be replaced.")


def _is_earlier_export(out: Path) -> bool:
    """Whether the folder holds what its manifest lists and nothing else."""
    present = {path.relative_to(out).as_posix() for path in out.rglob("*") if not path.is_dir()}
    try:
        return present <= list_files_in_manifest((out / MANIFEST).read_bytes())
    except OSError:
        return False


def _is_earlier_zip(out: Path) -> bool:
    """The same of a zip; a link is somebody's own."""
    try:
        with zipfile.ZipFile(out) as archive:
            if archive.getinfo(MANIFEST).file_size > MAX_MANIFEST:
                return False
            ours = list_files_in_manifest(archive.read(MANIFEST))
            return not out.is_symlink() and set(archive.namelist()) <= ours
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return False


def list_files_in_manifest(manifest: bytes) -> set[str]:
    """The files that a manifest of ours lists; none where it is of somebody else."""
    try:
        value = json.loads(manifest)
        if value["software"]["name"] != SOFTWARE:
            return set()
        return {MANIFEST, *(item["path"] for item in value["files"])}
    except (ValueError, KeyError, TypeError, RecursionError):
        return set()


def _publish_zip(staging: Path, out: Path, prefix: str, progress: ReportProgress | None) -> None:
    handle, name = tempfile.mkstemp(prefix=prefix, suffix=PARTIAL, dir=out.parent)
    partial = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            write_zip(staging, file, progress)
            file.flush()
            os.fsync(file.fileno())
        partial.chmod(0o644)
        partial.replace(out)
    finally:
        partial.unlink(missing_ok=True)
    sync_to_disk(out.parent)


def write_zip(root: Path, file: object, progress: ReportProgress | None = None) -> None:
    """All files of an export below ``root`` into a zip: sorted names, dated 1980-01-01."""
    files = FilesToPack(root)
    write_files_to_zip(report_each_item(files, len(files), progress, "Packing the files."), file)


def write_files_to_zip(
    files: Iterable[tuple[str, Path | bytes]], file: object, stored: Collection[str] = ()
) -> None:
    """Files into a zip, in their order, dated 1980-01-01.

    Args:
        files: Name and content of each.
        file: Where the zip is written: a path, or a file that is open.
        stored: Endings of names whose files are not compressed, such as ``.jpg``.
    """
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:  # type: ignore[call-overload]
        for name, content in files:
            entry = zipfile.ZipInfo(name, _DATE)
            entry.external_attr = 0o644 << 16
            entry.create_system = 3
            packed = Path(name).suffix.lower() in stored
            entry.compress_type = zipfile.ZIP_STORED if packed else zipfile.ZIP_DEFLATED
            if isinstance(content, Path) and content.stat().st_size <= WHOLE:
                content = content.read_bytes()
            if isinstance(content, bytes):
                archive.writestr(entry, content, compresslevel=LEVEL)
                continue
            # So that a file of more than 2 GB gets the sizes of ZIP64.
            entry.file_size = content.stat().st_size
            with content.open("rb") as source, archive.open(entry, "w") as target:
                shutil.copyfileobj(source, target, 1024 * 1024)


def _publish_folder(staging: Path, out: Path) -> None:
    for folder, _, files in os.walk(staging, topdown=False):
        for name in files:
            sync_to_disk(Path(folder) / name)
        sync_to_disk(Path(folder))
    staging.chmod(0o755)
    if not out.exists():
        staging.rename(out)
    else:
        # A folder cannot be renamed onto one that holds files: the old one steps aside.
        aside = staging.with_suffix(".replaced")
        out.rename(aside)
        staging.rename(out)
        shutil.rmtree(aside, ignore_errors=True)
    sync_to_disk(out.parent)


_CHUNK = 1024 * 1024


@contextmanager
def open_output_in_store(
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
    require_free_in_store(out)
    try:
        beside.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        prefix = f".{beside.name}."
        staging = Path(tempfile.mkdtemp(prefix=prefix, suffix=PARTIAL, dir=beside.parent))
    except OSError as error:
        raise StorageError(f"the folder of exports cannot be written ({error.strerror})") from error
    try:
        yield staging
        if _is_zip_in_store(out):
            with out.store.writing(out.key, "application/zip") as file:
                write_zip(staging, file, progress)
        else:
            _publish_to_store(staging, out, progress)
    finally:
        shutil.rmtree(staging, ignore_errors=True)


@contextmanager
def open_output(
    out: Root, exports: Path, beside: Path | None = None, progress: ReportProgress | None = None
) -> Iterator[Path]:
    """``open_output_folder`` on a disk, ``open_output_in_store`` in an object store.

    Args:
        out: Where it goes.
        exports: The folder in which what goes into a store is gathered.
        beside: See there; by default a name in ``exports``, or ``out`` itself.
        progress: See there.
    """
    if isinstance(out, StoredPath):
        opened = open_output_in_store(out, beside or exports / "stored", progress)
    else:
        opened = open_output_folder(out, beside, progress)
    with opened as folder:
        yield folder


def require_new_zip_in_store(out: StoredPath) -> None:
    """Refuse a place where anything is, and one that is no zip.

    Raises:
        InputError: It is such a place, or exports may not be written there.
        StorageError: The store cannot be asked.
    """
    if not _is_zip_in_store(out):
        raise InputError(
            "an export to an object store must be a zip: choose a name that ends in .zip"
        )
    require_free_in_store(out)
    with suppress(NotFoundError):
        out.store.head(out.key)
        raise make_occupied_output_error(f"{out} already exists")


def require_free_in_store(out: StoredPath) -> None:
    """Refuse, before anything is written, a place that an export may not take.

    Raises:
        InputError: Exports may not be written there, or something else is there.
        StorageError: The store cannot be asked.
    """
    if not out.settings.exports:
        raise InputError(
            f'exports into the store "{out.store_name}" are not allowed',
            hint='The operator allows it with "exports": true in TOUCHLINE_STORES.',
        )
    if not out.key:
        raise InputError(f"name a folder or a zip in the store, such as {out}league.zip")
    is_ours = (
        _may_replace_zip_in_store(out)
        if _is_zip_in_store(out)
        else _may_replace_folder_in_store(out)
    )
    if not is_ours:
        raise make_occupied_output_error(f"{out} already exists and is not an earlier export")


def _is_zip_in_store(out: StoredPath) -> bool:
    return out.suffix.lower() == ".zip"


def _may_replace_zip_in_store(out: StoredPath) -> bool:
    """Whether there is nothing, or a zip that holds what its manifest lists."""
    try:
        present = out.make_object_path(out.store.head(out.key))
    except NotFoundError:
        return True
    try:
        with open_zip(present) as archive:
            if archive.getinfo(MANIFEST).file_size > MAX_MANIFEST:
                return False
            return set(archive.namelist()) <= list_files_in_manifest(archive.read(MANIFEST))
    except (OSError, KeyError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error):
        return False


def _may_replace_folder_in_store(out: StoredPath) -> bool:
    """The same of a folder; one whose manifest never came is somebody's own, too."""
    present = {
        item.key.removeprefix(f"{out.key}/") for item in out.store.iterate_objects_below(out.key)
    }
    if not present:
        return True
    try:
        return present <= list_files_in_manifest(
            out.store.read_whole((out / MANIFEST).key, MAX_MANIFEST)[0]
        )
    except (NotFoundError, TooLargeError):
        return False


def _publish_to_store(staging: Path, out: StoredPath, progress: ReportProgress | None) -> None:
    """Put files in place, the manifest last; that of an earlier export goes first."""
    store, earlier = out.store, {item.key for item in out.store.iterate_objects_below(out.key)}
    manifest = (out / MANIFEST).key
    if manifest in earlier:
        # Until the new one is complete the old files are what an export cut off left behind.
        store.delete(manifest)
    files = sorted(path for path in staging.rglob("*") if path.is_file())
    files.sort(key=lambda path: path == staging / MANIFEST)
    for path in report_each_item(files, len(files), progress, "Sending the files to the store."):
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
