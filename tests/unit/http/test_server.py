"""One socket, one address."""

from __future__ import annotations

import asyncio
import gc
import socket
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from app.errors import InputError
from app.http.server import (
    ACCEPTED_AT_ONCE,
    HEAD_BYTES,
    MAX_CONNECTIONS,
    SWITCH_SECONDS,
    Server,
    make_server,
    open_listening_socket,
    raise_connection_limit,
    warm_up_process,
)


class TestListen:
    def test_tells_the_address_that_a_browser_opens(self) -> None:
        with open_listening_socket("127.0.0.1", 0) as (server, address):
            assert address == f"http://127.0.0.1:{server.getsockname()[1]}"
            # asyncio looks at the protocol before it turns Nagle's algorithm off.
            assert server.proto == socket.IPPROTO_TCP

    def test_a_port_in_use_is_a_sentence(self) -> None:
        with open_listening_socket("127.0.0.1", 0) as (server, _):
            port = server.getsockname()[1]
            with (
                pytest.raises(InputError, match="is already in use"),
                open_listening_socket("127.0.0.1", port),
            ):
                pass

    def test_an_address_of_another_machine_is_a_sentence(self) -> None:
        with (
            pytest.raises(InputError, match="cannot be used"),
            open_listening_socket("192.0.2.1", 0),
        ):
            pass


class TestSettle:
    def test_what_is_there_for_good_is_not_collected_again_and_what_lives_seldom(self) -> None:
        before = gc.get_threshold()
        gc.unfreeze()
        try:
            warm_up_process()
            assert gc.get_freeze_count() > len(gc.get_objects())
            assert gc.get_threshold() == (700, 10, 100)
        finally:
            gc.set_threshold(*before)


@pytest.fixture
def server() -> Iterator[Server]:
    """A server over an application that nobody asks anything."""

    async def silent(scope, receive, send) -> None:
        while (await receive())["type"] != "lifespan.shutdown":
            await send({"type": "lifespan.startup.complete"})
        await send({"type": "lifespan.shutdown.complete"})

    silent.state = SimpleNamespace(services=Mock())  # type: ignore[attr-defined]
    interval = sys.getswitchinterval()
    yield make_server(silent)  # type: ignore[arg-type]
    sys.setswitchinterval(interval)


class TestConnections:
    def test_leave_descriptors_for_the_files_of_the_home(self) -> None:
        assert 8 <= raise_connection_limit() <= MAX_CONNECTIONS

    def test_a_head_and_connections_are_bounded(self, server: Server) -> None:
        assert server.config.h11_max_incomplete_event_size == HEAD_BYTES
        assert server.config.limit_concurrency == raise_connection_limit()
        assert not server.config.proxy_headers


class TestServer:
    def test_who_comes_with_many_at_once_is_let_in_a_few_at_a_time(self, server: Server) -> None:
        grown = asyncio.run(_growth(server, clients=60))
        assert sum(grown) == 60
        assert max(grown) <= ACCEPTED_AT_ONCE

    def test_threads_that_solve_let_others_go_first_soon(self, server: Server) -> None:
        asyncio.run(_growth(server, clients=1))
        assert sys.getswitchinterval() == pytest.approx(SWITCH_SECONDS)


async def _growth(server: Server, clients: int) -> list[int]:
    """How many connections are new at each turn of the loop, once all wait at the door."""
    with open_listening_socket("127.0.0.1", 0) as (listening, _):
        server.config.load()
        server.lifespan = server.config.lifespan_class(server.config)
        await server.startup([listening])
        # The loop stands still meanwhile: the system itself lets them wait.
        place = ("127.0.0.1", listening.getsockname()[1])
        came = [socket.create_connection(place, timeout=0.5) for _ in range(clients)]
        seen = [0]
        deadline = time.monotonic() + 10
        while seen[-1] < clients and time.monotonic() < deadline:
            await asyncio.sleep(0)
            seen.append(len(server.server_state.connections))
        for one in came:
            one.close()
        await server.shutdown([listening])
    return [after - before for before, after in pairwise(seen)]
