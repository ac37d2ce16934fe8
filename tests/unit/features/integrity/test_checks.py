"""What the check-up of a home finds: each planted fault by its name, with its mend."""

from __future__ import annotations

import os
import shutil
from collections import namedtuple
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.check import CheckResult
from app.db.home import make_home
from app.db.store import Store
from app.features.datasets.queries import list_unused_frame_files, list_unused_uploads
from app.features.groups.submit import load_group_state
from app.features.imports.upload_queries import UploadWriter, mark_upload_permanent
from app.features.integrity import checks
from app.features.integrity.checks import (
    examine_admins_clock_and_leftovers,
    examine_home_without_database,
)
from app.features.people.login_queries import put_identity
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from tests.databases import said_for_sqlite
from tests.provider import CLIENT, SECRET, providing, tell
from tests.smtp import MailBox, serving


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    settings = Settings(home=tmp_path / "home")
    make_home(settings)
    return settings


def faults(settings: Settings) -> dict[str, CheckResult]:
    return {check.name: check for check in examine_home_without_database(settings) if not check.ok}


SIGN_ON = {"sso_client_id": CLIENT, "sso_client_secret": SECRET}


class TestMail:
    def test_a_mail_server_that_takes_us_is_no_fault_and_is_sent_nothing(
        self, tmp_path: Path
    ) -> None:
        said = {"smtp_security": "none", "smtp_from": "box@example.org", "smtp_host": "127.0.0.1"}
        with serving(MailBox()) as box:
            said |= {"smtp_port": box.port}
            checks = tmp_path / "home"
            make_home(settings := Settings(home=checks, url="https://club.example", **said))
            found = {one.name: one for one in examine_home_without_database(settings)}["mail"]
            assert found.ok
            assert found.sentence == f"127.0.0.1:{box.port} answers (none); nothing was sent"
            assert "TOUCHLINE_URL" in faults(Settings(home=checks, **said))["mail"].sentence
            assert box.letters == []
        assert "cannot be reached" in faults(settings)["mail"].sentence
        assert "SMTP_FROM" in faults(Settings(home=checks, smtp_host="x.example"))["mail"].sentence

    def test_without_one_nothing_is_asked(self, settings: Settings) -> None:
        assert "mail" not in faults(settings)


class TestSignOn:
    def test_a_provider_that_answers_is_no_fault_and_another_is(self, tmp_path: Path) -> None:
        with providing() as provider:
            said = {**SIGN_ON, "sso_issuer": provider.address}
            make_home(settings := Settings(home=tmp_path / "home", **said))
            assert "single sign-on" not in faults(settings)
            found = {one.name: one for one in examine_home_without_database(settings)}[
                "single sign-on"
            ]
            assert found.sentence == f"{provider.address} answers, with 1 keys"
            other = {**provider.described(), "issuer": "https://other.example"}
            there = "/.well-known/openid-configuration"
            provider.instead[there] = lambda handler: tell(handler, other)
            assert (
                "is not the provider in TOUCHLINE_SSO_ISSUER"
                in faults(settings)["single sign-on"].sentence
            )
        assert "valid response" in faults(settings)["single sign-on"].sentence
        half = Settings(home=tmp_path / "home", sso_issuer=provider.address)
        assert (
            "needs the settings TOUCHLINE_SSO_CLIENT_ID" in faults(half)["single sign-on"].sentence
        )

    def test_an_admin_has_to_be_linked_where_there_is_no_other_way(self, tmp_path: Path) -> None:
        said = {**SIGN_ON, "sso_issuer": "https://club.example", "sso_only": True}
        with closing(Store.open(Settings(home=tmp_path / "home", team=True, **said))) as store:
            person, _ = invite(store, "anna", Role.ADMIN, actor="local")
            assert not around(store)["admins"].ok
            mine = {"person_id": person.id, "issuer": "https://club.example", "subject": "s"}
            with store.write() as session:
                put_identity(session, {**mine, "shown": "anna", "created": "2026-11-01"})
            assert around(store)["admins"].ok


def around(store: Store) -> dict[str, CheckResult]:
    return {check.name: check for check in examine_admins_clock_and_leftovers(store)}


class TestExamineHome:
    @pytest.mark.file_of_sqlite("a home without a database yet: a server has one before")
    def test_a_new_home_has_no_fault(self, settings: Settings) -> None:
        assert faults(settings) == {}

    def test_a_setting_that_is_none_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("TOUCHLINE_UPLOAD_DAY", "3")
        assert "TOUCHLINE_UPLOAD_DAY is not a setting" in faults(settings)["settings"].sentence

    def test_an_import_folder_that_is_gone_is_named(self, settings: Settings) -> None:
        gone = settings.model_copy(update={"import_folders": [Path("/nowhere/at/all")]})
        assert "/nowhere/at/all" in faults(gone)["settings"].sentence

    @pytest.mark.file_of_sqlite("permissions of the file")
    def test_a_home_that_others_can_read_is_named(self, settings: Settings) -> None:
        settings.database_file.touch(mode=0o644)
        assert faults(settings) == {}
        settings.home.chmod(0o755)
        found = faults(settings)["permissions"]
        assert (found.sentence.startswith("other users can read 2"), found.advice) == (
            True,
            f"Start touchline serve, or run chmod -R go= {settings.home}",
        )

    def test_a_disk_that_is_nearly_full_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        usage = namedtuple("usage", "total used free")(10, 9, 1)
        monkeypatch.setattr(shutil, "disk_usage", lambda _path: usage)
        assert "at least 1.1 GB" in str(faults(settings)["room"].advice)

    def test_an_unreadable_anchor_is_named(self, settings: Settings) -> None:
        settings.database_file.with_name("home.json").write_text("{")
        assert "home.json" in faults(settings)["anchor"].sentence

    def test_an_old_sqlite_is_named(
        self, settings: Settings, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(checks, "MIN_SQLITE", (99, 0, 0))
        assert "versions" in faults(settings)


class TestExamineSurroundings:
    def test_a_healthy_store_has_no_fault(self, there: Store) -> None:
        assert [
            check.name for check in examine_admins_clock_and_leftovers(there) if not check.ok
        ] == []

    def test_a_clock_behind_the_log_is_named(self, store: Store, fill, make_group) -> None:
        fill(make_group(7))
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET at = '2999-01-01T00:00:00+00:00'"))
        found = around(store)["clock"]
        assert (found.ok, found.advice) == (False, "Set the clock of this machine.")

    def test_entries_of_a_time_when_the_clock_was_ahead_are_counted(
        self, store: Store, fill, make_group
    ) -> None:
        fill(make_group(7))
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET at = '2999-01-01T00:00:00+00:00' WHERE id = 1"))
        found = around(store)["clock"]
        assert found.ok
        assert found.sentence.startswith("1 entry of the log is later than the clock")
        assert found.sentence.endswith("the newest is not: the clock was set right since")

    def test_what_nothing_uses_is_counted(self, there: Store) -> None:
        settings = there.settings
        writer = UploadWriter(settings, "frames.zip")
        writer.write(b"frames")
        upload = writer.finish()
        mark_upload_permanent(settings, upload.id)
        part = settings.uploads / "x.part"
        part.touch()
        os.utime(part, (0, 0))
        with there.write() as session:
            session.execute(text("INSERT INTO calibration (key, body) VALUES ('k', '')"))
        found = around(there)
        assert found["uploads"].sentence.startswith("1 kept")
        assert upload.id in str(found["uploads"].advice)
        assert found["leftovers"].sentence.startswith("1 half-written")
        assert found["unused calibrations"].sentence.startswith("1 that")
        assert all(found[name].ok for name in ("uploads", "leftovers", "unused calibrations"))

    def test_frames_that_a_frozen_version_alone_needs_are_used(
        self, store: Store, fill, make_group
    ) -> None:
        (group,) = fill(make_group(7))
        writer = UploadWriter(store.settings, "frames.zip")
        writer.write(b"frames")
        upload = writer.finish()
        mark_upload_permanent(store.settings, upload.id)
        in_upload = store.settings.uploads.absolute() / upload.id / "frames.zip"
        for name in ("frozen", "unknown"):
            (store.settings.recordings / name).mkdir(parents=True)
        in_recording = store.settings.recordings.absolute() / "frozen" / "7.png"
        media = text("UPDATE view SET media_path = :path WHERE position = :position")
        with store.write() as session:
            for position, path in enumerate((in_upload, in_recording)):
                session.execute(media, {"path": str(path), "position": position})
        etag = load_group_state(store, group).etag
        set_verdict(store, group, "accepted", None, None, if_match=etag, actor="ann")
        freeze_dataset(store, "demo", FreezeRequest("v1"), actor="ann")
        with store.write() as session:
            session.execute(text("UPDATE view SET media_path = NULL"))
        with store.read() as session:
            assert upload.id not in list_unused_uploads(session, store.settings)
            unused = list_unused_frame_files(session, store.settings)
        assert ("unknown" in unused, "frozen" in unused) == (True, False)
