"""Background: long work of one person, beside which others go on as if there were none.

A dataset is solved anew, exported whole, frozen and verified, judged all at once, and imported from the
command line, one after the other of its kind without a pause; each is an attack like any other (``flood``).
"""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import sys
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tests.e2e.service import ROOT, SERVE, run_touchline
from tests.torture.connection import API, Answer, Connection
from tests.waiting import SECONDS

FORMAT = "soccernet-v3d"
GROUPS = 300
"""So many that each is at work for some seconds."""
LOOK = 0.25
"""Seconds between two looks whether it is done."""
SCALES = (2.0, 2.5)
"""Pixels of ``calibration.robust_scale_px``, one after the other: all cameras are sought anew."""


@dataclass(frozen=True)
class Busy:
    """A dataset that somebody works on, and the folder that it came from."""

    dataset: str
    tree: Path


def prepare(home: Path, folder: Path) -> Busy:
    """Give a home one that takes long, solved."""
    busy = Busy("busy", folder / "busy")
    run_touchline(
        home,
        f"sample --workers 2 --groups {GROUPS} --seed 7 --labels-only {busy.tree}",
        f"import soccernet-v3 {busy.tree} --dataset {busy.dataset}",
        f"solve --dataset {busy.dataset} --workers 2",
        seconds=600,
    )
    return busy


class Background:
    """Long work on a server.

    Args:
        line: To the server, as somebody who may have it done.
        home: What it serves.
        busy: What is worked on.
    """

    def __init__(self, line: Connection, home: Path, busy: Busy):
        self._line, self._home, self._busy = line, home, busy
        self._turn = itertools.count()

    async def solve(self, _number: int) -> tuple[int, dict[str, str]]:
        """Every camera of the dataset is sought anew."""
        path = f"{API}/datasets/{self._busy.dataset}/policy"
        scale = SCALES[next(self._turn) % len(SCALES)]
        wanted = {"name": "busy", "values": {"calibration": {"robust_scale_px": scale}}}
        with closing(self._line):
            etag = (await self._line.ask("GET", path)).headers["etag"]
            return await self._done(await self._line.ask("PUT", path, _json(wanted), etag))

    async def export(self, _number: int) -> tuple[int, dict[str, str]]:
        """All of it is written to a zip."""
        wanted = {"dataset": self._busy.dataset, "format": FORMAT, "all": True}
        with closing(self._line):
            return await self._done(await self._line.ask("POST", f"{API}/exports", _json(wanted)))

    async def freeze(self, _number: int) -> tuple[int, dict[str, str]]:
        """A version of what passes, which is computed again and compared."""
        wanted = {"name": f"turn {next(self._turn)}", "groups": "passing"}
        path = f"{API}/datasets/{self._busy.dataset}/versions"
        with closing(self._line):
            asked = await self._line.ask("POST", path, _json(wanted))
            frozen = await self._done(asked)
            if frozen[0] != 202:
                return frozen
            job = json.loads((await self._line.ask("GET", asked.headers["location"])).body)
            path = f"{API}/versions/{job['result']['version']}/verify"
            return await self._done(await self._line.ask("POST", path))

    async def judge(self, _number: int) -> tuple[int, dict[str, str]]:
        """Every group of it is judged at once, and all of that is taken back."""
        path = f"{API}/datasets/{self._busy.dataset}/verdicts"
        with closing(self._line):
            given = await self._line.ask("POST", path, _json({"q": "", "state": "deferred"}))
            if given.status != 200:
                return given.status, given.headers
            batch = json.loads(given.body)["batch"]
            taken = await self._line.ask("POST", f"{API}/verdict-batches/{batch}/undo")
            return taken.status, taken.headers

    async def import_(self, _number: int) -> tuple[int, dict[str, str]]:
        """The command line brings the same groups into the home again, as another dataset."""
        name = f"import{next(self._turn)}"
        words = ("import", "soccernet-v3", str(self._busy.tree), "--dataset", name)
        command = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", SERVE, *words),
            cwd=ROOT,
            env={**os.environ, "TOUCHLINE_HOME": str(self._home)},
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
            state = json.loads((await self._line.ask("GET", place)).body)["state"]
            if state not in ("waiting", "running"):
                break
            await asyncio.sleep(LOOK)
        return (asked.status if state == "done" else 500), asked.headers


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()
