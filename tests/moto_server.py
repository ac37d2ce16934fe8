"""An S3 server for tests (moto), apart from the product's libraries, and a proxy before it that fails.

The proxy counts what goes through, and does what stores do on bad days: refuses, hangs, cuts bodies off.
"""

from __future__ import annotations

import http.client
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from app.config import ObjectStoreSettings, Settings
from app.object_store.store import ObjectStore, open_store
from tests.waiting import SECONDS

ROOT = Path(__file__).parents[1]
MOTO = ROOT / ".moto"
PROGRAM = "import sys; from moto.server import main; main(['-H', '127.0.0.1', '-p', sys.argv[1]])"
SIGNED = "AWS4-HMAC-SHA256 Credential=k/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0"
_GONE = {
    "denied": (403, "AccessDenied"),
    "expired": (400, "ExpiredToken"),
    "broken": (503, "SlowDown"),
}
PATIENCE = 6.0
"""Seconds after which the tests' stores give up; one that hangs takes longer."""


@dataclass
class StoreProxy:
    """What stands before the server.

    Attributes:
        mode: ``open``, ``denied``, ``expired``, ``broken``, ``hangs``, ``cuts``, ``closed`` or, of a store
            that gives out whatever is there, ``unconditional``.
        sent: Bytes of bodies that went out to readers.
        asked: Method and path of every request.
    """

    port: int
    mode: str = "open"
    sent: int = 0
    asked: list[str] = field(default_factory=list)
    writes_fail_after: int = -1
    """So many writes go through, the next ones are refused; -1: all."""

    @property
    def endpoint(self) -> str:
        """Its address."""
        return f"http://127.0.0.1:{self.port}"

    def reset(self) -> None:
        """Open, nothing counted."""
        self.mode, self.sent, self.writes_fail_after = "open", 0, -1
        self.asked.clear()


@contextmanager
def moto_server(*more: str) -> Iterator[StoreProxy]:
    """A server with an empty bucket ``soccer-data``, and ``more``, behind a proxy."""
    if not (MOTO / "ready").is_file():
        pytest.fail("The S3 server of the tests is missing: run 'make moto'.", pytrace=False)
    port = _free_port()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(port)],
        env={**os.environ, "PYTHONPATH": str(MOTO)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        for bucket in ("soccer-data", "other-data", *more):
            _make_bucket(port, bucket)
        with _proxy(port) as proxy:
            yield proxy
    finally:
        process.kill()
        process.wait()


def store_settings(proxy: StoreProxy, **more: object) -> ObjectStoreSettings:
    """The store ``soccer-data/frames`` behind a proxy, that gives up within seconds."""
    values: dict[str, object] = {
        "url": "s3://soccer-data/frames",
        "endpoint": proxy.endpoint,
        "key": "tests",
        "secret": "of-tests",
        "exports": True,
        # Long enough for an answer on a machine that is busy with other things.
        "seconds": PATIENCE,
    }
    return ObjectStoreSettings.model_validate({**values, **more})


def stored_settings(home: Path, proxy: StoreProxy, **more: object) -> Settings:
    """Settings of a home that has the store ``frames``."""
    return Settings(home=home, stores={"frames": store_settings(proxy, **more)})


def fill_store(settings: Settings, files: Path, below: str = "") -> ObjectStore:
    """Put a folder's files into the store ``frames``."""
    store = open_store(settings, "frames")
    for path in sorted(files.rglob("*")):
        if path.is_file():
            name = path.relative_to(files).as_posix()
            store.put(f"{below}/{name}".lstrip("/"), path.read_bytes())
    return store


def _free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def _make_bucket(port: int, name: str) -> None:
    end = time.monotonic() + SECONDS
    while True:
        with suppress(OSError):
            line = http.client.HTTPConnection("127.0.0.1", port, timeout=SECONDS)
            line.request("PUT", f"/{name}", headers={"Authorization": SIGNED})
            assert line.getresponse().status == 200
            return
        assert time.monotonic() < end, "the S3 server does not start"
        time.sleep(0.05)


@contextmanager
def _proxy(behind: int) -> Iterator[StoreProxy]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), _Passing)
    server.daemon_threads = True
    proxy = StoreProxy(server.server_address[1])
    server.proxy, server.behind = proxy, behind  # type: ignore[attr-defined]
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    try:
        yield proxy
    finally:
        server.shutdown()
        server.server_close()


class _Passing(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def __getattr__(self, name: str) -> object:
        """Every method is passed on."""
        if name.startswith("do_"):
            return self._pass
        raise AttributeError(name)

    def handle_one_request(self) -> None:
        with suppress(ConnectionError):
            super().handle_one_request()

    def _pass(self) -> None:
        proxy: StoreProxy = self.server.proxy  # type: ignore[attr-defined]
        body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
        proxy.asked.append(f"{self.command} {self.path}")
        mode = proxy.mode
        if self.command in ("PUT", "POST") and proxy.writes_fail_after >= 0:
            proxy.writes_fail_after -= 1
            mode = "denied" if proxy.writes_fail_after < 0 else mode
            proxy.writes_fail_after = max(proxy.writes_fail_after, 0)
        if mode in _GONE:
            self._refuse(*_GONE[mode])
        elif mode == "closed":
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
        else:
            if mode == "hangs":
                time.sleep(PATIENCE + 3)
            self._forward(proxy, body, cut=mode == "cuts")

    def _refuse(self, status: int, code: str) -> None:
        text = f"<Error><Code>{code}</Code><Message>secret-bucket-name</Message></Error>".encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(text)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(text)

    def _forward(self, proxy: StoreProxy, body: bytes, *, cut: bool) -> None:
        line = http.client.HTTPConnection("127.0.0.1", self.server.behind, timeout=SECONDS)  # type: ignore[attr-defined]
        dropped = ("host", "if-match") if proxy.mode == "unconditional" else ("host",)
        headers = {n: value for n, value in self.headers.items() if n.lower() not in dropped}
        line.request(
            self.command,
            self.path,
            body or None,
            {**headers, "Host": f"127.0.0.1:{self.server.behind}"},
        )
        answer = line.getresponse()
        data = answer.read()
        self.send_response_only(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("transfer-encoding", "connection", "content-length"):
                self.send_header(name, value)
        length = answer.getheader("Content-Length") if self.command == "HEAD" else str(len(data))
        self.send_header("Content-Length", length or "0")
        self.end_headers()
        if cut and len(data) > 1 and answer.status in (200, 206) and "list-type" not in self.path:
            self.wfile.write(data[: len(data) // 2])
            self.close_connection = True
            return
        self.wfile.write(data)
        proxy.sent += len(data)

    def log_message(self, format: str, *args: object) -> None:  # noqa: A002
        """Nothing."""
