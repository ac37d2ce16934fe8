from __future__ import annotations

import pytest

from app.errors import NotFoundError
from app.review.evaluating.prediction_source import PredictionSource, prediction_set


class TestPredictionSet:
    def test_a_file_that_is_not_there_is_taken_for_the_name_of_a_set(
        self, store, fill, make_group
    ) -> None:
        fill(make_group(7))
        with pytest.raises(NotFoundError, match="no file and no set of predictions"):
            prediction_set(store, "demo", PredictionSource("nothing.json"), actor="ann")

    def test_beside_cameras_a_missing_file_is_never_taken_for_a_set(
        self, store, fill, make_group, tmp_path
    ) -> None:
        fill(make_group(7))
        source = PredictionSource("nothing.json", cameras=tmp_path)
        with pytest.raises(NotFoundError, match=r"there is no file nothing\.json"):
            prediction_set(store, "demo", source, actor="ann")
