from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import delete, select

from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets.tables import ViewModel
from app.features.groups.state import read_group_without_solution
from app.features.groups.submit import load_group_state
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.service import (
    add_predictions,
    delete_predictions,
    get_predictions,
    list_prediction_sets,
    make_prediction_set_name,
    read_predictions_of_view,
)
from app.features.predictions.tables import PredictedCameraModel, PredictionModel
from app.features.solutions.queries import read_solutions
from app.formats.camera_json import camera_to_json


def results(path: Path, *frames: str) -> PredictionFiles:
    """A file of one box a frame, scores falling."""
    values = [
        {
            "image_id": frame,
            "category_id": 1,
            "bbox": [600.5, 300.5, 14, 14],
            "score": 0.9 - 0.1 * place,
        }
        for place, frame in enumerate(frames)
    ]
    path.write_text(json.dumps(values))
    return PredictionFiles(path)


class TestAddPredictions:
    def test_keeps_boxes_and_lists_frames_that_it_does_not_know(
        self, store, state, tmp_path
    ) -> None:
        files = results(tmp_path / "yolo.json", "7.png", "7.png", "99.png")
        found = add_predictions(store, "demo", "yolo", files, actor="ann")
        assert (found.frames, found.boxes, found.unknown, found.cameras) == (1, 2, 1, 0)
        assert (found.source, found.format, found.actor) == ("yolo.json", "coco", "ann")
        assert found.report["unknown_frames"][0]["frame"] == "99.png"
        (kept, boxes), *_ = read_predictions_of_view(store, state.view_ids["7.png"])
        assert kept == found
        assert [(box.x, box.width, round(box.score, 9)) for box in boxes] == [
            (600, 14, 0.9), (600, 14, 0.8),
        ]  # fmt: skip

    def test_changes_nothing_of_the_group_and_solves_nothing(self, store, state, tmp_path) -> None:
        files = results(tmp_path / "yolo.json", "7.png", "7_1.png")
        add_predictions(store, "demo", "yolo", files, actor="ann")
        assert load_group_state(store, state.id) == state
        with store.read() as session:
            key = read_group_without_solution(session, state.id).solution_key
            assert list(read_solutions(session, [key])) == [state.id]

    def test_keeps_cameras(self, store, state, tmp_path, opposite) -> None:
        (tmp_path / "camera_7.json").write_text(json.dumps(camera_to_json(opposite)))
        files = PredictionFiles(None, cameras=tmp_path)
        found = add_predictions(store, "demo", "cams", files, actor="ann")
        assert (found.cameras, found.boxes, found.format) == (1, 0, "cameras")

    def test_cameras_do_not_make_up_for_boxes_of_no_known_frame(
        self, store, state, tmp_path, opposite
    ) -> None:
        cameras = tmp_path / "cameras"
        cameras.mkdir()
        (cameras / "camera_7.json").write_text(json.dumps(camera_to_json(opposite)))
        files = replace(results(tmp_path / "yolo.json", "99.png"), cameras=cameras)
        with pytest.raises(InputError, match="none of the 1 frames that could be read belongs"):
            add_predictions(store, "demo", "x", files, actor="ann")

    def test_a_name_is_taken_once(self, store, state, tmp_path) -> None:
        files = results(tmp_path / "yolo.json", "7.png")
        first = add_predictions(store, "demo", "yolo", files, actor="ann")
        with pytest.raises(ConflictError, match='"yolo" already'):
            add_predictions(store, "demo", "yolo", files, actor="ann")
        # The very same again is the same set; something else finds another name.
        assert add_predictions(store, "demo", None, files, actor="bob") == first
        other = results(tmp_path / "yolo.json", "7_1.png")
        assert add_predictions(store, "demo", None, other, actor="b").name == "yolo-2"

    def test_without_a_name_the_set_is_named_after_its_file(self, store, state, tmp_path) -> None:
        files = results(tmp_path / "best model (2).json", "7.png")
        assert add_predictions(store, "demo", None, files, actor="ann").name == "best-model--2"

    def test_auto_is_the_format_that_the_ending_tells(self, store, state, tmp_path) -> None:
        path = tmp_path / "boxes.csv"
        path.write_text("image,x,y,w,h,score\n7.png,600,300,14,14,0.9\n")
        found = add_predictions(store, "demo", None, PredictionFiles(path, "auto"), actor="ann")
        assert (found.name, found.format, found.boxes) == ("boxes", "csv", 1)

    def test_neither_boxes_nor_cameras_is_refused(self, store, state) -> None:
        with pytest.raises(InputError, match="there are no predictions to import"):
            add_predictions(store, "demo", "x", PredictionFiles(None), actor="ann")

    def test_a_file_with_another_report_is_another_set(self, store, state, tmp_path) -> None:
        files = results(tmp_path / "yolo.json", "7.png")
        first = add_predictions(store, "demo", None, files, actor="ann")
        # The same box again, and beside it a frame that is not known.
        more = results(tmp_path / "yolo.json", "7.png", "99.png")
        second = add_predictions(store, "demo", None, more, actor="ann")
        assert second.digest == first.digest
        assert (second.name, second.unknown) == ("yolo-2", 1)
        assert [item["frame"] for item in second.report["unknown_frames"]] == ["99.png"]
        assert add_predictions(store, "demo", None, more, actor="a") == second
        renamed = results(tmp_path / "later.json", "7.png")
        third = add_predictions(store, "demo", None, renamed, actor="ann")
        assert (third.name, third.source, third.unknown) == ("later", "later.json", 0)
        assert get_predictions(store, first.id) == first

    def test_a_file_for_another_dataset_is_refused(self, store, state, tmp_path) -> None:
        with pytest.raises(InputError, match="none of the 2 frames that could be read belongs"):
            add_predictions(
                store, "demo", "x", results(tmp_path / "y.json", "8.png", "9.png"), actor="ann"
            )
        assert list_prediction_sets(store, "demo") == []

    def test_records_that_cannot_be_read_are_named_where_no_frame_is_known(
        self, store, state, tmp_path
    ) -> None:
        path = tmp_path / "y.json"
        boxes = {"7.png": [1, 2, 3], "8.png": [1, 2, 3, 4], "7_1.png": [1, 2]}
        path.write_text(json.dumps([
            {"file_name": name, "category_id": 1, "bbox": box, "score": 0.5}
            for name, box in boxes.items()
        ]))  # fmt: skip
        with pytest.raises(InputError) as caught:
            add_predictions(store, "demo", "x", PredictionFiles(path), actor="ann")
        assert 'none of the 1 frames that could be read belongs to the dataset: "8.png"' in str(
            caught.value
        )
        assert "2 records could not be read, the first: " in str(caught.value)
        assert "result 0, bbox: has 3" in str(caught.value)

    @pytest.mark.parametrize("name", ["", "../x", "a/b", "ü", "x" * 101])
    def test_a_name_that_no_file_could_have_is_refused(self, store, state, tmp_path, name) -> None:
        with pytest.raises(InputError, match="cannot be the name"):
            add_predictions(store, "demo", name, results(tmp_path / "y.json", "7.png"), actor="a")

    def test_the_digest_is_of_the_boxes_and_not_of_the_file(self, store, state, tmp_path) -> None:
        one = add_predictions(store, "demo", "a", results(tmp_path / "a.json", "7.png"), actor="a")
        same = add_predictions(store, "demo", "b", results(tmp_path / "b.json", "7.png"), actor="b")
        other = add_predictions(
            store, "demo", "c", results(tmp_path / "c.json", "7_1.png"), actor="a"
        )
        assert one.digest == same.digest != other.digest


class TestDeletePredictions:
    def test_takes_its_boxes_along(self, store, state, tmp_path) -> None:
        found = add_predictions(
            store, "demo", "a", results(tmp_path / "a.json", "7.png"), actor="a"
        )
        delete_predictions(store, found.id, actor="local")
        assert read_predictions_of_view(store, state.view_ids["7.png"]) == []
        with pytest.raises(NotFoundError):
            get_predictions(store, found.id)
        with pytest.raises(NotFoundError):
            delete_predictions(store, found.id, actor="local")

    def test_a_view_that_goes_takes_its_predictions_along(self, store, state, tmp_path) -> None:
        add_predictions(
            store, "demo", "a", results(tmp_path / "a.json", "7.png", "7_1.png"), actor="a"
        )
        with store.write() as session:
            session.execute(delete(ViewModel).where(ViewModel.key == "7_1.png"))
        with store.read() as session:
            assert list(session.scalars(select(PredictionModel.view_id))) == [
                state.view_ids["7.png"]
            ]
            assert list(session.scalars(select(PredictedCameraModel.view_id))) == []


class TestSetName:
    def test_letters_that_a_set_cannot_have_become_dashes(self) -> None:
        assert make_prediction_set_name(Path("runs/best model (2).json")) == "best-model--2"

    def test_a_name_without_a_single_letter_is_replaced(self) -> None:
        assert make_prediction_set_name(Path("---.json")) == "predictions"
