from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.evaluation.annotation_distance import (
    Ball3DDistance,
    BallDistance,
    GroupDistance,
    LineDistance,
    ViewDistance,
)
from app.evaluation.rater_agreement import (
    MEASURES,
    AgreementLimits,
    Disagreement,
    MedianAndTail,
    cohen_kappa,
    compute_medians_and_tails,
    find_disagreements,
    fleiss_kappa,
    krippendorff_alpha,
)

# Fleiss 1971, table 1: six psychiatrists, thirty patients, five diagnoses.
DIAGNOSES = [
    "444444",
    "222555",
    "233335",
    "555555",
    "222444",
    "113333",
    "333355",
    "113334",
    "114444",
    "555555",
    "144444",
    "124444",
    "222333",
    "144444",
    "224445",
    "333335",
    "111455",
    "111112",
    "224444",
    "133555",
    "555555",
    "244444",
    "224555",
    "114444",
    "144445",
    "222224",
    "111155",
    "224444",
    "133333",
    "555555",
]
# Krippendorff 2011, section C: "binary or nominal data, any number of observers, missing data".
CODERS = (
    ("*", "*", "*", "*", "*", "3", "4", "1", "2", "1", "1", "3", "3", "*", "3"),
    ("1", "*", "2", "1", "3", "3", "4", "3", "*", "*", "*", "*", "*", "*", "*"),
    ("*", "*", "2", "1", "3", "4", "4", "*", "2", "1", "1", "3", "3", "*", "4"),
)
JUDGEMENTS = st.lists(st.tuples(*[st.sampled_from("abc")] * 2), min_size=2, max_size=12)


class TestCohenKappa:
    def test_of_fifty_proposals_is_that_of_the_table(self) -> None:
        # 20 yes/yes, 5 yes/no, 10 no/yes, 15 no/no: p_o 0.7, p_e 0.5.
        pairs = [("y", "y")] * 20 + [("y", "n")] * 5 + [("n", "y")] * 10 + [("n", "n")] * 15
        found = cohen_kappa([a for a, _ in pairs], [b for _, b in pairs])
        assert found.value == pytest.approx(0.4)
        assert found.observed == pytest.approx(0.7)
        assert found.items == 50
        # Standard error sqrt(p_o (1 - p_o) / (N (1 - p_e)^2)) = 0.13 (Cohen 1960, eq. 7).
        assert found.low == pytest.approx(0.4 - 1.96 * 0.13, abs=0.05)
        assert found.high == pytest.approx(0.4 + 1.96 * 0.13, abs=0.05)

    def test_is_the_same_again(self) -> None:
        said = (list("aabbabab"), list("aabbabba"))
        assert cohen_kappa(*said) == cohen_kappa(*said)

    def test_of_people_who_said_one_thing_alone_is_unknown_and_not_perfect(self) -> None:
        found = cohen_kappa(["a"] * 5, ["a"] * 5)
        assert (found.value, found.low, found.observed) == (None, None, 1)

    def test_of_nothing_is_unknown(self) -> None:
        assert cohen_kappa([], []).value is None

    @settings(max_examples=25, deadline=None)
    @given(JUDGEMENTS)
    def test_does_not_ask_who_is_first_nor_what_the_categories_are_called(
        self, pairs: list[tuple[str, str]]
    ) -> None:
        first, second = [a for a, _ in pairs], [b for _, b in pairs]
        value = cohen_kappa(first, second).value
        assert cohen_kappa(second, first).value == pytest.approx(value)
        names = {"a": 7, "b": 1, "c": 4}
        renamed = cohen_kappa([names[a] for a in first], [names[b] for b in second])
        assert renamed.value == pytest.approx(value)


class TestFleissKappa:
    def test_of_the_thirty_patients_is_the_published_one(self) -> None:
        found = fleiss_kappa(DIAGNOSES)
        assert found.value == pytest.approx(0.430, abs=5e-4)
        assert found.observed == pytest.approx(0.5556, abs=5e-4)
        assert found.low is not None and found.high is not None
        assert 0.3 < found.low < 0.43 < found.high < 0.6

    def test_asks_for_as_many_judgements_of_each(self) -> None:
        with pytest.raises(ValueError, match="same number"):
            fleiss_kappa(["aab", "ab"])


class TestKrippendorffAlpha:
    def test_with_missing_judgements_is_the_published_one(self) -> None:
        items = [
            [None if said == "*" else said for said in item] for item in zip(*CODERS, strict=True)
        ]
        found = krippendorff_alpha(items)
        assert found.value == pytest.approx(0.691, abs=5e-4)
        # Of fifteen items three were judged by fewer than two.
        assert found.items == 12

    def test_nears_fleiss_where_nothing_is_missing(self) -> None:
        # They differ by the pairs of a judgement with itself, 1 / (N m) of the disagreement.
        fleiss, alpha = fleiss_kappa(DIAGNOSES).value, krippendorff_alpha(DIAGNOSES).value
        assert fleiss is not None and alpha is not None
        assert alpha == pytest.approx(1 - (1 - fleiss) * (1 - 1 / 180))

    def test_of_people_who_throw_dice_is_about_nothing(self) -> None:
        thrown = np.random.default_rng(5).integers(0, 4, (2000, 3))
        found = krippendorff_alpha(thrown.tolist())
        assert found.value == pytest.approx(0, abs=0.04)
        assert found.low is not None and found.high is not None
        assert found.low < 0 < found.high


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
        assert [one.severity for one in found] == pytest.approx([10.0, 7.0, 3.0, 2.0])


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
        found = compute_medians_and_tails([GroupDistance(views, Ball3DDistance(True, True, 0.25))])
        assert tuple(found) == MEASURES
        for name in ("line_px", "ball_px", "diameter_px", "position_m"):
            assert found[name] == MedianAndTail(101, 50.0, 95.0), name
        assert found["jac"] == MedianAndTail(101, pytest.approx(0.5), pytest.approx(0.05))
        assert found["ball_m"] == MedianAndTail(1, 0.25, 0.25)

    def test_of_nothing_there_is_none(self) -> None:
        assert set(compute_medians_and_tails([]).values()) == {MedianAndTail(0)}
