"""A home with real data, filled by the command line, and a real server over it."""

from __future__ import annotations

import http.client
import io
import os
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from struct import pack
from urllib.parse import urlsplit

import cv2
import httpx
import numpy as np
import pytest

from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.sample.scene import Scene
from app.soccer.group import Group
from tests import starting
from tests.e2e.service import run_touchline, serving
from tests.homes import copy_home, once_for_all
from tests.scenes import make_scenes

COMMAND = "from app.cli import main; main()"


@dataclass(frozen=True)
class Raw:
    """An answer to a request that was sent as it stands, without a client's tidying."""

    status: int
    headers: dict[str, str]
    body: bytes


@pytest.fixture(scope="session")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files and a home that has them, made once: ``tree``, ``spoiled``, ``home``."""
    return once_for_all(tmp_path_factory, "integration", fill)


def fill(folder: Path) -> None:
    """Four sound groups and one with spoiled frames, and a home with both; the sound are solved."""
    scenes = make_scenes(groups=4, seed=3, faults=False)
    write_tree(folder / "tree", scenes)
    write_spoiled(folder / "spoiled", scenes[0].group)
    run_touchline(
        folder / "home",
        f"import soccernet-v3 {folder / 'tree'} --dataset small",
        f"import soccernet-v3 {folder / 'spoiled'} --dataset spoiled",
        "solve --dataset small --workers 1",
    )


@pytest.fixture(scope="session")
def tree(filled: Path) -> Path:
    """Four groups without planted faults, in SoccerNet-v3 layout; nobody changes them."""
    return filled / "tree"


def write_tree(root: Path, scenes: list[Scene]) -> None:
    """Scenes in SoccerNet-v3 layout, a Frames-v3.zip for each match."""
    write_soccernet_v3(root, [scene.group for scene in scenes])
    for scene in scenes:
        path = root / scene.group.match / "Frames-v3.zip"
        with zipfile.ZipFile(path, "a") as frames:
            for index, view in enumerate(scene.group.views):
                frames.writestr(view.key, picture(index, view.size.width, view.size.height))


def write_spoiled(root: Path, group: Group) -> None:
    """One group: its first frame is no image, its second a bomb."""
    write_soccernet_v3(root, [group])
    for view, content in zip(group.views, (b"GIF89a<script>", bomb(16_000)), strict=False):
        (root / group.match / view.key).write_bytes(content)


def picture(shade: int, width: int, height: int) -> bytes:
    """A plain frame as PNG."""
    image = np.full((height, width, 3), (40, 120 + 20 * shade, 50), np.uint8)
    return cv2.imencode(".png", image)[1].tobytes()


def bomb(side: int) -> bytes:
    """A black PNG of that side, a thousand times smaller than its pixels."""
    packer = zlib.compressobj(1)
    row = b"\0" * (side + 1)
    data = b"".join(packer.compress(row) for _ in range(side)) + packer.flush()
    header = pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", data), (b"IEND", b""))
    out = io.BytesIO(b"\x89PNG\r\n\x1a\n")
    out.seek(0, io.SEEK_END)
    for kind, content in parts:
        out.write(pack(">I", len(content)) + kind + content)
        out.write(pack(">I", zlib.crc32(kind + content)))
    return out.getvalue()


@pytest.fixture(scope="session")
def touchline(
    filled: Path, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a command of the command line in the home of this process."""
    home = copy_home(filled, tmp_path_factory)

    def run(*arguments: object) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-c", COMMAND, *map(str, arguments)]
        return starting.run(command, env=environment(home))

    run.home = home  # type: ignore[attr-defined]
    return run


def environment(home: Path) -> dict[str, str]:
    """The environment of a command: this one's, with that home alone."""
    kept = {name: text for name, text in os.environ.items() if not name.startswith("TOUCHLINE_")}
    return {**kept, "TOUCHLINE_HOME": str(home)}


@pytest.fixture(scope="session")
def address(touchline) -> Iterator[str]:
    """Address of a server over a home with the datasets ``small`` (solved) and ``spoiled``."""
    log = Path(touchline.home) / "server.log"
    with log.open("w") as file:
        server = starting.Process(
            [sys.executable, "-c", COMMAND, "serve", "--port", "0"],
            stdout=subprocess.PIPE,
            # A pipe that nobody reads would fill, and the server wait for ever.
            stderr=file,
            text=True,
            env=environment(touchline.home),
        )
    try:
        line = server.stdout.readline()
        assert line.startswith("Touchline is at http://127.0.0.1:"), log.read_text()
        # The address is told before what an earlier run left is taken up.
        assert httpx.get(f"{line.split()[-1]}/readyz", timeout=60).status_code == 200
        yield line.split()[-1]
    finally:
        server.terminate()
        server.communicate(timeout=60)
    assert "Traceback" not in (errors := log.read_text()), errors


@pytest.fixture(scope="module")
def own_server(filled: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A server over a home of its own: what others judge and edit changes what is in a version."""
    with serving(copy_home(filled, tmp_path_factory)) as address:
        yield address


@pytest.fixture(scope="session")
def client(address: str) -> Iterator[httpx.Client]:
    """A client of the server."""
    with httpx.Client(base_url=address, timeout=120) as client:
        yield client


@pytest.fixture(scope="session")
def raw(address: str) -> Callable[..., Raw]:
    """Send a request without any tidying of its target or headers."""
    where = urlsplit(address)

    def send(
        method: str, target: str, headers: dict[str, str] | None = None, body: bytes | None = None
    ) -> Raw:
        connection = http.client.HTTPConnection(where.hostname, where.port, timeout=120)
        try:
            sent = {"Host": where.netloc, **(headers or {})}
            connection.putrequest(method, target, skip_host=True, skip_accept_encoding=True)
            if body is not None:
                sent.setdefault("Content-Length", str(len(body)))
            for name, value in sent.items():
                connection.putheader(name, value)
            connection.endheaders(body)
            answer = connection.getresponse()
            lowered = {name.lower(): value for name, value in answer.getheaders()}
            return Raw(answer.status, lowered, answer.read())
        finally:
            connection.close()

    return send
