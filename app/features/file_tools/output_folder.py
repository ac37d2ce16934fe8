"""OUT: the folder that a command on files writes, looked at before the work and filled after it."""

from __future__ import annotations

import os
from pathlib import Path

from app.durable import replace_file
from app.errors import InputError


def require_writable_folder(out: Path) -> None:
    """Raise InputError, before long work, where its result could not be written; makes nothing.

    Args:
        out: A folder, or where one can be made.
    """
    nearest = next(path for path in (out, *out.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file; name a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest} cannot be written (this user has no permission)")


def write_out_file(file: Path, content: str | bytes) -> None:
    """Write a file of a result, and the folders that it lies in; the umask decides who may read it.

    Raises:
        InputError: It cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        data = content.encode() if isinstance(content, str) else content
        replace_file(file, data, durable=False, private=False)
    except OSError as error:
        raise InputError(f"{file} cannot be written ({error.strerror})") from error
