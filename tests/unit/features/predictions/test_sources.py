from __future__ import annotations

from pathlib import Path

import pytest

from app.errors import InputError, NotFoundError
from app.features.predictions.evaluation_run import EvaluationRequest
from app.features.predictions.reader import PredictionFiles
from app.features.predictions.sources import SourcesRequest, prediction_set
from app.soccer.frames import ImageSize


class TestCheck:
    @pytest.mark.parametrize(
        ("options", "words"),
        [
            ({"format": "csv"}, "--format is for a file of boxes"),
            ({"category": 32}, "--category is for"),
            ({"size": ImageSize(960, 540)}, "--size is for"),
            ({"images": Path("t.json")}, "--images is for"),
            (
                {"cameras_size": ImageSize(960, 540)},
                "--cameras-size is the size of predicted cameras",
            ),
        ],
    )
    @pytest.mark.parametrize("boxes", [None, Path("a-set")])
    def test_options_that_nothing_uses_are_refused(self, boxes, options, words: str) -> None:
        with pytest.raises(InputError, match=words):
            PredictionFiles(boxes, **options).check()

    def test_so_are_those_of_careful_boxes_by_their_own_name(self) -> None:
        careful = PredictionFiles(None, category=1)
        request = SourcesRequest(EvaluationRequest(), PredictionFiles(Path("a-set")), careful)
        with pytest.raises(InputError, match="--careful-category is for"):
            request.check()

    def test_a_version_has_its_own_groups(self) -> None:
        nothing = PredictionFiles(None)
        request = SourcesRequest(EvaluationRequest(groups="all"), nothing, nothing, version="v1")
        with pytest.raises(InputError, match='groups "all" is not used'):
            request.check()


class TestPredictionSet:
    def test_a_file_that_is_not_there_is_taken_for_the_name_of_a_set(
        self, store, fill, make_group
    ) -> None:
        fill(make_group(7))
        with pytest.raises(NotFoundError, match="no file and no set of predictions"):
            prediction_set(store, "demo", PredictionFiles(Path("nothing.json")), actor="ann")

    def test_beside_cameras_a_missing_file_is_never_taken_for_a_set(
        self, store, fill, make_group, tmp_path
    ) -> None:
        fill(make_group(7))
        source = PredictionFiles(Path("nothing.json"), cameras=tmp_path)
        with pytest.raises(NotFoundError, match=r"there is no file nothing\.json"):
            prediction_set(store, "demo", source, actor="ann")
