"""Every route of a team's server with every role: who may not, is refused; and sessions themselves."""

from __future__ import annotations

import http.client
import json
import time
from contextlib import ExitStack, closing
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import structlog
from limits import parse

from app.config import Settings
from app.db.log import NewLogEntry, append_entries, read_log
from app.db.session import now
from app.db.store import Store
from app.features.imports.ingest import ensure_dataset
from app.features.people import links
from app.features.people.devices import LASTS, DeviceTokens
from app.features.people.roles import LEAST, Role, Scope
from app.features.people.service import change_person, find_person, give_role, renew_link
from app.http import access
from app.http.pages import PAGES
from app.http.route import list_routes
from tests.security.asking import Answer, assert_guarded
from tests.security.table import TABLE, Row, rows
from tests.security.team import API, BYTES, DEVICE, GUARDED, HIDDEN, SECRET, Team, asked, cookie_in
from tests.waiting import SECONDS

RANKS = [role.value for role in Role]
SCOPE_OF = dict(zip(RANKS, ("read", "read", "annotate", "review", "lead", "admin"), strict=True))
"""The scope that lets a token do what a role may."""
OTHERWISE = {f"POST {API}/exports": "export"}
OF_PEOPLE = ("/session", "/sessions", "/tokens", "/notifications")
"""What no token may: sessions, passwords, tokens, and what a person is told."""
LET_IN = {
    "read": {200, 404, 422},
    "stream": {200},
    "page": {200, 404},
    "change": {200, 404, 409, 422, 428},
    "body": {404, 422, 428},
    "upload": {201, 404},
}
"""How a route answers whom it lets in, by its kind: what is asked for is often not there, and
the body of no shape."""


class TestTable:
    def test_the_reviewed_table_and_what_the_routes_say_are_the_same(self, team: Team) -> None:
        reviewed = {str(row): row.role for row in rows()}
        said = {name: route.permission.action for name, route in list_routes(team.app)}
        decided = {
            name: "everybody" if action is None else LEAST[action].value
            for name, action in said.items()
        }
        # Mounted folders, of the browser application alone (``require_permissions``).
        for folder in ("GET /static/{file}", "GET /assets/{version}/{file}"):
            assert reviewed.pop(folder) == "everybody"
        assert decided == reviewed

    def test_nothing_is_open_but_the_application_and_the_way_in(self, team: Team) -> None:
        opened = {name for name, route in list_routes(team.app) if route.permission.action is None}
        data = {route for route in opened if API in route}
        assert data == {
            f"GET {API}/session",
            f"POST {API}/session",
            f"DELETE {API}/session",
            f"POST {API}/session/passkey/begin",
            f"POST {API}/session/passkey",
            f"POST {API}/session/sign-on/begin",
            f"POST {API}/session/sign-on",
            f"POST {API}/links/look",
            f"POST {API}/links/use",
        }
        assert {f"GET {page}" for page in PAGES} < opened
        assert "GET /metrics" not in opened

    def test_every_role_is_explained(self) -> None:
        assert list(TABLE["roles"])[1:] == RANKS
        assert {row.role for row in rows()} <= set(TABLE["roles"])


class TestEveryRoute:
    @pytest.mark.parametrize("row", GUARDED, ids=str)
    def test_lets_in_who_may_and_nobody_else(self, team: Team, row: Row) -> None:
        stranger = asked(team, row, None)
        assert stranger.status == 401, (row, stranger.body)
        if row.kind != "stream":
            assert_guarded(stranger, row)
        assert stranger.headers["www-authenticate"].startswith("Session")
        least = RANKS.index(row.role)
        if least > RANKS.index("viewer"):
            below = asked(team, row, RANKS[least - 1])
            # What may be somebody's own is looked for before anything is said of it.
            looked_for = any(f"/{word}/{{" in row.path for word in ("exports", "jobs", "uploads"))
            assert below.status == (404 if looked_for else 403), (row, below.body)
            said = f"needs the role {row.role}".encode()
            assert looked_for or row.kind == "stream" or said in below.body
        if str(row) == f"DELETE {API}/sessions":
            return
        enough = asked(team, row, row.role)
        assert enough.status in LET_IN[row.kind], (row, enough.body)

    def test_a_token_lets_in_with_its_scope_and_with_no_other(self, team: Team) -> None:
        for row in GUARDED:
            scope = OTHERWISE.get(str(row), SCOPE_OF[row.role])
            private = row.path.removeprefix(API).startswith(OF_PEOPLE)
            others = tuple(s for s in Scope if private or s not in (scope, Scope.READ))
            lacks = asked(team, row, None, Authorization=team.bearer(*others), Origin="")
            if scope == "read" and not private:
                assert lacks.status in LET_IN[row.kind], (row, lacks.body)
                continue
            assert lacks.status == 403, (row, lacks.body)
            says = (
                "this action is not allowed with a token"
                if private
                else f"this token lacks the scope {scope};"
            )
            assert row.kind == "stream" or says.encode() in lacks.body, (row, lacks.body)
            if not private:
                enough = asked(team, row, None, Authorization=team.bearer(scope), Origin="")
                peoples = enough.status == 403 and b"a token cannot add people" in enough.body
                assert enough.status in LET_IN[row.kind] or peoples, (row, enough.body)

    def test_a_token_may_no_more_than_its_person(self, team: Team) -> None:
        every = tuple(Scope)
        for role in RANKS[1:]:
            bearer = team.bearer(*every, role=role)
            for row in (
                r for r in GUARDED if r.kind == "body" and r.role not in ("none", "viewer")
            ):
                answer = asked(team, row, None, Authorization=bearer, Origin="")
                if RANKS.index(role) >= RANKS.index(row.role):
                    assert answer.status in LET_IN["body"], (role, row, answer.body)
                else:
                    assert answer.status == 403, (role, row, answer.body)

    @pytest.mark.parametrize("row", [r for r in rows() if r.role == "everybody"], ids=str)
    def test_what_is_open_answers_strangers(self, team: Team, row: Row) -> None:
        assert asked(team, row, None).status in LET_IN[row.kind], row

    def test_what_is_no_route_is_not_there(self, team: Team) -> None:
        assert team.ask("GET", HIDDEN).status == 401
        for role in RANKS:
            assert team.ask("GET", HIDDEN, role=role).status == 404

    @pytest.mark.parametrize(
        ("path", "status"),
        [
            (f"{API}/datasets/", 401),
            (f"{API}//datasets", 401),
            ("/API/V1/datasets", 404),
            (f"{API}/%64atasets", 401),
            ("/metrics/", 404),
            (f"{API}/datasets%2f", 401),
        ],
    )
    def test_another_spelling_opens_nothing(self, team: Team, path: str, status: int) -> None:
        answer = team.ask("GET", path)
        assert answer.status == status, answer.body
        assert b"items" not in answer.body

    @pytest.mark.parametrize("method", ["OPTIONS", "TRACE", "PROPFIND", "POST"])
    def test_another_method_opens_nothing(self, team: Team, method: str) -> None:
        assert team.ask(method, f"{API}/datasets").status == 401


class TestSessions:
    def test_the_cookie_is_for_this_server_alone(self, team: Team) -> None:
        said = team.log_in("viewer").headers["set-cookie"].lower()
        assert "httponly" in said and "samesite=strict" in said and "path=/" in said
        assert "domain" not in said
        assert "secure" not in said, "there is no TLS on loopback"

    def test_behind_tls_it_is_secure_and_bound_to_its_name(self, tmp_path: Path) -> None:
        from app.http.team import TeamLogin as Way

        settings = Settings(home=tmp_path, team=True, url="https://touchline.example.org")
        with closing(Store.open(settings)) as store:
            way = Way.of(settings, store)
        assert way is not None
        assert way.cookies.session_name.startswith("__Host-")
        assert way.cookies.make_session_cookie("x")["secure"] is True

    def test_a_login_gives_a_new_session_and_ends_the_old(self, team: Team) -> None:
        old = team.add("fixed", Role.VIEWER)
        planted = "touchline_session=" + "A" * 43
        for before in (old, planted):
            fresh = cookie_in(team.log_in("fixed", Cookie=before))
            assert fresh != before
            assert team.ask("GET", f"{API}/datasets", Cookie=before).status == 401
            assert team.ask("GET", f"{API}/datasets", Cookie=fresh).status == 200

    def test_logging_out_ends_it_on_the_server(self, team: Team) -> None:
        cookie = team.add("leaves", Role.VIEWER)
        answer = team.ask("DELETE", f"{API}/session", role="leaves")
        assert "max-age=0" in answer.headers["set-cookie"].lower()
        assert team.ask("GET", f"{API}/datasets", Cookie=cookie).status == 401

    def test_two_cookies_of_the_name_are_none(self, team: Team) -> None:
        mine = team.cookies["viewer"]
        both = f"{mine}; touchline_session=x"
        assert team.ask("GET", f"{API}/datasets", Cookie=both).status == 401
        assert team.ask("GET", f"{API}/datasets", Cookie=f"a=b; {mine}").status == 200

    def test_own_sessions_are_listed_and_ended(self, team: Team) -> None:
        team.add("many", Role.VIEWER)
        other = cookie_in(team.log_in("many", User_Agent="Another/1.0"))
        items = json.loads(team.ask("GET", f"{API}/sessions", role="many").body)["items"]
        assert sorted(item["this"] for item in items) == [False, True]
        gone = next(item for item in items if item["browser"] == "Another/1.0")
        foreign = team.ask("DELETE", f"{API}/sessions/{gone['id']}", role="viewer")
        assert foreign.status == 404
        assert team.ask("DELETE", f"{API}/sessions/{gone['id']}", role="many").status == 204
        assert team.ask("GET", f"{API}/datasets", Cookie=other).status == 401
        assert team.ask("GET", f"{API}/datasets", role="many").status == 200

    def test_a_role_that_is_taken_away_is_gone_with_the_next_request(self, team: Team) -> None:
        team.add("falls", Role.LEAD)
        target = f"{API}/uploads"
        assert team.ask("GET", target, role="falls").status == 200
        user = find_person(team.store, "falls").id
        edit = {"role": "viewer"}
        assert team.ask("PATCH", f"{API}/users/{user}", edit, role="admin").status == 200
        assert team.ask("GET", target, role="falls").status == 403

    @pytest.mark.file_of_sqlite("a server of databases is always waited for")
    def test_it_is_looked_up_without_a_thread_and_by_one_where_there_is_something_to_wait_for(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        by_threads: list[str] = []
        run_sync = access.run_sync

        async def noted(work, *given, **how):
            by_threads.append(work.__name__)
            return await run_sync(work, *given, **how)

        monkeypatch.setattr(access, "run_sync", noted)
        address = f"{API}/datasets"
        assert team.ask("GET", address, role="reviewer").status == 200
        assert by_threads == []
        # Whoever has a role in one dataset alone: it takes a look where each thing is.
        team.add("here-only", Role.NONE)
        assert team.ask("GET", f"{API}/jobs/1", role="here-only").status == 404
        assert by_threads == ["require_allowed", "find_missing_error"]
        with team.store.read_without_waiting():
            assert team.ask("GET", address, role="reviewer").status == 200
        assert by_threads == ["require_allowed", "find_missing_error", "_find_login"]
        assert team.ask("GET", address, Cookie="touchline-session=nobody").status == 401

    def test_the_log_says_who_asked_and_from_where(self, team: Team) -> None:
        with structlog.testing.capture_logs() as lines:
            address = f"{API}/datasets/broadcast/saved-views"
            for who in ({"role": "admin"}, {"Authorization": team.bearer("admin")}, {}):
                # Each is refused, for one reason or another.
                assert team.ask("POST", address, {}, **who).status >= 400
            # A line follows its answer.
            end = time.monotonic() + SECONDS
            asked: list[Any] = []
            while len(asked) < 3 and time.monotonic() < end:
                time.sleep(0.01)
                asked = [line for line in lines if line.get("path") == address]
        assert {line["address"] for line in asked} == {"127.0.0.1"}
        assert [line["person"] for line in asked] == ["admin", "admin (token admin admin)", None]

    def test_no_dataset_is_offered_that_somebody_may_not_see(self, team: Team) -> None:
        team.add("sees-none", Role.NONE)
        ensure_dataset(team.store, "offered", "local")
        address = f"{API}/datasets/oferred"
        assert b"offered" in team.ask("GET", address, role="viewer").body
        for who in ("sees-none", None):
            assert b"offered" not in team.ask("GET", address, role=who).body

    def test_nobody_changes_their_own_rights(self, team: Team) -> None:
        me = find_person(team.store, "admin").id
        for edit in ({"role": "viewer"}, {"disabled": True}):
            assert team.ask("PATCH", f"{API}/users/{me}", edit, role="admin").status == 403

    def test_the_next_person_in_a_browser_is_shown_nothing_of_the_last(self, team: Team) -> None:
        team.add("shares", Role.VIEWER)
        told = team.log_in("shares")
        assert "clear-site-data" not in told.headers, "a browser of their own"
        browser = cookie_in(told, DEVICE)
        assert "clear-site-data" not in team.log_in("shares", Cookie=browser).headers
        assert team.log_in("viewer", Cookie=browser).headers["clear-site-data"] == '"cache"'
        out = team.ask("DELETE", f"{API}/session", Cookie=cookie_in(told))
        assert out.headers["clear-site-data"] == '"cache"'

    def test_too_many_tries_of_a_name_wait(self, team: Team) -> None:
        told = [team.log_in("tried", "wrong wrong wrong").status for _ in range(11)]
        assert told == [401] * 10 + [429]
        answer = team.log_in("tried")
        assert 0 < int(answer.headers["retry-after"]) <= 60
        assert team.log_in("viewer").status == 200, "others are let in"

    def test_strangers_who_guess_lock_nobody_out_of_a_browser_that_is_known(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        team.add("guessed", Role.VIEWER)
        name, _, token = cookie_in(team.log_in("guessed"), DEVICE).partition("=")
        known, foreign = f"{name}={token}", cookie_in(team.log_in("viewer"), DEVICE)
        monkeypatch.setattr("app.http.team.NAME_LIMIT_ALL_ADDRESSES", parse("4/hour"))
        team.forget_attempts()
        wrong = [team.log_in("guessed", "wrong wrong wrong").status for _ in range(5)]
        assert wrong[-1] == 429
        assert team.log_in("guessed").status == 429, "nor does the right password help a stranger"
        for cookie in (
            foreign,
            f"{name}={foreign.partition('=')[2]}",
            f"{known[:-1]}!",
            f"{name}=x.y",
            f"{name}=é.é.é",
        ):
            assert team.log_in("guessed", Cookie=cookie).status == 429
        assert team.log_in("guessed", Cookie=known).status == 200
        told = [team.log_in("guessed", "wrong wrong wrong", Cookie=known).status for _ in range(10)]
        assert told[-1] == 429, "a known browser has an end of its tries, too"
        team.forget_attempts()
        devices = team.app.state.team.devices
        assert devices.recognise("guessed", token)
        late = DeviceTokens(team.store, lambda: datetime.now(UTC) + LASTS + timedelta(seconds=1))
        assert late.recognise("guessed", token) is None
        _, link = renew_link(team.store, find_person(team.store, "guessed").id, actor="local")
        links.set_password_by_link(team.store, link.token, "three other words")
        assert devices.recognise("guessed", token) is None, "it ends with its password"

    def test_a_browser_stays_a_known_one_when_its_person_changes_the_password(
        self, team: Team
    ) -> None:
        cookie = team.add("changes", Role.VIEWER)
        change = {"old": SECRET, "new": "three other words"}
        told = team.ask("PUT", f"{API}/session/password", change, Cookie=cookie)
        token = cookie_in(told, DEVICE).partition("=")[2]
        assert team.app.state.team.devices.recognise("changes", token)

    def test_a_link_sets_a_password_once_and_logs_in(self, team: Team) -> None:
        made = team.ask("POST", f"{API}/users", {"name": "new", "role": "viewer"}, role="admin")
        assert made.status == 201, made.body
        base, _, token = json.loads(made.body)["link"].partition("#")
        assert base == f"{team.address}/join"
        meant = team.ask("POST", f"{API}/links/look", {"token": token})
        assert json.loads(meant.body) == {"name": "new", "joined": False}
        use = {"token": token, "password": SECRET}
        cookie = cookie_in(team.ask("POST", f"{API}/links/use", use))
        assert team.ask("GET", f"{API}/datasets", Cookie=cookie).status == 200
        assert team.ask("POST", f"{API}/links/use", use).status == 404

    def test_no_secret_is_kept_for_a_request_that_is_repeated(self, team: Team) -> None:
        person = find_person(team.store, "viewer")
        target = f"{API}/users/{person.id}/link"
        answers = [team.ask("POST", target, role="admin", Idempotency_Key="k-1") for _ in "12"]
        one, two = (json.loads(answer.body)["link"] for answer in answers)
        assert one != two
        with pytest.raises(Exception, match="no longer valid"):
            links.find_link_holder(team.store, one.partition("#")[2])


class TestWhoActs:
    def test_a_change_must_say_that_it_comes_from_here(self, team: Team) -> None:
        target = f"{API}/session/password"
        body = {"old": SECRET, "new": SECRET}
        for origin in ("", "http://evil.example", "null"):
            answer = team.ask("PUT", target, body, role="viewer", Origin=origin)
            assert answer.status == 403, origin
        assert team.ask("GET", f"{API}/datasets", role="viewer", Origin="").status == 200

    def test_nobody_hides_behind_the_name_of_a_script(self, team: Team) -> None:
        ensure_dataset(team.store, "scripted", "local")
        target, body = f"{API}/datasets/scripted/saved-views", {"name": "a", "q": ""}
        answer = team.ask("POST", target, body, role="annotator", X_Actor="bot")
        assert answer.status == 400
        assert b"is not accepted on a server with logins" in answer.body

    def test_the_log_names_the_person(self, team: Team) -> None:
        team.ask("POST", f"{API}/users", {"name": "logged", "role": "viewer"}, role="admin")
        with team.store.read() as session:
            last = list(read_log(session))[-1]
        assert (last.actor, last.body["person"], last.body["did"]) == ("admin", "logged", "invited")

    def test_what_is_made_is_its_makers(self, team: Team) -> None:
        ensure_dataset(team.store, "made", "local")
        body = {"name": "mine", "q": ""}
        answer = team.ask("POST", f"{API}/datasets/made/saved-views", body, role="annotator")
        assert (answer.status, json.loads(answer.body)["by"]) == (201, "annotator")

    def test_a_key_belongs_to_its_person(self, team: Team) -> None:
        """Two people may choose the same; neither is given the other's answer."""
        target, key = f"{API}/uploads?name=a.zip", "the-same-key"
        team.add("lead2", Role.LEAD)
        told = [
            team.ask("POST", target, sent, role=role, kind=BYTES, Idempotency_Key=key)
            for role, sent in (("lead", b"one"), ("lead2", b"two"), ("lead", b"one"))
        ]
        assert [answer.status for answer in told] == [201, 201, 201]
        assert told[0].body == told[2].body != told[1].body
        assert "idempotency-replayed" not in told[1].headers

    def test_what_is_deleted_again_under_its_key_gets_the_first_answer(self, team: Team) -> None:
        """It is not there any more, and whose it was is not known; the request is the same."""
        sent = team.ask("POST", f"{API}/uploads?name=b.zip", b"three", role="lead", kind=BYTES)
        target = f"{API}/uploads/{json.loads(sent.body)['id']}"
        told = [team.ask("DELETE", target, role="lead", Idempotency_Key="k-3") for _ in "12"]
        assert [answer.status for answer in told] == [204, 204]
        assert told[1].headers["idempotency-replayed"] == "true"

    def test_who_lost_sight_of_a_dataset_is_not_told_their_first_answers_either(
        self, team: Team
    ) -> None:
        team.add("leaving", Role.ANNOTATOR)
        ensure_dataset(team.store, "left", "local")
        target, body = f"{API}/datasets/left/saved-views", {"name": "kept", "q": ""}

        def ask() -> Answer:
            return team.ask("POST", target, body, role="leaving", Idempotency_Key="k-4")

        first, again = ask(), ask()
        assert (first.status, again.body) == (201, first.body)
        person = find_person(team.store, "leaving").id
        give_role(team.store, "left", person, Role.NONE, actor="local")
        unknown = team.ask("POST", target.replace("left", "nothing"), body, role="leaving")
        assert ask().status == unknown.status == 404
        assert b"kept" not in ask().body


class TestStreams:
    @pytest.mark.parametrize("ends", ["disabled", "logged out", "nobody looks"])
    def test_an_open_stream_ends_with_its_session(
        self, team: Team, ends: str, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        name = f"hears-{ends.replace(' ', '-')}"
        looked = ends != "nobody looks"
        cookie = team.add(name, Role.VIEWER) if looked else team.cookies["viewer"]
        connection = http.client.HTTPConnection(team.address.partition("//")[2], timeout=SECONDS)
        connection.request("GET", f"{API}/events", headers={"Cookie": cookie})
        answer = connection.getresponse()
        assert answer.status == 200
        assert answer.readline().startswith(b":")
        if ends == "disabled":
            person = find_person(team.store, name)
            change_person(team.store, person.id, actor="local", disabled=True)
        elif ends == "logged out":
            team.ask("DELETE", f"{API}/session", role=name)
        else:
            monkeypatch.setattr(access.AccessControl, "is_still_allowed", None)
        # It says every now and then that it is still there.
        until = time.monotonic() + SECONDS
        while answer.read1(1000):
            assert time.monotonic() < until, "it goes on"
        connection.close()
        if looked:
            assert team.ask("GET", f"{API}/events", Cookie=cookie).status == 401

    def test_one_person_takes_the_places_of_nobody_else(
        self, team: Team, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.http.event_stream.MAX_FEEDS_OF_ONE", 2)
        cookie = team.add("listens-much", Role.VIEWER)
        with ExitStack() as opened:

            def listen(cookie: str) -> http.client.HTTPResponse:
                where = team.address.partition("//")[2]
                connection = http.client.HTTPConnection(where, timeout=SECONDS)
                opened.callback(connection.close)
                connection.request("GET", f"{API}/events", headers={"Cookie": cookie})
                return connection.getresponse()

            assert [listen(cookie).status for _ in range(2)] == [200, 200]
            refused = listen(cookie)
            assert (refused.status, refused.headers["retry-after"]) == (503, "5")
            assert b"of your browser windows" in refused.read()
            assert listen(team.cookies["viewer"]).status == 200

    def test_it_tells_of_what_is_seen_and_of_no_more_than_that(self, team: Team) -> None:
        """One dataset of two; and of none, some time after the role in it was taken away."""
        ids = [ensure_dataset(team.store, name, "local") for name in ("heard", "unheard")]
        cookie = team.add("listens", Role.NONE)
        person = find_person(team.store, "listens").id
        give_role(team.store, "heard", person, Role.VIEWER, actor="local")

        opened = ExitStack()

        def listening() -> http.client.HTTPResponse:
            where = team.address.partition("//")[2]
            connection = http.client.HTTPConnection(where, timeout=SECONDS)
            opened.callback(connection.close)
            connection.request("GET", f"{API}/events", headers={"Cookie": cookie})
            answer = connection.getresponse()
            assert answer.readline().startswith(b":")
            return answer

        def say(who: str) -> None:
            with team.store.write() as session:
                for key in ids[::-1]:
                    append_entries(session, [NewLogEntry("policy", who, now(), {}, dataset_id=key)])

        def heard(answer: http.client.HTTPResponse) -> bytes:
            line = b":"
            while line and not line.startswith(b"data:"):
                line = answer.readline()
            return line

        with opened:
            answer = listening()
            say("first")
            assert b'"heard"' in (line := heard(answer)) and b"first" in line
            give_role(team.store, "heard", person, None, actor="local")
            assert heard(answer) == b"", "it ends, to be asked for again with other rights"
            again = listening()
            say("second")
            give_role(team.store, "heard", person, Role.VIEWER, actor="local")
            assert heard(again) == b""
            third = listening()
            say("third")
            assert b"third" in (line := heard(third)) and b'"heard"' in line

    def test_it_goes_on_while_the_session_does(self, team: Team) -> None:
        connection = http.client.HTTPConnection(team.address.partition("//")[2], timeout=SECONDS)
        headers = {"Cookie": team.cookies["viewer"]}
        connection.request("GET", f"{API}/events", headers=headers)
        answer = connection.getresponse()
        assert connection.sock is not None
        connection.sock.settimeout(1)
        with pytest.raises(TimeoutError):
            answer.read()
        connection.close()


def test_a_reset_link_ends_sessions_when_it_is_used(team: Team) -> None:
    cookie = team.add("resets", Role.VIEWER)
    _, link = renew_link(team.store, find_person(team.store, "resets").id, actor="admin")
    assert team.ask("GET", f"{API}/datasets", Cookie=cookie).status == 200
    team.ask("POST", f"{API}/links/use", {"token": link.token, "password": SECRET})
    assert team.ask("GET", f"{API}/datasets", Cookie=cookie).status == 401
