"""A child that was forked from a loaded process is what ``multiprocessing`` would have started."""

from __future__ import annotations

import os
import signal
import sys
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any

import pytest

from tests.spawning import ANEW, read_mask
from tests.waiting import SECONDS

SPAWN = get_context("spawn")
OF_READLINE = ("LINES", "COLUMNS")
"""What that library tells programs that a process starts, and not the process."""
ENDS = {"exit": 3, "SIGKILL": -signal.SIGKILL, "SIGABRT": -signal.SIGABRT, "error": 1}


def tell(line: Connection) -> None:
    """What a child is, as far as the product may ask."""
    standard = [str(Path(f"/proc/self/fd/{own}").readlink()) for own in range(3)]
    line.send(
        {
            "environment": {
                name: os.environ[name] for name in os.environ if name not in OF_READLINE
            },
            "folder": str(Path.cwd()),
            "mask": read_mask(),
            "standard": standard,
            "interrupt": str(signal.getsignal(signal.SIGINT)),
            "files": len(list(Path("/proc/self/fd").iterdir())),
        }
    )


def end(how: str) -> None:
    """End in some way."""
    if how == "exit":
        sys.exit(3)
    if how == "error":
        raise ValueError("what went wrong")
    os.kill(os.getpid(), getattr(signal, how))


def loaded(line: Connection) -> None:
    """How many modules of the product are there before anything is asked for."""
    line.send(sum(name.startswith("app.") for name in sys.modules))


def heard(work: Any) -> Any:
    """What a child says."""
    own, far = SPAWN.Pipe(duplex=False)
    child = SPAWN.Process(target=work, args=(far,))
    child.start()
    far.close()
    assert own.poll(SECONDS)
    said = own.recv()
    child.join(SECONDS)
    assert child.exitcode == 0
    return said


@pytest.fixture
def anew(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Runs something with children as the standard library starts them."""

    def run(work: Any) -> Any:
        with monkeypatch.context() as patch:
            patch.setattr(SpawnProcess, "_Popen", staticmethod(ANEW))
            return heard(work)

    return run


@pytest.mark.skipif(sys.platform != "linux", reason="children are forked on Linux alone")
class TestLoaded:
    def test_it_has_the_product_before_it_is_asked_for_anything(self, anew) -> None:
        assert anew(loaded) == 0
        assert heard(loaded) > 100

    def test_it_is_where_and_what_its_parent_is(self, anew, monkeypatch, tmp_path) -> None:
        monkeypatch.setenv("TOUCHLINE_HOME", "of this test")
        monkeypatch.chdir(tmp_path)
        before = os.umask(0o027)
        try:
            forked, started = heard(tell), anew(tell)
        finally:
            os.umask(before)
        # The library's own server of forks hands on two lines of its own.
        assert forked.pop("files") <= started.pop("files") + 2
        assert forked == started

    @pytest.mark.parametrize("how", ENDS)
    def test_its_end_is_told(self, how) -> None:
        child = SPAWN.Process(target=end, args=(how,))
        child.start()
        child.join(SECONDS)
        assert child.exitcode == ENDS[how]
