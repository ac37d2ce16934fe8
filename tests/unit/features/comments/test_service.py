"""Comments: threads on groups, whom they mention, who is told, and what the log keeps."""

from __future__ import annotations

import pytest

from app.db.log import find_newest_entry_id, verify_chain
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, ForbiddenError, InputError, NotFoundError
from app.features.comments import service as comments
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables
from app.features.groups.state import read_etags
from app.features.notifications.queries import NotificationKind
from app.features.notifications.service import mark_as_read, notify_person, read_notifications
from app.features.people.logins import Login, read_roles
from app.features.people.queries import find_person_by_name
from app.features.people.roles import Role
from app.features.people.service import change_person, give_role, invite
from app.features.queue.changes import read_changes
from app.features.queue.service import list_groups
from tests.unit.features.independent_annotations.begun import begin_take


@pytest.fixture
def group(store: Store, fill, make_group) -> int:
    """A group of the dataset "demo", and people of whom carl does not see it."""
    (group,) = fill(make_group())
    for name, role in (("anna", Role.REVIEWER), ("bob", Role.ANNOTATOR), ("carl", Role.NONE)):
        invite(store, name, role, actor="local")
    return group


def login(store: Store, name: str) -> Login:
    """Somebody as they are at this moment."""
    from datetime import UTC, datetime

    with store.read() as session:
        row = find_person_by_name(session, name)
        roles = read_roles(session, row.id, Role(row.role))
    return Login(1, row.id, name, roles, datetime.now(UTC))


def told(store: Store, name: str) -> list[str]:
    """Why somebody was told something, the newest first."""
    return [ring.kind for ring in read_notifications(store, login(store, name)).items]


def found(store: Store, query: str) -> int:
    """How many groups a query finds."""
    return list_groups(store, 1, query).total


class TestThreads:
    def test_they_are_read_with_replies_as_they_were_said(self, store: Store, group: int) -> None:
        thread = comments.begin_thread(
            store, group, " Is this the ball? ", actor="anna", view="7_1.png", at=(612.0, 330.5)
        )
        comments.add_reply(store, group, thread.id, "It is.", actor="bob (token lens)")
        (read,) = comments.list_threads(store, group)
        assert (read.view, read.x, read.y, read.resolved) == ("7_1.png", 612.0, 330.5, None)
        said = [(one.actor, one.text) for one in read.comments]
        assert said == [("anna", "Is this the ball?"), ("bob (token lens)", "It is.")]

    def test_one_changes_and_deletes_what_is_ones_own_alone(self, store: Store, group: int) -> None:
        thread = comments.begin_thread(store, group, "One", actor="anna")
        mine = thread.comments[0].id
        for change in (
            lambda: comments.edit_comment(store, group, thread.id, mine, "Two", actor="bob"),
            lambda: comments.delete_comment(store, group, thread.id, mine, actor="bob"),
        ):
            with pytest.raises(ForbiddenError):
                change()
        changed = comments.edit_comment(
            store, group, thread.id, mine, "Two", actor="anna (token x)"
        )
        assert (changed.comments[0].text, changed.comments[0].edited is not None) == ("Two", True)
        comments.add_reply(store, group, thread.id, "Three", actor="bob")
        comments.delete_comment(store, group, thread.id, mine, actor="anna")
        (read,) = comments.list_threads(store, group)
        assert [one.text for one in read.comments] == [None, "Three"]
        comments.delete_comment(store, group, thread.id, read.comments[1].id, actor="bob")
        assert comments.list_threads(store, group) == []

    def test_what_cannot_be_said_is_refused_with_its_field(self, store: Store, group: int) -> None:
        for said, pointer in (
            ({"text": "  "}, "/text"),
            ({"text": "a" * (comments.LONGEST + 1)}, "/text"),
            ({"text": "a", "view": "no.png"}, "/view"),
            ({"text": "a", "at": (1.0, 2.0)}, "/view"),
        ):
            with pytest.raises(InputError) as refused:
                comments.begin_thread(store, group, actor="anna", **said)
            assert refused.value.pointer == pointer

    def test_a_thread_of_another_group_is_unknown(self, store: Store, fill, make_group) -> None:
        group, other = fill(make_group(7), make_group(8))
        thread = comments.begin_thread(store, group, "One", actor="anna")
        mine = thread.comments[0].id
        for asked in (
            lambda: comments.add_reply(store, other, thread.id, "Two", actor="anna"),
            lambda: comments.resolve_thread(store, other, thread.id, True, actor="anna"),
            lambda: comments.edit_comment(store, other, thread.id, mine, "Two", actor="anna"),
            lambda: comments.delete_comment(store, other, thread.id, mine, actor="anna"),
            lambda: comments.edit_comment(store, group, thread.id, 99, "Two", actor="anna"),
        ):
            with pytest.raises(NotFoundError):
                asked()
        assert comments.list_threads(store, other) == []

    def test_the_queue_counts_and_finds_what_is_open(self, store: Store, group: int) -> None:
        thread = comments.begin_thread(store, group, "@bob look", actor="anna")
        assert list_groups(store, 1).items[0].comments == 1
        asked = ("comments:open", "comments:resolved", "mentions:bob", "mentions:anna")
        assert [found(store, query) for query in asked] == [1, 0, 1, 0]
        comments.resolve_thread(store, group, thread.id, True, actor="bob")
        assert list_groups(store, 1).items[0].comments == 0
        assert [found(store, query) for query in asked] == [0, 1, 0, 0]
        assert [found(store, f"comments:{word}") for word in ("any", "none")] == [1, 0]


class TestLog:
    def test_every_word_is_in_the_chain_and_the_group_stays_what_it_was(
        self, store: Store, group: int
    ) -> None:
        with store.read() as session:
            before, position = read_etags(session, [group]), find_newest_entry_id(session)
        thread = comments.begin_thread(store, group, "One", actor="anna")
        comments.edit_comment(store, group, thread.id, thread.comments[0].id, "Two", actor="anna")
        comments.resolve_thread(store, group, thread.id, True, actor="bob")
        comments.delete_comment(store, group, thread.id, thread.comments[0].id, actor="anna")
        said = [entry for entry in read_history(store, group) if entry.kind == "comment"]
        assert [(one.actor, one.body["did"], one.body.get("text")) for one in said] == [
            ("anna", "said", "One"),
            ("anna", "edited", "Two"),
            ("bob", "resolved", None),
            ("anna", "deleted", None),
        ]
        with store.read() as session:
            assert verify_chain(session) == find_newest_entry_id(session)
            assert read_etags(session, [group]) == before
            (change,) = read_changes(session, position)
        assert (change.kind, change.group_id) == ("comment", group)

    def test_tables_that_are_made_anew_from_the_log_keep_the_comments(
        self, store: Store, group: int
    ) -> None:
        comments.begin_thread(store, group, "@anna One", actor="bob")
        rebuild_tables(store)
        (thread,) = comments.list_threads(store, group)
        assert (thread.comments[0].text, thread.comments[0].mentions) == ("@anna One", ("anna",))


class TestMentions:
    def test_names_stand_after_an_at_sign_and_in_no_address(self) -> None:
        assert comments.extract_mentions("@anna, @Bob. (@carl) mail x@dora.org @@eve") == [
            "anna",
            "bob",
            "carl",
        ]

    def test_only_who_sees_the_group_can_be_completed_and_is_told(
        self, store: Store, group: int
    ) -> None:
        assert comments.list_mentionable_people(store, group) == ["anna", "bob"]
        thread = comments.begin_thread(store, group, "@bob @carl @nobody @anna", actor="anna")
        assert thread.comments[0].mentions == ("anna", "bob")
        assert [told(store, name) for name in ("anna", "bob", "carl")] == [[], ["mention"], []]
        with store.read() as session:
            carl = find_person_by_name(session, "carl").id
        give_role(store, "demo", carl, Role.VIEWER, actor="local")
        assert comments.list_mentionable_people(store, group) == ["anna", "bob", "carl"]
        assert told(store, "carl") == []

    def test_of_a_copy_its_person_and_the_leads_alone_are_offered_and_told(
        self, store: Store, group: int
    ) -> None:
        invite(store, "lea", Role.LEAD, actor="local")
        copy = begin_take(store, group, person="bob").copy_id
        assert comments.list_mentionable_people(store, copy) == ["bob", "lea"]
        thread = comments.begin_thread(store, copy, "@anna @carl @lea", actor="bob")
        assert thread.comments[0].mentions == ("lea",)

    def test_who_spoke_before_hears_of_a_reply_and_who_is_named_once(
        self, store: Store, group: int
    ) -> None:
        thread = comments.begin_thread(store, group, "One", actor="anna")
        comments.add_reply(store, group, thread.id, "Two", actor="bob")
        comments.add_reply(store, group, thread.id, "@bob three", actor="anna")
        assert told(store, "anna") == ["reply"]
        assert told(store, "bob") == ["mention"]

    def test_who_spoke_through_a_token_hears_of_a_reply(self, store: Store, group: int) -> None:
        thread = comments.begin_thread(store, group, "One", actor="anna (token lens)")
        comments.add_reply(store, group, thread.id, "Two", actor="bob")
        assert told(store, "anna") == ["reply"]

    def test_who_is_disabled_is_not_mentioned(self, store: Store, group: int) -> None:
        with store.read() as session:
            bob = find_person_by_name(session, "bob").id
        change_person(store, bob, actor="local", disabled=True)
        thread = comments.begin_thread(store, group, "@bob look", actor="anna")
        assert thread.comments[0].mentions == ()

    def test_a_correction_is_told_to_those_alone_whom_it_names_anew(
        self, store: Store, group: int
    ) -> None:
        thread = comments.begin_thread(store, group, "@bob look", actor="anna")
        mine = thread.comments[0].id
        comments.edit_comment(store, group, thread.id, mine, "@bob @local look here", actor="anna")
        assert told(store, "bob") == ["mention"]
        other = comments.begin_thread(store, group, "look", actor="anna")
        comments.edit_comment(
            store, group, other.id, other.comments[0].id, "@bob look", actor="anna"
        )
        assert told(store, "bob") == ["mention", "mention"]

    def test_a_thread_is_full_some_day(
        self, store: Store, group: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(comments, "MOST", 2)
        thread = comments.begin_thread(store, group, "One", actor="anna")
        comments.add_reply(store, group, thread.id, "Two", actor="bob")
        with pytest.raises(ConflictError, match="at most 2 comments"):
            comments.add_reply(store, group, thread.id, "Three", actor="bob")


class TestBell:
    def test_what_somebody_may_not_see_any_more_is_not_shown(
        self, store: Store, group: int
    ) -> None:
        comments.begin_thread(store, group, "@bob look", actor="anna")
        bob = login(store, "bob")
        assert read_notifications(store, bob).unread == 1
        give_role(store, "demo", bob.person_id, Role.NONE, actor="local")
        bell = read_notifications(store, login(store, "bob"))
        assert (bell.items, bell.unread) == ([], 0)

    def test_it_is_ones_own_and_what_is_read_stays_read(self, store: Store, group: int) -> None:
        comments.begin_thread(store, group, "@bob @anna look", actor="local")
        bob, anna = login(store, "bob"), login(store, "anna")
        (ring,) = read_notifications(store, bob).items
        assert ring.sentence.startswith("local mentioned you in ")
        assert ring.address.startswith(f"/review/{group}?thread=")
        mark_as_read(store, anna, [ring.id])
        assert read_notifications(store, bob).unread == 1
        assert mark_as_read(store, bob, [ring.id]).unread == 0
        assert read_notifications(store, anna).unread == 1

    def test_nobody_is_told_who_is_disabled_or_did_it_themselves(
        self, store: Store, group: int
    ) -> None:
        bob = login(store, "bob").person_id
        change_person(store, bob, actor="local", disabled=True)

        def ring(session: Session, person: str, actor: str) -> bool:
            return notify_person(
                session, person, NotificationKind.ASSIGNED, "x", actor=actor, address="/"
            )

        with store.write() as session:
            assert not ring(session, "bob", "local")
            assert not ring(session, "anna", "anna (token x)")
            assert ring(session, "anna", "local")
