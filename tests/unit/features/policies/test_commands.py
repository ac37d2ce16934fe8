"""The policy of a dataset on the command line: the file that is shown can be set."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import ensure_dataset
from app.soccer.policy import PAPER, STRICT

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture
def run(touchline: Run, tmp_path: Path) -> Run:
    """Run a command in a home with an empty dataset ``demo``: exit code, stdout, stderr."""
    store = Store.open(Settings(home=tmp_path / "home"))
    ensure_dataset(store, "demo", "ann")
    store.close()
    return touchline


class TestShow:
    def test_prints_yaml_or_one_json_document(self, run: Run) -> None:
        code, out, _ = run("policy", "show", "--dataset", "demo")
        assert (code, out.splitlines()[0]) == (0, "name: paper")
        _, out, _ = run("policy", "show", "--dataset", "demo", "--json")
        body = json.loads(out)
        assert (body["hash"], body["version"]) == (PAPER.hash, 1)
        assert body["values"]["tau_percent"] == 1.0
        assert [item["name"] for item in body["history"]] == ["paper"]

    def test_of_an_unknown_dataset_is_one_sentence(self, run: Run) -> None:
        code, out, err = run("policy", "show", "--dataset", "nothing")
        assert (code, out, err.count("\n")) == (1, "", 1)


class TestSet:
    def test_takes_the_file_that_was_shown_and_edited(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "ours.yaml"
        assert run("policy", "show", "--dataset", "demo", file)[:2] == (0, "")
        text = file.read_text().replace("name: paper", "name: ours")
        file.write_text(text.replace("tau_percent: 1.0", "tau_percent: 0.7"))
        code, out, _ = run("policy", "set", "--dataset", "demo", file, "--json")
        body = json.loads(out)
        assert (code, body["name"], body["version"], body["to_solve"]) == (0, "ours", 2, 0)
        assert "tau_percent: 0.7" in run("policy", "show", "--dataset", "demo")[1]

    def test_takes_a_shipped_one_by_its_name(self, run: Run) -> None:
        _, out, _ = run("policy", "set", "--dataset", "demo", "strict", "--json")
        assert json.loads(out)["hash"] == STRICT.hash

    def test_a_file_that_is_none_is_one_sentence_with_its_name(
        self, run: Run, tmp_path: Path
    ) -> None:
        file = tmp_path / "bad.yaml"
        file.write_text("tau: 1\n")
        code, _, err = run("policy", "set", "--dataset", "demo", file)
        assert code == 1
        assert "bad.yaml" in err and '"tau"' in err
        assert run("policy", "set", "--dataset", "demo", tmp_path / "none.yaml")[0] == 2

    def test_a_name_that_does_not_exist_is_wrong_usage_with_the_nearest(self, run: Run) -> None:
        code, _, err = run("policy", "set", "--dataset", "demo", "strictt")
        assert code == 2
        assert "did you mean strict?" in " ".join(err.replace("│", " ").split())
        assert "name: paper" in run("policy", "show", "--dataset", "demo")[1]


class TestSolveWithPolicy:
    def test_the_same_file_works(self, run: Run, tmp_path: Path) -> None:
        file = tmp_path / "ours.yaml"
        file.write_text("name: ours\nmin_jac: 0.6\n")
        command = ("solve", "--dataset", "demo", "--workers", "1", "--policy", file)
        assert run(*command)[0] == 0
        assert "min_jac: 0.6" in run("policy", "show", "--dataset", "demo")[1]
