"""Accepted noise in the database: how noisy balls of cameras and people are, unlike the dataset's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from sqlalchemy import select, update

from app.canonical import canonical
from app.db.json_columns import Json, as_written, parse
from app.db.session import Session
from app.features.datasets.tables import DatasetModel

NOISE = "noise"
"""Kind of the log's entries on noise: what is accepted for a dataset, and one for each group."""


class Factor(NamedTuple):
    """How noisy balls of a camera that a person places are beside the dataset's.

    Attributes:
        camera: Key of a static camera; None: any other.
        person: Who places the ball; None: anybody else, or the dataset itself.
        ratio: Of both sigmas; one where they may be alike.
    """

    camera: str | None
    person: str | None
    ratio: float


Factors = tuple[Factor, ...]


def read_factors(session: Session, dataset_id: int) -> Factors:
    """The factors that are accepted for a dataset; none where all balls are alike."""
    return factors_of(
        session.scalar(select(DatasetModel.noise).where(DatasetModel.id == dataset_id))
    )


def factors_of(text: str | None) -> Factors:
    """The factors that a dataset's row holds."""
    if text is None:
        return ()
    with as_written():
        return tuple(Factor(*row) for row in parse(text))


def write_factors(session: Session, dataset_id: int, factors: Factors) -> None:
    """Accept factors for a dataset; its groups are the caller's to change."""
    text = canonical(factors_to_json(factors)) if factors else None
    mine = DatasetModel.id == dataset_id
    session.execute(update(DatasetModel).where(mine).values(noise=text))


def factors_to_json(factors: Factors) -> Json:
    """``[[camera, person, ratio], ...]``."""
    return [list(item) for item in factors]


def factor_of(factors: Sequence[Factor], camera: str | None, person: str | None) -> float:
    """How noisy a ball is beside the dataset's; a camera or person that is not named is any other."""
    known = {(item.camera, item.person): item.ratio for item in factors}
    cameras, people = {item.camera for item in factors}, {item.person for item in factors}
    place = camera if camera in cameras else None, person if person in people else None
    return known.get(place, 1.0)
