"""The sample as a dataset: made once, completed where it is not complete."""

from __future__ import annotations

from contextlib import nullcontext

import numpy as np
import pytest

from app.db.log import read_log
from app.db.store import Store
from app.errors import JobCancelled
from app.features.datasets.service import get_dataset, list_datasets
from app.features.practice.service import (
    SampleDataset,
    make_practice_dataset,
    make_sample_dataset,
)
from app.sample import SampleOrder
from app.sample.scene import read_truth
from app.sample.write import SampleReport

ORDER = SampleOrder(groups=2, seed=3, labels_only=True)


def make(store: Store, progress=lambda *_: None) -> SampleDataset:
    folder = store.settings.home / "sample"
    return make_sample_dataset(
        store, "drawn", folder, ORDER, nullcontext, progress, workers=1, actor="ann"
    )


def test_it_is_drawn_imported_and_solved(store: Store) -> None:
    made = make(store)
    assert (made.dataset, made.groups, made.solved, made.is_complete) == ("drawn", 2, 2, True)
    assert isinstance(made.written, SampleReport)
    assert len(read_truth(store.settings.home / "sample")) == 2
    assert get_dataset(store, "drawn").solved == 2


def test_a_complete_one_is_left_alone(store: Store) -> None:
    make(store)
    truth = store.settings.home / "sample" / "truth.json"
    truth.unlink()
    again = make(store)
    assert (again.written, again.groups, again.solved) == (None, 2, 2)
    assert not truth.exists()


def test_one_that_was_stopped_before_it_was_solved_is_completed(store: Store) -> None:
    def stop(_done: int, _total: int | None = None, _sentence: str = "", /) -> None:
        if any(item.groups for item in list_datasets(store)):
            raise JobCancelled

    with pytest.raises(JobCancelled):
        make(store, stop)
    left = get_dataset(store, "drawn")
    assert left.solved < left.groups
    assert make(store).is_complete


def test_practice_groups_that_were_stopped_before_they_were_solved_are_completed(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    blank = np.zeros((720, 1280, 3), np.uint8)
    monkeypatch.setattr("app.features.practice.lessons.render_view", lambda _scene, _key: blank)

    def stop(_done: int, _total: int | None = None, sentence: str = "", /) -> None:
        if sentence == "Solving the groups.":
            raise JobCancelled

    with pytest.raises(JobCancelled):
        make_practice_dataset(store, store.settings, stop, actor="ann")
    assert get_dataset(store, "practice").solved < 8
    make_practice_dataset(store, store.settings, lambda *_: None, actor="ann")
    assert get_dataset(store, "practice").solved == 8


def test_the_log_says_who_made_it(store: Store) -> None:
    make(store)
    with store.read() as session:
        assert {entry.actor for entry in read_log(session)} == {"ann"}
