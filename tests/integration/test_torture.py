"""A short form of ``make torture``, and proof that each part sees what it is there to see."""

from __future__ import annotations

import asyncio
import random
import shutil
import subprocess
import sys
from collections import Counter
from contextlib import closing
from pathlib import Path

import pytest
from sqlalchemy import text

from app.config import Settings
from app.db.store import Store
from tests.cluster import ADVICE, find_programs
from tests.e2e.service import serving
from tests.torture import (
    attacks,
    commands,
    conditions,
    crowd,
    engines,
    flood,
    kills,
    power,
    upgrades,
)
from tests.torture.background import Background, Busy
from tests.torture.connection import Connection
from tests.torture.counting import processor
from tests.torture.crowd import Load
from tests.torture.person import Work
from tests.torture.power import cut_power, disk_at
from tests.torture.recording import Acknowledge, Name, Step, Sync, Write, parse, record


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
        steps = record(home, 4)
        found = cut_power(home, tmp_path / "cut", steps, cuts=20, seed=1)
        assert (found.acknowledged, found.uploads) == (4, 4)
        assert (found.cuts, found.faults) == (20, [])

    def test_a_weaker_promise_loses_changes_and_is_seen(self, home: Path, tmp_path: Path) -> None:
        steps = record(home, 4, "NORMAL")
        assert cut_power(home, tmp_path / "cut", steps, cuts=20, seed=1).faults

    def test_an_upload_whose_name_is_not_on_the_disk_is_lost_and_seen(
        self, home: Path, tmp_path: Path
    ) -> None:
        steps = record(home, 4, plant=power.WEAK)
        found = cut_power(home, tmp_path / "cut", steps, cuts=20, seed=1)
        assert found.faults
        assert all("uploads are not there" in fault for fault in found.faults)


STEPS = (
    Write("touchline.db", 2, b"XX"),
    Sync("touchline.db"),
    Write("touchline.db", 0, b"Y" * 1024),
    Acknowledge(),
    Name("touchline.db-wal", None),
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

    def test_a_name_is_certain_once_its_folder_was_synced(self) -> None:
        steps = [
            Name("new.part", "new.part"),
            Name("new.part/a", "a"),
            Write("new.part/a", 0, b"1"),
            Sync("new.part/a"),
            Sync("new.part"),
            Name("new.part", "new"),
        ]

        def found(steps: list[Step]) -> set[str]:
            """Where the file may be."""
            disks = (disk_at({}, steps, len(steps), random.Random(seed)) for seed in range(200))
            return {str(files) for files in disks}

        one, other = str({"new.part/a": b"1"}), str({"new/a": b"1"})
        assert found(steps) == {"{}", one, other}
        assert found([*steps, Sync(".")]) == {other}

    def test_what_gets_the_name_of_another_file_takes_its_place(self) -> None:
        steps = [Write("b", 0, b"1"), Sync("b"), Name("b", "b"), Name("b", "a"), Sync(".")]
        assert disk_at({"a": b"0"}, steps, 5, random.Random(1)) == {"a": b"1"}


def text_of(value: str) -> str:
    """A text as strace writes it."""
    return '"' + "".join(f"\\x{byte:02x}" for byte in value.encode()) + '"'


class TestParse:
    def test_reads_what_strace_says_of_the_home_alone(self) -> None:
        lines = [
            f"7  openat(AT_FDCWD, {text_of('/home/touchline.db-wal')}, O_RDWR|O_CREAT, 0644) = 4",
            f"7  openat(AT_FDCWD, {text_of('/elsewhere/touchline.db')}, O_RDWR, 0644) = 5",
            f"7  pwrite64(4, {text_of('ab')}, 2, 32)  = 2",
            f"7  pwrite64(5, {text_of('ab')}, 2, 32)  = 2",
            "7  fsync(4)                          = 0",
            f'7  write(1, {text_of("acknowledged ")[:-1]}\\x0a", 14) = 14',
            "7  ftruncate(4, 100)                 = 0",
            f"7  unlink({text_of('/home/touchline.db-wal')}) = 0",
            f"7  unlink({text_of('/home/touchline.db-journal')}) = -1 ENOENT (No such file)",
            "7  close(4)                          = 0",
            "7  fsync(4)                          = 0",
        ]
        assert list(parse(lines, Path("/home"))) == [
            Name("touchline.db-wal", "touchline.db-wal"),
            Write("touchline.db-wal", 32, b"ab"),
            Sync("touchline.db-wal"),
            Acknowledge(),
            Write("touchline.db-wal", 100, None),
            Name("touchline.db-wal", None),
        ]

    def test_a_file_keeps_its_first_path_whatever_its_folder_is_called(self) -> None:
        lines = [
            f"7  mkdir({text_of('/home/a.part')}, 0700) = 0",
            f"7  rename({text_of('/home/a.part')}, {text_of('/home/a')}) = 0",
            f"7  openat(AT_FDCWD, {text_of('/home/a/b')}, O_WRONLY|O_CREAT|O_TRUNC, 0644) = 4",
            f"7  write(4, {text_of('ab')}, 2)  = 2",
            f"7  write(4, {text_of('c')}, 1)  = 1",
            f"7  openat(AT_FDCWD, {text_of('/home')}, O_RDONLY) = 5",
            "7  fsync(5) = 0",
            f"7  unlink({text_of('/home/a/b')}) = 0",
            f"7  openat(AT_FDCWD, {text_of('/home/a/b')}, O_WRONLY|O_CREAT, 0644) = 4",
        ]
        assert list(parse(lines, Path("/home"))) == [
            Name("a.part", "a.part"),
            Name("a.part", "a"),
            Name("a.part/b", "b"),
            Write("a.part/b", 0, None),
            Write("a.part/b", 0, b"ab"),
            Write("a.part/b", 2, b"c"),
            Sync("."),
            Name("a.part/b", None),
            Name("a.part/b#1", "b"),
        ]


class TestCommands:
    def test_each_command_that_was_killed_ends_the_same_the_second_time(
        self, tmp_path: Path
    ) -> None:
        found = commands.torture(tmp_path / "commands", kills=1, groups=2, seed=2)
        assert (found.kills, found.commands, found.faults) == (5, 5, [])

    def test_a_row_and_a_file_that_differ_are_seen(
        self, home: Path, prepared: Path, tmp_path: Path
    ) -> None:
        calm = Path(shutil.copytree(prepared, tmp_path / "calm"))
        for one in (calm, home):
            (one / "out").mkdir()
            (one / "out" / "a.json").write_text("{}")
        assert commands.differences(calm, home) == []
        (home / "out" / "a.json").write_text("{} ")
        with closing(Store.open(Settings(home=home))) as store, store.write() as session:
            session.execute(text("UPDATE groups SET inputs_hash = 'another' WHERE id = 1"))
        found = commands.differences(calm, home)
        assert found[:2] == ["groups differ", "a.json differ"]
        # Nor is it what was said of the group.
        assert "1 with a digest that does not match the annotations: group 1" in found[2:]


class TestCrowd:
    def test_people_on_the_same_groups_lose_no_change_and_meet_no_error(self, home: Path) -> None:
        found = crowd.crowd(home, people=4, seconds=3, think=0, seed=1)
        assert found.faults == []
        assert found.changes > 0
        assert found.lines()[0].startswith("4 people, 3 s: ")
        assert found.clients > 0

    def test_a_change_that_is_lost_a_failure_and_a_state_that_comes_twice_are_seen(self) -> None:
        sound = Work({"ball": [1.0]}, {200: 3, 412: 1}, [(1, "a"), (1, "b"), (2, "a")])
        other = Work({"ball": [2.0]}, {200: 1}, [(2, "b")])
        load = crowd.gathered(2, 1.0, [sound, other], {1: 2, 2: 2})
        assert (load.faults, load.changes, load.stale) == ([], 4, 1)
        assert load.milliseconds == {"ball": [1.0, 2.0]}
        assert crowd.gathered(2, 1.0, [sound, other], {1: 1, 2: 2}).faults == [
            "group 1: 2 changes accepted, 1 in its history"
        ]
        worse = Work({}, {500: 1, 200: 1}, [(2, "a")], ["EOFError: "])
        assert crowd.gathered(2, 1.0, [sound, worse], {1: 2, 2: 2}).faults == [
            "EOFError: ",
            "answers that were neither 200 nor 412: {500: 1}",
            "group 2: two changes led to one state",
        ]


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
    def test_too_many_clients_are_refused_and_quiet_people_are_served(self, home: Path) -> None:
        # `make torture` has all attacks; these are the ones that hold on to something.
        hold = ("slow bodies", "streams", "uploads")
        told: list[str] = []
        assert flood.flood(home, attacks.SHORT, times=None, only=hold, tell=told.append) == []
        assert len(told) == 2 + len(hold)
        # A line of each has what each of the quiet parties waited.
        assert not [line for line in told if "nan" in line]

    def test_long_work_comes_to_its_end_and_work_that_fails_is_seen(
        self, home: Path, prepared: Path
    ) -> None:
        with serving(home) as address:
            line = Connection(int(address.rpartition(":")[2]))
            trees = prepared.parent / "tree", prepared.parent / "none"
            work, failing = (Background(line, home, Busy("client1", tree)) for tree in trees)

            async def all_of_it() -> list[int]:
                long = (
                    work.solve,
                    work.export,
                    work.freeze,
                    work.judge,
                    work.import_,
                    failing.import_,
                )
                return [(await once(0))[0] for once in long]

            assert asyncio.run(all_of_it()) == [202, 202, 202, 200, 200, 500]

    def test_a_refusal_that_does_not_say_when_to_come_back_is_seen(self) -> None:
        async def refused(_number: int) -> tuple[int, dict[str, str]]:
            return 503, {}

        async def told(_number: int) -> tuple[int, dict[str, str]]:
            return 503, {"retry-after": "2"}

        seen = [
            flood.run(attacks.Attack("uploads", 3, once, frozenset()), attacks.Scale(0.05)).faults
            for once in (refused, told)
        ]
        assert seen == [["uploads: 503 without Retry-After"], []]

    def test_a_failure_a_flood_without_refusals_slow_answers_and_memory_are_seen(self) -> None:
        attack = attacks.Attack("uploads", 1, attacks.nothing, frozenset({201}), frozenset({503}))
        quiet = flood.Seen("nobody", {"reader": [20.0] * 10, "editor": [2.0] * 10}, 200)
        times = {"reader": [59.0] * 10, "editor": [14.0] * 10}
        fine = flood.Seen("uploads", times, 480, Counter({201: 3, 503: 2}))
        assert flood.judged(fine, quiet, attack, 3.0) == []
        times = {"reader": [61.0] * 10, "editor": [16.0] * 10}
        bad = flood.Seen("uploads", times, 501, Counter({201: 3, 500: 1}))
        assert flood.judged(bad, quiet, attack, 3.0) == [
            "uploads: answers {500: 1}",
            "uploads: nobody was answered with 503",
            "uploads: the server took 501 MB",
            "uploads: the reader waited 61 ms, 20 before",
            "uploads: the editor waited 16 ms, 2 before",
        ]
        assert len(flood.judged(bad, quiet, attack, None)) == 3


class TestConditions:
    def test_frames_that_are_taken_away_cost_the_frames_alone(self, tmp_path: Path) -> None:
        assert conditions.frames_gone(tmp_path) == []

    @pytest.mark.file_of_sqlite("a page of its file")
    def test_a_page_that_is_lost_meanwhile_stops_changes_with_a_sentence(self, home: Path) -> None:
        assert conditions.damaged_meanwhile(home) == []

    def test_a_server_that_starts_falls_over_or_says_something_else_is_seen(self) -> None:
        condition = conditions.CONDITIONS[0]
        said = "this home is of a newer version\nof Touchline"
        assert conditions.judged(condition, 1, said) == []
        assert conditions.judged(condition, None, said) == ["newer schema: the server started"]
        assert conditions.judged(condition, 0, said) == [
            "newer schema: the server ended as if all were well"
        ]
        assert conditions.judged(condition, 1, "Traceback") == [
            "newer schema: the server fell over: Traceback",
            "newer schema: the server says 'Traceback'",
        ]

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

    def test_what_people_said_is_there_after_the_newest_migration(
        self, home: Path, tmp_path: Path
    ) -> None:
        assert upgrades.carry(home, tmp_path) == []


VIEWS: upgrades.Rows = {"view": [{"id": 1, "lines": "{}"}, {"id": 2, "lines": "[1]"}]}


class TestLost:
    def test_a_column_that_is_emptied_and_a_row_that_is_gone_are_named(self) -> None:
        emptied: upgrades.Rows = {"view": [{"id": 1, "lines": ""}, {"id": 2, "lines": ""}]}
        assert upgrades.lost(VIEWS, emptied) == ["view.lines"]
        gone: upgrades.Rows = {"view": VIEWS["view"][:1]}
        assert upgrades.lost(VIEWS, gone) == ["view.id", "view.lines"]
        assert upgrades.lost(VIEWS, {"view": []}) == ["view"]

    def test_what_a_new_schema_adds_or_has_no_room_for_is_not_lost(self) -> None:
        grown = [{"id": 1, "ball": None}, {"id": 2, "ball": None}, {"id": 3, "ball": None}]
        assert upgrades.lost(VIEWS, {"view": grown, "ball": []}) == []
        assert upgrades.lost(VIEWS, {}) == []


class TestDifferences:
    def test_another_value_and_a_table_that_one_has_alone_are_named(self) -> None:
        one: upgrades.Rows = {"view": [{"id": 1}], "installation": [{"id": "a"}]}
        assert upgrades.differences(one, one | {"installation": [{"id": "b"}]}) == []
        assert upgrades.differences(one, {"view": [{"id": 2}], "ball": []}) == ["ball", "view"]
