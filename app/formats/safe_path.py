"""Paths that stay where they belong, whoever wrote them, and files opened only where they are files."""

from __future__ import annotations

import os
import re
import stat
import unicodedata
from pathlib import Path
from typing import IO
from urllib.parse import unquote

from app.errors import DatasetFormatError, UnsafePathError
from app.json_text import quote_text

_DRIVE = re.compile(r"[A-Za-z]:")
_CONTROL = re.compile(r"[\\\x00-\x1f\x7f]")
_NO_TEXT = re.compile("[\ud800-\udfff]")
MAX_PART = 255
"""Most bytes of the name of a file or folder; what is longer fits on no disk."""


def require_safe_path(path: str) -> str:
    """The relative path unchanged, when it stays inside whatever folder it is joined to.

    Raises:
        UnsafePathError: Empty, absolute, longer than disks take, with a drive letter, ``..``,
            backslash or control character; also when only its decoded or normalised spelling is so.
    """
    for spelling in _decoded_spellings(path):
        problem = _find_path_problem(spelling)
        if problem:
            raise UnsafePathError(f"the path {quote_text(path, 200)} {problem}")
    if any(len(part.encode()) > MAX_PART for part in path.split("/")):
        raise UnsafePathError(
            f"the path {quote_text(path, 200)} has a part of more than {MAX_PART} bytes"
        )
    return path


def resolve_inside(root: Path, path: str) -> Path:
    """The real path of ``path`` below ``root``; symbolic links may not lead out of it.

    Args:
        root: Folder that must contain the result; may itself be a symbolic link.
        path: Relative, with forward slashes; need not exist.

    Raises:
        UnsafePathError: The path would leave the folder.
    """
    require_safe_path(path)
    real_root = Path(os.path.realpath(root))
    real = Path(os.path.realpath(real_root / path))
    if real != real_root and real_root not in real.parents:
        raise UnsafePathError(f"the path {quote_text(path, 200)} leads out of its folder")
    return real


def _decoded_spellings(path: str) -> list[str]:
    if path.isascii() and "%" not in path:
        return [path]
    spellings = [path, unicodedata.normalize("NFKC", path)]
    decoded = path
    for _ in range(3):
        decoded = unquote(decoded)
        spellings += [decoded, unicodedata.normalize("NFKC", decoded)]
    return spellings


def _find_path_problem(path: str) -> str | None:
    if not path:
        return "is empty"
    if _CONTROL.search(path):
        return "holds a backslash or a control character"
    if _NO_TEXT.search(path):
        return "is not valid text"
    if path.startswith("/") or _DRIVE.match(path):
        return "is absolute"
    if ".." in path.split("/"):
        return "holds '..'"
    return None


def is_hidden(name: str) -> bool:
    """Whether a file or folder of that name is none that people mean."""
    return (name.startswith(".") and name not in (".", "..")) or name == "__MACOSX"


MAX_BYTES = 256 * 1024 * 1024
"""Longest file that is read whole."""


def open_regular_file(path: Path, shown: str = "") -> IO[bytes]:
    """A file open for reading.

    Args:
        path: The file.
        shown: Its name as a person knows it; empty: the path.

    Raises:
        DatasetFormatError: It is a pipe, a device, a socket or a folder.
        OSError: It cannot be opened.
    """
    file = open(path, "rb", opener=_open_without_blocking)  # noqa: SIM115 - who asked closes it
    if stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        return file
    file.close()
    raise DatasetFormatError(shown or str(path), None, None, "is not a regular file")


def _open_without_blocking(path: str, flags: int) -> int:
    return os.open(path, flags | os.O_NONBLOCK)


def read_regular_file(path: Path, limit: int = MAX_BYTES) -> bytes:
    """The whole content of a file that somebody named.

    Raises:
        DatasetFormatError: It cannot be read, is not a regular file, or is longer than the limit.
    """
    try:
        with open_regular_file(path) as file:
            content = file.read(limit + 1)
    except OSError as error:
        problem = f"cannot be read ({error.strerror})"
        raise DatasetFormatError(str(path), None, None, problem) from error
    if len(content) > limit:
        raise DatasetFormatError(str(path), None, None, f"is longer than {limit:,} bytes")
    return content
