"""Kills: a server that dies at any moment, and clients that send again until they are answered.

Each client has a dataset of its own and knows what was acknowledged; at the end the log must hold
exactly that: nothing lost, nothing half, nothing twice.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
import uuid
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from app.config import Settings
from app.db.log import read_log
from app.db.store import Store
from app.features.datasets.service import list_datasets
from app.features.integrity.checks import examine_database
from tests.e2e.service import ROOT, SERVE, free_port, run_touchline
from tests.starting import Process
from tests.torture.connection import API

START_SECONDS = 120.0
ANSWER_SECONDS = 120.0
"""For one request, with all the times that it is sent."""


@dataclass
class Report:
    """What a run came to; ``faults`` are sentences, none where all is well."""

    kills: int = 0
    acknowledged: int = 0
    repeated: int = 0
    faults: list[str] = field(default_factory=list)


def prepare(home: Path, folder: Path, *, clients: int, groups: int) -> None:
    """A home with a solved dataset for each client."""
    tree = folder / "tree"
    lines = ["migrate", f"sample --workers 1 --groups {groups} --labels-only {tree}"]
    for number in range(clients):
        lines += [
            f"import soccernet-v3 {tree} --dataset client{number}",
            f"solve --dataset client{number} --workers 1",
        ]
    run_touchline(home, *lines, seconds=600)


class Server:
    """A server that can be killed and started again on its port.

    Args:
        home: What it serves.
        plant: Python that its process runs first, to plant a fault.
        log: Where it says what it says; None: into the home.
        environment: Settings of its own.
    """

    def __init__(
        self,
        home: Path,
        plant: str = "",
        log: Path | None = None,
        environment: Mapping[str, str] | None = None,
    ):
        self._home, self._plant, self.port = home, plant, free_port()
        self._environment = environment or {}
        self._log = log or home / "server.log"
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def address(self) -> str:
        """Where it is."""
        return f"http://127.0.0.1:{self.port}"

    @property
    def pid(self) -> int:
        """Of its process."""
        assert self._process is not None
        return self._process.pid

    def start(self) -> None:
        """Start, and do not wait."""
        environment = {
            **os.environ,
            "TOUCHLINE_HOME": str(self._home),
            "TOUCHLINE_PORT": str(self.port),
            **self._environment,
        }
        # What is planted must be there before what it changes is loaded.
        start = subprocess.Popen if self._plant else Process
        with self._log.open("ab") as log:
            self._process = start(
                [sys.executable, "-c", f"{self._plant}\n{SERVE}", "serve"],
                cwd=ROOT,
                env=environment,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def wait(self) -> None:
        """Wait until it answers."""
        deadline = time.monotonic() + START_SECONDS
        while time.monotonic() < deadline:
            assert self._process is not None and self._process.poll() is None, self.log()
            try:
                httpx.get(f"{self.address}/readyz", timeout=2)
            except httpx.HTTPError:
                time.sleep(0.05)
            else:
                return
        raise TimeoutError(self.log())

    def kill(self) -> None:
        """End it without a word, and all that belongs to it."""
        if self._process is not None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def ended(self, seconds: float) -> int | None:
        """Its exit code; None where it is still there after so many seconds."""
        assert self._process is not None
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def log(self) -> str:
        """What it said last."""
        return self._log.read_text(errors="replace")[-2000:]


class Client(threading.Thread):
    """Somebody who works on a dataset as fast as it goes, and sends again what was not answered."""

    def __init__(self, address: str, dataset: str, seed: int, go_on: Callable[[], bool]):
        super().__init__(daemon=True)
        self.dataset = dataset
        self.said: Counter[str] = Counter()
        """Log entries that the answers promise, by kind."""
        self.acknowledged = self.repeated = 0
        self.fault: str | None = None
        self._http = httpx.Client(base_url=address, timeout=20)
        self._random, self._go_on = random.Random(seed), go_on
        self._groups: list[dict[str, Any]] = []

    def run(self) -> None:
        """Work until told otherwise, or until an answer is wrong."""
        try:
            listed = self._ask("GET", f"/groups?dataset={self.dataset}&limit=500")["items"]
            self._groups = [self._ask("GET", f"/groups/{item['id']}") for item in listed]
            while self._go_on():
                chosen = self._random.choices((self._edit, self._judge, self._bulk), (8, 4, 1))[0]
                chosen()
        except Exception as error:
            self.fault = f"{self.dataset}: {type(error).__name__}: {error}"
        finally:
            self._http.close()

    def _edit(self) -> None:
        """Move a ball; sometimes take it back."""
        place = self._random.randrange(len(self._groups))
        group = self._groups[place]
        view = self._random.choice(group["views"])
        x, y = self._random.uniform(50, 900), self._random.uniform(50, 500)
        edit = {"box": [round(x, 2), round(y, 2), 12.0, 12.5]}
        answer = self._ask("PATCH", f"/views/{view['id']}/ball", edit, group["etag"])
        self._note(place, answer, "edit", group)
        if self._random.random() < 0.3:
            undone = self._ask("POST", f"/groups/{group['id']}/undo", None, answer["etag"])
            self._note(place, undone, "undo", answer)

    def _judge(self) -> None:
        """Give another verdict than the last."""
        place = self._random.randrange(len(self._groups))
        group = self._groups[place]
        state = self._random.choice(["deferred", "unreviewed"])
        if group["verdict"]["state"] == state:
            return
        answer = self._ask("PUT", f"/groups/{group['id']}/verdict", {"state": state}, group["etag"])
        self._note(place, answer, "verdict", group)

    def _bulk(self) -> None:
        """Judge all groups at once, and take that back."""
        done = self._ask("POST", f"/datasets/{self.dataset}/verdicts", {"state": "deferred"})
        self.said["verdict"] += done["changed"]
        if done["batch"] is not None:
            undone = self._ask("POST", f"/verdict-batches/{done['batch']}/undo")
            self.said["verdict"] += undone["restored"]
        self._groups = [self._ask("GET", f"/groups/{item['id']}") for item in self._groups]

    def _note(self, place: int, answer: dict[str, Any], kind: str, before: dict[str, Any]) -> None:
        self._groups[place] = answer
        # An answer that leaves the state as it was is no entry.
        self.said[kind] += answer["etag"] != before["etag"]

    def _ask(
        self, method: str, path: str, body: Any = None, etag: str | None = None
    ) -> dict[str, Any]:
        """The answer, however often the question must be sent."""
        headers = {} if method == "GET" else {"Idempotency-Key": uuid.uuid4().hex}
        if etag is not None:
            headers["If-Match"] = etag if etag.startswith('"') else f'"{etag}"'
        deadline = time.monotonic() + ANSWER_SECONDS
        while True:
            try:
                answer = self._http.request(method, API + path, json=body, headers=headers)
            except httpx.HTTPError:
                self.repeated += 1
            else:
                if answer.status_code != 503:
                    break
            if time.monotonic() > deadline:
                raise TimeoutError(f"{method} {path} was not answered")
            time.sleep(0.02)
        if not answer.is_success:
            raise AssertionError(f"{method} {path}: {answer.status_code} {answer.text[:300]}")
        self.acknowledged += method != "GET"
        found: dict[str, Any] = answer.json()
        return found


def torture(
    home: Path,
    *,
    kills: int,
    edits: int,
    clients: int,
    seed: int,
    tell: Callable[[str], None] = lambda _sentence: None,
) -> Report:
    """Kill the server that many times, and go on until that many changes are acknowledged.

    Args:
        home: A home that ``prepare`` has made.
        kills: How often the server is killed with SIGKILL.
        edits: Acknowledged changes, of all clients together.
        clients: People who work at once.
        seed: Decides what they do and when the server dies.
        tell: Called with each sentence worth reading.
    """
    report, chance = Report(), random.Random(seed)
    server = Server(home)
    ended = threading.Event()
    people = [
        Client(server.address, f"client{number}", seed + number, lambda: not ended.is_set())
        for number in range(clients)
    ]

    def acknowledged() -> int:
        return sum(person.acknowledged for person in people)

    def failed() -> bool:
        return any(person.fault for person in people)

    server.start()
    for person in people:
        person.start()
    try:
        while (report.kills < kills or acknowledged() < edits) and not failed():
            wanted = edits * (report.kills + 1) / (kills + 1) if report.kills < kills else edits
            server.wait()
            while acknowledged() < wanted and not failed():
                time.sleep(0.01)
            if report.kills < kills:
                if chance.random() < 0.5:
                    time.sleep(chance.uniform(0, 0.2))
                else:
                    _await_write(home)
                server.kill()
                report.kills += 1
                tell(f"{report.kills} kills, {acknowledged()} changes acknowledged")
                server.start()
                if chance.random() < 0.2:
                    # Sometimes while it starts, too.
                    time.sleep(chance.uniform(0, 2))
                    server.kill()
                    server.start()
    finally:
        ended.set()
        # What is on its way is answered first: its client counts it.
        for person in people:
            person.join(ANSWER_SECONDS)
        server.kill()
    report.acknowledged = acknowledged()
    report.repeated = sum(person.repeated for person in people)
    report.faults = [person.fault for person in people if person.fault] + compare(home, people)
    return report


def _await_write(home: Path) -> None:
    """Wait until something is being written: what is killed then is often saved but not answered."""
    path = home / "touchline.db-wal"
    if not path.exists():
        # The database is a server's; the home is told of a commit before its request is answered.
        path = home / "home.json"
    deadline = time.monotonic() + 2.0
    before = path.stat().st_mtime_ns
    while path.stat().st_mtime_ns == before and time.monotonic() < deadline:
        pass


def compare(home: Path, people: list[Client]) -> list[str]:
    """What the log does not hold as it was acknowledged, and what the doctor finds."""
    store = Store.open(Settings(home=home))
    try:
        ids = {item.name: item.id for item in list_datasets(store)}
        kept: Counter[tuple[int | None, str]] = Counter()
        with store.read() as session:
            for entry in read_log(session):
                kept[entry.dataset_id, entry.kind] += 1
        faults = []
        for person in people:
            for kind in ("edit", "undo", "verdict"):
                said, found = person.said[kind], kept[ids[person.dataset], kind]
                if said != found:
                    faults.append(
                        f"{person.dataset}: {said} of {kind} acknowledged, {found} in the log"
                    )
        return faults + [check.sentence for check in examine_database(store) if not check.ok]
    finally:
        store.close()
