"""The policy of a dataset: versions, conflicts, and how little a change computes."""

from __future__ import annotations

import pytest
from sqlalchemy import func, select, text

from app.db.log import LogModel
from app.db.store import Store
from app.errors import NotFoundError, StaleRevisionError
from app.features.datasets.service import get_dataset, insert_dataset
from app.features.imports.ingest import ensure_dataset
from app.features.policies.service import change_policy, read_policy, replace_thresholds
from app.features.queue.service import list_groups
from app.features.solutions import service as recompute
from app.features.solutions.queries import CalibrationModel, SolutionModel
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.soccer.policy import PAPER, STRICT
from app.solving import calibrate

TIGHT = replace_thresholds(PAPER, {"tau_percent": 0.1}, name="tight")


def count(store: Store, model) -> int:
    with store.read() as session:
        return session.execute(select(func.count()).select_from(model)).scalar_one()


@pytest.fixture
def calibrations(monkeypatch: pytest.MonkeyPatch) -> list[object]:
    """Every calibration that is computed from now on."""
    made: list[object] = []
    plain = calibrate.calibrate_station

    def counted(*arguments, **options):
        made.append(arguments)
        return plain(*arguments, **options)

    for module in (calibrate, recompute):
        monkeypatch.setattr(module, "calibrate_station", counted)
    return made


class TestReadPolicy:
    def test_begins_with_the_policy_that_the_dataset_was_made_with(self, store: Store) -> None:
        with store.write() as session:
            insert_dataset(session, "demo", STRICT, "ann")
        state = read_policy(store, "demo")
        assert (state.policy, state.version) == (STRICT, 1)
        assert [(item.version, item.policy, item.actor) for item in state.history] == [
            (1, STRICT, "ann")
        ]
        with pytest.raises(NotFoundError):
            read_policy(store, "nothing")

    @pytest.mark.file_of_sqlite("which index SQLite says that it would use")
    def test_reads_a_few_entries_however_long_the_log(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        with store.read() as session:
            plan = session.execute(
                text(
                    "EXPLAIN QUERY PLAN SELECT body FROM log WHERE dataset_id = 1 "
                    "AND kind IN ('dataset', 'policy') ORDER BY id"
                )
            ).all()
        assert "USING INDEX log_policy" in str(plan)


class TestChangePolicy:
    def test_counts_versions_and_keeps_those_before(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        ensure_dataset(store, "other", "ann")
        for policy in (STRICT, TIGHT, STRICT):
            etag = read_policy(store, "demo").etag
            state = change_policy(store, "demo", policy, if_match=etag, actor="bob")
        assert [item.policy for item in state.history] == [PAPER, STRICT, TIGHT, STRICT]
        assert [item.version for item in state.history] == [1, 2, 3, 4]
        assert get_dataset(store, "demo").policy == STRICT
        assert read_policy(store, "other").version == 1

    def test_the_same_again_changes_nothing(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        first = change_policy(store, "demo", STRICT, if_match=None, actor="ann")
        entries = count(store, LogModel)
        assert change_policy(store, "demo", STRICT, if_match=None, actor="ann") == first
        assert count(store, LogModel) == entries

    def test_a_change_of_an_older_policy_is_refused(self, store: Store) -> None:
        ensure_dataset(store, "demo", "ann")
        etag = read_policy(store, "demo").etag
        first = change_policy(store, "demo", STRICT, if_match=etag, actor="ann")
        with pytest.raises(StaleRevisionError) as caught:
            change_policy(store, "demo", TIGHT, if_match=etag, actor="bob")
        assert caught.value.current_etag == first.etag
        assert get_dataset(store, "demo").policy == STRICT

    def test_a_new_tau_calibrates_nothing_and_judges_every_group_anew(
        self, store: Store, fill, make_group, make_static, calibrations
    ) -> None:
        ids = fill(make_group(7, shift=3.0), make_group(8), make_static(10), make_static(20))
        assert calibrations
        calibrations.clear()
        kept = count(store, CalibrationModel)
        change_policy(store, "demo", TIGHT, if_match=None, actor="ann")
        assert list_stale_groups(store, "demo") == ids
        assert get_dataset(store, "demo").solved == 0
        report = solve_dataset(store, "demo")
        assert (report.solved, report.passed) == (4, 3)
        assert calibrations == []
        assert count(store, CalibrationModel) == kept
        found = get_dataset(store, "demo")
        rows = {row.id: row for row in list_groups(store, found.id, limit=10).items}
        assert (rows[ids[0]].passes, rows[ids[0]].gate) == (False, "reprojection")
        assert [rows[number].passes for number in ids[1:]] == [True] * 3

    def test_back_to_a_policy_that_was_solved_nothing_is_to_do(
        self, store: Store, fill, make_group
    ) -> None:
        fill(make_group(7), make_group(8, shift=3.0))
        change_policy(store, "demo", TIGHT, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        solutions = count(store, SolutionModel)
        change_policy(store, "demo", PAPER, if_match=None, actor="ann")
        assert list_stale_groups(store, "demo") == []
        assert get_dataset(store, "demo").solved == 2
        assert solve_dataset(store, "demo").total == 0
        assert count(store, SolutionModel) == solutions

    def test_another_name_alone_solves_nothing(self, store: Store, fill, make_group) -> None:
        fill(make_group())
        named = replace_thresholds(PAPER, {}, name="ours")
        assert change_policy(store, "demo", named, if_match=None, actor="ann").version == 2
        assert list_stale_groups(store, "demo") == []

    def test_another_calibration_part_calibrates_every_camera_once(
        self, store: Store, fill, make_static, calibrations
    ) -> None:
        fill(make_static(10), make_static(20))
        calibrations.clear()
        policy = replace_thresholds(PAPER, {"calibration": {"robust_scale_px": 3.0}}, name="soft")
        change_policy(store, "demo", policy, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        assert len(calibrations) == 3
