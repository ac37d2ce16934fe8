"""Commands that look after a home: doctor, backup, restore, transfer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.terminal.options import Json, read_settings
from app.terminal.server import open_store, require_no_server
from app.terminal.terminal import print_error, print_json, say
from app.wording import plural

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
    from app.db.dialects.dialect import get_dialect
    from app.db.locks import hold_server_lock
    from app.db.recovery.preopen_check import require_database
    from app.features.groups.replay import rebuild_tables
    from app.features.integrity.checks import examine_everything

    settings = read_settings()
    if get_dialect(settings).is_file:
        require_database(settings, "Set TOUCHLINE_HOME to the home folder of an installation.")
    if rebuild:
        with hold_server_lock(settings), open_store(settings) as store:
            for sentence in rebuild_tables(store):
                print_error(sentence)
    require_no_server()
    checks = examine_everything(settings)
    if json_:
        # `mend` is the earlier name of `advice`; scripts may read it.
        print_json([{**vars(check), "mend": check.advice} for check in checks])
    else:
        for check in checks:
            say(f"{'ok   ' if check.ok else 'FAULT'} {check.name:24} {check.sentence}")
            if check.advice:
                say(f"      {'':24} {check.advice}")
    if not all(check.ok for check in checks):
        raise typer.Exit(1)


@commands.command()
def backup(
    out: Annotated[Path, typer.Argument(help="A zip that does not exist yet.")],
    with_frames: Annotated[
        bool,
        typer.Option(
            "--with-frames",
            help="Uploads, frames of recordings, sample and practice frames in the home, too.",
        ),
    ] = False,
    with_exports: Annotated[
        bool, typer.Option("--with-exports", help="Exports made over REST, too.")
    ] = False,
    json_: Json = False,
) -> None:
    """Copy the database of the home, beside a running server; the copy is read again and compared.

    Frames are read where they are: those outside the home are in no backup.
    """
    from app.db.backup import EXPORTS, FRAMES, back_up_home

    folders = (*(FRAMES if with_frames else ()), *(EXPORTS if with_exports else ()))
    manifest = back_up_home(read_settings(), out, folders)
    if json_:
        print_json({"out": str(out), **vars(manifest)})
        return
    size = out.stat().st_size / 1e6
    say(f"{out} ({size:,.1f} MB) is written and verified")
    say(
        f"  {_describe_contents(manifest.entries, manifest.rows)}, {plural(len(manifest.files) - 1, 'file')}"
    )
    if manifest.frames_elsewhere:
        say(
            f"  {plural(manifest.frames_elsewhere, 'file')} with frames left out; they stay as they are"
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
    replace_null: Annotated[
        bool,
        typer.Option("--replace-null", help="Write U+FFFD where texts of FROM hold U+0000."),
    ] = False,
    json_: Json = False,
) -> None:
    """Copy a whole database between SQLite and PostgreSQL, and compare every row and the log.

    No server may run. A transfer that was stopped goes on when it is given again. Files of the home
    (uploads, exports) stay where they are. Everybody on the machine can read what is typed here: an
    address with a password stands in a file, or the password in ~/.pgpass.
    """
    from app.features.integrity.transfer import make_settings_of_both_databases
    from app.features.integrity.transfer import transfer_database as run_transfer

    settings = read_settings()
    printed: set[str] = set()

    def print_copied_table(table: str, _rows: int) -> None:
        if table not in printed and not json_:
            say(f"  {table}")
        printed.add(table)

    done = run_transfer(
        *make_settings_of_both_databases(source, target, settings),
        print_copied_table,
        replace_null=replace_null,
    )
    if json_:
        print_json(vars(done))
        return
    say(
        f"{_describe_contents(done.entries, done.rows)} are equal in both; {done.copied:,} rows were copied"
    )
    for name, digest in done.versions.items():
        say(f"  version {name} {digest[:12]}")


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
    from app.db.restore import restore_database as run_restore

    restored = run_restore(read_settings(home=home), source)
    if json_:
        values = {name: str(v) if isinstance(v, Path) else v for name, v in vars(restored).items()}
        print_json(values)
        return
    say(f"{restored.home} is restored from {source}")
    say(
        f"  {_describe_contents(restored.entries, restored.rows)}, {plural(restored.files, 'file')}"
    )
    if restored.foreign_log:
        say("  the write-ahead log beside it was another database's, and is left out")
    if restored.aside is not None:
        say(f"  what was there is in {restored.aside}")
    say(
        "  touchline doctor compares with the log what follows from it, and reads what was computed"
    )


def _describe_contents(entries: int, rows: dict[str, int]) -> str:
    groups, verdicts = rows.get("groups", 0), rows.get("verdict", 0)
    return f"{plural(entries, 'entry', 'entries')} of the log, {plural(groups, 'group')}, {plural(verdicts, 'verdict')}"
