"""A long recording on a server of its own: memory, rate of indexing, and how quickly frames come.

``python -m tests.bench.long_recording [MINUTES] [WIDTHxHEIGHT]``; without any 2 of 1280x720. A match of 90
minutes takes half an hour of a processor.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from tests.bench.table import print_table
from tests.films import rendered
from tests.videos import replace_boxes, write_pictures

RATE, SECONDS = 25, 20
SERVE = "from app.cli import main; main()"
STEPS = 60
"""Frames that are asked for one after the other in each direction."""


def bench_long_recording(minutes: float = 2.0, size: tuple[int, int] = (1280, 720)) -> None:
    """Print what a recording of that length costs."""
    with tempfile.TemporaryDirectory() as folder:
        film = write_long(Path(folder) / "films" / "match.mp4", minutes, size)
        environment = {
            **os.environ,
            "TOUCHLINE_HOME": f"{folder}/home",
            "TOUCHLINE_IMPORT_FOLDERS": str(film.parent),
        }
        server = subprocess.Popen(
            [sys.executable, "-c", SERVE, "serve", "--port", "0"],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        try:
            assert server.stdout is not None
            address = server.stdout.readline().split()[-1]
            with httpx.Client(base_url=f"{address}/api/v1", timeout=600) as client:
                _bench(client, server.pid, minutes, size)
        finally:
            server.terminate()
            server.wait()


def _bench(client: httpx.Client, server: int, minutes: float, size: tuple[int, int]) -> None:
    began = time.perf_counter()
    body = {"dataset": "long", "source": {"folder": "films/match.mp4"}}
    job = client.post("/recordings", json=body).raise_for_status().json()
    indexing = indexed_processor = 0.0
    while job["state"] not in ("done", "failed"):
        time.sleep(0.2)
        job = client.get(f"/jobs/{job['id']}").json()
        for worker in _children(server):
            indexing = max(indexing, _peak(worker))
            indexed_processor = max(indexed_processor, _processor(worker))
    assert job["state"] == "done", job["problem"]
    wall = time.perf_counter() - began
    number, frames = job["result"]["recording"], job["result"]["frames"]
    middle = frames // 2
    ways: dict[str, Iterator[int] | list[int]] = {
        "forwards": list(range(middle, middle + STEPS)),
        "backwards": list(range(middle, middle - STEPS, -1)),
        "anywhere": np.random.default_rng(1).integers(0, frames, STEPS).tolist(),
    }
    times = {way: sorted(_times(client, number, asked)) for way, asked in ways.items()}
    rows: list[tuple[str, object]] = [
        ("indexed, times real time", 60 * minutes / wall),
        ("processor for a frame, ms", 1000 * indexed_processor / frames),
        ("real time over processor time", 60 * minutes / indexed_processor),
        ("peak of the process that indexes, MB", indexing),
        ("peak of the server, MB", _peak(server)),
        ("peak of what decodes frames, MB", max(map(_peak, _children(server)), default=0.0)),
    ]
    for way, found in times.items():
        rows.append((f"frame {way}, median ms", 1000 * found[len(found) // 2]))
        rows.append((f"frame {way}, p95 ms", 1000 * found[int(0.95 * len(found))]))
    print_table(
        f"A recording of {minutes:g} minutes, {size[0]} x {size[1]}", ("what", "value"), rows
    )


def _times(client: httpx.Client, number: int, asked: Any) -> Iterator[float]:
    """Seconds for each frame, as a page asks for it; the first of a way is a jump."""
    for place, frame in enumerate(asked):
        began = time.perf_counter()
        client.get(f"/recordings/{number}/frames/{frame}", params={"width": 960}).raise_for_status()
        if place:
            yield time.perf_counter() - began
        # A person looks at it.
        time.sleep(0.04)


def _children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    found = [int(part) for part in text.split()]
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            found += [int(part) for part in (task / "children").read_text().split()]
        except OSError:
            continue
    return sorted(set(found))


def _peak(pid: int) -> float:
    """Most memory that a process has had at once, MB."""
    try:
        for line in Path(f"/proc/{pid}/status").read_text().splitlines():
            if line.startswith("VmHWM"):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    return 0.0


def _processor(pid: int) -> float:
    """Seconds of processor that a process has had."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def write_long(path: Path, minutes: float, size: tuple[int, int]) -> Path:
    """An MP4 of that length that holds the pictures of some seconds again and again, each once."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_pictures(path, "mp4v", rendered(3, SECONDS * RATE, size), RATE)
    times = max(round(60 * minutes / SECONDS), 1)

    def table(kind: bytes, body: bytes) -> bytes:
        """The same samples so many times over."""
        if kind == b"stsz":
            same, count = struct.unpack(">II", body[4:12])
            assert not same
            return body[:8] + struct.pack(">I", count * times) + body[12:] * times
        (count,) = struct.unpack(">I", body[4:8])
        head = body[:4] + struct.pack(">I", count * times)
        if kind == b"stco":
            return head + body[8:] * times
        if kind == b"stss":
            numbers = np.frombuffer(body[8:], ">u4")
            rounds = [numbers + lap * SECONDS * RATE for lap in range(times)]
            return head + np.concatenate(rounds).astype(">u4").tobytes()
        if kind == b"stsc":
            runs = np.frombuffer(body[8:], ">u4").reshape(-1, 3)
            laps = [runs + np.array((lap * _chunks(path), 0, 0)) for lap in range(times)]
            return head + np.concatenate(laps).astype(">u4").tobytes()
        entries = np.frombuffer(body[8:], ">u4").reshape(-1, 2)
        return head + np.tile(entries, (times, 1)).astype(">u4").tobytes()

    return replace_boxes(path, table)


def _chunks(path: Path) -> int:
    data = path.read_bytes()
    at = data.index(b"stco")
    return int(struct.unpack(">I", data[at + 8 : at + 12])[0])


if __name__ == "__main__":
    asked = sys.argv[1:]
    wide = tuple(int(side) for side in asked[1].split("x")) if len(asked) > 1 else (1280, 720)
    bench_long_recording(float(asked[0]) if asked else 2.0, (wide[0], wide[1]))
