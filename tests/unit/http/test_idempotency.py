"""Idempotency-Key: the first response again, whatever became of the state since."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import httpx
import pytest
import uvicorn
from fastapi import Request
from sqlalchemy import update
from starlette.responses import Response
from structlog.testing import capture_logs

from app.db import idempotency
from app.db.idempotency import StoredResponseModel, delete_oldest_response_bodies
from app.errors import StorageError
from app.features.verdicts import routes as verdicts
from app.features.verdicts.service import set_verdict
from app.http.idempotency import IdempotencyHandler, RequestDigest
from app.http.request_limits import WRITE
from app.http.server import Server, open_listening_socket
from tests.openapi import openapi_of
from tests.waiting import SECONDS

API = "/api/v1"
VERDICT = f"{API}/groups/1/verdict"
KEY = {"Idempotency-Key": "one"}
SECRETS = {"session", "sessions", "links", "tokens", "users", "webhooks"}


def accept(api: Any, key: dict[str, str] = KEY, state: str = "deferred", **options: Any) -> Any:
    etag = options.get("etag") or api.get(f"{API}/groups/1").headers["etag"]
    return api.put(VERDICT, json={"state": state}, headers={"If-Match": etag, **key})


class TestRepetition:
    def test_gets_the_first_answer_after_others_have_changed_the_state(self, api) -> None:
        etag = api.get(f"{API}/groups/1").headers["etag"]
        first = accept(api, etag=etag)
        accept(api, {}, "unreviewed")
        again = accept(api, etag=etag)
        assert again.content == first.content
        assert (again.status_code, again.json()["verdict"]["state"]) == (200, "deferred")
        for name in ("etag", "content-type", "cache-control"):
            assert again.headers[name] == first.headers[name]
        assert again.headers["idempotency-replayed"] == "true"
        assert "idempotency-replayed" not in first.headers
        assert api.get(f"{API}/groups/1").json()["verdict"]["state"] == "unreviewed"

    def test_counts_once_when_the_first_answer_is_no_longer_kept(self, app, api) -> None:
        etag = api.get(f"{API}/groups/1").headers["etag"]
        accept(api, etag=etag)
        with app.state.services.store.write() as session:
            assert delete_oldest_response_bodies(session, 0) == 1
        again = accept(api, etag=etag)
        assert (again.status_code, again.headers["idempotency-replayed"]) == (409, "true")
        assert "Do not send it again" in again.json()["hint"]

    def test_of_another_state_is_another_request(self, api) -> None:
        assert accept(api).status_code == 200
        again = accept(api)
        assert again.status_code == 422
        assert again.json()["detail"] == "this Idempotency-Key was used for another request"

    def test_is_known_by_what_it_says_and_not_by_how_it_is_written(self, api) -> None:
        body = '{"state": "rejected", "reason": "sides_confused"}'
        other = '{"reason":"sides_confused",\n"state":"rejected"}'
        etag = api.get(f"{API}/groups/1").headers["etag"]
        headers = {"If-Match": etag, "Content-Type": "application/json", **KEY}
        first = api.put(VERDICT, content=body, headers=headers)
        assert first.status_code == 200
        assert api.put(VERDICT, content=other, headers=headers).content == first.content

    @pytest.mark.parametrize(
        ("method", "path", "body"),
        [
            ("PUT", VERDICT, {"state": "unreviewed"}),
            ("PUT", f"{API}/groups/2/verdict", {"state": "deferred"}),
            ("PUT", f"{VERDICT}?x=1", {"state": "deferred"}),
            ("POST", f"{API}/groups/1/undo", None),
        ],
    )
    def test_of_another_request_under_the_same_key_is_422(self, api, method, path, body) -> None:
        assert accept(api).status_code == 200
        etag = api.get(f"{API}/groups/1").headers["etag"]
        answer = api.request(method, path, json=body, headers={"If-Match": etag, **KEY})
        assert answer.status_code == 422
        assert "Idempotency-Key" in answer.json()["detail"]
        assert api.get(f"{API}/groups/1").json()["verdict"]["state"] == "deferred"

    def test_a_refused_request_can_be_sent_again_under_its_key(self, api) -> None:
        assert accept(api, etag='"stale-0"').status_code == 412
        assert accept(api).status_code == 200

    def test_starts_no_second_job(self, app, api) -> None:
        order = {"dataset": "broadcast", "format": "cameras", "all": True}
        first = api.post(f"{API}/exports", json=order, headers=KEY)
        app.state.services.jobs.wait(first.json()["id"], 20)
        again = api.post(f"{API}/exports", json=order, headers=KEY)
        assert (again.status_code, again.content) == (202, first.content)
        assert again.headers["location"] == first.headers["location"]
        assert len(app.state.services.jobs.find()) == 1

    def test_undoes_a_static_camera_once(self, api) -> None:
        group = api.get(f"{API}/groups/4").json()
        station = group["views"][0]["station"]
        path = f"{API}/stations/{station['id']}"
        for count in (3, 4):
            points = [{"x": 10.0 * n, "y": 50.0 + n} for n in range(count)]
            etag = api.get(path).headers["etag"]
            body = {"lines": {"Side line top": points}}
            api.patch(f"{path}/lines", json=body, headers={"If-Match": etag})
        headers = {"If-Match": api.get(path).headers["etag"], **KEY}
        first = api.post(f"{path}/undo", headers=headers)
        again = api.post(f"{path}/undo", headers=headers)
        assert (first.status_code, again.content) == (200, first.content)
        assert len(api.get(path).json()["lines"]["Side line top"]) == 3

    def test_after_a_day_is_a_request_of_its_own_that_builds_on_a_state_that_is_gone(
        self, app, api
    ) -> None:
        etag = api.get(f"{API}/groups/1").headers["etag"]
        accept(api, etag=etag)
        with app.state.services.store.write() as session:
            session.execute(update(StoredResponseModel).values(at="2020-01-01"))
        again = accept(api, etag=etag)
        assert (again.status_code, "idempotency-replayed" in again.headers) == (412, False)
        assert len(api.get(f"{API}/groups/1/history").json()["items"]) == 2


class TestKey:
    @pytest.mark.parametrize("key", [" ", "a b", "a" * 201, "\xe4"])
    def test_must_be_short_and_visible(self, api, key: str) -> None:
        answer = accept(api, {"Idempotency-Key": key.encode("latin-1")})
        assert answer.status_code == 400
        assert answer.json()["detail"].startswith("Idempotency-Key must be")

    def test_every_route_that_changes_something_takes_a_key(self, app) -> None:
        for path, operations in openapi_of(app)["paths"].items():
            for method, operation in operations.items():
                names = [item["name"] for item in operation["parameters"]]
                # What shows a secret once, or ends one, keeps no answer.
                secret = SECRETS & set(path.split("/")) and "/recordings/" not in path
                kept = method != "get" and not secret
                assert names.count("Idempotency-Key") == kept, (method, path)


class TestFailure:
    def test_an_answer_that_cannot_be_kept_after_the_work_is_given_all_the_same(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(*_: object) -> None:
            raise StorageError("the disk is full")

        monkeypatch.setattr(idempotency, "insert_response", full)
        with capture_logs() as logs:
            headers = {"Content-Type": "application/octet-stream", **KEY}
            sent = api.post(f"{API}/uploads?name=a.json", content=b"{}", headers=headers)
            assert sent.status_code == 201
        assert [entry["event"] for entry in logs] == [
            "a response could not be stored",
            "request answered",
        ]

    def test_work_whose_answer_cannot_be_kept_is_not_done(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def full(*_: object) -> None:
            raise StorageError("the disk is full")

        with monkeypatch.context() as patch:
            patch.setattr(idempotency, "insert_response", full)
            assert accept(api).status_code == 503
        assert api.get(f"{API}/groups/1").json()["verdict"]["state"] == "unreviewed"
        assert accept(api).json()["verdict"]["state"] == "deferred"

    def test_of_two_servers_that_answer_the_same_request_one_does_it(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(idempotency, "insert_response", lambda *_: False)
        assert accept(api).status_code == 409
        assert api.get(f"{API}/groups/1").json()["verdict"]["state"] == "unreviewed"

    def test_a_database_that_does_not_answer_is_503_and_nothing_is_done(
        self, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def busy(*_: object) -> None:
            raise StorageError("the database is busy")

        with monkeypatch.context() as patch:
            patch.setattr(idempotency, "find_response", busy)
            answer = accept(api)
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
        assert api.get(f"{API}/groups/1").json()["verdict"]["state"] == "unreviewed"


class TestTwins:
    @pytest.fixture
    def address(self, app) -> Iterator[str]:
        with open_listening_socket("127.0.0.1", 0) as (socket, address):
            server = Server(uvicorn.Config(app, log_level="critical", lifespan="off"), app)
            thread = threading.Thread(target=server.run, kwargs={"sockets": [socket]})
            thread.start()
            yield address
            server.should_exit = True
            thread.join(20)

    def test_sent_at_the_same_time_one_is_carried_out_and_both_are_answered(
        self, app, api, address: str
    ) -> None:
        etag = api.get(f"{API}/groups/1").headers["etag"]

        def send(_: int) -> httpx.Response:
            headers = {"If-Match": etag, **KEY}
            return httpx.put(
                f"{address}{VERDICT}", json={"state": "deferred"}, headers=headers, timeout=120
            )

        with ThreadPoolExecutor(6) as pool:
            answers = list(pool.map(send, range(6)))
        assert {answer.status_code for answer in answers} == {200}
        assert len({answer.content for answer in answers}) == 1
        assert sum("idempotency-replayed" in answer.headers for answer in answers) == 5
        assert len(api.get(f"{API}/groups/1/history").json()["items"]) == 2


class TestRepetitionsThatWait:
    def test_leave_room_for_other_changes(self, app, api, monkeypatch: pytest.MonkeyPatch) -> None:
        etag = api.get(f"{API}/groups/1").headers["etag"]
        other = api.get(f"{API}/groups/2").headers["etag"]
        finish = threading.Event()

        def slow(store: Any, group: int, *said: Any, **options: Any) -> Any:
            if group == 1:
                assert finish.wait(SECONDS)
            return set_verdict(store, group, *said, **options)

        monkeypatch.setattr(verdicts, "set_verdict", slow)

        async def ask() -> tuple[int, list[int]]:
            transport = httpx.ASGITransport(app)
            async with httpx.AsyncClient(transport=transport, base_url=str(api.base_url)) as client:

                def put(group: int, headers: dict[str, str]) -> asyncio.Task[httpx.Response]:
                    path, body = f"{API}/groups/{group}/verdict", {"state": "deferred"}
                    return asyncio.create_task(client.put(path, json=body, headers=headers))

                same = [put(1, {"If-Match": etag, **KEY}) for _ in range(WRITE.width + 3)]
                await asyncio.sleep(0.1)
                try:
                    change = await put(2, {"If-Match": other})
                    assert not any(task.done() for task in same)
                finally:
                    finish.set()
                return change.status_code, [(await task).status_code for task in same]

        assert asyncio.run(ask()) == (200, [200] * (WRITE.width + 3))


class TestStreamed:
    def test_an_upload_is_known_by_its_bytes_which_are_not_held(self, app) -> None:
        parts: list[int] = []
        idempotency = IdempotencyHandler()

        async def call(chunks: list[bytes]) -> Response:
            waiting = list(chunks)

            async def receive() -> dict[str, Any]:
                body = waiting.pop(0)
                return {"type": "http.request", "body": body, "more_body": bool(waiting)}

            headers = [(b"idempotency-key", b"u"), (b"content-type", b"application/octet-stream")]
            scope = {"type": "http", "app": app, "method": "POST", "path": "/u"}
            request = Request({**scope, "query_string": b"", "headers": headers}, receive)
            digest = RequestDigest(request, is_streamed=True)

            async def upload() -> Response:
                more = True
                while more:
                    message = await digest.receive()
                    parts.append(len(message["body"]))
                    more = message["more_body"]
                return Response(str(len(parts)), 201)

            async def nothing_is_hidden() -> bool:
                return False

            return await idempotency.answer_once(
                request, digest, "local", nothing_is_hidden, upload
            )

        async def all_told() -> list[Response]:
            return [await call(chunks) for chunks in ([b"ab", b"c"], [b"a", b"bc"], [b"abd"])]

        first, again, other = asyncio.run(all_told())
        assert parts == [2, 1]
        assert [found.status_code for found in (first, again, other)] == [201, 201, 422]
        assert again.body == first.body == b"2"
