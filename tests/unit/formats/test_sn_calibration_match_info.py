from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.formats.report import ReaderReport
from app.formats.sn_calibration import (
    MatchInfoWriter,
    build_match_key_of_record,
    find_match_info_of_view,
    read_match_info,
)
from app.formats.trees import open_tree
from app.soccer.group import Group


def read(root: Path, report: ReaderReport) -> Any:
    tree = open_tree(root, report)
    assert tree is not None
    return read_match_info(tree, tree.names(), report)


class TestReadMatchInfo:
    def test_images_by_their_place_and_both_files_together(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "valid").mkdir()
        first = {"00001.jpg": {"match": "m"}, "00002.jpg": "league/season/match", "00003.jpg": 3}
        (tmp_path / "valid/match_info.json").write_text(json.dumps(first))
        camera = {"00001.jpg": {"camera": "Main camera center"}}
        (tmp_path / "valid/match_info_cam_gt.json").write_text(json.dumps(camera))
        found = read(tmp_path, report)
        assert found["valid/00001"] == {"match": "m", "camera": "Main camera center"}
        assert build_match_key_of_record(found["valid/00002"]) == "league/season/match"
        assert [item.record for item in report.problems] == ["00003.jpg"]

    def test_one_number_that_is_none_costs_no_other_image(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        text = '{"1.jpg": {"match": "m", "ms_time": NaN}, "2.jpg": {"match": "n"}}'
        (tmp_path / "match_info.json").write_text(text)
        found = read(tmp_path, report)
        assert {key: record["match"] for key, record in found.items()} == {"1": "m", "2": "n"}
        assert report.problems == []
        assert len(report.remarks) == 1 and "1.jpg" in report.remarks[0]

    def test_a_file_of_matches_counts_where_no_other_says_anything(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "match_info.json").write_text('{"1.jpg": {"match": "m"}}')
        matches = {
            "l/s/other": {"1.jpg": {"half": 1}, "2.jpg": {"half": 2}},
            "l/s/wrong": 3,
        }
        (tmp_path / "per_match_info.json").write_text(json.dumps(matches))
        assert read(tmp_path, report) == {
            "1": {"match": "m"},
            "2": {"match": "l/s/other", "half": 2},
        }
        assert [item.record for item in report.problems] == ["l/s/wrong"]

    def test_a_file_that_is_no_object_is_reported(
        self, tmp_path: Path, report: ReaderReport
    ) -> None:
        (tmp_path / "match_info.json").write_text("[]")
        assert read(tmp_path, report) == {}
        assert "not an object" in report.problems[0].problem


class TestMatchOf:
    @pytest.mark.parametrize(
        ("record", "match"),
        [
            ({"league": "l", "season": "s", "match": "m"}, "l/s/m"),
            ({"match": "m"}, "m"),
            ({"UrlLocal": "l/s/m/"}, "l/s/m"),
            ({"match": "../../etc"}, ""),
            ({"match": None}, ""),
            ({}, ""),
        ],
    )
    def test_the_match_is_found_in_every_spelling_of_it(
        self, record: dict[str, Any], match: str
    ) -> None:
        assert build_match_key_of_record(record) == match


class TestMatchInfoWriter:
    def test_writes_what_it_reads(
        self, tmp_path: Path, soccer_group: Callable[..., Group], report: ReaderReport
    ) -> None:
        group = soccer_group(match="l/s/m")
        with MatchInfoWriter(tmp_path) as info:
            for view in group.views:
                info.add(f"l/s/m/{view.key}", find_match_info_of_view(group, view))
        found = read(tmp_path, report)
        assert {build_match_key_of_record(record) for record in found.values()} == {"l/s/m"}
        assert set(found) == {"l/s/m/7", "l/s/m/7_1"}

    def test_without_images_it_is_an_empty_object(self, tmp_path: Path) -> None:
        with MatchInfoWriter(tmp_path):
            pass
        assert json.loads((tmp_path / "match_info.json").read_text()) == {}
