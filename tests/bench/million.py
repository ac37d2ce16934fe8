"""Queue and yield at a million groups: the sample's, imported, solved and copied in the database.

Prints how long pages, counts and places take beside the same at 12,764 groups, and the bytes of a
group. ``python -m tests.bench.million [GROUPS]``; a million take four minutes and 14 GB of disk.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pysqlite3.dbapi2 as sqlite3

from app.config import Settings
from app.db.store import Store
from app.features.queue.service import find_neighbours, list_groups
from app.features.queue.statistics import read_statistics
from app.features.what_if.funnel import count_yield
from app.features.what_if.service import WhatIfStore
from app.features.what_if.statistics import StatisticsCache
from tests.bench.table import print_table
from tests.e2e.service import run_touchline

SAMPLE_GROUPS = 40
REFERENCE = 12_764
TURNS = 5
PAGES = (
    "",
    "jac<0.95",
    "passes:yes",
    "sort:sigma",
    "sort:jac-desc",
    "passes:yes sort:value",
    "finding:none",
    "error>50 sigma<0.3",
)
WHAT_IF: tuple[dict[str, Any], ...] = (
    {"min_jac": 0.8},
    {"min_jac": 0.95},
    {"tau_percent": 0.3},
    {"max_sigma_m": 0.3},
    {"max_sigma_m": 0.3, "min_jac": 0.9},
)
SPREAD = ("value", "error_px", "error_percent", "sigma_m", "parallax_degrees")
"""Numbers that differ from copy to copy, so that an order has something to sort."""


def bench_million(groups: int = 1_000_000) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as name:
        small, size = _measured(Path(name) / "small", REFERENCE)
        large, larger = _measured(Path(name) / "large", groups)
    rows = [[what, small[what], large[what], large[what] / small[what]] for what in large]
    rows.append(["bytes of a group", size, larger, larger / size])
    print_table(
        "Queue and yield, ms, the median of five",
        ("what", f"{REFERENCE:,}", f"{groups:,}", "ratio"),
        rows,
    )


def _measured(home: Path, groups: int) -> tuple[dict[str, float], float]:
    _make_home(home, groups)
    settings = Settings(home=home)
    with closing(Store.open(settings)) as store:
        found = {f"page of {query or 'all'}": _page(store, query) for query in PAGES}
        found["page in the middle"] = _page(store, "sort:sigma", groups // 2)
        for query in ("", "sort:sigma"):
            found[f"place in {query or 'all'}"] = _place(store, query, groups // 2)
        found |= _yields(store) | _statistics(store)
    return found, settings.database_file.stat().st_size / groups


def _yields(store: Store) -> dict[str, float]:
    """Counted once, as a server does after its start; then first and later looks."""
    start = time.perf_counter()
    WhatIfStore(store).update_table(1)
    found = {"yield counted anew": 1000 * (time.perf_counter() - start)}
    yields = WhatIfStore(store)
    start = time.perf_counter()
    count_yield(yields, 1)
    found["first yield after a start"] = 1000 * (time.perf_counter() - start)
    for asked in WHAT_IF:
        name = " ".join(f"{key}={value}" for key, value in asked.items())
        found[f"what if {name}"] = _spent(lambda asked=asked: count_yield(yields, 1, asked))
    return found


def _statistics(store: Store) -> dict[str, float]:
    """Counted once; then first and later looks."""
    found = {}
    for what in ("statistics counted anew", "first statistics after a start"):
        kept = StatisticsCache(store)
        start = time.perf_counter()
        kept.get_statistics(1)
        found[what] = 1000 * (time.perf_counter() - start)
    found["statistics"] = _spent(lambda: kept.get_statistics(1))
    found["statistics of sigma<0.3"] = _spent(lambda: read_statistics(store, 1, "sigma<0.3"))
    return found


def _page(store: Store, query: str, start: int = 0) -> float:
    return _spent(lambda: list_groups(store, 1, query, limit=100, start=start))


def _place(store: Store, query: str, group: int) -> float:
    return _spent(lambda: find_neighbours(store, group, query))


def _spent(work: Callable[[], object]) -> float:
    times = []
    for _ in range(TURNS):
        start = time.perf_counter()
        work()
        times.append(1000 * (time.perf_counter() - start))
    return float(np.median(times))


def _make_home(home: Path, groups: int) -> None:
    home.mkdir()
    tree = home / "tree"
    run_touchline(
        home,
        "migrate",
        f"sample --groups {SAMPLE_GROUPS} {tree}",
        f"import soccernet-v3 {tree} --dataset sample",
        "solve --dataset sample",
    )
    with closing(sqlite3.connect(home / "touchline.db", isolation_level=None)) as database:
        database.execute("PRAGMA foreign_keys = OFF")
        database.execute("PRAGMA synchronous = OFF")
        database.execute("CREATE TEMP TABLE copy (i INTEGER PRIMARY KEY)")
        copies = [(number,) for number in range(1, groups // SAMPLE_GROUPS)]
        database.executemany("INSERT INTO copy VALUES (?)", copies)
        last = {
            table: database.execute(f"SELECT max(id) FROM {table}").fetchone()[0]
            for table in ("groups", "station", "view", "solution")
        }
        group, station, view = last["groups"], last["station"], last["view"]
        numbered = {"number": f"number + i * {SAMPLE_GROUPS}", "key": "key || '/' || i"}
        in_group = {"group_id": f"group_id + i * {group}"}
        spread = "* (1.0 + ((group_id * 7919 + i * 104729) % 10007) / 20014.0)"
        _copy(database, "groups", {"id": f"id + i * {group}", **numbered, **_hashed()})
        _copy(database, "station", {"id": f"id + i * {station}", "key": "key || '/' || i"})
        on_station = {"station_id": f"station_id + i * {station}"}
        _copy(database, "view", {"id": f"id + i * {view}", **in_group, **on_station})
        _copy(database, "solution", {"id": f"id + i * {last['solution']}", **in_group, **_hashed()})
        shown = {"main_view": f"main_view + i * {view}"}
        _copy(
            database,
            "queue",
            {**in_group, **numbered, **shown, **{name: name + spread for name in SPREAD}},
        )
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")


def _hashed() -> dict[str, str]:
    return {"inputs_hash": "inputs_hash || '/' || i"}


def _copy(database: sqlite3.Connection, table: str, changed: dict[str, str]) -> None:
    """Copy every row of a table once for each row of ``copy``."""
    names = [row[1] for row in database.execute(f"PRAGMA table_info({table})")]
    listed = ", ".join(f'"{name}"' for name in names)
    values = ", ".join(changed.get(name, f'"{name}"') for name in names)
    database.execute(f"INSERT INTO {table} ({listed}) SELECT {values} FROM {table}, copy")


if __name__ == "__main__":
    bench_million(*(int(groups) for groups in sys.argv[1:2]))
