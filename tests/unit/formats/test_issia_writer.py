from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from app.errors import InputError
from app.formats.issia import FramePersons
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.issia_writer import write_issia
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import ImagePoint, ImageSize
from app.soccer.group import Group

Make = Callable[..., Group]


def person(identity: str, x: float) -> dict[str, object]:
    points = {"x1": x, "y1": 20.0, "x2": x + 30.5, "y2": 90.0}
    return {"class": "Person", "ID": identity, "points": points}


def with_extras(group: Group, extras: Extras) -> Group:
    return replace(group, views=tuple(replace(view, extras=extras) for view in group.views))


class TestWriteIssia:
    def test_comes_back_as_it_was(
        self, tmp_path: Path, issia_group: Make, camera: Camera, report: ReaderReport
    ) -> None:
        extras = Extras((person("2", 5.0), person("10", 1.0)), (), {"ball": {"SHOT": "a < b"}})
        group = with_extras(issia_group(358), extras)
        station = replace(
            group.views[0].station, given=camera, lines=make_lines({"Middle line": [(0.1, 963.6)]})
        )
        views = (replace(group.views[0], station=station), group.views[1])
        groups = [issia_group(-2, cameras=(6,)), replace(group, views=views)]
        unassigned = [FramePersons(7, "cam2", (person("3", -4.0),))]
        counts = write_issia(tmp_path, reversed(groups), unassigned)
        assert counts == {"groups": 2, "annotated_balls": 3, "persons": 5, "cameras": 4}
        folder = open_issia(tmp_path, IssiaOptions(), report)
        again = {found.key: found for found in folder.groups()}
        for written in groups:
            assert again[written.key].views == written.views
        assert list(folder.persons_without_ball()) == unassigned
        assert report.problems == []

    def test_the_size_of_the_images_comes_back(
        self, tmp_path: Path, issia_group: Make, report: ReaderReport
    ) -> None:
        group = issia_group(358)
        small = tuple(
            replace(view, station=replace(view.station, size=ImageSize(1280, 720)))
            for view in group.views
        )
        write_issia(tmp_path, [replace(group, views=small)])
        (again,) = open_issia(tmp_path, IssiaOptions(), report).groups()
        assert {view.size for view in again.views} == {ImageSize(1280, 720)}
        assert report.problems == []

    def test_whole_pixels_are_whole_numbers_and_frames_are_shifted(
        self, tmp_path: Path, issia_group: Make
    ) -> None:
        write_issia(tmp_path, [issia_group(358, cameras=(3,))])
        text = (tmp_path / "ground_truth_3.xgtf").read_text()
        assert '<data:point framespan="366:366" x="300" y="50.5"/>' in text

    def test_several_balls_of_a_frame_all_stay(
        self, tmp_path: Path, issia_group: Make, report: ReaderReport
    ) -> None:
        group = issia_group(1, cameras=(1,))
        balls = tuple(BallAnnotation(point=ImagePoint(x, 2.0)) for x in (9.0, 3.0))
        group = replace(group, views=(replace(group.views[0], balls=balls),))
        write_issia(tmp_path, [group])
        (again,) = open_issia(tmp_path, IssiaOptions(), report).groups()
        assert again.views[0].balls == balls

    def test_text_cannot_leave_its_attribute(
        self, tmp_path: Path, issia_group: Make, report: ReaderReport
    ) -> None:
        evil = '"/><object name="BALL">\n\x00&lt;'
        extras = Extras((person(evil, 1.0),), (), {"ball": {"SHOT": evil}})
        write_issia(tmp_path, [with_extras(issia_group(1, cameras=(1,)), extras)])
        folder = open_issia(tmp_path, IssiaOptions(), report)
        assert report.problems == []
        (group,) = folder.groups()
        assert len(group.views) == 1
        assert group.views[0].extras.boxes[0]["ID"].startswith('"/><object')

    def test_other_datasets_are_refused(self, tmp_path: Path, soccer_group: Make) -> None:
        with pytest.raises(InputError, match="cannot be from ISSIA"):
            write_issia(tmp_path, [soccer_group()])
