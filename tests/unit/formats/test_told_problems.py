"""Whatever a reader cannot use is told with its record and field, and takes nothing else along."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.formats.camera_json import camera_to_json
from app.formats.issia_3d import open_issia_3d
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_sn_calibration
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize

Value = dict[str, Any]
Spoil = Callable[[Value], object]
Told = tuple[str | None, str | None, str]


def told(report: ReaderReport) -> list[Told]:
    return [(problem.record, problem.field, problem.problem) for problem in report.problems]


MISSING = "is missing, and no action links this replay"
SOCCERNET: dict[str, tuple[Spoil, list[Told], list[int]]] = {
    "actions missing": (
        lambda labels: labels.pop("actions"),
        [(None, "actions", "is missing or not an object")]
        + [
            (
                f"7_{n}.png",
                "linked_action",
                "names the action 7.png, which this file does not contain",
            )
            for n in (1, 0)
        ],
        [],
    ),
    "replays no object": (
        lambda labels: labels.update(replays=[]),
        [(None, "replays", "is missing or not an object")]
        + [
            ("7.png", "linked_replays", f"names 7_{n}.png, which this file does not contain")
            for n in (1, 0)
        ],
        [1, 1],
    ),
    "no replays at all": (
        lambda labels: (labels.pop("replays"), labels["actions"]["7.png"].pop("linked_replays")),
        [],
        [1, 1],
    ),
    "game no object": (
        lambda labels: labels.update(GameMetadata=5),
        [(None, "GameMetadata", "is not an object")],
        [3, 1],
    ),
    "links no list": (
        lambda labels: labels["actions"]["8.png"].update(linked_replays="7_1.png"),
        [("8.png", "linked_replays", "is not a list of image names")],
        [3, 1],
    ),
    "a link no name": (
        lambda labels: labels["actions"]["7.png"].update(linked_replays=["7_1.png", 5]),
        [("7.png", "linked_replays", "is not a list of image names")],
        [3, 1],
    ),
    "a replay of nobody": (
        lambda labels: (
            labels["actions"]["7.png"].update(linked_replays=["7_1.png"]),
            labels["replays"]["7_0.png"].pop("linked_action"),
        ),
        [("7_0.png", "linked_action", MISSING)],
        [2, 1],
    ),
    "a replay of an action that is not there": (
        lambda labels: (
            labels["actions"]["7.png"].update(linked_replays=["7_1.png"]),
            labels["replays"]["7_0.png"].update(linked_action="9.png"),
        ),
        [("7_0.png", "linked_action", "names the action 9.png, which this file does not contain")],
        [2, 1],
    ),
    "an action no object": (
        lambda labels: labels["actions"].update({"8.png": "text"}),
        [("8.png", None, "is not an image record")],
        [3],
    ),
}


@pytest.mark.parametrize("case", SOCCERNET)
def test_soccernet_v3(
    labels: Value, write_labels: Callable[[Any], Path], report: ReaderReport, case: str
) -> None:
    spoil, expected, views = SOCCERNET[case]
    spoil(labels)
    groups = list(read_soccernet_v3(write_labels(labels), report))
    assert told(report) == expected
    assert [len(group.views) for group in groups] == views


XGTF = (
    '<viper xmlns="http://lamp.cfar.umd.edu/viper#" xmlns:data="http://lamp.cfar.umd.edu/viperdata#">'
    '<data><sourcefile><object name="BALL" id="0"><attribute name="BallPos">'
    '<data:point framespan="18:18" x="100" y="50"/></attribute></object></sourcefile></data></viper>'
)
LINE = [{"x": 945.5, "y": 100.75}, {"x": 945.5, "y": 1026}]


@pytest.fixture
def folder(tmp_path: Path, camera: Camera) -> Path:
    """One camera with a ball, its calibration, and lines that an export laid beside it."""
    root = tmp_path / "issia"
    root.mkdir()
    (root / "ground_truth_3.xgtf").write_text(XGTF)
    (root / "issia_calibration.json").write_text(
        json.dumps({"cameras": {"cam3": camera_to_json(camera)}})
    )
    return root


def issia(folder: Path, report: ReaderReport, **options: Any) -> int:
    return len(list(open_issia(folder, IssiaOptions(**options), report).groups()))


def test_a_second_calibration_of_an_issia_folder_is_told_and_the_first_counts(
    folder: Path, report: ReaderReport
) -> None:
    (folder / "z").mkdir()
    (folder / "z" / "issia_calibration.json").write_text("{}")
    assert issia(folder, report) == 1
    ((_, _, problem),) = told(report)
    assert problem == "is a second issia_calibration.json; issia_calibration.json is used"


def test_a_calibration_that_is_no_json_is_told(folder: Path, report: ReaderReport) -> None:
    (folder / "issia_calibration.json").write_text("{")
    assert issia(folder, report) == 1
    (problem,) = report.problems
    assert "issia_calibration.json" in str(problem)


@pytest.mark.parametrize("beside", [False, True])
def test_lines_of_an_issia_camera_that_cannot_be_read_are_told(
    folder: Path, tmp_path: Path, report: ReaderReport, beside: bool
) -> None:
    """Those that were named as well as those that lie beside the ground truth."""
    lines = folder / "lines" if beside else tmp_path / "lines"
    lines.mkdir()
    (lines / "cam3.json").write_text(json.dumps({"Middle line": LINE, "Circle central": 5}))
    assert issia(folder, report, **({} if beside else {"lines": lines})) == 1
    (problem,) = report.problems
    assert "Circle central" in str(problem)
    assert "cam3.json" in str(problem)


def test_an_xgtf_file_without_a_number_says_which(folder: Path, report: ReaderReport) -> None:
    (folder / "ball.xgtf").write_text(XGTF)
    assert issia(folder, report) == 1
    (problem,) = report.problems
    assert str(problem).endswith("ball.xgtf: has no camera number in its name")


def test_cameras_and_lines_that_join_no_ground_truth_are_said(
    folder: Path, tmp_path: Path, camera: Camera, report: ReaderReport
) -> None:
    value = camera_to_json(camera)
    cameras = {"cam3": value, "camera_3": value, "cam5": value, "stand": value}
    (folder / "issia_calibration.json").write_text(json.dumps(cameras))
    lines = tmp_path / "lines"
    lines.mkdir()
    for name in ("cam3", "camera-3", "cam6", "stand"):
        (lines / f"{name}.json").write_text(json.dumps({"Middle line": LINE}))
    assert issia(folder, report, lines=lines) == 1
    assert [(problem.record, problem.problem) for problem in report.problems] == [
        ("camera_3", "is a second camera 3; left out"),
        ("stand", "has no camera number in its name; left out"),
        (None, "is a second file of lines of camera 3; left out"),
        (None, "has no camera number in its name; left out"),
    ]
    assert report.remarks == [
        "camera of cam5 not used: there is no ground truth of that camera",
        "line file of cam6 not used: there is no ground truth of that camera",
    ]


def test_half_a_pair_of_columns_is_named(tmp_path: Path, report: ReaderReport) -> None:
    (tmp_path / "ISSIA-3D.csv").write_text("frame,x_cam1,y_cam1,x_cam2,y_cam4\n7,1,2,3,4\n")
    found = open_issia_3d(tmp_path, IssiaOptions(), report)
    assert len(list(found.groups())) == 1
    assert [(problem.field, problem.problem) for problem in report.problems] == [
        ("x_cam2", "has no column y_cam2 beside it; left out"),
        ("y_cam4", "has no column x_cam4 beside it; left out"),
    ]


def test_images_of_match_info_without_lines_are_said(tmp_path: Path, report: ReaderReport) -> None:
    (tmp_path / "00001.json").write_text(json.dumps({"Middle line": [{"x": 0.5, "y": 0.5}]}))
    (tmp_path / "match_info.json").write_text(json.dumps({"00001.jpg": "a", "00002.jpg": "b"}))
    groups = list(read_sn_calibration(tmp_path, ImageSize(960, 540), report))
    assert [group.match for group in groups] == ["a"]
    assert report.remarks == ["1 image of match_info.json without a file of lines: 00002"]
