"""Background: long work of one person, beside which others go on as if there were none.

A dataset is solved anew, exported whole, and imported from the command line, one after the other of its
kind without a pause; each is an attack like any other (``flood``).
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import sys
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.e2e.service import ROOT, SERVE, run_touchline
from tests.torture.connection import API, Answer
from tests.waiting import SECONDS

DATASET = "busy"
FORMAT = "soccernet-v3d"
GROUPS = 300
"""So many that each is at work for some seconds."""
LOOK = 0.25
"""Seconds between two looks whether it is done."""
SCALES = (2.0, 2.5)
"""Pixels of ``calibration.robust_scale_px``, one after the other: all cameras are sought anew."""

Ask = Callable[..., Awaitable[Answer]]


def prepare(home: Path, folder: Path, groups: int = GROUPS) -> Path:
    """Give a home the dataset, solved; the folder that it came from."""
    tree = folder / DATASET
    run_touchline(
        home,
        f"sample --workers 2 --groups {groups} --seed 7 --labels-only {tree}",
        f"import soccernet-v3 {tree} --dataset {DATASET}",
        f"solve --dataset {DATASET} --workers 2",
        seconds=600,
    )
    return tree


@dataclass
class Background:
    """Long work on a server.

    Args:
        ask: Asks the server: method, path, body, further headers.
        home: What it serves.
        tree: What the command line imports.
    """

    ask: Ask
    home: Path
    tree: Path

    def __post_init__(self) -> None:
        self._turn = itertools.count()

    async def solve(self, _number: int) -> tuple[int, dict[str, str]]:
        """Every camera of the dataset is sought anew."""
        path = f"{API}/datasets/{DATASET}/policy"
        etag = (await self.ask("GET", path)).headers["etag"]
        scale = SCALES[next(self._turn) % len(SCALES)]
        wanted = {"name": "busy", "values": {"calibration": {"robust_scale_px": scale}}}
        return await self._done(await self.ask("PUT", path, _json(wanted), {"If-Match": etag}))

    async def export(self, _number: int) -> tuple[int, dict[str, str]]:
        """All of it is written to a zip."""
        wanted = {"dataset": DATASET, "format": FORMAT, "all": True}
        return await self._done(await self.ask("POST", f"{API}/exports", _json(wanted)))

    async def import_(self, _number: int) -> tuple[int, dict[str, str]]:
        """The command line brings the same groups into the home again, as another dataset."""
        name = f"import{next(self._turn)}"
        words = ("import", "soccernet-v3", str(self.tree), "--dataset", name)
        command = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", SERVE, *words),
            cwd=ROOT,
            env={**os.environ, "TOUCHLINE_HOME": str(self.home)},
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.DEVNULL,
        )
        try:
            code = await command.wait()
        finally:
            with suppress(ProcessLookupError):
                command.kill()
            await command.wait()
        return (200 if code == 0 else 500), {}

    async def _done(self, asked: Answer) -> tuple[int, dict[str, str]]:
        """The answer to a request for a job, once the job is done; 500 where it failed."""
        if asked.status != 202:
            return asked.status, asked.headers
        place, state = asked.headers["location"], "waiting"
        for _ in range(int(SECONDS / LOOK)):
            state = json.loads((await self.ask("GET", place)).body)["state"]
            if state not in ("waiting", "running"):
                break
            await asyncio.sleep(LOOK)
        return (asked.status if state == "done" else 500), asked.headers


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
