"""The command that shows everybody a notice: maintenance."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

import typer

from app.terminal.options import Json, get_current_actor
from app.terminal.server import open_store
from app.terminal.terminal import print_values

commands = typer.Typer()
WHEN = "2030-01-31T18:00; without an offset in this machine's time."


@commands.command()
def maintenance(
    text: Annotated[
        str | None,
        typer.Argument(help=("The notice, one line; without it the present notice is printed.")),
    ] = None,
    starts: Annotated[
        str | None, typer.Option(metavar="TIME", help=f"Show it from then on: {WHEN}")
    ] = None,
    until: Annotated[
        str | None, typer.Option(metavar="TIME", help=f"Show it until then: {WHEN}")
    ] = None,
    clear: Annotated[bool, typer.Option("--clear", help="Take the notice away.")] = False,
    json_: Json = False,
) -> None:
    """Show a notice on every page of the browser application, also before people log in."""
    from app.features.maintenance.service import clear_banner, read_banner, set_banner

    if clear and (text or starts or until):
        raise typer.BadParameter("--clear removes the notice: leave out TEXT, --starts and --until")
    if text is None and (starts or until):
        raise typer.BadParameter("--starts and --until need TEXT")
    begin, end = _parse_time(starts, "--starts"), _parse_time(until, "--until")
    with open_store() as store:
        if clear:
            clear_banner(store, actor=get_current_actor())
        elif text is not None:
            set_banner(store, text, starts=begin, until=end, actor=get_current_actor())
        banner = read_banner(store)
    print_values(vars(banner) if banner else {"text": None}, json_)


def _parse_time(text: str | None, option: str) -> datetime | None:
    if text is None:
        return None
    try:
        return datetime.fromisoformat(text).astimezone()
    except (ValueError, OverflowError):
        raise typer.BadParameter(f'{option} "{text}" is not a time such as {WHEN}') from None
