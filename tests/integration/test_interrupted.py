"""Commands that Ctrl+C ends: soon, with what is done kept, and without a word too many."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from tests import starting
from tests.databases import count_rows
from tests.integration.conftest import COMMAND, environment
from tests.waiting import SECONDS

GROUPS = 60


def solved(home: Path) -> int:
    return count_rows(home, "solution")["solution"]


def test_solve_keeps_what_is_done_and_goes_on_from_there(tmp_path: Path) -> None:
    home = tmp_path / "home"

    def command(*words: str) -> list[str]:
        return [sys.executable, "-c", COMMAND, *words]

    def run(*words: str) -> None:
        done = starting.run(command(*words), env=environment(home))
        assert done.returncode == 0, done.stderr

    tree = tmp_path / "tree"
    run("sample", str(tree), "--groups", str(GROUPS), "--labels-only", "--workers", "1")
    run("import", "soccernet-v3", str(tree), "--dataset", "demo")
    # A terminal tells every process of the foreground.
    solving = subprocess.Popen(
        command("solve", "--dataset", "demo", "--workers", "2"),
        env=environment(home), stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    end = time.monotonic() + SECONDS
    while not solved(home) and time.monotonic() < end:
        time.sleep(0.01)
    os.killpg(solving.pid, signal.SIGINT)
    _, told = solving.communicate(timeout=SECONDS)
    kept = solved(home)
    assert (solving.returncode, 0 < kept < GROUPS) == (130, True), told
    *progress, last = told.splitlines()
    assert last == f"stopped; {kept} solved groups are stored, {GROUPS - kept} are left to do"
    assert all(line.startswith("Solving: ") for line in progress), told
    run("solve", "--dataset", "demo", "--workers", "1")
    assert solved(home) == GROUPS
