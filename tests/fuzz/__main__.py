"""``make fuzz``: files of every kind, damaged at random, for some minutes; 1 where a reader fails.

What is found is made small and kept in ``tests/security/corpus/files``, where a test replays it.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path

from tests.fuzz.case import Case
from tests.fuzz.damage import damage
from tests.fuzz.readers import KINDS, Fault, Readers
from tests.fuzz.seeds import seeds
from tests.fuzz.shrink import shrink

CORPUS = Path(__file__).parents[1] / "security" / "corpus" / "files"
USED = 8
"""One case in so many is solved and written in every format, which takes longest."""
CRASHED = "the process ended"
STUCK = "the process did not end"
KILLED = -1000
"""Stands for the status of a process that did not end."""
PROGRAM = (sys.executable, "-m", "tests.fuzz")
GRACE = 60.0
"""Seconds that a process may take beyond its time: it makes small what it found last."""


def main() -> int:
    """Run until the time is over; 1 where anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=600, help="for how long in all (600)")
    parser.add_argument("--kind", action="append", choices=KINDS, help="these alone")
    parser.add_argument("--seed", type=int, default=None, help="default: another one every time")
    parser.add_argument("--under-way", type=Path, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.is_in_progress is not None:
        return _work(asked)
    seed = int(time.time()) if asked.seed is None else asked.seed
    return supervise(asked.seconds, asked.kind or [], seed)


def supervise(
    seconds: float,
    kinds: list[str],
    seed: int,
    program: tuple[str, ...] = PROGRAM,
    grace: float = GRACE,
) -> int:
    """Let a process work; one that crashes or sticks leaves its case, and another goes on."""
    ends, found, tried = time.monotonic() + seconds, 0, Counter[str]()
    chosen = [argument for kind in kinds for argument in ("--kind", kind)]
    with tempfile.TemporaryDirectory(prefix="touchline-fuzz-") as name:
        while (left := ends - time.monotonic()) > 0:
            under_way = Path(name, "case.json")
            # What a process leaves is of its own, not of the one before.
            under_way.unlink(missing_ok=True)
            command = [*program, "--under-way", str(under_way)]
            command += ["--seconds", str(left), "--seed", str(seed), *chosen]
            done = _run(command, left + grace)
            *faults, last = done.stdout.splitlines() or [""]
            print("\n".join(faults), end="\n" if faults else "")
            told = json.loads(last) if done.returncode == 0 else {}
            tried.update(told.get("tried", {}))
            found += told.get("found", 0)
            if done.returncode != 0:
                found += 1
                if not under_way.exists():
                    print(done.stderr)
                    return 1
                what = f"{CRASHED} ({done.returncode})" if done.returncode != KILLED else STUCK
                print(f"FAULT {what}\n{done.stderr[-2000:]}")
                _keep(replace(Case.of(under_way.read_text()), found=what))
                seed += 1
    for kind, count in sorted(tried.items()):
        print(f"{kind:20} {count:8,} files")
    print(f"{sum(tried.values()):,} damaged files, {found} faults (seed {seed})")
    return 1 if found else 0


def _run(command: list[str], seconds: float) -> subprocess.CompletedProcess[str]:
    """Run a process, for so long at most; it is killed then."""
    # Libraries complain about pictures and videos on stderr, whatever they are told.
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    status: int | None = None
    try:
        told = process.communicate(timeout=seconds)
        status = process.returncode
    except subprocess.TimeoutExpired:
        status = KILLED
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            told = process.communicate()
    return subprocess.CompletedProcess(command, status, *told)


def _work(asked: argparse.Namespace) -> int:
    """One process's part; its last line says what it tried and found."""
    ends, dice = time.monotonic() + asked.seconds, random.Random(asked.seed)
    sound = [case for case in seeds() if not asked.kind or case.kind in asked.kind]
    tried, known = Counter[str](), set[str]()
    with tempfile.TemporaryDirectory(prefix="touchline-fuzz-") as name:
        readers = Readers(Path(name, "home"))
        for case in sound:
            _require_sound(readers, case)
        while time.monotonic() < ends:
            case = damage(dice.choice(sound), dice)
            asked.is_in_progress.write_text(case.text())
            whole = dice.randrange(USED) == 0
            fault = readers.try_out(case, whole=whole)
            tried[case.kind] += 1
            if fault is not None and fault.place not in known:
                known.add(fault.place)
                _tell(readers, case, fault)
        readers.close()
    print(json.dumps({"tried": tried, "found": len(known)}))
    return 0


def _require_sound(readers: Readers, case: Case) -> None:
    fault = readers.try_out(case)
    if fault is not None:
        raise AssertionError(f"{case.kind} is not even read as it should be: {fault.told}")


def _tell(readers: Readers, case: Case, fault: Fault) -> None:
    print(f"FAULT {case.kind}: {fault.place}\n{fault.told}", flush=True)

    def fails(smaller: Case) -> bool:
        found = readers.try_out(smaller)
        return found is not None and found.place == fault.place

    _keep(replace(shrink(case, fails), found=fault.place))


def _keep(case: Case) -> None:
    CORPUS.mkdir(parents=True, exist_ok=True)
    (CORPUS / case.name).write_text(case.text())


if __name__ == "__main__":
    sys.exit(main())
