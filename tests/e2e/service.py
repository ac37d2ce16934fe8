"""The product as somebody runs it: commands in a home, and a server over it."""

from __future__ import annotations

import os
import socket
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from tests.starting import Process, run

ROOT = Path(__file__).resolve().parents[2]
START_SECONDS = 180.0
COMMAND_SECONDS = 300
SERVE = "from app.cli import main; main()"
# One process for all of them: each would load the solver again.
COMMANDS = """
import shlex, sys
from app.command_line import app
for line in sys.argv[1:]:
    app(shlex.split(line), standalone_mode=False)
"""


def run_touchline(home: Path, *lines: str, seconds: float = COMMAND_SECONDS) -> None:
    """Run command lines of ``touchline`` in a home, one after the other."""
    command = [sys.executable, "-c", COMMANDS, *lines]
    done = run(command, cwd=ROOT, env=_environment(home), timeout=seconds)
    assert done.returncode == 0, f"touchline {lines}: {done.stderr}"


NOBODY = "http://127.0.0.1:9/hook"
"""An address that webhooks may have, and at which nobody listens."""


@contextmanager
def serving(home: Path, *options: str) -> Iterator[str]:
    """Address of a server over a home, with further options of ``serve``."""
    port = free_port()
    with killable(home, port, *options):
        yield f"http://127.0.0.1:{port}"


@contextmanager
def killable(home: Path, port: int, *options: str) -> Iterator[Process]:
    """A server over a home, at a port, that a test may end before its time."""
    with (home / "server.log").open("wb") as log:
        process = Process(
            [sys.executable, "-c", SERVE, "serve", *options],
            cwd=ROOT,
            env=_environment(home, port),
            stdout=log,
            stderr=log,
        )
        try:
            _wait_for(f"http://127.0.0.1:{port}", process, home / "server.log")
            yield process
        finally:
            process.terminate()
            process.wait(timeout=START_SECONDS)


def delete_dataset(address: str, name: str) -> None:
    """Delete a dataset where it is there: tests share a server, and know one dataset."""
    api = f"{address}/api/v1/datasets"
    for item in httpx.get(api).json()["items"]:
        if item["name"] == name:
            gone = httpx.request("DELETE", f"{api}/{item['id']}", json={"confirm": name})
            assert gone.is_success, gone.text


def _environment(home: Path, port: int = 0) -> dict[str, str]:
    return {
        **os.environ,
        "TOUCHLINE_HOME": str(home),
        "TOUCHLINE_PORT": str(port),
        "TOUCHLINE_WEBHOOKS": f'["{NOBODY}"]',
    }


def free_port() -> int:
    """A port that nobody listens on at this moment."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _wait_for(address: str, process: Process, log: Path) -> None:
    deadline = time.monotonic() + START_SECONDS
    while time.monotonic() < deadline:
        assert process.poll() is None, log.read_text()
        try:
            with urllib.request.urlopen(f"{address}/healthz", timeout=2):
                return
        except OSError:
            time.sleep(0.1)
    pytest.fail(f"the server did not start: {log.read_text()}")
