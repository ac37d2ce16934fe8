"""Sharing: what processes with one database say to each other and leave to one of them.

A claim ends with the process that holds it, however that ends. A word is heard by whoever listens
at that moment, and by nobody later: who acts on it looks into the database, and looks again when the
line was broken.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from app.store.session import Session

Hearer = Callable[[str], None]
AGAIN = ""
"""The word that stands for all that may have been said while nobody could listen."""


class Sharing(Protocol):
    """What a process knows of the others.

    Attributes:
        is_shared: Whether other processes may serve the same database.
    """

    is_shared: bool

    def take(self, name: str) -> bool:
        """Claim something; False where another process, or this one, has it. Waits for nobody.

        Raises:
            StorageError: The database cannot be asked.
        """

    def holds(self, name: str) -> bool:
        """Whether a claim of this process still stands."""

    def give_back(self, name: str) -> None:
        """End a claim; one that is lost already is none."""

    def tell(self, session: Session, word: str) -> None:
        """Say a word to the others once a transaction is kept."""

    def hear(self, hearer: Hearer) -> None:
        """Call a function with what others say, once ``listen`` was called; it must be quick."""

    def listen(self) -> None:
        """Begin to listen, on a thread of its own."""

    def close(self) -> None:
        """End all claims, and stop listening."""


class Alone:
    """The one server of a database: everything is its own, and nobody listens."""

    is_shared = False

    def take(self, name: str) -> bool:
        """See ``Sharing``."""
        return True

    def holds(self, name: str) -> bool:
        """See ``Sharing``."""
        return True

    def give_back(self, name: str) -> None:
        """See ``Sharing``."""

    def tell(self, session: Session, word: str) -> None:
        """See ``Sharing``."""

    def hear(self, hearer: Hearer) -> None:
        """See ``Sharing``."""

    def listen(self) -> None:
        """See ``Sharing``."""

    def close(self) -> None:
        """See ``Sharing``."""
