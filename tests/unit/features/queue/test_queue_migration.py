"""Migrations 0005 and 0006 on a database that holds groups, solutions and verdicts."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pysqlite3.dbapi2 as sqlite
import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.dialects.dialect import make_engine
from app.db.migrate import KNOWN_REVISIONS, migrate_database, read_schema_revision
from app.db.store import Store
from app.errors import StorageError
from app.features.groups.submit import load_group_state
from app.features.queue.refresh_queries import refresh_queue
from app.features.queue.tables import QUEUE_NUMBERS
from app.features.verdicts.service import set_verdict

pytestmark = pytest.mark.file_of_sqlite("homes of released versions, which had a file")

PLACES = ("distance_m", "box_px", "x_m", "y_m")


def as_before(store: Store) -> None:
    """Take back what migration 0005 does, and what came after it."""
    with store.write() as session:
        for trigger in ("group_new", "group_change", "group_solved"):
            session.execute(text(f"DROP TRIGGER {trigger}_is_marked"))
        session.execute(text("ALTER TABLE version DROP COLUMN tracks"))
        session.execute(text("DROP TABLE batch_track"))
        session.execute(text("DROP TABLE track"))
        session.execute(text("DROP TABLE ball_run"))
        session.execute(text("DROP TABLE predicted_track"))
        session.execute(text("ALTER TABLE prediction_set DROP COLUMN tracks"))
        for column in ("number", "place", "of_inputs"):
            session.execute(text(f"ALTER TABLE import_finding DROP COLUMN {column}"))
        session.execute(text("DROP TABLE shot_cameras"))
        session.execute(text("DROP TABLE shot_link"))
        session.execute(text("DROP TABLE recording"))
        session.execute(text("DROP TABLE group_change"))
        session.execute(text("DROP TABLE dismissal"))
        session.execute(text("ALTER TABLE queue DROP COLUMN dismissed"))
        for table in ("begun", "attempt"):
            session.execute(text(f"DROP TABLE {table}"))
        session.execute(text("ALTER TABLE job DROP COLUMN ending"))
        session.execute(text("DROP INDEX queue_scanned"))
        for table in ("agreement_limits", "agreement"):
            session.execute(text(f"DROP TABLE {table}"))
        for table in ("guideline_picture", "guideline", "gold", "take", "copy_dataset"):
            session.execute(text(f"DROP TABLE {table}"))
        for table in ("lease", "batch_group", "batch_person", "batch"):
            session.execute(text(f"DROP TABLE {table}"))
        for table in ("bell", "comment_mention", "comment", "thread"):
            session.execute(text(f"DROP TABLE {table}"))
        for name in QUEUE_NUMBERS:
            session.execute(text(f"DROP INDEX queue_{name}"))
        for table in ("webhook_delivery", "webhook"):
            session.execute(text(f"DROP TABLE {table}"))
        for table in (
            "identity",
            "passkey",
            "access_token",
            "recovery_code",
            "second_factor",
            "team_setting",
        ):
            session.execute(text(f"DROP TABLE {table}"))
        for table in ("actor_alias", "dataset_role", "login", "one_time_link", "person"):
            session.execute(text(f"DROP TABLE {table}"))
        session.execute(text("DROP TABLE proposal"))
        session.execute(text("ALTER TABLE station DROP COLUMN proposed"))
        session.execute(text("ALTER TABLE queue DROP COLUMN agreement"))
        session.execute(text("DROP TABLE paint_evidence"))
        session.execute(text("ALTER TABLE groups DROP COLUMN paint"))
        session.execute(text("ALTER TABLE dataset DROP COLUMN noise"))
        session.execute(text("ALTER TABLE view DROP COLUMN noise"))
        session.execute(text("ALTER TABLE station DROP COLUMN picture"))
        session.execute(text("ALTER TABLE groups DROP COLUMN positions"))
        session.execute(text("DROP TABLE pitch_estimate"))
        session.execute(text("DROP TABLE version_check"))
        session.execute(text("DROP TABLE installation"))
        session.execute(text("ALTER TABLE job DROP COLUMN tries"))
        session.execute(text("ALTER TABLE solution DROP COLUMN facts"))
        session.execute(text("CREATE TABLE idempotency (key TEXT)"))
        session.execute(text("ALTER TABLE view DROP COLUMN left_out"))
        for name in (*PLACES, "pictures"):
            session.execute(text(f"ALTER TABLE queue DROP COLUMN {name}"))
        for trigger in ("solution_refuses_update", "verdict_refuses_delete"):
            session.execute(text(f"DROP TRIGGER {trigger}"))
        removed = ", ".join(f"'$.{name}'" for name in PLACES)
        session.execute(text(f"UPDATE solution SET summary = json_remove(summary, {removed})"))
        session.execute(
            text(
                "CREATE TRIGGER solution_refuses_update BEFORE UPDATE ON solution "
                "BEGIN SELECT RAISE(ABORT, 'never'); END"
            )
        )
        session.execute(
            text(
                "CREATE TRIGGER verdict_refuses_delete BEFORE DELETE ON verdict "
                "BEGIN SELECT RAISE(ABORT, 'never'); END"
            )
        )
        for table in ("saved_view", "verdict_batch", "used_id"):
            session.execute(text(f"DROP TABLE {table}"))
        session.execute(text("DROP INDEX log_deleted"))
        session.execute(text("UPDATE alembic_version SET version_num = '0004'"))


def upgraded(store: Store, home: Path) -> Store:
    """A copy of the store after everything from migration 0005 on has been done again."""
    settings = Settings(home=home)
    home.mkdir()
    with (
        closing(sqlite.connect(str(store.settings.database_file))) as source,
        closing(sqlite.connect(str(settings.database_file))) as target,
    ):
        source.backup(target)
    with closing(Store.open(settings)) as copy:
        as_before(copy)
    # A home of that time had none.
    (home / "home.json").unlink()
    migrate_database(settings)
    return Store.open(settings)


def read(store: Store, statement: str) -> list[Any]:
    with store.read() as session:
        return list(session.execute(text(statement)).all())


QUEUE = f"SELECT group_id, {', '.join(PLACES)}, pictures, views FROM queue ORDER BY group_id"
SUMMARIES = "SELECT id, summary FROM solution ORDER BY id"


@pytest.fixture
def filled(store: Store, fill, make_group, make_static) -> Store:
    """A broadcast group, a static one, one without a ball and one that is not solved."""
    without = make_group(8)
    without = without.with_view(replace(without.views[0], balls=()))
    ids = fill(make_group(7), make_static(10), without)
    state = load_group_state(store, ids[0])
    set_verdict(store, ids[0], "accepted", if_match=state.etag, actor="ann")
    fill(make_group(9), solved=False)
    return store


class TestUpgrade:
    def test_places_are_as_a_new_solution_has_them(self, filled: Store, tmp_path: Path) -> None:
        queue, summaries = read(filled, QUEUE), read(filled, SUMMARIES)
        assert queue[0].distance_m == pytest.approx(62.57, abs=0.1)
        assert (queue[0].x_m, queue[0].y_m) == pytest.approx((5.0, 2.0), abs=0.1)
        assert (queue[0].box_px, queue[2].box_px) == (14.0, 14.0)
        assert queue[1].box_px == pytest.approx(5.0, abs=2.0)
        # Static cameras come without frames here.
        assert [(row.pictures, row.views) for row in queue] == [(2, 2), (0, 3), (2, 2), (2, 2)]
        assert queue[2].x_m is None and queue[3].box_px is None
        with closing(upgraded(filled, tmp_path / "home")) as store:
            assert read_schema_revision(make_engine(store.settings)) == KNOWN_REVISIONS[-1]
            assert read(store, QUEUE) == queue
            again = read(store, SUMMARIES)
        assert [json.loads(row.summary) for row in again] == [
            json.loads(row.summary) for row in summaries
        ]

    def test_the_queue_stays_so_when_it_is_written_again(
        self, filled: Store, tmp_path: Path
    ) -> None:
        queue = read(filled, QUEUE)
        with closing(upgraded(filled, tmp_path / "home")) as store:
            with store.write() as session:
                refresh_queue(session, [row.group_id for row in queue])
            assert read(store, QUEUE) == queue

    def test_solutions_and_verdicts_are_guarded_again(self, filled: Store, tmp_path: Path) -> None:
        with closing(upgraded(filled, tmp_path / "home")) as store:
            for statement in ("UPDATE solution SET summary = '{}'", "DELETE FROM verdict"):
                with pytest.raises(StorageError), store.write() as session:
                    session.execute(text(statement))
