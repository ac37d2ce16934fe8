"""The home folder: made private, refused on network file systems, one server at a time."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.config import Settings
from app.errors import StorageError

NETWORK_FILE_SYSTEMS = frozenset(
    {"nfs", "nfs4", "cifs", "smb3", "smbfs", "afs", "fuse.sshfs", "fuse.s3fs", "9p", "glusterfs"}
)
"""Where file locks and shared memory do not hold, SQLite's WAL loses data."""

_MOUNTS = Path("/proc/mounts")


def make_home(settings: Settings) -> Path:
    """Make the home folder, readable by its owner alone, and check where it lies.

    Raises:
        StorageError: It cannot be made, or lies on a network file system.
    """
    try:
        settings.home.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise StorageError(f"the home folder cannot be made: {error.strerror}") from error
    kind = file_system(settings.home)
    if kind in NETWORK_FILE_SYSTEMS:
        raise StorageError(
            f"the home folder lies on a network file system ({kind})",
            hint="Set TOUCHLINE_HOME to a folder on a local disk.",
        )
    return settings.home


def file_system(folder: Path, mounts: Path = _MOUNTS) -> str:
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


@contextmanager
def server_lock(settings: Settings) -> Iterator[None]:
    """Hold the home for one server; the lock ends with the process, however it ends.

    Raises:
        StorageError: Another server holds it.
    """
    path = make_home(settings) / "server.lock"
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StorageError(
                "another Touchline server already uses this home folder",
                hint="Stop it, or set TOUCHLINE_HOME to another folder.",
            ) from error
        yield
