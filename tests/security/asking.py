"""Asking a server without a client's tidying, and what every answer must be."""

from __future__ import annotations

import http.client
import json
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlsplit

from tests.waiting import SECONDS

PROBLEM = "application/problem+json"
POLICY_START = "default-src 'self'; img-src 'self' blob: data:;"
SECRETS = (
    "Traceback",
    "sqlite",
    "SELECT ",
    "/home/",
    "/tmp/",
    "site-packages",
    'File "',
    "root:x:",
)
JSON = {"Content-Type": "application/json"}


@dataclass(frozen=True)
class Answer:
    """What came back; names of headers are small, and one that came twice has two lines."""

    status: int
    headers: Mapping[str, str]
    body: bytes


class Asker:
    """Sends requests as they stand, over one connection for as long as it lasts."""

    def __init__(self, address: str):
        self.where = urlsplit(address)
        self.asked = self.repeated = 0
        self._connection: http.client.HTTPConnection | None = None

    def __call__(
        self,
        method: str,
        target: str,
        headers: Mapping[str, str] | None = None,
        body: bytes | None = None,
        *,
        only_head: bool = False,
    ) -> Answer:
        """Send a request; ``only_head`` does not wait for a body that may have no end."""
        self.asked += 1
        try:
            return self._ask(method, target, headers or {}, body, only_head)
        except TimeoutError:
            self.close()
            raise
        except (http.client.RemoteDisconnected, BrokenPipeError, ConnectionResetError):
            # The server ended the connection after the answer before.
            self.close()
            self.repeated += 1
            return self._ask(method, target, headers or {}, body, only_head)

    def close(self) -> None:
        """End the connection."""
        if self._connection is not None:
            self._connection.close()
        self._connection = None

    def _ask(
        self, method: str, target: str, headers: Mapping[str, str], body: bytes | None, head: bool
    ) -> Answer:
        if self._connection is None:
            found = http.client.HTTPConnection(
                self.where.hostname or "", self.where.port, timeout=SECONDS
            )
            self._connection = found
        connection = self._connection
        sent = {"Host": self.where.netloc, **headers}
        connection.putrequest(method, target, skip_host=True, skip_accept_encoding=True)
        if body is not None:
            sent.setdefault("Content-Length", str(len(body)))
        for name, value in sent.items():
            connection.putheader(name, value)
        connection.endheaders(body)
        answer = connection.getresponse()
        lowered: dict[str, str] = {}
        for name, value in answer.getheaders():
            before = lowered.get(name.lower())
            lowered[name.lower()] = value if before is None else f"{before}\n{value}"
        found = Answer(answer.status, lowered, b"" if head else answer.read())
        if (
            head
            or lowered.get("connection") == "close"
            or sent.get("Content-Length", "0") != str(len(body or b""))
        ):
            self.close()
        return found


def assert_guarded(answer: Answer, told: object) -> None:
    """Security headers on every answer; a refusal is a problem, and betrays nothing."""
    headers, text = answer.headers, answer.body.decode("utf-8", "replace")
    assert headers["content-security-policy"].startswith(POLICY_START), told
    assert "unsafe" not in headers["content-security-policy"], told
    assert headers["x-content-type-options"] == "nosniff", told
    assert headers["x-frame-options"] == "DENY", told
    assert headers["referrer-policy"] == "same-origin", told
    assert headers["cross-origin-resource-policy"] == "same-origin", told
    assert not {name for name in headers if name.startswith("access-control-")}, told
    assert "server" not in headers, told
    assert answer.status < 500, (told, text)
    if answer.status >= 400 and answer.body and not headers["content-type"].startswith("text/html"):
        assert headers["content-type"] == PROBLEM, told
        problem = json.loads(text)
        assert problem["status"] == answer.status, told
        assert problem["instance"].startswith("urn:uuid:"), told
        assert not [secret for secret in SECRETS if secret in text], (told, text)
