"""Commands that run the service: serve it, and bring its database up to date."""

from __future__ import annotations

from typing import Annotated

import typer

from app.commands.opened import process_pool
from app.commands.options import read_settings, require_local
from app.commands.sample import ensure_sample
from app.commands.terminal import log_to_stderr, say

commands = typer.Typer()


@commands.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="0: any free one.")] = None,
    with_sample: Annotated[
        bool, typer.Option("--sample", help="Make the dataset sample first, where it is missing.")
    ] = False,
) -> None:
    """Serve the browser application and the REST interface."""
    settings = read_settings(host=host, port=port)
    require_local(settings)
    log_to_stderr()
    from app.api.application import create_app
    from app.api.server import listen, run
    from app.store.home import server_lock
    from app.store.migrate import migrate as run_migrations

    with server_lock(settings):
        run_migrations(settings)
        if with_sample:
            ensure_sample(settings)
        with listen(settings.host, settings.port) as (socket, address):
            # One processor is left for the requests.
            workers = max(1, settings.workers - 1)
            application = create_app(settings, pool=lambda: process_pool(workers))
            say(f"Touchline is at {address}")
            run(application, socket)


@commands.command()
def migrate() -> None:
    """Bring the database to this version's schema."""
    from app.store.migrate import migrate as run_migrations

    say(f"schema {run_migrations(read_settings())}")
