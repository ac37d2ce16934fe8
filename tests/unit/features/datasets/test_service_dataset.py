from __future__ import annotations

from dataclasses import replace

import pytest

from app.errors import InputError, NotFoundError
from app.features.datasets.service import get_dataset, get_dataset_head, list_datasets
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import ensure_dataset
from app.features.policies.service import change_policy
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.soccer.policy import PAPER, STRICT


class TestGetDataset:
    def test_finds_by_name_and_by_id(self, store) -> None:
        made = ensure_dataset(store, "spring 2030", "ann")
        found = get_dataset(store, "spring 2030")
        assert (found.id, found.name, found.policy) == (made, "spring 2030", PAPER)
        assert get_dataset(store, made) == get_dataset(store, str(made)) == found

    @pytest.mark.parametrize("name", ["", "12", "../up", "a/b", "x" * 101, "a\n", ".hidden", "ä"])
    def test_names_that_files_cannot_have_are_refused(self, store, name: str) -> None:
        with pytest.raises(InputError):
            ensure_dataset(store, name, "ann")

    def test_an_unknown_dataset_is_not_found(self, store) -> None:
        for name in ("nothing", "7", 7, "9" * 40, "٣"):
            with pytest.raises(NotFoundError):
                get_dataset(store, name)


class TestGetHead:
    def test_counts_no_group(self, store, counted) -> None:
        made = ensure_dataset(store, "spring 2030", "ann")
        with counted(store) as cost:
            found = get_dataset_head(store, "spring 2030")
        assert cost.statements == 1
        whole = get_dataset(store, made)
        assert (found.id, found.name, found.created, found.policy) == (
            made,
            whole.name,
            whole.created,
            PAPER,
        )


class TestListDatasets:
    def test_counts_states(self, store, fill, make_group) -> None:
        ensure_dataset(store, "empty", "ann")
        fill(make_group(7), make_group(8))
        demo, empty = list_datasets(store)
        assert (demo.name, demo.groups, demo.solved, demo.unreviewed) == ("demo", 2, 2, 2)
        assert (empty.name, empty.groups, empty.solved) == ("empty", 0, 0)


class TestSavePolicy:
    def test_leaves_groups_to_be_judged_anew(self, store, state) -> None:
        change_policy(store, "demo", STRICT, if_match=None, actor="ann")
        after = get_dataset(store, "demo")
        assert (after.policy, after.solved) == (STRICT, 0)
        now = load_group_state(store, state.id)
        assert now.solution is None
        assert now.etag != state.etag
        assert list_stale_groups(store, "demo") == [state.id]

    def test_calibrates_nothing_anew(self, store, state, monkeypatch) -> None:
        def refuse(*_):
            raise AssertionError("calibrated again")

        monkeypatch.setattr("app.solving.solve.calibrate_view", refuse)
        stricter = replace(STRICT, name="stricter", calibration=PAPER.calibration)
        change_policy(store, "demo", stricter, if_match=None, actor="ann")
        assert solve_dataset(store, "demo").failed == []

    def test_back_to_a_policy_everything_is_solved_already(self, store, state) -> None:
        change_policy(store, "demo", STRICT, if_match=None, actor="ann")
        change_policy(store, "demo", PAPER, if_match=None, actor="ann")
        assert get_dataset(store, "demo").solved == 1
        assert load_group_state(store, state.id).solution == state.solution
