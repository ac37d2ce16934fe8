"""Commands that run the service: serve it, and bring its database up to date."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from app.terminal.options import Cluster, get_current_actor, read_settings
from app.terminal.server import open_store
from app.terminal.terminal import say, show_progress

if TYPE_CHECKING:
    from socket import socket

    from app.config import Settings
    from app.db.store import Store

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
            help="Require a login, or do not. Default: no login, unless TOUCHLINE_TEAM is set.",
        ),
    ] = None,
    url: Annotated[
        str | None,
        typer.Option(help="The address that people open, where a proxy stands in front."),
    ] = None,
    cluster: Cluster = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=64,
            help="Processes that answer requests, on PostgreSQL. Default: one.",
        ),
    ] = None,
    with_sample: Annotated[
        bool, typer.Option("--sample", help="Make the dataset sample first, where it is missing.")
    ] = False,
) -> None:
    """Serve the browser application and the REST interface."""
    settings = read_settings(
        host=host, port=port, team=team, url=url, cluster=cluster, web_workers=workers
    )
    _require_safe_settings(settings)
    from app.db.dialects.dialect import get_dialect, require_multiprocess_support
    from app.db.locks import hold_server_lock
    from app.features.maintenance.upkeep import read_database_file_sizes
    from app.features.people.service import require_no_people
    from app.http.server import open_listening_socket, serve_application, serve_with_processes
    from app.log import log_to_stderr
    from app.main import create_app
    from app.workers.executors import make_server_pool_opener

    require_multiprocess_support(settings, settings.web_workers)
    log_to_stderr(settings.log_format)
    with hold_server_lock(settings, shared=not get_dialect(settings).is_file) as tell_address:
        _prepare_home(settings)
        if not settings.team and team is None:
            with open_store(settings, may_create=True) as store:
                require_no_people(store)
        if with_sample:
            # A port that is taken is refused before minutes of work.
            with open_listening_socket(settings.host, settings.port):
                pass
            _make_sample(settings)
        with open_listening_socket(settings.host, settings.port) as (socket, address):
            tell_address(settings.url or address)
            if settings.web_workers > 1:
                _print_address(settings, address)
                serve_with_processes(settings.web_workers, _serve_process, settings, socket)
                return
            application = create_app(settings, pool=make_server_pool_opener(settings))
            if read_database_file_sizes(settings).get("database", 0) <= QUICK_BYTES:
                application.state.services.store.require_intact_database()
            say(f"Touchline is at {address}")
            if settings.team:
                _print_first_admin_link(application.state.services.store, settings.url or address)
            serve_application(application, socket)


def _require_safe_settings(settings: Settings) -> None:
    """Refuse to serve where strangers could come in, or passwords would be read on their way."""
    from app.features.maintenance.service import find_exposure_warning
    from app.features.people.sign_on_rules import read_rules
    from app.features.webhooks.sender import require_valid_setting
    from app.mail import read_mail_server

    read_rules(settings)
    require_valid_setting(settings)
    read_mail_server(settings)
    problem = find_exposure_warning(settings)
    if problem is not None:
        raise typer.BadParameter(problem)


def _make_sample(settings: Settings) -> None:
    """The dataset ``sample``, where it is missing or not complete."""
    from app.features.practice.service import SAMPLE, make_sample_dataset
    from app.sample import SampleOrder
    from app.workers.executors import open_executor

    folder, pool = settings.home / SAMPLE, partial(open_executor, settings)
    with (
        open_store(settings, may_create=True) as store,
        show_progress("Making the sample") as progress,
    ):
        make_sample_dataset(
            store, SAMPLE, folder, SampleOrder(), pool, progress, actor=get_current_actor()
        )


def _serve_process(settings: Settings, socket: socket) -> None:
    """Serve in one process of several."""
    from app.http.server import serve_application
    from app.log import log_to_stderr
    from app.main import create_app
    from app.workers.executors import make_server_pool_opener

    log_to_stderr(settings.log_format)
    serve_application(create_app(settings, pool=make_server_pool_opener(settings)), socket)


def _print_address(settings: Settings, address: str) -> None:
    say(f"Touchline is at {address}")
    if settings.team:
        with open_store(settings, may_create=True) as store:
            _print_first_admin_link(store, settings.url or address)


def _print_first_admin_link(store: Store, base: str) -> None:
    """Show whoever starts a server without an admin how to become one."""
    from app.features.people.links import FIRST_LASTS, make_first_admin_link

    link = make_first_admin_link(store, actor=get_current_actor())
    if link is not None:
        hours = int(FIRST_LASTS.total_seconds() // 3600)
        say(f"No admin can log in yet. Become one here (good once, for {hours} hours):")
        say(link.address(base))


@commands.command()
def migrate() -> None:
    """Bring the database to this version's schema, after a backup; no server may run."""
    from app.db.locks import hold_server_lock
    from app.db.migrate import migrate_database as run_migrations

    settings = read_settings()
    with hold_server_lock(settings):
        migrated = run_migrations(settings)
    if migrated.copy is not None:
        say(f"backup {migrated.copy}")
    say(f"schema {migrated.revision}")


def _prepare_home(settings: Settings) -> None:
    """Make the home private and its database the present one; the log says what was changed."""
    import structlog

    from app.db.home import make_home_private
    from app.db.migrate import migrate_database as run_migrations

    log = structlog.get_logger("touchline")
    mended = make_home_private(settings)
    if mended:
        log.warning("others could read the home; now its owner alone can", files=mended)
    migrated = run_migrations(settings)
    if migrated.copy is not None:
        log.info("schema migrated", schema=migrated.revision, backup=str(migrated.copy))
