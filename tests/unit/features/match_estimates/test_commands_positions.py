"""Shared positions on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from app.soccer.policy import PAPER
from tests.unit.features.match_estimates.match_home import ingest_by_policies
from tests.unit.features.match_estimates.test_positions import MATCH, SHARING, match

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a match as the datasets ``demo`` and, by the paper, ``paper``."""
    home = tmp_path_factory.mktemp("filled")
    ingest_by_policies(home, match(), {"demo": SHARING, "paper": PAPER})
    return home


@pytest.fixture
def run(touchline: Run) -> Run:
    return partial(touchline, "positions")


class TestPositions:
    def test_shows_shares_and_takes_back(self, run: Run) -> None:
        code, out, _ = run("--dataset", "demo")
        assert (code, out) == (
            0,
            f"{MATCH}: none of 6 pictures of the main camera uses a shared position\n",
        )
        (shared,) = json.loads(run("--dataset", "demo", "--share", "--workers", "1", "--json")[1])
        assert (shared["shared"], shared["current"]) == (6, True)
        assert "6 of 6 pictures" in run("--dataset", "demo")[1]
        (back,) = json.loads(run("--dataset", "demo", "--undo", "--match", MATCH, "--json")[1])
        assert (back["shared"], back["current"]) == (0, None)

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("paper", "--share"), 1, "calibration.share_position"),
            (("demo", "--share", "--match", "final"), 1, "has no match final"),
            (("demo", "--match", "final"), 1, "has no match final"),
            (("demo", "--undo"), 2, "--undo needs --match"),
            (("demo", "--undo", "--match", MATCH), 1, "share no camera position"),
            (("demo", "--undo", "--share"), 2, "use either --share or --undo"),
        ],
    )
    def test_wrong_options_and_what_cannot_be_shared_or_undone_are_refused(
        self, run: Run, words, code: int, sentence: str
    ) -> None:
        found, _, err = run("--dataset", *words)
        assert (found, sentence in err) == (code, True)
