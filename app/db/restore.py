"""Restoring: a backup becomes the home's database; what was there is moved aside, never deleted."""

from __future__ import annotations

import os
import shutil
import zipfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath

import pysqlite3.dbapi2

from app.config import Settings
from app.db.backup import (
    DATABASE,
    EXPORTS,
    FRAMES,
    RECORDINGS,
    BackupManifest,
    examine_database,
    require_file_database,
    verify_backup,
)
from app.db.home import ASIDE, FOLDER_MODE, RESTORING, make_file_access_error, make_home_private
from app.db.home_paths import find_path_in_home
from app.db.locks import hold_exclusive_database_lock, hold_server_lock
from app.db.migrate import KNOWN_REVISIONS, newer_schema_error
from app.db.recovery.anchor import DatabaseAnchor, find_anchor_file, write_anchor
from app.db.recovery.preopen_check import (
    MAGIC,
    find_write_ahead_log_file,
    read_header,
    summarize_wal_file,
)
from app.durable import sync_to_disk
from app.errors import DamagedError, InputError

_HAS_RECORDINGS = "SELECT 1 FROM sqlite_master WHERE name = 'recording'"
_STAMPS = "SELECT path, stamp, sha256 FROM recording WHERE stamp IS NOT NULL"


@dataclass(frozen=True)
class RestoreResult:
    """What a home has been made from.

    Attributes:
        home: The home.
        schema: Revision of the database's schema; an older one is migrated by ``serve``.
        entries: Length of the log.
        rows: Rows by table.
        files: How many files came with the database.
        aside: Folder with what was there before; None where nothing was.
        foreign_log: Whether a write-ahead log beside the database was another one's, and left out.
    """

    home: Path
    schema: str
    entries: int
    rows: dict[str, int]
    files: int
    aside: Path | None
    foreign_log: bool = False


def restore_database(settings: Settings, source: Path) -> RestoreResult:
    """Put a backup, or a database file, into the place of a home's database.

    The source is examined first. Killed at any moment, the home is as it was, or without a
    database, which no server takes for a new one: restoring again mends it.

    Args:
        settings: Which home.
        source: A zip of ``write_backup``, or a database with or without the log beside it.

    Raises:
        InputError: It is no backup, or not what was written.
        DamagedError: The database in it is damaged.
        StorageError: Somebody uses the home, or the disk is full.
    """
    require_file_database(
        settings, "restored", "pg_restore --clean --if-exists --dbname=DATABASE FILE"
    )
    if not source.is_file():
        raise InputError(f"there is no file {source}")
    with (
        hold_server_lock(settings),
        hold_exclusive_database_lock(settings, "it cannot be replaced meanwhile"),
    ):
        try:
            with _temporary_folder(settings) as folder:
                return _restore_through_folder(settings, source, folder)
        except OSError as error:
            raise make_file_access_error(Path(error.filename or settings.home), error) from error


def _restore_through_folder(settings: Settings, source: Path, folder: Path) -> RestoreResult:
    if zipfile.is_zipfile(source):
        manifest, foreign_log = _unpack_backup(source, folder), False
    else:
        manifest, foreign_log = None, _copy_database_and_own_log(source, folder)
    anchor, rows = examine_database(settings, folder / DATABASE, source)
    if anchor.schema not in KNOWN_REVISIONS:
        raise newer_schema_error(anchor.schema, settings)
    if manifest is not None:
        if (manifest.entries, manifest.hash) != (anchor.entries, anchor.hash):
            raise DamagedError(
                f"the log in the backup {source} differs from the log that its manifest describes"
            )
        _set_times_of_recordings(folder, manifest)
    files = sum(1 for path in folder.rglob("*") if path.is_file()) - 1
    # The files of the backup, and those of its database's log, which SQLite may have left.
    os.sync()
    # Exports are called after their jobs, whose ids another database may give to others.
    restored = _list_restored_paths(folder)
    aside = _move_replaced_files_aside(settings, sorted({*EXPORTS, *restored}))
    _move_into_home(settings, folder, restored, anchor)
    make_home_private(settings)
    return RestoreResult(
        settings.home, anchor.schema, anchor.entries, rows, files, aside, foreign_log
    )


@contextmanager
def _temporary_folder(settings: Settings) -> Iterator[Path]:
    folder = settings.database_file.with_name(RESTORING)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(mode=FOLDER_MODE)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _unpack_backup(source: Path, folder: Path) -> BackupManifest:
    """Unpack a backup that is what was written."""
    manifest = verify_backup(source)
    with zipfile.ZipFile(source) as backup:
        for name in manifest.files:
            target = folder / _safe_member_path(name, source)
            target.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
            handle = os.open(target, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with backup.open(name) as member, os.fdopen(handle, "wb") as file:
                shutil.copyfileobj(member, file)
    return manifest


def _set_times_of_recordings(folder: Path, manifest: BackupManifest) -> None:
    """Give the files of recordings the times by which their recordings know them."""
    with closing(pysqlite3.dbapi2.connect(str(folder / DATABASE))) as connection:
        if not connection.execute(_HAS_RECORDINGS).fetchone():
            return
        rows = connection.execute(_STAMPS).fetchall()
    for path, stamp, sha256 in rows:
        file = Path(find_path_in_home(path, folder))
        if file.is_relative_to(folder):
            size, time = map(int, stamp.split())
            known = manifest.files.get(file.relative_to(folder).as_posix())
            if known == {"bytes": size, "sha256": sha256}:
                os.utime(file, ns=(time, time))


def _list_restored_paths(folder: Path) -> list[str]:
    """Files and folders of a home that a backup has, each with all below it."""
    found = []
    for path in sorted(folder.iterdir()):
        # Without its frames the folder holds a part of what the home may have.
        inside = sorted(path.iterdir()) if path.name == RECORDINGS else []
        if inside and all(file.is_file() for file in inside):
            found += [f"{RECORDINGS}/{file.name}" for file in inside]
        elif path.is_dir():
            found.append(path.name)
    return found


def _safe_member_path(name: str, source: Path) -> PurePosixPath:
    """The path of a member below the home: the database, or in one of our folders."""
    path = PurePosixPath(name)
    ours = path.parts[0] in (*FRAMES, *EXPORTS) and len(path.parts) > 1
    if name != DATABASE and (not ours or ".." in path.parts):
        raise InputError(
            f"the backup {source} contains {name}, which is not a file of a Touchline home"
        )
    return path


def _copy_database_and_own_log(source: Path, folder: Path) -> bool:
    """Copy a database and the log that belongs to it; returns whether another one lay there."""
    header = read_header(source)
    if header is None:
        raise InputError(
            f"{source} is neither a backup of Touchline nor a database ({MAGIC[:13].decode()})",
            hint="Make a backup with touchline backup.",
        )
    log = summarize_wal_file(find_write_ahead_log_file(source))
    shutil.copyfile(source, folder / DATABASE)
    if log.commits and log.belongs_to(header):
        shutil.copyfile(
            find_write_ahead_log_file(source), find_write_ahead_log_file(folder / DATABASE)
        )
        return False
    return log.commits > 0


def _move_replaced_files_aside(settings: Settings, names: list[str]) -> Path | None:
    """Move what will be replaced into a folder of its own; the anchor stays until the end."""
    database = settings.database_file
    present = {path: path.name for path in database.parent.glob(f"{database.name}*")}
    present |= {settings.home / name: name for name in names if (settings.home / name).exists()}
    anchor = find_anchor_file(database)
    if not present and not anchor.exists():
        return None
    aside = _make_aside_folder(settings.home)
    if anchor.exists():
        shutil.copy(anchor, aside)
    for path, name in present.items():
        (aside / name).parent.mkdir(mode=FOLDER_MODE, exist_ok=True)
        shutil.move(path, aside / name)
    for path in (aside, settings.home, database.parent):
        sync_to_disk(path)
    return aside


def _make_aside_folder(home: Path) -> Path:
    name = f"{ASIDE}{datetime.now(UTC):%Y%m%dT%H%M%S}"
    number = 1
    while (folder := home / (name if number == 1 else f"{name}-{number}")).exists():
        number += 1
    folder.mkdir(mode=FOLDER_MODE)
    return folder


def _move_into_home(
    settings: Settings, folder: Path, names: list[str], anchor: DatabaseAnchor
) -> None:
    """The database last: without it nothing is served."""
    # Their marks are those of the changes of another database.
    shutil.rmtree(settings.yields, ignore_errors=True)
    for name in names:
        (settings.home / name).parent.mkdir(mode=FOLDER_MODE, exist_ok=True)
        shutil.move(folder / name, settings.home / name)
    sync_to_disk(settings.home)
    shutil.move(folder / DATABASE, settings.database_file)
    sync_to_disk(settings.database_file.parent)
    if anchor.installation:
        write_anchor(settings.database_file, anchor)
    else:
        find_anchor_file(settings.database_file).unlink(missing_ok=True)
