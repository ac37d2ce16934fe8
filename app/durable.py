"""Durable: files that are there after a power cut, under their name, whole or not at all; and those
that their owner alone may read, such as a secret that operators give to the service."""

from __future__ import annotations

import os
import secrets
import stat
from pathlib import Path

from app.errors import InputError


def read_private_file(path: Path, variable: str) -> str:
    """The text of a file that nobody but its owner may use, without white space around it.

    Args:
        path: The file.
        variable: The setting that names it, for the sentence of an error.

    Raises:
        InputError: Others may use it, or it cannot be read as text. What it holds is in no sentence.
    """
    try:
        if is_open_to_others(path.stat()):
            raise InputError(
                f"other users can read the file {path}, which {variable} names",
                hint=f"Run chmod 600 {path}.",
            )
        return path.read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{path}, which {variable} names, cannot be read",
            hint=(
                "Check that it exists and is a plain text file owned by the user that runs "
                "Touchline."
            ),
        ) from error


def is_open_to_others(found: os.stat_result) -> bool:
    """Whether others than its owner may do anything with a file."""
    return bool(stat.S_IMODE(found.st_mode) & 0o077)


def set_private_umask() -> None:
    """From now on this process makes no file that others than its owner may read."""
    os.umask(0o077)


PARTIAL = ".partial"
"""How the name of what is not complete yet ends; it begins with a dot."""


def sync_to_disk(path: Path) -> None:
    """Put a file, or the names in a folder, on the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def replace_file(
    path: Path, content: bytes | memoryview, *, durable: bool = True, private: bool = True
) -> None:
    """Write a file: a reader sees all of it or what was there before.

    Of several writers the last one stays.

    Args:
        path: The file.
        content: All of it.
        durable: Whether that holds after a power cut, too; it costs a wait for the disk.
        private: Whether it is for its owner alone; otherwise the umask decides.
    """
    partial = path.with_name(f".{path.name}.{secrets.token_hex(4)}{PARTIAL}")
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    handle = os.open(partial, flags, 0o600 if private else 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    if durable:
        sync_to_disk(path.parent)
