"""The home folder: made private, refused on network file systems.

Its keys belong to the installation and are in no backup.
"""

from __future__ import annotations

import errno
import os
import secrets
import shutil
import stat
import time
from collections.abc import Iterator
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import iglob
from pathlib import Path

from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.db.recovery.anchor import read_anchor
from app.durable import PARTIAL, set_private_umask, sync_to_disk
from app.errors import DamagedError, StorageError

NETWORK_FILE_SYSTEMS = frozenset(
    {"nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "fuse.sshfs", "fuse.s3fs", "9p", "glusterfs"}
)
"""Where file locks and shared memory do not hold, SQLite's WAL loses data."""
FOLDERS = ("uploads", "recordings", "exports", "cache", "sample", "practice", "backups")
"""What we make in a home beside the database and its side files."""
ASIDE, RESTORING = "before-restore-", f".restore{PARTIAL}"
"""Folders of a restore: how those with what was there before begin, and where it works."""
SERVER_LOCK, DATABASE_LOCK, OPENING_LOCK = "server.lock", "database.lock", "opening.lock"
PRACTICE_LOCK = "practice.lock"
LOCKS = SERVER_LOCK, DATABASE_LOCK, OPENING_LOCK, PRACTICE_LOCK
SIDES = "", "-wal", "-shm", "-journal"
"""How names of files of SQLite go on after the database's own."""
FOLDER_MODE = 0o700
WRITABLE = (
    "Make the home folder and its files writable for this user, or set TOUCHLINE_HOME to another."
)
"""What to do where a file of the home cannot be written."""

_MOUNTS = Path("/proc/mounts")


def make_home(settings: Settings) -> Path:
    """Make the home folder, readable by its owner alone, and check where it lies.

    Raises:
        StorageError: It cannot be made, or its database would lie on a network file system.
    """
    try:
        settings.home.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(
            f"the home folder {settings.home} cannot be created: {error.strerror}",
            hint="Set TOUCHLINE_HOME to a folder that this user may write to.",
        ) from error
    kind = find_file_system(settings.home)
    # A database on a server lets several machines share the files.
    if kind in NETWORK_FILE_SYSTEMS and get_dialect(settings).is_file:
        raise StorageError(
            f"the home folder lies on a network file system ({kind})",
            hint="Set TOUCHLINE_HOME to a folder on a local disk.",
        )
    return settings.home


def make_home_private(settings: Settings) -> int:
    """Take a home's folders and files from everybody but their owner, from now on, too.

    What belongs to another user stays as it is; ``find_paths_open_to_others`` finds it.

    Returns:
        How many could be read by others.
    """
    set_private_umask()
    mended = 0
    for path in iterate_private_files(settings):
        # Other commands may delete files meanwhile.
        with suppress(FileNotFoundError, PermissionError):
            mode = path.lstat().st_mode
            wanted = FOLDER_MODE if stat.S_ISDIR(mode) else mode & 0o700
            if not stat.S_ISLNK(mode) and stat.S_IMODE(mode) != wanted:
                path.chmod(wanted)
                mended += 1
    return mended


def find_paths_open_to_others(settings: Settings) -> list[Path]:
    """What of a home others than its owner can read or write: a closed home closes all in it."""
    closed = not settings.home.stat().st_mode & 0o077
    found = []
    for path in iterate_private_files(settings):
        with suppress(FileNotFoundError):
            mode = path.lstat().st_mode
            inside = closed and path.is_relative_to(settings.home)
            if mode & 0o077 and not stat.S_ISLNK(mode) and not inside:
                found.append(path)
    return found


def iterate_private_files(settings: Settings) -> Iterator[Path]:
    """The home, and all in it that is ours; whatever else somebody keeps there is theirs."""
    home, database = settings.home, settings.database_file
    yield home
    yield from (home / name for name in LOCKS if (home / name).exists())
    yield from _iterate_database_files(home, database)
    ours = (home / name for name in FOLDERS)
    for top in (*ours, *home.glob(f"{ASIDE}*"), database.with_name(RESTORING)):
        for folder, _folders, names in os.walk(top):
            yield Path(folder)
            yield from (Path(folder, file) for file in names)


def _iterate_database_files(home: Path, database: Path) -> Iterator[Path]:
    """A database and what lies beside it; outside of the home only where it is surely ours."""
    if not database.resolve().is_relative_to(home.resolve()) and not _is_own_database(database):
        return
    names = (*(f"{database.name}{end}" for end in SIDES), "home.json")
    yield from (path for path in map(database.with_name, names) if path.exists())


def _is_own_database(file: Path) -> bool:
    """Whether a file is the database of the installation that is named beside it."""
    # It needs numpy, and commands that only print a help text come by here.
    from app.db.recovery.preopen_check import read_header

    try:
        header, anchor = read_header(file), read_anchor(file)
    except (OSError, DamagedError):
        return False
    return bool(header and anchor and anchor.installation.startswith(f"{header.tag:07x}"))


def make_file_access_error(path: Path, error: OSError, hint: str = WRITABLE) -> StorageError:
    """What a disk said about a file, as a sentence with its remedy; without ``hint`` of the home."""
    if error.errno == errno.ENOSPC:
        return StorageError(
            f"the disk is full: {path} cannot be written", hint="Free some space and try again."
        )
    return StorageError(
        f"{path} cannot be written: {error.strerror}",
        hint=hint,
    )


def create_private_file(path: Path) -> None:
    """An empty file for its owner alone, where there is none.

    One that is there is not opened: closing it would end the locks of SQLite on it in this process.
    """
    try:
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    except FileExistsError:
        return
    except OSError as error:
        raise make_file_access_error(path, error) from error


def find_file_system(folder: Path, mounts: Path = _MOUNTS) -> str:
    """Kind of the file system that holds a folder, or an empty text where nobody says."""
    if not mounts.exists():
        return ""
    place = folder.resolve()
    best, kind = -1, ""
    for line in mounts.read_text(errors="replace").splitlines():
        _device, point, this_kind, *_rest = line.split(" ")
        mount = Path(point.replace("\\040", " "))
        if place.is_relative_to(mount) and len(mount.parts) >= best:
            best, kind = len(mount.parts), this_kind
    return kind


SECOND_FACTOR, WEBHOOKS, BEGUN = "second-factor.key", "webhooks.key", "begun.key"
DEVICES = "devices.key"
KEYS = SECOND_FACTOR, WEBHOOKS, BEGUN, DEVICES
"""Files of keys: each is made for something that a database holds."""
_BYTES = 32


def get_or_make_secret_key(settings: Settings, name: str) -> bytes:
    """A random key of a home, made when it is asked for the first time; ``name`` is its file's.

    Raises:
        StorageError: The disk refuses.
        DamagedError: The file is there, and no key.
    """
    path = settings.home / name
    try:
        if not path.exists():
            _make_key_file(path)
        key = path.read_bytes()
    except OSError as error:
        raise make_file_access_error(path, error) from error
    if len(key) != _BYTES:
        raise DamagedError(
            f"{path} is not a valid secret key: it has {len(key)} bytes, not {_BYTES}",
            hint="Restore the file from a copy. If you delete it, the server makes a new key, and"
            " everything that was signed or encrypted with the old key becomes invalid.",
        )
    return key


def _make_key_file(path: Path) -> None:
    """Whole or not at all; of two that make one at a time, the first counts."""
    partial = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(descriptor, "wb") as file:
            file.write(secrets.token_bytes(_BYTES))
            file.flush()
            os.fsync(file.fileno())
        try:
            os.link(partial, path)
        except FileExistsError:
            return
        sync_to_disk(path.parent)
    finally:
        partial.unlink(missing_ok=True)


PART = ".part"
"""How the name of a half-sent upload's folder ends."""


def delete_path(path: Path) -> None:
    """Delete a file, or a folder with all in it; it may be gone already."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


DAY = 86_400.0
"""Seconds."""
_HALF_WRITTEN = (
    f".*{PARTIAL}",
    f"*/.*{PARTIAL}",
    f"uploads/*{PART}",
    f"uploads/*/.*{PARTIAL}",
    f"recordings/*/.*{PARTIAL}",
)
"""Names that we give to what is not complete yet, in the places where we do; anywhere else a file
of such a name is somebody's."""


def is_half_written(path: Path, home: Path) -> bool:
    """Whether a path of a home is, or lies in, what something is writing or was when it was killed."""
    parts = path.relative_to(home).parts
    return any(_matches_pattern(pattern.split("/"), parts) for pattern in _HALF_WRITTEN)


def _matches_pattern(pattern: list[str], parts: tuple[str, ...]) -> bool:
    return len(parts) >= len(pattern) and all(map(fnmatchcase, parts, pattern))


def find_leftovers(settings: Settings) -> Iterator[Path]:
    """Files and folders that something killed was writing: nothing in them changed for a day."""
    oldest = time.time() - DAY
    for pattern in _HALF_WRITTEN:
        # Unlike that of pathlib, it passes over a folder that is deleted meanwhile.
        for name in iglob(pattern, root_dir=settings.home):  # noqa: PTH207
            path = settings.home / name
            written = find_last_write_time(path)
            if written is not None and written < oldest:
                yield path


def delete_leftovers(settings: Settings) -> int:
    """Delete them; returns how many there were."""
    found = list(find_leftovers(settings))
    for path in found:
        delete_path(path)
    return len(found)


def find_last_write_time(path: Path) -> float | None:
    """When a file, or the newest in a folder, was written (seconds since 1970); None: it is gone."""
    inside = [Path(folder, name) for folder, _, names in os.walk(path) for name in names]
    times = []
    for item in (path, *inside):
        with suppress(FileNotFoundError):
            times.append(item.lstat().st_mtime)
    return max(times, default=None)
