import numpy as np
import pytest

from app.errors import InputError, UnknownMarkingError
from app.soccer.pitch import (
    CIRCLES,
    MARKINGS,
    Arc,
    Pitch,
    Segment,
    canonical_marking,
    opposite_marking,
)

PITCH = Pitch()


def turned(points):
    """The pitch turned by 180 degrees about the centre mark."""
    return points * [-1.0, -1.0, 1.0]


class TestConventions:
    def test_there_are_26_markings_and_each_has_a_shape(self):
        assert len(MARKINGS) == len(set(MARKINGS)) == 26
        assert set(PITCH.shapes) == set(MARKINGS)

    def test_the_crossbar_hangs_at_minus_2_44(self):
        crossbar = PITCH.shapes["Goal left crossbar"]
        assert isinstance(crossbar, Segment)
        assert crossbar.start[2] == crossbar.end[2] == -2.44

    def test_the_left_post_of_the_left_goal_stands_at_plus_3_66(self):
        assert PITCH.shapes["Goal left post left"].start[1] == 3.66
        assert PITCH.shapes["Goal left post right"].start[1] == -3.66

    def test_the_left_post_of_the_right_goal_stands_at_minus_3_66(self):
        assert PITCH.shapes["Goal right post left"].start[1] == -3.66
        assert PITCH.shapes["Goal right post right"].start[1] == 3.66

    def test_bottom_is_the_touchline_of_the_main_cameras(self):
        assert PITCH.shapes["Side line bottom"].start[1] == 34.0

    def test_penalty_arcs_lie_outside_the_penalty_areas(self):
        left = PITCH.sample("Circle left", 0.9, 0.2)
        right = PITCH.sample("Circle right", 0.9, 0.2)
        assert left[:, 0].min() == pytest.approx(-36.0)
        assert right[:, 0].max() == pytest.approx(36.0)
        assert left[:, 0].max() == pytest.approx(-41.5 + 9.15, abs=1e-3)


class TestByTheLaws:
    """Outer edges make the pitch: the middle of each line lies half a line inside the plan."""

    LAWS = Pitch(100.0, 64.0).with_goal_edge("laws")

    def test_every_line_moves_half_its_width_into_the_area_that_it_bounds(self):
        shapes = self.LAWS.shapes
        assert shapes["Side line top"].start == pytest.approx((-49.94, -31.94, 0.0))
        assert shapes["Side line right"].end == pytest.approx((49.94, 31.94, 0.0))
        assert shapes["Big rect. left main"].start == pytest.approx((-33.56, -20.10, 0.0))
        assert shapes["Small rect. right bottom"].end == pytest.approx((49.94, 9.10, 0.0))
        assert shapes["Middle line"].start == pytest.approx((0.0, -31.94, 0.0))
        assert shapes["Circle central"].radius == pytest.approx(9.09)

    def test_the_penalty_arc_ends_on_the_middle_of_the_penalty_areas_line(self):
        arc = self.LAWS.sample("Circle right", 0.9, 0.2)
        assert arc[[0, -1], 0] == pytest.approx([33.56, 33.56])
        assert self.LAWS.shapes["Circle right"].center == (39.0, 0.0)

    def test_goals_have_their_middle_and_stand_on_the_goal_lines_outer_edge(self):
        post = self.LAWS.shapes["Goal right post right"]
        assert post.start == pytest.approx((50.0, 3.72, -2.50))

    def test_nothing_else_moves_a_line(self):
        middle = PITCH.with_goal_edge("middle").shapes
        assert {name for name in MARKINGS if middle[name] != PITCH.shapes[name]} == {
            name for name in MARKINGS if name.startswith("Goal")
        }


class TestTwinMarking:
    @pytest.mark.parametrize("marking", MARKINGS)
    def test_is_the_marking_that_a_half_turn_puts_there(self, marking):
        here = turned(PITCH.sample(marking, 0.9, 0.2))
        there = PITCH.sample(opposite_marking(marking), 0.9, 0.2)
        apart = np.linalg.norm(here[:, None] - there[None], axis=2)
        assert apart.min(axis=1).max() < 0.9
        assert apart.min(axis=0).max() < 0.9

    @pytest.mark.parametrize("marking", MARKINGS)
    def test_the_twin_of_the_twin_is_the_marking_itself(self, marking):
        assert opposite_marking(opposite_marking(marking)) == marking


class TestCanonicalMarking:
    def test_spaces_at_the_ends_do_not_matter(self):
        assert canonical_marking("Goal left post left ") == "Goal left post left"

    def test_an_unknown_name_is_named(self):
        with pytest.raises(UnknownMarkingError, match="Goal middle"):
            canonical_marking("Goal middle")

    @pytest.mark.parametrize(
        ("name", "meant"),
        [
            ("Circle centre", "Circle central"),
            ("BIG RECT. LEFT TOP", "Big rect. left top"),
            ("Goal left post_right", "Goal left post right"),
        ],
    )
    def test_the_name_that_was_meant_is_offered(self, name: str, meant: str):
        with pytest.raises(UnknownMarkingError) as caught:
            canonical_marking(name)
        assert caught.value.hint.startswith(f'Did you mean "{meant}"? ')

    def test_where_no_name_is_near_the_list_is_offered_alone(self):
        with pytest.raises(UnknownMarkingError) as caught:
            canonical_marking("xyz")
        assert caught.value.hint.startswith("docs/glossary.md lists")


class TestSample:
    def test_steps_are_as_the_public_evaluator_counts_them(self):
        # int(16.5 / 0.9 - 1) = 17 steps from the start, then the end.
        points = PITCH.sample("Big rect. left top", 0.9, 0.2)
        assert len(points) == 19
        assert np.allclose(np.diff(points[:-1, 0]), 0.9)
        assert points[-1, 0] - points[-2, 0] == pytest.approx(1.2)

    def test_the_central_circle_stays_open_by_one_step(self):
        points = PITCH.sample("Circle central", 0.9, 0.2)
        assert len(points) == int(2 * np.pi * 9.15 / 0.2)

    def test_circles_have_their_radius(self):
        for marking in CIRCLES:
            shape = PITCH.shapes[marking]
            assert isinstance(shape, Arc)
            offset = PITCH.sample(marking, 0.9, 0.2)[:, :2] - shape.center
            assert np.allclose(np.linalg.norm(offset, axis=1), 9.15)


class TestPitch:
    def test_another_size_moves_what_hangs_on_it(self):
        small = Pitch(100.0, 64.0)
        assert small.shapes["Side line left"].start == (-50.0, -32.0, 0.0)
        assert small.shapes["Big rect. right main"].start[0] == pytest.approx(33.5)

    @pytest.mark.parametrize("size", [(60.0, 68.0), (105.0, 100.0)])
    def test_a_size_that_the_laws_do_not_allow_is_refused(self, size):
        with pytest.raises(InputError, match="the Laws of the Game allow"):
            Pitch(*size)
