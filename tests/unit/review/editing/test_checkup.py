"""What the check-up of a home finds: each planted fault by its name, with its mend."""

from __future__ import annotations

import os
import shutil
from collections import namedtuple
from pathlib import Path

import pytest
from sqlalchemy import text

from app.config import Settings
from app.review.editing import checkup
from app.review.editing.check import Check
from app.review.editing.checkup import examine_home, examine_surroundings
from app.store.home import make_home
from app.store.session import Store
from app.store.uploads import UploadWriter, keep_upload


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    settings = Settings(home=tmp_path / "home")
    make_home(settings)
    return settings


def faults(settings: Settings) -> dict[str, Check]:
    return {check.name: check for check in examine_home(settings) if not check.ok}


def around(store: Store) -> dict[str, Check]:
    return {check.name: check for check in examine_surroundings(store)}


class TestExamineHome:
    def test_a_new_home_has_no_fault(self, settings: Settings) -> None:
        assert faults(settings) == {}

    def test_a_setting_that_is_none_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_UPLOAD_DAY", "3")
        assert "TOUCHLINE_UPLOAD_DAY is no setting" in faults(settings)["settings"].sentence

    def test_an_import_folder_that_is_gone_is_named(self, settings: Settings) -> None:
        gone = settings.model_copy(update={"import_folders": [Path("/nowhere/at/all")]})
        assert "/nowhere/at/all" in faults(gone)["settings"].sentence

    def test_a_home_that_others_can_read_is_named(self, settings: Settings) -> None:
        settings.database_file.touch(mode=0o644)
        assert faults(settings) == {}
        settings.home.chmod(0o755)
        found = faults(settings)["permissions"]
        assert (found.sentence.startswith("others than its owner may read 2"), found.mend) == (
            True,
            f"Start touchline serve, or run chmod -R go= {settings.home}",
        )

    def test_a_disk_that_is_nearly_full_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        usage = namedtuple("usage", "total used free")(10, 9, 1)
        monkeypatch.setattr(shutil, "disk_usage", lambda _path: usage)
        assert "at least 1.1 GB" in str(faults(settings)["room"].mend)

    def test_an_unreadable_anchor_is_named(self, settings: Settings) -> None:
        settings.database_file.with_name("home.json").write_text("{")
        assert "home.json" in faults(settings)["anchor"].sentence

    def test_an_old_sqlite_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(checkup, "MIN_SQLITE", (99, 0, 0))
        assert "versions" in faults(settings)


class TestExamineSurroundings:
    def test_a_healthy_store_has_no_fault(self, there: Store) -> None:
        assert [check.name for check in examine_surroundings(there) if not check.ok] == []

    def test_a_clock_behind_the_log_is_named(self, store: Store, fill, make_group) -> None:
        fill(make_group(7))
        with store.write() as session:
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET at = '2999-01-01T00:00:00+00:00'"))
        found = around(store)["clock"]
        assert (found.ok, found.mend) == (False, "Set the clock of this machine.")

    def test_what_nothing_uses_is_counted(self, there: Store) -> None:
        settings = there.settings
        writer = UploadWriter(settings, "frames.zip")
        writer.write(b"frames")
        upload = writer.finish()
        keep_upload(settings, upload.id)
        part = settings.uploads / "x.part"
        part.touch()
        os.utime(part, (0, 0))
        with there.write() as session:
            session.execute(text("INSERT INTO calibration (key, body) VALUES ('k', '')"))
        found = around(there)
        assert found["uploads"].sentence.startswith("1 kept")
        assert upload.id in str(found["uploads"].mend)
        assert found["leftovers"].sentence.startswith("1 half-written")
        assert found["spare calibrations"].sentence.startswith("1 that")
        assert all(found[name].ok for name in ("uploads", "leftovers", "spare calibrations"))
