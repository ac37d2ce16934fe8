"""Heads: the few numbers and digests of a group that name its state; nothing is decoded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import bindparam, func, select
from sqlalchemy.orm import Session

from app.store.models import DatasetModel, GroupModel, SolutionModel, VerdictModel
from app.store.solutions import is_current

_LAST = (
    select(func.coalesce(func.max(VerdictModel.id), 0))
    .where(VerdictModel.group_id == GroupModel.id)
    .correlate(GroupModel)
    .scalar_subquery()
    .label("last")
)
_HEAD = (
    select(GroupModel.inputs_hash, GroupModel.revision, DatasetModel.policy_hash, _LAST)
    .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
    .where(GroupModel.id == bindparam("group"))
)


def find_head(session: Session, group_id: int) -> Any | None:
    """Row (inputs_hash, revision, policy_hash, last) of a group; ``last`` is its newest verdict."""
    return session.execute(_HEAD, {"group": group_id}).one_or_none()


def read_heads(session: Session, group_ids: Sequence[int]) -> Sequence[Any]:
    """Rows as of ``find_head`` with ``id``, the ``policy`` and the ``summary`` of the solution."""
    statement = (
        select(
            GroupModel.id,
            GroupModel.inputs_hash,
            GroupModel.revision,
            DatasetModel.policy,
            DatasetModel.policy_hash,
            SolutionModel.summary,
            _LAST,
        )
        .join(DatasetModel, DatasetModel.id == GroupModel.dataset_id)
        .outerjoin(SolutionModel, is_current())
        .where(GroupModel.id.in_(group_ids))
    )
    return session.execute(statement).all()
