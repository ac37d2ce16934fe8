"""Changes: what others want to hear of, read from the log, whoever wrote it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

from app.db.log import find_newest_entry_id
from app.db.session import Session
from app.db.store import Store
from app.features.datasets.queries import read_dataset_names
from app.features.groups.revision_queries import (
    StoredChange,
    iterate_changes_after_entry,
    list_groups_solved_after,
)
from app.features.groups.state import read_etags
from app.features.solutions.queries import find_newest_solution_id

MANY = 200
"""So many groups of one dataset at once are told as one change of the dataset."""
FAR = 5000
"""A client that missed more entries than this has to read everything again."""
COMMENT = "comment"
"""Kind of a change of what people say to each other about a group; the group is what it was."""
EVERYTHING = "everything"
"""Kind of a change of a dataset in which nothing can be taken to be as it was."""
SOLVED = "solved"
"""Kind of a change that nobody said: a solution arrived."""


@dataclass(frozen=True)
class LoggedChange:
    """A group that is not what it was, or, without a group, a dataset.

    Attributes:
        id: Id of the last log entry that it tells of; None for what is not logged.
        dataset: Its name; None where it is gone.
        etag: Of the group as it is now.
        kind: As in the log, or ``solved``.
        actor: Who did it last; None where nobody did.
    """

    id: int | None
    dataset_id: int
    dataset: str | None
    kind: str
    actor: str | None
    group_id: int | None = None
    etag: str | None = None


@dataclass(frozen=True)
class NewChanges:
    """What there is to tell at one moment.

    Attributes:
        entry: Id of the log's last entry; 0 for an empty log.
        solution: Id of the last solution; 0 where there is none.
        changes: By the entry after which they came.
        solved: Groups that got a solution and are in none of the changes after the entry, by entry and solution
            after which they did; datasets as a whole where they are many.
    """

    entry: int
    solution: int
    changes: Mapping[int, list[LoggedChange]]
    solved: Mapping[tuple[int, int], list[LoggedChange]]


def read_newest_entry_id(store: Store) -> int:
    """Id of the log's last entry; 0 for an empty log."""
    with store.read() as session:
        return find_newest_entry_id(session)


def find_newest_entry_and_solution_ids(store: Store) -> tuple[int, int]:
    """Ids of the log's last entry and of the last solution; 0 where there is none."""
    with store.read() as session:
        return find_newest_entry_id(session), find_newest_solution_id(session)


def read_new_changes(store: Store, places: Collection[tuple[int, int]]) -> NewChanges:
    """What has changed since some places: each an entry of the log and a solution."""
    with store.read() as session:
        newest, last = find_newest_entry_id(session), find_newest_solution_id(session)
        changes = {entry: read_changes(session, entry) for entry, _ in places if entry < newest}
        solved = {
            (entry, solution): read_newly_solved_groups(
                session, solution, {item.group_id for item in changes.get(entry, ())}
            )
            for entry, solution in places
            if solution < last
        }
    return NewChanges(newest, last, changes, solved)


def read_changes(session: Session, after: int) -> list[LoggedChange]:
    """What has changed since an entry of the log, each group once, in the order of the log."""
    newest = find_newest_entry_id(session)
    if newest - after > FAR:
        names = read_dataset_names(session)
        return [LoggedChange(newest, key, name, EVERYTHING, None) for key, name in names.items()]
    return _add_names_and_etags(session, iterate_changes_after_entry(session, after))


def read_newly_solved_groups(
    session: Session, after: int, known: Iterable[int | None] = ()
) -> list[LoggedChange]:
    """Groups that got a solution after another one, datasets as a whole where they are many; ``known`` are told
    of already."""
    if find_newest_solution_id(session) - after > FAR:
        names = read_dataset_names(session)
        return [LoggedChange(None, key, name, SOLVED, None) for key, name in names.items()]
    skipped = set(known)
    found = [
        StoredChange(None, dataset_id, SOLVED, None, group_id)
        for dataset_id, group_id in list_groups_solved_after(session, after)
        if group_id not in skipped
    ]
    return _add_names_and_etags(session, found)


def _add_names_and_etags(session: Session, found: Iterable[StoredChange]) -> list[LoggedChange]:
    """Changes with names and ETags; a dataset with too many of them is told as a whole."""
    items = _select_newest_change_per_group(found)
    sizes = Counter(item.dataset_id for item in items if item.group_id is not None)
    items = _select_newest_change_per_group(
        replace(item, group_id=None) if sizes[item.dataset_id] > MANY else item for item in items
    )
    names = read_dataset_names(session)
    # Of a dataset that is gone there is one thing to tell.
    ends = {item.dataset_id: item for item in items if item.dataset_id not in names}
    items = [item for item in items if ends.get(item.dataset_id, item) is item]
    etags = read_etags(session, [item.group_id for item in items if item.group_id is not None])
    return [
        LoggedChange(
            item.id,
            item.dataset_id,
            names.get(item.dataset_id),
            item.kind,
            item.actor,
            item.group_id,
            None if item.group_id is None else etags[item.group_id],
        )
        for item in items
        # A group that is gone by now is told of by its dataset's own entries.
        if item.group_id is None or item.group_id in etags
    ]


def _select_newest_change_per_group(found: Iterable[StoredChange]) -> list[StoredChange]:
    """The last change of each group, and the last one of each kind of each dataset, in order.

    A comment stands beside the change of its group, which it does not hide.
    """
    last = {(item.dataset_id, item.group_id, _make_merge_key(item)): item for item in found}
    return sorted(last.values(), key=lambda item: item.id or 0)


def _make_merge_key(item: StoredChange) -> str:
    return item.kind if item.group_id is None or item.kind == COMMENT else ""
