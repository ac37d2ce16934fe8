"""Exports as Touchline writes them, and a server that answers what a test says."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from app.formats.export_record import ExportRecord, find_export_frame_name
from app.formats.manifest import Manifest, write_manifest
from app.formats.output import open_output_folder, write_zip
from app.formats.parquet import write_parquet
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.scenes import make_scenes

HASH = "6f1ed002ab5595859014ebf0951522d9" * 2


@pytest.fixture(scope="session")
def records() -> list[ExportRecord]:
    """Three solved groups of the sample, the first in the test split."""
    found = []
    for number, scene in enumerate(make_scenes(groups=4, seed=3, faults=False)[:3]):
        views = {view.key: "train" if number else "test" for view in scene.group.views}
        found.append(
            ExportRecord(scene.group, solve_group(scene.group, PAPER), "accepted", splits=views)
        )
    return found


@pytest.fixture(scope="session")
def export(records: list[ExportRecord], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A Parquet export of a frozen version, with frames; nobody changes it."""
    return write_export(tmp_path_factory.mktemp("export") / "v1", records)


def write_export(out: Path, records: list[ExportRecord], images: bool = True) -> Path:
    """Write an export as the review floor does: table, plain frames, manifest."""
    with open_output_folder(out) as root:
        counts = write_parquet(root, records)
        for record in records if images else ():
            for number, view in enumerate(record.group.views):
                path = root / find_export_frame_name(record, view)
                path.parent.mkdir(parents=True, exist_ok=True)
                shape = (view.size.height, view.size.width, 3)
                Image.fromarray(np.full(shape, 40 * number, np.uint8)).save(path)
        stamp = {"frozen": {"hash": HASH}}
        manifest = Manifest("league", "parquet", "2030-01-01", counts, version="v1", stamp=stamp)
        write_manifest(root, manifest)
    return out


def zipped(folder: Path, out: Path) -> Path:
    """The zip of an export."""
    with out.open("wb") as file:
        write_zip(folder, file)
    return out


@dataclass
class Asked:
    """A request as it came."""

    method: str
    path: str
    headers: dict[str, str]
    body: bytes


@dataclass
class Answers:
    """What a server answers, one after the other, the last one for ever; and what it was asked.

    An answer is a status, a document and headers; a status of 0 closes the connection.
    """

    address: str
    waiting: list[tuple[int, Any, dict[str, str]]] = field(default_factory=list)
    asked: list[Asked] = field(default_factory=list)

    def say(self, status: int, body: Any = None, **headers: str) -> None:
        """One more answer."""
        self.waiting.append((status, body, {k.replace("_", "-"): v for k, v in headers.items()}))


@pytest.fixture
def answers() -> Iterator[Answers]:
    """A real server that says what it is told to."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler)
    told = Answers(f"http://127.0.0.1:{server.server_port}")
    server.RequestHandlerClass = _handler(told)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield told
    server.shutdown()
    thread.join()
    server.server_close()


def _handler(told: Answers) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def _answer(self) -> None:
            length = int(self.headers.get("Content-Length", 0))
            body = self.rfile.read(length)
            if self.headers.get("Transfer-Encoding") == "chunked":
                body = _chunked(self.rfile)
            told.asked.append(Asked(self.command, self.path, dict(self.headers.items()), body))
            status, value, headers = (
                told.waiting.pop(0) if len(told.waiting) > 1 else told.waiting[0]
            )
            if status == 0:
                self.close_connection = True
                return
            content = b"" if value is None else json.dumps(value).encode()
            self.send_response(status)
            for name, text in {"Content-Length": str(len(content)), **headers}.items():
                self.send_header(name, text)
            self.end_headers()
            self.wfile.write(content)

        do_GET = do_POST = do_PUT = do_PATCH = do_DELETE = _answer  # noqa: N815  as http.server asks

        def log_message(self, *_: Any) -> None:
            """Nothing on the screen."""

    return Handler


def _chunked(stream: Any) -> bytes:
    whole = b""
    while size := int(stream.readline(), 16):
        whole += stream.read(size)
        stream.readline()
    stream.readline()
    return whole
