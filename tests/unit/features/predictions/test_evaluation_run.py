from __future__ import annotations

from pathlib import Path

import pytest

from app.errors import InputError, NotFoundError
from app.evaluation.frame import GroundTruthFrame
from app.evaluation.result import Table
from app.features.predictions.evaluation_run import (
    AcceptedTruthCounts,
    EvaluationRequest,
    SourcesEvaluationRequest,
    read_or_find_prediction_set,
)
from app.features.predictions.reader import PredictionFiles
from app.soccer.frames import Box, ImageSize

BOXES = {"annotated": Box(1, 2, 3, 4)}


def frame(identity: int, source: str = "", **more: object) -> GroundTruthFrame:
    values = {"boxes": BOXES, "predicted_by": source, **more}
    return GroundTruthFrame(
        identity, 1, "g", f"{identity}.png", "m", ImageSize(1280, 720), **values
    )


class TestAcceptedTruth:
    def test_counts_frames_that_have_the_box_by_where_their_ball_is_from(self) -> None:
        frames = [frame(1), frame(2, "yolo"), frame(3, "old"), frame(4, "yolo", boxes={})]
        assert AcceptedTruthCounts.count(frames, "annotated", "yolo") == AcceptedTruthCounts(
            2, 1, 3
        )
        assert AcceptedTruthCounts.count(frames, "annotated", None) == AcceptedTruthCounts(2, 0, 3)
        assert AcceptedTruthCounts.count(frames, "exact", "yolo") == AcceptedTruthCounts(0, 0, 0)

    def test_warns_in_the_tables_that_it_flatters_alone(self) -> None:
        tables = [Table(name, name, (), (), "Note.") for name in ("detection", "cameras")]
        assert AcceptedTruthCounts(0, 0, 3).add_warnings(tables) == tables
        first, second = AcceptedTruthCounts(2, 1, 3).add_warnings(tables)
        assert first.note.startswith("Note. Warning: the ball of 2 of 3 frames")
        assert "1 of them from the evaluated set itself" in first.note
        assert second == tables[1]


class TestCheck:
    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"format": "csv"}, "--format needs a file of boxes"),
            ({"category": 32}, "--category needs a file of boxes"),
            ({"size": ImageSize(960, 540)}, "--size needs a file of boxes"),
            ({"images": Path("t.json")}, "--images needs a file of boxes"),
            (
                {"cameras_size": ImageSize(960, 540)},
                "--cameras-size needs predicted cameras",
            ),
        ],
    )
    @pytest.mark.parametrize("boxes", [None, Path("a-set")])
    def test_options_that_nothing_uses_are_refused(self, boxes, options, words: str) -> None:
        with pytest.raises(InputError, match=words):
            PredictionFiles(boxes, **options).refuse_unused_options()

    def test_so_are_those_of_careful_boxes_by_their_own_name(self) -> None:
        careful = PredictionFiles(None, category=1)
        request = SourcesEvaluationRequest(
            EvaluationRequest(), PredictionFiles(Path("a-set")), careful
        )
        with pytest.raises(InputError, match="--reference-category needs a file of boxes"):
            request.refuse_unused_options()

    def test_a_version_has_its_own_groups(self) -> None:
        nothing = PredictionFiles(None)
        request = SourcesEvaluationRequest(
            EvaluationRequest(groups="all"), nothing, nothing, version="v1"
        )
        with pytest.raises(InputError, match='groups "all" cannot be combined with a version'):
            request.refuse_unused_options()


class TestPredictionSet:
    def test_a_file_that_is_not_there_is_taken_for_the_name_of_a_set(
        self, store, fill, make_group
    ) -> None:
        fill(make_group(7))
        with pytest.raises(NotFoundError, match="no file and no set of predictions"):
            read_or_find_prediction_set(
                store, "demo", PredictionFiles(Path("nothing.json")), actor="ann"
            )

    def test_beside_cameras_a_missing_file_is_never_taken_for_a_set(
        self, store, fill, make_group, tmp_path
    ) -> None:
        fill(make_group(7))
        source = PredictionFiles(Path("nothing.json"), cameras=tmp_path)
        with pytest.raises(NotFoundError, match=r"there is no file nothing\.json"):
            read_or_find_prediction_set(store, "demo", source, actor="ann")
