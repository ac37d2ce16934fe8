"""The big jobs on a dataset of SoccerNet-v3's size: import, solve, freeze, verify, exports.

Prints seconds, seconds of the processor (all processes of the command) and milliseconds of it a group,
the most memory that they held at once, and what each may take of all of SoccerNet-v3; and what a
group takes of the disk, imported and solved.
``python -m tests.bench.big [GROUPS ...]``; 12,764 groups take ten minutes.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import get_args

import psutil

from app.soccer.choices import ExportFormat
from tests.bench.table import print_table
from tests.e2e.service import ROOT, SERVE

HEAD = ("what", "s", "processor, s", "a group, ms", "MB", "at most")
GROUPS = (3000, 12_764)
"""A quarter of SoccerNet-v3, and all of it."""
LOOK_S = 0.5
FORMATS = tuple(
    name for name in get_args(ExportFormat) if name not in ("issia", "issia-3d", "touchline")
)
"""What holds the groups of SoccerNet; ISSIA's has no place for their frames."""
TARGETS_S = {
    "import": 40,
    "solve": 180,
    "solve with a new tau": 15,
    "freeze": 15,
    **{f"export {name}": 30 for name in (*FORMATS, "touchline")},
    "verify": 180,
}
"""What each may take of 12,764 groups on two cores that do nothing else."""
TARGET_MB = 600


@dataclass(frozen=True)
class Cost:
    """What a command took."""

    seconds: float
    processor: float
    megabytes: float


def bench_big(*sizes: int) -> None:
    """Measure and print."""
    for groups in sizes or GROUPS:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _touchline(folder, f"sample --groups {groups} --labels-only {folder / 'tree'}")
            print_table(f"{groups:,} groups, at most {TARGET_MB} MB", HEAD, [])
            measure(folder, folder / "tree", groups)


def measure(folder: Path, tree: Path, groups: int) -> None:
    """Import a tree into a home of its own, run everything on it, and print a line for each."""
    tau = folder / "tau.yaml"
    for what, line in (
        ("import", f"import soccernet-v3 {tree} --dataset full"),
        ("solve", "solve --dataset full"),
        ("import again", f"import soccernet-v3 {tree} --dataset full"),
        ("policy", f"policy show {tau} --dataset full"),
        ("solve with a new tau", f"solve --dataset full --policy {tau}"),
        ("freeze", "freeze v1 --dataset full --groups passing"),
        *(
            (
                f"export {name}",
                f"export {folder / name}.zip --format {name} --dataset full --version v1",
            )
            for name in FORMATS
        ),
        ("export touchline", f"export {folder / 'carry'}.zip --format touchline --dataset full"),
        ("verify", "verify v1 --dataset full"),
    ):
        cost = _touchline(folder, line)
        print(line_of(what, cost, groups), flush=True)
        if what == "policy":
            _change_tau(tau)
        if what in ("import", "solve"):
            print(f"{'bytes of a group':22}{_bytes(folder / 'home') / groups:8,.0f}", flush=True)


def line_of(what: str, cost: Cost, groups: int) -> str:
    """A command's line of the table."""
    each = 1000 * cost.processor / groups
    target = f"{TARGETS_S[what]:7} s" if what in TARGETS_S else ""
    return (
        f"{what:22}{cost.seconds:8.1f}{cost.processor:8.1f}{each:8.2f}{cost.megabytes:6.0f}{target}"
    )


def _bytes(home: Path) -> int:
    """Of all files of a home."""
    return sum(file.stat().st_size for file in home.rglob("*") if file.is_file())


def _change_tau(file: Path) -> None:
    text = re.sub(r"(?m)^tau_percent: [^ ]*", "tau_percent: 0.6", file.read_text())
    file.write_text(re.sub(r"(?m)^name: .*", "name: mine", text))


def _touchline(home: Path, line: str) -> Cost:
    """Run a command; what its processes take together."""
    before = os.times()
    start, most = time.perf_counter(), 0.0
    with subprocess.Popen(
        [sys.executable, "-c", SERVE, *line.split()],
        cwd=ROOT,
        env={**os.environ, "TOUCHLINE_HOME": str(home / "home")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    ) as process:
        while process.poll() is None:
            most = max(most, _memory(process.pid))
            time.sleep(LOOK_S)
        said = process.stderr.read().decode() if process.stderr else ""
    if process.returncode:
        raise SystemExit(f"{line}: {said}")
    after = os.times()
    spent = after.children_user + after.children_system
    spent -= before.children_user + before.children_system
    return Cost(time.perf_counter() - start, spent, most / 1e6)


def _memory(pid: int) -> float:
    """Bytes of a process and those below it; what they share counts once."""
    total = 0.0
    try:
        root = psutil.Process(pid)
        for process in (root, *root.children(recursive=True)):
            total += process.memory_full_info().pss
    except psutil.Error:
        pass
    return total


if __name__ == "__main__":
    bench_big(*(int(groups) for groups in sys.argv[1:]))
