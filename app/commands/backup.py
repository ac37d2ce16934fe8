"""Commands that copy a home and bring it back: backup, restore and transfer."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.options import Json, read_settings
from app.commands.terminal import print_json, say

if TYPE_CHECKING:
    from app.config import Settings

commands = typer.Typer()

_PASSWORD = re.compile(r"://[^:/@]*:[^@]*@|[?&]password=")
"""In the address of a database, as its driver reads it."""


@commands.command()
def backup(
    out: Annotated[Path, typer.Argument(help="A zip that does not exist yet.")],
    with_frames: Annotated[
        bool,
        typer.Option("--with-frames", help="Uploads, sample and practice frames in the home, too."),
    ] = False,
    with_exports: Annotated[
        bool, typer.Option("--with-exports", help="Exports made over REST, too.")
    ] = False,
    json_: Json = False,
) -> None:
    """Copy the database of the home, beside a running server; the copy is read again and compared.

    Frames are read where they are: those outside the home are in no backup.
    """
    from app.store.backup import EXPORTS, FRAMES, back_up

    folders = (*(FRAMES if with_frames else ()), *(EXPORTS if with_exports else ()))
    manifest = back_up(read_settings(), out, folders)
    if json_:
        print_json({"out": str(out), **vars(manifest)})
        return
    size = out.stat().st_size / 1e6
    say(f"{out} ({size:,.1f} MB) is written and verified")
    say(f"  {_contents(manifest.entries, manifest.rows)}, {len(manifest.files) - 1:,} files")
    if manifest.frames_elsewhere:
        say(
            f"  {manifest.frames_elsewhere:,} files with frames are not in it; they stay as they are"
        )


@commands.command()
def transfer(
    source: Annotated[
        str,
        typer.Argument(
            metavar="FROM",
            help="A home folder, postgresql://HOST/DATABASE, or a file of mode 0600 with such an "
            "address.",
        ),
    ],
    target: Annotated[
        str, typer.Argument(metavar="TO", help="The same: a new folder, or an empty database.")
    ],
    json_: Json = False,
) -> None:
    """Copy a whole database between SQLite and PostgreSQL, and compare every row and the log.

    No server may run. A transfer that was stopped goes on when it is given again. Files of the home
    (uploads, exports) stay where they are. Everybody on the machine can read what is typed here: an
    address with a password stands in a file, or the password in ~/.pgpass.
    """
    from app.store.transfer import transfer as run_transfer

    settings = read_settings()
    told: set[str] = set()

    def tell(table: str, _rows: int) -> None:
        if table not in told and not json_:
            say(f"  {table}")
        told.add(table)

    begin, address = _database(source, "FROM", settings), _address(target, "TO")
    # The files of a home that goes into a database stay in that home.
    end = _database(target, "TO", settings if address is None else begin)
    done = run_transfer(begin, end, tell)
    if json_:
        print_json(vars(done))
        return
    say(f"{_contents(done.entries, done.rows)} are equal in both; {done.copied:,} rows were copied")
    for name, digest in done.versions.items():
        say(f"  version {name} {digest[:12]}")


def _database(place: str, name: str, settings: Settings) -> Settings:
    """Settings of the database that an argument of some name gives."""
    address = _address(place, name)
    if address is not None:
        return settings.model_copy(update={"database_url": address})
    return settings.model_copy(update={"home": Path(place).absolute(), "database_url": None})


def _address(place: str, name: str) -> str | None:
    """The address that an argument is, or that the file holds which it names; None: it is a home.

    Raises:
        InputError: The address has a password that everybody could read, or others than its owner
            may use the file, or it holds no address.
    """
    from app.errors import InputError
    from app.private_file import read_private

    if "://" in place:
        if _PASSWORD.search(place):
            raise InputError(
                f"everybody on this machine can read the password in {name} while this runs",
                hint="Write the address into a file, chmod 600 it, and name that file instead.",
            )
        return place
    file = Path(place)
    if not file.is_file():
        return None
    address = read_private(file, name)
    if "://" not in address:
        raise InputError(
            f"{file} holds no address of a database",
            hint="Write postgresql://USER:PASSWORD@HOST/DATABASE into it, or name a home folder.",
        )
    return address


@commands.command()
def restore(
    source: Annotated[
        Path, typer.Argument(metavar="BACKUP", help="A zip of touchline backup, or a touchline.db.")
    ],
    home: Annotated[Path | None, typer.Option(help="Default: TOUCHLINE_HOME.")] = None,
    json_: Json = False,
) -> None:
    """Put a backup into the place of the home's database; what is there is moved aside, not deleted.

    The backup is verified first. No server may run.
    """
    from app.store.restore import restore as run_restore

    restored = run_restore(read_settings(home=home), source)
    if json_:
        values = {name: str(v) if isinstance(v, Path) else v for name, v in vars(restored).items()}
        print_json(values)
        return
    say(f"{restored.home} is restored from {source}")
    say(f"  {_contents(restored.entries, restored.rows)}, {restored.files:,} files")
    if restored.foreign_log:
        say("  the write-ahead log beside it was another database's, and is left out")
    if restored.aside is not None:
        say(f"  what was there is in {restored.aside}")
    say(
        "  touchline doctor compares with the log what follows from it, and reads what was computed"
    )


def _contents(entries: int, rows: dict[str, int]) -> str:
    groups, verdicts = rows.get("groups", 0), rows.get("verdict", 0)
    return f"{entries:,} entries of the log, {groups:,} groups, {verdicts:,} verdicts"
