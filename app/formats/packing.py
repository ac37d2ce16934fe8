"""A folder as one file that can be sent, and files that were fetched as one as a folder again."""

from __future__ import annotations

import shutil
import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from app.formats.output import zip_files
from app.formats.safe_path import resolve_inside

COMPRESSED = frozenset({".jpg", ".jpeg", ".png", ".webp", ".mp4", ".zip", ".parquet"})
"""Endings of files that are compressed already."""
_CHUNK = 1 << 20


@contextmanager
def as_one_file(path: Path) -> Iterator[Path]:
    """A file itself, or all files of a folder as a zip of its name, there until the block ends.

    The same files make the same zip, so that it is known again.
    """
    if not path.is_dir():
        yield path
        return
    with tempfile.TemporaryDirectory() as held:
        packed = Path(held) / f"{path.resolve().name}.zip"
        files = (file for file in sorted(path.rglob("*")) if file.is_file())
        named = ((file.relative_to(path).as_posix(), file) for file in files)
        zip_files(named, packed, COMPRESSED)
        yield packed


def unpack(packed: Path, folder: Path) -> None:
    """All files of a zip into a folder.

    Raises:
        UnsafePathError: A name leads out of it.
    """
    with zipfile.ZipFile(packed) as archive:
        for name in archive.namelist():
            target = resolve_inside(folder, name)
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(name) as source, target.open("wb") as file:
                shutil.copyfileobj(source, file, _CHUNK)
