"""Import in a child: files of somebody else are parsed where they can take nobody down.

The child reads the files and writes the database in the short transactions that an import has
anyway. It takes its turn among the writers of this process, so that edits do not wait longer than
they would for a thread.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, closing
from dataclasses import dataclass
from typing import Any, Literal

from app.child import Allowance, Child, ChildEnded
from app.child_figures import FIGURES
from app.config import Settings
from app.errors import DamagedError, TooLargeError
from app.progress import TellProgress
from app.review.importing.sources import Source, import_source
from app.soccer.policy import Policy
from app.store.store import Store

SILENCE = 900.0
"""Seconds in which an import must have read its next batch of groups."""
LIMITS_HINT = (
    "Import it in parts, or have the operator raise TOUCHLINE_IMPORT_MEMORY or "
    "TOUCHLINE_IMPORT_SECONDS. What was imported before it ended stays, and is not brought twice."
)

Word = Literal["take", "give"] | tuple[int, int | None, str]
"""What the child says: that it wants to write, that it has written, or how far it is."""
Tell = Callable[[Word], None]


@dataclass(frozen=True)
class Outcome:
    """What an import came to.

    Attributes:
        values: The report, as plain values.
        fresh: Whether there is something new to solve.
        nothing: Why nothing was read, with what to do about it; None where something was.
    """

    values: dict[str, Any]
    fresh: bool
    nothing: tuple[str, str] | None


def import_apart(
    store: Store,
    dataset: str,
    source: Source,
    *,
    actor: str,
    dry_run: bool,
    progress: TellProgress,
    stop: Callable[[], None],
    policy: Policy | None = None,
) -> Outcome:
    """``import_source`` in a process with limits.

    Args:
        store: The database.
        dataset: Name.
        source: What to read, and how.
        actor: Who imports.
        dry_run: Say what would happen, and keep nothing.
        progress: Called with the number of groups done; what it raises ends the import.
        stop: Called every now and then; what it raises ends the import.
        policy: Of a dataset that is made; None: as its first pictures suggest.

    Raises:
        DamagedError: The child met damage; no change is taken from then on, here either.
        TooLargeError: It went beyond the limits of the settings, or made the process crash.
    """
    settings = store.settings
    child = Child(Allowance(settings.import_memory, settings.import_seconds, SILENCE))
    with ExitStack() as turn, closing(child):

        def hear(word: Word) -> None:
            if word == "take":
                turn.enter_context(store.turn)
            elif word == "give":
                turn.close()
            else:
                progress(*word)

        try:
            given = (settings, dataset, source, actor, dry_run, policy)
            with FIGURES["imports"].working():
                outcome: Outcome = child.run(import_here, *given, heard=hear, stop=stop)
        except DamagedError as error:
            store.note_damage(error)
            raise
        except ChildEnded as error:
            raise TooLargeError(f"{source.label} {error}", hint=LIMITS_HINT) from error
    return outcome


def import_here(
    settings: Settings,
    dataset: str,
    source: Source,
    actor: str,
    dry_run: bool,
    policy: Policy | None,
    tell: Tell,
) -> Outcome:
    """The import itself, in this process."""

    def told(done: int, total: int | None = None, sentence: str = "", /) -> None:
        tell((done, total, sentence))

    with closing(Store.open(settings, _Turn(tell))) as store:
        imported = import_source(
            store, dataset, source, settings, told, actor=actor, dry_run=dry_run, policy=policy
        )
    result = imported.result
    nothing = None if imported.something else imported.nothing_read()
    return Outcome(imported.values(), bool(result.new + result.changed), nothing)


class _Turn:
    """The turn to write, which the parent has."""

    def __init__(self, tell: Tell):
        self._tell = tell

    def __enter__(self) -> None:
        self._tell("take")

    def __exit__(self, *_: object) -> None:
        self._tell("give")
