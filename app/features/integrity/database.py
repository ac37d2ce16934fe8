"""Whether the database is whole, and its tables are what the log says."""

from __future__ import annotations

import hashlib

from app.db.check import Check, compare_records, compare_with_log
from app.db.dialects.dialect import dialect_in
from app.db.log import entries_of_kinds, newest_entry
from app.db.session import Session
from app.db.store import Store
from app.errors import StorageError
from app.features.datasets.service import list_datasets
from app.features.groups.digest import group_inputs_hash, station_digest, view_digest
from app.features.groups.projection_queries import all_groups, all_stations
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot import StateSnapshot, read_state_snapshot
from app.features.guidelines.queries import GUIDELINE, all_guidelines
from app.features.integrity.records import DELETED, examine_computed, examine_people
from app.features.integrity.transfer import find_null_characters, list_null_characters
from app.features.queue.refresh_queries import differing_rows
from app.features.solutions.service import stale_groups
from app.soccer.codec import paint_to_json


def examine_guidelines(session: Session, restore: str) -> Check:
    """Compare every version of every dataset's guidelines with the digest in the log.

    Args:
        session: A read session on a log whose chain is whole.
        restore: What to do where a text is not what was written.
    """
    logged = _logged_guidelines(session)
    present = {
        (row.dataset_id, row.number): hashlib.sha256(row.text.encode()).hexdigest()
        for row in all_guidelines(session)
    }
    return compare_with_log("guidelines", logged, present, restore, _guideline_name)


def _guideline_name(key: tuple[int, int]) -> str:
    dataset, number = key
    return f"version {number} of dataset {dataset}"


def _logged_guidelines(session: Session) -> dict[tuple[int, int], str]:
    digests: dict[tuple[int, int], str] = {}
    for entry in entries_of_kinds(session, [GUIDELINE, DELETED]):
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


def examine_database(store: Store) -> list[Check]:
    """Look at the file, the log's hash chain, the tables and everything that was computed.

    Nothing is changed. The tables are compared with what follows from the log alone, unless the
    log is broken: then nothing follows from it.
    """
    with store.read() as session:
        restore = dialect_in(session).restoring
        checks = [_check_file(session, restore)]
        entries = newest_entry(session)
        try:
            logged = replay_log(session)
        except StorageError as error:
            checks.append(Check("log", False, error.message, error.hint or restore))
        else:
            checks.append(Check("log", True, f"{entries:,} entries, each as it was written"))
            checks.append(_check_texts(session))
            checks += _check_tables_against_log(session, logged, restore)
            checks += [*examine_people(session, restore), examine_guidelines(session, restore)]
        computed = examine_computed(session, restore)
        is_whole = all(check.ok for check in computed)
        checks += [*computed, _check_queue(session, REBUILD if is_whole else restore)]
    return [*checks, *_check_solutions(store)]


def _check_file(session: Session, restore: str) -> Check:
    """The database's own look at its pages and indexes, and at references to rows that are gone."""
    dialect = dialect_in(session)
    faults, lost = dialect.file_faults(session), dialect.count_lost_references(session)
    if faults:
        return Check("file", False, f"SQLite finds it damaged: {'; '.join(faults)}", restore)
    if lost:
        return Check("file", False, f"{lost} rows refer to rows that are gone", restore)
    return Check("file", True, dialect.no_fault)


def _check_texts(session: Session) -> Check:
    """Texts from before U+0000 was refused: no fault here, and nothing that PostgreSQL can keep."""
    found = find_null_characters(session)
    if not found:
        return Check("texts", True, "SQLite and PostgreSQL can keep each")
    sentence = (
        f"{len(found):,} with U+0000, which PostgreSQL cannot keep: {list_null_characters(found)}"
    )
    return Check("texts", True, sentence, "touchline transfer --replace-null writes U+FFFD there.")


def _check_tables_against_log(session: Session, logged: StateSnapshot, restore: str) -> list[Check]:
    try:
        present = read_state_snapshot(session)
    except StorageError as error:
        return [Check("tables", False, error.message, REBUILD)]
    checks = _check_tables(logged, present, restore)
    # Of a row that is not what was said, the digest says nothing.
    return [*checks, _check_digests(session)] if all(check.ok for check in checks) else checks


def _check_tables(logged: StateSnapshot, present: StateSnapshot, restore: str) -> list[Check]:
    return [
        compare_with_log(words, getattr(logged, name), getattr(present, name), mend)
        for names, mend in ((REBUILT, REBUILD), (KEPT, restore))
        for name, words in names.items()
    ]


def _check_digests(session: Session) -> Check:
    """Whether cameras, views and groups have the digests by which solutions and edits know them."""
    count, apart = 0, list[str]()
    for station in all_stations(session):
        count += 1
        if station.digest != station_digest(station.station):
            apart.append(f"camera {station.id}")
    for group in all_groups(session):
        count += 1
        views = {view.key: view_digest(view) for view in group.group.views}
        hashed = group_inputs_hash(group.group, paint_to_json(group.group.paint))
        present = {key: digest for key, (digest, _) in group.view_digests.items()}
        if (present, group.inputs_hash) != (views, hashed):
            apart.append(f"group {group.id}")
    whole = f"of {count:,} groups and cameras, each matching its annotations"
    return compare_records("digests", whole, apart, "not of what was said", REBUILD)


def _check_queue(session: Session, mend: str) -> Check:
    """Whether the row of each group follows from what was said of it and computed for it."""
    try:
        count, apart = differing_rows(session)
    except StorageError as error:
        return Check("queue", False, error.message, mend)
    whole = f"{count:,} rows, as groups, verdicts and solutions say"
    wrong = "not as groups, verdicts and solutions say"
    return compare_records("queue", whole, [str(number) for number in apart], wrong, mend)


def _check_solutions(store: Store) -> list[Check]:
    """Groups that wait to be solved are no fault: the next ``solve`` finds them."""
    checks = []
    for item in list_datasets(store):
        waiting = len(stale_groups(store, item.id))
        mend = f'touchline solve --dataset "{item.name}"' if waiting else None
        sentence = f"{waiting:,} of {item.groups:,} groups wait to be solved"
        checks.append(Check(f"solutions of {item.name}", True, sentence, mend))
    return checks
