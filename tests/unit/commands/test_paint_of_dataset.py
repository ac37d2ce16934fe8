"""Paint of a dataset's pictures on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from app.soccer.policy import PAPER, TOUCHLINE
from tests.unit.commands.match_home import ingest_by_policies
from tests.unit.review.editing.test_positions import MATCH, match

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def filled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a match without pictures, as ``demo`` and as ``paper``."""
    home = tmp_path_factory.mktemp("filled")
    ingest_by_policies(home, match(), {"demo": TOUCHLINE, "paper": PAPER})
    return home


@pytest.fixture
def run(touchline: Run) -> Run:
    return partial(touchline, "paint")


class TestPaint:
    def test_shows_reads_and_takes_back(self, run: Run) -> None:
        assert run("demo", "--show")[:2] == (
            0,
            f"{MATCH}: the paint of none of 12 pictures was read\n",
        )
        (read,) = json.loads(run("demo", "--workers", "1", "--json")[1])
        assert (read["read"], read["painted"], read["no_frame"]) == (12, 0, 12)
        assert "12 missing or unreadable" in run("demo", "--show")[1]
        (back,) = json.loads(run("demo", "--undo", "--json")[1])
        assert back["read"] == 0

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("paper",), 1, "does not use the paint"),
            (("demo", "--match", "final"), 1, "has no match final"),
            (("demo", "--undo"), 1, "no paint was read"),
            (("demo", "--undo", "--show"), 2, "one at a time"),
        ],
    )
    def test_what_cannot_be_is_said(self, run: Run, words, code: int, sentence: str) -> None:
        found, _, err = run(*words)
        assert (found, sentence in err) == (code, True)
