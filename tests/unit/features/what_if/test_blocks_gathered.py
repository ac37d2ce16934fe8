from __future__ import annotations

import json
import random
import shutil
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.db.store import Store
from app.errors import ConflictError, OverloadedError
from app.features.groups.edit import SetViewInclusion, make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.features.what_if import blocks as gathered
from app.features.what_if.blocks import DatasetBlocks
from app.features.what_if.funnel import count_yield
from app.features.what_if.service import WhatIfStore
from app.soccer.policy import PAPER, CalibrationPolicy
from tests.waiting import SECONDS

SPLITS = ("train", "valid", "test")


@pytest.fixture(autouse=True)
def small(store: Store, monkeypatch) -> Iterator[None]:
    """Blocks of three groups, written from the first on, and again after two changes."""
    for name, value in (("BLOCK", 3), ("WORTH_KEEPING", 1), ("FLUSH", 2)):
        monkeypatch.setattr(f"app.features.what_if.blocks.{name}", value)
    yield
    shutil.rmtree(store.settings.yields, ignore_errors=True)
    store.settings.yields.unlink(missing_ok=True)


@pytest.fixture
def anew(store: Store, tmp_path: Path):
    """Counts everything from the solutions, whatever was kept."""

    def count(values=None):
        class Elsewhere(WhatIfStore):
            def _folder(self, dataset_id: int) -> Path:
                return tmp_path / "elsewhere"

        shutil.rmtree(tmp_path / "elsewhere", ignore_errors=True)
        return count_yield(Elsewhere(store), 1, values)

    return count


def folder(store: Store) -> Path:
    return store.settings.yields / "1"


class TestInStep:
    def test_after_any_changes_it_is_what_counting_anew_gives(
        self, store, fill, make_group, anew
    ) -> None:
        rng = random.Random(3)
        ids = fill(*(make_group(number, split=rng.choice(SPLITS)) for number in range(7, 14)))
        numbers = dict(zip(ids, range(7, 14), strict=True))
        yields = WhatIfStore(store)
        asked = {"min_jac": 0.9, "max_sigma_m": 0.2, "tau_percent": 0.4}

        def edit() -> None:
            group = rng.choice(ids)
            name = f"{numbers[group]}{rng.choice(['', '_1'])}.png"
            change = rng.choice(
                [make_set_ball_edit(name, None), SetViewInclusion(name, rng.random() < 0.5)]
            )
            submit_edit(
                store, group, change, if_match=load_group_state(store, group).etag, actor="ann"
            )

        def take_back() -> None:
            group = rng.choice(ids)
            with suppress(ConflictError):
                undo_group_edit(
                    store, group, if_match=load_group_state(store, group).etag, actor="ann"
                )

        def bring() -> None:
            fill(make_group(rng.choice(range(14, 20))), solved=False)

        def solve() -> None:
            solve_dataset(store, "demo")

        def judge() -> None:
            policy = replace(PAPER, min_jac=rng.random())
            change_policy(store, "demo", policy, if_match=None, actor="ann")
            # Until then the table answers for groups that counting anew finds unsolved.
            solve_dataset(store, "demo")

        for _ in range(14):
            rng.choice([edit, edit, edit, take_back, bring, solve, judge])()
            if rng.random() < 0.3:
                yields = WhatIfStore(store)
            assert count_yield(yields, 1) == anew()
            assert count_yield(yields, 1, asked) == anew(asked)

    def test_an_edit_that_is_taken_back_is_seen(self, store, fill, make_group, anew) -> None:
        """Its solution is there from before: none is inserted."""
        (group, *_) = fill(make_group(7), make_group(8))
        yields = WhatIfStore(store)
        etag = load_group_state(store, group).etag
        etag = submit_edit(
            store, group, make_set_ball_edit("7.png", None), if_match=etag, actor="ann"
        ).etag
        assert count_yield(yields, 1).passing == 1
        undo_group_edit(store, group, if_match=etag, actor="ann")
        assert count_yield(yields, 1) == anew()
        assert count_yield(yields, 1).passing == 2

    def test_another_calibration_begins_anew(self, store, fill, make_group, anew) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        yields = WhatIfStore(store)
        assert count_yield(yields, 1).unsolved == 0
        other = replace(PAPER, calibration=CalibrationPolicy(robust_scale_px=3.0))
        change_policy(store, "demo", other, if_match=None, actor="ann")
        assert count_yield(yields, 1).unsolved == 5
        solve_dataset(store, "demo")
        assert count_yield(yields, 1) == anew()

    def test_groups_that_went_without_a_mark_are_seen(self, store, fill, make_group, anew) -> None:
        """As when the log is replayed, which says everything anew: at the next change of any."""
        (group, *_) = fill(*(make_group(number) for number in range(7, 12)))
        yields = WhatIfStore(store)
        yields.get_snapshot(1).blocks[0].block.__dict__["groups"] = 2
        submit_edit(
            store,
            group,
            make_set_ball_edit("7.png", None),
            if_match=load_group_state(store, group).etag,
            actor="ann",
        )
        assert count_yield(yields, 1) == anew()


class TestAfterARestart:
    def test_no_solution_is_read_again(self, store, fill, make_group, monkeypatch) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        before = count_yield(WhatIfStore(store), 1)
        monkeypatch.setattr("app.features.what_if.blocks.read_tables", None)
        assert count_yield(WhatIfStore(store), 1) == before

    def test_what_was_judged_is_not_judged_again(
        self, store, fill, make_group, monkeypatch
    ) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        before = count_yield(WhatIfStore(store), 1)
        monkeypatch.setattr("app.features.what_if.block_results.judge_groups", None)
        assert count_yield(WhatIfStore(store), 1) == before

    @pytest.mark.parametrize("name", ["table.json", "*.facts", "*.judged", "bare.heads"])
    def test_a_damaged_file_is_made_again(self, store, fill, make_group, name: str) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        before = count_yield(WhatIfStore(store), 1)
        for damage in (lambda old: b"", lambda old: old[: len(old) // 2], lambda old: b"x" * 500):
            path = sorted(folder(store).glob(name))[0]
            whole = path.read_bytes()
            path.unlink()
            path.write_bytes(damage(whole))
            assert count_yield(WhatIfStore(store), 1) == before

    def test_a_table_of_another_database_is_not_used(self, store, fill, make_group) -> None:
        """As after a restored backup, whose changes have the numbers of others."""
        fill(*(make_group(number) for number in range(7, 12)))
        count_yield(WhatIfStore(store), 1)
        path = folder(store) / "table.json"
        kept = json.loads(path.read_text())
        with store.read() as session:
            assert DatasetBlocks.load(session, folder(store), 1, kept["calibration"]) is not None
            path.write_text(json.dumps({**kept, "entry": [kept["entry"][0], "0" * 64]}))
            assert DatasetBlocks.load(session, folder(store), 1, kept["calibration"]) is None
            path.write_text(json.dumps({**kept, "mark": kept["mark"] + 1}))
            assert DatasetBlocks.load(session, folder(store), 1, kept["calibration"]) is None

    def test_a_full_disk_costs_no_answer(self, store, fill, make_group) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        store.settings.yields.parent.mkdir(exist_ok=True)
        store.settings.yields.write_text("")
        assert count_yield(WhatIfStore(store), 1).passing == 5

    def test_no_file_is_left_behind(self, store, fill, make_group) -> None:
        ids = fill(*(make_group(number) for number in range(7, 13)))
        yields = WhatIfStore(store)
        count_yield(yields, 1)
        for group, number in zip(ids, range(7, 13), strict=True):
            change = make_set_ball_edit(f"{number}.png", None)
            submit_edit(
                store, group, change, if_match=load_group_state(store, group).etag, actor="ann"
            )
            count_yield(yields, 1)
        blocks = {path.stem for path in folder(store).glob("*.facts")}
        named = {block.block.name for block in yields.get_snapshot(1).blocks}
        assert blocks == named - {""}


class TestHowFarItIs:
    def test_who_asks_before_all_is_read_is_told_and_answered_later(
        self, store, fill, make_group, monkeypatch
    ) -> None:
        fill(*(make_group(number) for number in range(7, 12)))
        monkeypatch.setattr("app.features.what_if.service.AT_ONCE", 4)
        yields = WhatIfStore(store)
        with pytest.raises(
            OverloadedError,
            match="the yield is being counted: 0 groups are read, about 5 are left",
        ):
            yields.get_snapshot(1)
        for _ in range(int(SECONDS / 0.02)):
            try:
                found = count_yield(yields, 1)
                break
            except OverloadedError:
                time.sleep(0.02)
        assert found.passing == 5

    def test_what_was_gathered_before_a_kill_is_not_gathered_again(
        self, store, fill, make_group, monkeypatch, anew
    ) -> None:
        ids = fill(*(make_group(number) for number in range(7, 17)))
        read, taken = gathered.read_tables, []

        def killed(session, rows):
            taken.extend(row.group_id for row in rows)
            if len(taken) > 6:
                raise KeyboardInterrupt
            return read(session, rows)

        monkeypatch.setattr(gathered, "read_tables", killed)
        with pytest.raises(KeyboardInterrupt):
            WhatIfStore(store).update_table(1)
        monkeypatch.setattr(
            gathered,
            "read_tables",
            lambda session, rows: taken.extend(row.group_id for row in rows) or read(session, rows),
        )
        found = count_yield(WhatIfStore(store), 1)
        assert np.unique(taken[:6]).tolist() == ids[:6]
        assert not set(taken[9:]) & set(ids[:6])
        assert found == anew()
