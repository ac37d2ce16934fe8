import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest

from app.features.groups.solution_schemas import SolutionDocument
from app.features.solutions.codec import (
    from_json,
    solution_json_text,
    summarize_solution,
    to_json,
)
from app.geometry.sphere import tight_box
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Station, View
from app.soccer.pitch import MARKINGS, Pitch, opposite_marking
from app.soccer.policy import PAPER, STRICT
from app.soccer.solution import Calibration, MarkingFit, Solution, SuspectLabel
from app.solving.calibrate import calibrate_station
from app.solving.calibration_findings import find_calibration_findings
from app.solving.solve import solve_group
from tests.balls import BALL_M
from tests.cameras import SIZE, looking, wide
from tests.unit.solving.conftest import (
    BEHIND_GOAL,
    BEND,
    MAIN,
    OPPOSITE,
    click,
    given_view,
    group,
    view,
)

BALL = (38.0, 2.0, -1.4)
TAU = 0.01 * SIZE.diagonal


def shifted(one, x: float, y: float):
    """The view with its ball moved by so many pixels."""
    box = one.balls[0].box
    return replace(one, balls=(BallAnnotation(box=replace(box, x=box.x + x, y=box.y + y)),))


@pytest.fixture(scope="module")
def clean():
    return group(
        view("7.png", MAIN, BALL),
        view("7_1.png", BEHIND_GOAL, BALL),
        view("7_2.png", OPPOSITE, BALL),
    )


class TestPoint:
    """Which 3D ball leaves."""

    def test_the_most_likely_point_leaves_with_its_boxes_where_the_policy_says_so(self):
        cameras = zip("abc", (MAIN, BEHIND_GOAL, OPPOSITE), strict=True)
        views = [given_view(key, camera, BALL) for key, camera in cameras]
        views[1] = shifted(views[1], 2.0, 3.0)
        mean, best = (
            solve_group(group(*views), replace(PAPER, point=point)) for point in ("mean", "best")
        )
        assert (mean.point, mean.mean_ball, best.point) == ("mean", None, "best")
        assert best.mean_ball == mean.ball
        assert best.ball.point == best.best_ball.point == mean.best_ball.point
        assert (best.ball.sigma_m, best.ball.views) == (best.best_ball.sigma_m, mean.ball.views)
        assert best.gates == mean.gates
        assert best.views[1].ball.error_px < mean.views[1].ball.error_px - 0.1


class TestWideLenses:
    """Static cameras with lenses that no pinhole comes near, the ball far from their axes."""

    CAMERAS: ClassVar = {
        "cam1": wide((10.0, 44.0, -11.0), (0.0, 12.0, 0.0), "fisheye"),
        "cam2": wide((10.0, -30.0, -10.0), (0.0, 2.0, 0.0), "arctan_polynomial", focal=560.0),
        "cam3": looking((70.0, 0.0, -9.0), (38.0, 2.0, 0.0), 1500.0),
    }

    @pytest.fixture(scope="class")
    @classmethod
    def solved(cls):
        views = []
        for key, camera in cls.CAMERAS.items():
            left, top, right, bottom = tight_box(camera, np.array(BALL), BALL_M / 2).tolist()
            box = Box(left, top, right - left, bottom - top)
            station = Station(key, SIZE, given=camera)
            views.append(View(key, station, (BallAnnotation(box=box),)))
        return solve_group(group(*views), PAPER)

    def test_the_ball_is_where_it_is(self, solved):
        assert solved.passes
        assert np.allclose(solved.ball.point, BALL, atol=0.02)
        assert np.allclose(solved.best_ball.point, BALL, atol=0.02)
        assert [one.included for one in solved.views] == [True] * 3

    def test_lines_lie_on_the_curves_that_the_lens_makes_of_them(self):
        for key in ("cam1", "cam2"):
            camera = self.CAMERAS[key]
            station = Station(key, SIZE, lines=click(camera), given=camera)
            found = calibrate_station(station, Pitch(), PAPER.calibration)
            clicked = [fit for fit in found.markings if fit.distances_px]
            assert len(clicked) >= 5
            assert all(fit.outcome == "tp" for fit in clicked)
            # As far as a chord of 0.9 m is from the curve.
            assert max(fit.largest_px for fit in clicked) < 0.6

    def test_its_size_is_the_spheres(self, solved):
        for one in solved.views:
            assert one.ball.size_ratio == pytest.approx(1.0, abs=0.01)
            assert one.ball.monocular_error_m < 0.6
        assert not any(finding.kind == "ball_size" for finding in solved.findings)

    def test_taken_for_a_pinhole_it_is_metres_off(self):
        # What a format without a place for the lens would have made of it.
        bare = {
            key: replace(camera, lens="brown_conrady", distortion=np.zeros(12))
            for key, camera in self.CAMERAS.items()
        }
        views = [given_view(key, camera, BALL) for key, camera in self.CAMERAS.items()]
        wrong = [replace(one, station=replace(one.station, given=bare[one.key])) for one in views]
        found = solve_group(group(*wrong), PAPER)
        assert np.linalg.norm(np.array(found.ball.point) - BALL) > 1.0


class TestCamerasThatLinesLeaveOpen:
    """Parallel lines fit, and leave open where their camera stands."""

    @pytest.fixture(scope="class")
    @classmethod
    def views(cls):
        seen = looking((30.0, 60.0, -15.0), (30.0, 0.0, 0.0), 1100.0)
        shown = view("a", seen, BALL, noise_px=0.3)
        lines = {
            name: points
            for name, points in shown.station.lines.items()
            if name.endswith(("top", "bottom"))
        }
        rest = tuple(name for name in MARKINGS if name not in lines)
        shown = replace(shown, station=replace(shown.station, lines=lines, not_visible=rest))
        others = zip("bc", (BEHIND_GOAL, OPPOSITE), (1, 2), strict=True)
        return [shown, *(view(key, one, BALL, noise_px=0.3, seed=s) for key, one, s in others)]

    def test_nothing_is_known_of_their_ball(self, views):
        solution = solve_group(group(*views[:2]), replace(PAPER, max_sigma_m=1e6))
        assert solution.views[0].calibration.is_left_open
        assert (solution.ball.sigma_m, solution.best_ball) == (np.inf, None)
        failing = solution.first_failing
        assert (failing.name, failing.view) == ("sigma", "a")
        assert failing.sentence == "the lines of view A leave its camera open"
        (finding,) = [one for one in solution.findings if one.kind == "high_uncertainty"]
        assert finding.is_unusable_ball and failing.sentence in finding.sentence
        assert all(not np.isfinite(one.expected.covariance).any() for one in solution.views)

    @pytest.mark.parametrize(("count", "tested"), [(2, None), (3, ("b", "c"))])
    def test_the_others_alone_are_tested(self, views, count, tested):
        solution = solve_group(group(*views[:count]), replace(PAPER, min_p_value=1e-9))
        assert solution.passes
        found = solution.chi_square
        assert (None if found is None else found.views) == tested
        (gate,) = [gate for gate in solution.gates if gate.name == "chi_square"]
        assert gate.passed and (gate.value is None) == (tested is None)
        assert gate.sentence.startswith("not judged") == (tested is None)

    def test_the_others_are_named_where_they_contradict_each_other(self, views):
        late = view("c", OPPOSITE, np.add(BALL, (0.0, 0.4, -0.4)), noise_px=0.3, seed=2)
        solution = solve_group(group(*views[:2], late), replace(PAPER, tau_percent=5.0))
        (finding,) = [one for one in solution.findings if one.kind == "views_contradict"]
        assert finding.sentence.startswith("Views B and C do not agree on one ball")
        assert "inf" not in finding.sentence

    def test_what_is_stored_and_served_has_no_infinity(self, views):
        said = group(*views[:2])
        solution = solve_group(said, PAPER)
        assert solution.passes
        stored = solution_json_text(to_json(solution))
        assert from_json(Solution, json.loads(stored)) == solution
        served = SolutionDocument.of(solution, said).model_dump_json()
        for text in (stored, served):
            json.loads(text, parse_constant=pytest.fail)
        assert summarize_solution(said, solution).sigma_m is None

    def test_the_most_likely_ball_rests_on_the_others(self, views):
        best = solve_group(group(*views), PAPER).best_ball
        assert (best.views, best.contradicting) == (("b", "c"), ())
        assert np.linalg.norm(np.array(best.point) - BALL) < 0.2


class TestBallsBeyondTheLens:
    """No ray goes through a pixel that lies where the lens has folded the picture."""

    @pytest.fixture(scope="class")
    @classmethod
    def views(cls):
        fold = np.array([-0.35, *[0.0] * 11])
        lost = replace(looking((-40.0, 50.0, -15.0), BALL, 400.0), distortion=fold)
        beyond = replace(
            given_view("c", lost, BALL), balls=(BallAnnotation(box=Box(1270.0, 710.0, 8.0, 8.0)),)
        )
        return [given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL), beyond]

    def test_are_no_balls_that_are_seen(self, views):
        solution = solve_group(group(views[0], views[2]), PAPER)
        failing = solution.first_failing
        assert (failing.name, failing.value, failing.view) == ("ball", 1.0, "c")
        assert failing.sentence == (
            "in 1 view, no ray goes through it: it lies beyond what the lens of view B shows"
        )

    def test_store_no_nan(self, views):
        solution = solve_group(group(*views), PAPER)
        assert solution.passes
        fit = solution.views[2].ball
        assert (fit.optimized_diameter_px, fit.optimized_box, fit.size_ratio) == (None, None, None)
        assert (fit.optimized_error_m, fit.depth_per_px_m) == (None, None)
        json.dumps(to_json(solution), allow_nan=False)


class TestSolve:
    def test_exact_annotations_give_the_exact_ball(self, clean):
        solution = solve_group(clean, PAPER)
        assert solution.passes
        assert np.allclose(solution.ball.point, BALL, atol=0.02)
        assert solution.first_failing is None

    def test_every_calibrated_pair_is_kept(self, clean):
        pairs = {(pair.a, pair.b) for pair in solve_group(clean, PAPER).pairs}
        assert pairs == {("7.png", "7_1.png"), ("7.png", "7_2.png"), ("7_1.png", "7_2.png")}

    def test_known_calibrations_change_no_bit(self, clean):
        cold = solve_group(clean, PAPER)
        known = {item.calibration_key: item.calibration for item in cold.views}
        assert solve_group(clean, PAPER, known) == cold

    def test_known_calibrations_are_not_computed_again(self, clean):
        cold = solve_group(clean, PAPER)
        marked = {
            item.calibration_key: replace(item.calibration, reason="kept") for item in cold.views
        }
        assert all(
            item.calibration.reason == "kept" for item in solve_group(clean, PAPER, marked).views
        )

    def test_the_mean_is_over_valid_pairs_only(self):
        wrong = shifted(given_view("c", OPPOSITE, BALL), 0.0, 60.0)
        solution = solve_group(
            group(given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL), wrong), PAPER
        )
        assert solution.ball.views == ("a", "b")
        assert np.allclose(solution.ball.point, BALL, atol=1e-6)
        assert [item.included for item in solution.views] == [True, True, False]

    def test_the_optimised_box_has_the_true_size_however_loose_the_annotation(self, clean):
        loose = replace(clean.views[0].balls[0].box, width=40.0, height=36.0)
        center = clean.views[0].balls[0].box.center
        loose = replace(loose, x=center.x - 20.0, y=center.y - 18.0)
        changed = clean.with_view(replace(clean.views[0], balls=(BallAnnotation(box=loose),)))
        fit = solve_group(changed, PAPER).view("7.png").ball
        depth = MAIN.pitch_to_camera(np.array([BALL]))[0, 2]
        assert fit.optimized_diameter_px == pytest.approx(BALL_M * 2200.0 / depth, rel=0.03)
        assert fit.size_ratio == pytest.approx(38.0 / fit.optimized_diameter_px)
        assert fit.optimized_box.center == pytest.approx(center)

    def test_a_view_that_a_person_left_out_takes_no_part(self, clean):
        without = clean.with_view(replace(clean.views[1], included=False))
        solution = solve_group(without, PAPER)
        assert {pair.a for pair in solution.pairs} | {pair.b for pair in solution.pairs} == {
            "7.png",
            "7_2.png",
        }
        assert solution.view("7_1.png").failed == "excluded"

    def test_one_view_alone_puts_the_ball_where_its_box_says(self, clean):
        fit = solve_group(clean, PAPER).view("7_2.png").ball
        # A box of the true size: the rest is the distortion of the ball's own picture.
        assert fit.monocular_error_m < 0.05 * fit.depth_m
        assert np.linalg.norm(np.array(fit.monocular) - BALL) == pytest.approx(
            fit.monocular_error_m, abs=0.05
        )

    def test_points_without_a_box_are_enough(self):
        views = [given_view("a", MAIN, BALL), given_view("b", OPPOSITE, BALL)]
        points = [replace(one, balls=(BallAnnotation(point=one.balls[0].center),)) for one in views]
        solution = solve_group(group(*points), PAPER)
        assert solution.passes
        assert solution.views[0].ball.size_ratio is None
        assert solution.views[0].ball.monocular is None
        assert solution.views[0].ball.optimized_diameter_px > 5


class TestGates:
    def first(self, *views, policy=PAPER):
        gate = solve_group(group(*views), policy).first_failing
        return (gate.name, gate.view) if gate else None

    def test_a_group_short_of_views_names_the_view_without_a_camera(self, clean):
        bare = replace(clean.views[1], station=replace(clean.views[1].station, lines={}))
        assert self.first(clean.views[0], bare) == ("calibratable", "7_1.png")

    def test_a_bad_fit_is_named_when_it_leaves_one_view(self, clean):
        station = clean.views[1].station
        lines = {
            name: tuple(ImagePoint(x + 9 * (-1) ** index, y) for index, (x, y) in enumerate(points))
            for name, points in station.lines.items()
        }
        bad = replace(clean.views[1], station=replace(station, lines=lines))
        assert self.first(clean.views[0], bad) == ("jac", "7_1.png")

    def test_a_fallen_view_does_not_stop_two_others(self, clean):
        bare = replace(clean.views[2], station=replace(clean.views[2].station, lines={}))
        assert self.first(*clean.views[:2], bare) is None

    def test_one_view_alone_fails_at_two_views(self, clean):
        assert self.first(clean.views[0]) == ("two_views", None)

    def test_a_missing_ball_is_named(self, clean):
        blind = replace(clean.views[1], balls=())
        assert self.first(clean.views[0], blind) == ("ball", "7_1.png")

    def test_two_views_from_one_place_have_no_baseline(self):
        beside = looking((3.3, 62.1, -16.0), (34.0, -4.0, 0.0), 2300.0, bend=BEND)
        views = given_view("a", MAIN, BALL), given_view("b", beside, BALL)
        assert self.first(*views) == ("baseline", None)

    @pytest.mark.parametrize("make", [view, given_view], ids=["from lines", "given"])
    @pytest.mark.parametrize("other", [BALL, (30.0, 2.0, -1.4)], ids=["one ball", "two balls"])
    def test_a_picture_that_is_there_twice_has_no_baseline(self, make, other):
        found = solve_group(group(make("7.png", MAIN, BALL), make("7_1.png", MAIN, other)), PAPER)
        assert found.first_failing.name == "baseline"
        assert (found.first_failing.value, found.first_failing.sentence) == (
            0.0,
            "A–B 0.0 m apart",
        )

    def test_views_of_different_instants_do_not_meet(self):
        views = given_view("a", MAIN, BALL), given_view("b", OPPOSITE, (36.0, 2.0, -0.11))
        assert self.first(*views) == ("reprojection", None)

    def test_an_error_just_below_tau_passes_and_one_above_does_not(self):
        a, b = given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL)
        errors = [
            max(solve_group(group(a, shifted(b, 0.0, dy)), PAPER).pairs[0].errors_px)
            for dy in (10.0, 40.0)
        ]
        assert errors[0] < TAU < errors[1]
        assert self.first(a, shifted(b, 0.0, 10.0)) is None
        assert self.first(a, shifted(b, 0.0, 40.0)) == ("reprojection", None)

    def test_parallax_is_a_gate_of_the_strict_policy_alone(self):
        near = looking((7.0, 62.0, -16.0), (34.0, -4.0, 0.0), 2300.0, bend=BEND)
        views = given_view("a", MAIN, BALL), given_view("b", near, BALL)
        assert self.first(*views) is None
        assert self.first(*views, policy=STRICT) == ("parallax", None)

    def test_a_given_camera_without_lines_is_not_measured(self):
        views = given_view("a", MAIN, BALL), given_view("b", OPPOSITE, BALL)
        gate = solve_group(group(*views), PAPER).gates[1]
        assert (gate.passed, gate.value, gate.sentence) == (
            True,
            None,
            "not measured, the cameras were given",
        )

    def test_nine_of_twelve_is_not_above_three_quarters(self, clean):
        exactly = replace(PAPER, min_jac=1.0)
        assert solve_group(clean, exactly).first_failing.name == "jac"


class TestFindings:
    def kinds(self, *views, policy=PAPER):
        return [item.kind for item in solve_group(group(*views), policy).findings]

    def test_a_clean_group_has_none(self, clean):
        assert self.kinds(*clean.views) == []

    def test_a_view_in_no_valid_pair_disagrees(self):
        wrong = shifted(given_view("c", OPPOSITE, BALL), 0.0, 60.0)
        found = solve_group(
            group(given_view("a", MAIN, BALL), given_view("b", BEHIND_GOAL, BALL), wrong), PAPER
        ).findings
        assert [(item.kind, item.view, item.fix.action) for item in found] == [
            ("view_disagrees", "c", "exclude_view")
        ]
        assert found[0].number > found[0].threshold == pytest.approx(TAU)

    def test_several_balls_ask_to_pick_one(self, clean):
        twice = replace(clean.views[0], balls=clean.views[0].balls * 2)
        assert "several_balls" in self.kinds(twice, *clean.views[1:])
        ball = next(
            one
            for one in solve_group(group(twice, *clean.views[1:]), PAPER).gates
            if one.name == "ball"
        )
        assert ball.sentence.endswith("several in A")

    def test_a_low_parallax_is_said(self):
        near = looking((7.0, 62.0, -16.0), (34.0, -4.0, 0.0), 2300.0, bend=BEND)
        assert "low_parallax" in self.kinds(
            given_view("a", MAIN, BALL), given_view("b", near, BALL)
        )

    @pytest.mark.parametrize(
        ("place", "words"),
        [
            ((38.0, 2.0, 2.0), "below the grass"),
            ((38.0, 2.0, -45.0), "above the grass"),
            ((38.0, -48.0, -1.0), "outside the pitch"),
        ],
    )
    def test_an_implausible_ball_is_said_with_its_number(self, place, words):
        wide = looking((3.0, 80.0, -20.0), (38.0, 0.0, -10.0), 700.0)
        side = looking((90.0, 20.0, -20.0), (38.0, 0.0, -10.0), 500.0)
        found = solve_group(
            group(given_view("a", wide, place), given_view("b", side, place)), PAPER
        )
        (finding,) = [item for item in found.findings if item.kind == "implausible_ball"]
        assert words in finding.sentence
        assert finding.number > finding.threshold

    def test_a_camera_below_the_grass_is_said(self):
        buried = replace(MAIN, position=np.array([3.0, 62.0, 2.0]))
        kinds = self.kinds(given_view("a", buried, BALL), given_view("b", OPPOSITE, BALL))
        assert "implausible_camera" in kinds

    def test_a_camera_made_for_pictures_of_another_size_is_said_first(self):
        size = given_view("a", MAIN, BALL).size
        factor = 960 / size.width
        other = MAIN.scaled(factor, factor)
        other = replace(other, principal_point=(959 / 2, (round(size.height * factor) - 1) / 2))
        seen = given_view("a", MAIN, BALL)
        view = replace(seen, station=replace(seen.station, given=other))
        found = solve_group(group(view, given_view("b", OPPOSITE, BALL)), PAPER)
        finding = found.findings[0]
        assert finding.kind == "camera_size"
        assert f"--size 960x{round(size.height * factor)}" in finding.sentence
        assert finding.number > finding.threshold

    def test_a_goal_behind_the_line_is_no_fault(self):
        goal = (53.2, 1.0, -0.5)
        assert self.kinds(given_view("a", MAIN, goal), given_view("b", OPPOSITE, goal)) == []


class TestSidesSwapped:
    def test_a_replay_labelled_for_the_other_side_is_found_by_its_ball(self, clean):
        replay = clean.views[1]
        lines = {opposite_marking(name): points for name, points in replay.station.lines.items()}
        turned = replace(replay, station=replace(replay.station, lines=make_lines(lines)))
        found = solve_group(group(clean.views[0], turned, clean.views[2]), PAPER).findings
        assert [(item.kind, item.view, item.fix.action) for item in found] == [
            ("sides_swapped", "7_1.png", "swap_sides")
        ]
        assert found[0].confidence > 0.9

    def test_a_main_camera_on_the_far_side_is_the_one_that_is_swapped(self, clean):
        main = clean.views[0]
        lines = {opposite_marking(name): points for name, points in main.station.lines.items()}
        turned = replace(main, station=replace(main.station, lines=make_lines(lines)))
        found = solve_group(group(turned, clean.views[1]), PAPER).findings
        assert [(item.kind, item.view) for item in found] == [("sides_swapped", "7.png")]

    def test_views_that_are_all_labelled_from_the_other_end_agree_and_are_still_wrong(self, clean):
        turned = []
        for one in clean.views[:2]:
            lines = {opposite_marking(name): points for name, points in one.station.lines.items()}
            turned.append(replace(one, station=replace(one.station, lines=make_lines(lines))))
        solution = solve_group(group(*turned), PAPER)
        assert solution.passes
        (finding,) = [item for item in solution.findings if item.kind == "sides_swapped"]
        assert (finding.view, finding.fix.action) == ("7.png", "swap_sides")
        assert "far side" in finding.sentence

    def test_a_pair_that_meets_far_from_any_pitch_clears_no_view(self, clean):
        # The rays of the view as labelled meet, but high in the air and far behind the stands.
        replay = clean.views[1]
        lines = {opposite_marking(name): points for name, points in replay.station.lines.items()}
        turned = replace(replay, station=replace(replay.station, lines=make_lines(lines)))
        loose = replace(PAPER, tau_percent=100.0)
        solution = solve_group(group(clean.views[0], turned), loose)
        assert [pair.valid for pair in solution.pairs] == [True]
        assert "sides_swapped" in [item.kind for item in solution.findings]

    def test_another_instant_is_not_taken_for_another_side(self, clean):
        other = view("7_1.png", BEHIND_GOAL, (40.0, -9.0, -0.11))
        found = solve_group(group(clean.views[0], other), PAPER).findings
        assert [item.kind for item in found] == ["not_synchronous"]


class TestExpectedBall:
    def test_a_view_without_a_ball_says_where_it_should_show_it(self, clean):
        blind = replace(clean.views[2], balls=())
        solved = solve_group(group(*clean.views[:2], blind), PAPER).view("7_2.png")
        assert solved.ball is None
        assert not solved.included
        assert np.allclose(solved.expected.place, OPPOSITE.project(np.array([BALL]))[0], atol=1.0)
        assert solved.expected.box.diameter == pytest.approx(
            clean.views[2].balls[0].box.diameter, rel=0.1
        )

    def test_its_uncertainty_is_that_of_the_ball_seen_from_there(self, clean):
        solution = solve_group(clean, PAPER)
        covariance = np.array(solution.view("7_2.png").expected.covariance).reshape(2, 2)
        assert np.allclose(covariance, covariance.T)
        sigmas = np.sqrt(np.linalg.eigvalsh(covariance))
        assert 0.1 < sigmas[0] <= sigmas[1] < 10

    def test_without_a_3d_ball_nothing_is_expected(self, clean):
        alone = [replace(view, balls=()) for view in clean.views[1:]]
        assert all(
            view.expected is None
            for view in solve_group(group(clean.views[0], *alone), PAPER).views
        )

    def test_a_ball_that_was_put_where_the_others_see_it_confirms_nothing(self, clean):
        blind = replace(clean.views[2], balls=())
        before = solve_group(group(*clean.views[:2], blind), PAPER)
        put = BallAnnotation(box=before.view("7_2.png").expected.box, inferred=True)
        after = solve_group(group(*clean.views[:2], replace(blind, balls=(put,))), PAPER)
        assert (after.ball, after.pairs) == (before.ball, before.pairs)
        assert not after.view("7_2.png").included
        gate = next(gate for gate in after.gates if gate.name == "ball")
        assert gate.sentence == "in 2 views, placed in C (not counted)"
        alone = solve_group(group(clean.views[0], replace(clean.views[1], balls=(put,))), PAPER)
        assert alone.first_failing.name == "ball"


def left_out(marking, distances):
    """A calibration that left a marking out, whose points lie so far from where it should be."""
    fit = MarkingFit(marking, "fp", distances, used=False)
    suspect = SuspectLabel(marking, None, 0.5, max(distances))
    return Calibration("lines", MAIN, markings=(fit,), suspects=(suspect,))


class TestCalibrationFindings:
    def test_one_point_off_its_line_is_a_bad_point(self, clean):
        station = clean.views[0].station
        points = list(station.lines["Big rect. right main"])
        points[2] = ImagePoint(points[2].x, points[2].y + 25)
        lines = {**station.lines, "Big rect. right main": tuple(points)}
        moved = replace(clean.views[0], station=replace(station, lines=lines))
        found = solve_group(group(moved, *clean.views[1:]), PAPER).findings
        assert [(item.kind, item.marking, item.fix.index) for item in found] == [
            ("bad_point", "Big rect. right main", 2)
        ]

    def test_one_slipped_point_is_no_wrong_label_even_where_the_marking_was_left_out(self, clean):
        found = find_calibration_findings(left_out("Side line top", (0.4, 0.3, 48.5, 0.2)), SIZE)
        assert [(item.kind, item.fix.action, item.fix.index) for item in found] == [
            ("bad_point", "drop_point", 2)
        ]

    def test_a_marking_that_is_off_with_all_its_points_contradicts_the_others(self, clean):
        found = find_calibration_findings(left_out("Side line top", (30.0, 33.0, 48.5, 29.0)), SIZE)
        assert [(item.kind, item.fix.action) for item in found] == [("wrong_label", "drop_marking")]

    def test_a_marking_in_sight_that_nobody_annotated_is_said(self, clean):
        station = clean.views[0].station
        fewer = {name: at for name, at in station.lines.items() if name != "Side line top"}
        partial = replace(clean.views[0], station=replace(station, lines=fewer))
        found = solve_group(group(partial, *clean.views[1:]), PAPER).findings
        assert [(item.kind, item.marking) for item in found] == [
            ("visible_not_annotated", "Side line top")
        ]

    def test_a_mislabelled_marking_is_not_called_missing_too(self, clean):
        station = clean.views[0].station
        lines = dict(station.lines)
        lines["Circle left"] = lines.pop("Circle right")
        wrong = replace(clean.views[0], station=replace(station, lines=make_lines(lines)))
        found = solve_group(group(wrong, *clean.views[1:]), PAPER).findings
        assert [(item.kind, item.suggested) for item in found] == [("wrong_label", "Circle right")]


class TestBallInGroup:
    def test_a_ball_box_without_area_still_has_a_centre(self, clean):
        dot = BallAnnotation(box=Box(*clean.views[0].balls[0].box.center, 0.0, 0.0))
        changed = clean.with_view(replace(clean.views[0], balls=(dot,)))
        assert solve_group(changed, PAPER).view("7.png").ball.size_ratio is None
