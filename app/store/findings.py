"""Import findings in the database: what imports noticed, by group or by static camera."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from sqlalchemy import delete, insert, select

from app.soccer.finding import PICTURE_GEOMETRY, PITCH_SIZE
from app.store.session import Session
from app.store.tables.groups import GroupModel, ImportFindingModel

SEEN = (PITCH_SIZE, PICTURE_GEOMETRY)
"""Kinds that stand beside what imports noticed and are in no log: computed, or seen of pictures."""
Noticed = tuple[str | None, str]
"""Key of a view, or None where the whole group is meant; and the sentence."""


def group_findings(session: Session, group_id: int) -> list[Noticed]:
    """What is noticed about a group, in the order in which it was."""
    model = ImportFindingModel
    statement = select(model.view, model.sentence).where(
        model.group_id == group_id, model.kind.not_in(SEEN)
    )
    return [(row.view, row.sentence) for row in session.execute(statement.order_by(model.id))]


def groups_told(session: Session, ids: Collection[int], sentence: str) -> set[int]:
    """The groups among them that have a finding about the whole group."""
    model = ImportFindingModel
    statement = select(model.group_id).where(
        model.group_id.in_(list(ids)), model.view.is_(None), model.sentence == sentence
    )
    return {number for number in session.scalars(statement) if number is not None}


def add_group_findings(
    session: Session, kind: str, noticed: Iterable[tuple[int, str | None, str]]
) -> None:
    """Insert findings: group, view and sentence of each."""
    rows = [
        {"group_id": group, "view": view, "kind": kind, "sentence": sentence}
        for group, view, sentence in noticed
    ]
    if rows:
        session.execute(insert(ImportFindingModel), rows)


def replace_group_findings(
    session: Session, group_id: int, kind: str, noticed: Iterable[Noticed]
) -> None:
    """Put findings in the place of all that imports noticed about a group."""
    model = ImportFindingModel
    session.execute(delete(model).where(model.group_id == group_id, model.kind.not_in(SEEN)))
    add_group_findings(session, kind, ((group_id, view, text) for view, text in noticed))


def station_finding(session: Session, station_id: int) -> str | None:
    """What is noticed about a static camera."""
    model = ImportFindingModel
    return session.scalar(select(model.sentence).where(model.station_id == station_id))


def replace_station_finding(
    session: Session, station_id: int, kind: str, sentence: str | None
) -> None:
    """Put a finding (or none) in the place of the one that a static camera has."""
    model = ImportFindingModel
    session.execute(delete(model).where(model.station_id == station_id))
    if sentence is not None:
        values = {"station_id": station_id, "kind": kind, "sentence": sentence}
        session.execute(insert(model), [values])


def replace_shape_findings(
    session: Session, dataset_id: int, keys: Collection[str], found: Iterable[tuple[str, str, str]]
) -> list[int]:
    """Put findings about the shapes of pictures in the place of those that groups have.

    Args:
        session: Of a write.
        dataset_id: The dataset.
        keys: Of the groups whose pictures were looked at; other groups keep theirs.
        found: Key of the group, key of the view and sentence of each.

    Returns:
        Ids of the groups concerned.
    """
    model, wanted = ImportFindingModel, set(found)
    mine = select(GroupModel.id, GroupModel.key).where(GroupModel.dataset_id == dataset_id)
    has = select(model.id, model.group_id, model.view, model.sentence, GroupModel.key)
    has = has.join(GroupModel, GroupModel.id == model.group_id).where(
        GroupModel.dataset_id == dataset_id, model.kind == PICTURE_GEOMETRY
    )
    looked = set(keys)
    present = {
        (row.key, row.view, row.sentence): row for row in session.execute(has) if row.key in looked
    }
    gone = [row for said, row in present.items() if said not in wanted]
    fresh = sorted(wanted - present.keys())
    ids = {row.key: row.id for row in session.execute(mine)} if fresh else {}
    if gone:
        session.execute(delete(model).where(model.id.in_([row.id for row in gone])))
    rows = [(ids[group], view, text) for group, view, text in fresh if group in ids]
    add_group_findings(session, PICTURE_GEOMETRY, rows)
    return sorted({row.group_id for row in gone} | {row[0] for row in rows})
