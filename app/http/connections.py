"""Connections: how long a client may take, how many there may be, and what malformed bytes get.

uvicorn closes a connection that is idle between two requests. Here the rest is bounded as well:
one that has not sent a whole head of a request, a head that is too long, one that stops in the
middle of a body, and one connection more than the process has room for.
"""

from __future__ import annotations

import asyncio
import re
import resource
from functools import cache
from http import HTTPStatus
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from app.http.errors import RETRY_SECONDS
from app.http.headers import FIXED, content_security_policy
from app.http.problem import make_problem, problem_response
from app.http.request_log import HEADER, new_request_id

HEAD_SECONDS = 15.0
"""From the connection, or the first byte of a request, to the end of its head."""
HEAD_BYTES = 64 * 1024
"""Of the first line of a request and its headers."""
HEAD_END = re.compile(rb"\n\r?\n")
BODY_SECONDS = 20.0
"""For each ``BODY_BYTES`` of a body, and for what is left of it."""
BODY_BYTES = 16 * 1024
STOP_SECONDS = 2.0
"""For the rest of a body once the server stops."""
MAX_CONNECTIONS = 1000
SPARE_FILES = 128
"""Descriptors that stay free for the database, frames and exports."""


@cache
def connection_limit() -> int:
    """How many connections fit; the process is given as many descriptors as it may have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_CONNECTIONS + SPARE_FILES
    if soft != resource.RLIM_INFINITY and soft < wanted:
        soft = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    if soft == resource.RLIM_INFINITY:
        return MAX_CONNECTIONS
    return max(8, min(MAX_CONNECTIONS, soft - SPARE_FILES))


class Connection(H11Protocol):
    """One connection, with a deadline for whatever its client owes.

    A client owes the head of a request from its first byte (or the connection) on, and then the
    body, at ``BODY_BYTES`` in ``BODY_SECONDS``. Nothing is owed while the server answers, or while
    it is the server that does not read.
    """

    _deadline: asyncio.TimerHandle | None = None
    _owed = ""
    _received = 0
    _used = 0.0

    def __init__(self, *args: Any, **kwargs: Any):
        super().__init__(*args, **kwargs)
        # h11 bounds what is incomplete alone: a head would pass or not by how its bytes arrive.
        self.conn = h11.Connection(h11.SERVER, max_incomplete_event_size=HEAD_BYTES)

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take it; where there is no room, in the place of the one that is idle for longest."""
        if len(self.connections) >= connection_limit() and not self._make_room():
            transport.write(_error_response_bytes(503, "the server has too many connections"))
            transport.close()
            return
        super().connection_made(transport)
        self._used = self.loop.time()
        self._set_deadline("head", HEAD_SECONDS)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget what was owed."""
        self._clear_deadline()
        if self in self.connections:
            super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what came, and see what is still owed."""
        if self.transport is None or self.transport.is_closing():
            return
        self._used = self.loop.time()
        self._received += len(data)
        if self.conn.their_state is h11.IDLE and self._is_too_long_a_head(data):
            self._answer_and_close(
                431, f"the head of the request is longer than {HEAD_BYTES:,} bytes"
            )
            return
        super().data_received(data)
        self._update_deadline()

    def on_response_complete(self) -> None:
        """Look at what is owed once an answer is sent."""
        super().on_response_complete()
        self._update_deadline()

    def shutdown(self) -> None:
        """Stop: a request that is still arriving has little time left."""
        super().shutdown()
        if self.conn.their_state is h11.SEND_BODY:
            self._clear_deadline()
            self._set_deadline("rest", STOP_SECONDS)

    def send_400_response(self, msg: str) -> None:
        """Answer bytes that are no HTTP like every other mistake, and close."""
        self._answer_and_close(400, "the request is not valid HTTP")

    @property
    def is_idle(self) -> bool:
        """Whether no request is under way."""
        return self.cycle is None or self.cycle.response_complete

    def _is_too_long_a_head(self, data: bytes) -> bool:
        """Whether a head ends too late with these bytes, or cannot end in time any more."""
        arrived = self.conn.trailing_data[0] + data
        end = HEAD_END.search(arrived)
        return (end.end() if end else len(arrived)) > HEAD_BYTES

    def _update_deadline(self) -> None:
        """Set, keep or lift the deadline by the state of the request."""
        state = self.conn.their_state
        if state is h11.SEND_BODY:
            if self._owed != "rest" and (self._owed != "body" or self._received >= BODY_BYTES):
                self._clear_deadline()
                self._set_deadline("body", BODY_SECONDS)
        elif state is h11.IDLE and (self.cycle is None or self.conn.trailing_data[0]):
            self._set_deadline("head", HEAD_SECONDS)
        else:
            # Between two requests uvicorn's own timer runs.
            self._clear_deadline()

    def _set_deadline(self, what: str, seconds: float) -> None:
        if self._owed != what:
            self._owed, self._received = what, 0
            self._deadline = self.loop.call_later(seconds, self._end_overdue_request)

    def _clear_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
        self._deadline, self._owed = None, ""

    def _end_overdue_request(self) -> None:
        what, self._owed = self._owed, ""
        if self.transport.is_closing():
            return
        if what == "body" and self.flow.read_paused:
            self._set_deadline("body", BODY_SECONDS)
            return
        self._answer_and_close(
            408, f"the {'head' if what == 'head' else 'rest'} of the request did not come"
        )

    def _answer_and_close(self, status: int, detail: str) -> None:
        """Answer, if no answer has begun, and close."""
        begun = self.cycle is not None and self.cycle.response_started and not self.is_idle
        if self.cycle is not None and not self.is_idle:
            self.cycle.disconnected = True
            self.cycle.message_event.set()
        if not begun and self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.write(_error_response_bytes(status, detail))
        self.transport.close()

    def _make_room(self) -> bool:
        """Close the connection that is idle for longest; False where all are at work."""
        idle = [item for item in self.connections if isinstance(item, Connection) and item.is_idle]
        if not idle:
            return False
        oldest = min(idle, key=lambda item: item._used)
        self.connections.discard(oldest)
        oldest._clear_deadline()
        oldest.transport.abort()
        return True


def _error_response_bytes(status: int, detail: str) -> bytes:
    """A whole answer that says what is wrong, for a connection that ends with it."""
    busy = {"Retry-After": RETRY_SECONDS} if status == 503 else {}
    problem = problem_response(make_problem(status, detail), busy)
    headers = {
        HEADER: new_request_id(),
        **FIXED,
        "Content-Security-Policy": content_security_policy(),
        "Connection": "close",
        **dict(problem.headers),
    }
    lines = [f"HTTP/1.1 {status} {HTTPStatus(status).phrase}"]
    lines += [f"{name}: {value}" for name, value in headers.items()]
    return "\r\n".join([*lines, "", ""]).encode("latin-1") + bytes(problem.body)
