from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from dataclasses import replace

import pytest

from app.db.store import Store
from app.errors import DamagedError, JobCancelled, NotFoundError, StorageError
from app.features.datasets.service import delete_dataset
from app.features.versions import verify as verify_module
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.service import get_version, list_versions
from app.features.versions.verify import verify_and_save_report
from app.soccer.solution import SOLVER_VERSION, Solution
from app.solving.solve import NO_CALIBRATIONS, solve_group


def beside(group, policy, calibrations: Mapping = NO_CALIBRATIONS) -> Solution:
    """A solver whose ball lies elsewhere."""
    solution = solve_group(group, policy, calibrations)
    x, y, z = solution.ball.point
    return replace(solution, ball=replace(solution.ball, point=(x + 1.0, y, z)))


@pytest.fixture
def version(store, fill, make_group):
    fill(make_group(7), make_group(8))
    return freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")


class TestVerifyAndKeep:
    def test_the_result_is_kept_with_the_version_over_a_restart(self, store, version) -> None:
        assert version.verified is None
        verify_and_save_report(store, version.id, actor="ben")
        with closing(Store.open(store.settings)) as again:
            kept = get_version(again, version.id).verified
        assert (kept.actor, kept.solver_version, kept.problem) == ("ben", SOLVER_VERSION, None)
        assert (kept.report["ok"], kept.report["equal"]) == (True, 2)
        assert [item.verified for item in list_versions(store, "demo")] == [kept]

    def test_differences_take_its_place_and_are_named(self, store, version, monkeypatch) -> None:
        verify_and_save_report(store, version.id, actor="ben")
        monkeypatch.setattr(verify_module, "solve_group", beside)
        verify_and_save_report(store, version.id, actor="eve")
        kept = get_version(store, version.id).verified
        assert (kept.actor, kept.report["ok"], kept.report["equal"]) == ("eve", False, 0)
        assert "ball.point.0" in {item["place"] for item in kept.report["differences"]}

    def test_why_it_failed_is_kept_too(self, store, version, monkeypatch) -> None:
        def broken(*_arguments, **_options):
            raise StorageError("the disk is full")

        monkeypatch.setattr(verify_module, "verify_version", broken)
        with pytest.raises(StorageError):
            verify_and_save_report(store, version.id, actor="ben")
        kept = get_version(store, version.id).verified
        assert (kept.problem, kept.report) == ("the disk is full", None)

    def test_of_a_damaged_database_the_damage_is_told(self, store, version, monkeypatch) -> None:
        def broken(*_arguments, **_options):
            error = DamagedError("touchline.db is damaged")
            store.record_damage(error)
            raise error

        monkeypatch.setattr(verify_module, "verify_version", broken)
        with pytest.raises(DamagedError, match=r"^touchline\.db is damaged$"):
            verify_and_save_report(store, version.id, actor="ben")
        assert get_version(store, version.id).verified is None

    def test_a_run_that_was_cancelled_leaves_what_was_kept(self, store, version) -> None:
        def cancel(_done: int, _total: int) -> None:
            raise JobCancelled

        verify_and_save_report(store, version.id, actor="ben")
        before = get_version(store, version.id).verified
        with pytest.raises(JobCancelled):
            verify_and_save_report(store, version.id, progress=cancel, actor="eve")
        assert get_version(store, version.id).verified == before

    def test_it_goes_with_its_dataset(self, store, version) -> None:
        verify_and_save_report(store, version.id, actor="ben")
        delete_dataset(store, "demo", confirm="demo", actor="ann")
        with pytest.raises(NotFoundError):
            get_version(store, version.id)
