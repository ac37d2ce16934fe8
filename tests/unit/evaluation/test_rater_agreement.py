from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.evaluation.rater_agreement import cohen_kappa, fleiss_kappa, krippendorff_alpha

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
