from dataclasses import fields, replace
from typing import get_args

import pytest

from app.soccer.choices import PolicyName
from app.soccer.pitch import Pitch, Segment
from app.soccer.policy import (
    CALIBRATION,
    CLICKED,
    PAPER,
    POLICIES,
    STRICT,
    SUBJECTS,
    TOUCHLINE,
    CalibrationPolicy,
    Policy,
)
from app.soccer.solution import GATES
from app.soccer.thresholds import THRESHOLDS, Threshold


def another(threshold: Threshold) -> object:
    """A value of a threshold that the policy of the paper does not have."""
    words = [word for word in threshold.choices if isinstance(word, str)]
    candidates = words or [threshold.minimum, threshold.maximum]
    if threshold.minimum is None and not words:
        candidates = [True, False]
    return next(value for value in candidates if value != threshold.default)


class TestPolicies:
    def test_each_can_be_named_in_a_request_and_no_other(self):
        assert get_args(PolicyName) == tuple(POLICIES)
        assert all(policy.name == name for name, policy in POLICIES.items())


class TestHash:
    def test_the_name_does_not_count(self):
        assert replace(PAPER, name="mine").hash == PAPER.hash

    @pytest.mark.parametrize("threshold", THRESHOLDS, ids=lambda threshold: threshold.name)
    def test_every_threshold_counts(self, threshold: Threshold):
        part, _, name = threshold.name.rpartition(".")
        values = {name: another(threshold)}
        if part:
            values = {CALIBRATION: replace(PAPER.calibration, **values)}
        changed = replace(PAPER, **values)
        assert changed.hash != PAPER.hash
        assert (changed.calibration_hash != PAPER.calibration_hash) == bool(part)

    def test_policies_of_different_names_and_thresholds_differ(self):
        assert STRICT.hash != PAPER.hash

    def test_a_threshold_that_came_later_changes_no_hash_until_it_asks_for_something(self):
        """Versions that are frozen must verify: these are the hashes of before."""
        strict = Policy(name="strict", min_parallax_degrees=5.0, max_sigma_m=0.5)
        assert (PAPER.hash, strict.hash) == ("b6b4891b3d9960d2", "172d8def1c011aaa")
        clicked = replace(PAPER, calibration=CLICKED)
        assert clicked.hash != PAPER.hash and clicked.calibration_hash != PAPER.calibration_hash
        assert replace(PAPER, point="best").hash != PAPER.hash
        assert replace(PAPER, min_p_value=0.001).hash != PAPER.hash
        assert replace(PAPER, min_agreement=0.4).hash != PAPER.hash
        sharing = replace(PAPER, calibration=CalibrationPolicy(share_position=True))
        assert sharing.hash != PAPER.hash
        assert sharing.calibration_hash != PAPER.calibration_hash
        short = replace(PAPER, calibration=CalibrationPolicy(shortest_marking_px=5.0))
        assert short.hash != PAPER.hash and short.calibration_hash != PAPER.calibration_hash
        painted = replace(PAPER, calibration=CalibrationPolicy(source="paint"))
        # What touchline was before it left stubs out.
        assert painted.hash == "2e048fba4ca30dd4" not in (PAPER.hash, TOUCHLINE.hash)
        alone = replace(PAPER, calibration=CalibrationPolicy(source="paint", lone_frames="any"))
        assert alone.hash not in (painted.hash, TOUCHLINE.hash)
        assert replace(TOUCHLINE, noise="fixed").hash != TOUCHLINE.hash
        assert painted.calibration_hash != PAPER.calibration_hash

    def test_the_paper_fits_the_inner_edges_of_goals_and_the_others_their_middle(self):
        goals = {name: policy.calibration.goal for name, policy in POLICIES.items()}
        assert goals == {"paper": "inner", "strict": "middle", "touchline": "middle"}
        post = CLICKED.pitch_for_fitted_lines(Pitch(100.0, 64.0)).shapes["Goal left post left"]
        assert isinstance(post, Segment) and post.start == pytest.approx((-50.0, 3.72, -2.5))
        assert PAPER.calibration.pitch_for_fitted_lines(Pitch()) == Pitch()

    def test_lines_by_the_laws_are_asked_for_by_no_shipped_policy(self):
        laws = replace(CLICKED, goal="laws")
        assert laws.pitch_for_fitted_lines(Pitch()).shapes["Side line left"].start[
            0
        ] == pytest.approx(-52.44)
        assert CLICKED.pitch_for_fitted_lines(Pitch()).shapes["Side line left"].start[0] == -52.5
        keys = {replace(PAPER, calibration=one).hash for one in (CLICKED, laws, PAPER.calibration)}
        assert len(keys) == 3

    def test_the_paper_weighs_points_and_the_others_markings(self):
        weighed = {name: policy.calibration.weighed for name, policy in POLICIES.items()}
        assert weighed == {"paper": "points", "strict": "markings", "touchline": "markings"}
        assert repr(replace(CLICKED, weighed="points")) == repr(CLICKED)

    def test_sharing_positions_has_no_part_in_what_keys_calibrations(self):
        """Those that were kept before it came stay known; the position itself keys the others."""
        assert repr(CalibrationPolicy(share_position=True)) == repr(CalibrationPolicy())

    def test_paint_has_no_part_in_what_keys_calibrations_either(self):
        assert repr(CalibrationPolicy(source="paint")) == repr(CalibrationPolicy())
        assert repr(CalibrationPolicy(lone_frames="any")) == repr(CalibrationPolicy())

    def test_tau_leaves_calibrations_alone(self):
        assert replace(PAPER, tau_percent=0.9).calibration_hash == PAPER.calibration_hash
        other = replace(PAPER, calibration=CalibrationPolicy(check_labels=False))
        assert other.calibration_hash != PAPER.calibration_hash


class TestPaper:
    def test_holds_the_values_recovered_from_the_published_dataset(self):
        assert (PAPER.tau_percent, PAPER.ball_diameter_m) == (1.0, 0.226)
        assert (PAPER.jac_gamma_percent, PAPER.min_jac, PAPER.min_baseline_m) == (0.5, 0.75, 1.0)


class TestThresholds:
    def test_name_every_value_of_a_policy_and_nothing_else(self):
        own = {item.name for item in fields(Policy)} - {"name", CALIBRATION}
        inner = {f"{CALIBRATION}.{item.name}" for item in fields(CalibrationPolicy)}
        assert {threshold.name for threshold in THRESHOLDS} == own | inner

    def test_each_that_a_gate_compares_with_says_how_and_jac_alone_must_be_exceeded(self):
        asks = {
            threshold.name: threshold.comparison for threshold in THRESHOLDS if threshold.comparison
        }
        compared = {item.name for item in THRESHOLDS if item.gate} - {"jac_gamma_percent"}
        assert set(asks) == compared
        assert [name for name, words in asks.items() if words == "more than"] == ["min_jac"]

    def test_thresholds_of_gates_come_first_and_in_the_order_of_the_gates(self):
        subjects = list(dict.fromkeys(threshold.subject for threshold in THRESHOLDS))
        assert subjects == [subject for subject in SUBJECTS if subject in subjects]
        gates = list(dict.fromkeys(item.gate for item in THRESHOLDS if item.gate))
        assert gates == [gate for gate in GATES if gate in gates]

    @pytest.mark.parametrize("policy", POLICIES.values(), ids=lambda policy: policy.name)
    def test_the_shipped_policies_lie_between_the_ends(self, policy):
        for threshold in THRESHOLDS:
            value = threshold.value(policy)
            if value is None:
                assert threshold.optional, threshold.name
            elif threshold.has_word_choices:
                assert value in threshold.choices, threshold.name
            elif not isinstance(value, bool):
                assert threshold.minimum <= value <= threshold.maximum, threshold.name
