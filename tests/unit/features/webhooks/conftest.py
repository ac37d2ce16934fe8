"""A receiver of webhooks: a real HTTP server that believes what is signed, and nothing else."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest
from standardwebhooks import Webhook as Verifier

from app.db.store import Store
from tests.waiting import SECONDS


@dataclass
class Receiver:
    """What arrived, and what is answered."""

    port: int = 0
    secret: str | None = None
    """With it every message is verified, by the library that receivers use."""
    answers: list[int] = field(default_factory=list)
    """Taken one by one; 204 where none is left."""
    let_go: threading.Event = field(default_factory=threading.Event)
    """Until it is set nothing that is sent below ``/slow`` is answered."""
    got: list[tuple[dict[str, str], dict[str, Any]]] = field(default_factory=list)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}/hook"

    @property
    def kinds(self) -> list[str]:
        return [body["type"] for _, body in self.got]


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    """Listens on loopback."""
    found = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            text = self.rfile.read(int(self.headers["Content-Length"])).decode()
            headers = {name.lower(): value for name, value in self.headers.items()}
            if self.path.endswith("/slow"):
                found.let_go.wait(SECONDS)
                return
            if found.secret is not None:
                Verifier(found.secret).verify(text, headers)
            found.got.append((headers, json.loads(text)))
            status = found.answers.pop(0) if found.answers else 204
            self.send_response(status)
            if 300 <= status < 400:
                self.send_header("Location", "/elsewhere")
            self.send_header("Content-Length", "0")
            self.end_headers()

        def do_GET(self) -> None:
            found.got.append(({}, {"type": "GET " + self.path}))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_arguments: object) -> None:
            return

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    found.port = server.server_port
    thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
    thread.start()
    yield found
    found.let_go.set()
    server.shutdown()
    server.server_close()


@pytest.fixture
def allowed(store: Store, receiver: Receiver, monkeypatch: pytest.MonkeyPatch) -> Store:
    """A store whose operator allows the receiver."""
    settings = store.settings.model_copy(update={"webhooks": [receiver.url]})
    monkeypatch.setattr(store, "settings", settings)
    return store
