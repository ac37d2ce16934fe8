"""Conditions: a home, a disk or a clock that is not as it should be, and the one sentence it gets.

What keeps a server from starting is said in a sentence with what to do; what comes while it works
takes nothing from those who only read, and loses no change that was acknowledged.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx

from app.formats.soccernet_v3_writer import write_soccernet_v3
from tests.e2e.service import run_touchline
from tests.integration.conftest import picture
from tests.scenes import make_scenes
from tests.torture import damage
from tests.torture.kills import API, Server

DAY = 24 * 3600
ROOM = "24m"
"""Of the disk that is filled."""
NFS = """
import app.db.home as home, pathlib
home.file_system.__defaults__ = (pathlib.Path({!r}),)
"""
"""Lets a server believe another list of mounts."""
CLOCK = """
import datetime as when, pathlib, time
place, measured = pathlib.Path({!r}), time.time
aside = lambda: float(place.read_text())
time.time = lambda: measured() + aside()
class Clock(when.datetime):
    @classmethod
    def now(cls, tz=None):
        return when.datetime.fromtimestamp(time.time(), tz)
import app.db.idempotency, app.db.session
app.db.session.datetime = app.db.idempotency.datetime = Clock
"""
"""Gives a server a clock that is as many seconds aside as a file says.

libfaketime does that for any program, and now and then stops a server with threads for good.
"""


@dataclass(frozen=True)
class Condition:
    """A home in which no server starts.

    Args:
        name: What it is.
        spoil: Brings a home into it; returns Python that the server runs first.
        says: What the server's sentence must say; one of them.
    """

    name: str
    spoil: Callable[[Path], str | None]
    says: tuple[str, ...]


def _on_a_network(home: Path) -> str:
    mounts = home.with_name("mounts")
    mounts.write_text(f"/dev/vda / ext4 rw 0 0\nserver:/data {home.resolve()} nfs4 rw 0 0\n")
    return NFS.format(str(mounts))


CONDITIONS = (
    Condition("newer schema", damage.write_newer_schema, ("newer version of Touchline",)),
    Condition("truncated file", damage.cut_short, ("is truncated",)),
    Condition("no database", damage.take_away, ("is missing, but this home has been used",)),
    Condition("damaged page", damage.spoil_first, ("damaged",)),
    Condition("damaged page in the middle", damage.spoil_inside, ("touchline.db is damaged",)),
    Condition("network file system", _on_a_network, ("network file system (nfs4)",)),
)


def torture(home: Path, folder: Path, tell: Callable[[str], None] = lambda _: None) -> list[str]:
    """Bring copies of a home into each condition; what was not in order, one sentence each."""
    faults = []
    for number, condition in enumerate(CONDITIONS):
        found = refused(_copy(home, folder / str(number)), condition)
        tell(f"{condition.name}: {'; '.join(found) or 'one sentence'}")
        faults += found
    faults += frames_gone(folder / "frames")
    faults += damaged_meanwhile(_copy(home, folder / "damaged"))
    if can_mount():
        faults += read_only(_copy(home, folder / "read-only"))
        faults += full_disk(_copy(home, folder / "full"), tell)
    else:
        tell("read-only home and full disk are skipped: nobody but root can mount a disk")
    faults += clock_set_back(_copy(home, folder / "clock"), tell)
    return faults


def can_mount() -> bool:
    """Whether this process may mount a small disk."""
    if os.geteuid():
        return False
    with tempfile.TemporaryDirectory() as place:
        command = ["mount", "-t", "tmpfs", "-o", "size=1m", "none", place]
        if subprocess.run(command, capture_output=True, check=False).returncode:
            return False
        subprocess.run(["umount", place], check=True)
    return True


def _copy(home: Path, folder: Path) -> Path:
    folder.mkdir(parents=True)
    return Path(shutil.copytree(home, folder / "home"))


def refused(home: Path, condition: Condition) -> list[str]:
    """Start a server over a home in that condition; what was not in order."""
    plant = condition.spoil(home) or ""
    server = Server(home, plant)
    (home / "server.log").unlink(missing_ok=True)
    server.start()
    code = server.ended(60)
    if code is None:
        server.kill()
    return judged(condition, code, server.log())


def judged(condition: Condition, code: int | None, said: str) -> list[str]:
    """What is wrong with how a server ended, None: it has not, and with what it said."""
    server, faults = f"{condition.name}: the server", []
    if code is None:
        faults.append(f"{server} started")
    if code == 0:
        faults.append(f"{server} ended as if all were well")
    if "Traceback" in said:
        faults.append(f"{server} fell over: {said[-300:]}")
    if not any(words in " ".join(said.split()) for words in condition.says):
        faults.append(f"{server} says {said[-300:]!r}")
    return faults


def read_only(home: Path) -> list[str]:
    """A home on a disk that cannot be written: a sentence that says so (as root alone)."""
    with _disk(home.with_name("read-only")) as disk:
        shutil.copytree(home, disk / "home")
        damage.settle(disk / "home")
        subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
        # Its log must go elsewhere.
        server = Server(disk / "home", log=home.with_name("read-only.log"))
        server.start()
        code, said = server.ended(60), server.log()
        if code is None:
            server.kill()
            return ["read-only home: the server started"]
        fell = "Traceback" in said or "cannot be written" not in said
        return [f"read-only home: the server says {said[-300:]!r}"] if fell else []


def full_disk(home: Path, tell: Callable[[str], None] = lambda _: None) -> list[str]:
    """A disk that fills while people edit: 507, reads go on, and so does all once there is room."""
    with _disk(home.with_name("full")) as disk:
        shutil.copytree(home, disk / "home")
        server = Server(disk / "home", log=home.with_name("full.log"))
        server.start()
        try:
            server.wait()
            with httpx.Client(base_url=server.address, timeout=60) as http:
                return _fill(http, disk / "ballast", tell)
        finally:
            server.kill()


def _fill(http: httpx.Client, ballast: Path, tell: Callable[[str], None]) -> list[str]:
    person, faults = _Person(http), []
    for _ in range(3):
        faults += person.edit(200)
    _take_all(ballast)
    refused = 0
    for _ in range(200):
        answer = person.send()
        if answer.status_code == 507:
            refused += 1
        elif answer.status_code != 200:
            faults.append(f"full disk: an edit was answered with {answer.status_code}")
        if refused == 3:
            break
    if not refused:
        faults.append("full disk: no edit was refused")
    if http.get(person.path).json()["etag"] != person.etag:
        faults.append("full disk: what is read is not what was acknowledged")
    ballast.unlink()
    faults += person.edit(200)
    faults += person.compare("full disk")
    tell(f"full disk: {refused} edits refused with 507, {person.accepted} accepted")
    return faults


def clock_set_back(home: Path, tell: Callable[[str], None] = lambda _: None) -> list[str]:
    """Three days earlier while people work: order, repetition, jobs and events stay right."""
    clock = home.with_name("clock")
    _set(clock, 0)
    server = Server(home, CLOCK.format(str(clock)))
    server.start()
    try:
        server.wait()
        with httpx.Client(base_url=server.address, timeout=60) as http:
            return _turn_back(http, clock, tell)
    finally:
        server.kill()


def _set(clock: Path, aside: int) -> None:
    """At once: a server that read half of it would fail in whatever asks for the time."""
    written = clock.with_suffix(".new")
    written.write_text(str(aside))
    written.replace(clock)


def _turn_back(http: httpx.Client, clock: Path, tell: Callable[[str], None]) -> list[str]:
    person = _Person(http)
    faults = person.edit(200, key="before")
    first = person.last
    _set(clock, -3 * DAY)
    faults += person.edit(200, key="after")
    again = http.patch(first.request.url, content=first.request.content, headers=_sent(first))
    if again.content != first.content or "idempotency-replayed" not in again.headers:
        faults.append(f"clock set back: a repetition got {again.status_code} and another answer")
    entries = http.get(f"{person.path}/history").json()["items"]
    times, ids = [item["at"] for item in entries], [item["id"] for item in entries]
    if ids != sorted(ids):
        faults.append("clock set back: the history is not in the order of what was done")
    if times[-1] >= times[-2]:
        faults.append("clock set back: the clock was not set back")
    export = {"dataset": "client0", "format": "soccernet-v3d", "all": True}
    job = http.post(f"{API}/exports", json=export)
    if job.status_code != 202:
        faults.append(f"clock set back: an export got {job.status_code} {job.text[:200]}")
    else:
        faults += _finished(http, job.json())
    faults += person.compare("clock set back")
    tell(f"clock set back: from {times[-2]} to {times[-1]}, {person.accepted} edits accepted")
    return faults


def _finished(http: httpx.Client, job: dict[str, Any]) -> list[str]:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        state = http.get(f"{API}/jobs/{job['id']}").json()["state"]
        if state not in ("waiting", "running"):
            return [] if state == "done" else [f"clock set back: an export ended as {state}"]
        time.sleep(0.1)
    return ["clock set back: an export does not end"]


def frames_gone(folder: Path) -> list[str]:
    """Frames that are taken away while they are looked at: the rest is served, and a picture says
    what it lacks.

    Args:
        folder: Where a home and its frames go.
    """
    home, tree = folder / "home", folder / "tree"
    _with_frames(home, tree)
    server = Server(home)
    server.start()
    try:
        server.wait()
        with httpx.Client(base_url=server.address, timeout=60) as http:
            person, faults = _Person(http), []
            # Each width is made for itself: what was looked at may be served on.
            answers = [http.get(f"{API}/views/{person.view}/image?width=320")]
            tree.rename(folder / "elsewhere")
            answers.append(http.get(f"{API}/views/{person.view}/image?width=208"))
            faults += person.edit(200)
            if answers[0].status_code != 200:
                faults.append(f"frames there: {answers[0].status_code} {answers[0].text[:200]}")
            if answers[1].status_code != 404 or not answers[1].json().get("detail"):
                faults.append(f"frames gone: {answers[1].status_code} {answers[1].text[:200]}")
            return faults + person.compare("frames gone")
    finally:
        server.kill()


def _with_frames(home: Path, tree: Path) -> None:
    """A home with one group, whose frames are in a tree."""
    group = make_scenes(groups=1, seed=3, faults=False)[0].group
    write_soccernet_v3(tree, [group])
    for view in group.views:
        path = tree / group.match / view.key
        path.write_bytes(picture(0, view.size.width, view.size.height))
    run_touchline(home, "migrate", f"import soccernet-v3 {tree} --dataset client0")


def damaged_meanwhile(home: Path) -> list[str]:
    """A page of the views is lost while a server runs: a sentence for all, and no change is taken."""
    damage.settle(home)
    place = damage.interior_page(home)
    server = Server(home)
    server.start()
    try:
        server.wait()
        with httpx.Client(base_url=server.address, timeout=60) as http:
            person = _Person(http)
            faults = person.edit(200)
            damage.scribble(home, place)
            damage.write_beside(home)
            answers = [person.send(), person.send(), http.get("/readyz")]
            for answer in answers:
                if answer.status_code != 503 or "is damaged" not in answer.json()["detail"]:
                    faults.append(f"damaged meanwhile: {answer.status_code} {answer.text[:200]}")
            return faults
    finally:
        server.kill()


class _Person:
    """Somebody who moves one ball, and knows what was acknowledged."""

    def __init__(self, http: httpx.Client):
        ids = http.get(f"{API}/groups/ids", params={"dataset": "client0"}).json()["ids"]
        self.path, self._http = f"{API}/groups/{ids[0]}", http
        group = http.get(self.path).json()
        self.etag, self.view = group["etag"], group["views"][0]["id"]
        self.accepted, self._turn = 0, 0
        self._entries = len(http.get(f"{self.path}/history").json()["items"])
        self.last: httpx.Response

    def send(self, key: str | None = None) -> httpx.Response:
        """Move the ball."""
        self._turn += 1
        headers = {"If-Match": self.etag, "Idempotency-Key": key or f"turn-{self._turn}"}
        body = {"box": [100.0 + self._turn, 200.0, 12.0, 12.0]}
        self.last = self._http.patch(f"{API}/views/{self.view}/ball", json=body, headers=headers)
        if self.last.status_code == 200:
            self.etag, self.accepted = self.last.headers["etag"], self.accepted + 1
        return self.last

    def edit(self, wanted: int, key: str | None = None) -> list[str]:
        """Move the ball, and expect that status."""
        answer = self.send(key)
        if answer.status_code == wanted:
            return []
        return [f"an edit was answered with {answer.status_code}: {answer.text[:200]}"]

    def compare(self, name: str) -> list[str]:
        """Whether the history holds what was acknowledged."""
        found = len(self._http.get(f"{self.path}/history").json()["items"]) - self._entries
        if found == self.accepted:
            return []
        return [f"{name}: {self.accepted} edits acknowledged, {found} in the history"]


def _sent(answer: httpx.Response) -> dict[str, str]:
    names = ("if-match", "idempotency-key", "content-type")
    return {name: answer.request.headers[name] for name in names}


@contextmanager
def _disk(place: Path) -> Iterator[Path]:
    """A small disk of its own."""
    place.mkdir()
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={ROOM}", "none", str(place)], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def _take_all(ballast: Path) -> None:
    """Fill a disk to the last byte."""
    with ballast.open("wb", buffering=0) as file:
        for size in (1 << 20, 1 << 12, 1):
            try:
                while True:
                    file.write(b"\0" * size)
            except OSError:
                continue
