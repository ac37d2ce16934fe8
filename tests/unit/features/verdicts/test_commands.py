"""Verdicts on the command line: tried, given, and under whose name."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.features.verdicts.bulk import list_bulk_verdicts
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.soccernet_v3_writer import write_soccernet_v3
from tests.scenes import make_scenes

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with the solved dataset ``demo``."""
    home = tmp_path_factory.mktemp("filled")
    write_soccernet_v3(home / "tree", [scene.group for scene in make_scenes(2, 4, faults=False)])
    with closing(Store.open(Settings(home=home))) as store:
        import_groups(
            store, "demo", read_soccernet_v3(home / "tree", ReaderReport()), source="t", actor="ann"
        )
        solve_dataset(store, "demo")
    return home


@pytest.fixture
def run(touchline: Run) -> Run:
    return touchline


def accepted(run: Run) -> int:
    (found,) = json.loads(run("datasets", "list", "--json")[1])
    return int(found["accepted"])


class TestVerdict:
    def test_is_tried_given_and_taken_back(self, run: Run, tmp_path: Path) -> None:
        words = ("verdict", "accepted", "--dataset", "demo", "--query", "passes:yes", "--json")
        words += ("--note", "by its lines")
        code, out, err = run(*words, "--dry-run")
        tried = json.loads(out)
        assert (code, tried["matches"], tried["would_change"]) == (0, 2, 2), err
        assert ([item["number"] for item in tried["sample"]], accepted(run)) == ([1, 2], 0)
        assert (tried["unchanged"], tried["replaced"]) == (0, {})
        code, out, _ = run("--actor", "nightly", *words, "--expected", 2)
        assert (code, json.loads(out)["changed"], accepted(run)) == (0, 2, 2)
        store = Store.open(Settings(home=tmp_path / "home"))
        assert [batch.actor for batch in list_bulk_verdicts(store, 1)] == ["script:nightly"]
        store.close()
        assert run("verdict", "unreviewed", "--dataset", "demo", "--query", "id:1")[0] == 0
        assert accepted(run) == 1

    def test_another_number_than_was_expected_changes_nothing(self, run: Run) -> None:
        words = ("verdict", "deferred", "--dataset", "demo", "--query", "")
        code, _, err = run(*words, "--expected", 7)
        assert (code, "2 groups would change, not 7" in err) == (1, True)

    def test_a_verdict_that_is_refused_for_every_group_is_a_failure(self, run: Run) -> None:
        code, out, err = run("verdict", "accepted", "--dataset", "demo", "--query", "", "--json")
        assert (code, json.loads(out)["refused"], accepted(run)) == (1, {"no_picture": 2}, 0)
        assert "--note" in err
        code, _, err = run("verdict", "rejected", "--dataset", "demo", "--query", "")
        assert (code, "needs a reason" in err) == (1, True)

    def test_a_query_that_cannot_be_is_one_sentence(self, run: Run) -> None:
        code, out, err = run("verdict", "deferred", "--dataset", "demo", "--query", "sigmaa<1")
        assert (code, out, "did you mean sigma" in err) == (1, "", True)

    def test_no_query_is_wrong_usage_not_every_group(self, run: Run) -> None:
        assert run("verdict", "deferred", "--dataset", "demo")[0] == 2


class TestActor:
    def test_the_environment_says_it_too(self, run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("TOUCHLINE_ACTOR", "night.job")
        run("policy", "set", "--dataset", "demo", "strict")
        monkeypatch.delenv("TOUCHLINE_ACTOR")
        run("policy", "set", "--dataset", "demo", "paper")
        history = json.loads(run("policy", "show", "--dataset", "demo", "--json")[1])["history"]
        assert [item["actor"] for item in history[1:]] == ["script:night.job", "local"]

    def test_a_name_that_cannot_be_is_one_sentence(self, run: Run) -> None:
        code, _, err = run("--actor", "a\nb", "datasets", "list")
        assert (code, "the name of a script" in err) == (1, True)
