"""Request limits: who is admitted, who waits, and who is told to come back."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import pytest
from fastapi import FastAPI
from starlette.responses import Response
from starlette.types import Scope

from app.http import request_limits
from app.http.access import LOGIN
from app.http.request_limits import (
    COMPUTE,
    MOST_WAITING,
    READ,
    TRANSFER,
    WRITE,
    RequestClass,
    RequestLimits,
)
from app.http.route import list_routes
from app.main import PREFIX

SMALL = {b"content-length": b"8192"}
LARGE = {b"content-length": b"8193"}


class TestClassOfARoute:
    def test_stands_with_the_route(self, app: FastAPI) -> None:
        classes = {name: route.request_class for name, route in list_routes(app)}
        for request_class, names in {
            READ: (
                "GET /groups/{group}",
                "GET /groups",
                "GET /work",
                "GET /uploads",
                "GET /events",
            ),
            WRITE: (
                "PATCH /views/{view}/ball",
                "PUT /groups/{group}/verdict",
                "POST /batches/{batch}/next",
                "DELETE /uploads/{upload}",
                "POST /datasets/{dataset}/verdicts",
            ),
            COMPUTE: (
                "POST /groups/{group}/preview",
                "POST /datasets/{dataset}/edits",
                "GET /views/{view}/influence",
                "POST /datasets/{dataset}/yield",
                "GET /datasets/{dataset}/noise",
            ),
            TRANSFER: (
                "GET /views/{view}/image",
                "GET /evaluations/{evaluation}/figures/{figure}.{ending}",
                "POST /views/{view}/propose",
                "GET /exports/{export}/content",
                "POST /uploads",
                "POST /session",
            ),
        }.items():
            for name in names:
                method, path = name.split(" ")
                assert classes[f"{method} {PREFIX}{path}"] is request_class, name

    def test_health_and_styles_wait_for_nobody(self, app: FastAPI) -> None:
        free = {name for name, route in list_routes(app) if route.request_class is None}
        styles = "GET /assets/{version}/all.css"
        assert free == {"GET /healthz", "GET /readyz", "GET /metrics", styles}

    def test_whatever_changes_something_has_one_that_is_not_for_reading(self, app: FastAPI) -> None:
        assert [
            name
            for name, route in list_routes(app)
            if not name.startswith("GET ") and route.request_class in (None, READ)
        ] == []


class Work:
    """An application whose requests end when they are told to."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.may_answer, self.may_end = asyncio.Event(), asyncio.Event()

    async def __call__(self, scope: Scope) -> Response:
        self.begun.append(scope["path"])
        await self.may_answer.wait()
        return Response()


@dataclass
class Named:
    """What limits ask of whoever is logged in."""

    name: str


class Service:
    """Requests that are limited, without a socket."""

    def __init__(self, *, team: bool) -> None:
        self.work, self.limits = Work(), RequestLimits(team=team)
        self.app: Callable[[Scope], Awaitable[Response]] = self.work
        self.statuses: list[int] = []
        self.bodies: list[bytes] = []
        self.tasks: list[asyncio.Task[None]] = []

    def ask(
        self,
        request_class: RequestClass,
        path: str = "/1",
        accept: str = "*/*",
        who: str = "",
        headers: dict[bytes, bytes] | None = None,
    ) -> asyncio.Task[None]:
        sent = {b"accept": accept.encode(), **(headers or {})}
        scope: dict[str, Any] = {"type": "http", "path": path, "headers": [*sent.items()]}
        if who:
            scope[LOGIN] = Named(who)

        async def run() -> None:
            async with self.limits.admit(request_class, scope) as refusal:
                response = refusal or await self.app(scope)
            self.statuses.append(response.status_code)
            self.bodies.append(bytes(response.body))
            if refusal is None:
                await self.work.may_end.wait()

        self.tasks.append(asyncio.create_task(run()))
        return self.tasks[-1]

    async def settle(self) -> None:
        """Let every task go as far as it can."""
        for _ in range(30):
            await asyncio.sleep(0)

    async def end(self) -> None:
        self.work.may_answer.set()
        self.work.may_end.set()
        await asyncio.gather(*self.tasks, return_exceptions=True)

    def counts(self, request_class: RequestClass) -> tuple[int, int, int]:
        """How many are at work, wait, and were refused."""
        (found,) = (one for one in self.limits.class_limiters if one.request_class is request_class)
        return found.busy, found.waiting, found.refused

    def is_quiet(self) -> bool:
        """Whether nobody is at work or waits."""
        return all(one.busy == one.waiting == 0 for one in self.limits.class_limiters)


def run(test: Callable[[Service], Awaitable[None]], *, team: bool = False) -> None:
    async def inside() -> None:
        service = Service(team=team)
        await test(service)
        await service.end()
        assert service.is_quiet()

    asyncio.run(inside())


class TestLimits:
    @pytest.mark.parametrize("busy", [WRITE, COMPUTE, TRANSFER])
    def test_a_class_whose_requests_wait_leaves_reads_alone(self, busy: RequestClass) -> None:
        async def test(service: Service) -> None:
            for _ in range(busy.width + 5):
                service.ask(busy)
            service.ask(READ, "/groups/1")
            await service.settle()
            assert len(service.work.begun) == busy.width + 1
            assert service.work.begun[-1] == "/groups/1"
            assert service.counts(busy) == (busy.width, 5, 0)
            await service.end()
            assert service.statuses == [200] * (busy.width + 6)

        run(test)

    @pytest.mark.parametrize("usual", [READ, WRITE])
    @pytest.mark.parametrize(
        ("headers", "is_large"),
        [({}, 0), (SMALL, 0), (LARGE, 1), ({b"transfer-encoding": b"chunked"}, 1)],
    )
    def test_what_draws_hundreds_of_points_keeps_nobody_waiting_who_drags_one(
        self, usual: RequestClass, headers: dict[bytes, bytes], is_large: int
    ) -> None:
        async def test(service: Service) -> None:
            service.ask(usual, headers=headers)
            await service.settle()
            assert service.counts(COMPUTE) == (is_large, 0, 0)
            assert service.counts(usual) == (1 - is_large, 0, 0)

        run(test)

    def test_one_more_than_may_wait_is_told_to_come_back_slowly(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(request_limits, "PAUSE", 0.1)

        async def test(service: Service) -> None:
            for _ in range(WRITE.width + MOST_WAITING + 1):
                service.ask(WRITE)
            await service.settle()
            assert service.statuses == []
            while not service.statuses:
                await asyncio.sleep(0.01)
            assert service.statuses == [503]
            assert service.counts(WRITE) == (WRITE.width, MOST_WAITING, 1)

        run(test)

    @pytest.mark.parametrize(
        ("accept", "begins"), [("text/html,*/*", b"<!doctype html>"), ("*/*", b'{"type"')]
    )
    def test_nobody_waits_for_ever_and_who_asked_for_a_page_is_told_by_one(
        self, monkeypatch: pytest.MonkeyPatch, accept: str, begins: bytes
    ) -> None:
        monkeypatch.setattr(request_limits, "PATIENCE", 0.01)

        async def test(service: Service) -> None:
            for _ in range(READ.width + 1):
                service.ask(READ, accept=accept)
            while not service.bodies:
                await asyncio.sleep(0.01)
            assert service.statuses == [503]
            assert service.bodies[0].startswith(begins)

        run(test)

    def test_it_ends_when_the_answer_begins(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(TRANSFER.width):
                service.ask(TRANSFER)
            await service.settle()
            service.work.may_answer.set()
            await service.settle()
            service.ask(TRANSFER, "/views/2/image")
            await service.settle()
            assert service.work.begun[-1] == "/views/2/image"
            assert service.is_quiet()

        run(test)

    def test_an_application_that_breaks_leaves_no_place_taken(self) -> None:
        async def broken(_: Scope) -> Response:
            raise KeyError

        async def test(service: Service) -> None:
            service.app = broken
            with pytest.raises(KeyError):
                await service.ask(READ)

        run(test)


class TestTeam:
    def test_who_sends_a_hundred_requests_waits_for_them_alone(self) -> None:
        async def test(service: Service) -> None:
            for who in ("ann",) * 100 + ("bob", "eve"):
                service.ask(READ, f"/{who}", who=who)
            await service.settle()
            assert service.work.begun == ["/ann", "/bob", "/eve"]

        run(test, team=True)

    def test_people_are_admitted_one_after_the_other(self) -> None:
        async def test(service: Service) -> None:
            step = asyncio.Semaphore(0)

            async def answer(scope: Scope) -> Response:
                service.work.begun.append(scope["path"])
                await step.acquire()
                return Response()

            service.app = answer
            for who in ("ann",) * 4 + ("bob", "bob", "eve", "dan", "kim"):
                service.ask(WRITE, f"/{who}", who=who)
            for _ in service.tasks:
                await service.settle()
                step.release()
            await service.settle()
            begun = service.work.begun
            assert begun[:5] == ["/ann", "/bob", "/eve", "/dan", "/kim"]
            assert Counter(begun) == {"/ann": 4, "/bob": 2, "/eve": 1, "/dan": 1, "/kim": 1}

        run(test, team=True)

    def test_strangers_together_are_one_person(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(TRANSFER.width):
                service.ask(TRANSFER, "/login")
            service.ask(TRANSFER, "/image", who="ann")
            await service.settle()
            assert service.work.begun == ["/login"] * TRANSFER.per_person_limit + ["/image"]

        run(test, team=True)

    def test_one_person_may_let_half_as_many_wait_as_all(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(request_limits, "PAUSE", 0.0)

        async def test(service: Service) -> None:
            for _ in range(READ.per_person_limit + MOST_WAITING):
                service.ask(READ, who="ann")
            await service.settle()
            assert service.statuses == [503] * (MOST_WAITING // 2)
            service.ask(READ, "/bob", who="bob")
            await service.settle()
            assert service.work.begun[-1] == "/bob"

        run(test, team=True)

    def test_who_is_refused_keeps_none_of_their_own_places(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(request_limits, "MOST_WAITING", 0)

        async def test(service: Service) -> None:
            for who in ("ann", "bob", "eve"):
                service.ask(WRITE, f"/{who}", who=who)
            await service.settle()
            # Eve is not told yet; once somebody is done, her next one is let in.
            assert service.work.begun == ["/ann", "/bob"] and service.statuses == []
            service.work.may_answer.set()
            await service.settle()
            service.ask(WRITE, "/eve/again", who="eve")
            await service.settle()
            assert service.work.begun[-1] == "/eve/again"
            service.tasks[2].cancel()

        run(test, team=True)

    def test_who_goes_while_waiting_leaves_no_place_taken(self) -> None:
        async def test(service: Service) -> None:
            for who in ("ann", "bob", "eve"):
                service.ask(READ, who=who)
            at_work = len(service.tasks)
            for who in ("ann", "dan"):
                service.ask(READ, who=who)
            await service.settle()
            for gone in service.tasks[at_work:]:
                gone.cancel()
            await service.settle()
            assert service.counts(READ) == (3, 0, 0)

        run(test, team=True)
