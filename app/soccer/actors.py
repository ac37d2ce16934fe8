"""Actors: under which name history, verdicts and jobs remember who did it."""

from __future__ import annotations

import re

from app.errors import InputError

LOCAL_USER = "local"
"""Who acts in single-user mode."""
SCRIPT = "script:"
"""How the name of a script begins, so that none passes for a person."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._@+-]{0,59}")


def script_name(said: str, *, pointer: str | None = None) -> str:
    """The name under which a script acts.

    Example:
        >>> script_name("nightly import"), script_name("script:nightly")
        ('script:nightly import', 'script:nightly')

    Raises:
        InputError: It cannot be a name.
    """
    name = said.strip().removeprefix(SCRIPT)
    if not _NAME.fullmatch(name):
        raise InputError(
            "the name of a script is up to 60 letters, digits, spaces and . _ @ + -",
            pointer=pointer,
        )
    return f"{SCRIPT}{name}"
