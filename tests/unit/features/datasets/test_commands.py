"""Commands on datasets: what they list, ask and delete."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.command_line import app
from app.config import Settings
from app.db.store import Store
from app.features.datasets.service import list_datasets
from app.features.imports.ingest import ensure_dataset


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """A home with two empty datasets."""
    monkeypatch.setenv("TOUCHLINE_HOME", str(tmp_path))
    store = Store.open(Settings())
    for name in ("one", "two"):
        ensure_dataset(store, name, "ann")
    yield store
    store.close()


def names(store: Store) -> list[str]:
    return [item.name for item in list_datasets(store)]


class TestList:
    def test_shows_every_dataset(self, store: Store) -> None:
        done = CliRunner().invoke(app, ["datasets", "list", "--json"])
        assert done.exit_code == 0
        assert [item["name"] for item in json.loads(done.stdout)] == ["one", "two"]
        assert "two" in CliRunner().invoke(app, ["datasets", "list"]).stdout

    @pytest.mark.file_of_sqlite("a mistyped home has no file")
    @pytest.mark.parametrize("words", [["datasets", "list"], ["solve", "--dataset", "one"]])
    def test_a_mistyped_home_is_refused_and_not_made(
        self, words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        home = tmp_path / "mistyped"
        monkeypatch.setenv("TOUCHLINE_HOME", str(home))
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 1
        assert not home.exists()


class TestDelete:
    def test_asks_for_the_name(self, store: Store) -> None:
        done = CliRunner().invoke(app, ["datasets", "delete", "one"], input="one\n")
        assert done.exit_code == 0
        assert "Type its name" in done.stderr
        assert names(store) == ["two"]

    def test_another_name_deletes_nothing(self, store: Store) -> None:
        done = CliRunner().invoke(app, ["datasets", "delete", "one"], input="yes\n")
        assert done.exit_code == 1
        assert names(store) == ["one", "two"]

    def test_nobody_there_to_be_asked_deletes_nothing(self, store: Store) -> None:
        assert CliRunner().invoke(app, ["datasets", "delete", "one"], input="").exit_code == 1
        assert names(store) == ["one", "two"]

    def test_yes_asks_nothing(self, store: Store) -> None:
        done = CliRunner().invoke(app, ["datasets", "delete", "two", "--yes", "--json"])
        assert json.loads(done.stdout)["deleted"] == "two"
        assert names(store) == ["one"]
