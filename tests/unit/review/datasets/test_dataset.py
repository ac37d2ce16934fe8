from __future__ import annotations

import pytest

from app.errors import ConflictError, InputError, NotFoundError
from app.review.datasets.dataset import create_dataset, get_dataset, list_datasets, set_policy
from app.review.editing.recompute import solve_dataset, stale_groups
from app.review.editing.submit import load
from app.soccer.policy import PAPER, STRICT


class TestCreateDataset:
    def test_is_found_by_name_and_by_id(self, store) -> None:
        made = create_dataset(store, "spring 2030")
        assert made.policy == PAPER
        assert get_dataset(store, "spring 2030") == made
        assert get_dataset(store, made.id) == get_dataset(store, str(made.id)) == made

    def test_a_name_is_taken_once(self, store) -> None:
        create_dataset(store, "a")
        with pytest.raises(ConflictError):
            create_dataset(store, "a")

    @pytest.mark.parametrize("name", ["", "12", "../up", "a/b", "x" * 101, "a\n", ".hidden", "ä"])
    def test_names_that_files_cannot_have_are_refused(self, store, name: str) -> None:
        with pytest.raises(InputError):
            create_dataset(store, name)

    def test_an_unknown_one_is_not_found(self, store) -> None:
        for name in ("nothing", "7", 7, "9" * 40, "٣"):
            with pytest.raises(NotFoundError):
                get_dataset(store, name)


class TestListDatasets:
    def test_counts_states(self, store, fill, make_group) -> None:
        create_dataset(store, "empty")
        fill(make_group(7), make_group(8))
        demo, empty = list_datasets(store)
        assert (demo.name, demo.groups, demo.solved, demo.unreviewed) == ("demo", 2, 2, 2)
        assert (empty.name, empty.groups, empty.solved) == ("empty", 0, 0)


class TestSetPolicy:
    def test_leaves_groups_to_be_judged_anew(self, store, state) -> None:
        after = set_policy(store, "demo", STRICT, actor="ann")
        assert (after.policy, after.solved) == (STRICT, 0)
        now = load(store, state.id)
        assert now.solution is None
        assert now.etag != state.etag
        assert stale_groups(store, "demo") == [state.id]

    def test_calibrates_nothing_anew(self, store, state, monkeypatch) -> None:
        def refuse(*_):
            raise AssertionError("calibrated again")

        monkeypatch.setattr("app.solving.solve.calibrate_station", refuse)
        set_policy(store, "demo", STRICT)
        assert solve_dataset(store, "demo").failed == []

    def test_back_to_a_policy_everything_is_solved_already(self, store, state) -> None:
        set_policy(store, "demo", STRICT)
        assert set_policy(store, "demo", PAPER).solved == 1
        assert load(store, state.id).solution == state.solution
