"""The gates in words, from a judgement made by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from app.soccer.policy import PAPER, Policy
from app.soccer.solution import (
    GATES,
    Ball3D,
    Calibration,
    ChiSquare,
    Gate,
    PaintFit,
    TriangulatedPair,
)
from app.solving.gate_sentences import JudgedView, describe_gates, describe_odds
from app.solving.judgement import Judgement
from tests.cameras import looking

ASKED = replace(PAPER, min_parallax_degrees=5.0, max_sigma_m=0.5)
BALL = Ball3D((1.0, 2.0, -0.5), (0.0,) * 9, 0.25, 20.0, ("a", "b"))


def seen(letter: str, jac: float | None = 0.875, **changes: object) -> JudgedView:
    """An included view in good order."""
    view = JudgedView(
        key=letter.lower(),
        letter=letter,
        calibration=Calibration("lines", None, reason="too few lines"),
        jac=jac,
        tau_px=20.0,
        has_ball=True,
        failed=None,
    )
    return replace(view, **changes)


def given(letter: str) -> JudgedView:
    return seen(letter, None, calibration=Calibration("given", None))


def pair(a: str, b: str, *errors: float, failed: str | None = None) -> TriangulatedPair:
    return TriangulatedPair(a, b, (0.0, 0.0, 0.0), errors, 40.0, 20.0, failed is None, failed)  # type: ignore[arg-type]


def gates(
    views: list[JudgedView],
    failed: tuple[str, ...] = (),
    *,
    left_out: tuple[str, ...] = (),
    pairs: tuple[TriangulatedPair, ...] = (),
    ball: Ball3D | None = None,
    baseline: float = math.nan,
    policy: Policy = PAPER,
    chi_square: ChiSquare | None = None,
) -> dict[str, Gate]:
    """The gates by name, of a group that fails some."""
    fails = np.array([[name in failed] for name in GATES])
    nothing = np.empty(0)
    judgement = Judgement(
        jac=nothing,
        view_failed=nothing.astype(int),
        pair_failed=nothing.astype(int),
        failed=fails,
        baseline=np.array([baseline]),
        point=nothing,
        parallax=nothing,
        distance=nothing,
    )
    found = describe_gates(views, left_out, pairs, ball, judgement, policy, chi_square)
    unasked = () if policy.min_agreement is not None else ("agreement",)
    assert tuple(gate.name for gate in found) == tuple(n for n in GATES if n not in unasked)
    return {gate.name: gate for gate in found}


MEASURED = Calibration("paint", looking((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), 2000.0))
NO_CAMERA = {"failed": "calibratable", "jac": None}
LOW = {"failed": "jac", "jac": 0.5}


class TestNumbersThatContradictTheirMark:
    def test_no_tick_stands_beside_the_views_that_fell_where_the_rest_has_no_jac(self):
        views = [given("A"), seen("B", failed="jac", jac=0.75), given("C")]
        found = gates(views)["jac"]
        assert (found.passed, found.value, found.margin) == (True, None, None)
        assert found.view is None and "B: 0.75, not used; the rest not measured" in found.sentence

    def test_a_view_that_counts_is_told_before_those_that_fell(self):
        found = gates([seen("A", 0.9), seen("B", failed="jac", jac=0.75), given("C")])["jac"]
        assert (found.value, found.sentence) == (0.9, "A: 0.90; B too low, not used")

    def test_pixels_within_tau_are_no_reason_to_fail(self):
        pairs = (pair("a", "b", 9.0, 4.0, failed="reprojection"),)
        found = gates([seen("A"), seen("B")], ("reprojection",), pairs=pairs)["reprojection"]
        assert (found.passed, found.value, found.threshold, found.margin) == (
            False,
            9.0,
            20.0,
            None,
        )
        assert found.sentence == "the rays of A–B meet behind a camera"


class TestCalibratable:
    def test_counts_the_views_with_a_camera(self):
        found = gates([seen("A"), seen("B", **NO_CAMERA), seen("C")])["calibratable"]
        assert found == Gate("calibratable", True, 2.0, 2, 0.0, "in 2 of 3 views")

    def test_says_which_cameras_the_lines_do_not_determine(self):
        guess = replace(MEASURED, unobservable=("position",))
        found = gates([seen("A"), seen("B", calibration=guess)])["calibratable"]
        assert (found.passed, found.sentence) == (True, "in 2 of 2 views, B uncertain")

    def test_a_group_of_one_view_needs_one_camera(self):
        assert gates([seen("A")])["calibratable"].threshold == 1

    def test_names_the_first_view_without_one_when_it_is_to_blame(self):
        views = [seen("A"), seen("B", **NO_CAMERA), seen("C", **NO_CAMERA)]
        found = gates(views, ("calibratable", "two_views"))["calibratable"]
        sentence = "B has no camera: too few lines"
        assert found == Gate("calibratable", False, 1.0, 2, -0.5, sentence, "b")


class TestJac:
    def test_says_the_worst_of_the_views_that_are_left(self):
        views = [seen("A", 1.0), seen("B", 0.875), seen("C", **LOW)]
        sentence = "B: 0.88 (lowest); C too low, not used"
        assert gates(views)["jac"] == Gate("jac", True, 0.875, 0.75, 0.125 / 0.75, sentence)

    def test_names_all_views_below(self):
        found = gates([seen("A"), seen("B", **LOW), seen("C", **LOW)])["jac"]
        assert found.sentence == "A: 0.88; B, C too low, not used"

    def test_says_the_worst_of_the_fallen_when_they_are_to_blame(self):
        views = [seen("A", 0.25), seen("B", 0.5, failed="jac"), seen("C", 0.375, failed="jac")]
        found = gates(views, ("jac", "two_views"))["jac"]
        assert found == Gate("jac", False, 0.375, 0.75, -0.5, "C: 0.38 (lowest)", "c")

    def test_where_all_fell_and_another_gate_is_to_blame_the_fallen_speak(self):
        found = gates([seen("A", **LOW), seen("B", **NO_CAMERA)], ("calibratable",))["jac"]
        assert (found.passed, found.sentence, found.view) == (
            True,
            "A: 0.50, not used; the rest not measured",
            None,
        )

    @pytest.mark.parametrize(
        ("jac", "said"),
        [(0.7512, "0.7512"), (0.7488, "0.7488"), (0.7612, "0.76")],
    )
    def test_says_as_many_digits_as_it_takes(self, jac: float, said: str):
        assert gates([seen("A", jac)])["jac"].sentence == f"A: {said}"

    def test_a_value_at_the_threshold_says_that_it_must_be_above(self):
        views = [seen("A", 1.0), seen("B", 0.75, failed="jac")]
        found = gates(views, ("jac", "two_views"))["jac"]
        assert found.sentence == "B: 0.75, must be above 0.75"

    def test_given_cameras_without_lines_are_not_measured(self):
        sentence = "not measured, the cameras were given"
        assert gates([given("A"), seen("B", None)])["jac"] == Gate(
            "jac", True, None, 0.75, None, sentence
        )

    def test_without_any_line_there_is_nothing_to_measure(self):
        assert gates([seen("A", None)])["jac"].sentence == "nothing to measure"

    def test_one_measured_view_is_enough_to_speak(self):
        assert gates([given("A"), seen("B")])["jac"].value == 0.875


class TestAgreement:
    POLICY = replace(PAPER, min_agreement=0.4)

    @staticmethod
    def painted(letter: str, value: float, **changes: object) -> JudgedView:
        """A view with a camera that agrees with its paint so far."""
        calibration = replace(MEASURED, paint=PaintFit(value, 1.0, 80))
        return seen(letter, calibration=calibration, **changes)

    def test_is_no_gate_where_it_is_not_asked(self):
        assert "agreement" not in gates([self.painted("A", 0.1)])

    def test_says_the_worst_of_the_views_that_are_left(self):
        views = [self.painted("A", 0.9), self.painted("B", 0.6)]
        found = gates(views, policy=self.POLICY)["agreement"]
        assert (found.passed, found.value, found.view) == (True, 0.6, None)
        assert found.margin == pytest.approx(0.5)
        assert found.sentence == "B: 0.60 (lowest)"

    def test_names_the_one_to_blame(self):
        views = [self.painted("A", 0.9), self.painted("B", 0.2, failed="agreement")]
        found = gates(views, ("agreement", "two_views"), policy=self.POLICY)
        assert (found["agreement"].passed, found["agreement"].view) == (False, "b")
        assert found["agreement"].sentence == "B: 0.20"
        assert "B not counted (paint contradicts the camera)" in found["two_views"].sentence

    def test_one_below_that_is_not_needed_is_said(self):
        views = [
            self.painted("A", 0.9),
            self.painted("B", 0.8),
            self.painted("C", 0.1, failed="agreement"),
        ]
        found = gates(views, policy=self.POLICY)["agreement"]
        assert found.sentence == "B: 0.80 (lowest); C too low, not used"

    def test_where_no_paint_was_read_it_is_not_judged(self):
        found = gates([seen("A"), given("B")], policy=self.POLICY)["agreement"]
        assert found == Gate("agreement", True, None, 0.4, None, "no paint was read")


class TestTwoViews:
    def test_counts_what_is_left_of_all(self):
        found = gates([seen("A"), seen("B"), seen("C", **LOW)], left_out=("D",))["two_views"]
        assert found == Gate("two_views", True, 2.0, 2, 0.0, "2 of 4")

    def test_says_why_each_view_does_not_count(self):
        views = [seen("A"), seen("B", **LOW), seen("C", **NO_CAMERA), seen("D", **LOW)]
        found = gates(views, ("jac", "two_views"), left_out=("E", "F"))["two_views"]
        sentence = (
            "1 of 6, B, D not counted (lines do not fit), C not counted (no camera), "
            "E, F left out by a person"
        )
        assert found == Gate("two_views", False, 1.0, 2, -0.5, sentence)

    def test_one_view_alone_says_only_that(self):
        assert gates([seen("A")], ("two_views",))["two_views"].sentence == "1 of 1"


class TestBall:
    def test_counts_the_views_that_show_it(self):
        found = gates([seen("A"), seen("B"), seen("C", has_ball=False)])["ball"]
        assert found == Gate("ball", True, 2.0, 2, 0.0, "in 2 views, none in C")

    def test_names_the_first_view_without_it(self):
        views = [seen("A"), seen("B", has_ball=False), seen("C", has_ball=False)]
        found = gates(views, ("ball",))["ball"]
        assert found == Gate("ball", False, 1.0, 2, -0.5, "in 1 view, none in B, C", "b")

    def test_says_why_a_ball_that_is_there_does_not_count(self):
        placed = {"has_ball": False, "no_ball": "placed in {} (not counted)"}
        views = [seen("A"), seen("B"), seen("C", **placed), seen("D", has_ball=False)]
        sentence = "in 2 views, placed in C (not counted), none in D"
        assert gates(views)["ball"].sentence == sentence

    def test_a_ball_in_a_view_that_does_not_count_is_said(self):
        views = [seen("A"), seen("B", **LOW), seen("C", has_ball=False, **NO_CAMERA)]
        found = gates(views, ("ball",))["ball"]
        assert found.sentence == "in 1 view, B not counted (lines do not fit)"
        assert found.view is None

    def test_where_every_view_shows_it_no_view_is_named(self):
        found = gates([seen("A"), seen("B")])["ball"]
        assert (found.sentence, found.view) == ("in 2 views", None)


class TestBaseline:
    def test_says_the_widest(self):
        found = gates([seen("A"), seen("B")], baseline=15.0, policy=ASKED)["baseline"]
        assert found == Gate("baseline", True, 15.0, 1.0, 14.0, "15.0 m")

    def test_names_the_views_that_are_too_close(self):
        views = [seen("A"), seen("B", has_ball=False), seen("C"), seen("D", **LOW)]
        found = gates(views, ("baseline",), baseline=0.25)["baseline"]
        assert found == Gate("baseline", False, 0.25, 1.0, -0.75, "A–C 0.2 m apart")

    def test_names_the_pairs_that_are_not_used_beside_the_widest(self):
        views = [seen("A"), seen("C"), seen("D")]
        close = replace(pair("c", "d", 1.0, 1.0, failed="baseline"), baseline_m=0.9)
        found = gates(views, pairs=(pair("a", "c", 1.0, 1.0), close), baseline=112.2)["baseline"]
        assert (found.passed, found.sentence) == (True, "112.2 m; C–D 0.9 m not used")

    def test_without_two_sights_it_is_not_judged(self):
        found = gates([seen("A")], ("baseline",))["baseline"]
        assert found == Gate("baseline", False, None, 1.0, None, "not judged")


class TestReprojection:
    def test_the_best_pair_speaks_with_its_larger_error(self):
        views = [seen("A"), seen("B"), seen("C")]
        pairs = (pair("a", "b", 4.0, 6.0), pair("a", "c", 2.0, 5.0), pair("b", "c", 9.0, 1.0))
        found = gates(views, pairs=pairs)["reprojection"]
        assert found == Gate(
            "reprojection", True, 5.0, 20.0, 0.75, "A–C 5.0 px, 0.25 % (best pair)"
        )

    def test_errors_compare_in_units_of_their_own_views_tau(self):
        views = [seen("A", tau_px=4.0), seen("B", tau_px=40.0)]
        found = gates(views, pairs=(pair("a", "b", 2.0, 10.0),))["reprojection"]
        assert found == Gate("reprojection", True, 2.0, 4.0, 0.5, "A–B 2.0 px, 0.50 %")
        found = gates(views, pairs=(pair("a", "b", 2.0, 30.0),))["reprojection"]
        assert (found.value, found.threshold, found.margin) == (30.0, 40.0, 0.25)

    def test_pairs_compare_in_units_of_tau_as_well(self):
        views = [seen("A", tau_px=4.0), seen("B", tau_px=40.0), seen("C", tau_px=40.0)]
        pairs = (pair("a", "b", 2.0, 2.0), pair("b", "c", 10.0, 8.0))
        assert gates(views, pairs=pairs)["reprojection"].sentence == (
            "B–C 10.0 px, 0.25 % (best pair)"
        )

    def test_a_valid_pair_goes_before_a_closer_one_that_is_not(self):
        views = [seen("A"), seen("B"), seen("C")]
        behind = pair("a", "b", 1.0, 1.0, failed="reprojection")
        far = pair("b", "c", 50.0, 50.0, failed="reprojection")
        found = gates(views, pairs=(behind, pair("a", "c", 2.0, 8.0), far))["reprojection"]
        assert (found.passed, found.sentence) == (
            True,
            "A–C 8.0 px, 0.40 % (best pair); A–B, B–C not used",
        )

    def test_without_a_valid_pair_the_closest_speaks_and_none_is_left_out(self):
        views = [seen("A"), seen("B"), seen("C")]
        pairs = (
            pair("a", "b", 60.0, 30.0, failed="reprojection"),
            pair("a", "c", 30.0, 40.0, failed="reprojection"),
        )
        found = gates(views, ("reprojection",), pairs=pairs)["reprojection"]
        sentence = "A–C 40.0 px, 2.00 % (best pair)"
        assert found == Gate("reprojection", False, 40.0, 20.0, -1.0, sentence)

    def test_a_share_beside_the_threshold_has_the_digits_to_tell_them_apart(self):
        pairs = (pair("a", "b", 20.02, 1.0, failed="reprojection"),)
        found = gates([seen("A"), seen("B")], ("reprojection",), pairs=pairs)["reprojection"]
        assert found.sentence == "A–B 20.0 px, 1.0010 %"

    def test_pairs_that_failed_before_do_not_speak(self):
        views = [seen("A"), seen("B"), seen("C", **LOW)]
        pairs = (
            pair("a", "b", 1.0, 1.0, failed="baseline"),
            pair("a", "c", 1.0, 1.0, failed="jac"),
        )
        found = gates(views, ("reprojection",), pairs=pairs)["reprojection"]
        assert found == Gate("reprojection", False, None, None, None, "not judged")


class TestParallax:
    def test_says_the_angle(self):
        found = gates([], ball=BALL, policy=ASKED)["parallax"]
        assert found == Gate("parallax", True, 20.0, 5.0, 3.0, "20.0°")

    def test_fails_where_the_verdict_says_so(self):
        low = replace(BALL, parallax_degrees=2.5)
        found = gates([], ("parallax",), ball=low, policy=ASKED)["parallax"]
        assert found == Gate("parallax", False, 2.5, 5.0, -0.5, "2.5°")

    def test_is_said_where_it_is_not_asked(self):
        found = gates([], ball=BALL)["parallax"]
        assert found == Gate("parallax", True, 20.0, None, None, "20.0°", active=False)

    def test_without_a_ball_it_is_not_judged(self):
        found = gates([], policy=ASKED)["parallax"]
        assert found == Gate("parallax", False, None, 5.0, None, "not judged")
        assert gates([])["parallax"] == replace(found, threshold=None, active=False)


class TestSigma:
    def test_says_the_uncertainty(self):
        found = gates([], ball=BALL, policy=ASKED)["sigma"]
        assert found == Gate("sigma", True, 0.25, 0.5, 0.5, "0.25 m")

    def test_fails_where_the_verdict_says_so(self):
        vague = replace(BALL, sigma_m=1.0)
        found = gates([], ("sigma",), ball=vague, policy=ASKED)["sigma"]
        assert found == Gate("sigma", False, 1.0, 0.5, -1.0, "1.00 m")

    def test_is_said_where_it_is_not_asked(self):
        found = gates([], ball=BALL)["sigma"]
        assert found == Gate("sigma", True, 0.25, None, None, "0.25 m", active=False)

    def test_without_a_ball_it_is_not_judged(self):
        found = gates([], policy=ASKED)["sigma"]
        assert found == Gate("sigma", False, None, 0.5, None, "not judged")
        assert gates([])["sigma"] == replace(found, threshold=None, active=False)


class TestChiSquare:
    FOUND = ChiSquare(11.62, 3, 0.0088, ("a", "b", "c"))
    POLICY = replace(PAPER, min_p_value=0.002)

    @pytest.mark.parametrize(
        ("p_value", "said"),
        [
            (0.72, "normal (p = 0.72)"),
            (0.05, "normal (p = 0.050)"),
            (0.049, "unlikely (p = 0.049)"),
            (0.0088, "unlikely (p = 0.0088)"),
            (0.002, "unlikely (p = 0.0020)"),
            (0.00083, "contradictory (p = 0.00083)"),
            (1e-12, "contradictory (p < 0.000001)"),
        ],
    )
    def test_says_how_consistent_the_views_are(self, p_value: float, said: str):
        one = replace(self.FOUND, p_value=p_value)
        found = gates([], policy=self.POLICY, chi_square=one)["chi_square"]
        assert (found.passed, found.value, found.threshold) == (True, p_value, 0.002)
        assert found.sentence == said

    def test_fails_where_the_verdict_says_so(self):
        one = ChiSquare(20.0, 1, 7.7e-6, ("a", "b"))
        found = gates([], ("chi_square",), policy=self.POLICY, chi_square=one)["chi_square"]
        assert not found.passed

    def test_is_said_where_it_is_not_asked(self):
        found = gates([], chi_square=self.FOUND)["chi_square"]
        assert (found.active, found.passed, found.value) == (False, True, 0.0088)

    def test_without_a_ball_it_is_not_judged(self):
        found = gates([], ("chi_square",), policy=self.POLICY)["chi_square"]
        assert found == Gate("chi_square", False, None, 0.002, None, "not judged")

    def test_passes_where_fewer_than_two_views_can_be_tested(self):
        found = gates([], ball=BALL, policy=self.POLICY)["chi_square"]
        sentence = "not judged: a camera has no known uncertainty"
        assert found == Gate("chi_square", True, None, 0.002, None, sentence)

    @pytest.mark.parametrize(
        ("p_value", "words"),
        [
            (0.31, "31 % of groups"),
            (0.01, "1 % of groups"),
            (0.0004, "1 of 2,500 groups"),
            (0.0, "fewer than 1 of a million groups"),
        ],
    )
    def test_chance_is_said_for_people(self, p_value, words):
        assert describe_odds(p_value) == words
