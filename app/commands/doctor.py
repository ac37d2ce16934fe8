"""The command that looks after the database: doctor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.opened import opened_store
from app.commands.options import Json, read_settings
from app.commands.terminal import print_json, say

if TYPE_CHECKING:
    from app.config import Settings
    from app.review.editing.check import Check

commands = typer.Typer()


@commands.command()
def doctor(
    rebuild: Annotated[
        bool,
        typer.Option("--rebuild", help="First write the tables anew from the log; no server runs."),
    ] = False,
    json_: Json = False,
) -> None:
    """Look whether home and database are whole: what the log tells of, and what was computed; 1 if not."""
    from app.review.editing.replay import rebuild as rebuild_tables
    from app.store.locks import server_lock

    settings = read_settings()
    if rebuild:
        with server_lock(settings), opened_store(settings) as store:
            rebuild_tables(store)
    checks = _examine(settings)
    if json_:
        print_json([vars(check) for check in checks])
    else:
        for check in checks:
            say(f"{'ok   ' if check.ok else 'FAULT'} {check.name:24} {check.sentence}")
            if check.mend:
                say(f"      {'':24} {check.mend}")
    if not all(check.ok for check in checks):
        raise typer.Exit(1)


def _examine(settings: Settings) -> list[Check]:
    """Everything; where the database cannot be opened, why, and what lies around it."""
    from app.errors import StorageError
    from app.review.editing.check import Check
    from app.review.editing.doctor import examine
    from app.review.editing.home_check import examine_home, examine_surroundings
    from app.review.talk.thread_check import examine_threads
    from app.review.versions.version_check import examine_versions
    from app.review.yields.soundness import examine_yields
    from app.store.home import make_home

    make_home(settings)
    checks = [*examine_home(settings), examine_yields(settings)]
    try:
        with opened_store(settings) as store:
            checks += [*examine_surroundings(store), *examine(store)]
            return [*checks, examine_threads(store), *examine_versions(store)]
    except StorageError as error:
        return [*checks, Check("database", False, error.message, error.hint)]
