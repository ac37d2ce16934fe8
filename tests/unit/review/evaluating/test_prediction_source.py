from __future__ import annotations

from pathlib import Path

import pytest

from app.errors import NotFoundError
from app.review.evaluating.prediction_source import (
    PredictionSource,
    guess_format,
    prediction_set,
    set_name,
)


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


class TestGuessFormat:
    @pytest.mark.parametrize(
        ("name", "format_"), [("a.json", "coco"), ("a.csv", "csv"), ("labels/7.txt", "yolo")]
    )
    def test_the_ending_of_the_files_tells_the_format(self, tmp_path, name, format_) -> None:
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("x")
        assert guess_format(path) == format_
        assert guess_format(path.parent) == format_

    def test_a_folder_with_several_formats_is_read_by_its_tables(self, tmp_path) -> None:
        for name in ("a.json", "b.csv", "c.txt"):
            (tmp_path / name).write_text("x")
        assert guess_format(tmp_path) == "csv"


class TestSetName:
    def test_letters_that_a_set_cannot_have_become_dashes(self) -> None:
        assert set_name(Path("runs/best model (2).json")) == "best-model--2"

    def test_a_name_without_a_single_letter_is_replaced(self) -> None:
        assert set_name(Path("---.json")) == "predictions"
