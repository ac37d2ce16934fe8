"""Connections: a real server, and clients that send slowly, wrongly or nothing."""

from __future__ import annotations

import asyncio
import json
import re
import socket
import threading
import time
from collections.abc import Iterator

import pytest
import uvicorn
from starlette.types import Receive, Scope, Send

from app.http import connections
from app.http.connections import HEAD_BYTES, Connection, connection_limit
from tests.waiting import SECONDS

HEAD = b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 1000000\r\n\r\n"
LIMIT = 3


class Echo:
    """Answers the number of bytes that it was sent; ``slow`` paths wait until they are let go."""

    def __init__(self) -> None:
        self.at_work = 0
        self.go_on = threading.Event()
        self.disconnected = threading.Event()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return
        size, more = 0, True
        while more:
            message = await receive()
            if message["type"] == "http.disconnect":
                self.disconnected.set()
                return
            size, more = size + len(message["body"]), message["more_body"]
        self.at_work += scope["path"] == "/slow"
        while scope["path"] == "/slow" and not self.go_on.is_set():
            await asyncio.sleep(0.02)
        body = str(size).encode()
        headers = [(b"content-length", str(len(body)).encode())]
        await send({"type": "http.response.start", "status": 200, "headers": headers})
        await send({"type": "http.response.body", "body": body})


@pytest.fixture
def echo() -> Echo:
    return Echo()


@pytest.fixture
def port(echo: Echo, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A server which takes few clients, and gives them time."""
    monkeypatch.setattr(connections, "HEAD_SECONDS", SECONDS)
    monkeypatch.setattr(connections, "BODY_SECONDS", SECONDS)
    monkeypatch.setattr(connections, "connection_limit", lambda: LIMIT)
    config = uvicorn.Config(echo, http=Connection, ws="none", lifespan="off", log_level="error")
    server = uvicorn.Server(config)
    listening = socket.create_server(("127.0.0.1", 0))
    thread = threading.Thread(target=server.run, args=([listening],))
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield listening.getsockname()[1]
    echo.go_on.set()
    server.should_exit = True
    thread.join(SECONDS)
    listening.close()


def connect(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=SECONDS)


def rest(client: socket.socket) -> bytes:
    """Everything until the server closes."""
    parts = []
    while True:
        try:
            part = client.recv(65536)
        except ConnectionResetError:
            part = b""
        if not part:
            return b"".join(parts)
        parts.append(part)


def ask(client: socket.socket) -> None:
    """A request and its whole answer."""
    client.sendall(b"GET / HTTP/1.1\r\nHost: a\r\n\r\n")
    answer = b""
    while not answer.endswith(b"\r\n\r\n0"):
        answer += client.recv(65536)
    assert answer.startswith(b"HTTP/1.1 200 ")


def head_of(size: int) -> bytes:
    """A request that is a head alone, so many bytes long."""
    start, end = b"GET / HTTP/1.1\r\nHost: a\r\nRange: ", b"\r\n\r\n"
    return start + b"0" * (size - len(start) - len(end)) + end


def send_in_pieces(client: socket.socket, request: bytes, size: int) -> None:
    """Send bytes so that the server meets them one piece after the other."""
    for start in range(0, len(request), size):
        client.sendall(request[start : start + size])
        time.sleep(0.02)


def assert_problem(answer: bytes, status: int) -> None:
    head, _, body = answer.partition(b"\r\n\r\n")
    lines = head.decode().lower().split("\r\n")
    assert lines[0].startswith(f"http/1.1 {status} ")
    assert "content-type: application/problem+json" in lines
    assert "x-content-type-options: nosniff" in lines
    assert "connection: close" in lines
    assert any(line.startswith("content-security-policy: default-src 'self'") for line in lines)
    assert any(re.fullmatch("x-request-id: [0-9a-f]{16}", line) for line in lines)
    assert ("retry-after: 5" in lines) == (status == 503)
    assert json.loads(body)["status"] == status


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Clients that are late are cut off soon."""
    monkeypatch.setattr(connections, "HEAD_SECONDS", 0.3)
    monkeypatch.setattr(connections, "BODY_SECONDS", 0.3)


class TestDeadlines:
    def test_a_connection_that_sends_nothing_is_closed(self, port: int, impatient: None) -> None:
        with connect(port) as client:
            assert_problem(rest(client), 408)

    def test_half_a_head_is_not_waited_for(self, port: int, impatient: None) -> None:
        with connect(port) as client:
            client.sendall(b"GET / HTTP/1.1\r\nHost: a\r\n")
            assert_problem(rest(client), 408)

    def test_half_of_a_second_head_is_not_waited_for_either(
        self, port: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with connect(port) as client:
            ask(client)
            monkeypatch.setattr(connections, "HEAD_SECONDS", 0.3)
            client.sendall(b"GET / HT")
            assert_problem(rest(client), 408)

    def test_a_body_that_stops_is_cut_off_and_its_reader_told(
        self, port: int, echo: Echo, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(connections, "BODY_SECONDS", 0.3)
        with connect(port) as client:
            client.sendall(HEAD + b"x" * 100)
            assert_problem(rest(client), 408)
        assert echo.disconnected.wait(SECONDS)

    def test_a_body_that_comes_steadily_is_read_to_its_end(
        self, port: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(connections, "BODY_SECONDS", 1.5)
        with connect(port) as client:
            client.sendall(HEAD)
            for _ in range(10):
                client.sendall(b"x" * 100_000)
                time.sleep(0.2)
            assert b"200" in client.recv(65536)

    def test_an_answer_may_take_longer_than_a_request(
        self, port: int, echo: Echo, impatient: None
    ) -> None:
        with connect(port) as client:
            client.sendall(b"GET /slow HTTP/1.1\r\nHost: a\r\n\r\n")
            time.sleep(1.0)
            echo.go_on.set()
            assert b"200" in client.recv(65536)


class TestLimit:
    def test_a_new_connection_takes_the_place_of_one_that_is_idle(self, port: int) -> None:
        idle = []
        for _ in range(LIMIT):
            client = connect(port)
            ask(client)
            idle.append(client)
        with connect(port) as late:
            ask(late)
        assert rest(idle[0]) == b""
        for client in idle:
            client.close()

    def test_where_all_are_at_work_one_more_is_told_to_come_back(
        self, port: int, echo: Echo
    ) -> None:
        busy = [connect(port) for _ in range(LIMIT)]
        for client in busy:
            client.sendall(b"GET /slow HTTP/1.1\r\nHost: a\r\n\r\n")
        while echo.at_work < LIMIT:
            time.sleep(0.01)
        with connect(port) as late:
            assert_problem(rest(late), 503)
        echo.go_on.set()
        for client in busy:
            assert b"200" in client.recv(65536)
            client.close()

    def test_leaves_descriptors_for_the_files_of_the_home(self) -> None:
        assert 8 <= connection_limit() <= connections.MAX_CONNECTIONS


class TestHeads:
    @pytest.mark.parametrize("piece", [1 << 20, 5000])
    def test_one_that_fits_is_answered_however_it_arrives(self, port: int, piece: int) -> None:
        with connect(port) as client:
            send_in_pieces(client, head_of(HEAD_BYTES), piece)
            assert client.recv(65536).startswith(b"HTTP/1.1 200 ")

    @pytest.mark.parametrize("piece", [1 << 20, 5000])
    def test_a_byte_more_is_refused_however_it_arrives(self, port: int, piece: int) -> None:
        with connect(port) as client:
            send_in_pieces(client, head_of(HEAD_BYTES + 1), piece)
            assert_problem(rest(client), 431)

    def test_a_body_that_comes_with_its_head_is_none_of_it(self, port: int) -> None:
        with connect(port) as client:
            client.sendall(HEAD + b"x" * 1_000_000)
            assert client.recv(65536).startswith(b"HTTP/1.1 200 ")


class TestMalformed:
    def test_bytes_that_are_no_http_are_answered_like_every_mistake(self, port: int) -> None:
        with connect(port) as client:
            client.sendall(b"\x16\x03\x01\x02\x00\x01\x00\r\n\r\n")
            assert_problem(rest(client), 400)
