from __future__ import annotations

import pytest

from app.formats.picture_finder import find_split_in_word


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
