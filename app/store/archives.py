"""Open zip archives: a few are kept open, because opening one reads its whole directory."""

from __future__ import annotations

import threading
import zipfile
import zlib
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path

from app.errors import ImageError, NotFoundError, StorageError, TooLargeError
from app.object_store.path import StoredPath
from app.zip_file import nested_name, open_nested, open_zip

MAX_OPEN = 16

_Place = Path | StoredPath
_Key = tuple[str, int, int, str]
"""Path, time of change and size: a file that was replaced is another archive. The name of the zip
inside it last, or empty."""


class Archives:
    """Members of zip archives by path; safe to use from many threads.

    A member may lie in a zip that is itself a member: ``<match>/Frames-v3.zip/7.png``.
    """

    def __init__(self, most: int = MAX_OPEN):
        self._most = most
        self._open: OrderedDict[_Key, zipfile.ZipFile] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, path: _Place, member: str, limit: int) -> bytes:
        """The content of a member.

        Raises:
            NotFoundError: There is no such file or member.
            TooLargeError: The member is larger than ``limit`` bytes, whatever it declares.
            ImageError: The archive or the member is damaged.
        """
        data = self.head(path, member, limit + 1)
        if len(data) > limit:
            raise TooLargeError(f"{path.name}/{member} is larger than {limit} bytes")
        return data

    def head(self, path: _Place, member: str, count: int) -> bytes:
        """The first bytes of a member, so many at most; raises NotFoundError and ImageError."""
        archive, name = self._find(path, member)
        try:
            # ZipFile locks its own file.
            with archive.open(name) as file:
                return file.read(count)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        except (zipfile.BadZipFile, EOFError, OSError, ValueError, RuntimeError) as error:
            raise ImageError(f"{path.name}/{member} cannot be read: {error}") from error
        except NotImplementedError as error:
            raise ImageError(f"{path.name}/{member} is compressed in an unknown way") from error

    def facts(self, path: Path, member: str) -> tuple[int, int]:
        """Size and CRC-32 of a member, as the archive's directory says."""
        archive, name = self._find(path, member)
        try:
            info = archive.getinfo(name)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        return info.file_size, info.CRC

    def has(self, path: Path, member: str) -> bool:
        """Whether the archive's directory lists a member of that name."""
        archive, name = self._find(path, member)
        return name in archive.NameToInfo

    def close(self) -> None:
        """Close all archives."""
        with self._lock:
            while self._open:
                self._open.popitem()[1].close()

    def _find(self, path: _Place, member: str) -> tuple[zipfile.ZipFile, str]:
        """The open archive that a member lies in, and its name there."""
        key = _key(path)
        archive = self._get(key, lambda: _open(path))
        if member in archive.NameToInfo or (nested := nested_name(archive, member)) is None:
            return archive, member
        outer, inner = nested
        info = archive.getinfo(outer)
        return self._get((*key[:3], outer), lambda: _open_inside(path, info)), inner

    def _get(self, key: _Key, open_it: Callable[[], zipfile.ZipFile]) -> zipfile.ZipFile:
        with self._lock:
            if key not in self._open:
                self._open[key] = open_it()
            self._open.move_to_end(key)
            while len(self._open) > self._most:
                # Not closed here: another thread may have found it, and not opened its member yet.
                # It closes with whoever holds it last.
                self._open.popitem(last=False)
            return self._open[key]


def _open(path: _Place) -> zipfile.ZipFile:
    try:
        return open_zip(path)
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        raise ImageError(f"{path.name} is no complete zip archive") from error
    except OSError as error:
        raise StorageError(f"{path.name} cannot be read") from error


def _open_inside(path: _Place, info: zipfile.ZipInfo) -> zipfile.ZipFile:
    shown = f"{path.name}/{info.filename}"
    try:
        # Opened anew: one that is kept open may be closed for others' sake meanwhile.
        with _open(path) as archive:
            return open_nested(archive, path, info)
    except OSError as error:
        raise StorageError(f"{shown} cannot be read") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError) as error:
        raise ImageError(f"{shown} cannot be read: {error}") from error


def _key(path: _Place) -> _Key:
    if isinstance(path, StoredPath):
        return path.sealed(), 0, path.size, ""
    try:
        status = path.stat()
    except OSError as error:
        raise NotFoundError(f"the file {path.name} is not where it was imported from") from error
    return str(path), status.st_mtime_ns, status.st_size, ""
