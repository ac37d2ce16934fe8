"""Group edits: what is said of many groups at once, each with an entry of the log of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from app.db.json_columns import Json
from app.db.log import Entry, append
from app.db.session import Session, now
from app.features.groups.edit import Edit
from app.features.groups.edit_codec import edit_and_inverse_to_json
from app.features.groups.queries import StoredGroup, read_groups
from app.features.groups.revision_queries import next_revision, save_revision
from app.features.queue.refresh_queries import refresh_queue

_BATCH = 100


def edit_groups(
    session: Session,
    dataset_id: int,
    kind: str,
    ids: Sequence[int],
    edits_of: Callable[[Mapping[int, StoredGroup]], Mapping[int, Edit]],
    *,
    actor: str,
    body: Mapping[str, Json] | None = None,
    always_logged: int | None = None,
) -> int:
    """Edit groups; one that the edit leaves as it is gets neither revision nor entry.

    Args:
        session: A write session.
        dataset_id: Their dataset.
        kind: Of the entries.
        ids: The groups.
        edits_of: The edits of some groups, by id; one that has none is left alone.
        actor: Who says so.
        body: What each entry says beside the edit and its inverse.
        always_logged: A group that gets its entry even where nothing changes: the entry says more than the edit.

    Returns:
        How many groups have an entry.
    """
    at, count = now(), 0
    for start in range(0, len(ids), _BATCH):
        entries, changed = list[Entry](), list[int]()
        some = read_groups(session, ids[start : start + _BATCH])
        for number, edit in edits_of(some).items():
            stored = some[number]
            group = edit.apply(stored.group)
            if group == stored.group and number != always_logged:
                continue
            save_revision(session, stored, next_revision(stored, group, at))
            step = edit_and_inverse_to_json(edit, edit.inverse(stored.group))
            entries.append(Entry(kind, actor, at, {**(body or {}), **step}, dataset_id, number))
            changed.append(number)
        append(session, entries)
        refresh_queue(session, changed)
        count += len(changed)
    return count
