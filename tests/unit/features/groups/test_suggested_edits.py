from dataclasses import replace

import pytest

from app.features.groups.suggested_edits import (
    FixGuide,
    describe_condition,
    edit_of_fix,
    find_guide_of_finding,
    find_guide_of_fix,
    list_edits_of_finding,
    list_edits_of_fix,
    rank_of_fix,
)
from app.soccer.annotation import BallAnnotation
from app.soccer.finding import Finding, SuggestedFix
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Station, View
from tests.cameras import SIZE
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
        after = self.lines(SuggestedFix("relabel", "a", first, second))
        assert first not in after
        assert len(after[second]) == len(before[first]) + len(before[second])

    def test_a_dropped_point_leaves_the_others(self):
        before = GROUP.views[0].station.lines[MARKING]
        assert list(self.lines(SuggestedFix("drop_point", "a", MARKING, index=1))[MARKING]) == [
            point for index, point in enumerate(before) if index != 1
        ]

    def test_a_moved_point_leaves_the_others(self):
        before = GROUP.views[0].station.lines[MARKING]
        after = self.lines(SuggestedFix("move_point", "a", MARKING, index=0), ImagePoint(1.0, 2.0))[
            MARKING
        ]
        assert list(after) == [(1.0, 2.0), *before[1:]]

    def test_a_dropped_marking_is_gone(self):
        assert MARKING not in self.lines(SuggestedFix("drop_marking", "a", MARKING))

    def test_swapping_sides_twice_changes_nothing(self):
        fix = SuggestedFix("swap_sides", "a")
        once = edit_of_fix(GROUP, fix).apply(GROUP)
        assert edit_of_fix(once, fix).apply(once) == GROUP

    @pytest.mark.parametrize(
        "fix",
        [
            SuggestedFix("drop_point", "a", "Circle left", index=900),
            SuggestedFix("drop_marking", "nowhere", "Circle left"),
            SuggestedFix("pick_ball", "a", index=4),
            SuggestedFix("draw_marking", "a", "Circle left"),
            SuggestedFix("read_paint", "a"),
            SuggestedFix("look_ball", "a", to="b"),
        ],
    )
    def test_a_marking_that_is_gone_cannot_be_mended(self, fix):
        assert edit_of_fix(GROUP, fix) is None


class TestOffers:
    @pytest.mark.parametrize(
        ("fix", "label"),
        [
            (SuggestedFix("relabel", "a", MARKING, to="Side line top"), "Relabel as Side line top"),
            (SuggestedFix("swap_sides", "a"), "Swap left and right"),
            (SuggestedFix("pick_ball", "a", index=0), "Keep ball 1"),
            (SuggestedFix("drop_point", "a", MARKING, index=0), "Delete the point"),
            (SuggestedFix("drop_marking", "a", MARKING), "Delete the line"),
            (SuggestedFix("include_view", "a"), "Include it again"),
            (SuggestedFix("exclude_view", "a"), "Leave it out"),
            (SuggestedFix("free_picture", "a"), "Use this geometry"),
        ],
    )
    def test_say_what_the_button_does(self, fix, label):
        (offer,) = list_edits_of_fix(GROUP, fix)
        assert (offer.label, offer.edit) == (label, edit_of_fix(GROUP, fix))

    @pytest.mark.parametrize(
        ("fix", "caption"),
        [
            (
                SuggestedFix("relabel", "a", MARKING, to="Side line top"),
                f"{MARKING} → Side line top",
            ),
            (SuggestedFix("swap_sides", "a"), "Left and right swapped?"),
            (SuggestedFix("drop_point", "a", MARKING, index=0), f"point 1 of {MARKING}"),
            (SuggestedFix("drop_marking", "a", MARKING), f"{MARKING}: fits no line"),
            (SuggestedFix("exclude_view", "a"), ""),
        ],
    )
    def test_say_what_stands_beside_the_change_in_the_picture(self, fix, caption):
        assert [offer.caption for offer in list_edits_of_fix(GROUP, fix)] == [caption]

    def test_of_several_balls_each_that_is_seen_can_be_kept(self):
        first = GROUP.views[0]
        hidden, other = BallAnnotation(out_of_view=True), BallAnnotation(point=ImagePoint(5, 6))
        several = GROUP.with_view(replace(first, balls=(hidden, *first.balls, other)))
        found = list_edits_of_fix(several, SuggestedFix("pick_ball", "a"))
        assert [offer.label for offer in found] == ["Keep ball 2", "Keep ball 3"]
        assert [offer.edit.balls[0] for offer in found] == [*first.balls, other]
        assert edit_of_fix(several, SuggestedFix("pick_ball", "a")) is None

    def test_where_one_ball_is_left_there_is_none_to_pick(self):
        assert list_edits_of_fix(GROUP, SuggestedFix("pick_ball", "a")) == ()

    def test_a_finding_without_a_fix_offers_no_edit(self):
        assert (
            list_edits_of_fix(GROUP, None)
            == list_edits_of_fix(GROUP, SuggestedFix("swap_sides"))
            == ()
        )


class TestGuide:
    def test_says_which_marking_to_draw(self):
        assert find_guide_of_fix(SuggestedFix("draw_marking", "a", MARKING)) == FixGuide(
            "Draw it", draws=MARKING
        )

    def test_says_where_to_look_for_the_ball(self):
        place = ImagePoint(5.0, 6.0)
        found = find_guide_of_fix(SuggestedFix("look_ball", "a", to="b"), place)
        assert found == FixGuide("Show the place", "is the ball here?", looks=place)

    def test_says_that_the_picture_is_to_be_read(self):
        assert find_guide_of_fix(SuggestedFix("read_paint", "a")) == FixGuide(
            "Read its paint", reads=True
        )

    def test_where_an_edit_mends_nobody_is_led_anywhere(self):
        assert find_guide_of_fix(SuggestedFix("swap_sides", "a")) is None
        assert find_guide_of_fix(None) is None


class TestOffersOfFinding:
    def test_a_ball_of_odd_size_gets_the_box_that_it_has_at_its_distance(self):
        first = GROUP.views[0]
        large = replace(first.ball, point=None, box=Box(10.0, 20.0, 34.0, 30.0))
        found = Finding("ball_size", "", "a", number=4.0)
        (offer,) = list_edits_of_finding(GROUP.with_view(replace(first, balls=(large,))), found)
        assert (offer.label, offer.edit.balls[0].box) == ("Fit the box", Box(23.0, 31.0, 8.0, 8.0))

    def test_a_ball_without_a_box_has_none_to_fit(self):
        first = GROUP.views[0]
        alone = BallAnnotation(point=ImagePoint(5.0, 6.0))
        group = GROUP.with_view(replace(first, balls=(alone,)))
        assert list_edits_of_finding(group, Finding("ball_size", "", "a", number=4.0)) == ()

    def test_any_other_offers_what_its_fix_offers(self):
        fix = SuggestedFix("swap_sides", "a")
        assert list_edits_of_finding(
            GROUP, Finding("sides_swapped", "", "a", fix=fix)
        ) == list_edits_of_fix(GROUP, fix)


class TestGuideOfFinding:
    def test_a_visible_marking_that_nobody_drew_is_to_be_drawn(self):
        found = Finding("visible_not_annotated", "", "a", MARKING)
        assert find_guide_of_finding(found) == find_guide_of_fix(
            SuggestedFix("draw_marking", "a", MARKING)
        )

    def test_any_other_leads_where_its_fix_leads(self):
        found = Finding("no_paint", "", "a", fix=SuggestedFix("read_paint", "a"))
        assert find_guide_of_finding(found) == find_guide_of_fix(found.fix)
        assert find_guide_of_finding(Finding("low_parallax", "")) is None


class TestSentence:
    def test_names_the_view_by_its_letter_and_a_point_by_its_number(self):
        dropped = SuggestedFix("drop_point", "b", "Middle line", index=1)
        assert describe_condition(GROUP, dropped) == "point 2 of Middle line in B was deleted"
        moved = describe_condition(GROUP, replace(dropped, action="move_point"), 3.14159)
        assert moved == "point 2 of Middle line in B moved 3.1 px"

    def test_names_the_27th_view_as_the_gates_do(self):
        many = Group("g", tuple(View(f"{n}", Station(f"{n}", SIZE)) for n in range(27)))
        assert describe_condition(many, SuggestedFix("exclude_view", "26")).startswith("V27 ")


class TestRank:
    def test_mending_comes_before_leaving_out(self):
        actions = ("relabel", "move_point", "include_view", "drop_point", "drop_marking")
        ranks = [rank_of_fix(SuggestedFix(action)) for action in (*actions, "exclude_view")]
        assert ranks == sorted(set(ranks))
