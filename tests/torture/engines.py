"""Engines: the same crowd on a file of SQLite and on PostgreSQL, in turns.

Both homes begin with the same rows: that of PostgreSQL is one of SQLite that was transferred. Both
engines sync what they have promised. With pauses the crowd asks for the same on both, and how long
answers take can be compared; without them, how much gets done. A busy machine changes the figures of
both: compare the two of one run, and the seconds of the processor.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.cluster import Cluster, running_cluster
from tests.e2e.service import run_touchline
from tests.torture.crowd import Load, crowd
from tests.torture.kills import Server

ENGINES = SQLITE, POSTGRESQL = ("SQLite", "PostgreSQL")
ROUNDS = 2
"""So often each engine has its turn: what the machine does besides hits both."""
_ALL = "all"

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Row:
    """What an engine did with one kind of crowd, all its turns together.

    Attributes:
        engine: Its name.
        think: Mean of the seconds between two requests of a person; 0: none.
        changes: Accepted changes a second.
        p50: Milliseconds of half of all answers; ``p95`` and ``p99`` likewise.
        server: Milliseconds of the processor that the server took for an accepted change, with
            what was read for it; ``database``: those of the database's own processes.
    """

    engine: str
    think: float
    changes: float
    p50: float
    p95: float
    p99: float
    server: float
    database: float


def order(turn: int) -> tuple[str, ...]:
    """The engines in one round; who is first in it is last in the next."""
    return ENGINES if turn % 2 == 0 else ENGINES[::-1]


def compare(
    home: Path,
    folder: Path,
    *,
    people: int,
    seconds: float,
    think: float,
    seed: int,
    tell: Tell,
    rounds: int = ROUNDS,
) -> list[str]:
    """Print both engines' rows in one table; what was wrong in any turn, none where all is well.

    Args:
        home: A home that ``kills.prepare`` has made; it is copied.
        folder: For the copies.
        people: How many.
        seconds: For how long a turn.
        think: Mean of the seconds between two requests of a person; once more without any.
        seed: Decides what they do, on both engines alike.
        tell: Takes each line: one of each turn, then the table.
        rounds: How often each engine has its turn.
    """
    loads: dict[tuple[float, str], list[Load]] = {}
    with running_cluster(lasting=True) as cluster:
        for turn in range(rounds):
            for pause in dict.fromkeys((think, 0.0)):
                for engine in order(turn):
                    copied = Path(shutil.copytree(home, folder / f"{engine}{turn}-{pause}"))
                    load = _turn(cluster, copied, engine, people, seconds, pause, seed + turn)
                    loads.setdefault((pause, engine), []).append(load)
                    tell(f"{engine}, {pause:g} s of pause: {load.lines()[0]}")
                    shutil.rmtree(copied)
    rows = [row(engine, pause, turns) for (pause, engine), turns in loads.items()]
    for line in table(rows, people):
        tell(line)
    return [
        f"{engine}, {pause:g} s of pause: {fault}"
        for (pause, engine), turns in loads.items()
        for load in turns
        for fault in [*load.faults, *([] if load.changes else ["nothing was changed"])]
    ]


def _turn(
    cluster: Cluster,
    home: Path,
    engine: str,
    people: int,
    seconds: float,
    think: float,
    seed: int,
) -> Load:
    environment: Mapping[str, str] = {}
    others: tuple[int, ...] = ()
    if engine == POSTGRESQL:
        url = cluster.create()
        run_touchline(home, f"transfer {home} {url}", seconds=600)
        environment, others = {"TOUCHLINE_DATABASE_URL": url}, (cluster.pid,)
    server = Server(home, environment=environment)
    return crowd(
        home, people=people, seconds=seconds, think=think, seed=seed, server=server, others=others
    )


def row(engine: str, think: float, turns: list[Load]) -> Row:
    """The turns of an engine as one row."""
    together = Load(turns[0].people, sum(load.seconds for load in turns))
    for load in turns:
        together.changes += load.changes
        for times in load.milliseconds.values():
            together.milliseconds.setdefault(_ALL, []).extend(times)
    each = 1000 / max(together.changes, 1)
    server, database = (sum(load.processor[place] for load in turns) * each for place in (0, 1))
    pace = together.changes / together.seconds
    return Row(engine, think, pace, *together.percentiles(_ALL), server, database)


def table(rows: list[Row], people: int) -> list[str]:
    """The rows for people, and below each pair how PostgreSQL compares."""
    lines = [
        f"{people} people who edit and judge, on both engines in turns",
        "pause  engine      changes/s   p50 ms   p95 ms   p99 ms  processor ms a change",
        "                                                         server  database",
    ]
    lines += [
        f"{one.think:3g} s  {one.engine:10}  {one.changes:9.1f}  {one.p50:7.0f}  {one.p95:7.0f}"
        f"  {one.p99:7.0f}  {one.server:6.1f}  {one.database:8.1f}"
        for one in sorted(rows, key=lambda one: -one.think)
    ]
    for think in sorted({one.think for one in rows}, reverse=True):
        file, server = (
            next(one for one in rows if (one.think, one.engine) == (think, engine))
            for engine in ENGINES
        )
        lines.append(
            f"{think:3g} s  PostgreSQL to SQLite: changes/s {_ratio(server.changes, file.changes):.2f},"
            f" p99 {_ratio(server.p99, file.p99):.2f}, processor"
            f" {_ratio(server.server + server.database, file.server + file.database):.2f}"
        )
    return lines


def _ratio(one: float, other: float) -> float:
    """How often the other goes into one; nan where it is nothing."""
    return one / other if other else float("nan")
