"""Groups as they stand, with the solution that fits them: all in order, or those that changed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import func, select

from app.store.session import Session
from app.store.solutions import is_current
from app.store.tables.changes import GroupChangeModel
from app.store.tables.groups import DatasetModel, GroupModel
from app.store.tables.solutions import SolutionModel


def newest_change(session: Session) -> int:
    """Number of the last change of any group; 0 where there is none."""
    return session.scalar(select(func.max(GroupChangeModel.id))) or 0


def count_groups(session: Session, dataset_id: int) -> int:
    """How many groups a dataset has."""
    mine = GroupModel.dataset_id == dataset_id
    return session.scalar(select(func.count()).select_from(GroupModel).where(mine)) or 0


def count_changes(session: Session, dataset_id: int, after: int) -> int:
    """How many groups of a dataset have changed after a change."""
    statement = select(func.count()).select_from(GroupChangeModel)
    return session.scalar(statement.where(*_since(dataset_id, after))) or 0


def changed_ids(session: Session, dataset_id: int, after: int) -> list[int]:
    """Ids of the groups of a dataset that have changed after a change."""
    statement = select(GroupChangeModel.group_id).where(*_since(dataset_id, after))
    return list(session.scalars(statement))


def changed_groups(session: Session, dataset_id: int, after: int, limit: int) -> Sequence[Any]:
    """Groups of a dataset that have changed after a change, in the order of their last ones.

    Returns:
        Rows as of ``groups_from``, with ``change_id``.
    """
    statement = (
        _groups()
        .add_columns(GroupChangeModel.id.label("change_id"))
        .join(GroupChangeModel, GroupChangeModel.group_id == GroupModel.id)
        .where(*_since(dataset_id, after))
        .order_by(GroupChangeModel.id)
        .limit(limit)
    )
    return session.execute(statement).all()


def groups_from(session: Session, dataset_id: int, after: int, limit: int) -> Sequence[Any]:
    """Groups of a dataset in order, from the one after a number on.

    Returns:
        Rows (group_id, number, inputs_hash, solution_id or None, split, match, pitch_length,
        pitch_width); the solution is the one that fits the group as it is.
    """
    mine = (GroupModel.dataset_id == dataset_id, GroupModel.number > after)
    statement = _groups().where(*mine).order_by(GroupModel.number).limit(limit)
    return session.execute(statement).all()


def _groups() -> Any:
    group = GroupModel
    return (
        select(
            group.id.label("group_id"), group.number, group.inputs_hash,
            SolutionModel.id.label("solution_id"), group.split, group.match,
            group.pitch_length, group.pitch_width,
        )
        .join(DatasetModel, DatasetModel.id == group.dataset_id)
        .outerjoin(SolutionModel, is_current())
    )  # fmt: skip


def _since(dataset_id: int, after: int) -> tuple[Any, ...]:
    return GroupChangeModel.id > after, GroupChangeModel.dataset_id == dataset_id
