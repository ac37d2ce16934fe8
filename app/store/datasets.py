"""Datasets in the database: their names, policies and groups."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import lru_cache
from typing import Any

from sqlalchemy import exists, func, insert, select, update

from app.canonical import canonical
from app.finite import MAX_ID
from app.soccer.policy import Policy
from app.store.codecs import policy_from_json, policy_to_json
from app.store.session import Session
from app.store.sight import COPIES
from app.store.stored_json import as_written, parse
from app.store.tables.groups import DatasetModel, GroupModel
from app.store.tables.saved_views import COPIES_USED, UsedIdModel

_DIGITS = 19
"""No id has more."""
_ROWS = select(*DatasetModel.__table__.columns)


@lru_cache(maxsize=64)
def policy_of(text: str) -> Policy:
    """The policy of a dataset's row; one value a text, however often it is asked for."""
    with as_written():
        return policy_from_json(parse(text))


def dataset_rows(session: Session) -> Sequence[Any]:
    """The rows of all datasets, those of copies too, by name."""
    return session.execute(_ROWS.order_by(DatasetModel.name)).all()


def find_dataset(session: Session, dataset: str | int) -> Any | None:
    """The row of a dataset by name or id, or None."""
    if isinstance(dataset, int) or (
        len(dataset) <= _DIGITS and dataset.isascii() and dataset.isdigit()
    ):
        if int(dataset) > MAX_ID:
            return None
        statement = _ROWS.where(DatasetModel.id == int(dataset))
    elif "\0" in dataset:
        # PostgreSQL would refuse the question.
        return None
    else:
        statement = _ROWS.where(DatasetModel.name == dataset)
    return session.execute(statement).one_or_none()


def next_dataset_id(session: Session, *, copies: bool = False) -> int:
    """The id that the next dataset gets, or the next one of ``copies``."""
    column = DatasetModel.id
    mine = column > COPIES if copies else column <= COPIES
    newest = session.scalar(select(func.max(column)).where(mine))
    name = COPIES_USED if copies else DatasetModel.__tablename__
    used = session.scalar(select(UsedIdModel.id).where(UsedIdModel.table == name))
    return max(newest or 0, used or 0, COPIES if copies else 0) + 1


def insert_dataset_row(
    session: Session, name: str, policy: Policy, at: str, *, copies: bool = False
) -> int:
    """Insert a dataset, one of ``copies`` if so; returns its id."""
    identity = next_dataset_id(session, copies=copies)
    values = {"id": identity, "name": name, "created": at, **_policy_values(policy)}
    session.execute(insert(DatasetModel), [values])
    return identity


def update_policy(session: Session, dataset_id: int, policy: Policy) -> None:
    """Judge a dataset by another policy; the queue is the caller's to refresh."""
    mine = DatasetModel.id == dataset_id
    session.execute(update(DatasetModel).where(mine).values(_policy_values(policy)))


def group_ids(
    session: Session, dataset_id: int, matches: Collection[str] | None = None
) -> list[int]:
    """Ids of the groups of a dataset, of these matches where they are named, in order."""
    statement = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    if matches is not None:
        statement = statement.where(GroupModel.match.in_(matches))
    return list(session.scalars(statement.order_by(GroupModel.id)))


def has_more_groups(session: Session, dataset_id: int, count: int) -> bool:
    """Whether a dataset has more groups than that; no more are counted."""
    statement = select(GroupModel.id).where(GroupModel.dataset_id == dataset_id)
    return session.scalar(statement.offset(count).limit(1)) is not None


def has_match(session: Session, dataset_id: int, match: str) -> bool:
    """Whether a dataset has a group of a match; none is counted."""
    group = GroupModel
    found = exists().where(group.dataset_id == dataset_id, group.match == match)
    return bool(session.scalar(select(found)))


def dataset_name(session: Session, dataset_id: int) -> str:
    """The name of a dataset that is there."""
    return session.scalars(select(DatasetModel.name).where(DatasetModel.id == dataset_id)).one()


def dataset_names(session: Session) -> dict[int, str]:
    """The name of every dataset, by id."""
    statement = select(DatasetModel.id, DatasetModel.name)
    return {row.id: row.name for row in session.execute(statement)}


def _policy_values(policy: Policy) -> dict[str, str]:
    return {"policy": canonical(policy_to_json(policy)), "policy_hash": policy.hash}
