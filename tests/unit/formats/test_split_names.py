from __future__ import annotations

import pytest

from app.formats.report import ReaderReport
from app.formats.split_names import parse_split_name, read_split_name, split_in_file_name


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


class TestReadSplitName:
    @pytest.mark.parametrize(
        ("name", "split"),
        [("Validation", "valid"), (" Test ", "test"), ("val", "valid"), ("", ""), (" ", "")],
    )
    def test_a_split_has_one_spelling(self, name: str, split: str, report: ReaderReport) -> None:
        assert read_split_name(name, report) == split
        assert report.remarks == []

    def test_another_split_stays_and_is_named_once(self, report: ReaderReport) -> None:
        assert [read_split_name("fold-3", report) for _ in range(2)] == ["fold-3", "fold-3"]
        (remark,) = report.remarks
        assert remark.startswith('The split "fold-3" is none of train, valid, test')
        assert report.problems == []


class TestSplitInFileName:
    @pytest.mark.parametrize(
        ("split", "name"),
        [
            ("test", "test"), ("Fold 1", "Fold 1"), ("a/b", "a-b"), ("..", "unassigned"),
            ("../x", "-x"), ("x" * 300, "x" * 50), ("", "unassigned"),
        ],
    )  # fmt: skip
    def test_it_is_one_name_and_leads_nowhere(self, split: str, name: str) -> None:
        assert split_in_file_name(split) == name
