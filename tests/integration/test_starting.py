"""A process that was forked from a loaded one is what ``subprocess`` would have started."""

from __future__ import annotations

import json
import os
import resource
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from tests import starting
from tests.starting import ROOT
from tests.waiting import SECONDS

FACTS = """
import json, os, pathlib, resource, signal, sys, threading, time
limits = {name: resource.getrlimit(getattr(resource, name)) for name in dir(resource)
          if name.startswith("RLIMIT_")}
mask = os.umask(0o22)
files = {}
for own in pathlib.Path("/proc/self/fd").iterdir():
    if own.exists():
        files[own.name] = os.readlink(own).split(":")[0]
state = pathlib.Path("/proc/self/status").read_text().splitlines()
signals = [line for line in state if line.startswith(("SigBlk", "SigIgn", "SigCgt"))]
print(json.dumps({
    "arguments": sys.argv, "path": sys.path, "folder": os.getcwd(), "umask": mask,
    "environment": sorted(os.environ.items()), "limits": limits, "files": files,
    "signals": signals, "handler": str(signal.getsignal(signal.SIGINT)),
    "parent": os.getppid(), "leads": [os.getpgrp() == os.getpid(), os.getsid(0) == os.getpid()],
    "main": __name__, "spec": str(__spec__),
    "threads": threading.active_count(), "zone": time.tzname,
    "buffered": [sys.stdout.line_buffering, sys.stderr.line_buffering],
    "encodings": [sys.stdout.encoding, sys.stderr.errors, sys.flags.dev_mode],
    "streams": [[stream.seekable(), stream.isatty(), stream.mode, stream.newlines,
                 type(stream.buffer).__name__, stream.write_through, stream.errors]
                for stream in (sys.stdin, sys.stdout, sys.stderr)],
    "nice": os.nice(0), "processors": sorted(os.sched_getaffinity(0)),
}))
"""
WHO = "from pathlib import Path; print(Path('/proc/self/cmdline').read_text())"
ENDS = {
    "print('told'); import sys; sys.exit(3)": 3,
    "import sys; sys.exit('complaint')": 1,
    "raise ValueError('what went wrong')": 1,
    "import atexit; atexit.register(print, 'last')": 0,
    "import threading; threading.Timer(0.01, print, ['from a thread']).start()": 0,
    "import os, signal; os.kill(os.getpid(), signal.SIGTERM)": -signal.SIGTERM,
    "import os, signal; os.kill(os.getpid(), signal.SIGKILL)": -signal.SIGKILL,
    "import os, signal; os.kill(os.getpid(), signal.SIGINT)": (
        0 if signal.getsignal(signal.SIGINT) is signal.SIG_IGN else -signal.SIGINT
    ),
    "import os; os.abort()": -signal.SIGABRT,
}
"""Programs, and the exit codes that ``subprocess`` knows them by."""
FRAME = '  File "<string>", line 1, in <module>\n'
"""A fork has run one line more than a process that was started cold."""


def cold(command: list[str], **options: Any) -> subprocess.CompletedProcess[str]:
    """What a command says that the standard library starts."""
    return subprocess.run(command, capture_output=True, text=True, **options)


def of_both(*command: str, **options: Any) -> list[tuple[int, str, str]]:
    """Exit code and words of a program: forked, and started cold."""
    return [
        (done.returncode, done.stdout, done.stderr.replace(2 * FRAME, FRAME))
        for start in (starting.run, cold)
        for done in [start([sys.executable, "-c", *command], cwd=ROOT, timeout=SECONDS, **options)]
    ]


def is_forked(**options: Any) -> bool:
    """Whether a process with these options is a fork: it has the command line of what forked it."""
    said = starting.run([sys.executable, "-c", WHO], **{"cwd": ROOT, **options}).stdout
    return "wait_for_requests" in said


def used_by_children() -> float:
    """Seconds of processor time of all children that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


class TestProcess:
    @pytest.mark.parametrize("session", [False, True])
    def test_finds_itself_where_one_would_that_was_started_cold(self, session: bool) -> None:
        environment = {**os.environ, "TOUCHLINE_HOME": "/nowhere", "HOME": "/"}
        options = {"env": environment, "start_new_session": session}
        mask = os.umask(0o27 if session else 0o22)
        try:
            forked, usual = of_both(FACTS, "a b", "c", **options)
        finally:
            os.umask(mask)
        facts = json.loads(forked[1])
        assert facts == json.loads(usual[1])
        assert facts["parent"] == os.getpid()
        assert facts["leads"] == [session, session]

    def test_ends_as_one_would_that_was_started_cold(self) -> None:
        for program, code in ENDS.items():
            forked, usual = of_both(program)
            assert forked == usual, program
            assert forked[0] == code, program

    def test_is_a_fork_only_where_that_is_the_same(self, tmp_path: Path) -> None:
        assert is_forked()
        assert not is_forked(cwd=tmp_path)
        assert not is_forked(env={**os.environ, "NUMBA_DISABLE_JIT": "1"})
        assert not is_forked(preexec_fn=os.setpgrp)
        assert not is_forked(umask=0o77)

    def test_has_used_what_its_parent_is_told_of(self) -> None:
        before = used_by_children()
        burn = "import time\nwhile time.process_time() < 0.3: pass"
        assert starting.run([sys.executable, "-c", burn], cwd=ROOT).returncode == 0
        assert used_by_children() > before + 0.2


class TestNursery:
    def test_threads_that_start_their_first_processes_at_once_have_one(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made: list[object] = []

        def slowly() -> object:
            made.append(object())
            time.sleep(0.05)
            return made[-1]

        monkeypatch.setattr(starting.Process, "nursery", None)
        monkeypatch.setattr(starting, "Nursery", slowly)
        with ThreadPoolExecutor(8) as executor:
            found = [executor.submit(starting.nursery) for _ in range(8)]
        assert {one.result() for one in found} == {*made}
        assert len(made) == 1
