"""Paint of a dataset's pictures on the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from app.soccer.policy import PAPER, TOUCHLINE
from tests.unit.features.match_estimates.match_home import ingest_by_policies
from tests.unit.features.match_estimates.test_positions import MATCH, match
from tests.unit.features.paint.test_jobs_paint import without_files

Run = Callable[..., tuple[int, str, str]]


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a match without files of its pictures, as ``demo`` and as ``paper``, and with one
    that never had any, as ``bare``."""
    home = tmp_path_factory.mktemp("filled")
    ingest_by_policies(home, without_files(match()), {"demo": TOUCHLINE, "paper": PAPER})
    ingest_by_policies(home, match(), {"bare": TOUCHLINE})
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

    def test_views_that_never_had_a_picture_are_counted_and_not_read(self, run: Run) -> None:
        (read,) = json.loads(run("bare", "--workers", "1", "--json")[1])
        assert (read["views"], read["without_picture"], read["read"]) == (12, 12, 0)
        assert run("bare", "--show")[1] == f"{MATCH}: none of 12 views has a picture\n"

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("paper",), 1, "does not use the paint"),
            (("demo", "--match", "final"), 1, "has no match final"),
            (("demo", "--show", "--match", "final"), 1, "has no match final"),
            (("demo", "--undo", "--match", MATCH), 2, "newest reading"),
            (("demo", "--undo"), 1, "has a measurement of its paint"),
            (("demo", "--undo", "--show"), 2, "use either --show or --undo"),
        ],
    )
    def test_wrong_options_and_what_cannot_be_read_or_undone_are_refused(
        self, run: Run, words, code: int, sentence: str
    ) -> None:
        found, _, err = run(*words)
        assert (found, sentence in err) == (code, True)
