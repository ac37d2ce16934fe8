"""Processes behind one socket: each answers, one that dies is replaced, and all end with the first."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.config import Settings
from app.http.server import serve_with_processes
from tests.waiting import SECONDS

PROGRAM = "from tests.unit.http.test_server_web_processes import main; main()"


def answer(_settings: Settings, listening: socket.socket) -> None:
    """Tells everybody who connects the number of this process."""
    while True:
        asked, _ = listening.accept()
        with asked:
            asked.sendall(str(os.getpid()).encode())


def main() -> None:
    """Serve with two of them, and tell the port."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()
        sys.stdout.write(f"{listening.getsockname()[1]}\n")
        sys.stdout.flush()
        serve_with_processes(2, answer, Settings(), listening)


@pytest.fixture
def server() -> Iterator[subprocess.Popen[str]]:
    """The first process; its first line is the port."""
    command = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as started:
        yield started
        started.kill()


def ask(port: int) -> int:
    """The number of a process that answers; 0: it died while it did."""
    try:
        with socket.create_connection(("127.0.0.1", port), timeout=SECONDS) as line:
            return int(line.recv(32) or 0)
    except ConnectionError:
        return 0


def ask_until(port: int, enough: int, but: set[int]) -> set[int]:
    """Numbers of so many processes that answer, without some."""
    found: set[int] = set()
    until = time.monotonic() + SECONDS
    while len(found) < enough and time.monotonic() < until:
        found |= {ask(port)} - but - {0}
        # Who is there already would be asked all the time while another starts.
        time.sleep(0.01)
    return found


class TestServeWith:
    def test_one_that_dies_is_replaced_and_all_end_with_the_first(
        self, server: subprocess.Popen[str]
    ) -> None:
        assert server.stdout is not None
        port = int(server.stdout.readline())
        both = ask_until(port, 2, set())
        os.kill(min(both), signal.SIGKILL)
        new = ask_until(port, 1, both)
        assert len(new) == 1
        server.send_signal(signal.SIGTERM)
        assert server.wait(SECONDS) == 0
        assert not any(Path(f"/proc/{number}").exists() for number in both | new)

    def test_they_end_where_the_first_is_killed(self, server: subprocess.Popen[str]) -> None:
        assert server.stdout is not None
        port = int(server.stdout.readline())
        both = ask_until(port, 2, set())
        server.kill()
        until = time.monotonic() + SECONDS
        while any(is_running(number) for number in both) and time.monotonic() < until:
            time.sleep(0.02)
        assert not any(is_running(number) for number in both)


def is_running(number: int) -> bool:
    """Whether a process is there and no zombie, whom nobody may wait for."""
    try:
        return "\nState:\tZ" not in Path(f"/proc/{number}/status").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return False
