"""Files of an export: a folder or a zip, read and checked alike."""

from __future__ import annotations

import hashlib
import json
import zipfile
import zlib
from functools import cached_property
from pathlib import Path, PurePosixPath
from typing import Any

from touchline.errors import DataError, HashError

MANIFEST = "manifest.json"


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
    def names(self) -> frozenset[str]:
        """Names of the members of a zip; a folder is asked file by file."""
        return frozenset(self._zip.namelist()) if self._zip else frozenset()

    def holds(self, name: str) -> bool:
        """Whether there is a file of that name."""
        if self._zip is not None:
            return name in self.names
        return is_safe(name) and (self.path / name).is_file()

    def read(self, name: str) -> bytes:
        """The content of a file.

        Raises:
            DataError: It is not there, or damaged.
        """
        if not is_safe(name):
            raise DataError(f'"{name}" leads out of {self.path}')
        try:
            return self._zip.read(name) if self._zip else (self.path / name).read_bytes()
        except (KeyError, FileNotFoundError):
            raise DataError(f"{self.path} contains no {name}") from None
        except (OSError, zipfile.BadZipFile, RuntimeError, zlib.error) as error:
            raise DataError(f"{name} of {self.path} cannot be read ({error})") from None


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
