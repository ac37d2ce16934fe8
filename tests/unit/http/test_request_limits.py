"""Lanes: who gets a turn, who waits, and who is told to come back."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from time import monotonic
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.responses import Response
from starlette.types import Scope

from app.admission import release_admission
from app.http import request_limits as lanes
from app.http.access import LOGIN
from app.http.pages import ELSEWHERE
from app.http.request_limits import (
    AWAY,
    CHANGES,
    EDITS,
    IMAGES,
    LARGE,
    LOOKS,
    PAGES,
    PREVIEWS,
    QUESTIONS,
    READS,
    REQUEST_CLASSES,
    STREAMS,
    UPLOADS,
    ZIPS,
    ClassLimiter,
    ClassLimiters,
    RequestClass,
    wait_for_turn,
)
from app.http.route import list_routes
from app.main import PREFIX


class TestLaneOf:
    def test_stands_with_the_route(self, app: FastAPI) -> None:
        lanes_of = {name: route.lane for name, route in list_routes(app)}
        for lane, names in {
            LOOKS: (
                "GET /groups/{group}",
                "GET /views/{view}/predictions",
                "GET /stations/{station}",
                "GET /work",
                "GET /groups/{group}/neighbours",
            ),
            READS: (
                "GET /groups",
                "GET /groups/ids",
                "GET /datasets/{dataset}/team-work",
                "GET /uploads",
            ),
            EDITS: (
                "PATCH /views/{view}/ball",
                "PATCH /views/{view}",
                "PUT /groups/{group}/verdict",
                "POST /groups/{group}/undo",
                "POST /batches/{batch}/next",
                "PUT /batches/{batch}/groups/{group}/lease",
            ),
            CHANGES: (
                "POST /groups/{group}/adoption",
                "PATCH /stations/{station}/lines",
                "DELETE /uploads/{upload}",
                "POST /datasets/{dataset}/verdicts",
            ),
            LARGE: ("POST /datasets/{dataset}/edits",),
            PREVIEWS: ("POST /groups/{group}/preview",),
            QUESTIONS: (
                "GET /views/{view}/influence",
                "POST /datasets/{dataset}/yield",
                "GET /datasets/{dataset}/noise",
            ),
            IMAGES: (
                "GET /views/{view}/image",
                "GET /evaluations/{evaluation}/figures/{figure}.{ending}",
                "GET /views/{view}/neighbours",
                "POST /views/{view}/paint",
                "POST /views/{view}/propose",
            ),
            ZIPS: ("GET /exports/{export}/content",),
            UPLOADS: ("POST /uploads",),
            STREAMS: ("GET /events",),
        }.items():
            for name in names:
                method, path = name.split(" ")
                assert lanes_of[f"{method} {PREFIX}{path}"] is lane, name

    def test_health_waits_for_nobody_and_pages_for_each_other_alone(self, app: FastAPI) -> None:
        lanes_of = {name: route.lane for name, route in list_routes(app)}
        free = {name for name, lane in lanes_of.items() if lane is None}
        styles = "GET /assets/{version}/all.css"
        assert free == {"GET /healthz", "GET /readyz", "GET /metrics", styles}
        pages = {name for name in lanes_of if PREFIX not in name} - free
        assert pages == {name for name, lane in lanes_of.items() if lane is PAGES}
        assert {"GET /", f"GET {ELSEWHERE}"} < pages

    @pytest.mark.parametrize(
        ("usual", "large"), [(EDITS, LARGE), (PREVIEWS, LARGE), (CHANGES, CHANGES)]
    )
    @pytest.mark.parametrize(
        ("headers", "is_large"),
        [
            ({}, False),
            ({b"content-length": b"8192"}, False),
            ({b"content-length": b"8193"}, True),
            ({b"transfer-encoding": b"chunked"}, True),
        ],
    )
    def test_what_draws_hundreds_of_points_keeps_nobody_waiting_who_drags_one(
        self, usual: RequestClass, large: RequestClass, headers: Any, is_large: bool
    ) -> None:
        door = ClassLimiters().of(usual, {"headers": [*headers.items()]})
        assert door is not None
        assert door.lane == (large if is_large else usual)

    def test_every_route_that_changes_something_has_one(self, app: FastAPI) -> None:
        assert [
            name
            for name, route in list_routes(app)
            if not name.startswith("GET ") and route.lane in (None, LOOKS, READS, STREAMS, ZIPS)
        ] == []


class Work:
    """An application whose requests end when they are told to."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.may_answer, self.may_end = asyncio.Event(), asyncio.Event()
        self.away = False
        """Whether they say that they wait for something else."""

    async def __call__(self, scope: Scope) -> Response:
        self.begun.append(scope["path"])
        if self.away:
            await asyncio.to_thread(release_admission)
        await self.may_answer.wait()
        return Response()


@dataclass
class Named:
    """What lanes ask of whoever is logged in."""

    name: str


class Service:
    """Requests that take turns, without a socket."""

    def __init__(self) -> None:
        self.work, self.doors = Work(), ClassLimiters()
        self.app: Callable[[Scope], Awaitable[Response]] = self.work
        self.statuses: list[int] = []
        self.bodies: list[bytes] = []
        self.tasks: list[asyncio.Task[None]] = []

    def ask(self, lane: RequestClass, path: str = "/1", accept: str = "*/*", who: str = "") -> None:
        headers = [(b"accept", accept.encode())]
        scope = {"type": "http", "path": path, "headers": headers}
        if who:
            scope[LOGIN] = Named(who)

        async def run() -> None:
            async with wait_for_turn(self.doors.of(lane, scope), scope) as refusal:
                response = refusal or await self.app(scope)
            self.statuses.append(response.status_code)
            self.bodies.append(bytes(response.body))
            if refusal is None:
                await self.work.may_end.wait()

        self.tasks.append(asyncio.create_task(run()))

    async def settle(self) -> None:
        """Let every task go as far as it can."""
        for _ in range(20):
            await asyncio.sleep(0)

    async def end(self) -> None:
        self.work.may_answer.set()
        self.work.may_end.set()
        await asyncio.gather(*self.tasks)


def run(test: Callable[[Service], Awaitable[None]]) -> None:
    async def inside() -> None:
        await test(Service())

    asyncio.run(inside())


class TestLanes:
    def test_changes_that_wait_leave_reads_alone(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(CHANGES.width + 5):
                service.ask(CHANGES)
            service.ask(LOOKS, "/groups/1")
            await service.settle()
            assert len(service.work.begun) == CHANGES.width + 1
            assert service.work.begun[-1].endswith("/groups/1")
            door = service.doors.of(CHANGES, {"headers": []})
            assert door is not None and (door.busy, door.waiting) == (CHANGES.width, 5)
            await service.end()
            assert service.statuses == [200] * (CHANGES.width + 6)
            assert (door.busy, door.waiting, door.refused) == (0, 0, 0)

        run(test)

    def test_who_sends_many_requests_waits_behind_himself(self) -> None:
        async def test(service: Service) -> None:
            for path, who in (("/views/1", "ann"),) * 3 + (("/views/2", "bob"),):
                service.ask(EDITS, path, who=who)
            await service.settle()
            await service.end()
            assert [path[-1] for path in service.work.begun] == ["1", "1", "2", "1"]

        run(test)

    def test_who_waits_for_a_disk_lets_the_next_one_in_but_not_everybody(self) -> None:
        async def test(service: Service) -> None:
            service.work.away = True
            for _ in range(EDITS.width + AWAY + 1):
                service.ask(EDITS)
            while len(service.work.begun) < EDITS.width + AWAY:
                await asyncio.sleep(0.01)
            # Time enough for one more, if it were let in.
            await asyncio.sleep(0.1)
            door = service.doors.of(EDITS, {"headers": []})
            assert door is not None
            # One more is at work, has asked to leave, and had to stay.
            assert len(service.work.begun) == EDITS.width + AWAY
            assert (door.busy, door.away, door.waiting) == (EDITS.width, AWAY, 1)
            await service.end()
            assert service.statuses == [200] * (EDITS.width + AWAY + 1)
            assert (door.busy, door.away, door.waiting) == (0, 0, 0)

        run(test)

    @pytest.mark.parametrize(
        ("lane", "elsewhere", "people", "together"),
        [
            (EDITS, {"served": True}, ("ann", "ann", "ann", "ann"), EDITS.served),
            # One person drags one thing at a time.
            (PREVIEWS, {"apart": True}, ("ann", "ann", "bob", "eve"), PREVIEWS.apart),
        ],
    )
    def test_more_are_let_in_where_what_takes_long_is_not_done_here(
        self, lane: RequestClass, elsewhere: Any, people: tuple[str, ...], together: int
    ) -> None:
        async def let_in(door: ClassLimiter | None) -> int:
            assert door is not None
            return sum([await is_let_in(door, who) for who in people])

        async def is_let_in(door: ClassLimiter, who: str) -> bool:
            with anyio.move_on_after(0.01):
                return await door.enter(who)
            return False

        doors = ClassLimiters(), ClassLimiters(**elsewhere)
        assert [asyncio.run(let_in(one.of(lane, {"headers": []}))) for one in doors] == [
            1,
            together,
        ]

    def test_zips_that_are_not_written_yet_leave_reads_alone(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(READS.width + ZIPS.width):
                service.ask(ZIPS)
            service.ask(LOOKS, "/groups/1")
            await service.settle()
            assert service.work.begun[-1].endswith("/groups/1")
            await service.end()

        run(test)

    def test_one_more_than_may_wait_is_told_to_come_back(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(CHANGES.width + CHANGES.queue + 1):
                service.ask(CHANGES)
            await service.settle()
            assert service.statuses == [503]
            await service.end()

        run(test)

    def test_who_uploads_one_too_many_is_told_so_slowly_and_keeps_nobody_waiting(self) -> None:
        async def test(service: Service) -> None:
            began = monotonic()
            for _ in range(UPLOADS.width + UPLOADS.queue + 3):
                service.ask(UPLOADS)
            await service.settle()
            assert service.statuses == []
            service.ask(LOOKS, "/groups/1")
            await service.settle()
            assert len(service.work.begun) == UPLOADS.width + 1
            while len(service.statuses) < 3:
                await asyncio.sleep(0.05)
            assert service.statuses == [503, 503, 503]
            assert monotonic() - began >= UPLOADS.pause
            await service.end()

        run(test)

    def test_nobody_waits_for_ever(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(lanes, "PATIENCE", 0.01)

        async def test(service: Service) -> None:
            for _ in "12":
                service.ask(PREVIEWS)
            while not service.statuses:
                await asyncio.sleep(0.01)
            assert service.statuses == [503]
            await service.end()

        run(test)

    @pytest.mark.parametrize(
        ("accept", "begins"), [("text/html,*/*", b"<!doctype html>"), ("*/*", b'{"type"')]
    )
    def test_who_waits_for_a_page_is_told_by_one(
        self, monkeypatch: pytest.MonkeyPatch, accept: str, begins: bytes
    ) -> None:
        monkeypatch.setattr(lanes, "PATIENCE", 0.01)

        async def test(service: Service) -> None:
            for _ in range(PAGES.width + 1):
                service.ask(PAGES, accept=accept)
            while not service.bodies:
                await asyncio.sleep(0.01)
            assert service.statuses == [503]
            assert service.bodies[0].startswith(begins)
            await service.end()

        run(test)

    def test_a_turn_ends_when_the_answer_begins(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(IMAGES.width):
                service.ask(IMAGES)
            await service.settle()
            service.work.may_answer.set()
            await service.settle()
            service.ask(IMAGES, "/views/2/image")
            await service.settle()
            assert service.work.begun[-1].endswith("/views/2/image")
            await service.end()

        run(test)

    def test_streams_begin_a_few_at_a_time_and_hold_up_nobody_while_they_last(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(3 * STREAMS.width):
                service.ask(STREAMS)
            await service.settle()
            assert len(service.work.begun) == STREAMS.width
            service.work.may_answer.set()
            await service.settle()
            assert service.statuses == [200] * (3 * STREAMS.width)
            assert [door.busy for door in service.doors.all] == [0] * len(REQUEST_CLASSES)
            await service.end()

        run(test)

    def test_an_application_that_breaks_gives_its_turn_back(self) -> None:
        async def broken(_: Scope) -> Response:
            raise KeyError

        async def test(service: Service) -> None:
            service.app = broken
            service.ask(LOOKS, "/groups/1")
            with pytest.raises(KeyError):
                await service.end()
            assert [door.busy for door in service.doors.all] == [0] * len(REQUEST_CLASSES)

        run(test)
