"""Pitches on the command line: of line files, and of the matches of a dataset."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_writer import write_line_files
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking
from tests.unit.features.match_estimates.match_home import ingest_match
from tests.unit.solving.conftest import BEND, click

Run = Callable[..., tuple[int, str, str]]
MATCH, TRUE = "cup", Pitch(103.0, 66.0)


def frames() -> list[LineFile]:
    """Six frames of one match on a small pitch."""
    files = []
    for number in range(6):
        target = (-30.0 + 12.0 * number, -4.0, 0.0)
        camera = looking((1.0, 62.0, -16.0), target, 1200.0, bend=BEND)
        files.append(LineFile(f"{number}", SIZE, click(camera, 0.7, number, TRUE)))
    return files


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with that match as the dataset ``demo``."""
    home = tmp_path_factory.mktemp("filled")
    ingest_match(home, MATCH, frames())
    return home


@pytest.fixture
def run(touchline: Run) -> Run:
    """Runs the command, in one process."""
    return lambda *words: touchline("pitch", *words, "--workers", "1")


class TestPitch:
    def test_of_line_files_is_one_estimate(self, run: Run, tmp_path: Path) -> None:
        write_line_files(tmp_path, frames())
        code, out, _ = run(tmp_path, "--size", f"{SIZE.width}x{SIZE.height}", "--json")
        found = json.loads(out)
        assert (code, found["frames"]) == (0, 6)
        assert found["length_m"] == pytest.approx(103.0, abs=0.5)

    def test_of_a_dataset_proposes_accepts_and_takes_back(self, run: Run) -> None:
        code, out, _ = run("demo")
        assert (code, "cup: 105 x 68 m; lines show length 10" in out) == (0, True)
        assert "; use 10" in out
        (accepted,) = json.loads(run("demo", "--accept", "--json")[1])
        assert accepted["length"] == pytest.approx(103.0, abs=0.3)
        assert (accepted["proposed"], accepted["previous"]["length"]) == (None, 105.0)
        (back,) = json.loads(run("demo", "--match", MATCH, "--set", "previous", "--json")[1])
        assert (back["length"], back["width"]) == (105.0, 68.0)

    def test_a_folder_of_the_same_name_does_not_hide_a_dataset(
        self, run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "demo").mkdir()
        monkeypatch.chdir(tmp_path)
        (found,) = json.loads(run("--dataset", "demo", "--json")[1])
        assert found["match"] == MATCH

    def test_a_person_may_know_better(self, run: Run) -> None:
        (found,) = json.loads(run("demo", "--match", MATCH, "--set", "100x64", "--json")[1])
        assert (found["length"], found["width"]) == (100.0, 64.0)

    def test_problems_of_line_files_are_named(self, run: Run, tmp_path: Path) -> None:
        write_line_files(lines := tmp_path / "lines", frames())
        (lines / "broken.json").write_text("{")
        code, out, err = run(lines, "--size", f"{SIZE.width}x{SIZE.height}")
        assert (code, "broken.json" in err) == (0, True)
        assert ["problems", "1"] in [line.split() for line in out.splitlines()], err

    def test_an_unknown_match_is_refused_before_the_estimates(
        self, run: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.features.pitches.service.estimate_pitches", pytest.fail)
        code, _, err = run("demo", "--match", "final")
        assert (code, "has no match final" in err) == (1, True)

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("demo", "--set", "100x64"), 2, "--set needs --match"),
            (("demo", "--match", "final"), 1, "has no match final"),
            (("demo", "--match", MATCH, "--set", "big"), 1, "write it as 105x68"),
            (
                ("demo", "--match", MATCH, "--set", "previous"),
                1,
                "there is no earlier pitch size to restore",
            ),
            (("nothing",), 1, "nothing"),
            (
                ("demo", "--match", MATCH, "--set", "100x64", "--accept"),
                2,
                "either --accept or --set",
            ),
            ((), 2, "use either line files or --dataset"),
            (("demo", "--dataset", "demo"), 2, "use either line files or --dataset"),
        ],
    )
    def test_wrong_options_unknown_names_and_what_is_no_size_are_refused(
        self, run: Run, words, code: int, sentence: str
    ) -> None:
        found, _, err = run(*words)
        assert (found, sentence in err) == (code, True)
