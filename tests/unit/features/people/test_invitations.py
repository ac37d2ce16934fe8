"""Invitations: many at once, a word on each row, and links that are mailed or shown, never lost."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from app.config import Settings
from app.db.store import Store
from app.errors import ForbiddenError, InputError
from app.features.people import links
from app.features.people.invitations import (
    NO_MAIL,
    NO_URL,
    InvitationRow,
    LinkMailer,
    invite_many,
    invite_person,
    parse_invitation_list,
    renew_invitation,
)
from app.features.people.links import find_link_holder
from app.features.people.roles import Role
from app.features.people.service import list_people
from app.mail import MailServer, read_mail_server
from tests.databases import all_that_is_kept
from tests.smtp import MailBox, serving

URL = "https://touchline.example.org"
ROWS = [
    InvitationRow(1, "Anna", "Lead", "anna@example.org"),
    InvitationRow(2, "ben", "annotator"),
    InvitationRow(3, "carl", "boss"),
    InvitationRow(4, "local", "viewer"),
    InvitationRow(5, "anna", "viewer"),
    InvitationRow(6, "dora", "viewer", "dora at home"),
    InvitationRow(7, "emil", ""),
]


def mail_server(tmp_path: Path, box: MailBox) -> MailServer:
    more: dict[str, Any] = {"smtp_security": "none", "smtp_from": "box@example.org"}
    found = read_mail_server(
        Settings(home=tmp_path, smtp_host="127.0.0.1", smtp_port=box.port, **more)
    )
    assert found is not None
    return found


def names(store: Store) -> list[str]:
    return [person.name for person in list_people(store)]


def token_of(text: str) -> str:
    return text.partition("/join#")[2].split()[0]


class TestInviteMany:
    def test_says_of_each_row_what_became_of_it(self, store: Store) -> None:
        report = invite_many(store, ROWS, LinkMailer(None, None, URL), actor="local", dry_run=False)
        assert [(row.row, row.name, row.state) for row in report] == [
            (1, "anna", "invited"),
            (2, "ben", "invited"),
            (3, "carl", "refused"),
            (4, "local", "refused"),
            (5, "anna", "refused"),
            (6, "dora", "refused"),
            (7, "emil", "refused"),
        ]
        problems = [row.problem or "" for row in report]
        assert problems[0] == NO_MAIL
        assert problems[1] == ""
        assert problems[2] == (
            '"boss" is not a role; the roles are none, viewer, annotator, reviewer, lead, admin'
        )
        assert "is not a valid user name" in problems[3]
        assert problems[4] == "anna is already in row 1"
        assert problems[5] == '"dora at home" is not an email address'
        assert problems[6].startswith("the role is missing")
        assert names(store) == ["anna", "ben"]
        assert [person.role for person in list_people(store)] == [Role.LEAD, Role.ANNOTATOR]
        assert find_link_holder(store, token_of(report[0].link or "")).name == "anna"

    def test_a_dry_run_says_the_same_and_makes_nobody(self, store: Store) -> None:
        with serving(MailBox()) as box:
            post = LinkMailer(mail_server(store.settings.home, box), URL, URL)
            report = invite_many(store, ROWS, post, actor="local", dry_run=True)
        assert [row.state for row in report] == ["possible"] * 2 + ["refused"] * 5
        assert {row.link for row in report} == {None}
        assert names(store) == []
        assert box.connections == 0

    def test_whoever_is_there_already_is_refused(self, store: Store) -> None:
        post = LinkMailer(None, None, URL)
        invite_many(store, ROWS[:1], post, actor="local", dry_run=False)
        (row,) = invite_many(store, ROWS[:1], post, actor="local", dry_run=False)
        assert (row.state, row.problem) == ("refused", "there is already a user anna")

    def test_tokens_invite_nobody(self, store: Store) -> None:
        with pytest.raises(ForbiddenError):
            invite_many(
                store, ROWS, LinkMailer(None, None, URL), actor="anna (token x)", dry_run=True
            )

    @pytest.mark.parametrize("count", [0, 501])
    def test_lists_have_an_end(self, store: Store, count: int) -> None:
        rows = [InvitationRow(n, f"p{n}", "viewer") for n in range(count)]
        with pytest.raises(InputError, match="it must have 1 to 500"):
            invite_many(store, rows, LinkMailer(None, None, URL), actor="local", dry_run=False)


class TestPost:
    def test_a_link_that_went_by_mail_is_shown_to_nobody_else(self, store: Store) -> None:
        with serving(MailBox()) as box:
            post = LinkMailer(mail_server(store.settings.home, box), URL, URL)
            report = invite_many(store, ROWS[:2], post, actor="berta", dry_run=False)
        anna, ben = report
        assert (anna.mailed, anna.link, anna.problem) == (True, None, None)
        assert (ben.mailed, ben.problem) == (False, None)
        assert (ben.link or "").startswith(f"{URL}/join#")
        (letter,) = box.letters
        assert letter["To"] == "anna@example.org"
        assert letter["Subject"] == "Your account on Touchline at touchline.example.org"
        text = letter.get_content()
        assert f"berta invites you to Touchline at {URL} as lead." in text
        assert find_link_holder(store, token_of(text)).name == "anna"

    def test_a_letter_that_is_refused_shows_its_link_and_why(self, store: Store) -> None:
        with serving(MailBox(refuses=frozenset({"anna@example.org"}))) as box:
            post = LinkMailer(mail_server(store.settings.home, box), URL, URL)
            (row,) = invite_many(store, ROWS[:1], post, actor="local", dry_run=False)
        assert (row.state, row.mailed) == ("invited", False)
        assert row.problem == "the mail server refuses the letter (550: 5.1.1 no such box)"
        assert find_link_holder(store, token_of(row.link or "")).name == "anna"

    def test_a_server_that_does_not_know_its_address_sends_no_link(self, store: Store) -> None:
        with serving(MailBox()) as box:
            post = LinkMailer(mail_server(store.settings.home, box), None, "http://evil.example")
            (row,) = invite_many(store, ROWS[:1], post, actor="local", dry_run=False)
        assert (row.mailed, row.problem, box.letters) == (False, NO_URL, [])

    def test_another_link_says_what_it_is_for(self, store: Store) -> None:
        with serving(MailBox()) as box:
            post = LinkMailer(mail_server(store.settings.home, box), URL, URL)
            person, first = invite_person(store, "anna", Role.LEAD, None, post, actor="berta")
            address = "anna@example.org"
            renew_invitation(store, person.id, address, post, actor="berta")
            again, row = renew_invitation(store, person.id, None, post, actor="berta")
            links.set_password_by_link(store, token_of(row.link or ""), "three plain words")
            _, reset = renew_invitation(store, person.id, address, post, actor="berta")
        assert (first.state, row.state, reset.state) == ("invited", "invited", "reset")
        assert reset.mailed and not again.joined
        invited, other = box.letters
        assert invited["Subject"] == "Your account on Touchline at touchline.example.org"
        assert other["Subject"] == "A new password for Touchline at touchline.example.org"
        assert "invites you" not in other.get_content()
        assert find_link_holder(store, token_of(other.get_content())).joined

    def test_addresses_stand_in_no_table(self, store: Store) -> None:
        with serving(MailBox()) as box:
            post = LinkMailer(mail_server(store.settings.home, box), URL, URL)
            invite_many(store, ROWS[:1], post, actor="local", dry_run=False)
        assert b"anna@example.org" not in all_that_is_kept(store.settings.home)


class TestInviteOne:
    def test_an_address_that_is_none_makes_nobody(self, store: Store) -> None:
        with pytest.raises(InputError, match="is not an email address") as caught:
            invite_person(
                store, "anna", Role.VIEWER, "anna", LinkMailer(None, None, URL), actor="local"
            )
        assert caught.value.pointer == "/email"
        assert names(store) == []


class TestReadList:
    def test_reads_a_line_for_each_person(self) -> None:
        text = "\ufeff# the new ones\nanna,reviewer,anna@example.org\n\n ben , annotator \ncarl\n"
        assert parse_invitation_list(text) == [
            InvitationRow(2, "anna", "reviewer", "anna@example.org"),
            InvitationRow(4, "ben", "annotator"),
            InvitationRow(5, "carl", ""),
        ]

    @pytest.mark.parametrize("divider", [",", ";", "\t"])
    def test_a_first_line_says_the_order_of_columns(self, divider: str) -> None:
        lines = [("E-Mail", "Name", "Role"), ("a@b.org", "anna", "lead"), ("", "ben", "viewer")]
        text = "\r\n".join(divider.join(line) for line in lines)
        assert parse_invitation_list(text) == [
            InvitationRow(2, "anna", "lead", "a@b.org"),
            InvitationRow(3, "ben", "viewer"),
        ]

    def test_an_unknown_column_is_refused(self) -> None:
        with pytest.raises(InputError, match='"phone"'):
            parse_invitation_list("name,role,phone\nanna,lead,1\n")

    def test_more_cells_than_columns_are_not_dropped(self) -> None:
        (row,) = parse_invitation_list("anna,lead,a@b.org,c@d.org")
        assert row.email == "a@b.org,c@d.org"
