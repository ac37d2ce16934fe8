"""Server processes: one socket, and one uvicorn or several web processes behind it."""

from __future__ import annotations

import errno
import gc
import os
import resource
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from multiprocessing.process import BaseProcess
from tempfile import TemporaryDirectory
from threading import Event, Thread
from typing import Any

import structlog
import uvicorn
from fastapi import FastAPI
from prometheus_client.multiprocess import mark_process_dead

from app.config import Settings
from app.errors import InputError
from app.http.metrics import MULTIPROCESS
from app.solving.solve import warm_up_solver

MAX_CONNECTIONS = 1000
SPARE_FILES = 128
"""Descriptors that stay free for the database, frames and exports."""
HEAD_BYTES = 64 * 1024
"""Of the first line of a request and its headers."""
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
GC_THRESHOLDS = (700, 10, 100)
"""New objects before the collector looks at them, and how often it looks at older ones, as Python has it; but
at all of them a tenth as often: that takes 40 ms when caches are full, and nobody is answered meanwhile."""


log = structlog.get_logger("touchline")
ServeUntilStopped = Callable[[Settings, socket.socket], None]
"""Serves until its process is told to stop."""
POLL_SECONDS = 0.2
RESTART_SECONDS = 1.0
"""Before a process is started in the place of one that died."""
STOP_SECONDS = 30.0
"""So long a process may take to stop."""


@contextmanager
def open_listening_socket(host: str, port: int) -> Iterator[tuple[socket.socket, str]]:
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


def serve_application(app: FastAPI, server: socket.socket) -> None:
    """Serve until the process is told to stop."""
    Thread(target=warm_up_process, daemon=True).start()
    make_server(app).run(sockets=[server])


def warm_up_process() -> None:
    """Load the solver, and then count what is there among what stays; what comes now is as ``GC_THRESHOLDS``.

    A full collection would walk through all of it: 0.12 s in which nobody is answered, each time.
    """
    warm_up_solver()
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GC_THRESHOLDS)


def raise_connection_limit() -> int:
    """How many connections fit; the process is given as many descriptors as it may have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = MAX_CONNECTIONS + SPARE_FILES
    if soft != resource.RLIM_INFINITY and soft < wanted:
        soft = wanted if hard == resource.RLIM_INFINITY else min(wanted, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    if soft == resource.RLIM_INFINITY:
        return MAX_CONNECTIONS
    return max(8, min(MAX_CONNECTIONS, soft - SPARE_FILES))


def make_server(app: FastAPI) -> Server:
    """What serves an application."""
    config = uvicorn.Config(
        app,
        # The parser that bounds a head; clients that are slow with theirs are the business of the proxy.
        http="h11",
        h11_max_incomplete_event_size=HEAD_BYTES,
        limit_concurrency=raise_connection_limit(),
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


def serve_with_processes(
    count: int, part: ServeUntilStopped, settings: Settings, listening: socket.socket
) -> None:
    """Serve with so many processes until this one is told to stop.

    Args:
        count: How many.
        part: What each of them does; a function of a module.
        settings: Of the server.
        listening: The socket that all of them take connections from.
    """
    arguments = (part, settings, listening)
    with _listen_for_stop_signals() as stopping, _open_metrics_folder() as metrics:
        running = [_start_process(*arguments) for _ in range(count)]
        try:
            while not stopping.is_set():
                wait([process.sentinel for process in running], timeout=POLL_SECONDS)
                for place, process in enumerate(running):
                    if not process.is_alive() and not stopping.is_set():
                        log.error("a process of the server died", process=process.pid)
                        # What it has counted stays counted; what it was at is over.
                        mark_process_dead(process.pid, metrics)  # type: ignore[no-untyped-call]
                        stopping.wait(RESTART_SECONDS)
                        running[place] = _start_process(*arguments)
        finally:
            _stop_processes(running)


def _start_process(
    part: ServeUntilStopped, settings: Settings, listening: socket.socket
) -> BaseProcess:
    process = get_context("spawn").Process(target=_run_process, args=(part, settings, listening))
    process.start()
    return process


def _stop_processes(running: list[BaseProcess]) -> None:
    for process in running:
        process.terminate()
    for process in running:
        process.join(STOP_SECONDS)
        if process.is_alive():
            log.error("a process of the server did not stop", process=process.pid)
            process.kill()


@contextmanager
def _open_metrics_folder() -> Iterator[str]:
    """A folder in which the processes count together: ``/metrics`` of any of them adds up all.

    The library reads the variable when it is imported, which the processes do once they run.
    """
    with TemporaryDirectory(prefix="touchline-metrics-") as folder:
        os.environ[MULTIPROCESS] = folder
        try:
            yield folder
        finally:
            del os.environ[MULTIPROCESS]


@contextmanager
def _listen_for_stop_signals() -> Iterator[Event]:
    """Set once this process is asked to end."""
    stopping = Event()

    def set_stopping(*_: Any) -> None:
        stopping.set()

    before = {
        number: signal.signal(number, set_stopping) for number in (signal.SIGTERM, signal.SIGINT)
    }
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _run_process(part: ServeUntilStopped, settings: Settings, listening: socket.socket) -> None:
    """One process."""
    Thread(target=_terminate_with_parent, daemon=True).start()
    try:
        part(settings, listening)
    except KeyboardInterrupt:
        # Ctrl+C reaches all processes of a terminal.
        sys.exit(130)


def _terminate_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
