"""The banner for maintenance, among what admins have said for everybody."""

from __future__ import annotations

from sqlalchemy import delete, insert, select

from app.db.json_columns import Json, parse
from app.db.session import Session
from app.features.people.tables import TeamSettingModel
from app.finite import json_text

_NAME = "maintenance"


def find_banner(session: Session) -> Json | None:
    """What was put last; None: nothing, or it was taken away."""
    statement = select(TeamSettingModel.value).where(TeamSettingModel.name == _NAME)
    text = session.scalar(statement)
    return None if text is None else parse(text)


def put_banner(session: Session, banner: Json | None) -> None:
    """Put another one in its place; None: take it away."""
    session.execute(delete(TeamSettingModel).where(TeamSettingModel.name == _NAME))
    if banner is not None:
        values = {"name": _NAME, "value": json_text(banner)}
        session.execute(insert(TeamSettingModel), values)
