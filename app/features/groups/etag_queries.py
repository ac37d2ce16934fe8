"""Heads: the few numbers and digests of a group that name its state; nothing is decoded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import bindparam, func, select

from app.db.session import Session
from app.features.datasets.tables import DatasetModel, GroupModel, StationModel, ViewModel
from app.features.findings.tables import DismissalModel
from app.features.solutions.queries import is_current
from app.features.solutions.tables import SolutionModel
from app.features.verdicts.tables import VerdictModel

_GROUP, _DATASET, _VERDICT = GroupModel.__table__, DatasetModel.__table__, VerdictModel.__table__
_DISMISSAL = DismissalModel.__table__
_LAST = (
    select(func.coalesce(func.max(_VERDICT.c.id), 0))
    .where(_VERDICT.c.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("last")
)
_DISMISSED = (
    select(func.coalesce(func.max(_DISMISSAL.c.id), 0))
    .where(_DISMISSAL.c.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("last_dismissal")
)
_STATIONS = (
    select(func.coalesce(func.sum(StationModel.revision), 0))
    .join_from(ViewModel, StationModel, StationModel.id == ViewModel.station_id)
    .where(ViewModel.group_id == _GROUP.c.id)
    .correlate(_GROUP)
    .scalar_subquery()
    .label("station_revisions")
)
_HEAD = (
    select(_GROUP.c.inputs_hash, _GROUP.c.revision, _DATASET.c.policy_hash, _LAST, _DISMISSED)
    .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
    .where(_GROUP.c.id == bindparam("group"))
)
_HEADS = (
    select(
        _GROUP.c.id,
        _GROUP.c.inputs_hash,
        _GROUP.c.revision,
        _DATASET.c.policy,
        _DATASET.c.policy_hash,
        SolutionModel.__table__.c.summary,
        _LAST,
        _DISMISSED,
        _STATIONS,
    )
    .join_from(_GROUP, _DATASET, _DATASET.c.id == _GROUP.c.dataset_id)
    .outerjoin(SolutionModel.__table__, is_current())
    .where(_GROUP.c.id.in_(bindparam("ids", expanding=True)))
)


def find_etag_row(session: Session, group_id: int) -> Any | None:
    """Row (inputs_hash, revision, policy_hash, last, last_dismissal) of a group; ``last`` is its
    newest verdict."""
    return session.execute(_HEAD, {"group": group_id}).one_or_none()


def read_etag_rows(session: Session, group_ids: Sequence[int]) -> Sequence[Any]:
    """Rows as of ``find_etag_row`` with ``id``, the ``policy``, the ``summary`` of the solution and the
    sum of its views' stations' revisions, ``station_revisions``."""
    return session.execute(_HEADS, {"ids": list(group_ids)}).all()
