"""Commands that are killed and given again end as if nothing had happened."""

from __future__ import annotations

import hashlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sqlalchemy import text

from app.config import Settings
from app.db.store import Store
from app.features.integrity.checks import examine_database
from app.formats.manifest import MANIFEST
from tests.e2e.service import ROOT, SERVE, run_touchline
from tests.starting import Process

COMMANDS = (
    "import soccernet-v3 {tree} --dataset torture",
    "solve --dataset torture --workers 2",
    "freeze first --dataset torture --groups passing",
    "export --dataset torture --version first --format soccernet-v3d {out}",
    "datasets delete torture --yes",
)
"""One after the other, each on what the last one left."""
PICTURES = (
    "import soccernet-v3 {tree} --dataset torture --policy touchline",
    "paint torture",
    "solve --dataset torture --workers 2",
    "propose --dataset torture",
    "freeze first --dataset torture --groups passing",
    "verify first --dataset torture --workers 2",
)
"""The same where the pictures count; in each group one view has no line, another a single one."""
CONTENTS = {
    "groups": "SELECT key, inputs_hash, source_hash FROM groups ORDER BY key",
    "solutions": "SELECT g.key, s.inputs_hash, s.policy_hash, s.summary, s.body"
    " FROM solution s JOIN groups g ON g.id = s.group_id ORDER BY 1, 2, 3",
    "calibrations": "SELECT key, body FROM calibration ORDER BY key",
    "paint": "SELECT digest, reason, body FROM paint_evidence ORDER BY digest",
    "proposals": "SELECT g.key, v.key, p.outcome, p.sentence, p.lines, p.beside, p.frame, p.sought_with"
    " FROM proposal p"
    " JOIN view v ON v.id = p.view_id JOIN groups g ON g.id = v.group_id ORDER BY 1, 2",
    "queue": "SELECT key, solved, passes, findings, value FROM queue ORDER BY key",
    "versions": "SELECT name, hash FROM version ORDER BY name",
    "log": "SELECT kind, count(*) FROM log GROUP BY kind ORDER BY kind",
}
"""What must be the same; times and ids may differ."""

TIMES = ("date", "created")
"""What a manifest says of the time: each of the two homes froze its version at its own."""


@dataclass
class Report:
    """What a run came to; ``faults`` are sentences, none where all is well."""

    kills: int = 0
    commands: int = 0
    faults: list[str] = field(default_factory=list)


def torture(
    folder: Path,
    *,
    kills: int,
    groups: int,
    seed: int,
    commands: tuple[str, ...] = COMMANDS,
    pictures: bool = False,
    tell: Callable[[str], None] = lambda _sentence: None,
) -> Report:
    """Give each command once undisturbed, and once with that many kills before it may end.

    Args:
        folder: Where homes and files go; what is in it is replaced.
        kills: How often each command is killed with SIGKILL, at random moments.
        groups: Size of the dataset.
        seed: Decides about the moments.
        commands: Which ones, in order.
        pictures: Whether the dataset has its frames, and views without enough lines.
        tell: Called with each sentence worth reading.
    """
    shutil.rmtree(folder, ignore_errors=True)
    tree = folder / "tree"
    calm, killed = folder / "calm", folder / "killed"
    whole = "" if pictures else "--labels-only "
    run_touchline(calm, "migrate", f"sample --workers 1 --groups {groups} {whole}{tree}")
    if pictures:
        _take_lines_away(tree)
    shutil.copytree(calm, killed)
    report, chance = Report(), random.Random(seed)
    for command in commands:
        start = time.monotonic()
        refusal = _run(calm, _filled(command, tree, calm))
        if refusal:
            raise AssertionError(f"{command}: {refusal}")
        seconds = time.monotonic() - start
        for _ in range(kills):
            _run(
                killed, _filled(command, tree, killed), kill_after=chance.uniform(0.1, 1) * seconds
            )
            report.kills += 1
        # One that was done when it was killed may say so: what counts is what is there.
        refusal = _run(killed, _filled(command, tree, killed))
        report.commands += 1
        name = command.split(" ", 1)[0]
        found = [f"{name}: {fault} {refusal}".strip() for fault in differences(calm, killed)]
        report.faults += found
        tell(f"{name} after {kills} kills: {'; '.join(found) or 'the same'}")
    if pictures:
        report.faults += [
            f"no {name} to compare" for name in ("paint", "proposals") if _is_empty(calm, name)
        ]
    return report


def _take_lines_away(tree: Path) -> None:
    """Leave the first replay of each group without a line, and one line to the second."""
    for path in tree.rglob("Labels-v3.json"):
        labels = json.loads(path.read_text("utf-8"))
        for name, replay in labels["replays"].items():
            if name.endswith(("_1.png", "_2.png")):
                replay["lines"] = replay["lines"][: name.endswith("_2.png")]
        path.write_text(json.dumps(labels), "utf-8")


def _filled(command: str, tree: Path, home: Path) -> str:
    return command.format(tree=tree, out=home / "out")


def _run(home: Path, command: str, kill_after: float | None = None) -> str:
    """Run a command, to its end or until it is killed; returns why it was refused, if it was."""
    process = Process(
        [sys.executable, "-c", SERVE, *command.split(" ")],
        cwd=ROOT,
        env={**os.environ, "TOUCHLINE_HOME": str(home)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        _, errors = process.communicate(timeout=kill_after)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return ""
    return errors if process.returncode else ""


def differences(calm: Path, killed: Path) -> list[str]:
    """What the two homes do not have in common, and what the doctor finds."""
    one, two = _contents(calm), _contents(killed)
    faults = [f"{name} differ" for name in one if one[name] != two[name]]
    store = Store.open(Settings(home=killed))
    try:
        return faults + [check.sentence for check in examine_database(store) if not check.ok]
    finally:
        store.close()


def _contents(home: Path) -> dict[str, str]:
    """A digest of each table, and of each exported file."""
    store = Store.open(Settings(home=home))
    try:
        with store.read() as session:
            found = {
                name: _digest(str(session.execute(text(statement)).all()).encode())
                for name, statement in CONTENTS.items()
            }
    finally:
        store.close()
    out = home / "out"
    files = sorted(path for path in out.rglob("*") if path.is_file()) if out.exists() else []
    return {**found, **{str(path.relative_to(out)): _digest(_timeless(path)) for path in files}}


def _timeless(path: Path) -> bytes:
    """Content of an exported file; a manifest without when its version was frozen."""
    content = path.read_bytes()
    if path.name != MANIFEST:
        return content

    def without_times(said: dict[str, Any]) -> dict[str, Any]:
        return {key: value for key, value in said.items() if key not in TIMES}

    return json.dumps(json.loads(content, object_hook=without_times)).encode()


def _is_empty(home: Path, name: str) -> bool:
    store = Store.open(Settings(home=home))
    try:
        with store.read() as session:
            return session.execute(text(CONTENTS[name])).first() is None
    finally:
        store.close()


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
