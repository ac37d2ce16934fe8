"""A long recording on a server of its own: memory, rate of indexing, and how quickly frames come.

``python -m tests.bench.long_recording [MINUTES] [WIDTHxHEIGHT]``; without any 2 minutes of a real clip of 1280x720
again and again, or of a drawn film where there is none or another size is asked for. A match of 90 minutes takes half an
hour of a processor.
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import cv2
import httpx
import numpy as np

from app.video.indexing import index_without_measuring
from tests.bench.table import print_table
from tests.films import rendered
from tests.videos import replace_boxes, write_pictures

RATE, SECONDS = 25, 20
SERVE = "from app.cli import main; main()"
STEPS = 60
"""Frames that are asked for one after the other in each way."""
STEPPING = 10.0
"""Frames a second of somebody who steps."""
MOST_MS = 80.0
"""Within which a neighbour has to come, 95 in a hundred."""
WIDTH = 960
DATA = Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
CLIP = DATA / "broadcast" / "clips" / "rma_sev.mp4"


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
                _bench(client, server.pid, film, minutes, size)
        finally:
            server.terminate()
            server.wait()


def _bench(
    client: httpx.Client, server: int, film: Path, minutes: float, size: tuple[int, int]
) -> None:
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
    forwards, backwards = range(middle, middle + STEPS), range(middle, middle - STEPS, -1)
    dice = np.random.default_rng(1)
    ways: dict[str, tuple[Iterable[int], float]] = {
        "a step forwards": (forwards, STEPPING),
        "a step backwards": (backwards, STEPPING),
        "played (L)": (forwards, RATE),
        "played twice as fast (L L)": (range(middle, middle + 2 * STEPS, 2), RATE),
        "played backwards (J)": (backwards, RATE),
        "anywhere": (dice.integers(0, frames, STEPS).tolist(), STEPPING),
    }
    # Elsewhere each time: what is decoded for one way is nothing to the next one.
    far = [place * (frames // 8) - frames // 4 for place in range(len(ways))]
    rows: list[tuple[object, ...]] = []
    with closing(_by_hand(film)) as by_hand:
        for (way, (asked, rate)), off in zip(ways.items(), far, strict=True):
            moved = [frame if way == "anywhere" else (frame + off) % frames for frame in asked]
            spent = -_processor_of_all(server)
            pairs = list(_times(client, number, moved, rate, by_hand))
            spent = 1000 * (spent + _processor_of_all(server)) / STEPS
            times, hand = np.array(pairs).T
            median, late = np.percentile(1000 * times, [50, 95]).tolist()
            known_median, known_late = np.percentile(1000 * hand, [50, 95]).tolist()
            kept = None if way == "anywhere" else "yes" if late < MOST_MS else "no"
            rows.append(
                (way, median, late, spent, known_median, known_late, late / known_late, kept)
            )
    print_table(
        f"A recording of {minutes:g} minutes, {size[0]} x {size[1]}",
        ("what", "value"),
        [
            ("indexed, times real time", 60 * minutes / wall),
            ("processor for a frame, ms", 1000 * indexed_processor / frames),
            ("real time over processor time", 60 * minutes / indexed_processor),
            ("peak of the process that indexes, MB", indexing),
            ("peak of the server, MB", _peak(server)),
            ("peak of what decodes frames, MB", max(map(_peak, _children(server)), default=0.0)),
        ],
    )
    print_table(
        f"Its frames, {WIDTH} wide; by hand: the frame that follows decoded and encoded in this process, in turn",
        (
            "what is asked for",
            "median ms",
            "p95 ms",
            "processor ms",
            "by hand",
            "p95",
            "p95 x",
            f"{MOST_MS:g} ms kept",
        ),
        rows,
    )


def _times(
    client: httpx.Client, number: int, asked: Sequence[int], rate: float, by_hand: Iterator[float]
) -> Iterator[tuple[float, float]]:
    """Seconds for each frame, as a page asks for it, and for one by hand; the first of a way is a jump."""
    for place, frame in enumerate(asked):
        began = time.perf_counter()
        client.get(
            f"/recordings/{number}/frames/{frame}", params={"width": WIDTH}
        ).raise_for_status()
        spent = time.perf_counter() - began
        if place:
            yield spent, next(by_hand)
        time.sleep(max(began + 1 / rate - time.perf_counter(), 0.0))


def _by_hand(film: Path) -> Generator[float, None, None]:
    """Seconds that each frame takes where nobody serves it."""
    video = cv2.VideoCapture(str(film))
    try:
        while True:
            began = time.perf_counter()
            _, picture = video.read()
            height, width = picture.shape[:2]
            size = (WIDTH, round(height * WIDTH / width))
            cv2.imencode(".jpg", cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
            yield time.perf_counter() - began
    finally:
        video.release()


def _children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    found = [int(part) for part in text.split()]
    for task in Path(f"/proc/{pid}/task").iterdir():
        try:
            found += [int(part) for part in (task / "children").read_text().split()]
        except OSError:
            continue
    return sorted(set(found))


def _processor_of_all(server: int) -> float:
    """Seconds of processor of a server and its processes, those that work ahead too."""
    return sum(map(_processor, (server, *_children(server))))


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
    if size == (1280, 720) and CLIP.exists():
        # Its tables come behind its pictures, and its first frame is a key frame.
        path.write_bytes(CLIP.read_bytes())
    else:
        write_pictures(path, "mp4v", rendered(3, SECONDS * RATE, size), RATE)
    lap = index_without_measuring(path)
    seconds = float(lap.seconds[-1] + lap.seconds[1])
    times, chunks = max(round(60 * minutes / seconds), 1), _chunks(path)

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
            rounds = [numbers + turn * len(lap) for turn in range(times)]
            return head + np.concatenate(rounds).astype(">u4").tobytes()
        if kind == b"stsc":
            runs = np.frombuffer(body[8:], ">u4").reshape(-1, 3)
            laps = [runs + np.array((turn * chunks, 0, 0)) for turn in range(times)]
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
