"""A server and a command beside it: what one does the other's listeners hear, and it stops."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import httpx
import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import ensure_dataset
from tests.integration.conftest import COMMAND, environment
from tests.waiting import SECONDS


@pytest.fixture
def server(tmp_path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Address and process of a server over a home with an empty dataset ``demo``."""
    store = Store.open(Settings(home=tmp_path))
    ensure_dataset(store, "demo", "ann")
    store.close()
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "serve", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(tmp_path),
    )
    line = process.stdout.readline()
    assert line, process.stderr.read()
    yield line.split()[-1], process
    process.kill()
    process.communicate()


@contextmanager
def events(address: str) -> Iterator[Iterator[str]]:
    with (
        httpx.Client(base_url=address, timeout=SECONDS) as client,
        client.stream("GET", "/api/v1/events", params={"dataset": "demo"}) as answer,
    ):
        lines = answer.iter_lines()
        assert next(lines) == ": listening"
        yield lines


class TestEvents:
    def test_a_command_is_heard_and_an_open_stream_does_not_hold_the_server(
        self, server, tmp_path
    ) -> None:
        address, process = server
        with events(address) as lines:
            command = ("policy", "set", "strict", "--dataset", "demo")
            done = subprocess.run(
                [sys.executable, "-c", COMMAND, *command],
                capture_output=True,
                text=True,
                env=environment(tmp_path),
            )
            assert done.returncode == 0, done.stderr
            data = next(line for line in lines if line.startswith("data: "))
            assert json.loads(data.removeprefix("data: ")) == {
                "dataset": "demo",
                "kind": "policy",
                "actor": "local",
            }
            process.send_signal(signal.SIGTERM)
            assert list(lines)[-1] == ""
            _, errors = process.communicate(timeout=SECONDS)
        # Nothing waited out the ten seconds that answers are given to end.
        assert "graceful shutdown exceeded" not in errors
        assert "Traceback" not in errors, errors
