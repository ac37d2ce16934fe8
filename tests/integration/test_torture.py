"""A short form of ``make torture``, and proof that each part sees what it is there to see."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from tests.cluster import ADVICE, find_programs
from tests.torture import commands, conditions, crowd, engines, flood, kills, power, upgrades
from tests.torture.counting import processor
from tests.torture.crowd import Load
from tests.torture.power import Acknowledge, Sync, Unlink, Write, cut_power, disk_at, parse


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a small solved dataset for each of two people; to be copied."""
    folder = tmp_path_factory.mktemp("torture")
    kills.prepare(folder / "home", folder, clients=2, groups=2)
    return folder / "home"


@pytest.fixture
def home(prepared: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(prepared, tmp_path / "home"))


class TestKills:
    def test_what_was_acknowledged_is_there_once_after_the_server_was_killed(
        self, home: Path
    ) -> None:
        found = kills.torture(home, kills=1, edits=24, clients=2, seed=1)
        assert (found.kills, found.faults) == (1, [])
        assert found.acknowledged >= 24

    def test_a_change_that_is_not_in_the_log_is_seen(self, home: Path) -> None:
        people = [
            kills.Client("http://127.0.0.1:1", f"client{number}", number, bool)
            for number in range(2)
        ]
        for person in people:
            # Nobody works: each ends where it would begin.
            person._http.close()
        assert kills.compare(home, people) == []
        people[1].said["edit"] += 1
        assert kills.compare(home, people) == [
            "client1: 1 of edit acknowledged, 0 in the log",
        ]


@pytest.mark.file_of_sqlite("what is written into the file, and synced")
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace records what is synced")
class TestPower:
    def test_what_was_acknowledged_is_there_after_the_power_was_cut(
        self, home: Path, tmp_path: Path
    ) -> None:
        steps = power.record(home, 4)
        found = cut_power(home, tmp_path / "cut", steps, cuts=20, seed=1)
        assert (found.acknowledged, found.cuts, found.faults) == (4, 20, [])

    def test_a_weaker_promise_loses_changes_and_is_seen(self, home: Path, tmp_path: Path) -> None:
        steps = power.record(home, 4, "NORMAL")
        assert cut_power(home, tmp_path / "cut", steps, cuts=20, seed=1).faults


STEPS = (
    Write("touchline.db", 2, b"XX"),
    Sync("touchline.db"),
    Write("touchline.db", 0, b"Y" * 1024),
    Acknowledge(),
    Unlink("touchline.db-wal"),
)
BEFORE = {"touchline.db": b"abcdef", "touchline.db-wal": b"w"}


def outcomes(cut: int) -> set[tuple[bytes | None, bool]]:
    """The database, and whether its write-ahead log is there, in whatever a cut may leave."""
    found = (disk_at(BEFORE, STEPS, cut, random.Random(seed)) for seed in range(200))
    return {(files.get("touchline.db"), "touchline.db-wal" in files) for files in found}


class TestDiskAt:
    def test_what_was_synced_is_certain(self) -> None:
        assert outcomes(2) == {(b"abXXef", True)}

    def test_what_was_not_synced_may_be_there_whole_torn_or_not_at_all(self) -> None:
        torn = b"Y" * 512
        assert outcomes(4) == {(b"abXXef", True), (torn, True), (b"Y" * 1024, True)}

    def test_a_file_that_was_taken_away_may_be_there_again(self) -> None:
        assert {present for _, present in outcomes(5)} == {True, False}


class TestParse:
    def test_reads_what_strace_says_of_the_database_alone(self) -> None:
        def text(value: str) -> str:
            return '"' + "".join(f"\\x{byte:02x}" for byte in value.encode()) + '"'

        lines = [
            f"7  openat(AT_FDCWD, {text('/home/touchline.db-wal')}, O_RDWR|O_CREAT, 0644) = 4",
            f"7  openat(AT_FDCWD, {text('/elsewhere/touchline.db')}, O_RDWR, 0644) = 5",
            f"7  pwrite64(4, {text('ab')}, 2, 32)  = 2",
            f"7  pwrite64(5, {text('ab')}, 2, 32)  = 2",
            "7  fsync(4)                          = 0",
            f'7  write(1, {text("acknowledged")[:-1]}\\x0a", 13) = 13',
            "7  ftruncate(4, 100)                 = 0",
            f"7  unlink({text('/home/touchline.db-wal')}) = 0",
            f"7  unlink({text('/home/touchline.db-journal')}) = -1 ENOENT (No such file)",
            "7  close(4)                          = 0",
            "7  fsync(4)                          = 0",
        ]
        assert list(parse(lines, Path("/home"))) == [
            Write("touchline.db-wal", 32, b"ab"),
            Sync("touchline.db-wal"),
            Acknowledge(),
            Write("touchline.db-wal", 100, None),
            Unlink("touchline.db-wal"),
        ]


class TestCommands:
    def test_an_import_that_was_killed_ends_the_same_the_second_time(self, tmp_path: Path) -> None:
        found = commands.torture(
            tmp_path / "commands", kills=1, groups=2, seed=2, commands=commands.COMMANDS[:1]
        )
        assert (found.kills, found.commands, found.faults) == (1, 1, [])


class TestCrowd:
    def test_people_on_the_same_groups_lose_no_change_and_meet_no_error(self, home: Path) -> None:
        found = crowd.crowd(home, people=4, seconds=3, think=0, seed=1)
        assert found.faults == []
        assert found.changes > 0
        assert found.lines()[0].startswith("4 people, 3 s: ")


class TestEngines:
    @pytest.mark.skipif(find_programs() is None, reason=ADVICE)
    @pytest.mark.file_of_sqlite("one of the two that are compared")
    def test_the_same_people_work_on_both_in_turns(self, home: Path, tmp_path: Path) -> None:
        told: list[str] = []
        folder = tmp_path / "engines"
        folder.mkdir()
        faults = engines.compare(
            home, folder, people=2, seconds=1, think=0, seed=1, tell=told.append, rounds=1
        )
        assert faults == []
        turns, told = told[:2], told[2:]
        assert [line.split(",")[0] for line in turns] == [*engines.ENGINES]
        assert [line.split()[2] for line in told[3:5]] == ["SQLite", "PostgreSQL"]
        assert told[5].startswith("  0 s  PostgreSQL to SQLite: changes/s ")
        # Its database has processes of its own, which do something; a file has none.
        database = [float(line.split()[-1]) for line in told[3:5]]
        assert database[0] == 0 < database[1]

    def test_who_is_first_in_one_round_is_last_in_the_next(self) -> None:
        assert [engines.order(turn)[0] for turn in range(engines.ROUNDS)] == [*engines.ENGINES]

    def test_turns_of_one_engine_are_one_row(self) -> None:
        turns = [
            Load(3, 2.0, changes=10, milliseconds={"ball": [10.0] * 99}, processor=(0.2, 0.1)),
            Load(3, 2.0, changes=30, milliseconds={"verdict": [90.0] * 2}, processor=(0.6, 0.1)),
        ]
        found = engines.row("PostgreSQL", 0.5, turns)
        assert (found.engine, found.think, found.changes) == ("PostgreSQL", 0.5, 10.0)
        assert (found.p50, found.p95, found.p99) == (10.0, 10.0, 90.0)
        assert (found.server, found.database) == pytest.approx((20.0, 5.0))


class TestProcessor:
    def test_children_count_while_they_run_and_once_they_have_ended(self) -> None:
        busy = "from time import process_time as t; end = t() + 0.2\nwhile t() < end: pass\n"
        script = (
            "import subprocess, sys\n"
            "def run(program): subprocess.run([sys.executable, '-c', program])\n"
            f"run({busy!r}); run({busy + 'print(flush=True); input()'!r})"
        )
        pipe = subprocess.PIPE
        with subprocess.Popen([sys.executable, "-c", script], stdin=pipe, stdout=pipe) as process:
            assert process.stdout is not None
            process.stdout.readline()
            assert processor(process.pid) >= 0.38
            process.communicate(b"\n")


class TestFlood:
    def test_too_many_clients_are_refused_and_a_reader_is_served(self, home: Path) -> None:
        # `make torture` has all attacks; these are the ones that hold on to something.
        hold = ("slow bodies", "streams", "uploads")
        told: list[str] = []
        assert flood.flood(home, flood.SHORT, times=None, only=hold, tell=told.append) == []
        assert len(told) == 1 + len(hold)

    def test_a_refusal_that_does_not_say_when_to_come_back_is_seen(self) -> None:
        async def refused(_number: int) -> tuple[int, dict[str, str]]:
            return 503, {}

        async def told(_number: int) -> tuple[int, dict[str, str]]:
            return 503, {"retry-after": "2"}

        seen = [
            flood.run(flood.Attack("uploads", 3, once, frozenset()), flood.Scale(0.05)).faults
            for once in (refused, told)
        ]
        assert seen == [["uploads: 503 without Retry-After"], []]

    def test_a_failure_a_slow_reader_and_memory_that_grows_are_seen(self) -> None:
        attack = flood.Attack("edits", 1, flood.nothing, frozenset({412}))
        quiet = flood.Seen("nobody", [20.0] * 10, 200)
        fine = flood.Seen("edits", [59.0] * 10, 480, Counter({412: 3, 503: 2}))
        assert flood.judged(fine, quiet, attack, 3.0) == []
        bad = flood.Seen("edits", [61.0] * 10, 501, Counter({500: 1}))
        assert flood.judged(bad, quiet, attack, 3.0) == [
            "edits: answers {500: 1}",
            "edits: the server took 501 MB",
            "edits: the reader waited 61 ms, 20 before",
        ]


class TestConditions:
    def test_a_clock_that_is_set_back_disturbs_nothing(self, home: Path) -> None:
        assert conditions.clock_set_back(home) == []

    @pytest.mark.file_of_sqlite("the disk that the file lies on")
    @pytest.mark.skipif(not conditions.can_mount(), reason="only root can mount a disk")
    def test_a_disk_that_fills_stops_changes_alone(self, home: Path) -> None:
        assert conditions.full_disk(home) == []


@pytest.mark.file_of_sqlite("homes of released versions, which had a file")
class TestUpgrades:
    def test_a_full_home_that_was_killed_midway_migrates_and_can_be_taken_back(
        self, tmp_path: Path
    ) -> None:
        assert upgrades.torture(tmp_path, kills=1, seed=1, revisions=("0004", "0011")) == []
