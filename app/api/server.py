"""The server process: one socket, one uvicorn."""

from __future__ import annotations

import errno
import ipaddress
import socket
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI

from app.api.connections import Connection
from app.errors import InputError


def is_local(host: str) -> bool:
    """Whether nobody but this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


@contextmanager
def listen(host: str, port: int) -> Iterator[tuple[socket.socket, str]]:
    """A listening socket and the address that a browser opens.

    Raises:
        InputError: The address is taken or is not one of this machine's.
    """
    try:
        server = _bind(host.strip("[]"), port)
    except OSError as error:
        taken = error.errno == errno.EADDRINUSE
        reason = "is already in use" if taken else f"cannot be used ({error.strerror})"
        raise InputError(
            f"{host}:{port} {reason}", hint="Choose another with --port or TOUCHLINE_PORT."
        ) from error
    with server:
        name = f"[{host.strip('[]')}]" if ":" in host else host
        yield server, f"http://{name}:{server.getsockname()[1]}"


def _bind(host: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # With the protocol named: asyncio turns Nagle's algorithm off only then, and with it on
    # every second answer waits 40 ms for an acknowledgement.
    server = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind((host, port))
        server.listen(256)
    except OSError:
        server.close()
        raise
    return server


def run(app: FastAPI, server: socket.socket) -> None:
    """Serve until the process is told to stop."""
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
        timeout_graceful_shutdown=10,
    )
    Server(config, app).run(sockets=[server])


class Server(uvicorn.Server):
    """Ends what has no end of its own before it waits for all answers to be sent."""

    def __init__(self, config: uvicorn.Config, app: FastAPI):
        super().__init__(config)
        self._app = app

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop; open event streams and uploads end at once."""
        self._app.state.services.stopping.set()
        self._app.state.services.events.close()
        await super().shutdown(sockets)
