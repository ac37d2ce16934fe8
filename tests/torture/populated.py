"""A home in which people have worked, in an earlier schema, and what it says once it is migrated."""

from __future__ import annotations

import shutil
from contextlib import closing
from pathlib import Path
from typing import Any

import pysqlite3.dbapi2 as sqlite
from sqlalchemy import text

from app.config import Settings
from app.db.log import read_log, verify_chain
from app.db.store import Store
from app.features.datasets.service import list_datasets
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.integrity.checks import examine_database
from app.features.verdicts.queries import read_verdicts
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.service import list_versions
from app.features.versions.verify import verify_version
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box

BALL = BallAnnotation(box=Box(321.0, 123.0, 12.0, 12.0))


def people_work(settings: Settings, *, freezes: bool = True) -> None:
    """Freeze each dataset, then move a ball and judge in each of its groups."""
    with closing(Store.open(settings)) as store:
        for dataset in list_datasets(store) if freezes else ():
            freeze_dataset(store, dataset.id, FreezeRequest("first", groups="passing"), actor="ann")
        for group_id in _ids(store):
            state = load_group_state(store, group_id)
            edit = make_set_ball_edit(state.group.views[0].key, BALL)
            state = submit_edit(store, group_id, edit, if_match=state.etag, actor="ann")
            set_verdict(
                store, group_id, "rejected", "other", "no ball", if_match=state.etag, actor="ben"
            )


def said(settings: Settings) -> dict[str, Any]:
    """What a home says when the product reads it."""
    with closing(Store.open(settings)) as store:
        datasets = list_datasets(store)
        versions = [one for dataset in datasets for one in list_versions(store, dataset.id)]
        states = [load_group_state(store, group_id) for group_id in _ids(store)]
        with store.read() as session:
            log = list(read_log(session))
            verdicts = read_verdicts(session, [state.id for state in states])
            verify_chain(session)
        return {
            "datasets": [(dataset.id, dataset.name) for dataset in datasets],
            "groups": [(state.key, state.group, state.revision, state.etag) for state in states],
            "verdicts": verdicts,
            "versions": [(one.name, one.hash, one.policy, one.counts) for one in versions],
            "rebuilt": [verify_version(store, one.id).differences for one in versions],
            "log": log,
            "checks": [check.sentence for check in examine_database(store) if not check.ok],
        }


def carry_back(source: Path, home: Settings) -> None:
    """Put the rows of a home into one of an earlier schema, as far as that has room for them."""
    shutil.copy(source / "home.json", home.home / "home.json")
    with closing(sqlite.connect(str(home.database_file))) as connection:
        connection.execute("ATTACH ? AS source", (str(source / home.database_file.name),))
        found = "SELECT name, sql FROM main.sqlite_master WHERE type = ?"
        # They guard what people do; all of this is done already.
        triggers = connection.execute(found, ("trigger",)).fetchall()
        for name, _ in triggers:
            connection.execute(f"DROP TRIGGER {name}")
        for name, _ in connection.execute(found, ("table",)).fetchall():
            if name != "alembic_version" and not name.startswith("sqlite_"):
                _carry(connection, name)
        for _, statement in triggers:
            connection.execute(statement)
        connection.commit()


def _carry(connection: sqlite.Connection, table: str) -> None:
    now, then = (
        {row[1] for row in connection.execute(f"PRAGMA {schema}.table_info({table})")}
        for schema in ("source", "main")
    )
    columns = ", ".join(f'"{name}"' for name in sorted(now & then))
    connection.execute(f"DELETE FROM main.{table}")
    if columns:
        rows = f"SELECT {columns} FROM source.{table}"
        connection.execute(f"INSERT INTO main.{table} ({columns}) {rows}")


def _ids(store: Store) -> list[int]:
    with store.read() as session:
        return list(session.execute(text("SELECT id FROM groups ORDER BY id")).scalars())
