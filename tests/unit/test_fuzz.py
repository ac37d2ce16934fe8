"""``make fuzz`` itself: what sticks or crashes is a fault, and neither keeps it from ending."""

from __future__ import annotations

import io
import random
import sys
import time
from pathlib import Path

import pyarrow
import pytest
from pyarrow import parquet

import tests.fuzz.__main__ as fuzz
from tests.fuzz import readers
from tests.fuzz.case import Case
from tests.fuzz.damage import damage
from tests.waiting import SECONDS

LEAVES = """
import sys, time
words = sys.argv
open(words[words.index("--under-way") + 1], "w").write({text!r})
{then}
"""


@pytest.fixture
def corpus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(fuzz, "CORPUS", tmp_path / "corpus")
    return tmp_path / "corpus"


@pytest.mark.parametrize(
    ("then", "what", "grace"),
    [
        # Time enough to begin, on a machine that does much else.
        ("time.sleep(600)", fuzz.STUCK, 2.0),
        ("time.sleep(0.4); sys.exit(3)", f"{fuzz.CRASHED} (3)", SECONDS),
    ],
    ids=["sticks", "crashes"],
)
def test_a_process_that_does_not_come_back_leaves_its_case(
    corpus: Path, then: str, what: str, grace: float
) -> None:
    text = Case("text", {"a": b"b"}).text()
    program = (sys.executable, "-ISc", LEAVES.format(text=text, then=then))
    start = time.monotonic()
    assert fuzz.supervise(0.3, [], 1, program, grace) == 1
    assert time.monotonic() - start < 300
    assert [Case.of(path.read_text()).found for path in corpus.iterdir()] == [what]


def test_a_process_that_fails_before_its_first_case_ends_the_run(corpus: Path) -> None:
    program = (sys.executable, "-ISc", "import sys; sys.exit(3)")
    assert fuzz.supervise(60, [], 1, program) == 1
    assert not corpus.exists()


def test_a_case_that_waits_for_ever_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readers, "CLOCK_SECONDS", 0.05)
    with pytest.raises(readers.TooSlowError, match=r"0\.05 seconds$"), readers._bounded():
        time.sleep(10)


def test_the_case_of_one_process_is_not_taken_for_the_next_one_s(corpus: Path) -> None:
    then = "open(words[2] + '.seen', 'x')\nsys.exit(3)"
    first = LEAVES.format(text=Case("text", {"a": b"b"}).text(), then=then)
    again = "import os, sys\nwords = sys.argv\nif os.path.exists(words[2] + '.seen'): sys.exit(4)\n"
    start = time.monotonic()
    assert fuzz.supervise(300, [], 1, (sys.executable, "-ISc", again + first)) == 1
    assert time.monotonic() - start < 150
    assert len(list(corpus.iterdir())) == 1


def test_a_parquet_file_whose_text_is_none_is_damaged_further() -> None:
    words = pyarrow.StringArray.from_buffers(
        1, pyarrow.py_buffer(b"\0\0\0\0\1\0\0\0"), pyarrow.py_buffer(b"\xff")
    )
    out = io.BytesIO()
    parquet.write_table(pyarrow.table({"word": words}), out)
    case = Case("parquet", {"a.parquet": out.getvalue()})
    found = {damage(case, random.Random(seed)).text() for seed in range(40)}
    assert len(found) > 20
