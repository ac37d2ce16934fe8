"""A practice group is judged against what was planted in it, not against the solver."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.features.groups.state import VerdictState
from app.features.practice.lessons import (
    CLEAN,
    LESSONS,
    WORDS,
    Feedback,
    judge_lesson,
    make_practice_match,
    make_practice_scenes,
)
from app.sample.faults import FaultPlan
from app.sample.scene import PRACTICE_KINDS, Scene
from app.sample.scenes import make_scene
from app.soccer.annotation import make_lines
from app.soccer.group import Group, View
from app.soccer.pitch import opposite_marking
from app.soccer.policy import PAPER
from app.solving.solve import solve_group

NONE = VerdictState()
ACCEPTED = VerdictState("accepted")
MENDABLE = ("wrong_label", "swapped_sides", "bad_point", "missing_ball", "undrawn_line")


def rejected(reason: str) -> VerdictState:
    return VerdictState("rejected", reason)


@pytest.fixture(scope="module")
def scenes() -> dict[str, Scene]:
    return dict(zip([lesson.kind for lesson in LESSONS], make_practice_scenes(), strict=True))


def mended(scene: Scene, kind: str) -> Group:
    """The group with the view as it was before the fault."""
    lesson = next(item for item in LESSONS if item.kind == kind)
    sound = make_scene(make_practice_match(), lesson.number, None).group
    return with_view(scene.group, sound.views[lesson.view])


def with_view(group: Group, view: View) -> Group:
    views = tuple(view if item.key == view.key else item for item in group.views)
    return replace(group, views=views)


def swapped(group: Group, key: str) -> Group:
    view = group.view(key)
    assert view is not None
    lines = {opposite_marking(name): points for name, points in view.station.lines.items()}
    return with_view(group, replace(view, station=replace(view.station, lines=make_lines(lines))))


def told(scene: Scene, group: Group, verdict: VerdictState) -> Feedback:
    return judge_lesson(scene.truth, group, verdict)


class TestWords:
    def test_every_kind_has_its_words(self):
        assert set(WORDS) == {CLEAN, *PRACTICE_KINDS}


class TestSoundGroup:
    def test_accepting_it_is_right(self, scenes: dict[str, Scene]):
        scene = scenes[CLEAN]
        said = told(scene, scene.group, ACCEPTED)
        assert said.state == "right"
        assert said.sentence is not None
        assert said.sentence.startswith("Right: ")

    def test_rejecting_it_is_wrong(self, scenes: dict[str, Scene]):
        scene = scenes[CLEAN]
        said = told(scene, scene.group, rejected("bad_field_lines"))
        assert said.state == "wrong"
        assert said.sentence is not None
        assert said.sentence.startswith("Look again: you rejected a good group.")

    def test_accepting_it_after_spoiling_it_is_wrong(self, scenes: dict[str, Scene]):
        scene = scenes[CLEAN]
        spoilt = swapped(scene.group, scene.group.views[1].key)
        assert told(scene, spoilt, ACCEPTED).state == "wrong"


class TestMendable:
    @pytest.mark.parametrize("kind", MENDABLE)
    def test_before_a_verdict_nothing_is_said(self, scenes: dict[str, Scene], kind: str):
        assert told(scenes[kind], scenes[kind].group, NONE) == Feedback("open")

    @pytest.mark.parametrize("kind", MENDABLE)
    def test_mending_it_is_noticed_before_the_verdict(self, scenes: dict[str, Scene], kind: str):
        assert told(scenes[kind], mended(scenes[kind], kind), NONE).state == "mended"

    @pytest.mark.parametrize("kind", MENDABLE)
    def test_mending_and_accepting_is_right(self, scenes: dict[str, Scene], kind: str):
        said = told(scenes[kind], mended(scenes[kind], kind), ACCEPTED)
        assert said.state == "right"
        assert said.best

    @pytest.mark.parametrize("kind", MENDABLE)
    def test_accepting_it_unmended_is_wrong(self, scenes: dict[str, Scene], kind: str):
        assert told(scenes[kind], scenes[kind].group, ACCEPTED).state == "wrong"

    @pytest.mark.parametrize("kind", MENDABLE)
    def test_rejecting_what_can_be_mended_is_wrong(self, scenes: dict[str, Scene], kind: str):
        said = told(scenes[kind], scenes[kind].group, rejected("bad_field_lines"))
        assert said.state == "wrong"

    def test_turning_the_sound_camera_round_does_not_count_as_mended(
        self, scenes: dict[str, Scene]
    ):
        scene = scenes["swapped_sides"]
        turned = swapped(scene.group, scene.group.views[0].key)
        said = told(scene, turned, NONE)
        assert said.state == "open"
        assert said.sentence is not None
        assert "view A was labelled correctly" in said.sentence
        # The solver sees two views that agree: only the truth knows better.
        assert told(scene, turned, ACCEPTED).state == "wrong"

    def test_a_ball_at_the_wrong_place_mends_nothing(self, scenes: dict[str, Scene]):
        scene = scenes["missing_ball"]
        group = mended(scene, "missing_ball")
        view = group.view(scene.truth.faults[0].view)
        assert view is not None
        ball = view.balls[0]
        assert ball.box is not None
        moved = replace(ball, box=replace(ball.box, x=ball.box.x + 60))
        said = told(scene, with_view(group, replace(view, balls=(moved,))), NONE)
        assert said.state == "open"

    def test_the_answer_names_the_view_by_its_letter(self, scenes: dict[str, Scene]):
        said = told(scenes["missing_ball"], scenes["missing_ball"].group, ACCEPTED)
        assert said.sentence is not None
        assert "in view B" in said.sentence


class TestRejectable:
    @pytest.mark.parametrize(
        ("kind", "reason"),
        [("not_synchronous", "not_same_instant"), ("tiny_baseline", "duplicate_view")],
    )
    def test_the_fitting_reason_is_right_another_nearly(
        self, scenes: dict[str, Scene], kind: str, reason: str
    ):
        scene = scenes[kind]
        assert told(scene, scene.group, rejected(reason)).state == "right"
        assert told(scene, scene.group, rejected("bad_calibration")).state == "almost"
        assert told(scene, scene.group, ACCEPTED).state == "wrong"

    def test_leaving_the_view_of_another_moment_out_is_right_where_two_others_remain(self):
        stage = make_practice_match()
        numbers = range(501, 560)
        made = (make_scene(stage, n, FaultPlan("not_synchronous", 1, 1)) for n in numbers)
        scene = next(item for item in made if len(item.group.views) == 3)
        view = scene.group.view(scene.truth.faults[0].view)
        assert view is not None
        without = with_view(scene.group, replace(view, included=False))
        assert told(scene, without, ACCEPTED).state == "right"


class TestVerdicts:
    def test_putting_a_group_off_is_nearly_right(self, scenes: dict[str, Scene]):
        scene = scenes["wrong_label"]
        assert told(scene, scene.group, VerdictState("deferred")).state == "almost"

    def test_a_verdict_on_an_earlier_state_counts_as_none(self, scenes: dict[str, Scene]):
        scene = scenes["wrong_label"]
        assert told(scene, scene.group, replace(ACCEPTED, stale=True)) == Feedback("open")


class TestOneOfTwoLines:
    def test_one_line_is_enough_where_the_card_then_says_that_the_group_passes(
        self, scenes: dict[str, Scene]
    ):
        scene = scenes["undrawn_line"]
        whole = mended(scene, "undrawn_line")
        for fault in scene.truth.faults:
            view, drawn = scene.group.view(fault.view), whole.view(fault.view)
            assert view is not None
            assert drawn is not None
            lines = {**view.station.lines, fault.marking: drawn.station.lines[fault.marking]}
            station = replace(view.station, lines=make_lines(lines))
            one = with_view(scene.group, replace(view, station=station))
            assert solve_group(one, PAPER).passes
            assert told(scene, one, NONE).state == "mended"
            assert told(scene, one, ACCEPTED).state == "right"
