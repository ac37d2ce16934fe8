"""The source distribution, unpacked."""

from __future__ import annotations

import tarfile
from pathlib import Path
from typing import Any


def unpack(archive: Path, folder: Path) -> Path:
    """Unpack an archive of our own into a folder; returns the project in it."""
    # Python 3.11 knows filters from 3.11.4 on; Debian's is older.
    known: dict[str, Any] = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
    with tarfile.open(archive) as file:
        file.extractall(folder, **known)
    return next(folder.iterdir())
