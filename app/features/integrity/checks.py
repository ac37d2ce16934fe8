"""Checks of a home: its database against the log; settings, permissions, room, clock, leftovers, object stores; and all
together.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
from contextlib import closing
from datetime import UTC, datetime, timedelta
from itertools import islice

import cv2
import pysqlite3.dbapi2

from app.config import Settings
from app.db.check import CheckResult, compare_with_log, summarize_faulty_records
from app.db.dialects.dialect import get_session_dialect
from app.db.dialects.sqlite import MIN_SQLITE
from app.db.home import find_leftovers, find_paths_open_to_others, make_home
from app.db.log import (
    count_entries_after,
    find_last_entry_time,
    find_newest_entry_id,
    iterate_entries_of_kinds,
)
from app.db.recovery.anchor import read_anchor
from app.db.session import Session, format_utc_time
from app.db.store import Store
from app.errors import ConflictError, DamagedError, InputError, ReviewError, StorageError
from app.features.comments.service import examine_threads
from app.features.datasets.queries import (
    find_missing_path,
    list_missing_recording_files,
    list_unused_calibrations,
    list_unused_frame_files,
    list_unused_uploads,
)
from app.features.datasets.service import list_datasets
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import (
    StateSnapshot,
    iterate_groups,
    iterate_stations,
    read_state_snapshot,
)
from app.features.guidelines.queries import GUIDELINE, list_all_guidelines
from app.features.integrity.records import (
    DELETED,
    examine_computed_records,
    examine_people,
    examine_versions,
)
from app.features.integrity.transfer import find_null_characters, format_null_characters
from app.features.people.provider import Provider
from app.features.people.sign_on_rules import count_active_admins_linked_to_sign_on, read_rules
from app.features.queue.refresh_queries import find_outdated_rows
from app.features.solutions.service import list_stale_groups
from app.features.webhooks.sender import require_valid_setting
from app.features.what_if.service import examine_yield_cache
from app.mail import read_mail_server
from app.object_store.store import ChangedObjectError, ObjectStore, open_store
from app.soccer.codec import hash_group_inputs, paint_digests_to_json, station_digest, view_digest
from app.wording import plural


def examine_guidelines(session: Session, restore: str) -> CheckResult:
    """Compare every version of every dataset's guidelines with the digest in the log.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a text is not what was written.
    """
    logged = _read_logged_guidelines(session)
    present = {
        (row.dataset_id, row.number): hashlib.sha256(row.text.encode()).hexdigest()
        for row in list_all_guidelines(session)
    }
    return compare_with_log("guidelines", logged, present, restore, _guideline_name)


def _guideline_name(key: tuple[int, int]) -> str:
    dataset, number = key
    return f"version {number} of dataset {dataset}"


def _read_logged_guidelines(session: Session) -> dict[tuple[int, int], str]:
    digests: dict[tuple[int, int], str] = {}
    for entry in iterate_entries_of_kinds(session, [GUIDELINE, DELETED]):
        assert entry.dataset_id is not None
        if entry.kind == DELETED:
            digests = {key: digest for key, digest in digests.items() if key[0] != entry.dataset_id}
        else:
            digests[entry.dataset_id, entry.body["number"]] = entry.body["digest"]
    return digests


REBUILD = "Run touchline doctor --rebuild: it writes these tables anew from the log."
REBUILT = {
    "groups": "groups",
    "stations": "cameras",
    "unassigned": "unassigned frames",
    "noticed": "findings of imports",
}
"""Parts of the state snapshot that ``rebuild`` writes, with the words for them."""
KEPT = {
    "datasets": "datasets",
    "verdicts": "groups' verdicts",
    "dismissals": "dismissed findings",
}
"""Parts that it leaves as they are."""


def examine_database(store: Store) -> list[CheckResult]:
    """Look at the file, the log's hash chain, the tables and everything that was computed.

    Nothing is changed. The tables are compared with what follows from the log alone, unless the
    log is broken: then nothing follows from it.
    """
    with store.read() as session:
        restore = get_session_dialect(session).restoring
        checks = [_check_database_file(session, restore)]
        entries = find_newest_entry_id(session)
        try:
            logged = replay_log(session)
        except StorageError as error:
            checks.append(CheckResult("log", False, error.message, error.hint or restore))
        else:
            checks.append(CheckResult("log", True, f"{entries:,} entries, each as it was written"))
            checks.append(_check_null_characters(session))
            checks += _check_tables_against_log(session, logged, restore)
            checks += [*examine_people(session, restore), examine_guidelines(session, restore)]
        computed = examine_computed_records(session, restore)
        is_whole = all(check.ok for check in computed)
        checks += [*computed, _check_review_queue(session, REBUILD if is_whole else restore)]
    return [*checks, *_report_unsolved_groups(store)]


def _check_database_file(session: Session, restore: str) -> CheckResult:
    """The database's own look at its pages and indexes, and at references to rows that are gone."""
    dialect = get_session_dialect(session)
    faults, lost = dialect.find_file_faults(session), dialect.count_lost_references(session)
    if faults:
        return CheckResult("file", False, f"SQLite finds it damaged: {'; '.join(faults)}", restore)
    if lost:
        return CheckResult("file", False, f"{lost} rows refer to rows that are gone", restore)
    return CheckResult("file", True, dialect.no_fault)


def _check_null_characters(session: Session) -> CheckResult:
    """Texts from before U+0000 was refused: no fault here, and nothing that PostgreSQL can keep."""
    found = find_null_characters(session)
    if not found:
        return CheckResult("texts", True, "SQLite and PostgreSQL can keep each")
    sentence = (
        f"{len(found):,} with U+0000, which PostgreSQL cannot keep: {format_null_characters(found)}"
    )
    return CheckResult(
        "texts", True, sentence, "touchline transfer --replace-null writes U+FFFD there."
    )


def _check_tables_against_log(
    session: Session, logged: StateSnapshot, restore: str
) -> list[CheckResult]:
    try:
        present = read_state_snapshot(session)
    except StorageError as error:
        return [CheckResult("tables", False, error.message, REBUILD)]
    checks = _check_tables(logged, present, restore)
    # Of a row that is not what was said, the digest says nothing.
    return [*checks, _check_digests(session)] if all(check.ok for check in checks) else checks


def _check_tables(logged: StateSnapshot, present: StateSnapshot, restore: str) -> list[CheckResult]:
    return [
        compare_with_log(words, getattr(logged, name), getattr(present, name), advice)
        for names, advice in ((REBUILT, REBUILD), (KEPT, restore))
        for name, words in names.items()
    ]


def _check_digests(session: Session) -> CheckResult:
    """Whether cameras, views and groups have the digests by which solutions and edits know them."""
    count, apart = 0, list[str]()
    for station in iterate_stations(session):
        count += 1
        if station.digest != station_digest(station.station):
            apart.append(f"camera {station.id}")
    for group in iterate_groups(session):
        count += 1
        views = {view.key: view_digest(view) for view in group.group.views}
        hashed = hash_group_inputs(group.group, paint_digests_to_json(group.group.paint))
        present = {key: digest for key, (digest, _) in group.view_digests.items()}
        if (present, group.inputs_hash) != (views, hashed):
            apart.append(f"group {group.id}")
    whole = f"of {count:,} groups and cameras, each matching its annotations"
    return summarize_faulty_records(
        "digests", whole, apart, "with a digest that does not match the annotations", REBUILD
    )


def _check_review_queue(session: Session, advice: str) -> CheckResult:
    """Whether the row of each group follows from what was said of it and computed for it."""
    try:
        count, apart = find_outdated_rows(session)
    except StorageError as error:
        return CheckResult("queue", False, error.message, advice)
    whole = f"{count:,} rows, as groups, verdicts and solutions say"
    wrong = "not as groups, verdicts and solutions say"
    return summarize_faulty_records(
        "queue", whole, [str(number) for number in apart], wrong, advice
    )


def _report_unsolved_groups(store: Store) -> list[CheckResult]:
    """Groups that wait to be solved are no fault: the next ``solve`` finds them."""
    checks = []
    for item in list_datasets(store):
        waiting = len(list_stale_groups(store, item.id))
        advice = f'touchline solve --dataset "{item.name}"' if waiting else None
        sentence = f"{waiting:,} of {item.groups:,} groups wait to be solved"
        checks.append(CheckResult(f"solutions of {item.name}", True, sentence, advice))
    return checks


KEYS = "Correct TOUCHLINE_STORES or the file of keys: docs/operations.md says what a store needs."
CONDITIONS = "Update the store, or use another one: docs/operations.md says which."
_UNCONDITIONAL = (
    "ignores If-Match and returns changed content: a changed frame would be shown as the imported "
    "one"
)
_PROBE = ".touchline-check"
_NO_CONTENT = '"touchline-asks-for-no-content"'
"""What no store calls any content."""


def examine_object_stores(settings: Settings) -> list[CheckResult]:
    """Ask every configured store for what the service needs of it."""
    return [_check_object_store(settings, name) for name in sorted(settings.stores)]


def _check_object_store(settings: Settings, name: str) -> CheckResult:
    title, done = f"store {name}", list[str]()
    try:
        store = open_store(settings, name)
        found = next(islice(store.iterate_objects_below(""), 1), None)
        done.append("lists")
        if found is not None and found.size:
            store.read(found.key, 0, 1, found.etag)
            done.append("reads")
            if not _refuses_other_content(store, found.key):
                return CheckResult(title, False, _UNCONDITIONAL, CONDITIONS)
        if store.settings.exports:
            _write_probe(store)
            done.append("writes")
    except ReviewError as error:
        can = f"; it {' and '.join(done)}" if done else ""
        return CheckResult(title, False, f"{error.message}{can}", KEYS)
    empty = "" if found is not None else ", and nothing is in it"
    return CheckResult(title, True, f"{', '.join(done)}{empty}")


def _refuses_other_content(store: ObjectStore, key: str) -> bool:
    """Whether an object is not given out as the content that it is not."""
    try:
        store.read(key, 0, 1, _NO_CONTENT)
    except ChangedObjectError:
        return True
    return False


def _write_probe(store: ObjectStore) -> None:
    key = f"{_PROBE}-{secrets.token_hex(4)}"
    store.put(key, b"Touchline writes and deletes this to see that it can.\n")
    store.delete(key)


ROOM_BYTES = 2**30
"""Room on the disk below which the next import may not fit."""
_PREFIX = "TOUCHLINE_"
_FORMATS = (".jpg", ".png", ".webp")


def examine_home_without_database(settings: Settings) -> list[CheckResult]:
    """The checks of a home that need no database."""
    examined = (
        _check_settings,
        _check_permissions,
        _check_free_space,
        _check_anchor,
        _check_sign_on,
        _check_mail,
    )
    return [
        *(examine(settings) for examine in examined),
        _check_library_versions(),
        *examine_object_stores(settings),
    ]


def examine_admins_clock_and_leftovers(store: Store) -> list[CheckResult]:
    """What lies around the tables of a database that can be opened."""
    settings, admins = store.settings, _check_admins_can_log_in(store)
    with store.read() as session:
        return [
            *([admins] if admins else []),
            _check_clock(session),
            _check_leftovers(settings),
            _check_unused_calibrations(session),
            _check_unused_uploads(session, settings),
            _check_unused_frame_files(session, settings),
        ]


def _check_settings(settings: Settings) -> CheckResult:
    known = {_PREFIX + name.upper() for name in Settings.model_fields}
    unknown = sorted(name for name in os.environ if name.startswith(_PREFIX) and name not in known)
    gone = [str(folder) for folder in settings.import_folders if not folder.is_dir()]
    if unknown:
        sentence = f"{', '.join(unknown)} is not a setting and is ignored"
        return CheckResult(
            "settings", False, sentence, "docs/settings.md lists all; correct or unset it."
        )
    if gone:
        sentence = f"TOUCHLINE_IMPORT_FOLDERS names {', '.join(gone)}, which is not a folder"
        return CheckResult("settings", False, sentence, "Make the folder, or take it out.")
    try:
        require_valid_setting(settings)
    except InputError as error:
        return CheckResult("settings", False, error.message, error.hint)
    return CheckResult("settings", True, f"home {settings.home}")


def _check_sign_on(settings: Settings) -> CheckResult:
    """Whether single sign-on is set up whole, and its provider answers."""
    name, advice = (
        "single sign-on",
        "Look at the settings TOUCHLINE_SSO_...; docs/teams.md has them.",
    )
    try:
        # Whether it is a team that is served, serve is told on its own command line.
        rules = read_rules(settings.model_copy(update={"team": True}))
        if rules is None:
            return CheckResult(name, True, "not set up")
        return CheckResult(name, True, Provider(rules).refetch_and_describe())
    except (InputError, ConflictError) as error:
        return CheckResult(
            name, False, error.message, error.hint if isinstance(error, InputError) else advice
        )


def _check_mail(settings: Settings) -> CheckResult:
    """Whether the mail server takes us; it is sent nothing."""
    try:
        server = read_mail_server(settings)
        if server is None:
            return CheckResult("mail", True, "not set up")
        found = server.examine()
    except InputError as error:
        return CheckResult("mail", False, error.message, error.hint)
    if settings.url is None:
        return CheckResult(
            "mail", False, f"{found}; letters need TOUCHLINE_URL", "Set TOUCHLINE_URL."
        )
    return CheckResult("mail", True, found)


def _check_admins_can_log_in(store: Store) -> CheckResult | None:
    """Whether an admin can come in where there is no other way; None: there is one."""
    try:
        rules = read_rules(store.settings.model_copy(update={"team": True}))
    except InputError:
        return None
    if rules is None or not rules.only:
        return None
    count = count_active_admins_linked_to_sign_on(store, rules)
    sentence = f"{count} admins are linked with {rules.label}, by which alone people log in"
    advice = (
        None if count else "touchline users reset NAME prints a link with which an admin is linked."
    )
    return CheckResult("admins", count > 0, sentence, advice)


def _check_permissions(settings: Settings) -> CheckResult:
    found = find_paths_open_to_others(settings)
    if found:
        sentence = f"other users can read {plural(len(found), 'file or folder', 'files and folders')}: {found[0]}"
        more = " and others" if found[1:] else ""
        advice = f"Start touchline serve, or run chmod -R go= {settings.home}"
        return CheckResult("permissions", False, sentence + more, advice)
    return CheckResult("permissions", True, "the home is its owner's alone")


def _check_free_space(settings: Settings) -> CheckResult:
    free = shutil.disk_usage(settings.home).free
    # A migration copies the database twice: once as it is, once packed.
    database = settings.database_file
    needed = max(ROOM_BYTES, 2 * (database.stat().st_size if database.exists() else 0))
    sentence = f"{free / 1e9:,.1f} GB are free"
    if free < needed:
        advice = f"Free some space: at least {needed / 1e9:,.1f} GB."
        return CheckResult("room", False, sentence, advice)
    return CheckResult("room", True, sentence)


def _check_library_versions() -> CheckResult:
    sqlite = pysqlite3.dbapi2.sqlite_version
    lacking = [ending for ending in _FORMATS if not cv2.haveImageWriter(ending)]
    sentence = f"SQLite {sqlite}, OpenCV {cv2.__version__}"
    if pysqlite3.dbapi2.sqlite_version_info < MIN_SQLITE:
        advice = "Install the packages of requirements.lock: this SQLite can corrupt its file."
        return CheckResult("versions", False, sentence, advice)
    if lacking:
        sentence += f", which knows no {', '.join(lacking)}"
        return CheckResult(
            "versions", False, sentence, "Install the packages of requirements.lock."
        )
    return CheckResult("versions", True, sentence)


def _check_anchor(settings: Settings) -> CheckResult:
    try:
        anchor = read_anchor(settings.database_file)
    except StorageError as error:
        return CheckResult("anchor", False, error.message, error.hint)
    if anchor is None:
        return CheckResult("anchor", True, "none yet: it is made when the database is opened")
    sentence = f"installation {anchor.installation[:8]}, {anchor.entries:,} entries or more"
    return CheckResult("anchor", True, sentence)


def _check_clock(session: Session) -> CheckResult:
    now = datetime.now(UTC)
    # Two machines that edit in turn may differ by a little.
    count, latest = count_entries_after(session, format_utc_time(now + timedelta(minutes=5)))
    if count == 0:
        return CheckResult("clock", True, "not behind the log")
    sentence = f"{plural(count, 'entry of the log is', 'entries of the log are')} later than the clock, which says {format_utc_time(now)}; the latest is of {latest}"
    last = find_last_entry_time(session)
    if last is not None and datetime.fromisoformat(last) > now + timedelta(minutes=5):
        return CheckResult("clock", False, sentence, "Set the clock of this machine.")
    # Written while the clock was ahead: entries are in order all the same, and nothing can change them.
    return CheckResult(
        "clock", True, f"{sentence}; the newest is not: the clock was set right since"
    )


def _check_leftovers(settings: Settings) -> CheckResult:
    found = [str(path.relative_to(settings.home)) for path in find_leftovers(settings)]
    if found:
        sentence = f"{len(found):,} half-written files are left: {found[0]}"
        return CheckResult(
            "leftovers", True, sentence, "The server deletes them when it has nothing to do."
        )
    return CheckResult("leftovers", True, "none")


def _check_unused_calibrations(session: Session) -> CheckResult:
    count = len(list_unused_calibrations(session))
    advice = "The server deletes them when it has nothing to do." if count else None
    return CheckResult("unused calibrations", True, f"{count:,} that no solution rests on", advice)


def _check_unused_uploads(session: Session, settings: Settings) -> CheckResult:
    try:
        found = list_unused_uploads(session, settings)
    except DamagedError as error:
        return _unknown_use("uploads", error)
    sentence = f"{len(found):,} kept for frames that no dataset reads"
    advice = (
        _advise_deleting(session, f"the folder {settings.uploads / found[0]}") if found else None
    )
    return CheckResult("uploads", True, sentence, advice)


def _check_unused_frame_files(session: Session, settings: Settings) -> CheckResult:
    try:
        found = list_unused_frame_files(session, settings)
    except DamagedError as error:
        return _unknown_use("recordings", error)
    if missing := list_missing_recording_files(session, settings):
        more = " and others" if missing[1:] else ""
        sentence = f"{plural(len(missing), 'file')} of recordings missing: {missing[0]}{more}"
        return CheckResult("recordings", False, sentence, MAKE_AGAIN)
    sentence = f"{len(found):,} indices and folders of frames that nothing uses"
    advice = _advise_deleting(session, str(settings.recordings / found[0])) if found else None
    return CheckResult("recordings", True, sentence, advice)


MAKE_AGAIN = (
    "Restore a backup made with --with-frames. Or index the recording again (.npz), track its shots"
    " again (.cameras.npz), or make its groups again (.png)."
)


def _advise_deleting(session: Session, first: str) -> str:
    if missing := find_missing_path(session):
        return f"Delete nothing: {missing} is missing, which a recording or a view names."
    return f"Delete {first}, and the others."


def _unknown_use(name: str, error: DamagedError) -> CheckResult:
    sentence = f"which files are used cannot be read: {error.message}"
    return CheckResult(name, False, sentence, error.hint)


def examine_everything(settings: Settings) -> list[CheckResult]:
    """Look at everything; where the database cannot be opened, say why, and what lies around it."""
    make_home(settings)
    checks = [*examine_home_without_database(settings), examine_yield_cache(settings)]
    try:
        with closing(Store.open(settings)) as store:
            checks += [*examine_admins_clock_and_leftovers(store), *examine_database(store)]
            return [*checks, examine_threads(store), *examine_versions(store)]
    except StorageError as error:
        return [*checks, CheckResult("database", False, error.message, error.hint)]
