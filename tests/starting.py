"""Processes that start loaded: forked from one that has imported the product, instead of anew.

Most of what a server or a command of a test costs is imports. One process beside each test process
has done them, and forks at every request; the fork becomes a child of the test process (``wait``,
signals, exit codes and usage are as of any other) with the files, folder, environment and
arguments that it is given, and runs its program in ``__main__``, from the first line to the exit.

What a fork could not show is started cold: other programs than ``python -c``, other folders, and
environments that a library would have read differently (all but TOUCHLINE_... and a few).
Cold besides are all tests that call ``subprocess``: of the installation, of how a server stops, of
completion, of events, of interrupted work, and what changes a module before another loads it.
"""

from __future__ import annotations

import ctypes
import gc
import importlib
import io
import json
import os
import pkgutil
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any, ClassVar

from tests.spawning import fork_children, listen_for_children, read_mask, start_loaded
from tests.waiting import SECONDS

ROOT = Path(__file__).resolve().parents[1]
FREE = ("TOUCHLINE_", "PYTEST_", "XDG_", "HOME")
"""Beginnings of names of the environment that are read when something is asked, not when loaded."""
MOST = 2**18
"""Bytes of a request: program, arguments and environment."""
_SUBREAPER = 36
"""PR_SET_CHILD_SUBREAPER: who is it becomes the parent of its children's orphans."""
_one_nursery = threading.Lock()


class Process(subprocess.Popen[Any]):
    """A process as ``subprocess`` starts it, but loaded where that is the same."""

    nursery: ClassVar[Nursery | None] = None

    # The one place where the standard library makes the process.
    def _execute_child(self, args: Any, *rest: Any) -> None:
        executable, before, _, passed, folder, environment, _, _, shell, *others = rest
        ends, (_, *who, mask, session, group) = others[:6], others[6:]
        asked_more = (executable, before, passed, shell, *who, mask, group)
        usual = (None, None, (), False, None, None, None, -1, -1)
        if asked_more != usual or not _is_same(args, folder, environment):
            super()._execute_child(args, *rest)  # type: ignore[misc]
            return
        asked = {
            "program": args[2],
            "arguments": args[3:],
            "environment": dict(os.environ if environment is None else environment),
            "session": session,
            "mask": read_mask(),
        }
        read, _, _, told, _, complained = ends
        standard = [own if end == -1 else end for own, end in enumerate((read, told, complained))]
        self.pid = nursery().bear(asked, standard)
        self._child_created = True
        self._close_pipe_fds(*ends)  # type: ignore[attr-defined]


def run(
    command: list[str], *, timeout: float | None = None, **options: Any
) -> subprocess.CompletedProcess[str]:
    """What a command said, as ``subprocess.run`` with captured text."""
    pipe = subprocess.PIPE
    with Process(command, stdout=pipe, stderr=pipe, text=True, **options) as process:
        try:
            said, complained = process.communicate(timeout=timeout)
        except BaseException:
            process.kill()
            raise
    return subprocess.CompletedProcess(command, process.returncode, said, complained)


def end_nursery() -> None:
    """End the process that forks, if there is one."""
    if Process.nursery is not None:
        Process.nursery.end()
        Process.nursery = None


def _is_same(args: Any, folder: Any, environment: Any) -> bool:
    """Whether a fork is what ``subprocess`` would start."""
    if sys.platform != "linux" or isinstance(args, str) or args[:2] != [sys.executable, "-c"]:
        return False
    if Path(folder or ".").resolve() != ROOT:
        return False
    return _bound(os.environ) == _bound(os.environ if environment is None else environment)


def _bound(environment: Any) -> dict[str, str]:
    return {name: text for name, text in environment.items() if not name.startswith(FREE)}


def nursery() -> Nursery:
    """The process that forks for this one; the first thread that asks starts it."""
    with _one_nursery:
        if Process.nursery is None:
            Process.nursery = Nursery()
        return Process.nursery


class Nursery:
    """The process that has loaded the product, and forks when it is asked to."""

    def __init__(self) -> None:
        self._line, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._line.settimeout(SECONDS)
        program = "from tests.starting import wait_for_requests; exec(wait_for_requests())"
        self._folder = tempfile.mkdtemp(prefix="touchline-")
        listener, self.children = listen_for_children(self._folder)
        with far, listener:
            files = far.fileno(), listener.fileno()
            self._process = subprocess.Popen(
                [sys.executable, "-c", program, *map(str, files), self.children],
                cwd=ROOT,
                # Threads would not live on in a fork.
                env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
                pass_fds=files,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )

    def bear(self, asked: dict[str, Any], standard: list[int]) -> int:
        """Number of a process, a child of this one, with these standard files."""
        _adopt(True)
        try:
            socket.send_fds(self._line, [json.dumps(asked).encode()], standard)
            number, born = self._line.recv(32), self._line.recv(32)
        finally:
            _adopt(False)
        if not born:
            raise OSError("the process that forks has ended")
        return int(number)

    def end(self) -> None:
        """End it; what it has borne lives on."""
        self._line.close()
        try:
            self._process.wait(SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder)


def _adopt(orphans: bool) -> None:
    if ctypes.CDLL(None, use_errno=True).prctl(_SUBREAPER, int(orphans), 0, 0, 0):
        raise OSError(ctypes.get_errno(), "no process can be adopted")


def wait_for_requests() -> str:
    """Fork for every request, and return the program that is to be run, in the fork."""
    line = socket.socket(fileno=int(sys.argv[1]))
    # Ctrl+C reaches every process of a terminal; this one ends with its parent.
    interrupted = signal.signal(signal.SIGINT, signal.SIG_IGN)
    _load()
    needed, address = fork_children(int(sys.argv[2])), sys.argv[3]
    while True:
        message, files, _, _ = socket.recv_fds(line, MOST, 3)
        if not message:
            sys.exit()
        between = os.fork()
        if not between:
            _leave_behind(line)
            os.close(needed)
            asked = json.loads(message)
            if not asked["session"]:
                # Children of one that leads a session would have to belong to it, too.
                start_loaded(lambda: address)
            program = _become(asked, files)
            # Whoever was started in the background of a script ignores it, and so do its children.
            signal.signal(signal.SIGINT, interrupted)
            line.send(b"born")
            line.close()
            return program
        os.waitpid(between, 0)
        for file in files:
            os.close(file)


def _load() -> None:
    """Import all of the product, with the kernels."""
    import app

    # To look through what stays, again and again, is a fifth of it.
    gc.disable()
    for module in pkgutil.walk_packages(app.__path__, "app."):
        importlib.import_module(module.name)
    from app.solving.solve import warm_up_solver

    warm_up_solver()
    gc.collect()
    gc.freeze()
    gc.enable()
    threads = list(Path("/proc/self/task").iterdir())
    if len(threads) != 1:
        raise RuntimeError(f"{len(threads)} threads would not live on in a fork")


def _leave_behind(line: socket.socket) -> None:
    """Fork once more and end, so that the fork is an orphan, whom the test process adopts."""
    own = os.getpid()
    child = os.fork()
    if child:
        line.send(str(child).encode())
        os._exit(0)
    while os.getppid() == own:
        time.sleep(0.001)


def _become(asked: dict[str, Any], files: list[int]) -> str:
    """Make this fork the process that was asked for; its program."""
    for own, (name, file) in enumerate(zip(("stdin", "stdout", "stderr"), files, strict=True)):
        os.dup2(file, own)
        os.close(file)
        # Anew: what was opened over another file believes that this one is of its kind.
        setattr(sys, name, _opened(own, getattr(sys, name)))
        setattr(sys, f"__{name}__", getattr(sys, name))
    if asked["session"]:
        os.setsid()
    os.umask(asked["mask"])
    os.environ.clear()
    os.environ.update(asked["environment"])
    time.tzset()
    sys.argv = ["-c", *asked["arguments"]]
    return str(asked["program"])


def _opened(number: int, before: io.TextIOWrapper) -> io.TextIOWrapper:
    """A standard file as the interpreter opens it."""
    mode = "wb" if number else "rb"
    opened = io.TextIOWrapper(
        os.fdopen(number, mode, 0 if before.write_through and number else -1, closefd=False),
        encoding=before.encoding,
        errors=before.errors,
        newline="\n" if number else None,
        line_buffering=before.line_buffering,
        write_through=before.write_through,
    )
    opened.mode = mode[0]  # type: ignore[misc]
    return opened
