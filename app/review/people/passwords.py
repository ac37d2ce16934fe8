"""Passwords: what one must be, its hash, and whether a password belongs to it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from threading import BoundedSemaphore
from typing import TypeVar

from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.errors import InputError, OverloadedError

SHORTEST, LONGEST = 10, 200
"""Letters of a password. Length is what makes it hard to guess; no kinds of letters are asked for."""
MOST_GUESSED = 40
"""Letters that are looked at. Longer texts of signs that stand for letters keep the library busy for seconds."""
T = TypeVar("T")

HASHER = PasswordHash((Argon2Hasher(),))
AT_A_TIME = 2
"""Hashes at a time: each takes 64 MB of memory, and some tenths of a second."""
PATIENCE = 10.0
"""Seconds that one waits for its turn."""
_turns = BoundedSemaphore(AT_A_TIME)


def hash_password(password: str, name: str, *, pointer: str = "/password") -> str:
    """The argon2 hash of a new password.

    Raises:
        InputError: It is too short, too long, the name itself, or easy to guess.
    """
    if not SHORTEST <= len(password) <= LONGEST:
        raise InputError(
            f"a password has {SHORTEST} to {LONGEST} letters",
            hint="Three or four words that nobody would put together are easy to keep in mind.",
            pointer=pointer,
        )
    if password.casefold() == name.casefold():
        raise InputError("a password is not the name itself", pointer=pointer)
    if _in_turn(lambda: _is_easy_to_guess(password, name)):
        raise InputError(
            "this password is easy to guess: it is one of the common ones, or made of few parts",
            hint="Three or four words that nobody would put together are easy to keep in mind.",
            pointer=pointer,
        )
    return _in_turn(lambda: HASHER.hash(password))


def _is_easy_to_guess(password: str, name: str) -> bool:
    """Whether a million guesses find a password, by lists of common passwords, words and patterns."""
    # Its lists take some tenths of a second to load, and few requests need them.
    from zxcvbn import zxcvbn

    found = zxcvbn(password[:MOST_GUESSED], user_inputs=[name, "touchline"])
    return bool(found["score"] < 2)


def is_password(password: str, known: str | None) -> bool:
    """Whether a password belongs to a hash; without one it takes as long, and is not."""
    fits = _in_turn(lambda: HASHER.verify(password[:LONGEST], known or _nobodys()))
    return fits and known is not None and len(password) <= LONGEST


@cache
def _nobodys() -> str:
    """A hash that no password is known of, which is asked where there is no account."""
    return HASHER.hash("nobody's password, as long as others")


def _in_turn(work: Callable[[], T]) -> T:
    if not _turns.acquire(timeout=PATIENCE):
        raise OverloadedError("too many people log in at this moment", hint="Try again in a while.")
    try:
        return work()
    finally:
        _turns.release()
