"""Half-written files in a home, by somebody who is writing them or was killed."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import suppress
from fnmatch import fnmatchcase
from glob import iglob
from pathlib import Path

from app.config import Settings
from app.durable import PARTIAL

PART = ".part"
"""How the name of a half-sent upload's folder ends."""


def clear(path: Path) -> None:
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


def leftovers(settings: Settings) -> Iterator[Path]:
    """Files and folders that something killed was writing: nothing in them changed for a day."""
    oldest = time.time() - DAY
    for pattern in _HALF_WRITTEN:
        # Unlike that of pathlib, it passes over a folder that is deleted meanwhile.
        for name in iglob(pattern, root_dir=settings.home):  # noqa: PTH207
            path = settings.home / name
            written = last_written(path)
            if written is not None and written < oldest:
                yield path


def delete_leftovers(settings: Settings) -> int:
    """Delete them; returns how many there were."""
    found = list(leftovers(settings))
    for path in found:
        clear(path)
    return len(found)


def last_written(path: Path) -> float | None:
    """When a file, or the newest in a folder, was written (seconds since 1970); None: it is gone."""
    inside = [Path(folder, name) for folder, _, names in os.walk(path) for name in names]
    times = []
    for item in (path, *inside):
        with suppress(FileNotFoundError):
            times.append(item.lstat().st_mtime)
    return max(times, default=None)
