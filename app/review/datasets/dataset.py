"""Datasets: made, listed, and judged by a policy."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

from app.errors import NotFoundError
from app.review.datasets.match_choice import no_match
from app.review.datasets.naming import require_name
from app.soccer.policy import Policy
from app.store.clock import now
from app.store.codecs import policy_to_json
from app.store.copy_datasets import CopiesOf, copy_dataset_ids, insert_copy_dataset
from app.store.datasets import (
    dataset_names,
    dataset_rows,
    find_dataset,
    group_ids,
    has_match,
    insert_dataset_row,
    policy_of,
    update_policy,
)
from app.store.listing import count_states
from app.store.log import Entry, append
from app.store.queue import refresh_queue
from app.store.reader import is_blind
from app.store.session import Session
from app.store.sight import COPIES, EVERYTHING, Sight
from app.store.store import Store


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
    copies: CopiesOf | None = None,
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
    require_name(name, "a dataset")
    at = now()
    hidden = hidden or copies is not None
    identity = insert_dataset_row(session, name, policy, at, copies=hidden)
    body = {"name": name, "policy": policy_to_json(policy)}
    if copies is not None:
        insert_copy_dataset(session, identity, copies)
        body["copies"] = vars(copies)
    append(session, [Entry("dataset", actor, at, body, dataset_id=identity)])
    return identity


def list_datasets(
    store: Store, sight: Sight = EVERYTHING, own: Collection[int] = ()
) -> list[Dataset]:
    """The datasets that somebody sees, by name; those of copies are in no list.

    ``own`` are the ids of datasets in which they have a role: of those that are hidden from
    others (their practice) the list has theirs.
    """
    with store.read() as session:
        hidden = frozenset(own) - copy_dataset_ids(session) if own else frozenset[int]()
        rows = [row for row in dataset_rows(session) if row.id <= COPIES or row.id in hidden]
        return _datasets(session, [row for row in rows if sight.sees(row.id)])


def get_dataset(store: Store, dataset: str | int) -> Dataset:
    """A dataset by its name or its id, and how far it is.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _datasets(session, [_need(session, dataset)])[0]


def get_dataset_head(store: Store, dataset: str | int) -> DatasetHead:
    """A dataset by its name or its id, uncounted; raises NotFoundError when there is none."""
    with store.read() as session:
        return read_dataset_head(session, dataset)


def dataset_id(store: Store, dataset: str | int) -> int:
    """The id of a dataset; raises NotFoundError when there is none."""
    with store.read() as session:
        return need_dataset(session, dataset)


def need_dataset(session: Session, dataset: str | int) -> int:
    """``dataset_id`` within a session."""
    return int(_need(session, dataset).id)


def read_dataset_head(session: Session, dataset: str | int) -> DatasetHead:
    """A dataset within a session, uncounted; raises NotFoundError when there is none."""
    row = _need(session, dataset)
    return DatasetHead(row.id, row.name, row.created, policy_of(row.policy))


def require_matches(
    session: Session, dataset: str | int, matches: Collection[str] | None = None
) -> DatasetHead:
    """The head of a dataset that has all of these matches.

    Raises:
        NotFoundError: There is no such dataset or match.
    """
    found = read_dataset_head(session, dataset)
    for match in matches or ():
        if not has_match(session, found.id, match):
            raise no_match(found.name, match)
    return found


def save_policy(session: Session, dataset_id: int, policy: Policy, actor: str) -> None:
    """Judge a dataset by another policy; what that leaves without a solution is stale."""
    update_policy(session, dataset_id, policy)
    body = {"policy": policy_to_json(policy)}
    append(session, [Entry("policy", actor, now(), body, dataset_id=dataset_id)])
    refresh_queue(session, group_ids(session, dataset_id))


def _need(session: Session, dataset: str | int) -> Any:
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError.dataset(dataset, dataset_names(session))
    return row


def _datasets(session: Session, rows: Sequence[Any]) -> list[Dataset]:
    states: dict[int, Counter[str]] = {}
    for row in count_states(session, [row.id for row in rows]):
        counts = states.setdefault(row.dataset_id, Counter())
        counts.update({row.status: row.groups, "groups": row.groups, "solved": int(row.solved)})
    return [_dataset(row, states.get(row.id, Counter())) for row in rows]


def _dataset(row: Any, counts: Counter[str]) -> Dataset:
    return Dataset(
        id=row.id,
        name=row.name,
        created=row.created,
        policy=policy_of(row.policy),
        groups=counts["groups"],
        solved=counts["solved"],
        accepted=counts["accepted"],
        rejected=counts["rejected"],
        deferred=counts["deferred"],
        unreviewed=counts["unreviewed"],
        hides_groups=is_blind(row.id),
    )
