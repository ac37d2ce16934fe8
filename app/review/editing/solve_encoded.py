"""Solve and encode: a solution, and the same as it is stored with the facts that what-if reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.soccer.group import Group
from app.soccer.policy import Policy
from app.soccer.solution import Calibration, Solution
from app.solving.facts_codec import facts_to_bytes
from app.solving.solve import solve_with_facts
from app.store.solutions import EncodedSolution, SolutionKey, encode_solution

Solve = Callable[[Group, Policy, Mapping[str, Calibration]], tuple[Solution, EncodedSolution]]
"""``solve_encoded``, or who has another process do it."""


@dataclass(frozen=True)
class Result:
    """What a worker sends back for one group: a solution, or the reason why there is none."""

    key: SolutionKey
    group: str
    passes: bool = False
    solution: EncodedSolution | None = None
    problem: str = ""


def solve_encoded(
    group: Group, policy: Policy, known: Mapping[str, Calibration]
) -> tuple[Solution, EncodedSolution]:
    """The solution of a group, and its bytes; calibrations that are known are not encoded again."""
    solution, facts = solve_with_facts(group, policy, known)
    return solution, encode_solution(group, solution, known, facts_to_bytes(facts))
