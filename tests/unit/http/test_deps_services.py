"""What lives as long as a server."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from threading import Event

import pytest

from app import features
from app.config import Settings
from app.errors import BusyError
from app.features.maintenance import upkeep as upkeep
from app.features.match_estimates.jobs import MatchJobType
from app.http import deps as module
from app.http.deps import STOP_SECONDS, Services


class TestServices:
    def test_when_they_close_the_jobs_are_told_before_upkeep_is_waited_for(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        tidying, told = Event(), []

        def tidy(*_: object) -> upkeep.CleanupCounts:
            tidying.set()
            told.append(services.jobs._closing.wait(20))
            return upkeep.CleanupCounts()

        monkeypatch.setattr(upkeep, "FIRST_SECONDS", 0.0)
        monkeypatch.setattr(upkeep, "clean_up", tidy)
        services = Services.open(Settings(home=tmp_path / "home"))
        services.jobs.start()
        services.upkeep.start()
        assert tidying.wait(20)
        services.close()
        assert told == [True]

    def test_all_work_is_told_to_stop_first_and_has_ten_seconds_together(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        services = Services.open(Settings(home=tmp_path / "home"))
        told: list[str] = []
        given: list[float] = []

        def close(seconds: float) -> None:
            told.append("wait")
            given.append(seconds)
            # As if it had taken most of what was left.
            services.stopping._until -= 0.9 * seconds

        for work in (services.webhooks, services.jobs, services.upkeep):
            monkeypatch.setattr(work, "stop", lambda: told.append("stop"))
            monkeypatch.setattr(work, "close", close)
        services.stop()
        services.close()
        assert told == [*["stop"] * 6, *["wait"] * 3]
        assert sum(0.9 * seconds for seconds in given) <= STOP_SECONDS
        assert given[0] > STOP_SECONDS / 2
        assert given[2] < STOP_SECONDS / 10

    def test_another_process_can_make_the_work_of_every_kind_of_job_over_matches(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        made: set[str] = set()
        services = Services.open(Settings(home=tmp_path / "home"))
        for name in ("register_work", "register_resume"):
            monkeypatch.setattr(services.jobs, name, lambda kind, work_of: made.add(kind))
        services.start()
        services.close()
        modules = [
            import_module(item.name)
            for item in walk_packages(features.__path__, f"{features.__name__}.")
            if item.name.endswith(".jobs") and not item.ispkg
        ]
        kinds = {
            value.kind
            for module in modules
            for value in vars(module).values()
            if isinstance(value, MatchJobType)
        }
        assert {"paint", "positions"} <= kinds <= made


class TestStart:
    """A server that starts while an import of the command line keeps the write lock."""

    def test_what_was_left_is_taken_up_once_the_other_has_written(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        answers = [BusyError("another process is writing"), BusyError("still"), None]
        done = Event()

        def leftovers(*_arguments: object, **_options: object) -> None:
            answer = answers.pop(0)
            if answer is not None:
                raise answer
            done.set()

        monkeypatch.setattr(module, "request_solve_of_leftovers", leftovers)
        monkeypatch.setattr(module, "LEFTOVERS_AGAIN_S", 0.01)
        services = Services.open(Settings(home=tmp_path / "home"))
        services.start()
        try:
            assert done.wait(20)
        finally:
            services.stopping.set()
            services.close()
        assert answers == []
