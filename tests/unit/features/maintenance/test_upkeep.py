"""Upkeep: what is old, too large or nobody's goes; what is promised or used stays."""

from __future__ import annotations

import os
import time
from contextlib import suppress
from pathlib import Path

import pytest
from sqlalchemy import text, update
from structlog.testing import capture_logs

from app.db.idempotency import (
    StoredResponse,
    StoredResponseModel,
    find_response,
    insert_response,
)
from app.db.store import Store
from app.errors import DamagedError
from app.features.datasets.service import delete_dataset, list_datasets
from app.features.jobs.queries import JobModel, NewJob, insert_job, update_job
from app.features.jobs.service import Jobs
from app.features.maintenance import upkeep as module
from app.features.maintenance.upkeep import CleanupCounts, UpkeepScheduler, clean_up

OLD = time.time() - 40 * 86_400


def keys(store: Store, table: str = "calibration") -> int:
    with store.read() as session:
        return session.execute(text(f"SELECT count(*) FROM {table}")).scalar_one()


def place(path: Path, when: float) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x")
    os.utime(path, (when, when))
    return path


@pytest.fixture
def killed_deletion(store: Store, fill, make_group, monkeypatch: pytest.MonkeyPatch) -> Store:
    """A dataset was deleted by a process that was killed before its calibrations went."""
    fill(make_group(7), make_group(8))

    def kill(*_arguments):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("app.features.datasets.service.delete_unused_calibrations", kill)
        with suppress(KeyboardInterrupt):
            delete_dataset(store, "demo", confirm="demo", actor="a")
    return store


class TestCalibrations:
    def test_those_of_a_killed_deletion_go(self, killed_deletion: Store) -> None:
        assert list_datasets(killed_deletion) == []
        left = keys(killed_deletion)
        assert left > 0
        assert clean_up(killed_deletion).calibrations == left
        assert keys(killed_deletion) == 0

    def test_those_of_present_solutions_stay(self, store: Store, fill, make_group) -> None:
        fill(make_group(7))
        before = keys(store)
        assert clean_up(store) == CleanupCounts()
        assert keys(store) == before > 0

    def test_none_go_while_groups_wait_to_be_solved(
        self, killed_deletion: Store, fill, make_group
    ) -> None:
        before = keys(killed_deletion)
        fill(make_group(9), solved=False)
        assert clean_up(killed_deletion).calibrations == 0
        assert keys(killed_deletion) == before > 0


class TestAnswers:
    def test_old_ones_go_and_the_oldest_beyond_the_room_lose_their_text(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        body = os.urandom(1000)
        for number in range(5):
            with store.write() as session:
                insert_response(session, f"k{number}", "ann", StoredResponse("d", 200, {}, body))
        with store.write() as session:
            oldest = update(StoredResponseModel).where(StoredResponseModel.key == "k0")
            session.execute(oldest.values(at="2020-01-01T00:00:00"))
        monkeypatch.setattr(
            store, "settings", store.settings.model_copy(update={"answer_bytes": 2100})
        )
        assert clean_up(store).answers == 3
        with store.read() as session:
            found = [find_response(session, f"k{number}", "ann") for number in range(5)]
        assert [answer and answer.body for answer in found] == [None, None, None, body, body]
        assert [answer is None for answer in found] == [True, False, False, False, False]


class TestJobs:
    def test_those_that_ended_long_ago_go_but_for_exports_and_open_ones(self, store: Store) -> None:
        with store.write() as session:
            for kind in ("import", "import", "import", "export"):
                insert_job(session, NewJob(kind, "t", "ann"))
            session.execute(update(JobModel).values(state="done", ended="2020-01-01T00:00:00"))
            update_job(session, 2, ended="9999-01-01T00:00:00")
            update_job(session, 3, state="waiting", ended=None)
        assert clean_up(store).jobs == 1
        with store.read() as session:
            assert list(session.scalars(text("SELECT id FROM job ORDER BY id"))) == [2, 3, 4]

    def test_exports_that_failed_or_were_cancelled_go_too(self, store: Store) -> None:
        with store.write() as session:
            for state in ("failed", "cancelled", "done"):
                job = insert_job(session, NewJob("export", "t", "ann"))
                update_job(session, job, state=state, ended="2020-01-01T00:00:00")
        assert clean_up(store).jobs == 2
        with store.read() as session:
            assert list(session.scalars(text("SELECT state FROM job"))) == ["done"]


class TestExports:
    def test_old_zips_without_a_record_go_and_every_finished_export_stays(
        self, store: Store
    ) -> None:
        folder = store.settings.exports
        for name in ("1.zip", "2.zip", "2.json", "mine.zip", "f" * 32 + ".zip"):
            place(folder / name, OLD)
        place(folder / "3.zip", time.time())
        assert clean_up(store).exports == 2
        left = {path.name for path in folder.iterdir()}
        assert left == {"2.zip", "2.json", "3.zip", "mine.zip"}


class TestFiles:
    def test_old_images_and_half_written_files_go(self, store: Store) -> None:
        home = store.settings.home
        gone = [
            place(home / "cache" / "frames" / "ab" / "c.jpg", OLD),
            place(home / "uploads" / "1.part", OLD),
            place(home / "exports" / ".7.zip.partial", OLD),
            place(home / "uploads" / "a" / ".upload.json.x1.partial", OLD),
            place(home / ".home.json.x1.partial", OLD),
        ]
        stay = [
            place(home / "cache" / "frames" / "ab" / "d.jpg", time.time()),
            place(home / "uploads" / "2.part", time.time()),
            place(home / "uploads" / "f" / "content" / "photos.part", OLD),
            place(home / "uploads" / "f" / "content" / ".photos.partial", OLD),
            place(home / "exports" / "8.zip", OLD),
            place(home / "exports" / "8.json", OLD),
        ]
        tidied = clean_up(store)
        assert (tidied.cached, tidied.uploads, tidied.leftovers) == (1, 0, 4)
        assert not any(path.exists() for path in gone)
        assert all(path.exists() for path in stay)


class TestUpkeep:
    def test_a_fault_is_logged_and_ends_changes(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def damaged(_wanted: object) -> None:
            raise OSError("the disk is gone")

        upkeep = UpkeepScheduler(store, Jobs(store))
        monkeypatch.setattr(store, "require_intact_database", damaged)
        with capture_logs() as logs:
            upkeep.run_once()
        assert logs[-1]["error"] == "the disk is gone"

    @pytest.mark.parametrize("error", [OSError("gone"), ZeroDivisionError("a bug")])
    def test_a_step_that_fails_leaves_the_others_to_be_done(
        self, store: Store, monkeypatch: pytest.MonkeyPatch, error: Exception
    ) -> None:
        def fail(*_: object) -> int:
            raise error

        old = place(store.settings.home / "cache" / "frames" / "ab" / "c.jpg", OLD)
        monkeypatch.setattr(module, "delete_old_responses", fail)
        with capture_logs() as logs:
            assert clean_up(store).cached == 1
        assert [(entry["event"], entry["step"]) for entry in logs] == [("upkeep failed", "answers")]
        assert not old.exists()

    @pytest.mark.file_of_sqlite("a look at every page of the file")
    def test_a_look_at_the_whole_database_ends_when_the_server_stops(
        self, there: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        # Instead of a look that takes minutes: its number would be taken for a fault.
        count = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n LIMIT 2000000)"
        slow = text(f"{count} SELECT CAST(count(*) AS TEXT) FROM n")
        monkeypatch.setattr("app.db.dialects.sqlite.text", lambda _: slow)
        there.require_intact_database(lambda: False)
        with pytest.raises(DamagedError):
            there.require_intact_database()

    def test_its_thread_has_ended_when_it_is_closed_however_long_it_would_wait(
        self, store: Store, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "FIRST_SECONDS", 3600.0)
        upkeep = UpkeepScheduler(store, Jobs(store))
        upkeep.start()
        upkeep.close()
        upkeep.close()
        assert upkeep._thread is not None
        assert not upkeep._thread.is_alive()
