"""The command line with all its commands: the place where everything is put together.

A command (``app.features.<resource>.commands``) parses, calls one function of a floor below, prints a table or JSON
and returns an exit code: 0 done, 1 it could not be done, 2 it was asked for in a wrong way.
Progress and complaints go to stderr. Heavy modules are imported inside the commands, so that
``--help`` is quick.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from app import serve as service
from app.errors import NotFoundError, ReviewError
from app.features.batches import commands as batches
from app.features.datasets import commands as datasets
from app.features.exports import commands as exports
from app.features.file_tools import commands as file_tools
from app.features.integrity import commands as integrity
from app.features.maintenance import commands as maintenance
from app.features.match_estimates import commands as match_estimates
from app.features.paint import commands as paint
from app.features.people import commands as people
from app.features.policies import commands as policies
from app.features.practice import commands as practice
from app.features.predictions import commands as predictions
from app.features.solve import commands as solve
from app.features.tracks import commands as tracks
from app.features.verdicts import commands as verdicts
from app.features.versions import commands as versions
from app.json_text import quote_text
from app.terminal.options import set_current_actor
from app.terminal.server import set_current_server
from app.terminal.terminal import escape_controls, escape_unencodable_output, print_error
from app.workers import commands as cluster

READER_GONE = 141
"""Exit code of a command whose reader has gone, as shells have it."""
YOUNG = 50_000
"""New objects before the collector looks at them: what libraries bring is there to stay, and to walk
through it again and again is a sixth of a start."""

SHOWN = 200
"""Letters of a name in a complaint that it is too long, or no text."""


class _EscapingCommandGroup(typer.core.TyperGroup):
    """Commands whose complaints about what was typed do not steer a terminal with it."""

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            # What its parser of choices raised, without the words that tell it from other errors.
            error.message = escape_controls(error.message.removeprefix("Value error, "))
            raise


app = typer.Typer(
    name="touchline",
    cls=_EscapingCommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
for part in (
    service,
    practice,
    exports,
    solve,
    verdicts,
    file_tools,
    paint,
    match_estimates,
    versions,
    predictions,
    predictions,
    integrity,
    maintenance,
    tracks,
    cluster,
):
    app.add_typer(part.commands)
app.add_typer(datasets.commands, name="datasets")
app.add_typer(batches.commands, name="batch")
app.add_typer(policies.commands, name="policy")
app.add_typer(people.commands, name="users")


def _print_version(wanted: bool) -> None:
    if wanted:
        from app.formats.manifest import SOFTWARE, read_software_version

        typer.echo(f"{SOFTWARE} {read_software_version()}")
        raise typer.Exit


@app.callback()
def options(
    context: typer.Context,
    actor: Annotated[
        str | None,
        typer.Option(
            envvar="TOUCHLINE_ACTOR",
            metavar="NAME",
            help="What this script calls itself; history and verdicts name it as script:NAME.",
        ),
    ] = None,
    server: Annotated[
        str | None,
        typer.Option(
            envvar="TOUCHLINE_SERVER",
            metavar="URL",
            help="Work against this server instead of a home on this machine, where a command can.",
        ),
    ] = None,
    token_file: Annotated[
        Path | None,
        typer.Option(
            envvar="TOUCHLINE_TOKEN_FILE",
            help="File with a token of a team's server, that you alone can read.",
        ),
    ] = None,
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Tell the version and end.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Turn multi-view soccer frames into a trusted 3D ball dataset."""
    set_current_actor(actor)
    set_current_server(server, token_file, context.invoked_subcommand)
    if server is not None and token_file is not None and actor is not None:
        raise typer.BadParameter(
            "the log names the person of the token; leave it out", param_hint="--actor"
        )


def run() -> None:
    """Carry out a command line: what a caller can cause is one sentence on stderr and exit code 1."""
    escape_unencodable_output()
    gc.set_threshold(YOUNG)
    try:
        app()
    except SystemExit as end:
        # Whoever reads, such as head, has seen enough.
        if isinstance(end.__context__, BrokenPipeError):
            sys.exit(READER_GONE)
        raise
    except ReviewError as error:
        near = error.suggest_nearest_name() if isinstance(error, NotFoundError) else None
        print_error(error.message, error.hint or near)
        sys.exit(1)
    except OSError as error:
        if error.filename is None:
            raise
        name = quote_text(str(error.filename), SHOWN)
        if isinstance(error, PermissionError):
            print_error(
                f"this user has no permission to use {name}",
                "Give this user access (chmod, chown), or run the command as another user.",
            )
        else:
            print_error(f"{name} cannot be used: {error.strerror}")
        sys.exit(1)
    except UnicodeEncodeError as error:
        # What stands for bytes of the command line that are no UTF-8.
        if "surrogates" not in error.reason:
            raise
        print_error(f"{quote_text(error.object, SHOWN)} contains bytes that are not UTF-8 text")
        sys.exit(1)
    except RuntimeError as error:
        # numba's words when it finds no folder to write to; it has no class of its own for them.
        if "cannot cache function" not in str(error):
            raise
        print_error(
            "this user cannot write to any folder in which the compiled solver can be cached"
            " (neither to the installation nor to the user's own cache)",
            "Set NUMBA_CACHE_DIR to a folder that only this user can write to.",
        )
        sys.exit(1)
