"""Agreement limits: each thing in which two annotations may differ is told beyond its limit alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.agreement_limits import (
    MEASURES,
    AgreementLimits,
    Disagreement,
    Spread,
    find_disagreements,
    measure_spreads,
)
from app.evaluation.annotation_distance import (
    Ball3DDistance,
    BallDistance,
    GroupDistance,
    LineDistance,
    ViewDistance,
)

LIMITS, HERE = AgreementLimits(), Ball3DDistance(True, True)
ALIKE = ViewDistance("7.png", (True, True), (), BallDistance("seen", "seen"), (None, None), None)
MIDDLE, GOAL = "Middle line", "Goal left crossbar"


def told(
    view: ViewDistance = ALIKE,
    ball: Ball3DDistance = HERE,
    verdicts: tuple[str | None, str | None] = (None, None),
    limits: AgreementLimits = LIMITS,
) -> list[Disagreement]:
    return [*find_disagreements(GroupDistance((view,), ball), verdicts, limits)]


def balls(**measured: float) -> ViewDistance:
    return replace(ALIKE, ball=BallDistance("seen", "seen", **measured))


def line(px: float) -> ViewDistance:
    return replace(ALIKE, lines=(LineDistance(MIDDLE, None, px / 2, px),))


class TestLimits:
    """What lies at a limit agrees; what lies beyond is told with both numbers."""

    @pytest.mark.parametrize(
        ("make", "kind", "at", "beyond", "sentence"),
        [
            (line, "line_px", 5.0, 5.1, "Middle line lies up to 5.1 px apart"),
            (
                lambda px: balls(center_px=px),
                "ball_px",
                3.0,
                3.1,
                "the centres of the ball are 3.1 px apart",
            ),
            (
                lambda px: balls(diameter_px=px),
                "diameter_px",
                5.0,
                5.1,
                "the ball of annotation b is 5.1 px wider",
            ),
            (
                lambda px: balls(diameter_px=-px),
                "diameter_px",
                5.0,
                5.1,
                "the ball of annotation a is 5.1 px wider",
            ),
            (
                lambda jac: replace(ALIKE, jac=(0.9, jac)),
                "jac",
                0.7,
                0.69,
                "the camera of one annotation fits the lines of the other with JaC 0.69",
            ),
        ],
    )
    def test_of_a_view(self, make, kind: str, at: float, beyond: float, sentence: str) -> None:
        assert told(make(at)) == []
        (found,) = told(make(beyond))
        assert (found.kind, found.sentence, found.view) == (kind, sentence, "7.png")
        assert (found.value, found.limit) == (beyond, getattr(LIMITS, kind))
        assert found.marking == (MIDDLE if kind == "line_px" else None)

    @pytest.mark.parametrize(
        ("p_value", "why"),
        [
            (None, ""),
            (0.05, ", which both uncertainties explain"),
            (0.04, ", more than their uncertainties explain"),
        ],
    )
    def test_of_the_3d_balls(self, p_value: float | None, why: str) -> None:
        assert told(ball=Ball3DDistance(True, True, 0.5, p_value=p_value)) == []
        (found,) = told(ball=Ball3DDistance(True, True, 0.51, p_value=p_value))
        assert found.sentence == f"the 3D balls are 0.51 m apart{why}"
        assert (found.kind, found.view, found.value) == ("ball_m", None, 0.51)

    def test_of_markings_that_one_alone_drew(self) -> None:
        one, two = LineDistance(MIDDLE, "a"), LineDistance(GOAL, "b")
        assert told(replace(ALIKE, lines=(one,))) == []
        (found,) = told(replace(ALIKE, lines=(one, two)))
        assert (
            found.sentence
            == f"drawn by only one person: {MIDDLE} (annotation a), {GOAL} (annotation b)"
        )
        assert (found.kind, found.value, found.limit) == ("markings", 2.0, 1.0)


class TestStates:
    @pytest.mark.parametrize(("included", "who"), [((True, False), "a"), ((False, True), "b")])
    def test_who_left_a_view_in(self, included: tuple[bool, bool], who: str) -> None:
        (found,) = told(replace(ALIKE, included=included))
        assert (found.kind, found.sentence) == ("view", f"only annotation {who} uses the view")

    @pytest.mark.parametrize(
        ("states", "said"),
        [
            (("seen", "occluded"), "the ball is seen in annotation a, occluded in annotation b"),
            (
                ("none", "out_of_view"),
                "the ball is not annotated in annotation a, out of view in annotation b",
            ),
            (
                ("several", "seen"),
                "the ball is drawn several times in annotation a, seen in annotation b",
            ),
        ],
    )
    def test_what_each_says_of_the_ball(self, states: tuple[str, str], said: str) -> None:
        (found,) = told(replace(ALIKE, ball=BallDistance(*states)))
        assert (found.kind, found.sentence) == ("ball", said)

    @pytest.mark.parametrize(("there", "who"), [((True, False), "a"), ((False, True), "b")])
    def test_who_has_a_3d_ball(self, there: tuple[bool, bool], who: str) -> None:
        (found,) = told(ball=Ball3DDistance(*there))
        assert (found.kind, found.sentence) == (
            "ball_3d",
            f"only annotation {who} yields a 3D ball",
        )

    def test_verdicts_differ_where_both_are_given(self) -> None:
        (found,) = told(verdicts=("accepted", "rejected"))
        assert (found.kind, found.sentence) == (
            "verdict",
            "annotation a: accepted, annotation b: rejected",
        )
        assert told(verdicts=("accepted", None)) == told(verdicts=("deferred", "deferred")) == []


class TestOrder:
    def test_what_exceeds_its_limit_most_comes_first(self) -> None:
        view = replace(line(50.0), ball=BallDistance("seen", "seen", 9.0), jac=(0.1, None))
        found = told(view, verdicts=("accepted", "rejected"))
        assert [one.kind for one in found] == ["line_px", "jac", "ball_px", "verdict"]
        assert [one.weight for one in found] == pytest.approx([10.0, 7.0, 3.0, 2.0])


class TestSpreads:
    def test_each_measure_has_its_median_and_its_bad_end(self) -> None:
        views = tuple(
            replace(
                balls(center_px=float(px), diameter_px=-float(px)),
                lines=(LineDistance(MIDDLE, None, 1.0, float(px)), LineDistance(GOAL, "a")),
                jac=(px / 100, None),
                position_m=float(px),
            )
            for px in range(101)
        )
        found = measure_spreads([GroupDistance(views, Ball3DDistance(True, True, 0.25))])
        assert tuple(found) == MEASURES
        for name in ("line_px", "ball_px", "diameter_px", "position_m"):
            assert found[name] == Spread(101, 50.0, 95.0), name
        assert found["jac"] == Spread(101, pytest.approx(0.5), pytest.approx(0.05))
        assert found["ball_m"] == Spread(1, 0.25, 0.25)

    def test_of_nothing_there_is_none(self) -> None:
        assert set(measure_spreads([]).values()) == {Spread(0)}
