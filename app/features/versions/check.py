"""Whether versions are as they were frozen, told without solving anything anew."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from app.db.check import Check, compare_records
from app.db.dialects.dialect import dialect_in
from app.db.json_columns import as_written, parse, unpack
from app.db.log import LogEntry, entries_of_kinds
from app.db.session import Session
from app.db.store import Store
from app.errors import StorageError
from app.features.groups.codecs import policy_from_json
from app.features.people.visibility_queries import shown_entries
from app.features.versions.frozen_queries import (
    SAID,
    SOLUTION,
    fitting_key,
    frozen_batches,
    known_frozen,
    lost_calibrations,
    members_without_content,
    named_texts,
    read_json,
)
from app.features.versions.queries import all_versions, annotation_rows
from app.features.versions.service import calibration_names, version_hash

WRONG = "not as it was frozen"


def examine_versions(store: Store) -> list[Check]:
    """Compare each version with its groups and the log, and each frozen content with its key.

    Whether solutions would come out as they were frozen is what ``verify`` tells.
    """
    with store.read() as session:
        restore = dialect_in(session).restoring
        versions = all_versions(session)
        apart = [*_differing_versions(session, versions)]
        count, changed = _check_frozen_contents(session)
        return [
            compare_records(
                "frozen versions", f"{len(versions):,}, as frozen", apart, WRONG, restore
            ),
            compare_records("frozen content", f"{count:,}, as frozen", changed, WRONG, restore),
        ]


def _differing_versions(session: Session, versions: Any) -> Iterator[str]:
    """Each version that is not what was frozen, with what is wrong with it."""
    try:
        with as_written():
            logged = _logged_freezes(session)
    except StorageError:
        # Nothing follows from a log that cannot be read, which is named by itself.
        logged = None
    for row in versions:
        entry = None if logged is None else logged.pop(row.id, None)
        why = None
        if logged is not None and not _matches_log(row, entry):
            why = "the log says otherwise"
        why = why or _fault_of_version(session, row)
        if why is not None:
            yield f"{row.dataset}/{row.name} ({why})"
    for entry in (logged or {}).values():
        yield f"{entry.body.get('name')} of dataset {entry.dataset_id} (it is gone)"


def _logged_freezes(session: Session) -> dict[int, LogEntry]:
    """What the log says of each version by its id, but for datasets that were deleted."""
    found: dict[int, LogEntry] = {}
    entries = entries_of_kinds(session, ("freeze", "dataset_deleted"))
    for entry in shown_entries(session, entries):
        if entry.kind == "freeze":
            found[entry.body["version"]] = entry
        else:
            found = {key: at for key, at in found.items() if at.dataset_id != entry.dataset_id}
    return found


def _matches_log(row: Any, entry: LogEntry | None) -> bool:
    if entry is None:
        return False
    logged = (
        entry.dataset_id,
        entry.body.get("name"),
        entry.body.get("hash"),
        entry.at,
        entry.actor,
    )
    return logged == (row.dataset_id, row.name, row.hash, row.created, row.actor)


def _fault_of_version(session: Session, row: Any) -> str | None:
    """What in a version does not follow from its groups; None: all of it does."""
    rows = [item._mapping for item in annotation_rows(session, row.id)]
    try:
        with as_written():
            counts, policy = parse(row.counts), policy_from_json(parse(row.policy))
            members = sum(item["member"] for item in rows)
            left_out = sum(counts["left_out"].values())
            tracks = parse(row.tracks) if row.tracks else {}
            found = version_hash(policy, row.solver_version, rows, tracks)
    except StorageError:
        return "it cannot be read"
    if (members, len(rows) - members) != (counts["groups"], left_out):
        return f"{len(rows):,} groups of {counts['groups'] + left_out:,} are there"
    if found != row.hash or policy.hash != row.policy_hash:
        return "its hash does not follow from its groups"
    lost = set(tracks.values()) - known_frozen(session, row.dataset_id, tracks.values())
    if lost:
        return f"{len(lost):,} of its tracks are missing"
    without = members_without_content(session, row.id)
    return f"frozen content is missing, of {without[0]} first" if without else None


def _check_frozen_contents(session: Session) -> tuple[int, list[str]]:
    """How many frozen contents there are, and which of them are damaged or missing."""
    count, apart = 0, lost_calibrations(session)
    for rows in frozen_batches(session):
        count += len(rows)
        named: dict[int, set[str]] = {}
        for row in rows:
            try:
                named.setdefault(row.dataset_id, set()).update(_keys_named_in(row.key, row.body))
            except StorageError:
                apart.append(row.key)
        for dataset_id, keys in named.items():
            apart += sorted(keys - known_frozen(session, dataset_id, keys))
    return count, list(dict.fromkeys(apart))


def _keys_named_in(key: str, body: bytes | None) -> set[str]:
    """Keys of what a content names.

    Raises:
        DamagedError: The content is not what its key says.
    """
    if body is None:
        return set()
    with as_written():
        if not key.startswith((SAID, SOLUTION)):
            unpack(body)
        if fitting_key(key, body) != key:
            raise ValueError(f"{key} is the key of other content")
        if key.startswith(SAID):
            return named_texts(read_json(body))
        return calibration_names(read_json(body)) if key.startswith(SOLUTION) else set()
