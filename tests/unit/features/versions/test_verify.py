from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import pytest
from sqlalchemy import text

from app.errors import NotFoundError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.versions import verify as verify_module
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.frozen_queries import compress_text, decode_frozen_text
from app.features.versions.verify import verify_version
from app.soccer.solution import Solution
from app.solving import calibrate, solve
from app.solving.solve import NO_CALIBRATIONS, solve_group
from tests.databases import said_for_sqlite


def one_bit_off(group, policy, calibrations: Mapping = NO_CALIBRATIONS) -> Solution:
    """A solver whose ball lies one bit beside the true one in one group."""
    solution = solve_group(group, policy, calibrations)
    if not group.key.endswith("8.png"):
        return solution
    x, y, z = solution.ball.point
    moved = (x + abs(x) * 2.3e-16, y, z)
    assert moved != solution.ball.point
    return replace(solution, ball=replace(solution.ball, point=moved))


def broken(group, policy, calibrations: Mapping = NO_CALIBRATIONS) -> Solution:
    raise ZeroDivisionError


def upgrade(monkeypatch: pytest.MonkeyPatch) -> None:
    """From now on the solver has another version."""
    for module in (verify_module, calibrate, solve):
        monkeypatch.setattr(module, "SOLVER_VERSION", "99")


@pytest.fixture
def version(store, fill, make_group, make_static):
    fill(make_group(7), make_group(8), make_static(10), make_static(11))
    return freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")


def tamper(store, prefix: str, change) -> None:
    """Change frozen content behind the service's back."""
    table = "calibration" if prefix == "calibration:" else "frozen"
    where = "" if table == "calibration" else "WHERE key LIKE :prefix"
    with store.write() as session, said_for_sqlite(session):
        session.execute(text(f"DROP TRIGGER {table}_refuses_update"))
        statement = text(f"SELECT key, body FROM {table} {where} ORDER BY key LIMIT 1")
        row = session.execute(statement, {"prefix": f"{prefix}%"} if where else {}).one()
        values = {"key": row.key, "body": change(row.body)}
        session.execute(text(f"UPDATE {table} SET body = :body WHERE key = :key"), values)


class TestVerify:
    def test_everything_comes_out_as_it_was_frozen(self, store, version) -> None:
        seen = []
        report = verify_version(store, version.id, progress=lambda *place: seen.append(place))
        assert report.ok, report.to_values()
        assert (report.equal, report.groups, seen[-1]) == (4, 4, (4, 4))

    def test_workers_find_the_same(self, store, version) -> None:
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
            assert verify_version(store, version.id, executor).ok

    def test_it_holds_after_the_group_was_edited(self, store, version) -> None:
        state = load_group_state(store, 1)
        submit_edit(store, 1, make_set_ball_edit("7.png", None), if_match=state.etag, actor="ben")
        assert verify_version(store, version.id).ok

    def test_one_bit_is_a_difference_with_its_place(self, store, version, monkeypatch) -> None:
        monkeypatch.setattr(verify_module, "solve_group", one_bit_off)
        report = verify_version(store, version.id)
        assert not report.ok
        assert (report.equal, report.groups) == (3, 4)
        places = {item.place for item in report.differences}
        assert "ball.point.0" in places
        assert {item.group[-5:] for item in report.differences} == {"8.png"}

    def test_another_solver_with_the_same_figures_differs_in_nothing(
        self, store, version, monkeypatch
    ) -> None:
        upgrade(monkeypatch)
        report = verify_version(store, version.id)
        report.solver_version_now = "99"
        assert report.ok, report.to_values()
        assert report.sentence.startswith("The figures of 4 groups are as frozen; only the version")

    def test_the_largest_difference_of_another_solver_is_told(
        self, store, version, monkeypatch
    ) -> None:
        def moved(group, policy, calibrations: Mapping = NO_CALIBRATIONS) -> Solution:
            solution = solve_group(group, policy, calibrations)
            if not group.key.endswith("8.png"):
                return solution
            x, y, z = solution.ball.point
            return replace(solution, ball=replace(solution.ball, point=(x + 0.25, y, z)))

        upgrade(monkeypatch)
        monkeypatch.setattr(verify_module, "solve_group", moved)
        report = verify_version(store, version.id)
        report.solver_version_now = "99"
        assert {item.place for item in report.differences} == {"ball.point.0", "ball"}
        assert report.sentence.startswith(
            "1 of 4 groups came out differently, numbers that both have by at most 0.25 m and 0 px; the version"
        )

    def test_a_group_that_breaks_does_not_hide_the_others(
        self, store, version, monkeypatch
    ) -> None:
        monkeypatch.setattr(verify_module, "solve_group", broken)
        report = verify_version(store, version.id)
        assert [item.now for item in report.differences] == ["ZeroDivisionError: "] * 4

    @pytest.mark.parametrize("prefix", ["said:", "station:", "solution:", "calibration:"])
    def test_content_that_was_changed_is_found(self, store, version, prefix: str) -> None:
        def change(body: bytes) -> bytes:
            return compress_text(decode_frozen_text(body).replace(".5", ".6"))

        tamper(store, prefix, change)
        report = verify_version(store, version.id)
        assert not report.ok
        assert prefix == "calibration:" or "digest" in {item.place for item in report.differences}

    def test_rows_that_were_changed_do_not_give_the_hash(self, store, version) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER version_group_refuses_update"))
            session.execute(text("UPDATE version_group SET split = 'test' WHERE position = 0"))
        places = {item.place for item in verify_version(store, version.id).differences}
        assert places == {"hash", "split"}

    def test_missing_content_is_named(self, store, version) -> None:
        with store.write() as session, said_for_sqlite(session):
            session.execute(text("DROP TRIGGER frozen_refuses_delete"))
            session.execute(text("DELETE FROM frozen WHERE key LIKE 'solution:%'"))
        report = verify_version(store, version.id)
        assert {item.place for item in report.differences} == {"missing"}
        assert report.equal == 0

    def test_an_unknown_version_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            verify_version(store, 12)
