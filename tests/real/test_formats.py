"""The importers on real files; skipped where there are none."""

from __future__ import annotations

import os
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from app.formats.camera_json import camera_from_json, camera_to_json
from app.formats.cameras import read_cameras
from app.formats.export_record import ExportRecord
from app.formats.issia_3d import write_issia_3d
from app.formats.issia_reader import IssiaFolder, IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.formats.sn_calibration import DEFAULT_SIZE
from app.formats.sn_calibration_reader import read_line_files, read_sn_calibration
from app.formats.sn_calibration_writer import write_line_files, write_sn_calibration
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS

REAL_DATA = Path(
    os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[2].parent / "shared" / "data")
)

pytestmark = pytest.mark.skipif(
    not REAL_DATA.is_dir(), reason=f"no real data at {REAL_DATA} (set TOUCHLINE_REAL_DATA)"
)
LINES = REAL_DATA / "sn22-dev" / "lines.zip"
CAMERAS = REAL_DATA / "sn22-dev" / "pnlcalib-predicted-cameras.zip"
ISSIA = REAL_DATA / "issia"


@pytest.fixture
def report() -> ReaderReport:
    return ReaderReport()


@pytest.fixture(scope="module")
def issia() -> tuple[IssiaFolder, ReaderReport]:
    report = ReaderReport()
    return open_issia(ISSIA, IssiaOptions(lines=REAL_DATA / "issia-lines"), report), report


class TestLineFiles:
    def test_every_frame_is_read_without_a_problem(self, report: ReaderReport) -> None:
        groups = list(read_sn_calibration(LINES, DEFAULT_SIZE, report))
        assert len(groups) == len({group.key for group in groups}) == 727
        assert report.problems == []
        seen = {marking for group in groups for marking in group.views[0].station.lines}
        assert seen == set(MARKINGS)

    def test_points_outside_the_image_are_kept(self, report: ReaderReport) -> None:
        points = [
            point
            for file in read_line_files(LINES, DEFAULT_SIZE, report)
            for line in file.lines.values()
            for point in line
        ]
        outside = [p for p in points if not (0 <= p.x <= 959 and 0 <= p.y <= 539)]
        assert len(outside) > 0
        assert len(points) > 15_000

    def test_import_export_import_gives_the_same_lines(
        self, report: ReaderReport, tmp_path: Path
    ) -> None:
        first = list(read_line_files(LINES, DEFAULT_SIZE, report))
        write_line_files(tmp_path, first)
        again = list(read_line_files(tmp_path, DEFAULT_SIZE, report))
        assert [(file.stem, file.lines) for file in again] == [
            (file.stem, file.lines) for file in first
        ]

    def test_an_export_gives_every_frame_back_with_its_name_split_and_size(
        self, report: ReaderReport, tmp_path: Path
    ) -> None:
        first = list(read_sn_calibration(LINES, DEFAULT_SIZE, report))
        write_sn_calibration(tmp_path, (ExportRecord(group, None, "accepted") for group in first))
        # One folder a split and size, and every file in it a frame.
        folders = list((tmp_path / "lines").iterdir())
        assert sum(len(list(folder.glob("*.json"))) for folder in folders) == 727
        assert {folder.name.rsplit("-", 1)[1] for folder in folders} == {"960x540"}
        assert list(read_sn_calibration(tmp_path, ImageSize(2, 2), report)) == first


class TestCameras:
    def test_every_camera_is_read_without_a_problem(self, report: ReaderReport) -> None:
        cameras = read_cameras(CAMERAS, report)
        assert len(cameras) == 712
        assert report.problems == []
        assert any(camera.position[2] >= 0 for camera in cameras.values())

    def test_they_come_back_exactly(self, report: ReaderReport) -> None:
        for camera in read_cameras(CAMERAS, report).values():
            assert camera_from_json(camera_to_json(camera), "f") == camera


class TestIssia:
    def test_the_known_counts(self, issia: tuple[IssiaFolder, ReaderReport]) -> None:
        folder, report = issia
        groups = list(folder.groups())
        assert len(groups) == 2465
        assert sum(len(group.views) > 1 for group in groups) == 1801
        points = {camera: track.ball_point_count for camera, track in folder.tracks.items()}
        assert points == {1: 509, 2: 517, 3: 1377, 4: 1292, 5: 327, 6: 253}
        assert report.counts["persons"] == 131_392

    def test_the_known_pairs_of_cameras(self, issia: tuple[IssiaFolder, ReaderReport]) -> None:
        cameras = ["".join(view.key[-1] for view in group.views) for group in issia[0].groups()]
        pairs = Counter(views for views in cameras if len(views) == 2)
        assert pairs == {"34": 1037, "12": 378, "56": 232, "35": 78, "13": 62, "24": 5}
        assert sum(len(views) == 3 for views in cameras) == 9

    def test_the_one_blank_box_is_named(self, issia: tuple[IssiaFolder, ReaderReport]) -> None:
        (problem,) = issia[1].problems
        assert problem.record == "Person 155"
        assert problem.problem == "y is blank"

    def test_nobody_is_lost(self, issia: tuple[IssiaFolder, ReaderReport]) -> None:
        folder, _ = issia
        in_views = sum(len(view.extras.boxes) for group in folder.groups() for view in group.views)
        assert in_views + sum(len(item.boxes) for item in folder.persons_without_ball()) == 131_392

    def test_six_stations_with_camera_and_lines(
        self, issia: tuple[IssiaFolder, ReaderReport]
    ) -> None:
        stations = issia[0].stations
        assert sorted(stations) == [1, 2, 3, 4, 5, 6]
        assert all(station.given and station.lines for station in stations.values())
        assert np.hypot(*stations[3].lines["Middle line"][0]) > 100

    def test_the_folder_takes_seconds(self, report: ReaderReport) -> None:
        start = time.process_time()
        assert sum(1 for _ in open_issia(ISSIA, IssiaOptions(), report).groups()) == 2465
        assert time.process_time() - start < 20

    def test_a_row_for_every_frame_with_a_ball(
        self, issia: tuple[IssiaFolder, ReaderReport], tmp_path: Path
    ) -> None:
        records = (ExportRecord(group, None, "unreviewed") for group in issia[0].groups())
        assert write_issia_3d(tmp_path, records, everything=True)["groups"] == 2465
