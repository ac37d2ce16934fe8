from __future__ import annotations

import pytest

from app.formats.picture_finder import find_split_in_word, parse_split_name


class TestSplitOf:
    @pytest.mark.parametrize(
        ("name", "split"),
        [
            ("train", "train"), ("Train", "train"), ("training", "train"), ("train2017", "train"),
            ("train_set", "train"), ("val", "valid"), ("valid", "valid"), ("Validation", "valid"),
            ("val2017", "valid"), ("test", "test"), ("Testing", "test"), ("challenge", "challenge"),
            ("cam1", ""), ("contest", ""), ("latest", ""), ("valley", ""), ("default", ""), ("test_data", ""),
        ],
    )  # fmt: skip
    def test_names_of_folders(self, name: str, split: str) -> None:
        assert parse_split_name(name) == split


class TestSplitIn:
    @pytest.mark.parametrize(
        ("name", "split"),
        [
            ("instances_val2017", "valid"), ("_annotations.coco.train", "train"),
            ("custom-Test-v2", "test"), ("_annotations.coco", ""), ("train_val", ""),
        ],
    )  # fmt: skip
    def test_a_word_of_a_name_says_it(self, name: str, split: str) -> None:
        assert find_split_in_word(name) == split
