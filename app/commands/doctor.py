"""The command that looks after the database: doctor."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.opened import opened_store
from app.commands.options import Json, read_settings
from app.commands.terminal import print_json, say

commands = typer.Typer()


@commands.command()
def doctor(
    rebuild: Annotated[
        bool,
        typer.Option("--rebuild", help="First write the tables anew from the log; no server runs."),
    ] = False,
    json_: Json = False,
) -> None:
    """Look whether the database is whole and its tables are what the log says; 1 if they are not."""
    from app.review.editing.doctor import examine
    from app.review.editing.replay import rebuild as rebuild_tables
    from app.store.locks import server_lock

    settings = read_settings()
    if rebuild:
        with server_lock(settings), opened_store(settings) as store:
            rebuild_tables(store)
    with opened_store(settings) as store:
        checks = examine(store)
    if json_:
        print_json([vars(check) for check in checks])
    else:
        for check in checks:
            say(f"{'ok   ' if check.ok else 'FAULT'} {check.name:24} {check.sentence}")
            if check.mend:
                say(f"      {'':24} {check.mend}")
    if not all(check.ok for check in checks):
        raise typer.Exit(1)
