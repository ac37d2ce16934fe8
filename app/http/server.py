"""The server process: one socket, one uvicorn."""

from __future__ import annotations

import errno
import gc
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Thread

import uvicorn
from fastapi import FastAPI

from app.errors import InputError
from app.http.connections import Connection
from app.solving.solve import warm_up

WAITING = 256
"""Connections that may wait to be accepted."""
ACCEPTED_AT_ONCE = 1
"""Connections that are accepted before those that are open are looked after again: who comes with
five hundred at once makes nobody wait for all of them."""
SWITCH_SECONDS = 0.001
"""How long a thread that solves may keep the others waiting: a reader takes its turn a dozen times
for one answer, and Python's own 5 ms add up."""

ANSWER_SECONDS = 8
"""So long open requests are answered by a server that stops; it has ended two seconds later."""
USUAL = (700, 10, 100)
"""New objects before the collector looks at them, and how often it looks at older ones, as Python has it; but
at all of them a tenth as often: that takes 40 ms when caches are full, and nobody is answered meanwhile."""


@contextmanager
def listen(host: str, port: int) -> Iterator[tuple[socket.socket, str]]:
    """A listening socket and the address that a browser opens.

    Raises:
        InputError: The address is taken or is not one of this machine's.
    """
    try:
        server = _bind_socket(host.strip("[]"), port)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        reason = "is already in use" if taken else f"cannot be used ({error.strerror})"
        raise InputError(
            f"{host}:{port} {reason}", hint="Choose another with --port or TOUCHLINE_PORT."
        ) from error
    with server:
        name = f"[{host.strip('[]')}]" if ":" in host else host
        yield server, f"http://{name}:{server.getsockname()[1]}"


def _bind_socket(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With the protocol named: asyncio turns Nagle's algorithm off only then, and with it on
    # every second answer waits 40 ms for an acknowledgement.
    server = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind((host, port))
        server.listen(WAITING)
    except OSError:
        server.close()
        raise
    return server


def run(app: FastAPI, server: socket.socket) -> None:
    """Serve until the process is told to stop."""
    Thread(target=settle, daemon=True).start()
    make_server(app).run(sockets=[server])


def settle() -> None:
    """Load the solver, and then count what is there among what stays; what comes now is as ``USUAL``.

    A full collection would walk through all of it: 0.12 s in which nobody is answered, each time.
    """
    warm_up()
    gc.collect()
    gc.freeze()
    gc.set_threshold(*USUAL)


def make_server(app: FastAPI) -> Server:
    """What serves an application."""
    config = uvicorn.Config(
        app,
        http=Connection,
        ws="none",
        # What a stranger sends must not fill the log: malformed bytes are answered, not logged.
        log_level="error",
        access_log=False,
        server_header=False,
        # Nobody stands in front of a local server: forwarded addresses would be invented.
        proxy_headers=False,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=ANSWER_SECONDS,
        backlog=ACCEPTED_AT_ONCE,
    )
    return Server(config, app)


class Server(uvicorn.Server):
    """Looks after everybody in turn, and stops what has no end of its own before it waits for the rest."""

    def __init__(self, config: uvicorn.Config, app: FastAPI):
        super().__init__(config)
        self._app = app

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Start, with room for more connections to wait than are accepted at a time."""
        sys.setswitchinterval(SWITCH_SECONDS)
        await super().startup(sockets)
        for listening in sockets or []:
            listening.listen(WAITING)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop; open event streams and uploads end at once, and jobs while requests are answered."""
        self._app.state.services.stop()
        await super().shutdown(sockets)
