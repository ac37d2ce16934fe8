"""Actors: under which name history, verdicts and jobs remember who did it."""

from __future__ import annotations

import re

from app.errors import InputError

LOCAL_USER = "local"
"""The actor in single-user mode."""
SCRIPT = "script:"
"""How the name of a script begins, so that none passes for a person."""
TOKEN = " (token "
"""What stands between the name of a person and that of their token."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 ._@+-]{0,59}")


def make_token_actor(name: str, token: str) -> str:
    """The name under which a script acts that asks with a person's token.

    Example:
        >>> make_token_actor("anna", "deploy")
        'anna (token deploy)'
    """
    return f"{name}{TOKEN}{token})"


def person_of_actor(actor: str) -> str:
    """The name of the person behind an actor; no name of a person has a bracket.

    Example:
        >>> person_of_actor("anna (token deploy)"), person_of_actor("anna")
        ('anna', 'anna')
    """
    return actor.partition(TOKEN)[0]


def is_actor_of(actor: str, name: str) -> bool:
    """Whether an actor is a person of that name, one of their tokens, or that very token.

    Example:
        >>> is_actor_of("anna (token deploy)", "anna"), is_actor_of("anna", "anna (token deploy)")
        (True, False)
    """
    return name in (actor, person_of_actor(actor))


def parse_script_name(text: str, *, pointer: str | None = None) -> str:
    """The name under which a script acts.

    Example:
        >>> parse_script_name("nightly import"), parse_script_name("script:nightly")
        ('script:nightly import', 'script:nightly')

    Raises:
        InputError: It cannot be a name.
    """
    name = text.strip().removeprefix(SCRIPT)
    if not _NAME.fullmatch(name):
        raise InputError(
            "the name of a script is up to 60 letters, digits, spaces and . _ @ + -",
            pointer=pointer,
        )
    return f"{SCRIPT}{name}"
