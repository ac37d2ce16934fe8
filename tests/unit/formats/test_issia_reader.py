from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from app.formats.camera_json import camera_to_json
from app.formats.issia_reader import IssiaOptions, open_issia, parse_camera_number
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group, Media


def _xgtf(balls: dict[int, tuple[int, int]], persons: dict[int, int]) -> str:
    """Ball centres and number of persons, by XGTF frame."""
    points = "".join(
        f'<data:point framespan="{f}:{f}" x="{x}" y="{y}"/>' for f, (x, y) in balls.items()
    )
    boxes = "".join(
        f'<object name="Person" id="{f}{n}"><attribute name="LOCATION"><data:bbox'
        f' framespan="{f}:{f}" x="{n}" y="2" width="30" height="40"/></attribute></object>'
        for f, count in persons.items()
        for n in range(count)
    )
    return (
        '<viper xmlns="http://lamp.cfar.umd.edu/viper#"'
        ' xmlns:data="http://lamp.cfar.umd.edu/viperdata#"><data><sourcefile>'
        f'<object name="BALL" id="0"><attribute name="BallPos">{points}</attribute></object>'
        f"{boxes}</sourcefile></data></viper>"
    )


@pytest.fixture
def folder(tmp_path: Path, camera: Camera) -> Path:
    """Two cameras: both see the ball in frame 10, camera 3 alone in 11; people elsewhere."""
    root = tmp_path / "issia"
    (root / "truth").mkdir(parents=True)
    three = _xgtf({18: (100, 50), 19: (110, 51)}, {18: 2, 20: 3})
    four = _xgtf({18: (900, 60)}, {19: 1})
    (root / "truth" / "ground_truth_3.xgtf").write_text(three)
    (root / "truth" / "Film Role-0 ID-4 T-0 m00s00.xgtf").write_text(four)
    value = {"cameras": {"cam3": camera_to_json(camera)}, "_note": "ours"}
    (root / "issia_calibration.json").write_text(json.dumps(value))
    return root


@pytest.fixture
def lines(tmp_path: Path) -> Path:
    root = tmp_path / "lines"
    root.mkdir()
    points = [{"x": 945.5, "y": 100.75}, {"x": 945.5, "y": 1026}]
    (root / "cam3.json").write_text(json.dumps({"Middle line": points}))
    return root


def _groups(folder: Path, report: ReaderReport, options: IssiaOptions | None = None) -> list[Group]:
    return list(open_issia(folder, options or IssiaOptions(), report).groups())


class TestGroups:
    def test_frames_with_a_ball_are_groups_by_video_frame(
        self, folder: Path, report: ReaderReport
    ) -> None:
        first, second = _groups(folder, report)
        assert (first.key, second.key) == ("10", "11")
        assert [view.key for view in first.views] == ["cam3", "cam4"]
        assert [view.key for view in second.views] == ["cam3"]
        assert first.views[1].balls[0].point == ImagePoint(900.0, 60.0)
        assert (first.match, first.split, first.label) == ("issia", "train", "Frame 10")
        assert report.problems == []
        assert (report.read, report.imported) == (2, 2)

    def test_views_of_a_camera_share_one_station(self, folder: Path, report: ReaderReport) -> None:
        first, second = _groups(folder, report)
        station = first.views[0].station
        assert station is second.views[0].station
        assert (station.key, station.shared, station.size) == ("cam3", True, ImageSize(1920, 1080))

    def test_the_calibration_of_the_folder_is_given(
        self, folder: Path, report: ReaderReport, camera: Camera
    ) -> None:
        first, _ = _groups(folder, report)
        assert first.views[0].station.given == camera
        assert first.views[1].station.given is None
        assert first.views[0].station.calibration == "given"

    def test_lines_of_static_cameras_are_pixels_and_may_count_instead(
        self, folder: Path, report: ReaderReport, lines: Path
    ) -> None:
        options = IssiaOptions(lines=lines, calibration="lines")
        station = _groups(folder, report, options)[0].views[0].station
        assert station.lines["Middle line"][0] == (945.5, 100.75)
        assert station.calibration == "lines"
        assert station.given is not None

    def test_people_travel_with_a_view_that_has_a_ball(
        self, folder: Path, report: ReaderReport
    ) -> None:
        first, second = _groups(folder, report)
        assert first.views[0].extras.boxes[1] == {
            "class": "Person",
            "ID": "181",
            "points": {"x1": 1.0, "y1": 2.0, "x2": 31.0, "y2": 42.0},
        }
        assert second.views[0].extras.boxes == ()
        assert report.counts == {"ball points": 3, "persons": 6, "frames with persons only": 1}

    def test_the_offset_may_differ_by_camera(self, folder: Path, report: ReaderReport) -> None:
        options = IssiaOptions(frame_offset={4: 7})
        groups = _groups(folder, report, options)
        assert [(g.key, [v.key for v in g.views]) for g in groups] == [
            ("10", ["cam3"]),
            ("11", ["cam3", "cam4"]),
        ]

    def test_a_flip_is_a_setting_of_the_station(self, folder: Path, report: ReaderReport) -> None:
        first, _ = _groups(folder, report, IssiaOptions(flipped=frozenset({4})))
        assert [view.station.flipped for view in first.views] == [False, True]

    def test_videos_and_frames_beside_are_found(self, folder: Path, report: ReaderReport) -> None:
        (folder / "cam3.mp4").write_bytes(b"")
        (folder / "cam1_cam2_stacked.mp4").write_bytes(b"")
        (folder / "cam4").mkdir()
        (folder / "cam4" / "000010.jpg").write_bytes(b"")
        first, second = _groups(folder, report)
        assert first.views[0].media == Media(str(folder / "cam3.mp4"), frame=10)
        assert first.views[1].media == Media(str(folder / "cam4" / "000010.jpg"))
        assert second.views[0].media == Media(str(folder / "cam3.mp4"), frame=11)

    def test_a_zip_of_the_folder_will_do(
        self, folder: Path, report: ReaderReport, make_zip: Callable[..., Path]
    ) -> None:
        members = {
            str(path.relative_to(folder)): path.read_bytes()
            for path in folder.rglob("*")
            if path.is_file()
        }
        assert _groups(make_zip(members), report) == _groups(folder, ReaderReport())

    def test_reading_again_gives_the_same_groups(self, folder: Path) -> None:
        assert _groups(folder, ReaderReport()) == _groups(folder, ReaderReport())

    def test_a_bad_camera_is_reported_and_all_groups_stay(
        self, folder: Path, report: ReaderReport
    ) -> None:
        text = (folder / "issia_calibration.json").read_text()
        (folder / "issia_calibration.json").write_text(text.replace("2100.5", "-2100.5"))
        first, _ = _groups(folder, report)
        assert first.views[0].station.given is None
        assert (report.problems[0].record, report.problems[0].field) == ("cam3", "x_focal_length")

    def test_a_file_without_a_number_and_a_second_file_are_reported(
        self, folder: Path, report: ReaderReport
    ) -> None:
        (folder / "truth" / "truth.xgtf").write_text("<viper/>")
        (folder / "truth" / "cam3.xgtf").write_text("<viper/>")
        (folder / "truth" / "b").mkdir()
        groups = _groups(folder, report)
        assert len(groups) >= 1
        assert {problem.problem for problem in report.problems} == {
            "has no camera number in its name", "is left out: another file of camera 3 was read already",
        }  # fmt: skip

    def test_a_folder_without_xgtf_is_reported(self, tmp_path: Path, report: ReaderReport) -> None:
        assert _groups(tmp_path, report) == []
        assert "contains no XGTF file" in str(report.problems[0])

    def test_a_frame_of_cameras_of_both_splits_has_none(
        self, folder: Path, report: ReaderReport
    ) -> None:
        (folder / "cam1.xgtf").write_text(_xgtf({18: (5, 5), 30: (6, 6)}, {}))
        groups = _groups(folder, report)
        assert [(group.key, group.split) for group in groups] == [
            ("10", ""), ("11", "train"), ("22", "test"),
        ]  # fmt: skip


class TestPersons:
    def test_people_that_no_view_holds(self, folder: Path, report: ReaderReport) -> None:
        persons = list(open_issia(folder, IssiaOptions(), report).persons_without_ball())
        assert [(item.frame, item.camera, len(item.boxes)) for item in persons] == [
            (12, "cam3", 3), (11, "cam4", 1),
        ]  # fmt: skip

    def test_nobody_is_lost_between_views_and_persons(
        self, folder: Path, report: ReaderReport
    ) -> None:
        found = open_issia(folder, IssiaOptions(), report)
        in_views = sum(len(view.extras.boxes) for group in found.groups() for view in group.views)
        others = sum(len(item.boxes) for item in found.persons_without_ball())
        assert in_views + others == report.counts["persons"]


class TestCameraNumber:
    @pytest.mark.parametrize(
        ("name", "number"),
        [
            ("ground_truth_6", 6),
            ("cam3", 3),
            ("Camera 2", 2),
            ("Film Role-0 ID-5 T-0 m00s00-026-m00s01-020", 5),
            ("seq1_cam4", 4),
            ("truth", None),
        ],
    )
    def test_the_number_that_a_name_speaks_of(self, name: str, number: int | None) -> None:
        assert parse_camera_number(name) == number


def _sized(text: str, width: int, height: int) -> str:
    return text.replace(
        "<sourcefile>",
        '<sourcefile><file id="0"><attribute name="H-FRAME-SIZE">'
        f'<data:dvalue value="{width}"/></attribute><attribute name="V-FRAME-SIZE">'
        f'<data:dvalue value="{height}"/></attribute></file>',
    )


class TestSizeOfTheFile:
    @pytest.fixture
    def sized(self, folder: Path) -> Path:
        path = folder / "truth" / "ground_truth_3.xgtf"
        path.write_text(_sized(path.read_text(), 1280, 720))
        return folder

    def test_counts_for_its_camera_where_no_size_is_asked_for(
        self, sized: Path, report: ReaderReport
    ) -> None:
        first = _groups(sized, report)[0]
        assert [view.size for view in first.views] == [ImageSize(1280, 720), ImageSize(1920, 1080)]
        assert report.problems == [] and report.remarks == []

    def test_a_size_that_is_asked_for_counts_and_the_difference_is_told(
        self, sized: Path, report: ReaderReport
    ) -> None:
        first = _groups(sized, report, IssiaOptions(size=ImageSize(960, 540)))[0]
        assert {view.size for view in first.views} == {ImageSize(960, 540)}
        (remark,) = report.remarks
        assert remark.endswith(
            "ground_truth_3.xgtf: the file says 1280 x 720 for camera 3, and 960 x 540 was asked "
            "for (--size), which is used."
        )

    def test_lines_are_read_for_the_size_of_their_camera(
        self, sized: Path, report: ReaderReport, tmp_path: Path
    ) -> None:
        lines = tmp_path / "unit"
        lines.mkdir()
        for camera in (3, 4):
            points = [{"x": 0.0, "y": 0.0}, {"x": 1.0, "y": 1.0}]
            (lines / f"cam{camera}.json").write_text(json.dumps({"Middle line": points}))
        views = _groups(sized, report, IssiaOptions(lines=lines))[0].views
        ends = [view.station.lines["Middle line"][1] for view in views]
        assert ends == [(1279.0, 719.0), (1919.0, 1079.0)]


class TestFileWithoutABall:
    def test_is_told(self, folder: Path, report: ReaderReport) -> None:
        (folder / "truth" / "cam5.xgtf").write_text(_xgtf({}, {18: 1}))
        _groups(folder, report)
        (remark,) = report.remarks
        assert remark.endswith("cam5.xgtf contains no ball for camera 5.")


class TestFilesOfOtherNames:
    def test_xml_that_is_xgtf_is_read_and_other_xml_is_reported(
        self, folder: Path, report: ReaderReport
    ) -> None:
        path = folder / "truth" / "ground_truth_3.xgtf"
        path.rename(path.with_suffix(".xml"))
        (folder / "annotations.xml").write_text("<annotations/>")
        assert [view.key for view in _groups(folder, report)[0].views] == ["cam3", "cam4"]
        (problem,) = report.problems
        assert problem.problem == "is XML of another kind than XGTF; left out"


class TestSeveralSources:
    def _write(self, folder: Path, name: str, *sources: str) -> None:
        first = _xgtf({18: (1, 2)}, {})
        more = "".join(
            f'<sourcefile filename="{source}">'
            + _xgtf({18: (3, 4)}, {18: 2}).partition("<sourcefile>")[2].partition("</data>")[0]
            for source in sources[1:]
        )
        text = first.replace("<sourcefile>", f'<sourcefile filename="{sources[0]}">')
        (folder / "truth" / name).write_text(text.replace("</data>", f"{more}</data>"))

    def test_sources_that_name_their_cameras_are_those_cameras(
        self, folder: Path, report: ReaderReport
    ) -> None:
        self._write(folder, "both.xgtf", "cam1.avi", "C:\\videos\\camera_2.avi")
        keys = [view.key for view in _groups(folder, report)[0].views]
        assert keys == ["cam1", "cam2", "cam3", "cam4"]
        assert report.problems == []

    @pytest.mark.parametrize("second", ["part2.avi", "cam1.avi", ""])
    def test_others_are_left_out_and_named(
        self, folder: Path, report: ReaderReport, second: str
    ) -> None:
        self._write(folder, "cam1.xgtf", "cam1.avi", second)
        (view, *_) = _groups(folder, report)[0].views
        assert (view.key, view.balls[0].point) == ("cam1", ImagePoint(1.0, 2.0))
        (problem,) = report.problems
        assert problem.record == f"source 2 ({second})"
        assert problem.problem.startswith("is left out with 1 ball and 2 persons")
