from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import insert, select, text

from app.config import Settings
from app.db.backup import back_up_home
from app.db.dialects import postgresql
from app.db.log import filter_groups_with_history, iterate_group_entries_of_kinds
from app.db.restore import restore_database
from app.db.session import Session
from app.db.store import Store
from app.errors import BusyError, InputError, StorageError
from app.features.datasets.tables import DatasetModel, GroupModel
from app.features.findings.queries import (
    PICTURE_GEOMETRY,
    add_group_findings,
    filter_groups_with_finding,
    replace_picture_shape_findings,
)
from app.features.groups.queries import find_views
from app.features.groups.revision_queries import bump_group_revisions, refresh_inputs_hashes
from app.features.groups.view_queries import list_dataset_views
from app.features.independent_annotations.tables import CopyDatasetModel
from app.features.people.queries import DatasetRights, find_rights
from app.features.people.tables import DatasetRoleModel, PersonModel
from app.features.solutions.queries import list_unsolved_groups
from app.features.tracks.queries import delete_tracks, read_groups_by_match, read_track_bodies
from tests.databases import POSTGRESQL
from tests.unit.db.homes import say

DATABASES = [POSTGRESQL]
INSERT = "INSERT INTO dataset (name, created, policy, policy_hash) VALUES ('{}', '', '', '')"


def add(own_store: Store, *names: str) -> None:
    with own_store.write() as session:
        for name in names:
            session.execute(text(INSERT.format(name)))


def names(session) -> list[str]:
    return list(session.scalars(select(DatasetModel.name).order_by(DatasetModel.name)))


class TestText:
    def test_sorts_by_its_code_points_and_matches_whatever_the_case(self, own_store: Store) -> None:
        add(own_store, "b", "ä", "a", "B", "A_")
        with own_store.read() as session:
            assert names(session) == ["A_", "B", "a", "b", "ä"]
            found = select(DatasetModel.name).where(DatasetModel.name.contains("B"))
            assert set(session.scalars(found)) == {"b", "B"}
            # Of ASCII letters alone, as in SQLite.
            found = select(DatasetModel.name).where(DatasetModel.name.contains("Ä"))
            assert not list(session.scalars(found))

    def test_a_character_that_no_text_can_hold_is_a_mistake_of_who_sends_it(
        self, own_store: Store
    ) -> None:
        asked = select(DatasetModel.id).where(DatasetModel.name == "a\0b")
        with pytest.raises(InputError, match=r"U\+0000"), own_store.read() as session:
            session.scalar(asked)
        cast = text("SELECT CAST(:said AS jsonb) ->> 'a'")
        with pytest.raises(InputError, match=r"U\+0000"), own_store.read() as session:
            session.scalar(cast, {"said": '{"a": "\\u0000"}'})


class TestConnections:
    def test_one_that_comes_back_after_the_end_is_closed(self, own_store: Store) -> None:
        with closing(Store.open(own_store.settings)) as other, other.read() as late:
            driver: Any = late.connection.driver_connection
            other.close()
            assert not driver.closed
        assert driver.closed

    @pytest.mark.parametrize("lasting", [True, False])
    def test_each_ends_soon_after_the_machine_at_its_other_end_has_vanished(
        self, own_store: Store, lasting: bool
    ) -> None:
        names = ("keepalives_idle", "keepalives_interval", "keepalives_count", "user_timeout")
        with own_store.write(lasting=lasting) as session:
            # Behind a socket of this machine a server shows none of them, but who has set them.
            source = text("SELECT source FROM pg_settings WHERE name = :name")
            for name in names:
                assert session.scalar(source, {"name": f"tcp_{name}"}) == "session"
            driver: Any = session.connection.driver_connection
            own = driver.info.get_parameters()
        assert (own["keepalives_idle"], own["tcp_user_timeout"]) == ("15", "30000")

    @pytest.mark.parametrize(
        ("again", "said"),
        [(False, "Load the current state"), (True, "Nothing was saved")],
        ids=["while a change is saved", "before"],
    )
    def test_one_that_is_lost_says_what_is_known_of_the_change(
        self, own_store: Store, again: bool, said: str
    ) -> None:
        # What need not last tells nobody: nothing stands between its statements and its commit.
        with pytest.raises(StorageError) as refused, own_store.write(lasting=False) as session:
            add = text(INSERT.format("a"))
            session.execute(add)
            pid = session.scalar(text("SELECT pg_backend_pid()"))
            with own_store.read_for_one_statement() as other:
                other.execute(text("SELECT pg_terminate_backend(:pid, 10000)"), {"pid": pid})
            if again:
                session.execute(add)
        assert said in (refused.value.hint or "")
        assert ("it is not known whether" in refused.value.message) is not again


class TestWrite:
    def test_one_at_a_time_and_who_waits_too_long_is_told(
        self, own_store: Store, monkeypatch
    ) -> None:
        monkeypatch.setattr(postgresql, "LOCK_SECONDS", 0.1)
        with closing(Store.open(own_store.settings)) as other:
            with own_store.write() as session:
                session.execute(text(INSERT.format("a")))
                with pytest.raises(BusyError), other.write():
                    raise AssertionError("two write at once")
            add(other, "b")
        with own_store.read() as session:
            assert names(session) == ["a", "b"]

    def test_what_is_read_is_what_the_writer_before_left(self, own_store: Store) -> None:
        """The lock is waited for before the first look, so no change is lost between the two."""

        def count(opened: Store) -> None:
            for _ in range(20):
                with opened.write() as session:
                    number = len(names(session))
                    session.execute(text(INSERT.format(f"{number:03}")))

        with closing(Store.open(own_store.settings)) as other:
            threads = [threading.Thread(target=count, args=[one]) for one in (own_store, other)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        with own_store.read() as session:
            assert names(session) == [f"{number:03}" for number in range(40)]

    def test_what_need_not_last_waits_for_no_disk_and_leaves_others_as_they_are(
        self, own_store: Store
    ) -> None:
        promise = text("SHOW synchronous_commit")
        with closing(Store.open(own_store.settings)) as other:
            with own_store.write(lasting=False) as session:
                assert session.scalar(promise) == "off"
                session.execute(text(INSERT.format("a")))
            with other.write() as session:
                assert session.scalar(promise) == "on"
                assert names(session) == ["a"]


class TestGlance:
    def test_each_statement_is_a_transaction(self, own_store: Store) -> None:
        began = text("SELECT now()")
        with own_store.read_for_one_statement() as session:
            assert session.scalar(began) < session.scalar(began)
        with own_store.read() as session:
            assert session.scalar(began) == session.scalar(began)


class TestRead:
    def test_keeps_its_snapshot_and_changes_nothing(self, own_store: Store) -> None:
        with own_store.read() as session:
            assert names(session) == []
            add(own_store, "a")
            assert names(session) == []
        with pytest.raises(StorageError), own_store.read() as session:
            session.execute(text(INSERT.format("b")))


class TestGuards:
    @pytest.mark.parametrize(
        "statement", ["UPDATE log SET actor = 'eve'", "DELETE FROM log", "TRUNCATE log"]
    )
    def test_history_cannot_be_rewritten(self, own_store: Store, statement: str) -> None:
        say(own_store)
        with pytest.raises(StorageError), own_store.write() as session:
            session.execute(text(statement))
        with own_store.read() as session:
            assert session.execute(text("SELECT count(*) FROM log")).scalar_one() == 1


class TestMarks:
    def test_a_group_that_changes_is_marked_anew_and_one_that_goes_leaves_none(
        self, filled: Store
    ) -> None:
        marks = text("SELECT id, dataset_id, group_id FROM group_change")
        other, read = "UPDATE groups SET label = 'x'", "UPDATE groups SET split = 'x'"
        gone = [f"DELETE FROM {table}" for table in ("queue", "view", "groups")]
        found = []
        with filled.write() as session:
            for changes in ([], [other], [read], gone):
                for change in changes:
                    session.execute(text(change))
                found.append(session.execute(marks).all())
        assert found == [[(1, 1, 1)], [(1, 1, 1)], [(2, 1, 1)], []]


class TestRights:
    def test_of_everybody_come_with_them_in_one_statement(self, filled: Store) -> None:
        person = {"name": "ada", "role": "viewer", "disabled": False}
        person |= {"created": "", "created_by": ""}
        with filled.write() as session:
            session.execute(insert(PersonModel), [{**person, "id": 1}])
            assert find_rights(session, 1, ["lead"]) == DatasetRights({}, {})
            own = {"person_id": 1, "dataset_id": 1, "role": "lead"}
            own |= {"given": "", "given_by": ""}
            session.execute(insert(DatasetRoleModel), [own])
            other = {"name": "copies", "created": "", "policy": "", "policy_hash": ""}
            session.execute(insert(DatasetModel), [{**other, "id": 2}])
            copies = {"dataset_id": 2, "of_id": 1, "batch_id": 0, "person": "bob"}
            session.execute(insert(CopyDatasetModel), [copies])
            assert find_rights(session, 1, ["lead"]) == DatasetRights({1: "lead"}, {2: 1})


class TestInterrupted:
    def test_a_statement_ends_when_nobody_wants_it_any_more(self, own_store: Store) -> None:
        began = time.monotonic()
        with own_store.read() as session, postgresql.DIALECT.interrupt_when(session, lambda: True):
            session.execute(text("SELECT pg_sleep(600)"))
        assert time.monotonic() - began < 300


class TestAddress:
    @pytest.mark.parametrize(
        "url",
        ["postgresql://ann:s3cret@/nowhere?host=/nowhere", "postgresql://ann:s3cret@host:x/y"],
    )
    def test_a_password_is_never_said(self, url: str, tmp_path: Path) -> None:
        settings = Settings(home=tmp_path / "home", database_url=url)
        with pytest.raises((StorageError, InputError)) as caught:
            Store.open(settings)
        causes = [error for error in (caught.value, caught.value.__cause__) if error is not None]
        said = [caught.value.hint, repr(settings), *map(repr, causes), *map(str, causes)]
        assert not [one for one in said if "s3cret" in str(one)]


MANY = range(1, 65_600)
"""More than the parameters of one statement."""


class TestLongLists:
    @pytest.mark.parametrize(
        "ask",
        [
            lambda session: refresh_inputs_hashes(session, MANY),
            lambda session: bump_group_revisions(session, MANY, "t"),
            lambda session: filter_groups_with_finding(session, MANY, "s"),
            lambda session: filter_groups_with_history(session, MANY),
            lambda session: list(iterate_group_entries_of_kinds(session, MANY, ["edit"])),
            lambda session: list_unsolved_groups(session, 1, MANY),
            lambda session: find_views(session, 1, MANY, list(map(str, MANY))),
            lambda session: list_dataset_views(session, 1, ids=MANY),
            lambda session: read_groups_by_match(session, 1, None, MANY),
            lambda session: read_track_bodies(session, MANY),
            lambda session: delete_tracks(session, MANY),
        ],
        ids=lambda ask: ask.__code__.co_names[-1],
    )
    def test_of_groups_are_one_parameter(
        self, filled: Store, ask: Callable[[Session], object]
    ) -> None:
        with filled.write() as session:
            ask(session)

    def test_of_findings_that_are_no_more_are_one_parameter(self, filled: Store) -> None:
        with filled.write() as session:
            add_group_findings(session, PICTURE_GEOMETRY, ((1, "a", str(n)) for n in MANY))
            keys = list(session.scalars(select(GroupModel.key)))
            assert replace_picture_shape_findings(session, 1, keys, []) == [1]


class TestCopies:
    def test_are_made_by_the_server_and_the_command_is_named(
        self, own_store: Store, tmp_path
    ) -> None:
        for copy in (back_up_home, restore_database):
            with pytest.raises(InputError) as caught:
                copy(own_store.settings, tmp_path / "x.zip")
            assert caught.value.hint is not None
            assert caught.value.hint.startswith(("Run pg_dump", "Run pg_restore"))
