"""Datasets: made, listed, and judged by a policy."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import ColumnElement, Integer, cast, func, insert, select, update

from app.errors import InputError, NotFoundError
from app.soccer.policy import Policy
from app.store.clock import now
from app.store.codecs import canonical, parse, policy_from_json, policy_to_json
from app.store.group_rows import next_id
from app.store.log import Entry, append
from app.store.models import DatasetModel, GroupModel, QueueModel
from app.store.queue import refresh_queue
from app.store.session import Session, Store

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._ -]{0,99}")


@dataclass(frozen=True)
class Dataset:
    """A dataset and how far it is; the four states add up to ``groups``."""

    id: int
    name: str
    created: str
    policy: Policy
    groups: int
    solved: int
    accepted: int
    rejected: int
    deferred: int
    unreviewed: int


def insert_dataset(session: Session, name: str, policy: Policy, actor: str) -> int:
    """Insert a dataset and its log entry; returns its id."""
    require_name(name)
    identity, at = next_id(session, DatasetModel), now()
    body = {"name": name, "policy": policy_to_json(policy)}
    values = {"id": identity, "name": name, "created": at, **_policy_values(policy)}
    session.execute(insert(DatasetModel), [values])
    append(session, [Entry("dataset", actor, at, body, dataset_id=identity)])
    return identity


def require_name(name: str, pointer: str = "/name") -> None:
    """Raise InputError where a dataset cannot be called so."""
    if not _NAME.fullmatch(name) or name.isdigit():
        raise InputError(
            f'"{name}" cannot be the name of a dataset',
            hint="Use letters, digits, spaces and . _ -, up to 100, not digits alone.",
            pointer=pointer,
        )


def list_datasets(store: Store) -> list[Dataset]:
    """All datasets, by name."""
    with store.read() as session:
        rows = session.execute(select(*_COLUMNS).order_by(DatasetModel.name)).all()
        return _datasets(session, rows)


def get_dataset(store: Store, dataset: str | int) -> Dataset:
    """A dataset by its name or its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return read_dataset(session, dataset)


def dataset_id(store: Store, dataset: str | int) -> int:
    """The id of a dataset; raises NotFoundError when there is none."""
    with store.read() as session:
        return need_dataset(session, dataset)


def need_dataset(session: Session, dataset: str | int) -> int:
    """``dataset_id`` within a session."""
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError(f'there is no dataset "{dataset}"')
    return int(row.id)


def read_dataset(session: Session, dataset: str | int) -> Dataset:
    """``get_dataset`` within a session."""
    row = find_dataset(session, dataset)
    if row is None:
        raise NotFoundError(f'there is no dataset "{dataset}"')
    return _datasets(session, [row])[0]


def save_policy(session: Session, dataset_id: int, policy: Policy, actor: str) -> None:
    """Judge a dataset by another policy; what that leaves without a solution is stale."""
    values = _policy_values(policy)
    session.execute(update(DatasetModel).where(DatasetModel.id == dataset_id).values(values))
    body = {"policy": policy_to_json(policy)}
    append(session, [Entry("policy", actor, now(), body, dataset_id=dataset_id)])
    groups = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    refresh_queue(session, list(session.scalars(groups)))


def find_dataset(session: Session, dataset: str | int) -> Any:
    """The row of a dataset by name or id, or None."""
    by_id = isinstance(dataset, int) or (dataset.isascii() and dataset.isdigit())
    where: ColumnElement[bool] = (
        DatasetModel.id == int(dataset) if by_id else DatasetModel.name == dataset
    )
    if by_id and int(dataset) > 2**63 - 1:
        return None
    return session.execute(select(*_COLUMNS).where(where)).one_or_none()


def _policy_values(policy: Policy) -> dict[str, str]:
    return {"policy": canonical(policy_to_json(policy)), "policy_hash": policy.hash}


def _datasets(session: Session, rows: Sequence[Any]) -> list[Dataset]:
    statement = (
        select(
            QueueModel.dataset_id,
            QueueModel.status,
            func.count(),
            func.sum(cast(QueueModel.solved, Integer)),
        )
        .where(QueueModel.dataset_id.in_([row.id for row in rows]))
        .group_by(QueueModel.dataset_id, QueueModel.status)
    )
    states: dict[int, Counter[str]] = {}
    for dataset_id, status, groups, solved in session.execute(statement):
        counts = states.setdefault(dataset_id, Counter())
        counts.update({status: groups, "groups": groups, "solved": int(solved)})
    return [_dataset(row, states.get(row.id, Counter())) for row in rows]


def _dataset(row: Any, counts: Counter[str]) -> Dataset:
    return Dataset(
        id=row.id,
        name=row.name,
        created=row.created,
        policy=policy_from_json(parse(row.policy)),
        groups=counts["groups"],
        solved=counts["solved"],
        accepted=counts["accepted"],
        rejected=counts["rejected"],
        deferred=counts["deferred"],
        unreviewed=counts["unreviewed"],
    )


_COLUMNS = tuple(DatasetModel.__table__.columns)
