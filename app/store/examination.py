"""The examination of a database that nobody has open: every page, every reference, the whole log."""

from __future__ import annotations

from pathlib import Path

from sqlalchemy import Engine, inspect, text

from app.config import Settings
from app.errors import EXAMINE, DamagedError
from app.store.anchor import Anchor, anchor_of
from app.store.engine import make_engine, reported
from app.store.log import verify_chain
from app.store.session import Session
from app.store.soundness import count_lost_references, file_faults

_COUNTED = ("dataset", "groups", "view", "station", "verdict", "version", "solution", "log")


def examine_database(
    settings: Settings, file: Path, known_as: Path
) -> tuple[Anchor, dict[str, int]]:
    """Look at every page of a database that nobody else has open, and at the log's hash chain.

    Args:
        settings: Any.
        file: The database.
        known_as: What complaints call it.

    Returns:
        What its anchor is, and its rows by table.

    Raises:
        DamagedError: Something is not as it was written.
    """
    own = settings.model_copy(update={"database_url": f"sqlite+pysqlite:///{file}"})
    engine = make_engine(own)
    try:
        with reported(own):
            return _examine(engine, known_as)
    finally:
        engine.dispose()


def _examine(engine: Engine, file: Path) -> tuple[Anchor, dict[str, int]]:
    with Session(engine) as session:
        tables = set(inspect(session).get_table_names())
        if "alembic_version" not in tables or "log" not in tables:
            raise DamagedError(f"{file} is no database of Touchline", hint=EXAMINE)
        faults = file_faults(session, 3, thorough=True)
        if faults:
            raise DamagedError(f"{file} is damaged: {'; '.join(faults)}", hint=EXAMINE)
        if count_lost_references(session):
            raise DamagedError(f"{file} has rows that refer to rows that are gone", hint=EXAMINE)
        verify_chain(session)
        counts = {
            name: session.execute(text(f"SELECT count(*) FROM {name}")).scalar_one()
            for name in _COUNTED
            if name in tables
        }
        return anchor_of(session) or _without_installation(session), counts


def _without_installation(session: Session) -> Anchor:
    schema = session.execute(text("SELECT version_num FROM alembic_version")).scalar_one()
    last = session.execute(text("SELECT id, hash FROM log ORDER BY id DESC LIMIT 1")).first()
    return Anchor("", "", schema, *(tuple(last) if last else (0, "")))
