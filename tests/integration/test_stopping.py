"""A server that stops, or is killed, leaves neither processes nor half of an upload."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import cv2
import httpx
import pytest

from app.config import Settings
from app.db.store import Store
from app.features.jobs.records import require_job
from tests.databases import holding_the_write_lock
from tests.e2e.service import serving
from tests.homes import copy_home
from tests.integration.conftest import COMMAND, environment
from tests.starting import Process
from tests.videos import numbered, write_pictures
from tests.waiting import SECONDS


@pytest.fixture
def home(tmp_path: Path) -> Path:
    return tmp_path / "home"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A folder whose one file takes a long time to read."""
    match = tmp_path / "data" / "league" / "season" / "match"
    match.mkdir(parents=True)
    (match / "Labels-v3.json").write_bytes(b'{"a":[%s{}]}' % (b"{}," * 30_000_000))
    return tmp_path / "data"


@pytest.fixture
def server(home: Path, data: Path) -> Iterator[subprocess.Popen[str]]:
    started = subprocess.Popen(
        [sys.executable, "-c", COMMAND, "serve", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**environment(home), "TOUCHLINE_IMPORT_FOLDERS": str(data)},
    )
    yield started
    started.kill()
    started.communicate()


@pytest.fixture
def address(server: subprocess.Popen[str]) -> str:
    assert server.stdout is not None
    return server.stdout.readline().split()[-1]


def until(happens: Callable[[], Any]) -> Any:
    end = time.monotonic() + SECONDS
    while time.monotonic() < end:
        if found := happens():
            return found
        time.sleep(0.02)
    raise AssertionError("it did not happen")


def children(pid: int) -> list[int]:
    """Processes that a process started, without those that are over."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if int(parent) == pid and state != "Z":
            found.append(int(stat.parent.name))
    return found


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def is_listening(address: str) -> bool:
    try:
        socket.create_connection((urlsplit(address).hostname, urlsplit(address).port)).close()
    except ConnectionRefusedError:
        return False
    return True


def importing(server: subprocess.Popen[str], address: str) -> tuple[int, list[int]]:
    """Have the folder imported; the job once it runs, and the processes of the server then."""
    body = {"dataset": "d", "format": "soccernet-v3", "source": {"folder": "data"}}
    with httpx.Client(base_url=address, headers={"Origin": address}, timeout=SECONDS) as client:
        job: int = client.post("/api/v1/imports", json=body).json()["id"]
        until(lambda: client.get(f"/api/v1/jobs/{job}").json()["state"] == "running")
    # One for the pictures, one for the import, and multiprocessing's own.
    return job, until(lambda: len(found := children(server.pid)) >= 3 and found)


class TestStopping:
    def test_a_change_that_is_under_way_is_answered_and_kept(
        self, filled: Path, tmp_path_factory: pytest.TempPathFactory
    ) -> None:
        home = copy_home(filled, tmp_path_factory)
        views = "/api/v1/datasets/small/saved-views"
        server = Process(
            [sys.executable, "-c", COMMAND, "serve", "--port", "0"],
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment(home),
        )
        assert server.stdout is not None
        address = server.stdout.readline().split()[-1]
        # It writes when it starts.
        assert httpx.get(f"{address}/healthz", timeout=SECONDS).status_code == 200
        with ThreadPoolExecutor() as executor, holding_the_write_lock(home):
            body = {"name": "kept", "q": "status:accepted"}
            change = executor.submit(httpx.post, address + views, json=body, timeout=SECONDS)
            busy = 'touchline_requests_busy{class="write"} 1.0'
            until(lambda: busy in httpx.get(f"{address}/metrics", timeout=SECONDS).text)
            server.terminate()
            until(lambda: not is_listening(address))
        assert change.result().status_code == 201
        server.communicate(timeout=SECONDS)
        with serving(home) as address:
            found = httpx.get(address + views, timeout=SECONDS).json()["items"]
            assert [item["name"] for item in found] == ["kept"]

    @pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
    def test_no_process_outlives_the_server(
        self, server: subprocess.Popen[str], address: str, number: int
    ) -> None:
        _, workers = importing(server, address)
        server.send_signal(number)
        server.wait(SECONDS)
        until(lambda: not any(map(is_alive, workers)))

    def test_a_job_whose_process_is_told_to_end_before_its_server_goes_on_with_the_next_one(
        self, server: subprocess.Popen[str], address: str, home: Path
    ) -> None:
        job, workers = importing(server, address)
        # As systemd does with KillMode=control-group, in whatever order.
        for number in (*workers, server.pid):
            os.kill(number, signal.SIGTERM)
        server.wait(SECONDS)
        with closing(Store.open(Settings(home=home))) as store, store.read() as session:
            found = require_job(session, job)
        assert (found.state, found.problem) == ("running", None)

    def test_nothing_stays_of_an_upload_that_stalls(
        self, server: subprocess.Popen[str], address: str, home: Path
    ) -> None:
        where = urlsplit(address)
        with socket.create_connection((where.hostname, where.port)) as line:
            head = (
                f"POST /api/v1/uploads?name=a.zip HTTP/1.1\r\nHost: {where.netloc}\r\n"
                "Content-Type: application/octet-stream\r\nContent-Length: 1000\r\n\r\nstart"
            )
            line.sendall(head.encode())
            until(lambda: list((home / "uploads").glob("*.part")))
            server.send_signal(signal.SIGTERM)
            line.settimeout(SECONDS)
            assert line.recv(12) == b"HTTP/1.1 503"
            server.wait(SECONDS)
        assert list((home / "uploads").iterdir()) == []


class TestIndexing:
    """A recording whose indexing is killed is indexed by whoever comes next, and never by half."""

    FRAMES = 1200

    @pytest.fixture
    def data(self, tmp_path: Path) -> Path:
        """A folder with a film that takes seconds to index, also where much else is done."""
        (tmp_path / "data").mkdir()
        small = [cv2.resize(numbered(number), (320, 192)) for number in range(200)]
        pictures = (small[number % 200] for number in range(self.FRAMES))
        write_pictures(tmp_path / "data" / "final.mp4", "mp4v", pictures)
        return tmp_path / "data"

    def indexing(self, client: httpx.Client) -> int:
        """The job that indexes the film, once it has read frames of it."""
        body = {"dataset": "cup", "source": {"folder": "data/final.mp4"}}
        job: int = client.post("/api/v1/recordings", json=body).json()["id"]
        until(lambda: client.get(f"/api/v1/jobs/{job}").json()["done"] >= 100)
        return job

    def ended(self, client: httpx.Client, job: int) -> Any:
        def over() -> Any:
            found = client.get(f"/api/v1/jobs/{job}").json()
            return found["state"] in ("done", "failed") and found

        return until(over)

    def test_the_next_server_does_it_and_nothing_is_half(
        self, server: subprocess.Popen[str], address: str, home: Path, data: Path
    ) -> None:
        with httpx.Client(base_url=address, timeout=SECONDS) as client:
            job = self.indexing(client)
            workers = children(server.pid)
            server.kill()
            server.wait(SECONDS)
        until(lambda: not any(map(is_alive, workers)))
        assert not list((home / "recordings").glob("*"))
        again = subprocess.Popen(
            [sys.executable, "-c", COMMAND, "serve", "--port", "0"],
            stdout=subprocess.PIPE,
            text=True,
            env={**environment(home), "TOUCHLINE_IMPORT_FOLDERS": str(data)},
        )
        try:
            assert again.stdout is not None
            base = again.stdout.readline().split()[-1]
            with httpx.Client(base_url=base, timeout=SECONDS) as client:
                done = self.ended(client, job)
                assert (done["state"], done["result"]["frames"]) == ("done", self.FRAMES)
                (recording,) = client.get("/api/v1/recordings").json()["items"]
                assert (recording["indexed"], recording["problem"]) == (True, None)
                assert [path.name for path in (home / "recordings").iterdir()] == [
                    f"{recording['sha256']}.npz"
                ]
        finally:
            again.kill()
            again.communicate()

    def test_one_whose_process_is_killed_says_so_and_can_be_indexed_again(
        self, server: subprocess.Popen[str], address: str, home: Path
    ) -> None:
        with httpx.Client(base_url=address, headers={"Origin": address}, timeout=SECONDS) as client:
            job = self.indexing(client)
            for worker in children(server.pid):
                os.kill(worker, signal.SIGKILL)
            failed = self.ended(client, job)
            assert failed["state"] == "failed"
            assert (
                "final.mp4 was not finished: its process was killed"
                in (failed["problem"]["detail"])
            )
            (recording,) = client.get("/api/v1/recordings").json()["items"]
            assert not recording["indexed"]
            assert not list((home / "recordings").glob("*"))
            body = client.post(f"/api/v1/recordings/{recording['id']}/shots").json()
            assert self.ended(client, body["id"])["result"]["frames"] == self.FRAMES
