from __future__ import annotations

import random
import shutil
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.policies.service import change_policy
from app.features.queue.statistics import read_statistics
from app.features.solutions.service import solve_dataset
from app.features.verdicts.bulk import give_verdicts, list_bulk_verdicts
from app.features.verdicts.bulk_undo import undo_bulk_verdict
from app.features.what_if import statistics as kept
from app.features.what_if.statistics import StatisticsCache
from app.soccer.policy import PAPER

SPLITS = ("train", "valid", "test")


@pytest.fixture(autouse=True)
def small(store: Store, monkeypatch) -> Iterator[None]:
    """Written from the first group on, and again after two changes; read two at a time."""
    for name, value in (("BATCH", 2), ("CHUNK", 2), ("WORTH_KEEPING", 1), ("FLUSH", 2)):
        monkeypatch.setattr(f"app.features.what_if.statistics.{name}", value)
    yield
    shutil.rmtree(store.settings.yields, ignore_errors=True)


@pytest.fixture
def looked(monkeypatch) -> list[int]:
    """Fills with one number a look that read every group."""
    looks: list[int] = []
    gathered = kept._read_all_columns
    monkeypatch.setattr(kept, "_read_all_columns", lambda *args: looks.append(1) or gathered(*args))
    return looks


def file(store: Store) -> Path:
    return store.settings.yields / "statistics" / "1.counted"


def test_after_any_changes_they_are_those_of_reading_all(store, fill, make_group, looked) -> None:
    rng = random.Random(5)
    ids = fill(*(make_group(number, split=rng.choice(SPLITS)) for number in range(7, 12)))
    names = dict(zip(ids, range(7, 12), strict=True))
    held = StatisticsCache(store)

    def edit() -> None:
        group = rng.choice(ids)
        change = make_set_ball_edit(f"{names[group]}.png", None)
        submit_edit(store, group, change, if_match=load_group_state(store, group).etag, actor="ann")

    def take_back() -> None:
        group = rng.choice(ids)
        with suppress(ConflictError):
            undo_group_edit(store, group, if_match=load_group_state(store, group).etag, actor="ann")

    def bring() -> None:
        fill(make_group(rng.choice(range(14, 18))), solved=False)

    def solve() -> None:
        solve_dataset(store, "demo")

    def judge() -> None:
        give_verdicts(store, 1, "passes:yes", "accepted", actor="ben", note="seen")

    def take_back_all() -> None:
        standing = [batch for batch in list_bulk_verdicts(store, 1) if batch.undone is None]
        if standing:
            undo_bulk_verdict(store, standing[0].id, actor="ben")

    def move() -> None:
        policy = replace(PAPER, min_jac=rng.choice([0.5, 0.999]))
        change_policy(store, "demo", policy, if_match=None, actor="ann")

    steps = [edit, take_back, bring, solve, judge, take_back_all, move, judge, edit, solve]
    for step in (*steps, *(rng.choice(steps) for _ in range(6))):
        step()
        if rng.random() < 0.3:
            held = StatisticsCache(store)
        assert held.get_statistics(1) == read_statistics(store, 1), step.__name__
    # Another policy, and a group that came: nothing else is worth reading all.
    assert 1 <= len(looked) <= 1 + sum(step is move for step in steps) + 6


def test_one_change_reads_one_group_also_after_a_restart(store, fill, make_group, looked) -> None:
    (group, *_) = fill(*(make_group(number) for number in range(7, 12)))
    StatisticsCache(store).get_statistics(1)
    assert len(looked) == 1
    etag = load_group_state(store, group).etag
    submit_edit(store, group, make_set_ball_edit("7.png", None), if_match=etag, actor="ann")
    give_verdicts(store, 1, "passes:no", "rejected", "other", "no ball", actor="ben")
    assert StatisticsCache(store).get_statistics(1) == read_statistics(store, 1)
    assert len(looked) == 1


def test_what_the_cache_lost_or_got_wrong_is_read_anew(store, fill, make_group, looked) -> None:
    fill(*(make_group(number) for number in range(7, 12)))
    whole = StatisticsCache(store).get_statistics(1)
    good = file(store).read_bytes()
    for bad in (b"", good[:-70], good[:-40] + bytes([good[-40] ^ 1]) + good[-39:]):
        file(store).write_bytes(bad)
        assert StatisticsCache(store).get_statistics(1) == whole
    assert len(looked) == 4


def test_a_file_of_another_database_is_not_used(
    store, fill, make_group, looked, monkeypatch
) -> None:
    fill(*(make_group(number) for number in range(7, 12)))
    StatisticsCache(store).get_statistics(1)
    monkeypatch.setattr(kept, "read_entry_hash", lambda *_: "another")
    StatisticsCache(store).get_statistics(1)
    assert len(looked) == 2


def test_there_is_nothing_of_a_dataset_that_is_not_there(store) -> None:
    with pytest.raises(NotFoundError):
        StatisticsCache(store).get_statistics(99)


def test_groups_take_29_bytes_each(store, fill, make_group) -> None:
    fill(*(make_group(number) for number in range(7, 12)))
    held = StatisticsCache(store)
    held.get_statistics(1)
    counted = held._kept[1].counted
    size = 8 + sum(getattr(counted, name)[..., :1].nbytes for name in kept._ARRAYS)
    assert size == 8 + 4 + 4 + 1 + 1 + 2 + 9
    assert np.all(np.diff(held._kept[1].group_id) > 0)
