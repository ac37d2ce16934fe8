"""Web processes: several servers behind one socket, started anew where one of them dies.

Which of them gets a connection is the kernel's choice. What they have in common is the database, the
folders of the home, and nothing in memory (docs/decisions/0042-several-web-processes.md).
"""

from __future__ import annotations

import os
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
from prometheus_client.multiprocess import mark_process_dead

from app.config import Settings
from app.http.metrics import MULTIPROCESS

log = structlog.get_logger("touchline")

Part = Callable[[Settings, socket.socket], None]
"""Serves until its process is told to stop."""

POLL_SECONDS = 0.2
AGAIN_SECONDS = 1.0
"""Before a process is started in the place of one that died."""
STOP_SECONDS = 30.0
"""So long a process may take to stop."""


def serve_with(count: int, part: Part, settings: Settings, listening: socket.socket) -> None:
    """Serve with so many processes until this one is told to stop.

    Args:
        count: How many.
        part: What each of them does; a function of a module.
        settings: Of the server.
        listening: The socket that all of them take connections from.
    """
    arguments = (part, settings, listening)
    with _stop_event() as stopping, _shared_metrics() as metrics:
        running = [_start_process(*arguments) for _ in range(count)]
        try:
            while not stopping.is_set():
                wait([process.sentinel for process in running], timeout=POLL_SECONDS)
                for place, process in enumerate(running):
                    if not process.is_alive() and not stopping.is_set():
                        log.error("a process of the server died", process=process.pid)
                        # What it has counted stays counted; what it was at is over.
                        mark_process_dead(process.pid, metrics)  # type: ignore[no-untyped-call]
                        stopping.wait(AGAIN_SECONDS)
                        running[place] = _start_process(*arguments)
        finally:
            _stop_processes(running)


def _start_process(part: Part, settings: Settings, listening: socket.socket) -> BaseProcess:
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
def _shared_metrics() -> Iterator[str]:
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
def _stop_event() -> Iterator[Event]:
    """Set once this process is asked to end."""
    stopping = Event()

    def stop(*_: Any) -> None:
        stopping.set()

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _run_process(part: Part, settings: Settings, listening: socket.socket) -> None:
    """One process."""
    Thread(target=_end_with_parent, daemon=True).start()
    try:
        part(settings, listening)
    except KeyboardInterrupt:
        # Ctrl+C reaches all processes of a terminal.
        sys.exit(130)


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        parent.join()
        os.kill(os.getpid(), signal.SIGTERM)
