"""Tokens over the wire: good ones, those that are none, and what each may."""

from __future__ import annotations

import http.client
import json
import re
import time

import pytest
from limits import parse
from sqlalchemy import update

from app.features.imports.ingest import ensure_dataset
from app.features.jobs.queries import NewJob, insert_job
from app.features.people import access_tokens
from app.features.people.access_tokens import make_access_token_text
from app.features.people.roles import Role, Scope
from app.features.people.service import change_person, find_person
from app.features.people.tables import AccessTokenModel
from app.http.headers import read_bearer_token
from tests.security.asking import Answer, assert_guarded
from tests.security.team import API, BYTES, Team
from tests.waiting import SECONDS


class TestTokens:
    def ask(self, team: Team, bearer: str, target: str = "/datasets", **headers: str) -> Answer:
        return team.ask("GET", API + target, Authorization=bearer, Origin="", **headers)

    def made(self, team: Team, name: str, role: str, *scopes: str) -> tuple[int, str]:
        answer = team.ask("POST", f"{API}/tokens", {"name": name, "scopes": scopes}, role=role)
        assert answer.status == 201, answer.body
        found = json.loads(answer.body)
        return found["token"]["id"], f"Bearer {found['text']}"

    def test_unknown_expired_and_ended_get_the_same_answer(self, team: Team) -> None:
        team.add("keeps", Role.VIEWER)
        ended, gone = self.made(team, "gone", "keeps", "read")
        old, expired = self.made(team, "old", "keeps", "read")
        with team.store.write() as session:
            touched = update(AccessTokenModel).where(AccessTokenModel.id == old)
            session.execute(touched.values(expires="2026-01-01"))
        assert self.ask(team, gone).status == 200
        assert team.ask("DELETE", f"{API}/tokens/{ended}", role="viewer").status == 404
        assert team.ask("DELETE", f"{API}/tokens/{ended}", role="keeps").status == 204
        told = set()
        for bearer in (gone, expired, f"Bearer {make_access_token_text()}"):
            answer = self.ask(team, bearer)
            assert answer.status == 401
            assert answer.headers["www-authenticate"].startswith("Bearer")
            assert_guarded(answer, bearer)
            told.add(re.sub(rb"urn:uuid:[^\"]*", b"", answer.body))
        assert len(told) == 1
        assert b"unknown, expired or ended" in told.pop()

    def test_a_mistyped_one_is_known_without_the_database(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        bearer = team.bearer("read")
        typo = bearer[:-1] + ("a" if bearer[-1] != "a" else "b")
        monkeypatch.setattr(access_tokens, "find_access_token", None)
        for text in (typo, bearer[:-1], "Bearer", "Bearer x y"):
            assert b"incomplete or mistyped" in self.ask(team, text).body

    def test_a_token_counts_before_a_cookie_and_two_are_none(self, team: Team) -> None:
        bearer, cookie = team.bearer("read", role="viewer"), team.cookies["admin"]
        assert self.ask(team, bearer, "/users", Cookie=cookie).status == 403
        assert self.ask(team, "Bearer x", Cookie=cookie).status == 401
        assert self.ask(team, "Basic eDp5", Cookie=cookie).status == 200, "a proxy asked for it"
        both = [("authorization", bearer), ("authorization", team.bearer("read"))]
        raw = [(name.encode(), value.encode()) for name, value in both]
        assert read_bearer_token({"type": "http", "headers": raw}) == ""

    def test_a_page_of_another_site_is_refused_with_a_token_too(self, team: Team) -> None:
        bearer = team.bearer("lead")
        sent = {"Authorization": bearer, "kind": BYTES}
        target = f"{API}/uploads?name=a.zip"
        assert team.ask("POST", target, b"PK", **sent, Origin="").status == 201
        assert team.ask("POST", target, b"PK", **sent, Origin="http://evil.example").status == 403

    def test_who_is_disabled_has_no_tokens_and_gets_none_back(self, team: Team) -> None:
        team.add("sacked", Role.LEAD)
        bearer = team.bearer("read", role="sacked")
        person = find_person(team.store, "sacked")
        for disabled in (True, False):
            change_person(team.store, person.id, actor="local", disabled=disabled)
            assert self.ask(team, bearer).status == 401

    def test_a_role_that_is_taken_away_is_gone_from_the_token(self, team: Team) -> None:
        team.add("demoted", Role.LEAD)
        bearer = team.bearer("lead", role="demoted")
        assert self.ask(team, bearer, "/uploads").status == 200
        person = find_person(team.store, "demoted")
        change_person(team.store, person.id, actor="local", role=Role.VIEWER)
        assert b"needs the role lead" in self.ask(team, bearer, "/uploads").body

    def test_the_log_names_person_and_token(self, team: Team) -> None:
        team.add("ann", Role.LEAD)
        ensure_dataset(team.store, "tokened", "local")
        body = {"name": "mine", "q": ""}
        sent = {"Authorization": team.bearer("annotate", role="ann"), "Origin": ""}
        answer = team.ask("POST", f"{API}/datasets/tokened/saved-views", body, **sent)
        assert json.loads(answer.body)["by"] == "ann (token ann annotate)"
        named = team.ask("POST", f"{API}/datasets/tokened/saved-views", body, **sent, X_Actor="bob")
        assert named.status == 400

    def test_one_of_a_dataset_is_for_that_alone(self, team: Team) -> None:
        for name in ("near", "far"):
            ensure_dataset(team.store, name, "local")
        sent = {"Origin": ""}
        for role in ("admin", "lead"):
            body = {"name": f"near {role}", "scopes": list(Scope), "dataset": "near"}
            made = team.ask("POST", f"{API}/tokens", body, role=role)
            assert json.loads(made.body)["token"]["dataset"] == "near"
            sent["Authorization"] = f"Bearer {json.loads(made.body)['text']}"
            items = json.loads(self.ask(team, sent["Authorization"]).body)["items"]
            assert [item["name"] for item in items] == ["near"]
            assert self.ask(team, sent["Authorization"], "/datasets/far").status == 404
            assert self.ask(team, sent["Authorization"], "/datasets/near").status == 200
            for target in ("/users", "/imports/folders"):
                assert self.ask(team, sent["Authorization"], target).status == 403
            new = {"dataset": "new", "format": "coco", "source": {"folder": "x"}}
            assert team.ask("POST", f"{API}/imports", new, **sent).status == 403
        unknown = {"name": "none", "scopes": ["read"], "dataset": "nowhere"}
        assert team.ask("POST", f"{API}/tokens", unknown, role="viewer").status == 404
        hidden = {"name": "none", "scopes": ["read"], "dataset": "near"}
        assert team.ask("POST", f"{API}/tokens", hidden, role="none").status == 404

    def test_what_a_token_makes_is_its_persons(self, team: Team) -> None:
        for name in ("olga", "olg"):
            team.add(name, Role.LEAD)
        sent = {"Authorization": team.bearer("lead", role="olga"), "Origin": "", "kind": BYTES}
        made = team.ask("POST", f"{API}/uploads?name=mine.zip", b"olgas", **sent)
        upload = json.loads(made.body)["id"]
        for way in ({"role": "olga"}, {"Authorization": team.bearer("lead", role="olga")}):
            assert team.ask("GET", f"{API}/uploads/{upload}", **way).status == 200
            assert upload.encode() in team.ask("GET", f"{API}/uploads", **way).body
        for way in ({"role": "olg"}, {"Authorization": team.bearer("lead", role="olg")}):
            assert team.ask("GET", f"{API}/uploads/{upload}", **way).status == 404
            assert upload.encode() not in team.ask("GET", f"{API}/uploads", **way).body

    def test_one_of_a_dataset_has_nothing_of_its_persons_that_belongs_to_none(
        self, team: Team
    ) -> None:
        ensure_dataset(team.store, "leads", "local")
        body = {"name": "narrow", "scopes": ["read", "lead"], "dataset": "leads"}
        made = team.ask("POST", f"{API}/tokens", body, role="lead")
        narrow = {"Authorization": f"Bearer {json.loads(made.body)['text']}", "Origin": ""}
        wide = {"Authorization": team.bearer("lead", role="lead"), "Origin": ""}
        ids = {}
        for name, way in (("lead", {"role": "lead"}), ("wide", wide), ("narrow", narrow)):
            target = f"{API}/uploads?name={name}.zip"
            sent = team.ask("POST", target, name.encode(), **way, kind=BYTES)
            ids[name] = json.loads(sent.body)["id"]
        job = NewJob("import", "Import into a new one", "lead")
        with team.store.write() as session:
            ids["job"] = insert_job(session, job)

        def seen(way: dict[str, str]) -> set[str]:
            items = json.loads(team.ask("GET", f"{API}/uploads", **way).body)["items"]
            return {name for name in ("lead", "wide", "narrow") if ids[name] in str(items)}

        assert seen({"role": "lead"}) == seen(wide) == {"lead", "wide", "narrow"}
        assert seen(narrow) == {"narrow"}
        for name in ("lead", "wide"):
            for method in ("GET", "DELETE"):
                asked = team.ask(method, f"{API}/uploads/{ids[name]}", **narrow)
                assert asked.status == 404, (method, name)
        for method in ("GET", "DELETE"):
            assert team.ask(method, f"{API}/jobs/{ids['job']}", **narrow).status == 404
        assert team.ask("DELETE", f"{API}/uploads/{ids['narrow']}", **narrow).status == 204
        assert team.ask("GET", f"{API}/jobs/{ids['job']}", **wide).status == 200

    def test_no_token_and_nobody_for_themselves_makes_a_link_for_a_password(
        self, team: Team
    ) -> None:
        sent = {"Authorization": team.bearer("admin"), "Origin": ""}
        for name in ("admin", "viewer"):
            target = f"{API}/users/{find_person(team.store, name).id}/link"
            answer = team.ask("POST", target, **sent)
            assert (answer.status, b"a token cannot set a password" in answer.body) == (403, True)
        me = find_person(team.store, "admin").id
        own = team.ask("POST", f"{API}/users/{me}/link", role="admin")
        assert (own.status, b"for yourself" in own.body) == (403, True)

    def test_no_token_makes_people_or_changes_their_rights(self, team: Team) -> None:
        sent = {"Authorization": team.bearer("admin"), "Origin": ""}
        viewer = f"{API}/users/{find_person(team.store, 'viewer').id}"
        me = f"{API}/users/{find_person(team.store, 'admin').id}"
        for method, target, body in (
            ("POST", f"{API}/users", {"name": "friend", "role": "admin"}),
            (
                "POST",
                f"{API}/users/invitations",
                {"people": [{"name": "friend", "role": "admin"}]},
            ),
            ("PATCH", viewer, {"role": "admin"}),
            ("PATCH", viewer, {"disabled": True}),
            ("PATCH", me, {"disabled": True}),
            ("POST", f"{viewer}/adoption", None),
            ("DELETE", f"{viewer}/second-factor", None),
            ("PUT", f"{API}/team", {"require_second_factor": True}),
        ):
            answer = team.ask(method, target, body, **sent)
            assert (answer.status, b"a token cannot add people" in answer.body) == (403, True), (
                target
            )
        assert find_person(team.store, "viewer").role is Role.VIEWER

    def test_an_admin_ends_anybodys(self, team: Team) -> None:
        team.add("lost", Role.VIEWER)
        number, bearer = self.made(team, "laptop", "lost", "read")
        target = f"{API}/users/{find_person(team.store, 'lost').id}/tokens"
        listed = json.loads(team.ask("GET", target, role="admin").body)["items"]
        assert [(one["name"], one["start"]) for one in listed] == [("laptop", bearer[7:18])]
        elsewhere = f"{API}/users/{find_person(team.store, 'viewer').id}/tokens/{number}"
        assert team.ask("DELETE", elsewhere, role="admin").status == 404
        assert team.ask("DELETE", f"{target}/{number}", role="admin").status == 204
        assert self.ask(team, bearer).status == 401

    def test_no_secret_is_kept_for_a_request_that_is_repeated(self, team: Team) -> None:
        body = {"name": "again", "scopes": ["read"]}
        first, second = (
            team.ask("POST", f"{API}/tokens", body, role="viewer", Idempotency_Key="k-2")
            for _ in "12"
        )
        assert (first.status, second.status) == (201, 409)

    def test_an_open_stream_ends_with_its_token(self, team: Team) -> None:
        team.add("all-ears", Role.VIEWER)
        number, bearer = self.made(team, "ears", "all-ears", "read")
        connection = http.client.HTTPConnection(team.address.partition("//")[2], timeout=SECONDS)
        connection.request("GET", f"{API}/events", headers={"Authorization": bearer})
        answer = connection.getresponse()
        assert answer.readline().startswith(b":")
        team.ask("DELETE", f"{API}/tokens/{number}", role="all-ears")
        until = time.monotonic() + SECONDS
        while answer.read1(1000):
            assert time.monotonic() < until, "it goes on"
        connection.close()

    def test_guesses_are_counted_and_good_tokens_are_not(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.http.team.TOKEN_LIMIT", parse("4/minute"))
        team.forget_attempts()
        guesses = [self.ask(team, f"Bearer {make_access_token_text()}") for _ in range(5)]
        assert [answer.status for answer in guesses] == [401] * 4 + [429]
        assert 0 < int(guesses[-1].headers["retry-after"]) <= 60
        assert self.ask(team, team.bearer("read")).status == 200
        assert team.log_in("viewer").status == 200
