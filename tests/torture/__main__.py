"""``make torture``: kills, power cuts, killed commands, a crowd and a flood; 1 where one finds fault."""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from tests.cluster import ADVICE, find_programs
from tests.torture import (
    background,
    cluster,
    commands,
    conditions,
    crowd,
    engines,
    flood,
    kills,
    people,
    power,
    recording,
    upgrades,
)

SEED = 20260101
ENGINES_GROUPS = 60
PEOPLES_GROUPS = 500
"""So many that fifty people find work for a minute."""


def main() -> int:
    """Run what is asked for; 1 where one finds fault."""
    parser = argparse.ArgumentParser(prog="python -m tests.torture", description=__doc__)
    parser.add_argument("--kills", type=int, default=60, help="of the server (60)")
    parser.add_argument("--edits", type=int, default=30_000, help="acknowledged changes (30000)")
    parser.add_argument("--clients", type=int, default=4, help="people who work at once (4)")
    parser.add_argument("--cuts", type=int, default=400, help="of the power (400)")
    parser.add_argument("--command-kills", type=int, default=5, help="of each command (5)")
    parser.add_argument("--groups", type=int, default=120, help="that commands work on (120)")
    parser.add_argument("--people", type=int, default=50, help="who annotate at once (50)")
    parser.add_argument("--seconds", type=float, default=120, help="for how long (120)")
    parser.add_argument("--think", type=float, default=3, help="mean seconds between requests (3)")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--only", choices=PARTS, action="append", help="a part; all without it")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="touchline-torture-") as name:
        folder = Path(name)
        chosen = [PARTS[name] for name in asked.only or PARTS]
        faults = [fault for part in chosen for fault in part(folder, asked)]
    for fault in faults:
        print(f"FAULT {fault}")
    return 1 if faults else 0


def _kills(folder: Path, asked: argparse.Namespace) -> list[str]:
    home = folder / "home"
    kills.prepare(home, folder / "files", clients=asked.clients, groups=12)
    found = kills.torture(
        home,
        kills=asked.kills,
        edits=asked.edits,
        clients=asked.clients,
        seed=asked.seed,
        tell=print,
    )
    print(
        f"{found.kills} kills, {found.acknowledged} changes acknowledged, "
        f"{found.repeated} requests sent again: {len(found.faults)} faults"
    )
    return found.faults


def _cuts(folder: Path, asked: argparse.Namespace) -> list[str]:
    if shutil.which("strace") is None:
        sentence = "power cuts need strace (Debian: apt-get install strace)"
        print(f"Skipped: {sentence}")
        return [sentence] if "cuts" in (asked.only or []) else []
    home = folder / "power"
    kills.prepare(home, folder / "power-files", clients=1, groups=2)
    steps = recording.record(home, 60)
    found = power.cut_power(home, folder / "cut", steps, cuts=asked.cuts, seed=asked.seed)
    # The same with a weaker promise must lose something, else the cuts show nothing.
    weak = {
        "with synchronous=NORMAL": ("NORMAL", ""),
        "without syncing folders": ("FULL", power.WEAK),
    }
    seen = {}
    for words, promise in weak.items():
        kept = recording.record(home, 60, *promise)
        lost = power.cut_power(home, folder / "cut", kept, cuts=asked.cuts, seed=asked.seed)
        seen[words] = len(lost.faults)
    print(
        f"{found.cuts} power cuts among {found.acknowledged} acknowledged changes and "
        f"{found.uploads} uploads: {len(found.faults)} faults; "
        + ", ".join(f"{words} {number}" for words, number in seen.items())
    )
    return found.faults + [f"{words}: nothing was seen" for words in seen if not seen[words]]


def _commands(folder: Path, asked: argparse.Namespace) -> list[str]:
    found = commands.torture(
        folder / "commands",
        kills=asked.command_kills,
        groups=asked.groups,
        seed=asked.seed,
        tell=print,
    )
    print(f"{found.commands} commands, {found.kills} kills: {len(found.faults)} faults")
    return found.faults


def _pictures(folder: Path, asked: argparse.Namespace) -> list[str]:
    found = commands.torture(
        folder / "pictures",
        kills=asked.command_kills,
        groups=max(2, asked.groups // 6),
        seed=asked.seed,
        commands=commands.PICTURES,
        pictures=True,
        tell=print,
    )
    print(f"{found.commands} commands on pictures, {found.kills} kills: {len(found.faults)} faults")
    return found.faults


def _cluster(folder: Path, asked: argparse.Namespace) -> list[str]:
    found = cluster.torture(
        folder / "cluster",
        kills=4 * asked.command_kills,
        groups=2 * asked.groups,
        seed=asked.seed,
        tell=print,
    )
    print(
        f"{found.commands} times solved on a cluster, {found.kills} of its members killed: "
        f"{len(found.faults)} faults"
    )
    return found.faults


def _crowd(folder: Path, asked: argparse.Namespace) -> list[str]:
    home = folder / "crowd"
    kills.prepare(home, folder / "crowd-files", clients=1, groups=60)
    faults = []
    for number in (1, asked.people):
        # Somebody who says what was said before changes nothing, and is no entry of a history.
        seed = asked.seed + 1000 * number
        found = crowd.crowd(
            home, people=number, seconds=asked.seconds, think=asked.think, seed=seed
        )
        print("\n".join(found.lines()))
        faults += found.faults
    return faults


def _engines(folder: Path, asked: argparse.Namespace) -> list[str]:
    if find_programs() is None:
        print(f"Skipped: {ADVICE}")
        return [ADVICE] if "engines" in (asked.only or []) else []
    home = folder / "engines"
    kills.prepare(home, folder / "engines-files", clients=1, groups=ENGINES_GROUPS)
    return engines.compare(
        home,
        folder,
        people=asked.people,
        seconds=asked.seconds,
        think=asked.think,
        seed=asked.seed,
        tell=print,
    )


def _people(folder: Path, asked: argparse.Namespace) -> list[str]:
    homes = [folder / "people-alone", folder / "people-team"]
    kills.prepare(homes[0], folder / "people-files", clients=1, groups=PEOPLES_GROUPS)
    shutil.copytree(*homes)
    with ExitStack() as stack:
        offices = [
            stack.enter_context(
                people.office(
                    home, people=asked.people, think=asked.think, seed=asked.seed, team=team
                )
            )
            for home, team in zip(homes, (False, True), strict=True)
        ]
        for turn in range(people.TURNS):
            for office in offices[:: 1 if turn % 2 == 0 else -1]:
                office.work(asked.seconds / people.TURNS / 2)
    loads = [office.ended() for office in offices]
    for load, words in zip(loads, ("without accounts and leases", "in a team"), strict=True):
        print("\n".join([f"{words}:", *people.told(load.costs), *load.lines()]))
    lines, ratio = people.compare(*loads)
    print("\n".join(lines))
    slow = [f"p99 is {ratio:.2f} times that of the same load alone"] if ratio > people.RATIO else []
    return [*loads[0].faults, *loads[1].faults, *slow]


def _flood(folder: Path, asked: argparse.Namespace) -> list[str]:
    home = folder / "flood"
    kills.prepare(home, folder / "flood-files", clients=1, groups=12)
    planted = Path(shutil.copytree(home, folder / "flood-planted"))
    busy = background.prepare(home, folder)
    print("Quiet people, alone and beside somebody who asks for too much, or has long work done")
    faults = flood.flood(home, busy=busy, tell=print)
    # Where nobody is refused, the flood must say so, else what it says shows nothing.
    seen = flood.flood(planted, times=None, only=("uploads",), plant=flood.UNBOUNDED)
    return faults if seen else [*faults, "flood: the planted fault was not seen"]


def _conditions(folder: Path, asked: argparse.Namespace) -> list[str]:
    home = folder / "conditions"
    kills.prepare(home, folder / "conditions-files", clients=1, groups=4)
    return conditions.torture(home, folder / "spoilt", tell=print)


def _upgrades(folder: Path, asked: argparse.Namespace) -> list[str]:
    home = folder / "upgrades-home"
    kills.prepare(home, folder / "upgrades-files", clients=1, groups=4)
    return [
        *upgrades.torture(folder / "upgrades", kills=3, seed=asked.seed, tell=print),
        *upgrades.carry(home, folder / "carried"),
    ]


PARTS = {
    "kills": _kills,
    "cuts": _cuts,
    "commands": _commands,
    "pictures": _pictures,
    "cluster": _cluster,
    "crowd": _crowd,
    "people": _people,
    "engines": _engines,
    "flood": _flood,
    "conditions": _conditions,
    "upgrades": _upgrades,
}


if __name__ == "__main__":
    sys.exit(main())
