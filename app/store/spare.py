"""Spare frames in the database: images that are no view of a group (persons only)."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

from sqlalchemy import select

from app.store.dialect.statements import insert
from app.store.session import Session
from app.store.tables.groups import SpareFrameModel

BATCH = 1000


@dataclass(frozen=True)
class StoredSpareFrame:
    """A camera, one of its frames, and its extras as they are stored."""

    camera: str
    frame: str
    extras: bytes


def spare_rows(session: Session, dataset_id: int) -> Iterator[StoredSpareFrame]:
    """The spare frames of a dataset as they came, in batches."""
    model, after = SpareFrameModel, 0
    while True:
        rows = session.execute(
            select(model.id, model.camera, model.frame, model.extras)
            .where(model.dataset_id == dataset_id, model.id > after)
            .order_by(model.id)
            .limit(BATCH)
        ).all()
        for row in rows:
            yield StoredSpareFrame(row.camera, row.frame, row.extras)
        if len(rows) < BATCH:
            return
        after = rows[-1].id


def sorted_spare_rows(session: Session, dataset_id: int) -> Iterator[StoredSpareFrame]:
    """The spare frames of a dataset by camera and frame."""
    model = SpareFrameModel
    statement = (
        select(model.camera, model.frame, model.extras)
        .where(model.dataset_id == dataset_id)
        .order_by(model.camera, model.frame)
    )
    for row in session.execute(statement.execution_options(yield_per=BATCH)):
        yield StoredSpareFrame(row.camera, row.frame, row.extras)


def known_spare(
    session: Session, dataset_id: int, frames: Collection[str]
) -> dict[tuple[str, str], bytes]:
    """Extras of the spare frames of these names, by camera and frame."""
    model = SpareFrameModel
    statement = select(model.camera, model.frame, model.extras).where(
        model.dataset_id == dataset_id, model.frame.in_(frames)
    )
    return {(row.camera, row.frame): row.extras for row in session.execute(statement)}


def put_spare(session: Session, dataset_id: int, bodies: Mapping[tuple[str, str], bytes]) -> None:
    """Insert spare frames, or replace what is known of them."""
    rows = [
        {"dataset_id": dataset_id, "camera": camera, "frame": frame, "extras": body}
        for (camera, frame), body in bodies.items()
    ]
    statement = insert(SpareFrameModel)
    session.execute(
        statement.on_conflict_do_update(
            index_elements=["dataset_id", "camera", "frame"],
            set_={"extras": statement.excluded.extras},
        ),
        rows,
    )
