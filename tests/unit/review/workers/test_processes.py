"""Processes that solve."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from multiprocessing import active_children
from pathlib import Path

import pytest

from app.errors import InputError
from app.review.workers.processes import process_pool
from tests.waiting import SECONDS


class TestProcessPool:
    def test_who_stands_in_a_folder_that_they_may_not_enter_is_told_before_processes_start(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """As with sudo from somebody else's home: each process would end with a traceback."""

        def solve() -> str:
            with pytest.raises(InputError) as refused, process_pool(2):
                pass
            return f"{refused.value.message} {refused.value.hint}"

        closed = tmp_path / "closed"
        closed.mkdir()
        monkeypatch.chdir(closed)
        closed.chmod(0)
        said = as_nobody(solve)
        closed.chmod(0o700)
        assert "may not enter the folder" in said
        assert "cd /" in said

    def test_processes_end_with_the_work_that_fails_however_much_they_have_to_do(self) -> None:
        end = time.monotonic() + SECONDS
        with pytest.raises(LookupError), process_pool(1) as pool:
            pid = pool.submit(os.getpid).result()
            pool.submit(time.sleep, 3 * SECONDS)
            pool.submit(time.sleep, 3 * SECONDS)
            raise LookupError
        while pid in {child.pid for child in active_children()}:
            time.sleep(0.01)
        assert time.monotonic() < end


def as_nobody(work: Callable[[], str]) -> str:
    """What a function says in a process of somebody else than root."""
    read, write = os.pipe()
    child = os.fork()
    if not child:
        try:
            if os.getuid() == 0:
                os.setuid(65534)
            os.write(write, work().encode())
        finally:
            os._exit(0)
    os.close(write)
    with os.fdopen(read, encoding="utf-8") as said:
        found = said.read()
    os.waitpid(child, 0)
    return found
