from __future__ import annotations

import csv
from collections.abc import Callable
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from app.formats.file_tree import DEFAULT_LIMITS
from app.formats.report import ReaderReport
from app.formats.soccernet_v3d_reader import SoccerNetV3DTable, read_snv3d_table
from app.formats.trees import open_tree
from app.soccer.frames import Box, ImageSize

MATCH = "lea/2030-2031/2030-08-17 - 18-00 A 1 - 0 B"
HEAD = (
    ",league,season,match,main_action,action,replay,img_w,img_h,is_ball,ball_bbox,calibration,"
    "JaC@0.005,JaC@0.01,JaC@0.02,ball_3D,rep_error,optimized_error,optimized_d,set\n"
)
Read = Callable[..., SoccerNetV3DTable]


def row(number: int = 0, **cells: Any) -> str:
    league, season, match = MATCH.split("/")
    values = {
        "league": league, "season": season, "match": match, "main_action": 7, "action": True,
        "replay": "", "w": 1280, "h": 720, "is_ball": True, "box": '"[1.5, 2, 3, 4]"',
        "camera": "", "jac": "nan,nan,nan", "ball": '"[array([1., -2.5, nan])]"',
        "rest": "nan,nan,nan", "set": "train",
    } | cells  # fmt: skip
    return f"{number}," + ",".join(str(value) for value in values.values()) + "\n"


@pytest.fixture
def read(tmp_path: Path, report: ReaderReport) -> Read:
    def run(text: str, **files: str) -> SoccerNetV3DTable:
        (tmp_path / "SNv3D.csv").write_text(text, encoding="utf-8")
        for name, content in files.items():
            (tmp_path / f"SNv3D-{name}.txt").write_text(content)
        tree = open_tree(tmp_path, report)
        assert tree is not None
        return read_snv3d_table(tree, tree.names(), report, DEFAULT_LIMITS)

    return run


class TestReadSnv3dTable:
    def test_a_row_with_nan_and_array_in_it(self, read: Read, report: ReaderReport) -> None:
        table = read(HEAD + row())
        (found,) = table.rows[MATCH]["7.png"].values()
        assert (found.image, found.size, found.split) == ("7.png", ImageSize(1280, 720), "train")
        assert found.ball is not None
        assert found.ball.box == Box(1.5, 2.0, 3.0, 4.0)
        assert found.camera is None
        assert report.problems == []

    @pytest.mark.parametrize(
        ("action", "replay", "image"),
        [
            ("True", "", "7.png"),
            ("1.0", "nan", "7.png"),
            ("False", "1.0", "7_1.png"),
            ("0.0", "0.0", "7_0.png"),
            ("0", "2", "7_2.png"),
        ],
    )
    def test_actions_and_replays_in_every_spelling(
        self, read: Read, action: str, replay: str, image: str
    ) -> None:
        table = read(HEAD + row(action=action, replay=replay, main_action="7.0"))
        assert list(table.rows[MATCH]["7.png"]) == [image]

    def test_a_byte_order_mark_is_tolerated(self, read: Read) -> None:
        assert read("\ufeff" + HEAD + row()).rows

    def test_columns_may_stand_in_any_order(self, read: Read, report: ReaderReport) -> None:
        # Quoted commas: through the reader and the writer of the standard library.
        rows = [list(reversed(cells)) for cells in csv.reader(StringIO(HEAD + row()))]
        text = StringIO()
        csv.writer(text).writerows(rows)
        assert read(text.getvalue()).rows[MATCH]

    def test_the_camera_is_a_python_literal(self, read: Read, camera_json: dict[str, Any]) -> None:
        table = read(HEAD + row(camera=f'"{camera_json}"'))
        (found,) = table.rows[MATCH]["7.png"].values()
        assert found.camera is not None
        assert found.camera.focal_length == (2100.5, 2099.25)

    @pytest.mark.parametrize(
        "cell",
        [
            "\"__import__('os').system('x')\"",
            "\"{'pan_degrees': open('/etc/passwd')}\"",
            '"' + "[" * 500 + '"',
        ],
    )
    def test_code_in_a_cell_is_reported_and_never_run(
        self, read: Read, report: ReaderReport, cell: str
    ) -> None:
        table = read(HEAD + row(camera=cell))
        assert table.rows[MATCH]["7.png"]["7.png"].camera is None
        (problem,) = report.problems
        assert (problem.record, problem.field) == ("line 2", "calibration")

    @pytest.mark.parametrize(
        ("cells", "field"),
        [
            ({"action": "maybe"}, "action"),
            ({"action": False, "replay": ""}, "replay"),
            ({"main_action": "x"}, "main_action"),
            ({"w": 0}, "img_w"),
            ({"league": ".."}, "league"),
            ({"match": "a/b"}, "match"),
            ({"season": ""}, "season"),
        ],
    )
    def test_a_row_that_is_wrong_is_left_out_and_named(
        self, read: Read, report: ReaderReport, cells: dict[str, Any], field: str
    ) -> None:
        table = read(HEAD + row(**cells) + row(1, main_action=8))
        assert list(table.rows[MATCH]) == ["8.png"]
        assert [(item.record, item.field) for item in report.problems] == [("line 2", field)]

    @pytest.mark.parametrize("box", ['"[1, 2, 3]"', '"[1, 2, 0, 4]"', '"1; 2"', '"[1,2,3,1e999]"'])
    def test_a_box_that_is_none_costs_the_box_alone(
        self, read: Read, report: ReaderReport, box: str
    ) -> None:
        table = read(HEAD + row(box=box))
        assert table.rows[MATCH]["7.png"]["7.png"].ball is None
        assert [item.field for item in report.problems] == ["ball_bbox"]

    @pytest.mark.parametrize(("said", "split"), [("val", "valid"), (" Test", "test"), ("x", "x")])
    def test_a_split_has_one_spelling(
        self, read: Read, report: ReaderReport, said: str, split: str
    ) -> None:
        table = read(HEAD + row(set=said))
        assert table.find_split_of_group(MATCH, "7.png") == split
        assert len(report.remarks) == (split == "x")

    def test_the_split_lists_come_before_the_column(self, read: Read, report: ReaderReport) -> None:
        folder = MATCH.split("/")[-1]
        table = read(HEAD + row(), test=f"{folder}/7\n{folder}/7_1\n\nnot a view\n")
        assert table.find_split_of_group(MATCH, "7.png") == "test"
        assert [item.record for item in report.problems] == ["line 4"]

    def test_a_view_in_both_lists_is_reported(self, read: Read, report: ReaderReport) -> None:
        table = read(HEAD + row(), train="m/7\n", test="m/7\n")
        assert table.lists["m", "7"] == "train"
        assert len(report.problems) == 1

    def test_another_table_is_refused(self, read: Read, report: ReaderReport) -> None:
        assert read("frame,x\n1,2\n").rows == {}
        assert report.problems[0].field == "league"

    def test_a_second_row_of_a_view_is_reported(self, read: Read, report: ReaderReport) -> None:
        read(HEAD + row() + row(1))
        assert "second row" in report.problems[0].problem
