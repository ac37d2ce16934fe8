from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.errors import DatasetFormatError
from app.formats.report import ReaderReport
from app.formats.soccernet_v3_writer import labels_to_json
from app.formats.view_state import (
    GroupAssembler,
    GroupHead,
    RecordFieldReader,
    ViewWithGroupHead,
    extras_from_json,
    group_head_to_json,
    view_to_json,
)
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View, ViewExclusion
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch

Make = Callable[..., Group]
COVARIANCE = tuple(np.outer(*2 * [np.arange(1, 9) / 7]).ravel().tolist())


def read(value: Any) -> RecordFieldReader:
    return RecordFieldReader(value, "file", "record")


class TestStateReader:
    def test_reads_everything_that_is_written(self, soccer_group: Make, camera: Camera) -> None:
        group = soccer_group(pitch=Pitch(100.0, 64.5), label="a")
        balls = (
            BallAnnotation(point=ImagePoint(0.1, 0.2), occluded=True),
            BallAnnotation(box=Box(1.0, 2.0, 3.0, 4.0)),
            BallAnnotation(out_of_view=True),
        )
        station = replace(
            group.views[0].station,
            given=camera,
            given_covariance=COVARIANCE,
            calibration="lines",
            flipped=True,
            shared=True,
            picture=PictureGeometry(1.25, (0.5, -0.25), (0.125, 0.0, 0.5)),
            proposed=(min(group.views[0].station.lines),),
            not_visible=("Circle left", "Goal left crossbar"),
        )
        why = ViewExclusion("duplicate_view", "as camera 2")
        view = replace(group.views[0], balls=balls, included=False, station=station, left_out=why)
        assert read(view_to_json(view)).read_view(view.size, Extras()) == view
        head = read(group_head_to_json(group)).read_group_head()
        assert head.make_group(group.views) == group
        assert head.views == 2

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("view", "../x"),
            ("view", None),
            ("station", "/etc"),
            ("calibration", "guess"),
            ("lines", {"Midfield": []}),
            ("lines", {"Middle line": [[1]]}),
            ("lines", [1]),
            ("balls", [{"box": [1, 2, 0, 4], "point": None}]),
            ("balls", [{"box": None, "point": None}]),
            ("balls", [{"box": [1, 2, 3, 4], "point": [1, 2]}]),
            ("balls", {"box": 1}),
            ("given", {"pan_degrees": 1}),
            ("given_covariance", [1.0] * 63),
            ("given_covariance", [0.0] * 64),
            ("given_covariance", [1.0] * 64),
            ("proposed", "Middle line"),
            ("proposed", [["Middle line"]]),
            ("picture", [1.0]),
            ("picture", {"aspect": 1.0, "shift": [0.0], "sigma": [0.0, 0.0, 0.0]}),
            ("picture", {"aspect": 9.0, "shift": [0.0, 0.0], "sigma": [0.0, 0.0, 0.0]}),
        ],
    )
    def test_what_is_wrong_is_named(self, soccer_group: Make, name: str, value: Any) -> None:
        state = {**view_to_json(soccer_group().views[0]), name: value}
        with pytest.raises(DatasetFormatError) as caught:
            read(state).read_view(soccer_group().views[0].size, Extras())
        assert (caught.value.path, caught.value.record) == ("file", "record")
        assert caught.value.field == (name if name != "given" else "tilt_degrees")

    @pytest.mark.parametrize("pitch", [[1, 2], "x", [105]])
    def test_an_impossible_pitch_is_refused(self, soccer_group: Make, pitch: Any) -> None:
        with pytest.raises(DatasetFormatError, match="pitch"):
            read({**group_head_to_json(soccer_group()), "pitch": pitch}).read_group_head()


class TestExtras:
    def test_come_back_as_they_were(self) -> None:
        extras = Extras(({"class": None},), ({"points": [1]},), {"a": {"b": 1}})
        assert extras_from_json(extras.to_plain_values()) == extras
        assert Extras().to_plain_values() is None
        assert extras_from_json(None) == Extras()

    def test_values_that_are_no_extras_are_left_out(self) -> None:
        assert extras_from_json({"boxes": 5, "lines": "text"}) == Extras()
        assert extras_from_json({"boxes": [1, {"a": 1}], "metadata": []}) == Extras(({"a": 1},))

    @pytest.mark.parametrize("name", ["imageMetadata", "record", "balls", "GameMetadata", "labels"])
    @pytest.mark.parametrize("odd", [None, 3, "text", [1], {"a": 1}])
    def test_what_a_file_says_under_our_names_in_another_shape_ends_no_export(
        self, soccer_group: Make, name: str, odd: Any
    ) -> None:
        group = soccer_group()
        extras = extras_from_json({"metadata": {name: odd, "kept": odd}})
        assert extras.metadata["kept"] == odd
        views = tuple(replace(view, extras=extras) for view in group.views)
        written = labels_to_json("m", [replace(group, views=views)])
        assert list(written["actions"]) == [group.views[0].key]


def placed(key: str, group: str = "g", position: int = 0, views: int = 2) -> ViewWithGroupHead:
    head = GroupHead(group, "", "", "", Pitch(), views)
    station = Station("cam1", ImageSize(8, 8), shared=True)
    return ViewWithGroupHead(head, position, View(key, station))


class TestViewGroups:
    def test_a_group_comes_when_its_last_view_does_in_the_order_of_positions(
        self, report: ReaderReport
    ) -> None:
        groups = GroupAssembler(report)
        assert list(groups.add(placed("b", position=1), "a.json")) == []
        assert list(groups.add(placed("x", "other"), "a.json")) == []
        (group,) = groups.add(placed("a"), "a.json")
        assert [view.key for view in group.views] == ["a", "b"]
        (rest,) = groups.release_incomplete_groups()
        assert (rest.key, report.imported) == ("other", 3)
        assert list(groups.release_incomplete_groups()) == []
        assert report.remarks == [
            "1 group has fewer views than when it was written: other (1 of 2)"
        ]

    def test_static_cameras_of_one_key_are_one_station(self, report: ReaderReport) -> None:
        groups = GroupAssembler(report)
        first, second = (
            group for name in "ab" for group in groups.add(placed("v", name, views=1), "a.json")
        )
        assert first.views[0].station is second.views[0].station

    def test_a_view_that_comes_twice_counts_once(self, report: ReaderReport) -> None:
        groups = GroupAssembler(report)
        assert list(groups.add(placed("a"), "a.json")) == []
        assert list(groups.add(placed("a"), "a.json")) == []
        (problem,) = report.problems
        assert (problem.path, "comes twice" in problem.problem) == ("a.json", True)

    def test_a_group_that_comes_again_in_another_file_is_not_handed_on_twice(
        self, report: ReaderReport
    ) -> None:
        groups = GroupAssembler(report)
        found = [
            group
            for path in ("a.json", "b.json")
            for key in ("a", "b")
            for group in groups.add(placed(key), path)
        ]
        assert (len(found), report.imported, list(groups.release_incomplete_groups())) == (1, 2, [])
        assert [(problem.path, problem.field) for problem in report.problems] == [
            ("b.json", "a"),
            ("b.json", "b"),
        ]
