"""Commands that run the service: serve it, and bring its database up to date."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.opened import process_pool
from app.commands.options import read_settings, require_local
from app.commands.sample import ensure_sample
from app.commands.terminal import log_to_stderr, say

if TYPE_CHECKING:
    from app.config import Settings

commands = typer.Typer()

QUICK_BYTES = 256 * 2**20
"""A database up to this size is looked through before it is served (about a second), a larger one
while it is."""


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
    from app.store.locks import server_lock

    with server_lock(settings):
        _prepare(settings)
        if with_sample:
            ensure_sample(settings)
        with listen(settings.host, settings.port) as (socket, address):
            # One processor is left for the requests.
            workers = max(1, settings.workers - 1)
            application = create_app(settings, pool=lambda: process_pool(workers))
            if settings.database_file.stat().st_size <= QUICK_BYTES:
                application.state.services.store.require_whole()
            say(f"Touchline is at {address}")
            run(application, socket)


@commands.command()
def migrate() -> None:
    """Bring the database to this version's schema, after a backup; no server may run."""
    from app.store.locks import server_lock
    from app.store.migrate import migrate as run_migrations

    settings = read_settings()
    with server_lock(settings):
        migrated = run_migrations(settings)
    if migrated.copy is not None:
        say(f"backup {migrated.copy}")
    say(f"schema {migrated.revision}")


def _prepare(settings: Settings) -> None:
    """Make the home private and its database the present one; the log says what was changed."""
    import structlog

    from app.store.home import make_private
    from app.store.migrate import migrate as run_migrations

    log = structlog.get_logger("touchline")
    mended = make_private(settings)
    if mended:
        log.warning("others could read the home; now its owner alone can", files=mended)
    migrated = run_migrations(settings)
    if migrated.copy is not None:
        log.info("schema migrated", schema=migrated.revision, backup=str(migrated.copy))
