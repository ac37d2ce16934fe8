"""Frozen rows: all that versions keep, and what of it is not there, for whoever examines them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from sqlalchemy import ColumnElement, exists, func, or_, select, tuple_

from app.store.frozen import CALIBRATION
from app.store.session import Session
from app.store.tables.solutions import CalibrationModel
from app.store.tables.versions import FrozenModel, VersionGroupModel, VersionModel

_BATCH = 200


def frozen_batches(session: Session) -> Iterator[Sequence[Any]]:
    """Rows (dataset_id, key, body) of all frozen content, in batches that fit into memory."""
    place = tuple_(FrozenModel.dataset_id, FrozenModel.key)
    statement = (
        select(FrozenModel.dataset_id, FrozenModel.key, FrozenModel.body)
        .order_by(FrozenModel.dataset_id, FrozenModel.key)
        .limit(_BATCH)
    )
    rows = session.execute(statement).all()
    while rows:
        yield rows
        after = tuple_(rows[-1].dataset_id, rows[-1].key)
        rows = session.execute(statement.where(place > after)).all()


def lost_calibrations(session: Session) -> list[str]:
    """Keys of frozen calibrations whose body is neither there nor where the solver keeps it."""
    kept = CalibrationModel.key == func.replace(FrozenModel.key, CALIBRATION, "")
    statement = (
        select(FrozenModel.key)
        .outerjoin(CalibrationModel, kept)
        .where(FrozenModel.body.is_(None), CalibrationModel.key.is_(None))
        .order_by(FrozenModel.key)
    )
    return list(session.scalars(statement))


def members_without_content(session: Session, version_id: int) -> list[str]:
    """Keys of the members of a version whose annotations or solution are not there."""
    group = VersionGroupModel
    statement = (
        select(group.key)
        .join(VersionModel, VersionModel.id == group.version_id)
        .where(group.version_id == version_id, group.member)
        .where(or_(~_is_there(group.said), ~_is_there(group.solution)))
        .order_by(group.position)
    )
    return list(session.scalars(statement))


def _is_there(key: Any) -> ColumnElement[bool]:
    mine = FrozenModel.dataset_id == VersionModel.dataset_id
    return exists().where(mine, FrozenModel.key == key)
