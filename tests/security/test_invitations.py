"""Invitations over HTTP: by mail, for many at once, and what stays of an address."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import pytest
from structlog.testing import capture_logs

from app.config import Settings
from app.mail import read_mail_server
from tests.security.team import API, Team
from tests.smtp import MailBox, serving

MANY = f"{API}/users/invitations"


@pytest.fixture
def box(team: Team) -> Iterator[MailBox]:
    """The mail server of the team's."""
    state = team.app.state
    before = state.team
    with serving(MailBox(refuses=frozenset({"nobody@example.org"}))) as box:
        server = read_mail_server(
            Settings(
                smtp_host="127.0.0.1",
                smtp_port=box.port,
                smtp_security="none",
                smtp_from="box@example.org",
            )
        )
        state.team = replace(before, mail=server, url=team.address)
        yield box
        state.team = before


def asked(team: Team, target: str, body: Any, status: int, role: str = "admin") -> dict[str, Any]:
    answer = team.ask("POST", target, body, role=role)
    assert answer.status == status, answer.body
    told: dict[str, Any] = json.loads(answer.body)
    return told


class TestInviteUser:
    def test_a_link_goes_by_mail_and_is_not_shown(self, team: Team, box: MailBox) -> None:
        with capture_logs() as logs:
            new = {"name": "mailed", "role": "viewer", "email": "mailed@example.org"}
            told = asked(team, f"{API}/users", new, 201)
        assert (told["link"], told["mailed"], told["problem"]) == (None, True, None)
        (letter,) = box.letters
        token = letter.get_content().partition("/join#")[2].split()[0]
        meant = asked(team, f"{API}/links/look", {"token": token}, 200)
        assert meant == {"name": "mailed", "joined": False}
        assert "mailed@example.org" not in repr(logs)

    def test_a_letter_that_is_not_taken_leaves_the_link(self, team: Team, box: MailBox) -> None:
        new = {"name": "unmailed", "role": "viewer", "email": "nobody@example.org"}
        told = asked(team, f"{API}/users", new, 201)
        assert told["mailed"] is False
        assert told["problem"].startswith("the mail server refuses the letter")
        assert told["link"].startswith(f"{team.address}/join#")

    def test_where_no_mail_is_set_up_the_link_is_shown(self, team: Team) -> None:
        new = {"name": "shown", "role": "viewer", "email": "shown@example.org"}
        told = asked(team, f"{API}/users", new, 201)
        assert told["problem"] == "this server sends no mail: hand over the link yourself"
        assert "/join#" in told["link"]

    def test_another_link_goes_by_mail_as_the_first_did(self, team: Team, box: MailBox) -> None:
        user = asked(team, f"{API}/users", {"name": "again", "role": "viewer"}, 201)["user"]
        target = f"{API}/users/{user['id']}/link"
        told = asked(team, target, {"email": "again@example.org"}, 200)
        assert (told["link"], told["mailed"], told["problem"]) == (None, True, None)
        (letter,) = box.letters
        token = letter.get_content().partition("/join#")[2].split()[0]
        meant = asked(team, f"{API}/links/look", {"token": token}, 200)
        assert meant == {"name": "again", "joined": False}
        told = asked(team, target, {"email": "nobody@example.org"}, 200)
        assert (told["mailed"], "/join#" in told["link"]) == (False, True)
        assert told["problem"].startswith("the mail server refuses the letter")
        told = asked(team, target, {}, 200)
        assert (told["mailed"], told["problem"], "/join#" in told["link"]) == (False, None, True)

    @pytest.mark.parametrize(
        "email", ["x", "a@example.org\r\nBcc: eve@example.org", "a@example.org,b@example.org"]
    )
    def test_no_address_smuggles_a_second_one(self, team: Team, box: MailBox, email: str) -> None:
        new = {"name": "smuggled", "role": "viewer", "email": email}
        assert asked(team, f"{API}/users", new, 400)["pointer"] == "/email"
        assert box.letters == []

    def test_the_list_of_people_says_whether_mail_is_sent(self, team: Team, box: MailBox) -> None:
        assert json.loads(team.ask("GET", f"{API}/users", role="admin").body)["mail"] is True


class TestInviteUsers:
    def test_each_row_has_its_word(self, team: Team, box: MailBox) -> None:
        people = [
            {"name": "row-one", "role": "viewer", "email": "one@example.org"},
            {"name": "row-two", "role": "viewer", "email": "nobody@example.org"},
            {"name": "row-three", "role": "annotator"},
            {"name": "row-one", "role": "viewer"},
            {"name": "row-five", "role": "king"},
        ]
        dry = asked(team, f"{MANY}?dry_run=true", {"people": people}, 200)
        assert [row["state"] for row in dry["items"]] == ["possible"] * 3 + ["refused"] * 2
        assert box.letters == []
        told = asked(team, MANY, {"people": people}, 200)
        assert (told["invited"], told["refused"], told["mailed"]) == (3, 2, 1)
        assert [row["row"] for row in told["items"]] == [1, 2, 3, 4, 5]
        assert [row["link"] is not None for row in told["items"]] == [
            False,
            True,
            True,
            False,
            False,
        ]
        assert [bool(row["problem"]) for row in told["items"]] == [False, True, False, True, True]
        assert box.connections == 1
