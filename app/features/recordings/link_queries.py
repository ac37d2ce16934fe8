"""Links of replays in the database."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sqlalchemy import Select, delete, insert, or_, select, update
from sqlalchemy.orm import aliased

from app.db.session import Session, now
from app.features.groups.insert_queries import next_id
from app.features.people.visibility_queries import shown_actor
from app.features.recordings.tables import RecordingModel, ShotLinkModel

_LIVE, _REPLAY = aliased(RecordingModel), aliased(RecordingModel)


def _rows() -> Select[Any]:
    columns = (column for column in ShotLinkModel.__table__.columns if column.name != "actor")
    actor = shown_actor(ShotLinkModel.actor, ShotLinkModel.created).label("actor")
    sides = (
        column.label(f"{side}_{word}")
        for side, table in (("live", _LIVE), ("replay", _REPLAY))
        for word, column in (("name", table.name), ("sha256", table.sha256))
    )
    return (
        select(*columns, actor, *sides)
        .join_from(ShotLinkModel, _LIVE, _LIVE.id == ShotLinkModel.live_id)
        .join(_REPLAY, _REPLAY.id == ShotLinkModel.replay_id)
    )


def list_link_rows(session: Session, recording_id: int) -> Sequence[Any]:
    """The links whose live shot or whose replay is of a recording, by their live frames."""
    mine = or_(ShotLinkModel.live_id == recording_id, ShotLinkModel.replay_id == recording_id)
    order = (ShotLinkModel.live_id, ShotLinkModel.live_first, ShotLinkModel.id)
    return session.execute(_rows().where(mine).order_by(*order)).all()


def find_link(session: Session, link_id: int) -> Any | None:
    """A link by its id."""
    return session.execute(_rows().where(ShotLinkModel.id == link_id)).one_or_none()


def insert_link(session: Session, actor: str, **values: Any) -> int:
    """Insert a link; returns its id."""
    identity = next_id(session, ShotLinkModel)
    row = {"id": identity, **values, "revision": 0, "actor": actor, "created": now()}
    session.execute(insert(ShotLinkModel), [row])
    return identity


def update_link(session: Session, link_id: int, **values: Any) -> None:
    """Change columns of a link."""
    session.execute(update(ShotLinkModel).where(ShotLinkModel.id == link_id).values(values))


def delete_link(session: Session, link_id: int) -> None:
    """Delete a link."""
    session.execute(delete(ShotLinkModel).where(ShotLinkModel.id == link_id))


def delete_links(session: Session, recording_id: int) -> int:
    """Delete all links of a recording; returns how many there were."""
    mine = or_(ShotLinkModel.live_id == recording_id, ShotLinkModel.replay_id == recording_id)
    gone = delete(ShotLinkModel).where(mine).returning(ShotLinkModel.id)
    return len(session.scalars(gone).all())
