from dataclasses import replace

import pytest

from app.review.editing.fixes import edit_of_fix, offers, rank, sentence
from app.soccer.annotation import BallAnnotation
from app.soccer.finding import Fix
from app.soccer.frames import ImagePoint
from tests.unit.solving.conftest import BEHIND_GOAL, MAIN, group, view

BALL = (36.0, 3.0, -0.5)
GROUP = group(view("a", MAIN, BALL), view("b", BEHIND_GOAL, BALL))
MARKING = sorted(GROUP.views[0].station.lines)[0]


class TestEditOfFix:
    def lines(self, fix, point=None):
        return edit_of_fix(GROUP, fix, point).apply(GROUP).views[0].station.lines

    def test_a_relabelled_marking_joins_the_points_that_are_there(self):
        before = GROUP.views[0].station.lines
        first, second = sorted(before)[:2]
        after = self.lines(Fix("relabel", "a", first, second))
        assert first not in after
        assert len(after[second]) == len(before[first]) + len(before[second])

    def test_a_dropped_point_leaves_the_others(self):
        before = GROUP.views[0].station.lines[MARKING]
        assert list(self.lines(Fix("drop_point", "a", MARKING, index=1))[MARKING]) == [
            point for index, point in enumerate(before) if index != 1
        ]

    def test_a_moved_point_leaves_the_others(self):
        before = GROUP.views[0].station.lines[MARKING]
        after = self.lines(Fix("move_point", "a", MARKING, index=0), ImagePoint(1.0, 2.0))[MARKING]
        assert list(after) == [(1.0, 2.0), *before[1:]]

    def test_a_dropped_marking_is_gone(self):
        assert MARKING not in self.lines(Fix("drop_marking", "a", MARKING))

    def test_swapping_sides_twice_changes_nothing(self):
        fix = Fix("swap_sides", "a")
        once = edit_of_fix(GROUP, fix).apply(GROUP)
        assert edit_of_fix(once, fix).apply(once) == GROUP

    @pytest.mark.parametrize(
        "fix",
        [
            Fix("drop_point", "a", "Circle left", index=900),
            Fix("drop_marking", "nowhere", "Circle left"),
            Fix("pick_ball", "a", index=4),
            Fix("draw_marking", "a", "Circle left"),
            Fix("read_paint", "a"),
            Fix("look_ball", "a", to="b"),
        ],
    )
    def test_a_marking_that_is_gone_cannot_be_mended(self, fix):
        assert edit_of_fix(GROUP, fix) is None


class TestOffers:
    @pytest.mark.parametrize(
        ("fix", "label"),
        [
            (Fix("relabel", "a", MARKING, to="Side line top"), "Relabel as Side line top"),
            (Fix("swap_sides", "a"), "Swap left and right"),
            (Fix("pick_ball", "a", index=0), "Keep ball 1"),
            (Fix("drop_point", "a", MARKING, index=0), "Drop the point"),
            (Fix("drop_marking", "a", MARKING), "Drop the line"),
            (Fix("include_view", "a"), "Use it again"),
            (Fix("exclude_view", "a"), "Leave it out"),
            (Fix("free_picture", "a"), "Solve it so"),
        ],
    )
    def test_say_what_the_button_does(self, fix, label):
        (offer,) = offers(GROUP, fix)
        assert (offer.label, offer.edit) == (label, edit_of_fix(GROUP, fix))

    def test_of_several_balls_each_that_is_seen_can_be_kept(self):
        first = GROUP.views[0]
        hidden, other = BallAnnotation(out_of_view=True), BallAnnotation(point=ImagePoint(5, 6))
        several = GROUP.with_view(replace(first, balls=(hidden, *first.balls, other)))
        found = offers(several, Fix("pick_ball", "a"))
        assert [offer.label for offer in found] == ["Keep ball 2", "Keep ball 3"]
        assert [offer.edit.ball for offer in found] == [*first.balls, other]
        assert edit_of_fix(several, Fix("pick_ball", "a")) is None

    def test_where_one_ball_is_left_there_is_none_to_pick(self):
        assert offers(GROUP, Fix("pick_ball", "a")) == ()

    def test_a_finding_without_a_fix_offers_no_edit(self):
        assert offers(GROUP, None) == offers(GROUP, Fix("swap_sides")) == ()


class TestSentence:
    def test_names_the_view_by_its_letter_and_a_point_by_its_number(self):
        dropped = Fix("drop_point", "b", "Middle line", index=1)
        assert sentence(GROUP, dropped) == "point 2 of Middle line in B was dropped"
        moved = sentence(GROUP, replace(dropped, action="move_point"), 3.14159)
        assert moved == "point 2 of Middle line in B moved 3.1 px"


class TestRank:
    def test_mending_comes_before_leaving_out(self):
        actions = ("relabel", "move_point", "include_view", "drop_point", "drop_marking")
        ranks = [rank(Fix(action)) for action in (*actions, "exclude_view")]
        assert ranks == sorted(set(ranks))
