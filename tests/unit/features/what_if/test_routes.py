"""Yields over HTTP: the funnel of a policy, and what another one would let through."""

from __future__ import annotations

from typing import Any

import pytest

from app.features.what_if.funnel import UNSOLVED
from app.features.what_if.routes import LABELS, ThresholdsToTry
from app.soccer.solution import GATES
from app.soccer.thresholds import THRESHOLDS

PATH = "/api/v1/datasets/broadcast/yield"


def gates(answer: Any) -> dict[str, int]:
    return {step["gate"]: step["dropped"] for step in answer.json()["funnel"]}


class TestReadYield:
    @pytest.mark.parametrize("dataset", ["broadcast", "static"])
    def test_tells_how_many_pass(self, api, dataset: str) -> None:
        answer = api.get(f"/api/v1/datasets/{dataset}/yield")
        assert answer.status_code == 200
        found = answer.json()
        assert (found["groups"], found["passing"], found["unsolved"]) == (3, 3, 0)
        assert [step["left"] for step in found["funnel"]] == [3] * 6
        assert [curve["gamma_percent"] for curve in found["curves"]] == [0.5, 1.0, 2.0]
        assert found["curves"][0]["groups"][75] == 3
        assert found["curves"][0]["thresholds"][75] == 0.75
        assert found["policy"]["name"] == "paper"
        spread = [part for part in found["distances"] if part["groups"]]
        assert [(part["from"], part["to"], part["passing"]) for part in spread] == [(60.0, 70.0, 3)]

    def test_a_dataset_that_is_not_there_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/yield").status_code == 404
        assert api.post("/api/v1/datasets/nothing/yield", json={}).status_code == 404


class TestTryPolicy:
    def test_other_thresholds_are_tried_and_not_kept(self, api) -> None:
        answer = api.post(PATH, json={"max_sigma_m": 0.01, "min_jac": 0.1})
        assert answer.status_code == 200
        found = answer.json()
        assert (found["passing"], found["lost"], found["gained"]) == (0, 3, 0)
        assert gates(answer)["sigma"] == 3
        assert found["policy"]["max_sigma_m"] == 0.01
        assert api.get(PATH).json()["passing"] == 3
        assert api.get("/api/v1/datasets/broadcast").json()["policy"]["max_sigma_m"] is None

    def test_null_switches_an_optional_gate_off_and_is_refused_elsewhere(self, api) -> None:
        policy = "/api/v1/datasets/broadcast/policy"
        headers = {"If-Match": api.get(policy).headers["etag"]}
        assert api.put(policy, json={"name": "strict"}, headers=headers).status_code == 202
        assert "sigma" in gates(api.get(PATH))
        answer = api.post(PATH, json={"max_sigma_m": None, "min_jac": None})
        assert "sigma" not in gates(answer) and "parallax" in gates(answer)
        assert answer.json()["policy"]["min_jac"] == 0.75

    def test_thresholds_that_need_solving_are_named(self, api) -> None:
        answer = api.post(PATH, json={"calibration": {"check_labels": False}, "tau_percent": 2})
        assert answer.json()["needs_solving"] == ["calibration.check_labels"]

    @pytest.mark.parametrize(
        ("body", "pointer"),
        [
            ({"minimum": 1}, "/minimum"),
            ({"min_jac": "x"}, "/min_jac"),
            ({"tau_percent": 1e300}, "/tau_percent"),
            ({"tau_percent": 5.1}, "/tau_percent"),
            ({"min_jac": -0.5}, "/min_jac"),
            ({"min_parallax_degrees": 179}, "/min_parallax_degrees"),
            ({"point": "median"}, "/point"),
            ({"calibration": {"distortion_sigma": 0}}, "/calibration/distortion_sigma"),
            ({"calibration": {"x": 1}}, "/calibration/x"),
        ],
    )
    def test_a_threshold_that_cannot_be_is_422(self, api, body: Any, pointer: str) -> None:
        answer = api.post(PATH, json=body)
        assert (answer.status_code, answer.json()["pointer"]) == (422, pointer)


class TestWhatIf:
    def test_has_every_threshold_of_a_policy(self) -> None:
        inner = ThresholdsToTry.model_fields["calibration"].annotation.__args__[0].model_fields
        assert {*ThresholdsToTry.model_fields} - {"calibration"} | {
            f"calibration.{name}" for name in inner
        } == {threshold.name for threshold in THRESHOLDS}

    def test_every_step_has_a_label(self) -> None:
        assert set(LABELS) == {UNSOLVED, *GATES}
