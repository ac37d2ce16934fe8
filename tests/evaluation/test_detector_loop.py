"""The loop around a detector, whole: frames, model, predictions, a person, and then a solve."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from sqlalchemy import update
from typer.testing import CliRunner

from app.command_line import app as cli
from app.config import Settings
from app.db.store import Store
from app.errors import InputError
from app.evaluation.frame import Detection, iou
from app.features.datasets.tables import ViewModel
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.sources import ImportSource, import_source
from app.features.predictions.accept import AcceptRequest, accept_predicted_balls
from app.features.predictions.detect import DetectRequest, OnnxModel, run_detector
from app.features.predictions.evaluation import parse_run_tables
from app.features.predictions.evaluation_run import EvaluationRequest, run_evaluation
from app.features.predictions.service import delete_predictions, read_predictions_of_view
from app.features.solutions.service import solve_dataset
from app.sample.scene import read_truth
from app.sample.write import write_sample
from app.soccer.frames import Box, ImageSize
from tests.evaluation.tiny_detector import write_tiny_detector

GROUPS = 4


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A home with a rendered dataset ``drawn``, solved."""
    home = tmp_path_factory.mktemp("detector") / "home"
    settings = Settings(home=home)
    store = Store.open(settings)
    write_sample(home / "sample", groups=GROUPS, seed=3, faults=False, workers=1)
    import_source(store, "drawn", ImportSource("soccernet-v3", home / "sample"), settings)
    solve_dataset(store, "drawn")
    store.close()
    return home


@pytest.fixture(scope="module")
def store(home: Path):
    store = Store.open(Settings(home=home))
    yield store
    store.close()


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> OnnxModel:
    """Two classes, so that the ball is found by its name; letterboxed to 640 x 384."""
    path = tmp_path_factory.mktemp("model") / "tiny.onnx"
    write_tiny_detector(path, 640, 384, ("player", "ball"))
    return OnnxModel.open(path, threads=2)


@pytest.fixture(scope="module")
def detected(store: Store, model: OnnxModel):
    calls: list[tuple[int, int | None]] = []

    def progress(done: int, total: int | None, _sentence: str) -> None:
        calls.append((done, total))

    request = DetectRequest("tiny", min_score=0.3)
    found = run_detector(store, "drawn", model, request, actor="ann", progress=progress)
    return found, calls


class TestOpen:
    def test_reads_what_the_model_says_of_itself(self, model) -> None:
        assert (model.names, model.category) == (("player", "ball"), 1)
        assert model.input == ImageSize(640, 384)

    def test_a_file_that_is_no_model_is_refused(self, tmp_path) -> None:
        (tmp_path / "x.onnx").write_bytes(b"not a model")
        with pytest.raises(InputError, match="is not an ONNX model"):
            OnnxModel.open(tmp_path / "x.onnx")
        with pytest.raises(InputError, match="there is no model"):
            OnnxModel.open(tmp_path / "y.onnx")

    def test_several_classes_without_a_ball_need_a_word(self, tmp_path) -> None:
        path = write_tiny_detector(tmp_path / "t.onnx", 64, 64, ("player", "referee"))
        with pytest.raises(InputError, match="has 2 classes"):
            OnnxModel.open(path)
        assert OnnxModel.open(path, category=1).category == 1

    def test_without_onnxruntime_it_says_what_to_install(self, tmp_path, monkeypatch) -> None:
        monkeypatch.setitem(sys.modules, "onnxruntime", None)
        with pytest.raises(InputError, match="onnxruntime") as caught:
            OnnxModel.open(tmp_path / "x.onnx")
        assert "touchline[detect]" in (caught.value.hint or "")


class TestDetect:
    def test_looks_at_every_frame_and_tells_how_far_it_is(self, detected) -> None:
        found, calls = detected
        assert found.report["looked_at"] == len(calls)
        assert calls[0] == (0, len(calls))
        assert (found.format, found.source, found.report["problems"]) == ("detect", "tiny.onnx", [])
        assert len(found.report["model"]) == 64

    def test_finds_balls_where_they_are(self, store, home, detected) -> None:
        truth = read_truth(home / "sample")
        hits = 0
        for state in _states(store):
            for view in state.group.views:
                ((_set, boxes),) = read_predictions_of_view(store, state.view_ids[view.key])
                careful = truth[state.key].view(view.key).ball_box
                places = [Box(box.x, box.y, box.width, box.height) for box in boxes]
                hits += any(iou(place, careful) > 0.3 for place in places)
        # A matched filter finds some; were boxes misplaced by a letterbox, it would find none.
        assert hits >= found_at_least(detected[0].report["looked_at"])

    def test_boxes_are_half_a_pixel_before_the_numbers_of_the_model(
        self, store, model, monkeypatch
    ) -> None:
        # YOLO counts from the corner of the first pixel.
        seen = [Detection(Box(100.5, 50.5, 8, 8), 0.9)]
        monkeypatch.setattr(OnnxModel, "detect", lambda *_, **__: seen)
        found = run_detector(store, "drawn", model, DetectRequest("fixed"), actor="ann")
        view = next(iter(_states(store)[0].view_ids.values()))
        boxes = next(
            boxes for item, boxes in read_predictions_of_view(store, view) if item == found
        )
        assert [(box.x, box.y, box.width) for box in boxes] == [(100, 50, 8)]
        delete_predictions(store, found.id, actor="ann")

    def test_no_solve_has_seen_them(self, store, detected) -> None:
        for state in _states(store):
            assert all(not ball.predicted_by for view in state.group.views for ball in view.balls)

    def test_they_can_be_evaluated(self, store, detected) -> None:
        request = EvaluationRequest(predictions=detected[0].id)
        found = run_evaluation(store, "drawn", request, actor="ann")
        table = next(item for item in parse_run_tables(found) if item.name == "detection")
        assert 0 < table.cell("all", "recall").value <= 1

    def test_a_person_accepts_one_and_it_is_solved(self, store, detected) -> None:
        state = _states(store)[0]
        view = state.group.views[0].key
        cleared = submit_edit(
            store, state.id, make_set_ball_edit(view, None), if_match=state.etag, actor="ann"
        )
        assert cleared.solution.ball is None or len(cleared.solution.ball.views) < len(
            state.group.views
        )
        report = accept_predicted_balls(store, "drawn", AcceptRequest(detected[0].id), actor="ann")
        assert (report.views, report.groups) == (1, 1)
        after = load_group_state(store, state.id)
        assert after.group.view(view).ball.predicted_by == "tiny"
        assert after.solution is not None
        undone = submit_edit(
            store, state.id, make_set_ball_edit(view, state.group.view(view).ball), if_match=after.etag,
            actor="ann",
        )  # fmt: skip
        assert undone.group == state.group

    def test_frames_that_are_gone_are_named(self, store, model, tmp_path) -> None:
        views = [view for state in _states(store) for view in state.view_ids.values()]
        with store.write() as session:
            session.execute(
                update(ViewModel).where(ViewModel.id == views[0]).values(media_path="/gone.zip")
            )
        request = DetectRequest("partly", query="number:1", min_score=0.3)
        found = run_detector(store, "drawn", model, request, actor="ann")
        (problem,) = found.report["problems"]
        assert "gone.zip" in problem["problem"]


class TestCommand:
    def test_detects_lists_and_says_what_is_next(self, home, model, monkeypatch) -> None:
        monkeypatch.setenv("TOUCHLINE_HOME", str(home))
        run = CliRunner().invoke(
            cli,
            ["detect", "--dataset", "drawn", "--model", str(model.path), "--name", "again",
             "--query", "number:2", "--min-score", "0.4", "--json"],
        )  # fmt: skip
        assert run.exit_code == 0, run.output
        assert json.loads(run.stdout)["format"] == "detect"
        listed = CliRunner().invoke(cli, ["predictions", "--dataset", "drawn", "--json"])
        assert "again" in {item["name"] for item in json.loads(listed.stdout)}


def found_at_least(frames: int) -> int:
    """A third of the balls."""
    return frames // 3


def _states(store: Store):
    from app.features.datasets.service import get_dataset
    from app.features.queue.service import list_groups

    page = list_groups(store, get_dataset(store, "drawn").id, limit=500)
    return [load_group_state(store, row.id) for row in page.items]
