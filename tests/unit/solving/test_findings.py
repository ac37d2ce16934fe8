from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.soccer.annotation import BallAnnotation
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Station
from app.soccer.policy import PAPER
from app.soccer.solution import (
    Ball3D,
    BallFit,
    Calibration,
    ChiSquare,
    TriangulatedPair,
    ViewSolution,
)
from app.solving.contradiction import Contradiction
from app.solving.findings import _BY_WEIGHT, _make_sides_swapped_finding, find_group_findings
from app.solving.sides import SwappedView
from app.solving.solve import solve_group
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, OPPOSITE, click, given_view, group

BALL = (38.0, 2.0, -1.4)
CAMERAS = {"a": MAIN, "b": BEHIND_GOAL, "c": OPPOSITE}
GOOD = Ball3D(BALL, (0.0,) * 9, 0.1, 60.0, ("a", "b"))
TAU = 0.01 * SIZE.diagonal


def made(keys: str):
    return group(*(given_view(key, CAMERAS[key], BALL) for key in keys))


def pair(a: str, b: str, *errors: float, failed: str | None = None) -> TriangulatedPair:
    return TriangulatedPair(a, b, BALL, errors, 40.0, 60.0, failed is None, failed)


def solved(key: str, ratio: float | None = None, *, included: bool = True) -> ViewSolution:
    fit = BallFit(None, None, None, None, None, None, None, ratio, None)
    calibration = Calibration("given", CAMERAS[key])
    return ViewSolution(key, calibration, key, included, None, fit)


def off(key: str, error_px: float | None) -> ViewSolution:
    fit = BallFit(None, error_px, None, None, None, None, None, None, None)
    return replace(solved(key), ball=fit)


def found(of, *, pairs=(), ball=GOOD, views=None, policy=PAPER, torn=None) -> tuple[Finding, ...]:
    views = views or [solved(view.key) for view in of.views]
    return find_group_findings(of, views, [], pairs, ball, policy, torn)


class TestFind:
    def test_a_group_in_good_order_has_none(self) -> None:
        assert found(made("abc"), pairs=(pair("a", "b", 1.0, 2.0),)) == ()

    def test_of_a_view_that_a_person_left_out_nothing_is_said(self) -> None:
        of = made("abc")
        ball = of.views[2].balls[0]
        spoilt = replace(of.views[2], balls=(ball, ball))
        assert [item.view for item in found(of.with_view(spoilt))] == ["c"]
        assert found(of.with_view(replace(spoilt, included=False))) == ()

    def test_a_group_without_views_has_none(self) -> None:
        assert find_group_findings(group(), (), (), (), None, PAPER) == ()

    @given(st.floats(0, 10), st.floats(0, 3), st.floats(-60, 2), st.floats(0.2, 4), st.booleans())
    def test_what_explains_most_comes_first(self, angle, sigma, z, ratio, several) -> None:
        of = made("ab")
        if several:
            of = of.with_view(replace(of.views[0], balls=of.views[0].balls * 2))
        ball = replace(GOOD, parallax_degrees=angle, sigma_m=sigma, point=(38.0, 2.0, z))
        items = found(of, ball=ball, views=[solved("a", ratio), solved("b")])
        weights = [(not item.is_unusable_ball, _BY_WEIGHT.index(item.kind)) for item in items]
        assert weights == sorted(weights)

    @pytest.mark.parametrize("wrong", [{"point": (38.0, 2.0, 10.2)}, {"sigma_m": 64.0}])
    def test_what_makes_the_ball_unusable_comes_before_what_explains_it(self, wrong) -> None:
        of = made("ab")
        of = of.with_view(replace(of.views[0], balls=of.views[0].balls * 2))
        items = found(of, ball=replace(GOOD, parallax_degrees=0.2, **wrong))
        assert [item.is_unusable_ball for item in items] == [True, False, False]
        assert [item.kind for item in items[1:]] == ["several_balls", "low_parallax"]


class TestSeveralBalls:
    def test_two_balls_in_a_view_are_to_be_picked_from(self) -> None:
        of = made("ab")
        two = replace(of.views[1], balls=(*of.views[1].balls, BallAnnotation(box=Box(1, 2, 9, 9))))
        (item,) = found(of.with_view(two))
        assert (item.kind, item.view, item.number, item.threshold) == ("several_balls", "b", 2, 1)
        assert item.fix == SuggestedFix("pick_ball", "b")

    def test_a_ball_marked_out_of_view_is_no_second_ball(self) -> None:
        of = made("ab")
        two = replace(of.views[1], balls=(*of.views[1].balls, BallAnnotation(out_of_view=True)))
        assert found(of.with_view(two)) == ()


class TestViewDisagrees:
    PAIRS = (
        pair("a", "b", 1.0, 2.0),
        pair("a", "c", 40.0, 30.0, failed="reprojection"),
        pair("b", "c", 20.0, 35.0, failed="reprojection"),
    )

    def test_one_in_no_valid_pair_is_named_with_its_closest_pair(self) -> None:
        views = [solved("a"), solved("b"), solved("c", included=False)]
        (item,) = found(made("abc"), pairs=self.PAIRS, views=views)
        assert (item.kind, item.view, item.number) == ("view_disagrees", "c", 35.0)
        assert item.threshold == pytest.approx(TAU)
        assert item.fix == SuggestedFix("exclude_view", "c")
        here = "at best 35.0 px apart here and 20.0 px in B"
        assert f"{here}; at most {TAU:.1f} px is allowed" in item.sentence

    def test_a_view_that_was_not_judged_does_not_disagree(self) -> None:
        views = [solved("a"), solved("b"), solved("c", included=False)]
        assert found(made("abc"), pairs=self.PAIRS[:1], views=views) == ()

    def test_where_no_pair_is_valid_nobody_disagrees_with_the_rest(self) -> None:
        views = [solved(key, included=False) for key in "abc"]
        kinds = [item.kind for item in found(made("abc"), pairs=self.PAIRS[1:], views=views)]
        assert kinds == []

    def test_rays_that_meet_behind_a_camera_are_not_told_as_pixels_that_are_allowed(self) -> None:
        pairs = (
            self.PAIRS[0],
            pair("a", "c", 9.0, 4.0, failed="reprojection"),
            pair("b", "c", 5.0, 12.0, failed="reprojection"),
        )
        views = [solved("a"), solved("b"), solved("c", included=False)]
        (item,) = found(made("abc"), pairs=pairs, views=views)
        assert (item.kind, item.view, item.number, item.threshold) == (
            *("view_disagrees", "c"),
            *(None, None),
        )
        assert "behind a camera" in item.sentence and " px" not in item.sentence


class TestViewsOfSeveralSizes:
    """A view of a large picture beside one whose tau is a third of it."""

    LARGE = ImageSize(3 * SIZE.width, 3 * SIZE.height)

    def made(self, keys: str):
        of = made(keys)
        station = replace(of.views[0].station, size=self.LARGE)
        return of.with_view(replace(of.views[0], station=station))

    def told(self, keys: str, **what) -> list[Finding]:
        """What is said of errors; the large view's camera is that of a small picture."""
        kinds = "not_synchronous", "view_disagrees"
        return [item for item in found(self.made(keys), **what) if item.kind in kinds]

    def test_each_error_is_compared_with_the_tau_of_its_view(self) -> None:
        apart = pair("a", "b", 5.0, TAU + 1, failed="reprojection")
        (item,) = self.told("ab", pairs=(apart,), ball=None)
        assert item.sentence.startswith("The two views do not see the ball in the same place")
        assert (item.number, item.threshold) == (TAU + 1, pytest.approx(TAU))

    def test_only_what_all_allow_lies_behind_a_camera(self) -> None:
        behind = pair("a", "b", 3 * TAU - 1, TAU - 1, failed="reprojection")
        (item,) = self.told("ab", pairs=(behind,), ball=None)
        assert item.sentence.startswith("The rays of no two views meet in front of their cameras.")
        assert (item.number, item.threshold) == (None, None)

    def test_the_closest_pair_is_that_in_units_of_tau(self) -> None:
        small = pair("b", "c", 2 * TAU, 2 * TAU, failed="reprojection")
        large = pair("a", "b", 4.5 * TAU, 1.0, failed="reprojection")
        (item,) = self.told("abc", pairs=(small, large), ball=None)
        assert (item.number, item.threshold) == (4.5 * TAU, pytest.approx(3 * TAU))

    def test_a_view_that_disagrees_is_told_both_limits(self) -> None:
        pairs = (
            pair("a", "c", 1.0, 1.0),
            pair("a", "b", 2.0, TAU + 1, failed="reprojection"),
            pair("b", "c", 5 * TAU, 5 * TAU, failed="reprojection"),
        )
        views = [solved("a"), solved("b", included=False), solved("c")]
        (item,) = self.told("abc", pairs=pairs, views=views)
        assert (item.kind, item.view) == ("view_disagrees", "b")
        assert (item.number, item.threshold) == (TAU + 1, pytest.approx(TAU))
        assert f"at most {TAU:.1f} px and {3 * TAU:.1f} px are allowed" in item.sentence

    def test_of_views_that_disagree_the_one_that_is_farther_off_in_units_of_tau_is_first(
        self,
    ) -> None:
        views = [off("a", 4 * TAU), off("b", 2 * TAU)]
        kinds = [item.view for item in self.told("ab", views=views)]
        assert kinds == ["b", "a"]


class TestMissesBall:
    """A view in a valid pair that the mean of several pairs does not fit."""

    def test_a_view_that_counts_and_that_the_ball_misses_by_more_than_tau_is_named(self) -> None:
        views = [off("a", 37.7), off("b", 2.3), off("c", 61.1)]
        other, one = found(made("abc"), pairs=TestViewDisagrees.PAIRS, views=views)
        assert (one.kind, one.view, one.number) == ("view_disagrees", "a", 37.7)
        assert (other.view, other.number) == ("c", 61.1)
        assert other.threshold == pytest.approx(TAU)
        assert (
            f"61.1 px from the ball of this view; at most {TAU:.1f} px is allowed" in other.sentence
        )
        assert other.fix == SuggestedFix("exclude_view", "c")

    @pytest.mark.parametrize("error_px", [None, 0.0, TAU])
    def test_up_to_tau_nothing_is_said(self, error_px: float | None) -> None:
        assert found(made("ab"), views=[off("a", error_px), off("b", 1.0)]) == ()


class TestBallSize:
    @pytest.mark.parametrize(("ratio", "limit"), [(2.01, 2.0), (0.49, 0.5)])
    def test_a_box_twice_too_large_or_small_is_said(self, ratio: float, limit: float) -> None:
        (item,) = found(made("ab"), views=[solved("a"), solved("b", ratio)])
        assert (item.kind, item.view) == ("ball_size", "b")
        assert (item.number, item.threshold) == (ratio, limit)

    @pytest.mark.parametrize("ratio", [2.0, 0.5, 1.0, None])
    def test_a_box_up_to_twice_the_size_is_no_finding(self, ratio: float | None) -> None:
        assert found(made("ab"), views=[solved("a"), solved("b", ratio)]) == ()

    def test_a_view_in_no_valid_pair_says_nothing_of_its_box(self) -> None:
        assert found(made("ab"), views=[solved("a"), solved("b", 9.0, included=False)]) == ()


class TestNotSynchronous:
    APART = pair("a", "b", 30.0, 50.0, failed="reprojection")

    def test_two_views_whose_balls_do_not_meet(self) -> None:
        (item,) = found(made("ab"), pairs=(self.APART,), ball=None)
        assert (item.kind, item.number) == ("not_synchronous", 50.0)
        assert item.threshold == pytest.approx(TAU)
        assert item.sentence.startswith(
            "The two views do not see the ball in the same place (30.0 px and 50.0 px"
        )

    def test_rays_that_meet_behind_a_camera_are_not_told_as_pixels_that_are_allowed(self) -> None:
        behind = replace(self.APART, errors_px=(9.0, 4.0))
        (item,) = found(made("ab"), pairs=(behind,), ball=None)
        assert item.sentence.startswith("The rays of no two views meet in front of their cameras.")
        assert " px" not in item.sentence and (item.number, item.threshold) == (None, None)

    def test_of_more_views_the_closest_pair_is_said(self) -> None:
        pairs = (self.APART, pair("a", "c", 20.0, 10.0, failed="reprojection"))
        (item,) = found(made("abc"), pairs=pairs, ball=None)
        assert item.number == 20.0
        assert item.sentence.startswith("No two views see the ball in the same place (the closest")

    def test_static_cameras_run_on_one_clock(self) -> None:
        of = made("ab")
        for view in of.views:
            of = of.with_view(replace(view, station=replace(view.station, shared=True)))
        assert found(of, pairs=(self.APART,), ball=None) == ()

    def test_a_pair_that_failed_before_says_nothing(self) -> None:
        close = replace(self.APART, failed="baseline")
        assert found(made("ab"), pairs=(close,), ball=None) == ()


class TestViewsContradict:
    TWO = ChiSquare(14.2, 1, 0.00016, ("a", "b"))
    THREE = ChiSquare(30.0, 3, 1.4e-6, ("a", "b", "c"))

    def test_two_views_say_when_the_pictures_may_have_been_taken(self) -> None:
        (item,) = found(made("ab"), torn=Contradiction(self.TWO, None, None, 0.35, 1.2))
        assert (item.kind, item.view, item.fix) == ("views_contradict", None, None)
        assert (item.number, item.threshold) == (0.00016, 0.002)
        assert "by chance" not in item.sentence and "1 of 6,200 groups" in item.sentence
        assert "about 80 ms apart (10 to 170)" in item.sentence

    def test_the_numbers_of_the_contradiction_and_of_the_wider_sigma_are_told(self) -> None:
        wide = replace(GOOD, sigma_m=0.94)
        test = ChiSquare(350.0, 1, 4e-78, ("a", "b"))
        (item, _) = found(made("ab"), torn=Contradiction(test, None, None), ball=wide)
        assert "(χ² 350.0, 1 degree of freedom) in fewer than 1 of a million" in item.sentence
        assert "Because of this, sigma is 18.7 times larger: 0.94 m" in item.sentence

    def test_where_nobody_knows_the_cameras_the_way_to_their_noise_is_told(self) -> None:
        for known in (True, False):
            torn = Contradiction(self.TWO, None, None, is_known=known)
            (item,) = found(made("ab"), torn=torn)
            assert ("The accuracy of the given cameras is not known" in item.sentence) == (
                not known
            )

    def test_the_view_without_which_the_others_agree_is_to_be_left_out(self) -> None:
        torn = Contradiction(self.THREE, "c", 0.97, 0.35, None)
        (item,) = found(made("abc"), torn=torn)
        assert (item.view, item.confidence) == ("c", 0.97)
        assert item.fix == SuggestedFix("exclude_view", "c")
        assert "at least 10 ms apart" in item.sentence

    def test_no_instant_is_named_where_no_ball_moves_as_far(self) -> None:
        (item,) = found(made("ab"), torn=Contradiction(self.TWO, None, None, 0.35, 60.0))
        assert " ms" not in item.sentence

    def test_static_cameras_run_on_one_clock(self) -> None:
        of = made("ab")
        for view in of.views:
            of = of.with_view(replace(view, station=replace(view.station, shared=True)))
        (item,) = found(of, torn=Contradiction(self.TWO, None, None, 0.35, 1.2))
        assert " ms" not in item.sentence


class TestOfTheBall:
    @pytest.mark.parametrize(("angle", "kinds"), [(4.99, ["low_parallax"]), (5.0, [])])
    def test_low_parallax_lies_below_the_policys_angle(self, angle, kinds) -> None:
        items = found(made("ab"), ball=replace(GOOD, parallax_degrees=angle))
        assert [item.kind for item in items] == kinds

    @pytest.mark.parametrize(("sigma", "kinds"), [(0.26, ["high_uncertainty"]), (0.25, [])])
    def test_high_uncertainty_lies_above_a_quarter_of_a_metre(self, sigma, kinds) -> None:
        items = found(made("ab"), ball=replace(GOOD, sigma_m=sigma))
        assert [item.kind for item in items] == kinds

    def test_the_words_of_uncertainty_do_not_say_that_contradicting_views_agree(self) -> None:
        torn = Contradiction(TestViewsContradict.TWO, None, None)
        for contradiction, words in (
            (None, "although the views agree"),
            (torn, "contradict each other"),
        ):
            items = found(made("ab"), ball=replace(GOOD, sigma_m=0.9), torn=contradiction)
            assert words in next(one for one in items if one.kind == "high_uncertainty").sentence

    @pytest.mark.parametrize(("sigma", "unusable"), [(2.0, False), (2.01, True), (64.6, True)])
    def test_beyond_two_metres_a_ball_is_of_no_use(self, sigma: float, unusable: bool) -> None:
        (item,) = found(made("ab"), ball=replace(GOOD, sigma_m=sigma))
        assert (item.number, item.is_unusable_ball) == (sigma, unusable)
        assert item.threshold == (2.0 if unusable else 0.25)
        assert (f"known only to ± {sigma:.2f} m" in item.sentence) == unusable

    def test_an_implausible_place_of_which_nothing_is_known_says_so(self) -> None:
        ball = replace(GOOD, point=(0.0, 42.0, -14.0), sigma_m=64.6, parallax_degrees=0.2)
        item = found(made("ab"), ball=ball)[0]
        assert (item.kind, item.number, item.threshold) == ("implausible_ball", 8.0, 6.5)
        assert (
            "is 8 m outside the pitch at a height of 14.00 m, known only to ± 64.60 m, with rays that "
            "meet at 0.2°"
        ) in item.sentence

    def test_an_implausible_ball_has_the_number_of_what_is_wrong_first(self) -> None:
        (item,) = found(made("ab"), ball=replace(GOOD, point=(70.0, 2.0, 0.75)))
        assert (item.kind, item.number, item.threshold) == ("implausible_ball", 0.75, 0.5)
        assert "lies 0.75 m below the grass and is 18 m outside the pitch" in item.sentence


class TestSidesSwapped:
    def test_the_first_of_static_cameras_is_no_main_camera(self) -> None:
        """Its station says that it is one; who stands where is tested with ``find_swapped_views``."""
        far = looking((10.0, -60.0, -12.0), (38.0, 2.0, 0.0), 2000.0)
        for shared, kinds in ((False, ["sides_swapped"]), (True, [])):
            of = group(*(given_view(key, at, BALL) for key, at in (("a", far), ("b", BEHIND_GOAL))))
            for view in of.views:
                lines = click(view.station.given)
                station = Station(view.key, SIZE, shared=shared, lines=lines)
                of = of.with_view(replace(view, station=station))
            findings = solve_group(of, PAPER).findings
            swapped = [item.kind for item in findings if item.kind == "sides_swapped"]
            assert swapped == kinds

    def test_without_an_error_as_labelled_there_is_no_number(self) -> None:
        finding = _make_sides_swapped_finding(SwappedView("7_1.png", None, 2.0, 1.0))
        assert (finding.number, finding.threshold, finding.confidence) == (None, 2.0, 1.0)
        assert "within 2.0 px" in finding.sentence

    def test_the_error_as_labelled_is_the_number_of_the_finding(self) -> None:
        assert _make_sides_swapped_finding(
            SwappedView("7_1.png", 80.0, 2.0, 0.9)
        ).number == pytest.approx(80.0)

    def test_a_main_camera_on_the_far_side_has_no_numbers_and_says_where_it_stands(self) -> None:
        finding = _make_sides_swapped_finding(SwappedView("7.png", None, None, 0.9))
        assert (finding.number, finding.threshold) == (None, None)
        assert "far side" in finding.sentence
