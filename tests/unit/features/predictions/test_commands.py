from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from app.command_line import app
from app.config import Settings
from app.db.store import Store
from app.errors import NotFoundError
from app.features.imports.ingest import import_groups
from app.features.predictions.commands import print_prediction_set
from app.features.predictions.evaluation import parse_run_tables
from app.features.solutions.service import solve_dataset
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.soccernet_v3_writer import write_soccernet_v3
from tests.scenes import make_scenes


@pytest.fixture(scope="module")
def scenes():
    return make_scenes(groups=4, seed=3, faults=False)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory, scenes) -> Path:
    """A home with a solved dataset ``small``."""
    home = tmp_path_factory.mktemp("evaluate")
    write_soccernet_v3(home / "tree", [scene.group for scene in scenes])
    store = Store.open(Settings(home=home / "home"))
    import_groups(
        store, "small", read_soccernet_v3(home / "tree", ReaderReport()), source="t", actor="local"
    )
    solve_dataset(store, "small")
    store.close()
    return home / "home"


def test_accept_names_the_sets_that_there_are(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHLINE_HOME", str(home))
    with pytest.raises(NotFoundError) as refused:
        words = ["accept", "--dataset", "small", "nosuch"]
        CliRunner().invoke(app, words, catch_exceptions=False)
    assert refused.value.message == 'there is no set of predictions "nosuch"'
    assert refused.value.hint is not None and "set" in refused.value.hint


def test_a_set_of_tracks_is_told_by_its_tracks(capsys: pytest.CaptureFixture[str]) -> None:
    report = {"read": 2140, "problems": [], "more_problems": 0}
    print_prediction_set(
        {"source": "ball.csv", "name": "p1", "tracks": 1, "unknown": 0, "report": report}
    )
    assert capsys.readouterr().out == "ball.csv: 2,140 rows of 1 ball track (predictions p1)\n"


@pytest.fixture
def truth(tmp_path, scenes) -> Path:
    """The true boxes as COCO results."""
    values = [
        {
            "image_id": f"{scene.group.match}/{view.view}",
            "category_id": 1,
            # COCO counts from the corner of the first pixel.
            "bbox": [
                view.ball_box.x + 0.5,
                view.ball_box.y + 0.5,
                view.ball_box.width,
                view.ball_box.height,
            ],
            "score": 0.9,
        }
        for scene in scenes
        for view in scene.truth.views
    ]
    path = tmp_path / "truth.json"
    path.write_text(json.dumps(values))
    return path


@pytest.fixture
def run(home, monkeypatch):
    """Runs a command in that home."""
    monkeypatch.setenv("TOUCHLINE_HOME", str(home))

    def command(*words: str) -> Result:
        return CliRunner().invoke(app, list(words))

    return command


class TestEvaluate:
    def test_prints_one_document_and_keeps_the_evaluation(self, run, truth) -> None:
        done = run("evaluate", "--dataset", "small", str(truth), "--json")
        assert done.exit_code == 0, done.output
        document = json.loads(done.stdout)
        detection = next(item for item in document["tables"] if item["name"] == "detection")
        assert detection["rows"][0]["cells"][0]["value"] > 0.9
        assert document["sets"][0]["unknown"] == 0
        assert document["pins"]["predictions"]["name"] == "truth"

    def test_the_same_file_again_makes_no_second_set(self, run, truth) -> None:
        run("evaluate", "--dataset", "small", str(truth), "--json")
        before = json.loads(run("predictions", "--dataset", "small", "--json").stdout)
        run("evaluate", "--dataset", "small", str(truth), "--json")
        assert json.loads(run("predictions", "--dataset", "small", "--json").stdout) == before

    def test_every_number_in_the_tables_has_its_denominator(self, run, truth) -> None:
        done = run("evaluate", "--dataset", "small", str(truth), "--careful", str(truth))
        assert done.exit_code == 0, done.output
        rows = [
            line for line in done.stdout.splitlines() if line.startswith("  ") and "(n " in line
        ]
        assert len(rows) > 8
        assert "Optimised boxes" in done.stdout
        assert "the dataset as it is" in done.stdout

    def test_careful_boxes_are_read_by_their_own_options(
        self, run, truth, scenes, tmp_path
    ) -> None:
        halves = [
            {**item, "category_id": 32, "bbox": [side / 2 for side in item["bbox"]]}
            for item in json.loads(truth.read_text())
        ]
        half = tmp_path / "half.json"
        half.write_text(json.dumps(halves))
        lines = ["image,x,y,w,h"]
        for item in json.loads(truth.read_text()):
            x, y, *sides = item["bbox"]
            lines.append(",".join([item["image_id"], *map(str, [x - 0.5, y - 0.5, *sides])]))
        careful = tmp_path / "careful.csv"
        careful.write_text("\n".join(lines))
        size = scenes[0].group.views[0].size
        of_half = f"{size.width // 2}x{size.height // 2}"
        words = ("evaluate", "--dataset", "small", "--json")
        options = ("--format", "coco", "--category", "32", "--size", of_half)
        done = run(*words, str(half), *options, "--reference", str(careful))
        assert done.exit_code == 0, done.output
        document = json.loads(done.stdout)
        assert document["counts"]["careful_boxes"] == len(halves)
        table = next(item for item in document["tables"] if item["name"] == "boxes")
        rows = {row["name"]: row["cells"][0]["value"] for row in table["rows"]}
        assert rows["detected"] > 0.99
        swapped = run(
            *words, str(truth), "--reference", str(half), "--reference-format", "coco",
            "--reference-category", "32", "--reference-size", of_half,
        )  # fmt: skip
        document = json.loads(swapped.stdout)
        table = next(item for item in document["tables"] if item["name"] == "boxes")
        assert {row["name"]: row["cells"][0]["value"] for row in table["rows"]}["detected"] > 0.99

    def test_a_file_in_the_place_of_the_folder_is_refused_before_the_work(
        self, run, truth, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.features.predictions.commands._evaluate_locally", pytest.fail)
        done = run("evaluate", "--dataset", "small", str(truth), "--out", str(truth))
        assert "is a file; name a folder" in str(done.exception)

    def test_writes_tables_and_figures_into_a_folder(self, run, truth, tmp_path) -> None:
        out = tmp_path / "out"
        done = run("evaluate", "--dataset", "small", str(truth), "--out", str(out), "--json")
        assert done.exit_code == 0, done.output
        assert (out / "precision_distance.png").read_bytes()[:4] == b"\x89PNG"
        with (out / "localization.csv").open() as file:
            rows = {row["row"]: row for row in csv.DictReader(file)}
        assert float(rows["oracle"]["mae_m"]) < 5
        frames = [json.loads(line) for line in (out / "frames.jsonl").read_text().splitlines()]
        assert len(frames) == json.loads(done.stdout)["counts"]["judged"]

    def test_a_set_is_named_and_a_version_is_pinned(self, run, truth) -> None:
        run("evaluate", "--dataset", "small", str(truth), "--json")
        frozen = run("freeze", "--dataset", "small", "--groups", "passing", "v1", "--json")
        assert frozen.exit_code == 0, frozen.output
        done = run("evaluate", "--dataset", "small", "truth", "--version", "v1", "--json")
        assert json.loads(done.stdout)["pins"]["version_name"] == "v1"

    def test_what_is_missing_is_one_sentence_and_exit_code_1(self, touchline, tmp_path) -> None:
        code, out, err = touchline("evaluate", "--dataset", "small", tmp_path / "none.json")
        assert (code, out) == (1, "")
        assert "no set of predictions" in err
        assert "Traceback" not in err

    def test_without_anything_to_measure_it_is_wrong_usage(self, run) -> None:
        assert run("evaluate", "--dataset", "small").exit_code == 2


class TestAccept:
    def test_a_dry_run_counts(self, run, truth) -> None:
        run("evaluate", "--dataset", "small", str(truth), "--json")
        done = run("accept", "--dataset", "small", "truth", "--dry-run", "--json")
        values = json.loads(done.stdout)
        assert values["views"] == 0
        assert values["refused"]["annotated"] > 0


class TestTables:
    def test_of_a_stored_evaluation_are_what_was_computed(self, home, run, truth) -> None:
        from app.features.predictions.evaluation import list_evaluations

        run("evaluate", "--dataset", "small", str(truth), "--json")
        store = Store.open(Settings(home=home))
        found = list_evaluations(store, "small")[0]
        store.close()
        assert [table.name for table in parse_run_tables(found)][:2] == [
            "detection",
            "localization",
        ]
