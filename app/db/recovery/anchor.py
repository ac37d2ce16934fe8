"""The anchor: what the home knows of its database, in a file beside it.

A log whose end is cut off has a hash chain without a flaw, and an empty database looks like a new
one. The anchor says otherwise: which installation the database is, and how long its log was.

It is written after each commit that says something, in place and without waiting for the disk
(5 microseconds beside a commit's milliseconds): an anchor that a power cut left behind knows less
than the log and is right all the same. It waits for the disk when it is made and when the store is
closed. It fills one sector, so that no power cut leaves half of it.
"""

from __future__ import annotations

import json
import os
import time
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from sqlalchemy import Connection, Engine, inspect, text

from app.config import Settings
from app.db.dialects.dialect import get_dialect
from app.durable import replace_file, sync_to_disk
from app.errors import DamagedError
from app.json_text import json_text

ANCHOR_BYTES = 512
AGAIN_SECONDS = 0.01
"""A reader beside a writer may see half of an anchor: after so long it is read once more."""
RESTORE = "Run touchline restore BACKUP, or touchline restore {file} to continue with the content of that file."
RESTORE_SERVER = (
    "Let TOUCHLINE_DATABASE_URL name the database of this home, or restore it with pg_restore."
)
OLDER_DUMP = (
    "After pg_restore of an older dump this is expected: move home.json away and start again."
    " Otherwise restore the newest dump."
)
"""Where the log of a server's database is shorter than its home recorded."""


@dataclass(frozen=True)
class DatabaseAnchor:
    """What the home knows of its database.

    Attributes:
        installation: Id of the installation; also in the database.
        created: When that began.
        schema: Revision of the schema.
        entries: How many entries the log has at least.
        hash: Of the last of them.
    """

    installation: str
    created: str
    schema: str
    entries: int
    hash: str

    def to_bytes(self) -> bytes:
        """As JSON, filled up with spaces to one sector."""
        return json_text(asdict(self)).encode().ljust(ANCHOR_BYTES - 1) + b"\n"


def find_anchor_file(database: Path) -> Path:
    """Where the anchor of a database is."""
    return database.with_name("home.json")


def read_anchor(database: Path) -> DatabaseAnchor | None:
    """The anchor of a database, or None where there is none.

    Raises:
        DamagedError: The file is not one of ours.
    """
    with suppress(DamagedError):
        return _read_anchor_file(database)
    time.sleep(AGAIN_SECONDS)
    return _read_anchor_file(database)


def _read_anchor_file(database: Path) -> DatabaseAnchor | None:
    path = find_anchor_file(database)
    try:
        return DatabaseAnchor(**json.loads(path.read_bytes()))
    except FileNotFoundError:
        return None
    except (ValueError, TypeError) as error:
        raise DamagedError(
            f"{path} is damaged: it does not contain the recorded state of the database",
            hint=RESTORE.format(file=database),
        ) from error


def write_anchor(database: Path, anchor: DatabaseAnchor) -> None:
    """Write an anchor so that it is there after a power cut."""
    replace_file(find_anchor_file(database), anchor.to_bytes())


def overwrite_anchor(database: Path, anchor: DatabaseAnchor) -> None:
    """Write an anchor over the one that is there; one that was taken away stays away."""
    try:
        handle = os.open(find_anchor_file(database), os.O_WRONLY)
    except FileNotFoundError:
        return
    try:
        os.pwrite(handle, anchor.to_bytes(), 0)
    finally:
        os.close(handle)


def flush_anchor_to_disk(database: Path) -> None:
    """Wait until the anchor is on the disk."""
    with suppress(FileNotFoundError):
        sync_to_disk(find_anchor_file(database))


def compute_anchor_from_database(connection: Connection) -> DatabaseAnchor | None:
    """The anchor that a database should have; None before it had an installation id."""
    tables = inspect(connection).get_table_names()
    if "installation" not in tables:
        return None
    key, created, schema, entries, last = connection.execute(
        text(
            "SELECT installation.key, created, version_num, coalesce(log.id, 0), log.hash"
            " FROM installation CROSS JOIN alembic_version"
            " LEFT JOIN log ON log.id = (SELECT max(id) FROM log)"
        )
    ).one()
    return DatabaseAnchor(key, created, schema, entries, last or "")


def require_own_database(engine: Engine, settings: Settings) -> None:
    """Raise DamagedError where a database is not the one that its home had."""
    with suppress(DamagedError):
        _require_matching_database(engine, settings)
        return
    time.sleep(AGAIN_SECONDS)
    _require_matching_database(engine, settings)


def _require_matching_database(engine: Engine, settings: Settings) -> None:
    anchor = read_anchor(settings.database_file)
    if anchor is not None:
        with engine.connect() as connection:
            if get_dialect(settings).is_file:
                file = settings.database_file
                _require_matches_anchor(connection, anchor, str(file), RESTORE.format(file=file))
            else:
                _require_matches_anchor(connection, anchor, settings.database_name, RESTORE_SERVER)


def renew_anchor(engine: Engine, settings: Settings, *, alone: bool) -> None:
    """Write the anchor of a database that is in order, where it says anything else.

    Beside others (not ``alone``) the length of the log is left to whoever writes it.
    """
    with engine.connect() as connection:
        anchor = compute_anchor_from_database(connection)
    stored = read_anchor(settings.database_file)
    if anchor is None or anchor == stored:
        return
    if (
        alone
        or stored is None
        or _anchor_without_log_end(stored) != _anchor_without_log_end(anchor)
    ):
        write_anchor(settings.database_file, anchor)


def _anchor_without_log_end(anchor: DatabaseAnchor) -> DatabaseAnchor:
    return replace(anchor, entries=0, hash="")


def _require_matches_anchor(
    connection: Connection, anchor: DatabaseAnchor, database: str, hint: str
) -> None:
    tables = inspect(connection).get_table_names()
    if "log" not in tables:
        raise DamagedError(
            f"{database} has no log table, but this home recorded {anchor.entries:,} log entries",
            hint=hint,
        )
    if "installation" in tables:
        own = connection.execute(text("SELECT key FROM installation")).scalar()
        if own != anchor.installation:
            raise DamagedError(f"{database} is the database of another installation", hint=hint)
    entries = connection.execute(text("SELECT coalesce(max(id), 0) FROM log")).scalar_one()
    if entries < anchor.entries:
        raise DamagedError(
            f"the log in {database} ends after {entries:,} entries, but this home recorded"
            f" {anchor.entries:,}",
            hint=OLDER_DUMP if hint == RESTORE_SERVER else hint,
        )
    if anchor.entries:
        query = text("SELECT hash FROM log WHERE id = :id")
        found = connection.execute(query, {"id": anchor.entries}).scalar()
        if found != anchor.hash:
            raise DamagedError(
                f"entry {anchor.entries:,} of the log in {database} differs from the entry that"
                " this home recorded",
                hint=hint,
            )
