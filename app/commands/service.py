"""Commands that run the service: serve it, and bring its database up to date."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.opened import opened_store, process_pool
from app.commands.options import acting, read_settings, require_safe
from app.commands.sample import ensure_sample
from app.commands.terminal import log_to_stderr, say

if TYPE_CHECKING:
    from app.config import Settings
    from app.store.session import Store

commands = typer.Typer()

QUICK_BYTES = 256 * 2**20
"""A database up to this size is looked through before it is served (about a second), a larger one
while it is."""


@commands.command()
def serve(
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(min=0, max=65535, help="0: any free one.")] = None,
    team: Annotated[
        bool | None,
        typer.Option(
            "--team/--alone",
            help="Ask everybody who they are, or nobody. Default: alone, unless TOUCHLINE_TEAM is set.",
        ),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option(help="The address that people open, where a proxy stands in front."),
    ] = None,
    with_sample: Annotated[
        bool, typer.Option("--sample", help="Make the dataset sample first, where it is missing.")
    ] = False,
) -> None:
    """Serve the browser application and the REST interface."""
    settings = read_settings(host=host, port=port, team=team, url=url)
    require_safe(settings)
    log_to_stderr()
    from app.api.application import create_app
    from app.api.server import listen, run
    from app.store.locks import server_lock

    with server_lock(settings):
        _prepare(settings)
        if not settings.team and team is None:
            _require_no_team(settings)
        if with_sample:
            ensure_sample(settings)
        with listen(settings.host, settings.port) as (socket, address):
            # One processor is left for the requests.
            workers = max(1, settings.workers - 1)
            application = create_app(settings, pool=lambda: process_pool(workers))
            if settings.database_file.stat().st_size <= QUICK_BYTES:
                application.state.services.store.require_whole()
            say(f"Touchline is at {address}")
            if settings.team:
                _say_first_link(application.state.services.store, settings.url or address)
            run(application, socket)


def _require_no_team(settings: Settings) -> None:
    """Refuse to let everybody in where people have accounts."""
    from app.errors import InputError
    from app.review.people.people import has_people

    with opened_store(settings) as store:
        if has_people(store):
            raise InputError(
                "people have accounts here: without --team nobody would be asked who they are",
                hint="Serve with --team; or with --alone, if only you can reach this machine.",
            )


def _say_first_link(store: Store, base: str) -> None:
    """Show whoever starts a server without an admin how to become one."""
    from app.review.people.links import FIRST_LASTS, make_first_link

    link = make_first_link(store, actor=acting())
    if link is not None:
        hours = int(FIRST_LASTS.total_seconds() // 3600)
        say(f"No admin can log in yet. Become one here (good once, for {hours} hours):")
        say(link.address(base))


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
