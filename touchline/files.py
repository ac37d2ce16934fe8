"""Files of an export: a folder or a zip, read and checked alike."""

from __future__ import annotations

import hashlib
import json
import unicodedata
import zipfile
import zlib
from contextlib import suppress
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from touchline.errors import DataError, HashError

MANIFEST = "manifest.json"
_UTF_8 = 0x800
"""Flag of members of a zip whose names say that they are UTF-8."""


class Files:
    """The files below a folder, or in a zip.

    Args:
        path: Folder or zip.

    Raises:
        DataError: There is neither.
    """

    def __init__(self, path: Path):
        self.path = path
        self._zip: zipfile.ZipFile | None = None
        self._spellings: dict[Path, dict[str, str]] = {}
        if path.is_dir():
            return
        try:
            self._zip = zipfile.ZipFile(path)
        except FileNotFoundError:
            raise DataError(f"{path} is not there") from None
        except (OSError, zipfile.BadZipFile) as error:
            raise DataError(f"{path} is neither a folder nor a sound zip ({error})") from None

    def __reduce__(self) -> tuple[Any, ...]:
        """Workers that load data open the zip again."""
        return Files, (self.path,)

    def close(self) -> None:
        """Close the zip."""
        if self._zip is not None:
            self._zip.close()

    @cached_property
    def _members(self) -> dict[str, zipfile.ZipInfo]:
        """Members of a zip by their composed names; a folder is asked file by file."""
        members = self._zip.infolist() if self._zip else []
        return {_composed(_member_name(member)): member for member in members}

    def holds(self, name: str) -> bool:
        """Whether there is a file of that name, however its accents are composed."""
        if self._zip is not None:
            return _composed(name) in self._members
        return is_safe(name) and self.locate(name).is_file()

    def locate(self, name: str) -> Path:
        """Where a file of a folder lies, with each part of its name as the disk spells it."""
        if name.isascii() or (self.path / name).exists():
            return self.path / name
        place = self.path
        for part in PurePosixPath(name).parts:
            place /= self._spelling(place).get(_composed(part), part)
        return place

    def _spelling(self, folder: Path) -> dict[str, str]:
        """What is in a folder: its own spelling of each name, by the composed name."""
        if folder not in self._spellings:
            there = folder.iterdir() if folder.is_dir() else ()
            self._spellings[folder] = {_composed(item.name): item.name for item in there}
        return self._spellings[folder]

    def read(self, name: str) -> bytes:
        """The content of a file.

        Raises:
            DataError: It is not there, or damaged.
        """
        if not is_safe(name):
            raise DataError(f'"{name}" leads out of {self.path}')
        try:
            if self._zip is None:
                return self.locate(name).read_bytes()
            return self._zip.read(self._members[_composed(name)])
        except (KeyError, FileNotFoundError):
            raise DataError(f"{self.path} contains no {name}") from None
        except (OSError, zipfile.BadZipFile, RuntimeError, zlib.error) as error:
            raise DataError(f"{name} of {self.path} cannot be read ({error})") from None


def _composed(name: str) -> str:
    """A name with each accent in its letter: macOS writes them apart."""
    return unicodedata.normalize("NFC", name)


def _member_name(member: zipfile.ZipInfo) -> str:
    """The name of a member with forward slashes, in the letters that its writer meant.

    What is UTF-8 byte for byte is taken for that, also without the mark for it, as in an import.
    """
    name = member.filename
    if not name.isascii() and not member.flag_bits & _UTF_8:
        with suppress(UnicodeError):
            name = name.encode("cp437").decode("utf-8")
    return name.replace("\\", "/")


def is_safe(name: str) -> bool:
    """Whether a name stays below the folder that it is looked for in."""
    place = PurePosixPath(name)
    return bool(name) and not place.is_absolute() and ".." not in place.parts and "\0" not in name


class Export:
    """An export that says what it holds: files, and a manifest that has the hash of each.

    Args:
        path: Folder or zip.

    Raises:
        DataError: It has no manifest of Touchline.
    """

    def __init__(self, path: Path):
        self.files = Files(path)
        try:
            manifest = json.loads(self.files.read(MANIFEST))
            ours = manifest["software"]["name"] == "touchline"
            self._sha256 = {item["path"]: item["sha256"] for item in manifest["files"]}
        except (ValueError, KeyError, TypeError, RecursionError):
            ours = False
        if not ours:
            raise DataError(f"{MANIFEST} of {path} is none of Touchline")
        self.manifest: dict[str, Any] = manifest

    @property
    def hash(self) -> str | None:
        """Hash of the frozen version; None for an export of a dataset as it was that day."""
        frozen = self.manifest.get("frozen")
        return str(frozen["hash"]) if isinstance(frozen, dict) and "hash" in frozen else None

    @property
    def has_frames(self) -> bool:
        """Whether there is more in it than tables."""
        return any(not name.endswith(".parquet") for name in self._sha256)

    def lists(self, name: str) -> bool:
        """Whether the manifest lists a file."""
        return name in self._sha256

    def read(self, name: str) -> bytes:
        """The content of a file that the manifest lists.

        Raises:
            HashError: It is not what the manifest says.
            DataError: It is not there.
        """
        content = self.files.read(name)
        if hashlib.sha256(content).hexdigest() != self._sha256.get(name):
            raise HashError(
                f"{name} of {self.files.path} is not what its manifest says",
                f"Delete {self.files.path} and export or open the version again.",
            )
        return content

    def require(self, version: str | None) -> None:
        """Check that it is the version that was asked for.

        Args:
            version: Name, or eight or more digits of the hash; None: any.

        Raises:
            HashError: It is another one.
        """
        if version is None or version == self.manifest.get("version"):
            return
        found = self.hash or ""
        if len(version) >= 8 and found.startswith(version):
            return
        what = f'version "{self.manifest.get("version")}" ({found[:16]})' if found else "no version"
        raise HashError(
            f'{self.files.path} holds {what} of "{self.manifest.get("dataset")}", not "{version}"',
            f"Export that one: touchline export --dataset {self.manifest.get('dataset')} "
            f"--version {version} --format parquet OUT",
        )
