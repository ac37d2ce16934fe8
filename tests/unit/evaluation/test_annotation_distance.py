from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.annotation_distance import (
    compare_annotations,
    compare_balls,
    compare_balls_3d,
    compare_lines,
    measure_marking_distance,
)
from app.evaluation.rater_agreement import (
    AgreementLimits,
    compute_medians_and_tails,
    find_disagreements,
)
from app.soccer.annotation import BallAnnotation, Lines, make_lines
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.soccer.solution import Ball3D
from app.solving.jaccard import project_markings
from app.solving.solve import solve_group
from tests.cameras import SIZE
from tests.scenes import make_scenes
from tests.unit.solving.conftest import MAIN

LINE = "Side line top"


def drawn(*points: tuple[float, float]) -> dict[str, tuple[ImagePoint, ...]]:
    return dict(make_lines({LINE: points}))


def ball_at(x: float, variance: float) -> Ball3D:
    covariance = tuple((np.eye(3) * variance).ravel().tolist())
    return Ball3D((x, 0.0, -0.11), covariance, math.sqrt(variance), 40.0, ("1", "2"))


@pytest.fixture(scope="module")
def group() -> Group:
    return make_scenes(1, seed=3, faults=False)[0].group


class TestCompareLines:
    def test_a_line_moved_by_three_pixels_lies_three_pixels_apart(self) -> None:
        (found,) = compare_lines(drawn((0, 0), (100, 0)), drawn((0, 3), (50, 3), (100, 3)))
        assert found.mean_px == pytest.approx(3)
        assert found.largest_px == pytest.approx(3)

    def test_how_long_it_is_drawn_does_not_count(self) -> None:
        (found,) = compare_lines(drawn((0, 0), (400, 0)), drawn((100, 1), (200, 1)))
        assert found.largest_px == pytest.approx(1)

    def test_lines_that_lie_behind_each_other_are_as_far_apart_as_they_are(self) -> None:
        (found,) = compare_lines(drawn((0, 0), (10, 0)), drawn((30, 0), (40, 0)))
        assert found.largest_px == pytest.approx(30)

    def test_says_who_drew_what_the_other_did_not(self) -> None:
        (found,) = compare_lines({}, drawn((0, 0), (10, 0)))
        assert (found.only, found.mean_px) == ("b", None)

    def test_is_the_same_when_both_change_places(self) -> None:
        a, b = drawn((0, 0), (30, 4), (90, 9)), drawn((5, 2), (70, 13))
        assert compare_lines(a, b) == compare_lines(b, a)


class TestCircles:
    """Two who click exactly along a circle, each at other places of it."""

    PATH = project_markings(MAIN, Pitch(), SIZE)["Circle right"]

    def clicks(self, count: int, moved: float = 0.0, name: str = "Circle right") -> Lines:
        chosen = self.PATH[np.linspace(0, len(self.PATH) - 1, count).astype(int)]
        return make_lines({name: [(x, y + moved) for x, y in chosen.tolist()]})

    def test_who_clicks_exactly_agrees_with_whoever_clicks_elsewhere(self) -> None:
        largest, means = {}, {}
        for name in ("Middle line", "Circle right"):
            mine, theirs = self.clicks(8, name=name), self.clicks(11, name=name)
            (found,) = compare_lines(mine, theirs)
            largest[name] = found.largest_px or 0.0
            means[name] = measure_marking_distance(name, mine[name], theirs[name])
        assert largest["Circle right"] < 0.2 < 1.0 < largest["Middle line"]
        assert means["Circle right"] < 0.1 < 0.5 < means["Middle line"]

    def test_who_clicks_the_same_is_nothing_apart(self) -> None:
        (found,) = compare_lines(self.clicks(8), self.clicks(8))
        assert found.largest_px == 0.0

    def test_the_order_of_clicks_does_not_count(self) -> None:
        ((name, points),) = self.clicks(11).items()
        (found,) = compare_lines(self.clicks(8), {name: (*points[1::2], *points[::2])})
        assert found.largest_px is not None and found.largest_px < 0.2

    def test_a_circle_that_is_moved_lies_apart(self) -> None:
        (found,) = compare_lines(self.clicks(8), self.clicks(11, moved=6.0))
        assert found.largest_px == pytest.approx(6.0, abs=1.0)

    def test_fewer_than_five_points_are_joined_by_chords(self) -> None:
        straight, bent = (
            compare_lines(self.clicks(4, name=name), self.clicks(3, name=name))[0].largest_px
            for name in ("Middle line", "Circle right")
        )
        assert straight == bent


class TestCompareBalls:
    def test_says_centre_and_diameter(self) -> None:
        a, b = BallAnnotation(Box(10, 10, 10, 10)), BallAnnotation(Box(13, 14, 14, 14))
        found = compare_balls((a,), (b,))
        assert found.center_px == pytest.approx(math.hypot(5, 6))
        assert (found.diameter_px, found.is_same_state) == (4, True)

    def test_tells_occluded_out_of_view_and_not_annotated_apart(self) -> None:
        ball = BallAnnotation(Box(10, 10, 10, 10))
        hidden, gone = replace(ball, occluded=True), BallAnnotation(out_of_view=True)
        states = [
            compare_balls((ball,), other).b for other in ((hidden,), (gone,), (), (ball,) * 2)
        ]
        assert states == ["occluded", "out_of_view", "none", "several"]


class TestCompareBalls3D:
    def test_a_difference_within_both_sigmas_is_explained_and_a_large_one_is_not(self) -> None:
        near = compare_balls_3d(ball_at(0, 0.01), ball_at(0.2, 0.01))
        far = compare_balls_3d(ball_at(0, 0.01), ball_at(0.6, 0.01))
        # d^2 / (s1^2 + s2^2) is 2 and 18; 5 % of chi-square with three degrees lie above 7.81.
        assert near.p_value == pytest.approx(0.5724, abs=1e-4)
        assert (near.is_explained, far.is_explained) == (True, False)

    def test_without_a_covariance_nobody_knows(self) -> None:
        assert compare_balls_3d(ball_at(0, 0.0), ball_at(1, 0.0)).is_explained is None


class TestCompareAnnotations:
    def test_of_a_group_with_itself_is_nothing(self, group: Group) -> None:
        solution = solve_group(group, Policy())
        found = compare_annotations(group, group, solution, solution)
        assert found.ball.distance_m == 0
        assert all(view.largest_px < 1e-9 and view.position_m == 0 for view in found.views)
        assert find_disagreements(found, ("accepted", "accepted"), AgreementLimits()) == ()

    def test_a_moved_ball_is_told_in_pixels_and_in_metres(self, group: Group) -> None:
        view = group.views[0]
        (ball,) = view.balls
        assert ball.box is not None
        moved = replace(ball, box=replace(ball.box, x=ball.box.x + 40))
        other = group.with_view(replace(view, balls=(moved,)))
        solutions = solve_group(group, Policy()), solve_group(other, Policy())
        found = compare_annotations(group, other, *solutions)
        assert found.views[0].ball.center_px == pytest.approx(40)
        said = find_disagreements(found, ("accepted", "rejected"), AgreementLimits())
        assert {item.kind for item in said} >= {"verdict", "ball_px"}
        assert said[0].severity == max(item.severity for item in said)
        assert said[0].view == view.key

    def test_the_camera_of_one_is_held_against_the_lines_of_the_other(self, group: Group) -> None:
        view = group.views[0]
        lines = {
            name: tuple(ImagePoint(x + 30, y + 30) for x, y in points)
            for name, points in view.station.lines.items()
        }
        other = group.with_view(replace(view, station=replace(view.station, lines=lines)))
        solutions = solve_group(group, Policy()), solve_group(other, Policy())
        jac = compare_annotations(group, other, *solutions).views[0].jac
        back = compare_annotations(other, group, *reversed(solutions)).views[0].jac
        assert jac == back[::-1]
        assert all(value is not None and value < 0.5 for value in jac)


class TestSpreads:
    def test_hold_what_was_measured_and_say_of_how_many(self, group: Group) -> None:
        found = compute_medians_and_tails([compare_annotations(group, group, None, None)])
        assert (found["ball_m"].count, found["ball_m"].median) == (0, None)
        assert found["ball_px"].median == 0
        assert found["line_px"].tail == pytest.approx(0, abs=1e-9)
