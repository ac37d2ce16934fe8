"""Computed values to JSON and back, read by several threads."""

from __future__ import annotations

import subprocess
import sys

FIRST_READ = """
import sys
from dataclasses import make_dataclass
from threading import Barrier, Thread

sys.setswitchinterval(1e-6)
from app.features.solutions.codec import from_json

for _ in range(400):
    inner = make_dataclass("Inner", [(f"x{place}", float) for place in range(10)])
    outer = make_dataclass("Outer", [(f"part{place}", inner) for place in range(10)])
    value = {f"part{place}": {f"x{x}": 1.0 for x in range(10)} for place in range(10)}
    together = Barrier(4)

    def read():
        together.wait()
        assert from_json(outer, value).part9.x9 == 1.0

    readers = [Thread(target=read) for _ in range(4)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join()
print("all read")
"""
"""In a process of its own: where threads meet in what the library has not finished, it dies."""


def test_threads_that_read_a_type_for_the_first_time_do_not_meet_in_it() -> None:
    done = subprocess.run([sys.executable, "-c", FIRST_READ], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "all read\n"), done.stderr[-2000:]
