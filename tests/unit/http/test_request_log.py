"""The request log: who asked for what, and what became of it."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest
import structlog
from fastapi import FastAPI
from starlette.responses import Response
from starlette.testclient import TestClient

from app.http.request_log import MOST_REFUSALS, RefusalLogLimiter, RequestLog


@pytest.fixture
def logged(plain_app: FastAPI, client_of) -> TestClient:
    """An application that says something of its own while it changes a thing."""

    @plain_app.put("/thing")
    def change() -> Response:
        structlog.get_logger("thing").info("saved")
        return Response(headers={"ETag": '"after"'})

    @plain_app.get("/thing")
    def read() -> str:
        return "thing"

    @plain_app.get("/broken")
    def fail() -> Response:
        return Response(status_code=503)

    plain_app.add_middleware(RequestLog)
    return client_of(plain_app)


@pytest.fixture
def lines():
    """What is logged, with the values that belong to the request."""
    with structlog.testing.capture_logs([structlog.contextvars.merge_contextvars]) as found:
        yield found


def test_a_change_is_one_line_from_the_click_to_the_new_state(logged, lines, monkeypatch) -> None:
    clock = SimpleNamespace(perf_counter=iter([3.0, 3.2504]).__next__)
    monkeypatch.setattr("app.http.request_log.time", clock)
    answer = logged.put("/thing", headers={"Idempotency-Key": "click-1"})
    saved, told = lines
    assert (saved["event"], saved["request"]) == ("saved", answer.headers["x-request-id"])
    assert told["milliseconds"] == 250.4
    asked = ("request", "method", "path", "person", "address", "status", "key", "etag")
    assert {name: told[name] for name in asked} == {
        "request": answer.headers["x-request-id"],
        "method": "PUT",
        "path": "/thing",
        "person": "local",
        "address": "testclient",
        "status": 200,
        "key": "click-1",
        "etag": '"after"',
    }


def test_what_only_reads_is_logged_where_the_server_failed(logged, lines) -> None:
    assert logged.get("/thing").status_code == 200
    assert lines == []
    logged.get("/broken")
    assert [(line["path"], line["status"]) for line in lines] == [("/broken", 503)]


def test_every_request_has_a_name_of_its_own(logged) -> None:
    names = {logged.get("/thing").headers["x-request-id"] for _ in range(3)}
    assert len(names) == 3


class TestRefusalBound:
    def test_of_many_in_a_second_some_are_told_and_the_rest_is_counted(self, lines) -> None:
        clock, later = [5.0], []
        bound = RefusalLogLimiter(lambda: clock[0], later.append)
        assert [bound.should_log() for _ in range(MOST_REFUSALS + 3)].count(True) == MOST_REFUSALS
        assert (lines, len(later)) == ([], 1)
        clock[0] += 1.0
        assert bound.should_log()
        later.pop()()
        assert [(line["event"], line["count"]) for line in lines] == [
            ("more requests were refused", 3)
        ]

    def test_the_rest_is_counted_also_where_nothing_more_is_refused(self, lines) -> None:
        async def refuse_many() -> None:
            bound = RefusalLogLimiter()
            with structlog.contextvars.bound_contextvars(request="one of them"):
                for _ in range(MOST_REFUSALS + 2):
                    bound.should_log()
            await asyncio.sleep(1.1)

        asyncio.run(refuse_many())
        assert [(line["count"], "request" in line) for line in lines] == [(2, False)]

    def test_seldom_ones_are_all_told(self, lines) -> None:
        clock = [5.0]
        bound = RefusalLogLimiter(lambda: clock[0], pytest.fail)
        for _ in range(3 * MOST_REFUSALS):
            clock[0] += 0.1
            assert bound.should_log()
        assert lines == []

    def test_what_changed_something_is_always_told(self, logged, lines) -> None:
        for _ in range(MOST_REFUSALS + 5):
            logged.put("/nothing")
            logged.put("/thing")
        statuses = [line["status"] for line in lines if line["event"] == "request answered"]
        assert statuses.count(404) == MOST_REFUSALS
        assert statuses.count(200) == MOST_REFUSALS + 5
