"""Gold groups in the database: what is true of them, and what their annotators begin with."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args

from sqlalchemy import delete, select, update

from app.db.dialects.statements import insert
from app.db.json_columns import Json, pack, unpack
from app.db.session import Session, now
from app.features.datasets.tables import GroupModel
from app.features.independent_annotations.tables import GoldModel, IndependentAnnotationModel
from app.soccer.choices import GoldStart

IMPORTED = "imported"
WITHOUT_BALLS = "without_balls"
BARE = "bare"
STARTS: tuple[str, ...] = get_args(GoldStart)
_HEADS = select(
    GoldModel.group_id,
    GoldModel.dataset_id,
    GoldModel.start,
    GoldModel.marked,
    GoldModel.marked_by,
    GroupModel.key,
    GroupModel.label,
).join(GroupModel, GroupModel.id == GoldModel.group_id)


def mark_gold(
    session: Session, group_id: int, dataset_id: int, start: str, truth: Json, by: str
) -> None:
    """Keep what is true of a group, in the place of what was kept before."""
    values = {"dataset_id": dataset_id, "start": start, "truth": pack(truth)}
    values |= {"marked": now(), "marked_by": by}
    statement = insert(GoldModel).values(group_id=group_id, **values)
    session.execute(statement.on_conflict_do_update(index_elements=["group_id"], set_=values))


def start_gold(session: Session, group_id: int, start: str) -> None:
    """Let annotators of a gold group begin with something else; what is true of it stays."""
    of = GoldModel.group_id == group_id
    session.execute(update(GoldModel).where(of).values(start=start))


def unmark_gold(session: Session, group_id: int) -> None:
    """A gold group is an ordinary one again."""
    session.execute(delete(GoldModel).where(GoldModel.group_id == group_id))


def gold_start(session: Session, group_id: int) -> str:
    """What annotators of a gold group begin with."""
    statement = select(GoldModel.start).where(GoldModel.group_id == group_id)
    return session.scalar(statement) or IMPORTED


def common_start(session: Session, dataset_id: int) -> str | None:
    """What everybody begins with in batches that mix the gold groups of a dataset in: that which
    leaves least of those that its gold groups have; None where there is not a gold group."""
    mine = GoldModel.dataset_id == dataset_id
    found = session.scalars(select(GoldModel.start).where(mine).distinct())
    return max(found, key=(IMPORTED, WITHOUT_BALLS, BARE).index, default=None)


def gold_heads(session: Session, dataset_id: int) -> Sequence[Any]:
    """The gold groups of a dataset without what is true of them, by id of the group."""
    statement = _HEADS.where(GoldModel.dataset_id == dataset_id).order_by(GoldModel.group_id)
    return session.execute(statement).all()


def gold_head(session: Session, group_id: int) -> Any | None:
    """A gold group without what is true of it; None: it is none."""
    return session.execute(_HEADS.where(GoldModel.group_id == group_id)).one_or_none()


def gold_truth(session: Session, group_id: int) -> Json | None:
    """What is true of a gold group."""
    packed = session.scalar(select(GoldModel.truth).where(GoldModel.group_id == group_id))
    return None if packed is None else unpack(packed)


def fresh_gold(session: Session, dataset_id: int, person: str) -> list[int]:
    """Ids of the gold groups of a dataset of which a person has had no copy yet."""
    had = select(IndependentAnnotationModel.group_id).where(
        IndependentAnnotationModel.person == person
    )
    mine = GoldModel.dataset_id == dataset_id
    statement = select(GoldModel.group_id).where(mine, GoldModel.group_id.not_in(had))
    return list(session.scalars(statement.order_by(GoldModel.group_id)))
