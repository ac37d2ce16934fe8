from dataclasses import replace

import numpy as np

from app.features.groups import suggestions as remedies
from app.features.groups.suggested_edits import edit_of_fix, measure_marking_influences
from app.features.groups.suggestions import find_suggestions
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.frames import ImagePoint
from app.soccer.group import Media
from app.soccer.paint_evidence import PaintReading
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.soccer.solution import SuspectLabel
from app.solving.calibrate import compute_paint_search_key
from app.solving.solve import solve_group
from tests.cameras import SIZE
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, group, view
from tests.unit.solving.test_paint_camera import painted

BALL = (36.0, 3.0, -0.5)


def spoilt(of, markings=4, pixels=40.0):
    """A view in which one point of each of some markings was put somewhere else."""
    lines = {name: list(points) for name, points in of.station.lines.items()}
    for name in sorted(lines)[:markings]:
        x, y = lines[name][1]
        lines[name][1] = ImagePoint(x + pixels, y + pixels)
    return replace(of, station=replace(of.station, lines=make_lines(lines)))


class TestFindRemedies:
    def test_a_group_that_passes_needs_none(self):
        good = group(view("a", MAIN, BALL), view("b", BEHIND_GOAL, BALL))
        solution = solve_group(good, PAPER)
        assert solution.passes
        assert find_suggestions(good, PAPER, solution) == []

    def bad_point(self):
        """A group that one bad point keeps from passing, and the policy that asks for more."""
        good = group(view("a", MAIN, BALL), view("b", BEHIND_GOAL, BALL))
        clean = min(found.calibration.jac[0] for found in solve_group(good, PAPER).views)
        bad = good.with_view(spoilt(good.views[1], markings=1))
        return bad, replace(PAPER, min_jac=clean - 0.01)

    def test_what_would_make_it_pass_does_so_when_it_is_done(self):
        bad, policy = self.bad_point()
        solution = solve_group(bad, policy)
        assert solution.first_failing.name == "jac"
        remedies = find_suggestions(bad, policy, solution)
        assert remedies[0].passes
        assert remedies[0].fix.action == "move_point"
        for remedy in remedies:
            if remedy.fix.action == "draw_marking":
                continue
            edited = edit_of_fix(bad, remedy.fix, remedy.point).apply(bad)
            assert solve_group(edited, policy).passes == remedy.passes

    def test_the_sentence_names_the_point_and_how_far_it_moves(self):
        bad, policy = self.bad_point()
        best = find_suggestions(bad, policy, solve_group(bad, policy))[0]
        marking = sorted(bad.views[1].station.lines)[0]
        assert best.sentence.startswith(f"point 2 of {marking} in B moved ")

    def with_ball_off(self, pixels):
        off = view("b", BEHIND_GOAL, BALL)
        box = off.balls[0].box
        off = replace(off, balls=(BallAnnotation(box=replace(box, y=box.y + pixels)),))
        return group(view("a", MAIN, BALL), off)

    def test_a_ball_beside_the_other_views_ray_is_looked_for_on_it(self):
        bad = self.with_ball_off(38.0)
        solution = solve_group(bad, PAPER)
        assert solution.first_failing.name == "reprojection"
        remedies = find_suggestions(bad, PAPER, solution)
        assert remedies
        assert {remedy.fix.action for remedy in remedies} == {"look_ball"}
        assert all(remedy.passes for remedy in remedies)

    def test_no_remedy_puts_a_ball_onto_the_ray_that_would_then_confirm_it(self):
        bad = self.with_ball_off(40.0)
        (remedy,) = find_suggestions(bad, PAPER, solve_group(bad, PAPER))
        assert (remedy.fix.action, remedy.passes) == ("look_ball", True)
        assert edit_of_fix(bad, remedy.fix, remedy.point) is None

    def test_no_ball_is_looked_for_farther_off_than_a_hand_slips(self):
        bad = self.with_ball_off(440.0)
        solution = solve_group(bad, PAPER)
        assert solution.first_failing.name == "reprojection"
        assert find_suggestions(bad, PAPER, solution) == []

    def test_no_ball_is_looked_for_where_a_better_cause_is_known(self):
        bad = self.with_ball_off(40.0)
        solution = solve_group(bad, PAPER)
        swapped = Finding(
            "sides_swapped", "Left is right.", "b", fix=SuggestedFix("swap_sides", "b")
        )
        known = replace(solution, findings=(swapped,))
        actions = {remedy.fix.action for remedy in find_suggestions(bad, PAPER, known)}
        assert "look_ball" not in actions

    def undrawn(self):
        """A group whose second view lacks drawn lines, and a policy that asks for them."""
        good = group(view("a", MAIN, BALL), view("b", BEHIND_GOAL, BALL))
        clean = min(found.calibration.jac[0] for found in solve_group(good, PAPER).views)
        lines = dict(good.views[1].station.lines)
        missing = sorted(lines)[:2]
        for marking in missing:
            del lines[marking]
        station = replace(good.views[1].station, lines=make_lines(lines))
        bad = good.with_view(replace(good.views[1], station=station, media=Media("b.jpg")))
        return bad, replace(PAPER, min_jac=clean - 0.01), missing

    def test_lines_that_nobody_drew_are_named_as_what_keeps_a_view_from_passing(self):
        bad, policy, missing = self.undrawn()
        solution = solve_group(bad, policy)
        assert solution.first_failing.name == "jac"
        best = find_suggestions(bad, policy, solution)[0]
        assert (best.fix.action, best.fix.view, best.passes) == ("draw_marking", "b", True)
        assert all(marking in best.sentence for marking in missing)
        assert "visible over" in best.sentence
        assert edit_of_fix(bad, best.fix) is None

    def test_nothing_is_to_be_drawn_where_there_is_no_picture(self):
        bad, policy, _ = self.undrawn()
        bare = bad.with_view(replace(bad.views[1], media=None))
        found = find_suggestions(bare, policy, solve_group(bare, policy))
        assert "draw_marking" not in {remedy.fix.action for remedy in found}

    def lengths(self, bad, policy):
        """Of the markings of the second view that nobody drew, pixels at 960 x 540."""
        unit = SIZE.diagonal / np.hypot(960, 540)
        fits = solve_group(bad, policy).view("b").calibration.markings
        return {fit.marking: fit.length_px / unit for fit in fits if not fit.distances_px}

    def test_where_all_are_stubs_they_are_marked_as_not_visible_and_not_drawn(self, monkeypatch):
        """Two clicks anywhere on a stub of a pixel would pass as well."""
        bad, policy, missing = self.undrawn()
        monkeypatch.setattr(remedies, "STUB_PX", 2000.0)
        found = find_suggestions(bad, policy, solve_group(bad, policy))
        hides = [remedy for remedy in found if remedy.fix.action == "hide_marking"]
        hidden = sorted(remedy.fix.marking for remedy in hides)
        assert hidden == sorted(self.lengths(bad, policy)) and {*missing} <= {*hidden}
        assert "draw_marking" not in {remedy.fix.action for remedy in found}
        assert "was marked as not visible" in hides[0].sentence
        marked = bad
        for remedy in hides:
            (offer,) = remedy.offers
            marked = offer.edit.apply(marked)
        assert list(marked.views[1].station.not_visible) == hidden
        assert solve_group(marked, policy).passes

    def test_stubs_are_those_of_less_than_five_pixels(self):
        bad, policy, _ = self.undrawn()
        found = find_suggestions(bad, policy, solve_group(bad, policy))
        hidden = {one.fix.marking for one in found if one.fix.action == "hide_marking"}
        short = {name for name, length in self.lengths(bad, policy).items() if length < 5.0}
        assert hidden == short != set()
        assert "draw_marking" in {one.fix.action for one in found}

    def test_a_line_that_is_there_under_a_wrong_name_is_not_to_be_drawn_again(self):
        bad, policy, missing = self.undrawn()
        solution = solve_group(bad, policy)
        seen = solution.view("b")
        suspects = tuple(SuspectLabel("Middle line", name, 0.9, 50.0) for name in missing)
        doubted = replace(seen, calibration=replace(seen.calibration, suspects=suspects))
        views = tuple(doubted if one is seen else one for one in solution.views)
        remedies = find_suggestions(bad, policy, replace(solution, views=views))
        sentences = " ".join(remedy.sentence for remedy in remedies)
        assert not any(f"{marking} (visible" in sentences for marking in missing)

    def test_what_the_edges_in_use_do_not_show_is_not_to_be_drawn(self, monkeypatch):
        """JaC counts the evaluator's edges: one that just reaches into the picture is missed."""
        bad, policy, missing = self.undrawn()
        solution = solve_group(bad, policy)
        look = remedies.project_markings

        def without(names):
            def project(*arguments):
                return {name: at for name, at in look(*arguments).items() if name not in names}

            monkeypatch.setattr(remedies, "project_markings", project)
            return [
                item.sentence
                for item in find_suggestions(bad, policy, solution)
                if item.fix.action == "draw_marking"
            ]

        (sentence,) = without(missing[:1])
        assert missing[0] not in sentence and missing[1] in sentence
        assert without(look(MAIN, Pitch(), SIZE) | look(BEHIND_GOAL, Pitch(), SIZE)) == []

    def test_a_view_that_was_left_out_can_be_used_again(self):
        good = group(view("a", MAIN, BALL), view("b", BEHIND_GOAL, BALL))
        bad = good.with_view(replace(good.views[1], included=False))
        solution = solve_group(bad, PAPER)
        assert solution.first_failing.name == "two_views"
        (remedy,) = find_suggestions(bad, PAPER, solution)
        assert (remedy.fix, remedy.passes) == (SuggestedFix("include_view", "b"), True)
        assert "B left out by a person" in solution.first_failing.sentence


class TestPaint:
    """The cameras come from the paint that was read for the lines as they are."""

    POLICY = replace(PAPER, calibration=replace(PAPER.calibration, source="paint"))

    def painted(self):
        bad, policy = TestFindRemedies().bad_point()
        policy = replace(policy, calibration=self.POLICY.calibration)
        seen = bad.views[1]
        key = compute_paint_search_key(bad, seen, policy.calibration)
        reading = PaintReading("f" * 32, key, painted(BEHIND_GOAL), None, 0.9, 0.8)
        return replace(bad, paint={seen.key: reading}), policy

    def test_no_edit_of_lines_is_said_to_make_it_pass_before_its_paint_is_read(self):
        bad, policy = self.painted()
        solution = solve_group(bad, policy)
        assert solution.views[1].calibration.source == "paint"
        assert solution.first_failing.name == "jac"
        found = find_suggestions(bad, policy, solution)
        drawn = [one for one in found if one.fix.action != "hide_marking"]
        assert {one.fix.action for one in drawn} >= {"move_point"}
        assert {(one.passes, one.value) for one in drawn} == {(False, None)}
        # What is said not to be visible moves no camera.
        assert any(one.passes for one in found)

    def test_an_edit_that_the_cameras_of_clicks_gain_nothing_by_is_no_suggestion(self):
        bad, policy = self.painted()
        found = find_suggestions(bad, policy, solve_group(bad, policy))
        clicked = replace(bad, paint={})
        alone = find_suggestions(clicked, policy, solve_group(clicked, policy))
        named = {(one.fix, one.point) for one in alone}
        assert {one.fix.marking for one in found} <= {fix.marking for fix, _ in named}


class TestInfluences:
    def test_each_marking_is_predicted_by_the_others(self):
        station = view("a", MAIN, BALL, noise_px=0.5).station
        found = measure_marking_influences(station, Pitch(), PAPER.calibration)
        assert [item.marking for item in found] == list(station.lines)
        predicted = [item.largest_px_without for item in found]
        assert np.median(predicted) < 4.0
        assert all(item.jac is not None and item.jac[0] > 0.9 for item in found)

    def test_a_bad_marking_is_the_one_without_which_the_view_fits(self):
        station = spoilt(view("a", MAIN, BALL), markings=1, pixels=60.0).station
        found = measure_marking_influences(
            station, Pitch(), replace(PAPER.calibration, check_labels=False)
        )
        marking = sorted(station.lines)[0]
        by_name = {item.marking: item for item in found}
        best = max(found, key=lambda item: item.jac_without[2])
        assert by_name[marking].largest_px_without > 40
        assert best.jac_without[2] >= by_name[marking].jac[2]

    def test_without_enough_left_there_is_no_camera(self):
        station = view("a", MAIN, BALL).station
        lines = {name: points[:2] for name, points in list(station.lines.items())[:4]}
        few = replace(station, lines=make_lines(lines))
        assert all(
            item.jac_without is None
            for item in measure_marking_influences(few, Pitch(), PAPER.calibration)
        )
