"""Backups: a home in one zip, with a manifest that tells every byte, taken beside a running server.

``touchline.db`` is the database as one transaction saw it, ``manifest.json`` says what it holds;
files of the home lie under their own names. Any zip program unpacks it.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import shutil
import time
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any

import pysqlite3.dbapi2
from sqlalchemy import inspect, text

from app.config import Settings
from app.db.dialects.dialect import (
    get_dialect,
    get_session_dialect,
    make_engine,
    translate_storage_errors,
)
from app.db.home import find_last_write_time, is_half_written, make_file_access_error
from app.db.home_paths import find_path_in_home
from app.db.locks import DatabaseOpenLock
from app.db.log import verify_chain
from app.db.recovery.anchor import (
    DatabaseAnchor,
    compute_anchor_from_database,
    require_own_database,
)
from app.db.recovery.preopen_check import require_consistent_home_files, require_database
from app.db.session import Session, now
from app.durable import PARTIAL, sync_to_disk
from app.errors import EXAMINE, DamagedError, InputError, StorageError
from app.json_text import json_text

FORMAT, FORMAT_VERSION = "touchline-backup", 1
DATABASE, MANIFEST = "touchline.db", "manifest.json"
RECORDINGS = "recordings"
"""Folder of a home with what was found of recordings, in small files that go with every backup, and frames below."""
FRAMES = ("uploads", RECORDINGS, "sample", "practice")
"""Folders of a home that hold frames, and the files that were imported from."""
EXPORTS = ("exports",)
_CHUNK = 1 << 20
_QUICK = 1
_ABANDONED_S = 3600.0
"""A folder in which nothing began for so long, and that nobody has locked, is a killed run's."""
_COUNTED = ("dataset", "groups", "view", "station", "verdict", "version", "solution", "log")
"""Tables whose rows a backup counts."""


@dataclass(frozen=True)
class BackupManifest:
    """What a backup holds.

    Attributes:
        made: When.
        home: Where the home was, which frames are read from.
        schema: Revision of the database's schema.
        installation: Id of the installation, empty where it had none yet.
        entries: Length of the log; ``hash`` is that of its last entry.
        rows: Rows by table.
        frames_elsewhere: How many files hold frames that are not in it.
        files: Bytes and SHA-256 by name.
        format: What kind of file this is.
        version: Of the format.
    """

    made: str
    home: str
    schema: str
    installation: str
    entries: int
    hash: str
    rows: dict[str, int]
    frames_elsewhere: int
    files: dict[str, dict[str, int | str]]
    format: str = FORMAT
    version: int = FORMAT_VERSION


def back_up_home(settings: Settings, out: Path, folders: Sequence[str] = ()) -> BackupManifest:
    """``write_backup`` of a home whose files belong together, beside whoever works in it.

    Raises:
        InputError: The home has no database, or it is a server's.
    """
    require_file_database(settings, "backed up", "pg_dump --format=custom --file=OUT DATABASE")
    require_database(settings, "Set TOUCHLINE_HOME to the home folder of an installation.")
    lock = DatabaseOpenLock(settings)
    try:
        if lock.alone:
            require_consistent_home_files(settings)
        lock.share()
        return write_backup(settings, out, folders)
    finally:
        lock.release()


def require_file_database(settings: Settings, done: str, command: str) -> None:
    """Raise InputError where the database is a server's, whose own programs copy it."""
    if not get_dialect(settings).is_file:
        raise InputError(
            f"{settings.database_name} is a PostgreSQL database, which is {done} with the"
            " programs of PostgreSQL",
            hint=f"Run {command}, and copy the files of the home folder (uploads, exports)"
            " yourself.",
        )


def write_backup(
    settings: Settings, out: Path, folders: Sequence[str] = (), *, replace: bool = False
) -> BackupManifest:
    """Write a backup and read it once more; it is at its place when it is good, or not at all.

    The caller holds a lock of the database, and has looked at its files.

    Args:
        settings: Which home.
        out: The zip.
        folders: Folders of the home that go with it (``FRAMES``, ``EXPORTS``).
        replace: Whether a file of that name may be replaced.

    Raises:
        InputError: There is such a file already, or no such folder.
        DamagedError: The database is damaged; nothing is written.
        StorageError: The disk is full, or somebody writes the same backup.
    """
    _require_writable_destination(out, replace)
    try:
        with _temporary_folder(out) as folder:
            copy, partial = folder / DATABASE, folder / "backup.zip"
            _copy_database(settings, copy)
            manifest = _write_zip(settings, copy, partial, folders)
            verify_backup(partial)
            _require_writable_destination(out, replace)
            partial.replace(out)
            sync_to_disk(out.parent)
    except OSError as error:
        hint = f"Make {out.parent} writable for this user, or name another folder."
        raise make_file_access_error(Path(error.filename or out), error, hint) from error
    return manifest


def read_manifest(backup: zipfile.ZipFile) -> BackupManifest:
    """What a backup says that it holds.

    Raises:
        InputError: It is no backup, or one of a newer version.
    """
    try:
        values = json.loads(backup.read(MANIFEST))
        if values["format"] != FORMAT:
            raise ValueError(values["format"])
        if values["version"] != FORMAT_VERSION:
            raise InputError("the backup was made by a newer version of Touchline")
        return BackupManifest(**values)
    except (KeyError, ValueError, TypeError) as error:
        raise InputError(
            f"{backup.filename} is not a backup of Touchline: its manifest.json is missing or"
            " has an unknown format"
        ) from error


def verify_backup(path: Path) -> BackupManifest:
    """Read every byte of a backup and compare it with its manifest.

    Raises:
        InputError: It is no backup, or not what was written.
    """
    try:
        with zipfile.ZipFile(path) as backup:
            manifest = read_manifest(backup)
            names = [info.filename for info in backup.infolist() if info.filename != MANIFEST]
            if sorted(names) != sorted(manifest.files):
                raise InputError(f"{path} does not hold the files that its manifest names")
            for name in names:
                with backup.open(name) as member:
                    if (
                        _digest_chunks(iter(lambda: member.read(_CHUNK), b""))
                        != manifest.files[name]
                    ):
                        raise InputError(
                            f"the file {name} in the backup {path} is damaged: its checksum differs from the"
                            " one in the manifest"
                        )
    except (zipfile.BadZipFile, EOFError, OSError, zlib.error) as error:
        raise InputError(
            f"{path} is damaged or is not a backup of Touchline ({error})",
            hint="Use another backup.",
        ) from error
    return manifest


def examine_database(
    settings: Settings, file: Path, known_as: Path
) -> tuple[DatabaseAnchor, dict[str, int]]:
    """Look at every page of a database that nobody else has open, and at the log's hash chain.

    Args:
        settings: Any.
        file: The database.
        known_as: What complaints call it.

    Returns:
        What its anchor is, and its rows by table.

    Raises:
        DamagedError: Something is not as it was written.
    """
    own = settings.model_copy(update={"database_url": f"sqlite+pysqlite:///{file}"})
    engine = make_engine(own)
    try:
        with translate_storage_errors(own), Session(engine) as session:
            dialect, tables = get_session_dialect(session), set(inspect(session).get_table_names())
            if "alembic_version" not in tables or "log" not in tables:
                raise DamagedError(f"{known_as} is not a Touchline database", hint=EXAMINE)
            if faults := dialect.find_file_faults(session, 3, thorough=True):
                raise DamagedError(f"{known_as} is damaged: {'; '.join(faults)}", hint=EXAMINE)
            if dialect.count_lost_references(session):
                problem = f"{known_as} has rows that refer to rows that are gone"
                raise DamagedError(problem, hint=EXAMINE)
            verify_chain(session)
            counts = {
                name: session.execute(text(f"SELECT count(*) FROM {name}")).scalar_one()
                for name in _COUNTED
                if name in tables
            }
            return compute_anchor_from_database(session) or _read_anchor_without_installation(
                session
            ), counts
    finally:
        engine.dispose()


def _read_anchor_without_installation(session: Session) -> DatabaseAnchor:
    schema = session.execute(text("SELECT version_num FROM alembic_version")).scalar_one()
    last = session.execute(text("SELECT id, hash FROM log ORDER BY id DESC LIMIT 1")).first()
    return DatabaseAnchor("", "", schema, *(tuple(last) if last else (0, "")))


def _require_writable_destination(out: Path, replace: bool) -> None:
    if out.exists() and not replace:
        raise InputError(f"{out} already exists", hint="Name a file that does not exist yet.")
    if not out.parent.is_dir():
        raise InputError(f"there is no folder {out.parent}")


@contextmanager
def _temporary_folder(out: Path) -> Iterator[Path]:
    """A folder beside the backup, gone at the end; what killed runs left goes first."""
    _delete_abandoned_folders(out.parent)
    folder = out.with_name(f".{out.name}{PARTIAL}")
    folder.mkdir(mode=0o700, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        os.close(handle)
        raise StorageError(f"another process is writing {out}") from error
    try:
        for path in folder.iterdir():
            path.unlink()
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
        os.close(handle)


def _delete_abandoned_folders(parent: Path) -> None:
    """Delete folders of backups of any name that were killed; a run that is at one holds its lock."""
    for folder in parent.glob(f".*.zip{PARTIAL}"):
        written = find_last_write_time(folder)
        # One that began this moment may not have its lock yet.
        if written is None or written > time.time() - _ABANDONED_S:
            continue
        with suppress(OSError):
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(handle)


def _copy_database(settings: Settings, copy: Path) -> None:
    """The database as it is at one moment, in a file of its own that needs no log beside it."""
    os.close(os.open(copy, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    engine = make_engine(settings)
    try:
        with translate_storage_errors(settings):
            require_own_database(engine, settings)
        with (
            translate_storage_errors(settings),
            engine.connect() as connection,
            closing(pysqlite3.dbapi2.connect(str(copy))) as target,
        ):
            # All pages at once: writers go on meanwhile, and none of their changes is in it.
            driver: Any = connection.connection.dbapi_connection
            driver.backup(target)
    except pysqlite3.dbapi2.Error as error:
        raise StorageError(
            f"the database cannot be copied: {error}",
            hint="Check that the disk has free space. " + EXAMINE,
        ) from error
    finally:
        engine.dispose()


def _write_zip(
    settings: Settings, copy: Path, partial: Path, folders: Sequence[str]
) -> BackupManifest:
    anchor, rows = examine_database(settings, copy, settings.database_file)
    with closing(pysqlite3.dbapi2.connect(str(copy))) as connection:
        connection.execute("PRAGMA journal_mode=DELETE")
        elsewhere = _count_frames_elsewhere(connection, settings.home.absolute(), folders)
    files: dict[str, dict[str, int | str]] = {}
    handle = os.open(partial, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(handle, "w+b") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=_QUICK) as backup:
            files[DATABASE] = _add_file(backup, DATABASE, copy, zipfile.ZIP_DEFLATED)
            for path in _iterate_files(settings.home, folders):
                name = path.relative_to(settings.home).as_posix()
                # Uploads expire, and exports are deleted, meanwhile.
                with suppress(FileNotFoundError):
                    files[name] = _add_file(backup, name, path, zipfile.ZIP_STORED)
            manifest = BackupManifest(
                made=now(),
                home=str(settings.home.resolve()),
                schema=anchor.schema,
                installation=anchor.installation,
                entries=anchor.entries,
                hash=anchor.hash,
                rows=rows,
                frames_elsewhere=elsewhere,
                files=files,
            )
            backup.writestr(MANIFEST, json_text(asdict(manifest), indent=1))
        file.flush()
        os.fsync(file.fileno())
    return manifest


def _count_frames_elsewhere(connection: Any, home: Path, folders: Sequence[str]) -> int:
    statement = "SELECT DISTINCT media_path FROM view WHERE media_path IS NOT NULL"
    paths = [Path(find_path_in_home(path, home)) for (path,) in connection.execute(statement)]
    return sum(not any(path.is_relative_to(home / name) for name in folders) for path in paths)


def _iterate_files(home: Path, folders: Sequence[str]) -> Iterator[Path]:
    """Files of folders, in order, and the small ones of recordings; half-written ones are nobody's yet."""
    if RECORDINGS not in folders:
        small = sorted((home / RECORDINGS).glob("*.npz"))
        yield from (path for path in small if not is_half_written(path, home))
    for name in folders:
        walk = os.walk(home / name)
        for path in sorted(Path(folder, file) for folder, _, files in walk for file in files):
            if not is_half_written(path, home) and path.is_file() and not path.is_symlink():
                yield path


def _add_file(backup: zipfile.ZipFile, name: str, path: Path, packed: int) -> dict[str, int | str]:
    """Put a file into a backup; FileNotFoundError, and nothing is in it, where there is none."""
    with _translate_read_errors(path):
        info = zipfile.ZipInfo.from_file(path, name)
        source = path.open("rb")
    info.compress_type = packed
    with source, backup.open(info, "w", force_zip64=True) as target:
        return _digest_chunks(_read_chunks(source, path), target)


def _read_chunks(source: IO[bytes], path: Path) -> Iterator[bytes]:
    while True:
        with _translate_read_errors(path):
            chunk = source.read(_CHUNK)
        if not chunk:
            return
        yield chunk


@contextmanager
def _translate_read_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StorageError(
            f"{path} cannot be read: {error.strerror or error}",
            hint="Make the file readable for this user, or check the disk for faults; no backup"
            " was written.",
        ) from error


def _digest_chunks(
    chunks: Iterable[bytes], target: IO[bytes] | None = None
) -> dict[str, int | str]:
    digest, size = hashlib.sha256(), 0
    for chunk in chunks:
        digest.update(chunk)
        size += len(chunk)
        if target is not None:
            target.write(chunk)
    return {"bytes": size, "sha256": digest.hexdigest()}
