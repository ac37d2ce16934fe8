"""Recording: what a process that edits and uploads does to the files of a home, call by call.

A file or folder is called by the first path that it had in the home, whatever it is called later.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.e2e.service import ROOT

CALLS = "openat,close,pwrite64,write,fsync,fdatasync,ftruncate,unlink,mkdir,rename"
ACKNOWLEDGED = b"acknowledged "
SHARED_MEMORY = "touchline.db-shm"
"""Written as memory, and made again by whoever opens the database."""
WRITER = """
import sys
from pathlib import Path
from app.config import Settings
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.db.dialects import sqlite
from app.db.store import Store
from app.features.imports.upload_queries import UploadWriter

def acknowledge(upload=""):
    sys.stdout.buffer.write(f"acknowledged {upload}\\n".encode())
    sys.stdout.buffer.flush()

sqlite.PRAGMAS["synchronous"] = {"FULL": ("FULL", 2), "NORMAL": ("NORMAL", 1)}[sys.argv[3]]
settings = Settings(home=Path(sys.argv[1]))
store = Store.open(settings)
state = load_group_state(store, 1)
view = state.stored.group.views[0].key
for number in range(int(sys.argv[2])):
    ball = BallAnnotation(box=Box(100.0 + number, 200.0, 12.0, 12.0))
    state = submit_edit(store, 1, make_set_ball_edit(view, ball), if_match=state.etag, actor="ann")
    acknowledge()
    writer = UploadWriter(settings, f"{number}.csv", by="ann")
    writer.write(b"x,y,w,h\\n" * 200)
    acknowledge(writer.finish().id)
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
class Name:
    """A file or folder is called so in its folder, instead of what was; None: nothing is."""

    file: str
    name: str | None


@dataclass(frozen=True)
class Sync:
    """From here on all earlier changes of a file, or of the names in a folder, are certain."""

    file: str


@dataclass(frozen=True)
class Acknowledge:
    """Somebody is told that the change before, or an upload of that id, is saved."""

    upload: str = ""


Step = Write | Name | Sync | Acknowledge


def record(home: Path, edits: int, synchronous: str = "FULL", plant: str = "") -> list[Step]:
    """What a process does to the files of a home, which keeps its state of before.

    Args:
        home: The home.
        edits: How many changes are made, and files uploaded.
        synchronous: What SQLite promises of them.
        plant: Python that the process runs first, to plant a fault.

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
    command += [sys.executable, "-c", f"{plant}\n{WRITER}", str(copy), str(edits), synchronous]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    steps = list(parse(log.read_text().splitlines(), copy))
    shutil.rmtree(copy)
    return steps


def parse(lines: Sequence[str], home: Path) -> Iterator[Step]:
    """The steps of a recording that touch what lies in a home, or tell of a change."""
    recording = _Recording(home)
    for line in lines:
        match = _CALL.match(line)
        if match is None or match[3].startswith("-"):
            continue
        texts = [bytes.fromhex(item.replace("\\x", "")) for item in _TEXT.findall(match[2])]
        yield from recording.steps(match[1], match[2], texts, match[3])


def folder_of(file: str) -> str:
    """The folder that a file lies in, by its own first path; the home's is a dot."""
    return str(Path(file).parent)


class _Recording:
    """What is called how, and open under which number, as a recording is read."""

    def __init__(self, home: Path):
        self._home = home
        self._open: dict[str, str] = {}
        self._ends: dict[str, int] = {}
        """Where the next plain write of an open file goes."""
        self._called: dict[tuple[str, str], str | None] = {}
        self._known: set[str] = set()
        self._read: dict[str, Callable[[str, list[bytes], str], Iterator[Step]]] = {
            "openat": self._opened,
            "mkdir": lambda _, texts, __: self._made(texts[0]),
            "unlink": lambda _, texts, __: self._renamed(texts[0], None),
            "rename": lambda _, texts, __: self._renamed(*texts),
        }

    def steps(self, call: str, arguments: str, texts: list[bytes], result: str) -> Iterator[Step]:
        """What one call comes to."""
        number = arguments.partition(",")[0]
        if call in self._read:
            yield from self._read[call](arguments, texts, result)
        elif call == "write" and number == "1" and texts[0].startswith(ACKNOWLEDGED):
            yield Acknowledge(texts[0].removeprefix(ACKNOWLEDGED).decode().strip())
        elif call == "close":
            self._open.pop(number, None)
        elif number in self._open:
            yield from self._changed(call, number, arguments, texts)

    def _changed(
        self, call: str, number: str, arguments: str, texts: list[bytes]
    ) -> Iterator[Step]:
        file = self._open[number]
        if call == "pwrite64":
            yield Write(file, int(arguments.rpartition(",")[2]), texts[0])
        elif call == "write":
            yield Write(file, self._ends[number], texts[0])
            self._ends[number] += len(texts[0])
        elif call == "ftruncate":
            yield Write(file, int(arguments.rpartition(",")[2]), None)
        else:
            yield Sync(file)

    def _opened(self, arguments: str, texts: list[bytes], number: str) -> Iterator[Step]:
        self._open.pop(number, None)
        place = self._place(texts[0])
        if place is None:
            return
        if "O_CREAT" in arguments and self._called.get(place) is None:
            yield from self._made(texts[0])
        self._open[number], self._ends[number] = self._file(*place), 0
        if "O_TRUNC" in arguments:
            yield Write(self._open[number], 0, None)

    def _made(self, path: bytes) -> Iterator[Step]:
        """A file or folder is there under a name, by itself where it is not new."""
        place = self._place(path)
        if place is None:
            return
        file, number = str(Path(*place)), 1
        while file in self._known:
            file, number = f"{Path(*place)}#{number}", number + 1
        self._known.add(file)
        self._called[place] = file
        yield Name(file, place[1])

    def _renamed(self, path: bytes, to: bytes | None) -> Iterator[Step]:
        place, new = self._place(path), None if to is None else self._place(to)
        if place is None:
            return
        file = self._file(*place)
        # What gets its name afterwards is another file.
        self._known.add(file)
        self._called[place] = None
        if new is None:
            yield Name(file, None)
            return
        if new[0] != place[0]:
            raise ValueError("what is moved into another folder is not understood")
        self._called[new] = file
        yield Name(file, new[1])

    def _place(self, path: bytes) -> tuple[str, str] | None:
        """Folder and name of a path in the home; None: it lies elsewhere."""
        found = Path(path.decode())
        if not found.is_relative_to(self._home) or found.name == SHARED_MEMORY:
            return None
        *parents, name = found.relative_to(self._home).parts or ("",)
        folder = "."
        for parent in parents:
            folder = self._file(folder, parent)
        return folder, name

    def _file(self, folder: str, name: str) -> str:
        """What is called so by now; the home itself is a dot."""
        if not name:
            return "."
        return self._called.get((folder, name)) or str(Path(folder, name))
