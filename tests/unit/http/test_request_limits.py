"""Lanes: who gets a turn, who waits, and who is told to come back."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from time import monotonic
from typing import Any

import anyio
import pytest
from starlette.responses import Response
from starlette.testclient import TestClient
from starlette.types import Scope

from app.admission import release_admission
from app.http import request_limits as lanes
from app.http.access import LOGIN
from app.http.request_limits import (
    AWAY,
    CHANGES,
    EDITS,
    IMAGES,
    LANES,
    LARGE,
    LOOKS,
    PAGES,
    PREVIEWS,
    QUESTIONS,
    READS,
    STREAMS,
    UPLOADS,
    ZIPS,
    Door,
    Doors,
    Lane,
    lane_of,
    turn,
)
from app.main import PREFIX

DRAG = f"{PREFIX}/groups/1/preview"
EDIT = f"{PREFIX}/views/1/ball"


class TestLaneOf:
    @pytest.mark.parametrize(
        ("method", "path", "lane"),
        [
            ("GET", "/groups/1", LOOKS),
            ("HEAD", "/groups/1", LOOKS),
            ("GET", "/views/1/predictions", LOOKS),
            ("GET", "/stations/1", LOOKS),
            ("GET", "/work", LOOKS),
            ("GET", "/groups", READS),
            ("GET", "/groups/ids", READS),
            ("GET", "/datasets/a/team-work", READS),
            ("PATCH", "/views/1/ball", EDITS),
            ("PATCH", "/views/1", EDITS),
            ("PUT", "/groups/1/verdict", EDITS),
            ("POST", "/groups/1/undo", EDITS),
            ("POST", "/batches/1/next", EDITS),
            ("PUT", "/batches/1/groups/2/lease", EDITS),
            ("POST", "/groups/1/adoption", CHANGES),
            ("PATCH", "/stations/1/lines", CHANGES),
            ("DELETE", "/uploads/a", CHANGES),
            ("POST", "/datasets/a/verdicts", CHANGES),
            ("POST", "/datasets/a/edits", LARGE),
            ("POST", "/groups/1/preview", PREVIEWS),
            ("GET", "/views/1/influence", QUESTIONS),
            ("POST", "/datasets/a/yield", QUESTIONS),
            ("GET", "/datasets/a/noise", QUESTIONS),
            ("GET", "/views/1/image", IMAGES),
            ("GET", "/evaluations/1/figures/precision.svg", IMAGES),
            ("GET", "/views/1/neighbours", IMAGES),
            ("GET", "/groups/1/neighbours", LOOKS),
            ("GET", "/exports/1/content", ZIPS),
            ("POST", "/views/1/paint", IMAGES),
            ("POST", "/views/1/propose", IMAGES),
            ("POST", "/uploads", UPLOADS),
            ("GET", "/uploads", READS),
            ("GET", "/events", STREAMS),
        ],
    )
    def test_is_told_by_method_and_path(self, method: str, path: str, lane: Any) -> None:
        assert lane_of(method, PREFIX + path) == lane

    @pytest.mark.parametrize(
        "path", ["/healthz", "/readyz", "/metrics", "/static/main.js", "/assets/1/all.css"]
    )
    def test_health_and_files_of_the_page_wait_for_nobody(self, path: str) -> None:
        assert lane_of("GET", path) is None

    @pytest.mark.parametrize("path", ["/", "/review/3", "/nowhere", "/healthz/x"])
    def test_pages_wait_for_each_other_alone(self, path: str) -> None:
        assert lane_of("GET", path) == PAGES

    @pytest.mark.parametrize(
        ("method", "path", "usual", "large"),
        [
            ("PATCH", "/views/1/lines", EDITS, LARGE),
            ("POST", "/groups/1/preview", PREVIEWS, LARGE),
            ("PATCH", "/stations/1/lines", CHANGES, CHANGES),
        ],
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
        self, method: str, path: str, usual: Lane, large: Lane, headers: Any, is_large: bool
    ) -> None:
        scope = {
            "type": "http",
            "method": method,
            "path": PREFIX + path,
            "headers": [*headers.items()],
        }
        door = Doors().of(scope)
        assert door is not None
        assert door.lane == (large if is_large else usual)

    def test_every_route_that_changes_something_has_one(self, api: TestClient) -> None:
        document = api.get(f"{PREFIX}/openapi.json").json()["paths"]
        routes = [(method.upper(), path) for path, item in document.items() for method in item]
        assert [
            (method, path)
            for method, path in routes
            if method != "GET" and lane_of(method, path) in (None, LOOKS, READS, STREAMS, ZIPS)
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
        self.work, self.doors = Work(), Doors()
        self.app: Callable[[Scope], Awaitable[Response]] = self.work
        self.statuses: list[int] = []
        self.bodies: list[bytes] = []
        self.tasks: list[asyncio.Task[None]] = []

    def ask(
        self, method: str, path: str, prefix: str = PREFIX, accept: str = "*/*", who: str = ""
    ) -> None:
        headers = [(b"accept", accept.encode())]
        scope = {"type": "http", "method": method, "path": prefix + path, "headers": headers}
        if who:
            scope[LOGIN] = Named(who)

        async def run() -> None:
            async with turn(self.doors.of(scope), scope) as refusal:
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
                service.ask("PATCH", "/stations/1")
            service.ask("GET", "/groups/1")
            await service.settle()
            assert len(service.work.begun) == CHANGES.width + 1
            assert service.work.begun[-1].endswith("/groups/1")
            door = service.doors.of({"type": "http", "method": "PUT", "path": PREFIX + "/x"})
            assert door is not None and (door.busy, door.waiting) == (CHANGES.width, 5)
            await service.end()
            assert service.statuses == [200] * (CHANGES.width + 6)
            assert (door.busy, door.waiting, door.refused) == (0, 0, 0)

        run(test)

    def test_who_sends_many_requests_waits_behind_himself(self) -> None:
        async def test(service: Service) -> None:
            for path, who in (("/views/1", "ann"),) * 3 + (("/views/2", "bob"),):
                service.ask("PATCH", path, who=who)
            await service.settle()
            await service.end()
            assert [path[-1] for path in service.work.begun] == ["1", "1", "2", "1"]

        run(test)

    def test_who_waits_for_a_disk_lets_the_next_one_in_but_not_everybody(self) -> None:
        async def test(service: Service) -> None:
            service.work.away = True
            for _ in range(EDITS.width + AWAY + 1):
                service.ask("PATCH", "/views/1/ball")
            while len(service.work.begun) < EDITS.width + AWAY:
                await asyncio.sleep(0.01)
            # Time enough for one more, if it were let in.
            await asyncio.sleep(0.1)
            door = service.doors.of(
                {"type": "http", "method": "PATCH", "path": EDIT, "headers": []}
            )
            assert door is not None
            # One more is at work, has asked to leave, and had to stay.
            assert len(service.work.begun) == EDITS.width + AWAY
            assert (door.busy, door.away, door.waiting) == (EDITS.width, AWAY, 1)
            await service.end()
            assert service.statuses == [200] * (EDITS.width + AWAY + 1)
            assert (door.busy, door.away, door.waiting) == (0, 0, 0)

        run(test)

    @pytest.mark.parametrize(
        ("method", "path", "elsewhere", "people", "together"),
        [
            ("PATCH", EDIT, {"served": True}, ("ann", "ann", "ann", "ann"), EDITS.served),
            # One person drags one thing at a time.
            ("POST", DRAG, {"apart": True}, ("ann", "ann", "bob", "eve"), PREVIEWS.apart),
        ],
    )
    def test_more_are_let_in_where_what_takes_long_is_not_done_here(
        self, method: str, path: str, elsewhere: Any, people: tuple[str, ...], together: int
    ) -> None:
        scope = {"type": "http", "method": method, "path": path, "headers": []}

        async def let_in(door: Door | None) -> int:
            assert door is not None
            return sum([await is_let_in(door, who) for who in people])

        async def is_let_in(door: Door, who: str) -> bool:
            with anyio.move_on_after(0.01):
                return await door.enter(who)
            return False

        doors = Doors(), Doors(**elsewhere)
        assert [asyncio.run(let_in(one.of(scope))) for one in doors] == [1, together]

    def test_zips_that_are_not_written_yet_leave_reads_alone(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(READS.width + ZIPS.width):
                service.ask("GET", "/exports/1/content")
            service.ask("GET", "/groups/1")
            await service.settle()
            assert service.work.begun[-1].endswith("/groups/1")
            await service.end()

        run(test)

    def test_one_more_than_may_wait_is_told_to_come_back(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(CHANGES.width + CHANGES.queue + 1):
                service.ask("POST", "/datasets")
            await service.settle()
            assert service.statuses == [503]
            await service.end()

        run(test)

    def test_who_uploads_one_too_many_is_told_so_slowly_and_keeps_nobody_waiting(self) -> None:
        async def test(service: Service) -> None:
            began = monotonic()
            for _ in range(UPLOADS.width + UPLOADS.queue + 3):
                service.ask("POST", "/uploads")
            await service.settle()
            assert service.statuses == []
            service.ask("GET", "/groups/1")
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
                service.ask("POST", "/groups/1/preview")
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
                service.ask("GET", "/groups", prefix="", accept=accept)
            while not service.bodies:
                await asyncio.sleep(0.01)
            assert service.statuses == [503]
            assert service.bodies[0].startswith(begins)
            await service.end()

        run(test)

    def test_a_turn_ends_when_the_answer_begins(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(IMAGES.width):
                service.ask("GET", "/views/1/image")
            await service.settle()
            service.work.may_answer.set()
            await service.settle()
            service.ask("GET", "/views/2/image")
            await service.settle()
            assert service.work.begun[-1].endswith("/views/2/image")
            await service.end()

        run(test)

    def test_streams_begin_a_few_at_a_time_and_hold_up_nobody_while_they_last(self) -> None:
        async def test(service: Service) -> None:
            for _ in range(3 * STREAMS.width):
                service.ask("GET", "/events")
            await service.settle()
            assert len(service.work.begun) == STREAMS.width
            service.work.may_answer.set()
            await service.settle()
            assert service.statuses == [200] * (3 * STREAMS.width)
            assert [door.busy for door in service.doors.all] == [0] * len(LANES)
            await service.end()

        run(test)

    def test_an_application_that_breaks_gives_its_turn_back(self) -> None:
        async def broken(_: Scope) -> Response:
            raise KeyError

        async def test(service: Service) -> None:
            service.app = broken
            service.ask("GET", "/groups/1")
            with pytest.raises(KeyError):
                await service.end()
            assert [door.busy for door in service.doors.all] == [0] * len(LANES)

        run(test)
