from __future__ import annotations

import ast
import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.errors import InputError, UnsafePathError
from app.formats.camera_json import camera_from_json
from app.formats.export_record import ExportRecord
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_reader import read_soccernet_v3
from app.formats.soccernet_v3_writer import (
    COLUMNS,
    labels_to_json,
    parse_league_season_match,
    write_soccernet_v3,
    write_soccernet_v3d,
)
from app.formats.soccernet_v3d_reader import read_soccernet_v3d
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group

Solved = Callable[..., ExportRecord]
Make = Callable[..., Group]


def _rows(root: Path) -> list[dict[str, str]]:
    with (root / "SNv3D.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


class TestWriteSoccernetV3d:
    def test_the_columns_are_the_released_ones(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_soccernet_v3d(tmp_path, [solved(soccer_group())])
        header = (tmp_path / "SNv3D.csv").read_text().splitlines()[0]
        assert header == (
            ",league,season,match,main_action,action,replay,img_w,img_h,is_ball,ball_bbox,"
            "calibration,JaC@0.005,JaC@0.01,JaC@0.02,ball_3D,rep_error,optimized_error,"
            "optimized_d,set"
        )
        assert header.split(",")[1:] == list(COLUMNS)

    def test_one_row_a_view_with_the_values_of_the_solution(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera
    ) -> None:
        counts = write_soccernet_v3d(tmp_path, [solved(soccer_group())])
        action, replay = _rows(tmp_path)
        league, season, folder = match.split("/")
        calibration = action.pop("calibration")
        assert action == {
            "": "0", "league": league, "season": season, "match": folder, "main_action": "7",
            "action": "True", "replay": "", "img_w": "1280", "img_h": "720", "is_ball": "True",
            "ball_bbox": "[610.0, 300.0, 12.0, 11.0]", "JaC@0.005": "0.9", "JaC@0.01": "1.0",
            "JaC@0.02": "1.0", "ball_3D": "[array([1.5, -2.25, -0.113])]", "rep_error": "0.75",
            "optimized_error": "0.125", "optimized_d": "10.5", "set": "train",
        }  # fmt: skip
        assert (replay[""], replay["action"], replay["replay"]) == ("1", "False", "1.0")
        # The calibration cell is a Python literal of plain floats.
        assert camera_from_json(ast.literal_eval(calibration), "f") == camera
        assert counts == {"groups": 1, "views": 2, "balls": 2}

    def test_views_that_fell_have_a_row_without_ball(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_soccernet_v3d(tmp_path, [solved(soccer_group(replays=3))])
        third, fourth = _rows(tmp_path)[2:]
        names = ("ball_3D", "rep_error", "optimized_error", "optimized_d")
        assert [third[name] for name in names] == [""] * 4
        assert third["calibration"] != ""
        assert fourth["calibration"] == ""

    def test_everything_fills_all_views_and_adds_the_verdict(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        records = [
            solved(soccer_group(replays=2)),
            ExportRecord(soccer_group("8.png"), None, "rejected", "duplicate_view"),
        ]
        write_soccernet_v3d(tmp_path, records, everything=True)
        rows = _rows(tmp_path)
        assert list(rows[0])[-1] == "verdict"
        assert rows[2]["ball_3D"] != ""
        assert [row["verdict"] for row in rows] == [
            *["accepted"] * 3, *["rejected: duplicate_view"] * 2,
        ]  # fmt: skip

    def test_no_cell_is_ever_nan(self, tmp_path: Path, solved: Solved, soccer_group: Make) -> None:
        records = [solved(soccer_group(), ball=False)]
        write_soccernet_v3d(tmp_path, records, everything=True)
        assert not re.search(r"\bnan\b", (tmp_path / "SNv3D.csv").read_text(), re.IGNORECASE)

    def test_the_split_files_name_every_view_of_their_split(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str
    ) -> None:
        records = [solved(soccer_group()), solved(soccer_group("8.png", split="test"))]
        write_soccernet_v3d(tmp_path, records)
        folder = match.split("/")[-1]
        assert (tmp_path / "SNv3D-train.txt").read_text() == f"{folder}/7\n{folder}/7_1\n"
        assert (tmp_path / "SNv3D-test.txt").read_text() == f"{folder}/8\n{folder}/8_1\n"

    def test_the_labels_are_plain_json_beside_the_sources_own(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, camera: Camera
    ) -> None:
        write_soccernet_v3d(tmp_path, [solved(soccer_group(replays=2))])
        labels = json.loads((tmp_path / match / "Labels-v3D.json").read_text())
        assert labels["GameMetadata"]["reconstructions"] == ["7.png"]
        image = labels["actions"]["7.png"]["imageMetadata"]
        assert image["calibrated_replays"] == ["7_1.png"]
        assert camera_from_json(image["calibration"], "f") == camera
        assert image["JaC"] == {"JaC@0.005": 0.9, "JaC@0.01": 1.0, "JaC@0.02": 1.0}
        assert image["ball_3D"] == [1.5, -2.25, -0.113]
        third = labels["replays"]["7_2.png"]["imageMetadata"]
        assert "calibration" in third
        assert "ball_3D" not in third

    def test_the_labels_still_hold_the_annotations(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, report: ReaderReport
    ) -> None:
        group = soccer_group()
        write_soccernet_v3d(tmp_path, [solved(group)], boxes="annotated")
        path = tmp_path / match / "Labels-v3D.json"
        path.rename(path.with_name("Labels-v3.json"))
        (again,) = read_soccernet_v3(tmp_path, report)
        assert [view.station.lines for view in again.views] == [
            view.station.lines for view in group.views
        ]
        assert [view.balls for view in again.views] == [view.balls for view in group.views]

    @pytest.mark.parametrize(
        ("boxes", "points"),
        [
            ("annotated", [610.0, 300.0, 622.0, 311.0]),
            ("optimized", [610.75, 300.25, 621.25, 310.75]),
            ("exact", [610.5, 300.0, 621.1, 310.4]),
        ],
    )
    @pytest.mark.parametrize("everything", [False, True])
    def test_the_labels_hold_the_chosen_ball_box_of_views_that_take_part(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str, boxes: str,
        points: list[float], everything: bool,
    ) -> None:  # fmt: skip
        records = [solved(soccer_group(replays=2))]
        write_soccernet_v3d(tmp_path, records, everything=everything, boxes=boxes)
        labels = json.loads((tmp_path / match / "Labels-v3D.json").read_text())
        images = labels["actions"] | labels["replays"]
        found = {
            name: [list(box["points"].values()) for box in image["bboxes"]]
            for name, image in images.items()
        }
        annotated = [610.0, 300.0, 622.0, 311.0]
        assert found == {
            "7.png": [pytest.approx(points)],
            "7_1.png": [pytest.approx(points)],
            "7_2.png": [annotated],
        }

    def test_the_table_keeps_the_annotated_box(
        self, tmp_path: Path, solved: Solved, soccer_group: Make
    ) -> None:
        write_soccernet_v3d(tmp_path, [solved(soccer_group())], boxes="exact")
        assert {row["ball_bbox"] for row in _rows(tmp_path)} == {"[610.0, 300.0, 12.0, 11.0]"}

    def test_a_ball_that_is_a_point_is_a_box_without_area_and_comes_back(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, report: ReaderReport
    ) -> None:
        group = soccer_group()
        point = BallAnnotation(point=ImagePoint(12.5, 34.25))
        for view in group.views:
            group = group.with_view(replace(view, balls=(point,)))
        write_soccernet_v3d(tmp_path, [solved(group)], everything=True)
        cells = {(row["is_ball"], row["ball_bbox"]) for row in _rows(tmp_path)}
        assert cells == {("True", "[12.5, 34.25, 0.0, 0.0]")}
        for labels in tmp_path.rglob("Labels-v3D.json"):
            labels.unlink()
        (again,) = read_soccernet_v3d(tmp_path, report)
        assert [view.balls for view in again.views] == [(point,)] * len(group.views)
        assert report.problems == []

    def test_several_balls_stay_as_they_are(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str
    ) -> None:
        group = soccer_group()
        balls = (*group.views[0].balls, BallAnnotation(box=Box(10.0, 20.0, 8.0, 8.0)))
        record = solved(group.with_view(replace(group.views[0], balls=balls)))
        write_soccernet_v3d(tmp_path, [record])
        labels = json.loads((tmp_path / match / "Labels-v3D.json").read_text())
        corners = [box["points"]["x1"] for box in labels["actions"]["7.png"]["bboxes"]]
        assert corners == [610.0, 10.0]

    def test_groups_of_other_datasets_are_refused(
        self, tmp_path: Path, solved: Solved, issia_group: Make
    ) -> None:
        with pytest.raises(InputError, match="is not from SoccerNet"):
            write_soccernet_v3d(tmp_path, [solved(issia_group())])

    def test_records_are_streamed(
        self, tmp_path: Path, solved: Solved, soccer_group: Make, match: str
    ) -> None:
        alive = 0

        def records() -> object:
            nonlocal alive
            for number in range(5):
                folder = match.replace("Alder", f"Alder{number}")
                # Every earlier match lies on the disk already, but for the one before.
                written = len(list(tmp_path.rglob("Labels-v3D.json")))
                alive = max(alive, number - written)
                yield solved(soccer_group(match=folder))

        write_soccernet_v3d(tmp_path, records())  # type: ignore[arg-type]
        assert alive <= 1


Write = Callable[[Any], Path]


def _read(root: Path, report: ReaderReport) -> list[Group]:
    return list(read_soccernet_v3(root, report))


class TestWriteSoccernetV3:
    def test_import_export_import_gives_the_same_groups(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, tmp_path: Path
    ) -> None:
        labels["version"] = 3
        labels["actions"]["7.png"]["extra"] = [1]
        first = _read(write_labels(labels), report)
        (tmp_path / "out").mkdir()
        write_soccernet_v3(tmp_path / "out", first)
        assert _read(tmp_path / "out", report) == first
        assert report.problems == []

    def test_what_readers_of_the_format_follow_is_there(
        self, labels: dict[str, Any], write_labels: Write, report: ReaderReport, match: str
    ) -> None:
        value = labels_to_json(match, _read(write_labels(labels), report))
        assert value["GameMetadata"] == {
            "UrlLocal": match,
            "gameHomeTeam": "Alder Town",
            "list_actions": ["7.png", "8.png"],
            "list_replays": ["7_1.png", "7_0.png"],
        }
        assert value["actions"]["7.png"]["linked_replays"] == ["7_1.png", "7_0.png"]
        assert value["replays"]["7_0.png"]["linked_action"] == "7.png"

    def test_a_match_that_comes_again_is_added_to_its_file(
        self, soccer_group: Callable[..., Group], tmp_path: Path, report: ReaderReport, match: str
    ) -> None:
        other = match.replace("Alder", "Cedar")
        groups = [soccer_group("7.png"), soccer_group("7.png", match=other), soccer_group("8.png")]
        write_soccernet_v3(tmp_path, groups)
        again = _read(tmp_path, report)
        assert [group.key for group in again] == [
            f"{match}/7.png", f"{match}/8.png", f"{other}/7.png",
        ]  # fmt: skip
        path = tmp_path / match / "Labels-v3.json"
        game = json.loads(path.read_text())["GameMetadata"]
        assert game["list_actions"] == ["7.png", "8.png"]
        assert game["list_replays"] == ["7_1.png", "8_1.png"]

    def test_groups_of_other_datasets_are_refused(
        self, issia_group: Callable[..., Group], tmp_path: Path
    ) -> None:
        with pytest.raises(InputError, match="is not from SoccerNet"):
            write_soccernet_v3(tmp_path, [issia_group()])

    def test_a_key_that_leaves_the_folder_is_refused(
        self, soccer_group: Callable[..., Group], tmp_path: Path
    ) -> None:
        with pytest.raises(UnsafePathError):
            write_soccernet_v3(tmp_path, [soccer_group(match="../../x")])


class TestSplitKey:
    def test_league_season_and_match(self, soccer_group: Callable[..., Group], match: str) -> None:
        assert "/".join(parse_league_season_match(soccer_group())) == match
