"""Children of ``multiprocessing`` that start loaded, as programs do in ``tests.starting``.

The product starts its children anew ("spawn"), which costs mostly imports. For tests and for the
servers and commands that are forks, one process that has loaded the product forks them: the
standard library's own server of forks. A child has the environment, folder, standard files, mask
and handling of Ctrl+C of whoever starts it, but not its limits and its group of processes.
"""

from __future__ import annotations

import os
import re
import signal
import socket
import threading
import time
from collections.abc import Callable, Sequence
from multiprocessing import forkserver
from multiprocessing.context import SpawnProcess
from multiprocessing.popen_forkserver import Popen
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

ANEW = SpawnProcess._Popen  # type: ignore[attr-defined]
"""How the standard library starts a child."""
_lock = threading.Lock()


def start_loaded(find: Callable[[], str]) -> None:
    """Let the children of this process be forked from a loaded one, whose address is found then."""
    SpawnProcess._Popen = staticmethod(  # type: ignore[attr-defined]
        lambda process: _LoadedProcess(process, find())
    )


def listen_for_children(folder: str) -> tuple[socket.socket, str]:
    """A socket in a folder on which children will be asked for, and its address."""
    listener, address = socket.socket(socket.AF_UNIX), f"{folder}/children"
    listener.bind(address)
    listener.listen()
    return listener, address


def fork_children(listener: int) -> int:
    """Fork the process that forks children, each of which starts as this process is now.

    Args:
        listener: The socket on which it is asked; it is closed here.

    Returns:
        A file; when nobody has it open any more, the process ends.
    """
    alive, kept = os.pipe()
    if os.fork():
        os.close(alive)
        os.close(listener)
        return kept
    os.close(kept)
    try:
        forkserver.main(listener, alive, [])
    finally:
        os._exit(0)


def read_mask() -> int:
    """Permissions that new files of this process do not have, read without changing them."""
    status = Path("/proc/self/status").read_text()
    return int(re.findall(r"^Umask:\s+(\d+)$", status, re.MULTILINE)[0], 8)


class _LoadedProcess(Popen):
    """A child, as whoever has started it sees it."""

    method = "spawn"

    def __init__(self, process: BaseProcess, address: str):
        self._address = address
        super().__init__(process)

    def _launch(self, process: BaseProcess) -> None:
        server: Any = forkserver._forkserver  # type: ignore[attr-defined]
        with _lock:
            # It neither belongs to this process nor ends with it.
            server.ensure_running = lambda: None
            server._forkserver_address = self._address
            server._forkserver_alive_fd = os.open(os.devnull, os.O_RDONLY)
            try:
                super()._launch(_Born(process, self))  # type: ignore[misc]
            finally:
                os.close(server._forkserver_alive_fd)


class _Born:
    """A process that, when the child reads it, makes the child what its parent is."""

    def __init__(self, process: BaseProcess, started: _LoadedProcess):
        self._process, self._started = process, started
        self._name = process.name

    def __reduce__(self) -> tuple[Any, ...]:
        standard = [self._started.duplicate_for_child(own) for own in range(3)]  # type: ignore[attr-defined]
        ignores = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        return _become, (self._process, dict(os.environ), read_mask(), ignores, standard)


def _become(
    process: BaseProcess,
    environment: dict[str, str],
    mask: int,
    ignores: bool,
    standard: Sequence[int],
) -> BaseProcess:
    handed = forkserver.get_inherited_fds()
    assert handed is not None
    for own, place in enumerate(standard):
        os.dup2(handed[place], own)
        os.close(handed[place])
    os.environ.clear()
    os.environ.update(environment)
    time.tzset()
    os.umask(mask)
    signal.signal(signal.SIGINT, signal.SIG_IGN if ignores else signal.default_int_handler)
    return process
