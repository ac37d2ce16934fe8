"""Import in a child: files of somebody else are parsed where they can take nobody down.

The child reads the files and writes the database in the short transactions that an import has
anyway.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from app.child import Allowance, ChildEnded
from app.errors import TooLargeError
from app.progress import TellProgress
from app.review.importing.sources import Source, import_source
from app.soccer.policy import Policy
from app.store.child import SILENCE, work_apart
from app.store.store import Store

LIMITS_HINT = (
    "Import it in parts, or have the operator raise TOUCHLINE_IMPORT_MEMORY or "
    "TOUCHLINE_IMPORT_SECONDS. What was imported before it ended stays, and is not brought twice."
)


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
        dry_run: Dry run: report what would happen, change nothing.
        progress: Called with the number of groups done; what it raises ends the import.
        stop: Called every now and then; what it raises ends the import.
        policy: Of a dataset that is made; None: as its first pictures suggest.

    Raises:
        DamagedError: The child met damage; from then on nothing can be changed, here either.
        TooLargeError: It went beyond the limits of the settings, or made the process crash.
    """
    limits = store.settings
    try:
        return work_apart(
            store,
            "imports",
            import_here,
            dataset,
            source,
            actor,
            dry_run,
            policy,
            allowance=Allowance(limits.import_memory, limits.import_seconds, SILENCE),
            progress=progress,
            stop=stop,
        )
    except ChildEnded as error:
        raise TooLargeError(f"{source.label} {error}", hint=LIMITS_HINT) from error


def import_here(
    store: Store,
    dataset: str,
    source: Source,
    actor: str,
    dry_run: bool,
    policy: Policy | None,
    progress: TellProgress,
) -> Outcome:
    """The import itself, in this process."""
    imported = import_source(
        store,
        dataset,
        source,
        store.settings,
        progress,
        actor=actor,
        dry_run=dry_run,
        policy=policy,
    )
    result = imported.result
    nothing = None if imported.something else imported.nothing_read()
    return Outcome(imported.values(), bool(result.new + result.changed), nothing)
