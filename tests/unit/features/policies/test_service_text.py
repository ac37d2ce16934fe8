"""Policies as text: the same values back, and nothing that is unknown or impossible."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest

from app.errors import InputError
from app.features.policies.service import (
    MAX_CHARACTERS,
    policy_from_yaml,
    policy_to_values,
    policy_to_yaml,
    replace_thresholds,
)
from app.soccer.policy import PAPER, POLICIES, STRICT, TOUCHLINE, CalibrationPolicy, Policy


class TestPolicyToYaml:
    @pytest.mark.parametrize("policy", POLICIES.values(), ids=lambda policy: policy.name)
    def test_comes_back_the_same(self, policy: Policy) -> None:
        assert policy_from_yaml(policy_to_yaml(policy)) == policy

    def test_comes_back_the_same_bits_under_any_name(self) -> None:
        for name in ("yes", "1.5", "null", "2020-01-01", "a b", "1e5"):
            policy = replace_thresholds(STRICT, {"tau_percent": 0.1 + 0.2}, name=name)
            again = policy_from_yaml(policy_to_yaml(policy))
            assert (again, again.tau_percent) == (policy, 0.1 + 0.2)

    def test_says_what_each_threshold_is(self) -> None:
        lines = policy_to_yaml(PAPER).splitlines()
        assert lines[0] == "name: paper"
        assert (
            "tau_percent: 1.0                # Largest reprojection error, % of diagonal" in lines
        )
        assert "min_parallax_degrees: null      # Smallest parallax, degrees" in lines
        assert lines[lines.index("calibration:") + 1].startswith("  robust_scale_px: 2.0")


class TestPolicyFromYaml:
    def test_thresholds_that_are_not_named_are_those_of_the_paper(self) -> None:
        policy = policy_from_yaml("name: tight\ntau_percent: 0.5\ncalibration:\n  check_labels: no")
        expected = dataclasses.replace(
            PAPER,
            name="tight",
            tau_percent=0.5,
            calibration=CalibrationPolicy(check_labels=False),
        )
        assert policy == expected

    def test_an_integer_is_the_same_policy_as_its_number(self) -> None:
        assert policy_from_yaml("tau_percent: 2").hash == policy_from_yaml("tau_percent: 2.0").hash

    @pytest.mark.parametrize(
        ("text", "pointer", "words"),
        [
            ("tau: 1", "/tau", "no threshold"),
            ("tau_percent: x", "/tau_percent", "must be a number"),
            ("tau_percent: true", "/tau_percent", "must be a number"),
            ("tau_percent: .nan", "/tau_percent", "must be a number"),
            ("tau_percent: .inf", "/tau_percent", "must be a number"),
            ("tau_percent: null", "/tau_percent", "must be a number"),
            ("tau_percent: [1]", "/tau_percent", "must be a number"),
            ("tau_percent: -1", "/tau_percent", "must lie between 0.05 and 5"),
            ("max_sigma_m: 0", "/max_sigma_m", "must lie between"),
            ("point: middle", "/point", "mean or best"),
            ("point: null", "/point", "mean or best"),
            ("calibration: 5", "/calibration", "mapping"),
            ("calibration: {x: 5}", "/calibration/x", "no threshold"),
            ("calibration: {check_labels: 1}", "/calibration/check_labels", "true or false"),
            ("calibration: {1: 5}", "/calibration/1", "no threshold"),
            ("1: 5", "/1", "no threshold"),
            ("name: [x]", "/name", "name of a policy"),
            ("name: ''", "/name", "name of a policy"),
            ("name: paper\ntau_percent: 2", "/name", "other thresholds"),
        ],
    )
    def test_an_unknown_or_impossible_threshold_is_refused_with_its_place(
        self, text: str, pointer: str, words: str
    ) -> None:
        with pytest.raises(InputError, match=words) as caught:
            policy_from_yaml(text)
        assert caught.value.pointer == pointer

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("", "consists of lines"),
            ("- 1", "consists of lines"),
            ("5", "consists of lines"),
            ("a: [", "line 1"),
            ("tau_percent: 1\ntau_percent: 2", "line 2.*twice"),
            ("a: &x 1\nb: *x", "line 2: references"),
            ("a: {b: {c: {d: {e: 1}}}}", "too deep"),
            ("[" * 10_000, "too deep"),
            ("a: !!python/object/apply:os.system ['true']", "line 1"),
            ("#" * (MAX_CHARACTERS + 1), "characters"),
            ("a: 1\n---\nb: 2", "line 2"),
            ("tau_percent: 2020-13-45", "cannot be read"),
            ("? [1, 2]\n: 3", "line 1"),
        ],
    )
    def test_anything_but_plain_yaml_is_refused(self, text: str, words: str) -> None:
        with pytest.raises(InputError, match=words):
            policy_from_yaml(text)


class TestPolicyWith:
    def test_takes_the_calibration_nested_or_dotted(self) -> None:
        nested = replace_thresholds(PAPER, {"calibration": {"robust_scale_px": 3}}, name="x")
        dotted = replace_thresholds(PAPER, {"calibration.robust_scale_px": 3}, name="x")
        assert nested == dotted
        assert nested.calibration.robust_scale_px == 3.0

    def test_points_into_the_request(self) -> None:
        with pytest.raises(InputError) as caught:
            replace_thresholds(PAPER, {"calibration": {"robust_scale_px": 300}}, pointer="/values")
        assert caught.value.pointer == "/values/calibration/robust_scale_px"

    def test_an_optional_threshold_can_be_switched_off(self) -> None:
        policy = replace_thresholds(STRICT, {"max_sigma_m": None}, name="x")
        assert (policy.max_sigma_m, policy.min_parallax_degrees) == (None, 5.0)

    def test_values_of_a_policy_make_it_again(self) -> None:
        assert replace_thresholds(PAPER, policy_to_values(STRICT), name="strict") == STRICT

    @pytest.mark.parametrize(
        ("values", "noise"),
        [
            ({"click_sigma_px": 1.3}, "fixed"),
            ({"calibration": {"line_share": 0.4}}, "fixed"),
            ({"tau_percent": 0.9, "click_sigma_px": TOUCHLINE.click_sigma_px}, "estimated"),
            ({"click_sigma_px": 1.3, "noise": "estimated"}, "estimated"),
        ],
    )
    def test_a_number_of_ones_own_takes_the_place_of_the_estimate(
        self, values: dict[str, Any], noise: str
    ) -> None:
        assert replace_thresholds(TOUCHLINE, values, name="mine").noise == noise

    def test_what_a_dataset_shows_leaves_a_policy_the_shipped_one(self) -> None:
        estimated = {"noise": "estimated", "click_sigma_px": 1.3, "calibration.line_sigma_px": 0.7}
        assert replace_thresholds(TOUCHLINE, estimated).name == "touchline"
        with pytest.raises(InputError, match="a policy with other thresholds"):
            replace_thresholds(TOUCHLINE, {"click_sigma_px": 1.3})
        with pytest.raises(InputError, match="a policy with other thresholds"):
            replace_thresholds(TOUCHLINE, {**estimated, "tau_percent": 0.9})
