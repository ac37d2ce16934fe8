"""A recording that is sent in parts survives a network, a server and a script that stop."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

import touchline as library
from tests.integration.conftest import COMMAND, environment
from tests.starting import Process
from tests.videos import write_video
from tests.waiting import SECONDS
from touchline.errors import DataError, HashError, UnreachableError

Start = Callable[..., tuple["subprocess.Popen[Any]", str]]
MIB = 2**20


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a server over one home; on a port that a caller names, where it does."""
    started: list[subprocess.Popen[Any]] = []

    def serve(port: int = 0) -> tuple[subprocess.Popen[Any], str]:
        command = [sys.executable, "-c", COMMAND, "serve", "--port", str(port)]
        settings = environment(tmp_path / "home")
        server = Process(command, stdout=subprocess.PIPE, text=True, env=settings)
        started.append(server)
        assert server.stdout is not None
        return server, server.stdout.readline().split()[-1]

    yield serve
    for server in started:
        server.kill()
        server.communicate()


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """A video that is larger than a part: what follows its boxes is passed over by readers."""
    path = write_video(tmp_path / "final.mp4", "mp4v", 40)
    rest = 3 * MIB
    with path.open("ab") as file:
        file.write((rest + 8).to_bytes(4, "big") + b"free" + bytes(range(256)) * (rest // 256))
    return path


class TestUploadRecording:
    def test_it_goes_on_after_the_server_was_killed_and_is_the_same_file(
        self, start: Start, film: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(library.recordings, "PART", MIB)
        server, address = start()
        told: list[tuple[int, int]] = []

        def kill_once(there: int, size: int) -> None:
            nonlocal server
            told.append((there, size))
            if there == MIB and server.poll() is None:
                server.kill()
                server.wait()
                server, _ = start(urlsplit(address).port or 0)

        with library.Client(address) as client:
            recording = client.upload_recording("cup", film, sent=kill_once)
            size = film.stat().st_size
            assert [there for there, _ in told] == [0, MIB, 2 * MIB, 3 * MIB, size]
            assert (recording.frames, recording.bytes, recording.name) == (40, size, "final")
            assert client.recordings("cup") == client.recordings() == [recording]
            (shot,) = client.shots(recording)
            assert (shot.first, shot.last, shot.entered_by) == (0, 39, "start")
            shots = [{"first": a, "last": b, "kind": "main"} for a, b in ((0, 9), (10, 39))]
            path = f"recordings/{recording.id}"
            etag = client.get(f"{path}/shots")["etag"]
            client.put(f"{path}/shots", {"shots": shots}, if_match=etag)
            replay = {"recording": recording.id, "first": 10, "last": 39}
            client.post(f"{path}/links", {"live": {"first": 0, "last": 9}, "replay": replay})
            (link,) = client.links(recording)
            assert (link.live, link.replay) == (("final", 0, 9), ("final", 10, 39))
            assert (link.outcome, link.speed) == ("none", None)
            # Sent already: nothing is sent.
            told.clear()
            assert client.upload_recording("cup", film, sent=kill_once).id == recording.id
            assert told == [(size, size)]

    def test_a_script_that_was_stopped_goes_on_where_it_was(
        self, start: Start, film: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(library.recordings, "PART", MIB)
        server, address = start()

        def stop(there: int, _: int) -> None:
            if there == 2 * MIB:
                server.kill()
                server.wait()

        with library.Client(address, patience=0) as client, pytest.raises(UnreachableError):
            client.upload_recording("cup", film, sent=stop)
        _, address = start()
        told: list[int] = []
        with library.Client(address) as client:
            client.upload_recording("cup", film, sent=lambda there, _: told.append(there))
        assert told == [2 * MIB, 3 * MIB, film.stat().st_size]

    def test_of_a_part_whose_connection_is_lost_stays_what_came(
        self, start: Start, film: Path
    ) -> None:
        _, address = start()
        with library.Client(address) as client:
            asked = {"name": film.name, "size": film.stat().st_size, "mark": "1"}
            begun = client.send("POST", "uploads", params=asked, headers=library.recordings._BYTES)
            place = f"uploads/{begun.json()['id']}"
            where, content = urlsplit(address), film.read_bytes()
            with socket.create_connection((where.hostname, where.port)) as connection:
                head = f"PATCH /api/v1/{place}?offset=0 HTTP/1.1\r\nHost: {where.netloc}\r\n"
                head += f"Content-Type: application/octet-stream\r\nContent-Length: {len(content)}\r\n\r\n"
                connection.sendall(head.encode() + content[:100_000])
            end = time.monotonic() + SECONDS
            while client.get(place)["bytes"] < 100_000:
                assert time.monotonic() < end
                time.sleep(0.02)

    def test_a_file_that_changes_meanwhile_is_not_sent_as_one(
        self, start: Start, film: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(library.recordings, "PART", MIB)
        _, address = start()

        def change(there: int, _: int) -> None:
            if there == MIB:
                film.write_bytes(film.read_bytes())

        with library.Client(address) as client:
            with pytest.raises(DataError, match=r"final\.mp4 changed while it was sent"):
                client.upload_recording("cup", film, sent=change)
            recording = client.upload_recording("cup", film)
            film.write_bytes(film.read_bytes()[:-1])
            with pytest.raises(HashError, match=r"another file than final\.mp4"):
                library.recordings.require_same(film, recording)
