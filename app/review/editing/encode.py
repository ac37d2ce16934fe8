"""Encode: a solution as it is stored, with the facts that what-if reads of it."""

from __future__ import annotations

from collections.abc import Iterable

from app.soccer.group import Group
from app.soccer.solution import Solution
from app.solving.facts import group_facts
from app.solving.facts_codec import facts_to_bytes
from app.store.solutions import EncodedSolution, encode_solution


def encode(group: Group, solution: Solution, known: Iterable[str]) -> EncodedSolution:
    """A solution with its facts as bytes; calibrations under a known key are not encoded again."""
    facts = group_facts(group.views, [view.calibration for view in solution.views])
    return encode_solution(group, solution, known, facts_to_bytes(facts))
