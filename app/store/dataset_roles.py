"""Roles of people in single datasets, as the database has them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import delete, insert, select

from app.store.clock import now
from app.store.session import Session
from app.store.tables.groups import DatasetModel
from app.store.tables.people import DatasetRoleModel, PersonModel


def all_dataset_roles(session: Session) -> Sequence[Any]:
    """``person_id``, ``dataset_id``, ``dataset`` (its name) and ``role`` of everybody, by name."""
    statement = (
        select(
            DatasetRoleModel.person_id,
            DatasetRoleModel.dataset_id,
            DatasetModel.name.label("dataset"),
            DatasetRoleModel.role,
        )
        .join(DatasetModel, DatasetModel.id == DatasetRoleModel.dataset_id)
        .order_by(DatasetModel.name)
    )
    return session.execute(statement).all()


def members(session: Session, dataset_id: int, person_id: int | None = None) -> Sequence[Any]:
    """``id``, ``name``, ``everywhere``, ``role`` (here, or None) of one person, or of all who are
    not disabled."""
    one = PersonModel.disabled.is_(False) if person_id is None else PersonModel.id == person_id
    here = (DatasetRoleModel.person_id == PersonModel.id) & (
        DatasetRoleModel.dataset_id == dataset_id
    )
    statement = (
        select(
            PersonModel.id,
            PersonModel.name,
            PersonModel.role.label("everywhere"),
            DatasetRoleModel.role,
        )
        .outerjoin(DatasetRoleModel, here)
        .where(one)
        .order_by(PersonModel.name)
    )
    return session.execute(statement).all()


def set_dataset_role(
    session: Session, person_id: int, dataset_id: int, role: str | None, *, by: str
) -> None:
    """Give a person a role in a dataset; None: what they are everywhere counts there again."""
    mine = (DatasetRoleModel.person_id == person_id) & (DatasetRoleModel.dataset_id == dataset_id)
    session.execute(delete(DatasetRoleModel).where(mine))
    if role is not None:
        values = {"person_id": person_id, "dataset_id": dataset_id, "role": role}
        session.execute(insert(DatasetRoleModel), {**values, "given": now(), "given_by": by})
