"""Datasets: made, named, listed, judged by a policy, deleted, with the licence of their sources."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from app.db.idempotency import without_pending_response
from app.db.log import NewLogEntry, append_entries
from app.db.session import Session, now
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets import queries as removal
from app.features.datasets.queries import (
    delete_unused_calibrations_of_keys,
    find_dataset,
    has_match,
    insert_dataset_row,
    list_dataset_rows,
    list_group_ids,
    list_unused_calibrations,
    parse_stored_policy,
    read_dataset_names,
    update_policy,
)
from app.features.independent_annotations.queries import (
    CopyDatasetKey,
    insert_copy_dataset,
    list_copy_dataset_ids,
    list_copy_datasets,
)
from app.features.people.visibility_queries import COPIES, EVERYTHING, Visibility, has_hidden_groups
from app.features.queue.queries import count_states
from app.features.queue.refresh_queries import refresh_queue
from app.formats.issia import MATCH as ISSIA
from app.formats.manifest import LICENCES, UNKNOWN_LICENCE
from app.json_text import quote_text
from app.sample.fixture import LEAGUES
from app.soccer.codec import policy_to_json
from app.soccer.policy import Policy
from app.wording import is_one_line, is_visible


class HasMatch(Protocol):
    """Anything that has the name of its match."""

    @property
    def match(self) -> str:
        """Its name; empty: groups without a match."""


State = TypeVar("State", bound=HasMatch)


def filter_by_match(states: Iterable[State], match: str | None) -> list[State]:
    """The states of one match, or of all where ``match`` is None."""
    return [state for state in states if match in (None, state.match)]


def filter_by_existing_match(
    states: Iterable[State], match: str | None, dataset: str
) -> list[State]:
    """``filter_by_match``.

    Raises:
        NotFoundError: The dataset has no match of that name.
    """
    chosen = filter_by_match(states, match)
    if match is not None and not chosen:
        raise unknown_match_error(dataset, match)
    return chosen


def unknown_match_error(dataset: str, match: str) -> NotFoundError:
    """The error where a dataset has no match of some name."""
    return NotFoundError(f'"{dataset}" has no match {match}')


MAX_TITLE = 80
"""Characters of what only people read."""
_NAME = re.compile(r"[A-Za-z0-9](?:[A-Za-z0-9._ -]{0,98}[A-Za-z0-9._-])?")


def require_valid_name(
    name: str, what: str, *, digits: bool = False, pointer: str | None = "/name"
) -> None:
    """Raise unless something that addresses and files name can be called so.

    Args:
        name: The name.
        what: What is called so, such as ``a dataset``.
        digits: Whether digits alone are a name, too, and not taken for an id.
        pointer: Where the name stands in a request.

    Raises:
        InputError: It cannot.
    """
    if not _NAME.fullmatch(name) or (name.isdigit() and not digits):
        alone = "" if digits else ", not digits alone"
        raise InputError(
            f"{quote_text(name)} cannot be the name of {what}",
            hint=f"Use letters, digits, spaces and . _ -, up to 100, with no space at either end{alone}.",
            pointer=pointer,
        )


def strip_and_check_title(text: str, what: str) -> str:
    """What people read as the name of something, without white space around it.

    Args:
        text: As it was typed.
        what: What is called so, such as ``a batch``.

    Raises:
        InputError: It is empty, too long, or holds control characters.
    """
    text = text.strip()
    if not is_visible(text) or len(text) > MAX_TITLE:
        raise InputError(
            f"the name of {what} must have 1 to {MAX_TITLE} characters", pointer="/name"
        )
    if not is_one_line(text):
        raise InputError(
            f"the name of {what} must be one line without control characters", pointer="/name"
        )
    return text


@dataclass(frozen=True)
class Dataset:
    """A dataset and how far it is; the four states add up to ``groups``.

    ``hides_groups``: whether groups of it are hidden from whoever asks, who annotates blind; which, and
    how many, they are not told.
    """

    id: int
    name: str
    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int
    policy: Policy
    created: str
    hides_groups: bool


@dataclass(frozen=True)
class DatasetHead:
    """A dataset without how far it is, for which all its groups would be counted."""

    id: int
    name: str
    created: str
    policy: Policy


def insert_dataset(
    session: Session,
    name: str,
    policy: Policy,
    actor: str,
    copies: CopyDatasetKey | None = None,
    *,
    hidden: bool = False,
) -> int:
    """Insert a dataset and its log entry; returns its id.

    Args:
        session: A transaction that writes.
        name: What it is called.
        policy: Its thresholds.
        actor: Who makes it.
        copies: Of what it holds copies.
        hidden: Only people with a role in it see it, as with copies; not who has one everywhere.
    """
    require_valid_name(name, "a dataset")
    at = now()
    hidden = hidden or copies is not None
    identity = insert_dataset_row(session, name, policy, at, copies=hidden)
    body = {"name": name, "policy": policy_to_json(policy)}
    if copies is not None:
        insert_copy_dataset(session, identity, copies)
        body["copies"] = vars(copies)
    append_entries(session, [NewLogEntry("dataset", actor, at, body, dataset_id=identity)])
    return identity


def list_datasets(
    store: Store, visibility: Visibility = EVERYTHING, own: Collection[int] = ()
) -> list[Dataset]:
    """The datasets that somebody sees, by name; those of copies are in no list.

    ``own`` are the ids of datasets in which they have a role: of those that are hidden from
    others (their practice) the list has theirs.
    """
    with store.read() as session:
        hidden = frozenset(own) - list_copy_dataset_ids(session) if own else frozenset[int]()
        rows = [row for row in list_dataset_rows(session) if row.id <= COPIES or row.id in hidden]
        return _build_datasets_with_counts(
            session, [row for row in rows if visibility.sees(row.id)]
        )


def get_dataset(store: Store, dataset: str | int) -> Dataset:
    """A dataset by its name or its id, and how far it is.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _build_datasets_with_counts(session, [_require_dataset_row(session, dataset)])[0]


def get_dataset_head(store: Store, dataset: str | int) -> DatasetHead:
    """A dataset by its name or its id, uncounted; raises NotFoundError when there is none."""
    with store.read() as session:
        return read_dataset_head(session, dataset)


def dataset_id(store: Store, dataset: str | int) -> int:
    """The id of a dataset; raises NotFoundError when there is none."""
    with store.read() as session:
        return require_dataset_id(session, dataset)


def unknown_dataset_error(store: Store, dataset: str | int) -> NotFoundError:
    """That there is no such dataset, or not for whoever asks."""
    with store.read() as session:
        return NotFoundError.dataset(dataset, read_dataset_names(session))


def require_dataset_id(session: Session, dataset: str | int) -> int:
    """``dataset_id`` within a session."""
    return int(_require_dataset_row(session, dataset).id)


def read_dataset_head(session: Session, dataset: str | int) -> DatasetHead:
    """A dataset within a session, uncounted; raises NotFoundError when there is none."""
    row = _require_dataset_row(session, dataset)
    return DatasetHead(row.id, row.name, row.created, parse_stored_policy(row.policy))


def require_dataset_with_matches(
    session: Session, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetHead:
    """The head of a dataset that has all of these matches.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    found = read_dataset_head(session, dataset)
    for match in matches or ():
        if not has_match(session, found.id, match):
            raise unknown_match_error(found.name, match)
    return found


def save_policy(session: Session, dataset_id: int, policy: Policy, actor: str) -> None:
    """Judge a dataset by another policy; what that leaves without a solution is stale."""
    update_policy(session, dataset_id, policy)
    body = {"policy": policy_to_json(policy)}
    append_entries(session, [NewLogEntry("policy", actor, now(), body, dataset_id=dataset_id)])
    refresh_queue(session, list_group_ids(session, dataset_id))


def _require_dataset_row(session: Session, dataset: str | int) -> Any:
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError.dataset(dataset, read_dataset_names(session))
    return row


def _build_datasets_with_counts(session: Session, rows: Sequence[Any]) -> list[Dataset]:
    states: dict[int, Counter[str]] = {}
    for row in count_states(session, [row.id for row in rows]):
        counts = states.setdefault(row.dataset_id, Counter())
        counts.update({row.status: row.groups, "groups": row.groups, "solved": int(row.solved)})
    return [_build_dataset_with_counts(row, states.get(row.id, Counter())) for row in rows]


def _build_dataset_with_counts(row: Any, counts: Counter[str]) -> Dataset:
    return Dataset(
        id=row.id,
        name=row.name,
        created=row.created,
        policy=parse_stored_policy(row.policy),
        groups=counts["groups"],
        solved=counts["solved"],
        accepted=counts["accepted"],
        rejected=counts["rejected"],
        deferred=counts["deferred"],
        unreviewed=counts["unreviewed"],
        hides_groups=has_hidden_groups(row.id),
    )


def find_licence(match: str) -> str:
    """The terms of the source that a match is from."""
    return LICENCES.get(_find_source_of_match(match), UNKNOWN_LICENCE)


def join_licences(matches: Iterable[str]) -> str:
    """The terms of all sources, one after another."""
    return " ".join(sorted({find_licence(match) for match in matches})) or UNKNOWN_LICENCE


def _find_source_of_match(match: str) -> str:
    parts = match.split("/")
    if parts[0] in LEAGUES:
        return "sample"
    if match == ISSIA:
        return "issia"
    return "soccernet" if len(parts) == 3 else ""


CALIBRATIONS_AT_ONCE = 2000
"""Calibrations a transaction: nobody who saves waits long for it."""


def delete_unused_calibrations(store: Store, wanted: Callable[[], bool] = lambda: True) -> int:
    """Delete them in short transactions; returns how many there were.

    While a group waits to be solved they stay: its solver may have read them already. The rest is
    left once it is no longer ``wanted``.
    """
    with store.read() as session:
        keys = list_unused_calibrations(session)
    gone = 0
    for start in range(0, len(keys), CALIBRATIONS_AT_ONCE):
        if not wanted():
            break
        with store.write() as session:
            gone += delete_unused_calibrations_of_keys(
                session, keys[start : start + CALIBRATIONS_AT_ONCE]
            )
    return gone


KIND = "dataset_deleted"
CHUNK = 500
"""Solutions a transaction."""


@dataclass(frozen=True)
class DatasetContents:
    """What belongs to a dataset; ``counts`` by groups, views, verdicts, versions and so on."""

    id: int
    name: str
    counts: dict[str, int]


def read_contents(store: Store, dataset: str | int) -> DatasetContents:
    """The counts of everything that deleting a dataset would remove.

    Raises:
        NotFoundError: There is no such dataset.
    """
    with store.read() as session:
        return _read_contents_in_session(session, read_dataset_head(session, dataset).id)


def delete_dataset(
    store: Store, dataset: str | int, *, confirm: str, actor: str, afresh: Policy | None = None
) -> DatasetContents:
    """Delete a dataset with everything that belongs to it; returns what that was.

    What was computed goes first, in short transactions: killed in between, it is computed again.
    What was said goes at the end, all at once. The log keeps every entry and gains one.

    Args:
        store: The database.
        dataset: Name or id.
        confirm: The name, once more.
        actor: Who wants it.
        afresh: Policy of an empty dataset of the same name, which is made in its place with its
            roles, tokens and webhooks; None: none is.

    Raises:
        NotFoundError: There is no such dataset.
        ConflictError: ``confirm`` is another name; nothing is deleted.
    """
    found = read_contents(store, dataset)
    if confirm != found.name:
        raise ConflictError(
            f'`confirm` is not the name of the dataset, which is "{found.name}"',
            hint="Send the dataset's name as confirm: a deleted dataset cannot be restored.",
            pointer="/confirm",
        )
    identity = dataset_id(store, found.id)
    with store.read() as session:
        copies = list_copy_datasets(session, identity)
    with without_pending_response():
        for row in copies:
            delete_dataset(store, row.dataset_id, confirm=row.name, actor=actor)
    _delete_solutions(store, identity)
    with store.write() as session:
        contents = _read_contents_in_session(session, identity)
        # They went with the copies.
        contents.counts["annotations"] += found.counts["annotations"]
        removal.reserve_used_ids(session)
        heir = None if afresh is None else removal.move_access_to_next_dataset(session, identity)
        body = {"name": contents.name, "counts": contents.counts, "heir": heir}
        append_entries(session, [NewLogEntry(KIND, actor, now(), body, identity)])
        removal.delete_dataset_rows(session, identity)
        if afresh is not None:
            assert insert_dataset(session, contents.name, afresh, actor) == heir
        session.respond(contents)
    delete_unused_calibrations(store)
    return contents


def _read_contents_in_session(session: Session, identity: int) -> DatasetContents:
    name = read_dataset_head(session, identity).name
    return DatasetContents(identity, name, removal.count_dataset_contents(session, identity))


def _delete_solutions(store: Store, identity: int) -> None:
    """Delete what was computed."""
    with store.read() as session:
        solutions = removal.list_solution_ids(session, identity)
    for start in range(0, len(solutions), CHUNK):
        with store.write() as session:
            removal.delete_solutions(session, solutions[start : start + CHUNK])
