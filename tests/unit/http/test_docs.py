"""docs/api.md and the group that it refers to show what the service says."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from app.features.groups.schemas import GroupDocument
from app.features.policies.schemas import PolicyDocument
from app.http.problem import TITLES, Problem
from app.soccer.policy import PAPER
from tests.docs.group import GROUP_FILE
from tests.openapi import openapi_of

PAGE = (Path(__file__).parents[3] / "docs" / "api.md").read_text(encoding="utf-8")
(PROBLEM,) = re.findall(r"```json\n(.*?)```", PAGE, re.S)
GROUP = GROUP_FILE.read_text(encoding="utf-8")


def names(value: Any) -> Any:
    """The shape of a document: names of members, without their values."""
    if isinstance(value, dict):
        return {name: names(item) for name, item in value.items()}
    return None


class TestGroup:
    def test_is_a_complete_document(self) -> None:
        shown = json.loads(GROUP)
        again = json.loads(GroupDocument.model_validate_json(GROUP).model_dump_json())
        assert names(again) == names(shown)
        for part in ("views", "gates", "pairs"):
            for kept, said in zip(again["solution"][part], shown["solution"][part], strict=True):
                assert names(kept) == names(said)

    def test_has_everything_that_the_schema_has(self) -> None:
        shown = json.loads(GROUP)
        assert set(shown) == set(GroupDocument.model_fields)

    def test_its_policy_is_the_one_that_is_in_force(self) -> None:
        shown = json.loads(GROUP)
        assert shown["policy"] == PolicyDocument.model_validate(PAPER).model_dump(mode="json")
        assert shown["policy"]["hash"] == shown["solution"]["policy_hash"] == PAPER.hash


class TestProblem:
    def test_the_example_fits_the_schema_of_problems(self) -> None:
        assert Problem.model_validate_json(PROBLEM).status == 422


class TestAddresses:
    @pytest.mark.parametrize(
        "address", sorted(set(re.findall(r"\$api(/[a-z-]+(?:/[\w{}-]+)*)", PAGE)))
    )
    def test_every_address_in_the_examples_exists(self, app, address: str) -> None:
        wanted = re.sub(r"/(\d+|sample|[0-9a-f]{32})(?=/|$)", "/{}", f"/api/v1{address}")
        known = {re.sub(r"{\w+}", "{}", path) for path in openapi_of(app)["paths"]}
        assert wanted in known


def test_every_status_of_a_problem_is_explained() -> None:
    (listed,) = re.findall(r"^(400 .*?)\n\n", PAGE, re.S | re.M)
    explained = {int(part.split()[0]) for part in listed.replace("\n", " ").split(" · ")}
    assert explained == set(TITLES)
