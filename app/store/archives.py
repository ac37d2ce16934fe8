"""Open zip archives: a few are kept open, because opening one reads its whole directory."""

from __future__ import annotations

import threading
import zipfile
from collections import OrderedDict
from pathlib import Path

from app.errors import ImageError, NotFoundError, StorageError, TooLargeError

MAX_OPEN = 16

_Key = tuple[str, int, int]
"""Path, time of change and size: a file that was replaced is another archive."""


class Archives:
    """Members of zip archives by path; safe to use from many threads."""

    def __init__(self, most: int = MAX_OPEN):
        self._most = most
        self._open: OrderedDict[_Key, zipfile.ZipFile] = OrderedDict()
        self._lock = threading.Lock()

    def read(self, path: Path, member: str, limit: int) -> bytes:
        """The content of a member.

        Raises:
            NotFoundError: There is no such file or member.
            TooLargeError: The member is larger than ``limit`` bytes, whatever it declares.
            ImageError: The archive or the member is damaged.
        """
        archive = self._get(path)
        try:
            # ZipFile locks its own file; a closed one stays readable for a member under way.
            with archive.open(member) as file:
                data = file.read(limit + 1)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        except (zipfile.BadZipFile, EOFError, OSError, ValueError, RuntimeError) as error:
            raise ImageError(f"{path.name}/{member} cannot be read: {error}") from error
        except NotImplementedError as error:
            raise ImageError(f"{path.name}/{member} is compressed in an unknown way") from error
        if len(data) > limit:
            raise TooLargeError(f"{path.name}/{member} is larger than {limit} bytes")
        return data

    def facts(self, path: Path, member: str) -> tuple[int, int]:
        """Size and CRC-32 of a member, as the archive's directory says."""
        try:
            info = self._get(path).getinfo(member)
        except KeyError as error:
            raise NotFoundError(f"{path.name} has no member {member}") from error
        return info.file_size, info.CRC

    def has(self, path: Path, member: str) -> bool:
        """Whether the archive's directory lists a member of that name."""
        return member in self._get(path).NameToInfo

    def close(self) -> None:
        """Close all archives."""
        with self._lock:
            while self._open:
                self._open.popitem()[1].close()

    def _get(self, path: Path) -> zipfile.ZipFile:
        key = _key(path)
        with self._lock:
            if key not in self._open:
                try:
                    self._open[key] = zipfile.ZipFile(path)
                except zipfile.BadZipFile as error:
                    raise ImageError(f"{path.name} is no complete zip archive") from error
                except OSError as error:
                    raise StorageError(f"{path.name} cannot be read") from error
            self._open.move_to_end(key)
            while len(self._open) > self._most:
                self._open.popitem(last=False)[1].close()
            return self._open[key]


def _key(path: Path) -> _Key:
    try:
        status = path.stat()
    except OSError as error:
        raise NotFoundError(f"the file {path.name} is not where it was imported from") from error
    return str(path), status.st_mtime_ns, status.st_size
