"""Datasets in the database: their names and policies."""

from __future__ import annotations

from functools import lru_cache

from sqlalchemy import select
from sqlalchemy.orm import Session

from app.soccer.policy import Policy
from app.store.codecs import parse, policy_from_json
from app.store.models import DatasetModel


@lru_cache(maxsize=64)
def policy_of(text: str) -> Policy:
    """The policy of a dataset's row; one value a text, however often it is asked for."""
    return policy_from_json(parse(text))


def dataset_name(session: Session, dataset_id: int) -> str:
    """The name of a dataset that is there."""
    return session.scalars(select(DatasetModel.name).where(DatasetModel.id == dataset_id)).one()


def dataset_names(session: Session) -> dict[int, str]:
    """The name of every dataset, by id."""
    statement = select(DatasetModel.id, DatasetModel.name)
    return {row.id: row.name for row in session.execute(statement)}
