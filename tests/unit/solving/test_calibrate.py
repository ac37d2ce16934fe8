import json
from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.cameras import measure_error_without_marking
from app.features.solutions.codec import from_json, solution_json_text, to_json
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Station, View
from app.soccer.pitch import GOAL_PARTS, Pitch, mirrored_marking
from app.soccer.policy import CLICKED, POLICIES, CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate, calibrate_station, compute_calibration_key
from app.solving.calibration_findings import find_calibration_findings
from app.solving.facts import collect_facts_of_views
from app.solving.jaccard import camera_jaccard, project_markings
from app.solving.judgement import compute_view_jac
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEHIND_GOAL, BEND, MAIN, OPPOSITE, PITCH, click

POLICY = CalibrationPolicy()
VIEWS = {"main": MAIN, "behind goal": BEHIND_GOAL, "opposite": OPPOSITE}


def relabel(lines, marking, to):
    return make_lines({to if name == marking else name: at for name, at in lines.items()})


class TestCalibrate:
    @pytest.mark.parametrize("truth", VIEWS.values(), ids=VIEWS.keys())
    def test_exact_clicks_give_the_exact_camera(self, truth):
        found = calibrate(click(truth), PITCH, SIZE, POLICY)
        # The prior of the distortion pulls by a hair.
        assert np.linalg.norm(found.camera.position - truth.position) < 0.05
        assert found.camera.focal_length[0] == pytest.approx(truth.focal_length[0], rel=2e-3)
        assert found.error_px < 0.05

    @pytest.mark.parametrize("truth", VIEWS.values(), ids=VIEWS.keys())
    def test_the_truth_lies_where_the_covariance_says(self, truth):
        ratios = []
        for seed in range(12):
            found = calibrate(click(truth, 1.0, seed), PITCH, SIZE, POLICY)
            spread = np.array(found.covariance).reshape(8, 8)[3:6, 3:6]
            off = found.camera.position - truth.position
            ratios.append(off @ np.linalg.solve(spread, off))
        # Chi-squared with three degrees of freedom has median 2.4.
        assert 0.8 < np.median(ratios) < 6.0

    def test_the_same_lines_give_the_same_bits(self):
        lines = click(MAIN, 1.0)
        first, second = (calibrate(lines, PITCH, SIZE, POLICY) for _ in range(2))
        assert first == second

    def test_noise_of_a_pixel_keeps_every_marking_found(self):
        found = calibrate(click(MAIN, 0.8, seed=4), PITCH, SIZE, POLICY)
        assert found.jac[0] > 0.9

    def test_the_circle_alone_is_not_enough_and_that_is_said(self):
        lines = click(looking((0.0, 60.0, -15.0), (0.0, 0.0, 0.0), 2200.0, bend=BEND))
        few = {name: lines[name] for name in ("Circle central",)}
        found = calibrate(make_lines(few), PITCH, SIZE, POLICY)
        assert found.camera is None
        assert found.reason == ("1 marking gives 5 independent measurements, a camera needs 7")

    @pytest.mark.parametrize("spread_px", [0.0, 1e-6])
    def test_points_at_one_place_give_no_camera_however_many_lines_they_are_said_of(
        self, spread_px
    ):
        rng = np.random.default_rng(1)
        lines = {
            name: rng.normal((480.0, 270.0), spread_px, (len(points), 2))
            for name, points in click(MAIN).items()
        }
        found = calibrate(make_lines(lines), PITCH, SIZE, POLICY)
        assert found.camera is None
        assert f"{len(lines)} markings give 2 independent measurements" in found.reason

    def test_parallel_lines_leave_the_camera_open_and_that_is_said(self):
        # Four lines along y, each clicked in its middle: nothing says how far away y is.
        names = ("Big rect. right main", "Small rect. right main", "Side line right", "Middle line")
        wide = looking((3.0, 62.0, -16.0), (30.0, 0.0, 0.0), 700.0, bend=BEND)
        middle = {name: wide.project(PITCH.sample(name, 0.5, 0.5)[12:24:4]) for name in names}
        found = calibrate(make_lines(middle), PITCH, SIZE, POLICY)
        assert "position" in found.unobservable

    def test_no_lines_at_all_give_no_camera(self):
        assert calibrate({}, PITCH, SIZE, POLICY).camera is None


class TestWrongLabels:
    @pytest.mark.parametrize(
        ("marking", "wrong"),
        [
            ("Big rect. right top", "Big rect. left top"),
            ("Small rect. right bottom", "Small rect. left bottom"),
            ("Circle right", "Circle left"),
            ("Goal right post left", "Goal left post left"),
        ],
    )
    def test_a_wrong_label_is_left_out_and_the_right_one_proposed(self, marking, wrong):
        lines = relabel(click(MAIN, 0.7), marking, wrong)
        found = calibrate(lines, PITCH, SIZE, POLICY)
        assert [(item.marking, item.suggested) for item in found.suspects] == [(wrong, marking)]
        assert np.linalg.norm(found.camera.position - MAIN.position) < 1.5
        assert found.suspects[0].confidence > 0.9

    def test_two_swapped_posts_are_both_named(self):
        lines = click(MAIN, 0.5)
        left, right = "Goal right post left", "Goal right post right"
        swapped = make_lines({**lines, left: lines[right], right: lines[left]})
        found = calibrate(swapped, PITCH, SIZE, POLICY)
        assert {(item.marking, item.suggested) for item in found.suspects} == {
            (left, right),
            (right, left),
        }

    @pytest.mark.parametrize("seed", range(6))
    def test_clean_labels_raise_no_alarm(self, seed):
        assert calibrate(click(MAIN, 1.0, seed), PITCH, SIZE, POLICY).suspects == ()

    def test_labels_taken_as_given_are_not_doubted(self):
        lines = relabel(click(MAIN), "Circle right", "Circle left")
        trusting = replace(POLICY, check_labels=False)
        assert calibrate(lines, PITCH, SIZE, trusting).suspects == ()


class TestMirrored:
    @pytest.mark.parametrize("camera", [MAIN, BEHIND_GOAL], ids=["main", "behind goal"])
    def test_exchanged_sides_are_the_only_finding(self, camera):
        lines = {mirrored_marking(name): points for name, points in click(camera, 1.0).items()}
        found = calibrate(make_lines(lines), PITCH, SIZE, POLICY)
        (finding,) = find_calibration_findings(found, SIZE)
        assert finding.kind == "implausible_camera" and finding.number < finding.threshold
        assert "mirrored" in finding.sentence

    @pytest.mark.parametrize("camera", [MAIN, BEHIND_GOAL], ids=["main", "behind goal"])
    def test_lines_as_they_are_seen_are_not_mirrored(self, camera):
        assert calibrate(click(camera, 1.0), PITCH, SIZE, POLICY).mirrored_px is None

    def test_lines_at_random_are_not_mirrored_but_implausible(self):
        rng = np.random.default_rng(3)
        lines = {
            name: rng.uniform((0, 0), (959, 539), (len(points), 2))
            for name, points in click(MAIN).items()
        }
        found = calibrate(make_lines(lines), PITCH, SIZE, POLICY)
        assert found.mirrored_px is None


class TestCalibrateStation:
    def test_given_wins_over_lines_and_is_measured_with_them(self):
        station = Station("cam1", SIZE, lines=click(MAIN), given=MAIN)
        found = calibrate_station(station, PITCH, POLICY)
        assert found.source == "given"
        assert found.camera == MAIN
        assert found.jac[0] > 0.9

    def test_the_switch_makes_the_lines_win(self):
        station = Station("cam1", SIZE, lines=click(MAIN), given=OPPOSITE, calibration="lines")
        found = calibrate_station(station, PITCH, POLICY)
        assert found.source == "lines"
        assert np.linalg.norm(found.camera.position - MAIN.position) < 0.1

    def test_given_without_lines_has_no_jac(self):
        found = calibrate_station(Station("cam1", SIZE, given=MAIN), PITCH, POLICY)
        assert found.jac is None
        assert found.markings  # the projection is shown all the same

    def test_what_is_known_of_a_given_camera_is_known_of_its_calibration(self):
        station = Station("cam1", SIZE, given=MAIN, given_covariance=(0.25,) * 64)
        found = calibrate_station(station, PITCH, POLICY)
        assert (found.source, found.covariance) == ("given", (0.25,) * 64)


class TestCalibrationKey:
    def test_names_all_that_is_read(self):
        station = Station("7.png", SIZE, lines=click(MAIN), given=MAIN)
        key = compute_calibration_key(station, PITCH, POLICY)
        others = [
            compute_calibration_key(replace(station, lines=click(MAIN, 0.1)), PITCH, POLICY),
            compute_calibration_key(replace(station, given=OPPOSITE), PITCH, POLICY),
            compute_calibration_key(replace(station, calibration="lines"), PITCH, POLICY),
            compute_calibration_key(replace(station, given_covariance=(0.25,) * 64), PITCH, POLICY),
            compute_calibration_key(station, Pitch(104.0), POLICY),
            compute_calibration_key(station, PITCH, replace(POLICY, robust_scale_px=3.0)),
        ]
        assert len({key, *others}) == 7

    def test_knows_the_noise_of_lines_only_where_lines_make_the_camera(self):
        noisy = [replace(POLICY, line_sigma_px=1.4), replace(POLICY, line_share=0.6)]
        clicked = Station("7.png", SIZE, lines=click(MAIN))
        given = replace(clicked, given=MAIN, calibration="given")
        assert (
            len({compute_calibration_key(clicked, PITCH, policy) for policy in (POLICY, *noisy)})
            == 3
        )
        assert (
            len({compute_calibration_key(given, PITCH, policy) for policy in (POLICY, *noisy)}) == 1
        )

    def test_does_not_depend_on_the_name_or_the_order_of_lines(self):
        lines = click(MAIN)
        station = Station("7.png", SIZE, lines=lines)
        other = Station("8.png", SIZE, lines=dict(reversed(list(lines.items()))))
        assert compute_calibration_key(station, PITCH, POLICY) == compute_calibration_key(
            other, PITCH, POLICY
        )


def station_of(lines, **said) -> Station:
    return Station("main", SIZE, lines=lines, **said)


class TestNotMissing:
    """Markings that nobody drew, and that JaC counts or not."""

    @staticmethod
    def short(lines) -> tuple[str, float]:
        """A drawn marking, and its length in the picture at 960 x 540."""
        whole = calibrate_station(station_of(lines), PITCH, POLICY)
        unit = SIZE.diagonal / np.hypot(960, 540)
        fit = min(whole.markings, key=lambda fit: fit.length_px)
        return fit.marking, fit.length_px / unit

    def test_what_is_said_not_to_be_visible_is_not_missing(self):
        lines = click(MAIN)
        name = min(lines)
        rest = {marking: points for marking, points in lines.items() if marking != name}
        missed = calibrate_station(station_of(rest), PITCH, POLICY)
        said = calibrate_station(station_of(rest, not_visible=(name,)), PITCH, POLICY)
        count = len(missed.markings)
        assert missed.jac[0] == pytest.approx((count - 1) / count) and said.jac[0] == 1.0
        assert (said.camera, said.covariance) == (missed.camera, missed.covariance)
        assert name not in {fit.marking for fit in said.markings}

    def test_what_is_drawn_counts_whatever_is_said(self):
        lines = {**click(MAIN)}
        name = min(lines)
        lines[name] = tuple(replace_point(point, 90.0) for point in lines[name])
        policy = CalibrationPolicy(check_labels=False)
        found = calibrate_station(station_of(lines, not_visible=(name,)), PITCH, policy)
        assert {fit.marking: fit.outcome for fit in found.markings}[name] == "fp"

    def test_a_stub_shorter_than_the_policy_says_is_not_missing(self):
        lines = click(MAIN)
        name, length = self.short(lines)
        rest = {marking: points for marking, points in lines.items() if marking != name}
        jacs = [
            calibrate_station(
                station_of(rest), PITCH, CalibrationPolicy(shortest_marking_px=shortest)
            ).jac[0]
            for shortest in (0.0, 0.9 * length, 1.1 * length)
        ]
        assert jacs[0] == jacs[1] < 1.0 == jacs[2]

    @pytest.mark.parametrize(
        ("name", "shortest"), [("paper", 0.0), ("strict", 0.0), ("touchline", 5.0)]
    )
    def test_curation_leaves_stubs_out_and_the_paper_counts_as_the_public_evaluator(
        self, name, shortest
    ):
        assert POLICIES[name].calibration.shortest_marking_px == shortest

    def test_the_key_knows_both_and_is_as_ever_without(self):
        plain = station_of(click(MAIN))
        hidden = replace(plain, not_visible=("Circle left",))
        short = CalibrationPolicy(shortest_marking_px=5.0)
        keys = {
            compute_calibration_key(plain, PITCH, POLICY),
            compute_calibration_key(hidden, PITCH, POLICY),
            compute_calibration_key(plain, PITCH, short),
        }
        assert len(keys) == 3


def replace_point(point, down: float):
    return point._replace(y=point.y + down)


class TestGoals:
    """People click the middle of posts and bars; JaC asks for their inner edges."""

    NEAR = looking((40.0, -30.0, -9.0), (50.0, 2.0, 0.0), 2200.0, bend=BEND)
    """So near that 6 cm of a goal are several pixels."""
    LINES = click(NEAR, pitch=PITCH.with_goal_edge("middle"))

    def errors(self, policy):
        fits = calibrate(self.LINES, PITCH, SIZE, policy).markings
        return [max(fit.distances_px) for fit in fits if fit.marking in GOAL_PARTS]

    def test_the_middle_is_fitted_where_the_policy_says_so(self):
        assert len(self.errors(CLICKED)) == 3
        assert max(self.errors(CLICKED)) < 0.3
        assert max(self.errors(POLICY)) > 1.5
        off = [
            np.linalg.norm(
                calibrate(self.LINES, PITCH, SIZE, one).camera.position - self.NEAR.position
            )
            for one in (CLICKED, POLICY)
        ]
        assert off[0] < 0.05 < off[1]

    @pytest.mark.parametrize("policy", [POLICY, CLICKED], ids=["inner", "middle"])
    def test_jac_is_that_of_the_evaluator_whatever_is_fitted(self, policy):
        found = calibrate(self.LINES, PITCH, SIZE, policy)
        gammas = tuple(gamma / 100 * SIZE.diagonal for gamma in (0.5, 1.0, 2.0))
        for pitch in (PITCH, PITCH.with_goal_edge("middle")):
            assert found.jac == camera_jaccard(found.camera, self.LINES, pitch, SIZE, gammas)

    def test_lines_of_a_pitch_by_the_laws_are_fitted_where_the_policy_says_so(self):
        laws = replace(CLICKED, goal="laws")
        lines = click(self.NEAR, pitch=PITCH.with_goal_edge("laws"))
        found = calibrate(lines, PITCH, SIZE, laws)
        assert found.goal == "laws" and found.error_px < 0.05
        off = [
            np.linalg.norm(calibrate(lines, PITCH, SIZE, one).camera.position - self.NEAR.position)
            for one in (laws, CLICKED)
        ]
        assert off[0] < 0.05 < off[1]
        gammas = tuple(gamma / 100 * SIZE.diagonal for gamma in (0.05, 0.5, 1.0))
        of_the_plan = camera_jaccard(found.camera, lines, PITCH, SIZE, gammas)
        assert of_the_plan[0] < 0.8 and of_the_plan[1:] == found.jac[:2]

    def test_near_goals_do_not_fit_the_evaluator_though_they_fit_the_camera(self):
        # From here 6 cm of a goal are farther apart than the smallest gamma.
        closer = looking((45.0, -12.0, -4.0), (52.5, 0.0, -1.2), 3500.0)
        lines = click(closer, pitch=PITCH.with_goal_edge("middle"))
        found = calibrate_station(Station("a", SIZE, lines=lines, given=closer), PITCH, CLICKED)
        goals = [fit for fit in found.markings if fit.marking in GOAL_PARTS and fit.distances_px]
        assert "fp" in {fit.outcome for fit in goals}
        assert max(fit.largest_px for fit in goals) < 0.1
        assert found.goal == "middle"

    def test_the_gate_counts_as_jac_does_where_the_evaluator_sees_another_goal(self):
        closer = looking((45.0, -12.0, -4.0), (52.5, 0.0, -1.2), 3500.0)
        lines = click(closer, pitch=PITCH.with_goal_edge("middle"))
        station = Station("a", SIZE, lines=lines, given=closer)
        found = calibrate_station(station, PITCH, CLICKED)
        assert found.jac is not None and found.jac[0] < 1 == max(found.jac)
        facts = collect_facts_of_views([View("a", station, ())], [found])
        counted = [compute_view_jac(facts, gamma).tolist() for gamma in (0.5, 1.0, 2.0)]
        assert counted == [[jac] for jac in found.jac]

    def test_a_goal_that_the_evaluator_does_not_see_is_missed_by_the_gate_too(self):
        bar = "Goal right crossbar"
        closer = looking((37.0, 0.0, -4.0), (52.5, 0.0, -1.2), 1500.0)
        clicked = PITCH.with_goal_edge("middle")
        rows = [project_markings(closer, pitch, SIZE)[bar][:, 1] for pitch in (clicked, PITCH)]
        # The picture ends between the middle of the bar and its lower edge.
        size = ImageSize(SIZE.width, int(min(rows[1])))
        assert min(rows[0]) < size.height - 1
        inside = [p for p in click(closer, pitch=clicked)[bar] if p.y < size.height]
        station = Station("a", size, lines=make_lines({bar: inside}), given=closer)
        found = calibrate_station(station, PITCH, CLICKED)
        (missed,) = [fit for fit in found.markings if fit.marking == bar]
        assert (missed.outcome, missed.judged_px) == ("fn", np.inf) and missed.distances_px
        facts = collect_facts_of_views([View("a", station, ())], [found])
        assert compute_view_jac(facts, 0.5).tolist() == [found.jac[0]]
        assert from_json(Calibration, json.loads(solution_json_text(to_json(found)))) == found

    def test_a_left_out_marking_is_predicted_by_what_is_fitted(self):
        name = "Small rect. right main"
        middle, inner = (
            measure_error_without_marking(self.LINES, name, PITCH, SIZE, one)
            for one in (CLICKED, POLICY)
        )
        assert middle < 0.3 < inner
        post = "Goal right post left"
        assert measure_error_without_marking(self.LINES, post, PITCH, SIZE, CLICKED) < 0.3

    def test_its_key_is_its_own(self):
        station = Station("a", SIZE, lines=self.LINES)
        keys = {compute_calibration_key(station, PITCH, one) for one in (POLICY, CLICKED)}
        assert len(keys) == 2
