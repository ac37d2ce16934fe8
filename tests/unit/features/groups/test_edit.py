from __future__ import annotations

import math
from dataclasses import replace

import pytest

from app.errors import InputError, NotFoundError, UnknownMarkingError
from app.features.groups.edit import (
    SetBalls,
    SetCalibrationSource,
    SetLines,
    SetPictureGeometry,
    SetStationCalibrationSource,
    SetStationCamera,
    SetStationLines,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.features.groups.edit_codec import edit_from_json, edit_to_json, station_edit_from_json
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint
from app.soccer.picture import PictureGeometry
from tests.cameras import EVERY_COEFFICIENT

HERE = (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))
BALL = BallAnnotation(box=Box(500.0, 300.25, 14.0, 15.0), occluded=True)
EDITS = [
    SetLines("7.png", {"Middle line": HERE, "Side line top": None, "Side line left": HERE}),
    SetLines("7.png", {" Middle line ": ()}),
    SetLines("7.png", {"Circle left": None, "Side line top": HERE}, (), ("Circle left",)),
    make_set_ball_edit("7.png", BALL),
    make_set_ball_edit("7.png", None),
    SetBalls("7.png", (BALL, BallAnnotation(point=ImagePoint(1.0, 2.0)))),
    SetViewInclusion("7_1.png", False),
    SetViewInclusion("7_1.png", False, "not_same_instant"),
    SetViewInclusion("7_1.png", False, "other", "another match"),
    SetCalibrationSource("7.png", "lines"),
    SetPictureGeometry("7.png", PictureGeometry(1.25, (0.5, -0.25), (0.125, 0.0, 0.5))),
    SetPictureGeometry("7.png", None),
]
STATION_EDITS = [
    SetStationLines({"Middle line": HERE, "Circle central": None}),
    SetStationLines({"Circle central": None}, not_visible=("Circle central",)),
    SetStationCalibrationSource("lines"),
    SetStationCamera(EVERY_COEFFICIENT, (0.25,) * 64),
    SetStationCamera(EVERY_COEFFICIENT, None, "lines"),
    SetStationCamera(None),
]


class TestNotVisible:
    MARKED = SetLines("7.png", {"Circle left": None}, not_visible=(" Circle left",))

    def test_a_marking_is_said_not_to_be_visible_until_somebody_draws_it(self, make_group) -> None:
        group = make_group()
        marked = self.MARKED.apply(group)
        assert marked.views[0].station.not_visible == ("Circle left",)
        assert "Circle left" not in marked.views[0].station.lines
        for edit in (
            SetLines("7.png", {"Circle left": HERE}),
            SetLines("7.png", {"Circle left": None}),
        ):
            assert edit.apply(marked).views[0].station.not_visible == ()
        other = SetLines("7.png", {"Middle line": None}).apply(marked)
        assert other.views[0].station.not_visible == ("Circle left",)

    def test_a_marking_with_points_is_visible(self, make_group) -> None:
        edit = SetLines("7.png", {"Circle left": HERE}, not_visible=("Circle left",))
        assert edit.apply(make_group()).views[0].station.not_visible == ()

    def test_its_inverse_is_what_was_there_before(self, make_group) -> None:
        drawn = SetLines("7.png", {"Circle left": HERE}).apply(make_group())
        for before in (drawn, self.MARKED.apply(make_group())):
            for edit in (self.MARKED, SetLines("7.png", {"Circle left": HERE})):
                assert edit.inverse(before).apply(edit.apply(before)) == before


class TestSetPicture:
    def test_its_inverse_is_the_picture_before(self, make_group) -> None:
        group = SetPictureGeometry("7.png", PictureGeometry(1.25)).apply(make_group())
        edit = SetPictureGeometry("7.png", PictureGeometry(0.75))
        assert edit.inverse(group).apply(edit.apply(group)) == group


class TestApply:
    def test_lines_are_set_deleted_and_kept(self, make_group) -> None:
        group = make_group()
        before = group.views[0].station.lines
        after = EDITS[0].apply(group).views[0].station.lines
        assert after["Middle line"] == HERE
        assert "Side line top" not in after
        assert after["Circle central"] == before["Circle central"]
        assert list(after) == sorted(after)

    def test_a_trailing_space_does_not_matter(self, make_group) -> None:
        after = SetLines("7.png", {"Goal left post left ": HERE}).apply(make_group())
        assert "Goal left post left" in after.views[0].station.lines

    def test_lines_of_a_shared_station_change_in_every_view_of_it(self, make_static) -> None:
        after = SetLines("cam1", {"Middle line": HERE}).apply(make_static())
        assert after.view("cam1").station.lines["Middle line"] == HERE
        assert after.view("cam2").station == make_static().view("cam2").station

    def test_so_do_two_views_of_one_group_that_share_it(self, make_static) -> None:
        group = make_static()
        twin = replace(group.view("cam1"), key="cam1-later")
        both = replace(group, views=(*group.views, twin))
        after = SetLines("cam1", {"Middle line": HERE}).apply(both)
        assert after.view("cam1-later").station == after.view("cam1").station
        assert after.view("cam1").station.lines["Middle line"] == HERE

    def test_a_ball_takes_the_place_of_all_others(self, make_group) -> None:
        two = SetBalls("7.png", (BALL, BALL)).apply(make_group())
        assert make_set_ball_edit("7.png", BALL).apply(two).view("7.png").balls == (BALL,)

    @pytest.mark.parametrize("edit", EDITS)
    def test_the_group_that_it_is_applied_to_stays(self, edit, make_group) -> None:
        group = make_group()
        edit.apply(group)
        assert group == make_group()

    @pytest.mark.parametrize(
        ("edit", "error", "sentence"),
        [
            (SetLines("7.png", {"Midle line": HERE}), UnknownMarkingError, "Midle line"),
            (SetLines("9.png", {}), NotFoundError, "no view 9.png"),
            (
                SetLines("7.png", {"Middle line": (ImagePoint(math.nan, 1),)}),
                InputError,
                "valid pixel",
            ),
            (SetLines("7.png", {"Middle line": HERE * 501}), InputError, "1000 points"),
            (make_set_ball_edit("7.png", BallAnnotation()), InputError, "box or a point"),
            (
                make_set_ball_edit("7.png", BallAnnotation(box=Box(1, 2, 0, 3))),
                InputError,
                "above zero",
            ),
            (
                make_set_ball_edit("7.png", BallAnnotation(box=Box(1e9, 2, 3, 3))),
                InputError,
                "valid pixel",
            ),
            (
                make_set_ball_edit("7.png", BallAnnotation(box=Box(1, math.inf, 3, 3))),
                InputError,
                "valid pixel",
            ),
            (
                make_set_ball_edit("7.png", BallAnnotation(box=Box(1, 2, 1e9, 3))),
                InputError,
                "valid pixel",
            ),
            (
                make_set_ball_edit("7.png", BallAnnotation(point=ImagePoint(1e9, 0))),
                InputError,
                "valid pixel",
            ),
            (
                make_set_ball_edit(
                    "7.png", BallAnnotation(box=Box(1, 2, 3, 4), point=ImagePoint(1, 2))
                ),
                InputError,
                "not both",
            ),
            (SetCalibrationSource("7.png", "guess"), InputError, "given"),
        ],
    )
    def test_an_impossible_edit_is_refused_in_one_sentence(
        self, edit, error, sentence, make_group
    ) -> None:
        with pytest.raises(error, match=sentence):
            edit.apply(make_group())

    def test_a_ball_out_of_view_needs_no_box(self, make_group) -> None:
        ball = BallAnnotation(out_of_view=True)
        assert make_set_ball_edit("7.png", ball).apply(make_group()).view("7.png").ball is None


class TestInverse:
    @pytest.mark.parametrize("edit", EDITS)
    def test_leads_back(self, edit, make_group) -> None:
        group = make_group()
        assert edit.inverse(group).apply(edit.apply(group)) == group

    @pytest.mark.parametrize("edit", STATION_EDITS)
    def test_leads_back_on_a_station(self, edit, make_static) -> None:
        station = make_static().views[0].station
        assert edit.inverse(station).apply(edit.apply(station)) == station


class TestCodec:
    @pytest.mark.parametrize("edit", EDITS)
    def test_an_edit_from_the_log_does_the_same(self, edit, make_group) -> None:
        again = edit_from_json(edit_to_json(edit))
        assert again.apply(make_group()) == edit.apply(make_group())

    @pytest.mark.parametrize("edit", STATION_EDITS)
    def test_a_station_edit_from_the_log_does_the_same(self, edit, make_static) -> None:
        again = station_edit_from_json(edit_to_json(edit))
        station = make_static().views[0].station
        assert again.apply(station) == edit.apply(station)
