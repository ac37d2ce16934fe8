"""Power cuts: what a disk may hold at any moment, of which only what was synced is certain.

A process that edits is recorded system call by system call. For a cut, every file gets what was
synced before it, and of what was written later any part: a disk is free to keep it or not, whole
or torn between sectors.
"""

from __future__ import annotations

import random
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from app.config import Settings
from app.errors import StorageError
from app.store.log import verify_chain
from app.store.store import Store
from tests.e2e.service import ROOT

SECTOR = 512
FILES = ("touchline.db", "touchline.db-wal", "touchline.db-journal")
CALLS = "openat,close,pwrite64,write,fsync,fdatasync,ftruncate,unlink"
ACKNOWLEDGED = b"acknowledged\n"
WRITER = """
import itertools, sys
from pathlib import Path
from app.config import Settings
from app.review.editing.edit import SetBall
from app.review.editing.submit import load, submit
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.store.dialect import sqlite
from app.store.store import Store

sqlite.PRAGMAS["synchronous"] = {"FULL": ("FULL", 2), "NORMAL": ("NORMAL", 1)}[sys.argv[3]]
store = Store.open(Settings(home=Path(sys.argv[1])))
state = load(store, 1)
view = state.stored.group.views[0].key
for number in range(int(sys.argv[2])):
    ball = BallAnnotation(box=Box(100.0 + number, 200.0, 12.0, 12.0))
    state = submit(store, 1, SetBall(view, ball), if_match=state.etag, actor="ann")
    sys.stdout.buffer.write(b"acknowledged\\n")
    sys.stdout.buffer.flush()
store.close()
"""
_CALL = re.compile(r"^\d+\s+(\w+)\((.*)\)\s+= (-?\d+|\?)")
_TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')


@dataclass(frozen=True)
class Write:
    """Bytes at a place of a file; ``data`` None cuts the file off there."""

    file: str
    offset: int
    data: bytes | None


@dataclass(frozen=True)
class Sync:
    """From here on all earlier changes of a file are certain."""

    file: str


@dataclass(frozen=True)
class Unlink:
    """A file is taken away."""

    file: str


@dataclass(frozen=True)
class Acknowledge:
    """Somebody is told that the change before is saved."""


Step = Write | Sync | Unlink | Acknowledge


@dataclass
class Report:
    """What the cuts came to; ``faults`` are sentences, none where all is well."""

    steps: int = 0
    acknowledged: int = 0
    cuts: int = 0
    faults: list[str] = field(default_factory=list)


def record(home: Path, edits: int, synchronous: str = "FULL") -> list[Step]:
    """What a process that edits does to the files of a home, which keeps its state of before.

    Raises:
        FileNotFoundError: strace is not installed.
    """
    strace = shutil.which("strace")
    if strace is None:
        raise FileNotFoundError("power cuts are recorded with strace (apt-get install strace)")
    copy = home.with_name(f"{home.name}-recorded")
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(home, copy)
    log = copy / "strace.log"
    command = [strace, "-f", "-xx", "-s", "1000000", "-e", f"trace={CALLS}", "-o", str(log)]
    command += [sys.executable, "-c", WRITER, str(copy), str(edits), synchronous]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    steps = list(parse(log.read_text().splitlines(), copy))
    shutil.rmtree(copy)
    return steps


def parse(lines: Sequence[str], home: Path) -> Iterator[Step]:
    """The steps of a recording that touch the database of a home, or tell of a change."""
    open_files: dict[str, str] = {}
    for line in lines:
        match = _CALL.match(line)
        if match is None or match[3].startswith("-"):
            continue
        call, arguments, result = match[1], match[2], match[3]
        texts = [bytes.fromhex(item.replace("\\x", "")) for item in _TEXT.findall(arguments)]
        number = arguments.partition(",")[0]
        if call == "openat":
            path = Path(texts[0].decode())
            open_files.pop(result, None)
            if path.parent == home and path.name in FILES:
                open_files[result] = path.name
        elif call == "unlink":
            path = Path(texts[0].decode())
            if path.parent == home and path.name in FILES:
                yield Unlink(path.name)
        elif call == "write" and number == "1" and texts == [ACKNOWLEDGED]:
            yield Acknowledge()
        elif (file := open_files.get(number)) is None:
            continue
        elif call == "close":
            del open_files[number]
        elif call == "pwrite64":
            yield Write(file, int(arguments.rpartition(",")[2]), texts[0])
        elif call == "ftruncate":
            yield Write(file, int(arguments.rpartition(",")[2]), None)
        elif call in ("fsync", "fdatasync"):
            yield Sync(file)
        else:
            raise ValueError(f"{call} of {file} is not understood")


def disk_at(
    base: dict[str, bytes], steps: Sequence[Step], cut: int, chance: random.Random
) -> dict[str, bytes]:
    """What the files may hold when power fails before a step."""
    certain = {step.file: place for place, step in enumerate(steps[:cut]) if isinstance(step, Sync)}
    files = {name: bytearray(content) for name, content in base.items()}
    for place, step in enumerate(steps[:cut]):
        if isinstance(step, (Sync, Acknowledge)):
            continue
        if place < certain.get(step.file, -1):
            _apply(files, step)
        elif chance.random() < 0.5:
            _apply(files, _torn(step, chance) if chance.random() < 0.3 else step)
    return {name: bytes(content) for name, content in files.items()}


def _apply(files: dict[str, bytearray], step: Write | Unlink) -> None:
    if isinstance(step, Unlink):
        files.pop(step.file, None)
        return
    content = files.setdefault(step.file, bytearray())
    if step.data is None:
        del content[step.offset :]
        return
    content.extend(bytes(max(0, step.offset - len(content))))
    content[step.offset : step.offset + len(step.data)] = step.data


def _torn(step: Write | Unlink, chance: random.Random) -> Write | Unlink:
    """A write of which only the first sectors arrived."""
    if isinstance(step, Unlink) or step.data is None or len(step.data) <= SECTOR:
        return step
    sectors = chance.randrange(1, len(step.data) // SECTOR + 1)
    return Write(step.file, step.offset, step.data[: sectors * SECTOR])


def cut_power(home: Path, folder: Path, steps: Sequence[Step], *, cuts: int, seed: int) -> Report:
    """Cut the power at that many moments, and see what is there afterwards.

    Every change that was acknowledged before must be in the log, at most one more, and the chain
    of the log and the file must be whole.
    """
    chance = random.Random(seed)
    base = {name: (home / name).read_bytes() for name in FILES if (home / name).exists()}
    report = Report(steps=len(steps))
    report.acknowledged = sum(isinstance(step, Acknowledge) for step in steps)
    before = _entries(folder, base)
    for _ in range(cuts):
        cut = chance.randrange(len(steps) + 1)
        told = sum(isinstance(step, Acknowledge) for step in steps[:cut])
        place = f"before step {cut}, after {told} acknowledged changes"
        try:
            found = _entries(folder, disk_at(base, steps, cut, chance)) - before
        except StorageError as error:
            report.faults.append(f"{place}: {error}")
        else:
            if not told <= found <= told + 1:
                report.faults.append(f"{place}: {found} are there")
        report.cuts += 1
    return report


def _entries(folder: Path, files: dict[str, bytes]) -> int:
    """Length of the log in these files, whose chain is whole."""
    home = folder / "after"
    shutil.rmtree(home, ignore_errors=True)
    home.mkdir(parents=True)
    for name, content in files.items():
        (home / name).write_bytes(content)
    store = Store.open(Settings(home=home))
    try:
        with store.read() as session:
            return verify_chain(session)
    finally:
        store.close()
