"""People: a team whose batch is worked on by many at once, each with a session of their own.

Each takes the next group of the batch, looks at it, drags a ball (previews), judges, and goes on. No group
may be judged by two, no verdict that was answered with 200 may be missing from its group's history, and
nobody may be refused. How long answers take is printed beside the same people on a server without
accounts, sessions and leases, who take the next group from a list of their own. Both have their turns,
so that whatever else the machine does hits both, and none lasts until the groups come to an end: a crowd
that thins out waits less.
"""

from __future__ import annotations

import random
import threading
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
import numpy as np
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from app.config import Settings
from app.db.store import Store
from app.features.people import links
from app.features.people import links as passwords
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.verdicts.queries import read_verdicts
from tests.torture import counting
from tests.torture.crowd import Load
from tests.torture.kills import API, Server

LEAD = "lead"
"""Who is in charge of every team."""
SECRET = "three plain words"
DRAGS = 5
"""Previews of one drag."""
RATIO = 1.3
"""So much longer may the slowest hundredth of answers take beside the same load alone."""
MEASURED = 8
"""So many groups somebody works on by themselves, to count what each request costs."""
SETTLED = 0.02
"""Seconds after which an answer has cost what it costs."""
COMPARED = ("look", "drag", "judge")
TURNS = 4
"""So often each of the two works."""


class TeamServer(Server):
    """A server of a team; people log in to it."""

    @contextmanager
    def running(self, *, team: bool) -> Iterator[str]:
        """Its address while it runs."""
        # Both count, so that both are started the same way.
        self._plant = counting.plant(self._home)
        if team:
            self._plant = f"import os; os.environ['TOUCHLINE_TEAM'] = '1'; {self._plant}"
        self.start()
        try:
            self.wait()
            yield self.address
        finally:
            self.kill()


class Worker(threading.Thread):
    """Somebody who works on a batch, or, without one, on a list that all of them share."""

    def __init__(
        self, http: httpx.Client, batch: int | None, shared: deque[int], think: float, seed: int
    ):
        super().__init__(daemon=True)
        self.milliseconds: dict[str, list[float]] = {
            "next": [],
            "look": [],
            "drag": [],
            "judge": [],
        }
        self.statuses: Counter[int] = Counter()
        self.judged: list[int] = []
        self.fault: str | None = None
        self.until = 0.0
        self._http, self._batch, self._shared, self._think = http, batch, shared, think
        self._random = random.Random(seed)
        self._meter: counting.Meter | None = None
        self.costs: dict[str, list[np.ndarray]] = {}

    def run(self) -> None:
        """Work until the time is over, or nothing is left."""
        group: int | None = None
        try:
            # Nobody begins at the same moment.
            time.sleep(self._random.uniform(0, self._think))
            while time.monotonic() < self.until:
                group = self._next(group)
                if group is None:
                    return
                self._work(group)
        except Exception as error:
            self.fault = f"{type(error).__name__}: {error}"

    def _next(self, after: int | None) -> int | None:
        if self._batch is None:
            try:
                return self._shared.popleft()
            except IndexError:
                return None
        body = {} if after is None else {"after": after}
        found: int | None = self._ask("next", "POST", f"/batches/{self._batch}/next", body)["group"]
        return found

    def each(self, meter: counting.Meter) -> None:
        """Work on one group, and measure each request."""
        self._meter = meter
        group = self._next(None)
        assert group is not None, "there is nothing to measure with"
        self._work(group)

    def _work(self, group: int) -> None:
        document = self._ask("look", "GET", f"/groups/{group}")
        self._pause()
        view = document["views"][0]
        for _ in range(DRAGS):
            place = [round(self._random.uniform(50, 450), 2) for _ in range(2)]
            edit = {"views": {view["key"]: {"ball": {"box": [*place, 12.0, 12.5]}}}}
            self._ask("drag", "POST", f"/groups/{group}/preview", edit)
            time.sleep(0.1)
        self._pause()
        verdict = {"state": "rejected", "reason": "other", "note": "looked at"}
        self._ask("judge", "PUT", f"/groups/{group}/verdict", verdict, document["etag"])
        self.judged.append(group)

    def _ask(self, kind: str, method: str, path: str, body: Any = None, etag: str = "") -> Any:
        headers = {"If-Match": etag if etag.startswith('"') else f'"{etag}"'} if etag else {}
        if self._meter is not None:
            self._meter.lap()
        start = time.perf_counter()
        answer = self._http.request(method, API + path, json=body, headers=headers)
        if self._meter is not None:
            # What follows an answer is a part of what it costs.
            time.sleep(SETTLED)
            self.costs.setdefault(kind, []).append(self._meter.lap())
        self.milliseconds[kind].append(1000 * (time.perf_counter() - start))
        self.statuses[answer.status_code] += 1
        if answer.status_code != 200:
            raise AssertionError(f"{method} {path}: {answer.status_code} {answer.text[:200]}")
        return answer.json()

    def _pause(self) -> None:
        if self._think:
            time.sleep(self._random.expovariate(1 / self._think))


class Office:
    """A server, and the people who work on its dataset ``client0``, a turn at a time.

    Args:
        home: The home of the server, which ``kills.prepare`` has made.
        clients: A connection of each of them.
        batch: What they take their groups from; None: all share a list of their own.
        ids: The groups.
        think: Mean of the seconds before and after a drag; 0: none.
        seed: Decides when they do what.
    """

    def __init__(
        self,
        home: Path,
        clients: Sequence[httpx.Client],
        batch: int | None,
        ids: Sequence[int],
        think: float,
        seed: int,
    ):
        self.load = Load(len(clients), 0)
        """All turns so far."""
        self._home, self._clients, self._batch = home, clients, batch
        self._shared, self._think, self._seed = deque(ids), think, seed
        self._judged: Counter[int] = Counter()

    def measure(self, meter: counting.Meter) -> None:
        """What each kind of request costs somebody who works alone for a moment."""
        worker = Worker(self._clients[0], self._batch, self._shared, 0, self._seed)
        self.load.costs = measure(worker, meter)
        self._judged.update(worker.judged)

    def work(self, seconds: float) -> None:
        """A turn of everybody, until the time is over or nothing is left."""
        crowd = [
            Worker(client, self._batch, self._shared, self._think, self._seed + number)
            for number, client in enumerate(self._clients)
        ]
        self._seed += len(crowd)
        start = time.monotonic()
        for one in crowd:
            one.until = start + seconds
            one.start()
        for one in crowd:
            one.join()
        self.load.seconds += min(seconds, time.monotonic() - start)
        for one in crowd:
            self._judged.update(one.judged)
            self.load.changes += len(one.judged)
            self.load.faults += [one.fault] if one.fault else []
            self.load.statuses += one.statuses
            for kind, times in one.milliseconds.items():
                if times:
                    self.load.milliseconds.setdefault(kind, []).extend(times)

    def ended(self) -> Load:
        """All turns, with what was done twice or got lost."""
        judged = self._judged
        with closing(Store.open(Settings(home=self._home))) as store, store.read() as session:
            given = read_verdicts(session, list(judged))
        kept = {group: len(verdicts) for group, verdicts in given.items()}
        self.load.faults += [
            f"group {group} was judged by {n} people" for group, n in judged.items() if n > 1
        ]
        self.load.faults += [
            f"group {group}: {number} verdicts accepted, {kept.get(group, 0)} kept"
            for group, number in judged.items()
            if kept.get(group, 0) != number
        ]
        return self.load


@contextmanager
def office(home: Path, *, people: int, think: float, seed: int, team: bool) -> Iterator[Office]:
    """A running server over a home, and people who have come to work.

    Args:
        home: The home; ``team``: with an account for each of them, and a batch.
        people: How many.
        think: See ``Office``; ``seed`` likewise.
        team: Whether there are accounts and leases; else all share a list.
    """
    names = [f"person{number}" for number in range(people)]
    if team:
        invite_all(home, names)
    server = TeamServer(home)
    with server.running(team=team) as address:
        clients = [httpx.Client(base_url=address, timeout=60) for _ in names]
        lead = httpx.Client(base_url=address, timeout=60, headers={"Origin": address})
        try:
            batch = None
            if team:
                for name, client in zip((LEAD, *names), (lead, *clients), strict=True):
                    client.headers["Origin"] = address
                    log_in(client, name)
                asked = {"name": "everything"}
                made = lead.post(f"{API}/datasets/client0/batches", json=asked)
                batch = made.raise_for_status().json()["id"]
            found = lead.get(f"{API}/groups/ids", params={"dataset": "client0"})
            ids = found.raise_for_status().json()["ids"]
            begun = Office(home, clients, batch, ids, think, seed)
            begun.measure(counting.Meter(home, server.pid))
            yield begun
        finally:
            for client in (lead, *clients):
                client.close()


def invite_all(home: Path, names: Sequence[str]) -> None:
    """Accounts for a lead and for everybody; their passwords are hashed in no time, for it is not
    the logging in that is measured."""
    quick = PasswordHash((Argon2Hasher(time_cost=1, memory_cost=8, parallelism=1),))
    with (
        patch.object(passwords, "HASHER", quick),
        closing(Store.open(Settings(home=home))) as store,
    ):
        for name in (LEAD, *names):
            role = Role.LEAD if name == LEAD else Role.REVIEWER
            links.set_password_by_link(
                store, invite(store, name, role, actor="local")[1].token, SECRET
            )


def measure(worker: Worker, meter: counting.Meter) -> dict[str, np.ndarray]:
    """Medians of what each kind of request costs, of somebody who works alone for a moment.

    Statements and transactions say the same on every machine, however busy it is.
    """
    for _ in range(MEASURED):
        worker.each(meter)
    if worker.statuses.keys() - {200}:
        raise AssertionError(f"answers other than 200: {worker.statuses}")
    return {kind: np.median(laps, axis=0) for kind, laps in worker.costs.items()}


def told(costs: Mapping[str, np.ndarray]) -> list[str]:
    """The costs for people."""
    return [
        f"  {kind:8} {statements:4.0f} statements, {transactions:.0f} transactions, "
        f"{commits:.0f} commits, {busy:5.1f} ms of processor"
        for kind, (statements, transactions, commits, busy) in costs.items()
    ]


def log_in(client: httpx.Client, name: str) -> None:
    """Begin a session; a name and an address have so many tries a minute, which are waited for."""
    while True:
        answer = client.post(f"{API}/session", json={"name": name, "password": SECRET})
        if answer.status_code != 429:
            answer.raise_for_status()
            return
        time.sleep(float(answer.headers.get("retry-after", "1")))


def compare(alone: Load, beside: Load) -> tuple[list[str], float]:
    """How the slowest hundredth of answers of each kind compares, as lines and of all together."""
    lines, before, after = [], Load(0, 1), Load(0, 1)
    # The load is the same only where it comes as fast.
    pace = [sum(load.statuses.values()) / load.seconds for load in (alone, beside)]
    lines.append(f"  {pace[0]:.1f} requests a second alone, {pace[1]:.1f} in a team")
    for kind in COMPARED:
        one, other = alone.percentiles(kind)[2], beside.percentiles(kind)[2]
        lines.append(
            f"  {kind:8} p99 {one:6.0f} ms alone, {other:6.0f} ms in a team: {other / one:.2f}"
        )
        before.milliseconds.setdefault("all", []).extend(alone.milliseconds.get(kind, []))
        after.milliseconds.setdefault("all", []).extend(beside.milliseconds.get(kind, []))
    ratio = after.percentiles("all")[2] / before.percentiles("all")[2]
    return [*lines, f"  together p99 {ratio:.2f} times (at most {RATIO} asked)"], ratio
