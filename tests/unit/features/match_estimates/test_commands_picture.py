"""Pictures on the command line: of line files, of the matches of a dataset, and used to calibrate."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.config import Settings
from app.db.store import Store
from app.features.groups.submit import load_group_state
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_writer import write_line_files
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking
from tests.unit.features.match_estimates.match_home import ingest_match
from tests.unit.solving.conftest import BEND, click

Run = Callable[..., tuple[int, str, str]]
MATCH, TRUE = "cup", PictureGeometry(1.06)
PAPER, CLICKED = Pitch(), Pitch(goal="middle")
"""With the goals that the policy of a new dataset fits, and those of the commands on files."""


def frames(pitch: Pitch) -> list[LineFile]:
    """Four frames of one match whose pictures are 6 % too wide."""
    files = []
    for number in range(4):
        camera = looking((1.0, 62.0, -16.0), (-30.0 + 20.0 * number, -4.0, 0.0), 1300.0, bend=BEND)
        files.append(
            LineFile(
                f"{number}",
                SIZE,
                click(TRUE.camera_of_annotated_picture(camera, SIZE), 0.7, number, pitch),
            )
        )
    return files


@pytest.fixture(scope="module")
def filled_home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with that match as the dataset ``demo``."""
    home = tmp_path_factory.mktemp("filled")
    ingest_match(home, MATCH, frames(PAPER))
    return home


@pytest.fixture
def run(touchline: Run) -> Run:
    """Runs a command, in one process."""
    return lambda *words: touchline(*words, "--workers", "1")


class TestPicture:
    def test_of_line_files_is_one_estimate(self, run: Run, tmp_path: Path) -> None:
        lines, size = tmp_path / "lines", f"{SIZE.width}x{SIZE.height}"
        write_line_files(lines, frames(CLICKED))
        code, out, _ = run("picture", lines, "--size", size, "--json")
        found = json.loads(out)
        assert (code, found["frames"], found["changed"]) == (0, 4, True)
        assert found["aspect"] == pytest.approx(1.06, abs=0.015)

    def test_text_has_the_numbers_and_problems_are_named(self, run: Run, tmp_path: Path) -> None:
        lines, size = tmp_path / "lines", f"{SIZE.width}x{SIZE.height}"
        write_line_files(lines, frames(CLICKED))
        (lines / "broken.json").write_text("{")
        code, out, err = run("picture", lines, "--size", size)
        values = {line.split()[0]: line.split()[1:] for line in out.splitlines()}
        assert (code, len(values["shift"]), len(values["sigma"])) == (0, 2, 3)
        assert 0.0 < float(values["sigma"][0]) < 0.1
        assert "broken.json" in err

    def test_an_unknown_match_is_refused_before_the_estimates(
        self, run: Run, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.features.match_estimates.pictures._make_task", pytest.fail)
        code, _, err = run("picture", "--dataset", "demo", "--match", "final")
        assert (code, "has no match final" in err) == (1, True)

    def test_of_a_dataset_is_proposed_accepted_and_taken_back(self, run: Run, home: Path) -> None:
        code, out, _ = run("picture", "--dataset", "demo")
        assert (code, "use it with --accept" in out) == (0, True)
        (accepted,) = json.loads(run("picture", "--dataset", "demo", "--accept", "--json")[1])
        assert accepted["changed"] is True
        assert self.aspect(home) == pytest.approx(1.06, abs=0.015)
        assert "nothing to change" in run("picture", "--dataset", "demo")[1]
        run("picture", "--dataset", "demo", "--match", MATCH, "--as-taken")
        assert self.aspect(home) is None

    def aspect(self, home: Path) -> float | None:
        store = Store.open(Settings(home=home))
        picture = load_group_state(store, 1).group.views[0].station.picture
        store.close()
        return None if picture is None else picture.aspect

    @pytest.mark.parametrize(
        ("words", "code", "sentence"),
        [
            (("--dataset", "demo", "--as-taken"), 2, "--as-taken needs --match"),
            (("--dataset", "demo", "--match", "final"), 1, "has no match final"),
            (
                ("--dataset", "demo", "--match", MATCH, "--accept", "--as-taken"),
                2,
                "use either --accept",
            ),
            (("--dataset", "nothing"), 1, "nothing"),
            ((), 2, "use either line files or --dataset"),
        ],
    )
    def test_wrong_options_and_unknown_names_are_refused_with_a_sentence(
        self, run: Run, words, code: int, sentence: str
    ) -> None:
        found, _, err = run("picture", *words)
        assert (found, sentence in err) == (code, True)

    def test_a_file_of_something_else_is_refused(self, run: Run, tmp_path: Path) -> None:
        write_line_files(tmp_path / "lines", frames(PAPER))
        (tmp_path / "other.json").write_text("[1]")
        code, _, err = run(
            "calibrate", tmp_path / "lines", tmp_path / "out", "--picture", tmp_path / "other.json"
        )
        assert (code, "is not what touchline picture --json writes" in err) == (1, True)
