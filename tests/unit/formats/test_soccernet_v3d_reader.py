from __future__ import annotations

import json
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.formats.report import ReaderReport
from app.formats.soccernet_v3d_reader import read_soccernet_v3d
from app.soccer.frames import Box
from app.soccer.group import Group

Value = dict[str, Any]


@pytest.fixture
def solved_labels(labels: Value, camera_json: Value) -> Value:
    """Labels-v3D.json as released: cameras and JaC beside the metadata, empty reconstructions."""
    labels["GameMetadata"]["reconstructions"] = [{}, {}]
    for image in labels["actions"].values():
        image["imageMetadata"] |= {
            "calibration": camera_json,
            "JaC": {"JaC@0.005": 0.9},
            "calibrated_replays": ["7_1.png"],
        }
    labels["replays"]["7_0.png"]["imageMetadata"]["calibration"] = None
    return labels


@pytest.fixture
def read(tmp_path: Path, match: str, report: ReaderReport) -> Callable[..., list[Group]]:
    def run(text: str | None, table: str | None = None, **options: Any) -> list[Group]:
        folder = tmp_path / match
        folder.mkdir(parents=True, exist_ok=True)
        if text is not None:
            (folder / "Labels-v3D.json").write_text(text)
        if table is not None:
            (tmp_path / "SNv3D.csv").write_text(table)
        return list(read_soccernet_v3d(tmp_path, report, **options))

    return run


def table(match: str, *rows: str) -> str:
    league, season, folder = match.split("/")
    head = "league,season,match,main_action,action,replay,img_w,img_h,ball_bbox,set"
    return "\n".join([head, *(f"{league},{season},{folder},{row}" for row in rows), ""])


class TestNamesWithAccents:
    """macOS writes folders with accents apart from their letters, tables write them together."""

    MATCH = "germany_bundesliga/2014-2015/2015-02-21 - 17-30 Bayern M\u00fcnchen 2 - 1 K\u00f6ln"

    @pytest.mark.parametrize("spelt", ["NFC", "NFD"])
    def test_labels_table_and_lists_of_a_match_are_of_one_group(
        self, tmp_path: Path, labels: Value, report: ReaderReport, spelt: Any
    ) -> None:
        folder = tmp_path / unicodedata.normalize(spelt, self.MATCH)
        folder.mkdir(parents=True)
        (folder / "Labels-v3D.json").write_text(json.dumps(labels))
        rows = ["7,True,,1280,720,,", '8,True,,1280,720,"[1, 2, 3, 4]",']
        (tmp_path / "SNv3D.csv").write_text(table(self.MATCH, *rows))
        name = unicodedata.normalize("NFD", self.MATCH.rpartition("/")[2])
        (tmp_path / "SNv3D-test.txt").write_text(f"{name}/7\n{name}/8\n")
        (folder / "8.png").write_bytes(b"")
        groups = list(read_soccernet_v3d(tmp_path, report))
        assert [group.key for group in groups] == [f"{self.MATCH}/7.png", f"{self.MATCH}/8.png"]
        assert [group.split for group in groups] == ["test", "test"]
        media = groups[1].views[0].media
        assert media is not None
        assert media.path == str(folder / "8.png")


class TestReadSoccernetV3d:
    @pytest.mark.parametrize("spell", [json.dumps, lambda value: json.dumps(repr(value))])
    def test_plain_json_and_a_json_string_with_a_python_dict_in_it(
        self,
        read: Callable[..., list[Group]],
        solved_labels: Value,
        report: ReaderReport,
        spell: Any,
    ) -> None:
        first, second = read(spell(solved_labels))
        assert [view.key for view in first.views] == ["7.png", "7_1.png", "7_0.png"]
        assert [view.station.given is not None for view in first.views] == [True, False, False]
        assert second.key.endswith("8.png")
        assert report.problems == []

    def test_what_was_computed_is_not_kept_as_said(
        self, read: Callable[..., list[Group]], solved_labels: Value
    ) -> None:
        views = [view for group in read(json.dumps(solved_labels)) for view in group.views]
        assert len(views) >= 4
        for view in views:
            text = json.dumps(view.extras.metadata)
            assert "JaC" not in text and "reconstructions" not in text
            assert "pan_degrees" not in text and "calibrated_replays" not in text

    def test_code_in_the_string_is_not_run(
        self, read: Callable[..., list[Group]], report: ReaderReport, tmp_path: Path
    ) -> None:
        mark = tmp_path / "mark"
        assert read(json.dumps(f"open({str(mark)!r}, 'w').close()")) == []
        assert not mark.exists()
        assert "neither JSON nor a Python literal" in report.problems[0].problem

    def test_a_camera_that_is_wrong_is_left_out_and_named(
        self, read: Callable[..., list[Group]], solved_labels: Value, report: ReaderReport
    ) -> None:
        del solved_labels["actions"]["7.png"]["imageMetadata"]["calibration"]["x_focal_length"]
        first, _ = read(json.dumps(solved_labels))
        assert first.views[0].station.given is None
        places = {(item.record, item.field) for item in report.problems}
        assert ("7.png", "calibration, x_focal_length") in places

    def test_the_table_has_the_annotated_box_and_the_split(
        self, read: Callable[..., list[Group]], solved_labels: Value, match: str
    ) -> None:
        rows = table(match, '7,True,,1280,720,"[600, 300, 14, 13]",test')
        first, _ = read(json.dumps(solved_labels), rows)
        assert first.views[0].balls[0].box == Box(600.0, 300.0, 14.0, 13.0)
        assert first.views[1].balls[0].box == Box(610.0, 300.0, 12.0, 11.0)
        assert first.split == "test"

    def test_the_table_alone_makes_groups_without_lines(
        self, read: Callable[..., list[Group]], match: str, report: ReaderReport, tmp_path: Path
    ) -> None:
        (tmp_path / match).mkdir(parents=True)
        (tmp_path / match / "7_2.png").write_bytes(b"x")
        rows = table(
            match,
            "7,0.0,2.0,1280,720,,train",
            '7,1.0,nan,1280,720,"[1, 2, 3, 4]",train',
            "9,0,1,1280,720,,train",
        )
        (group,) = read(None, rows)
        assert [view.key for view in group.views] == ["7.png", "7_2.png"]
        assert group.views[1].media is not None
        assert all(view.station.lines == {} for view in group.views)
        assert [item.record for item in report.problems] == [f"{match}/9.png"]

    def test_lines_can_count_instead_of_the_cameras(
        self, read: Callable[..., list[Group]], solved_labels: Value
    ) -> None:
        first, _ = read(json.dumps(solved_labels), calibration="lines")
        assert {view.station.calibration for view in first.views} == {"lines"}

    def test_a_view_of_the_table_that_the_labels_do_not_have_is_reported(
        self,
        read: Callable[..., list[Group]],
        solved_labels: Value,
        match: str,
        report: ReaderReport,
    ) -> None:
        rows = table(match, "7,0,5,1280,720,,train")
        read(json.dumps(solved_labels), rows)
        assert [item.record for item in report.problems] == ["7_5.png"]

    @pytest.mark.parametrize("spelt", ["7{}.jpg", "0007{}.png", "07{}.jpeg"])
    def test_rows_belong_to_images_by_their_numbers_however_these_are_spelt(
        self,
        read: Callable[..., list[Group]],
        solved_labels: Value,
        match: str,
        tmp_path: Path,
        report: ReaderReport,
        spelt: str,
    ) -> None:
        text = json.dumps(solved_labels)
        for replay in ("", "_0", "_1"):
            text = text.replace(f"7{replay}.png", spelt.format(replay))
        (tmp_path / "SNv3D-test.txt").write_text(f"{match.rpartition('/')[2]}/7\n")
        rows = table(
            match,
            '7,True,,1280,720,"[600, 300, 14, 13]",train',
            '7,0,1,1280,720,"[500, 300, 14, 13]",train',
        )
        first, second = read(text, rows)
        assert [view.key for view in first.views] == [
            spelt.format(replay) for replay in ("", "_1", "_0")
        ]
        assert [view.balls[0].box for view in first.views[:2]] == [
            Box(600.0, 300.0, 14.0, 13.0),
            Box(500.0, 300.0, 14.0, 13.0),
        ]
        assert (first.split, second.key) == ("test", f"{match}/8.png")
        assert report.problems == [] and report.remarks == []

    @pytest.mark.parametrize("name", ["7.png", "0007.png", "7.jpg"])
    def test_a_frame_of_the_table_alone_is_found_by_its_numbers(
        self, read: Callable[..., list[Group]], match: str, tmp_path: Path, name: str
    ) -> None:
        (tmp_path / match).mkdir(parents=True)
        (tmp_path / match / name).write_bytes(b"x")
        (group,) = read(None, table(match, "7,1,,1280,720,,train"))
        assert group.views[0].media is not None
        assert group.views[0].media.path == str(tmp_path / match / name)

    def test_actions_of_the_split_lists_that_did_not_come_are_said(
        self,
        read: Callable[..., list[Group]],
        solved_labels: Value,
        match: str,
        tmp_path: Path,
        report: ReaderReport,
    ) -> None:
        folder = match.rpartition("/")[2]
        lines = [f"{folder}/7", f"{folder}/7_1", f"{folder}/99", f"{folder}/99_1", "Other/1"]
        (tmp_path / "SNv3D-train.txt").write_text("\n".join(lines))
        read(json.dumps(solved_labels), table(match, "7,1,,1280,720,,test"))
        assert report.remarks == [
            f"2 actions of the split lists did not come: {folder}/99, Other/1"
        ]
