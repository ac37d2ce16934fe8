"""The command on static cameras: what it shows, saves and takes back."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.command_line import app
from app.config import Settings
from app.db.store import Store
from app.errors import InputError
from app.features.imports.ingest import import_groups
from app.features.imports.queries import list_shared_stations
from tests.rigs import groups


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """A home with the balls that four static cameras show."""
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path))
    store = Store.open(Settings())
    import_groups(store, "rig", groups(45), source="test", actor="ann")
    yield store
    store.close()


def known(store: Store) -> list[bool]:
    """Of each static camera, whether anything is known of its uncertainty."""
    with store.read() as session:
        stations = list_shared_stations(session, 1)
    return [item.station.given_covariance is not None for item in stations]


def run(*words: str):
    return CliRunner().invoke(app, ["rig", "--dataset", "rig", *words])


class TestRig:
    def test_proposes_then_saves_then_takes_back(self, store: Store) -> None:
        shown = run()
        assert shown.exit_code == 0
        assert "cam1 cam2" in shown.stdout
        assert "no camera has lines" in shown.stdout
        assert "nothing is saved" in shown.stdout
        assert known(store) == [False] * 4

        saved = json.loads(run("--accept", "sigma", "--json").stdout)
        assert saved["accepted"] == "sigma"
        assert [item["key"] for item in saved["cameras"]] == ["cam1", "cam2", "cam3", "cam4"]
        assert known(store) == [True] * 4

        assert json.loads(run("--undo", "--json").stdout) == {"taken_back": 4}
        assert known(store) == [False] * 4

    def test_undo_and_accept_together_are_wrong_usage(self, store: Store) -> None:
        assert run("--undo", "--accept", "cameras").exit_code == 2

    def test_lines_of_no_camera_are_refused(self, store: Store, tmp_path: Path) -> None:
        (tmp_path / "lines").mkdir()
        assert isinstance(run("--lines", str(tmp_path / "lines")).exception, InputError)
