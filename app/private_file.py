"""Private file: what its owner alone may read, such as a secret that operators give to the service."""

from __future__ import annotations

import os
import stat
from pathlib import Path

from app.errors import InputError


def read_private(path: Path, variable: str) -> str:
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
                f"other users can read {path}, which {variable} names",
                hint=f"chmod 600 {path}",
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


def keep_private() -> None:
    """From now on this process makes no file that others than its owner may read."""
    os.umask(0o077)
