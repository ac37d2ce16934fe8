"""The command that looks after the database: doctor."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.opened import opened_store
from app.commands.options import Json, read_settings
from app.commands.server import require_home
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
    """Look whether home and database are whole: what the log tells of, and what was computed; 1 if not."""
    from app.review.editing.replay import rebuild as rebuild_tables
    from app.review.jobs.examination import examine_everything
    from app.store.locks import server_lock

    settings = read_settings()
    if rebuild:
        with server_lock(settings), opened_store(settings) as store:
            rebuild_tables(store)
    require_home()
    checks = examine_everything(settings)
    if json_:
        print_json([vars(check) for check in checks])
    else:
        for check in checks:
            say(f"{'ok   ' if check.ok else 'FAULT'} {check.name:24} {check.sentence}")
            if check.mend:
                say(f"      {'':24} {check.mend}")
    if not all(check.ok for check in checks):
        raise typer.Exit(1)
