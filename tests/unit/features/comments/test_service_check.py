"""What the doctor finds of comments: nothing where all is well, and each planted fault by its name."""

from __future__ import annotations

import pytest
from sqlalchemy import text

from app.db.dialects.dialect import get_dialect
from app.db.store import Store
from app.features.audit.service import assign_local_work
from app.features.comments import service as comments
from app.features.comments.service import examine_threads
from app.features.datasets.service import delete_dataset
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Role
from app.features.people.service import invite
from tests.databases import said_for_sqlite


@pytest.fixture(autouse=True)
def threads(store: Store, fill, make_group) -> list[int]:
    """One of everything that can be done to a thread; the last of four is gone."""
    (group,) = fill(make_group())
    invite(store, "anna", Role.REVIEWER, actor="local")
    begun = [
        comments.begin_thread(store, group, "Is this the ball?", actor="anna", **where).id
        for where in ({}, {"view": "7_1.png", "at": (612.0, 330.5)}, {"view": "7.png"}, {})
    ]
    first, second, third, last = begun
    replied = comments.add_reply(store, group, first, "It is.", actor="local")
    comments.edit_comment(store, group, first, replied.comments[1].id, "It is not.", actor="local")
    comments.resolve_thread(store, group, second, True, actor="local")
    comments.resolve_thread(store, group, third, True, actor="anna")
    comments.resolve_thread(store, group, third, False, actor="anna")
    gone = comments.add_reply(store, group, third, "Hm.", actor="anna")
    comments.delete_comment(store, group, third, gone.comments[1].id, actor="anna")
    (only,) = comments.list_threads(store, group)[-1].comments
    comments.delete_comment(store, group, last, only.id, actor="anna")
    return begun


class TestExamineThreads:
    def test_what_was_said_has_no_fault(self, store: Store) -> None:
        check = examine_threads(store)
        assert (check.ok, check.sentence) == (True, "3, as the log says")

    def test_a_log_that_was_forged_is_a_fault_and_breaks_nothing_off(self, store: Store) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER log_refuses_update"))
            session.execute(text("UPDATE log SET kind = 'comment' WHERE id = 1"))
        assert "cannot be decoded" in examine_threads(store).sentence

    def test_a_name_that_is_shown_in_the_place_of_another_is_none(self, store: Store) -> None:
        with store.read() as session:
            anna = find_person_by_name(session, "anna").id
        assign_local_work(store, anna, actor="local")
        assert examine_threads(store).ok

    def test_comments_of_a_dataset_that_was_deleted_are_not_missed(self, store: Store) -> None:
        delete_dataset(store, "demo", confirm="demo", actor="ann")
        assert examine_threads(store).sentence == "0, as the log says"

    @pytest.mark.parametrize(
        "forged",
        [
            "UPDATE comment SET text = 'It is mine.' WHERE thread_id = {}",
            "UPDATE comment SET actor = 'eve' WHERE thread_id = {}",
            "UPDATE comment SET edited = NULL WHERE thread_id = {}",
            "DELETE FROM comment WHERE thread_id = {}",
            "DELETE FROM thread WHERE id = {}",
            "UPDATE thread SET resolved = '2020', resolved_by = 'eve' WHERE id = {}",
            "UPDATE thread SET view = '7.png' WHERE id = {}",
        ],
    )
    def test_what_was_forged_is_named_by_its_thread(
        self, store: Store, threads: list[int], forged: str
    ) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text(forged.format(threads[0])))
        check = examine_threads(store)
        assert (check.ok, check.sentence) == (False, f"1 not as the log says: {threads[0]}")
        assert check.advice == get_dialect(store.settings).restoring
