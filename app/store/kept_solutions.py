"""Kept solutions: what was computed for groups, as they are, under policies of before."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from sqlalchemy import select

from app.soccer.solution import SOLVER_VERSION, Solution
from app.store import value_codec
from app.store.session import Session
from app.store.solutions import EncodedSolution, compress, read_summary
from app.store.stored_json import Json, as_written, inflate, parse
from app.store.summary import summarize_gates
from app.store.tables.groups import GroupModel
from app.store.tables.solutions import SolutionModel


@dataclass(frozen=True)
class KeptSolution:
    """A solution as it is stored, of its group's present state; ``group`` is the key of that."""

    group_id: int
    group: str
    inputs_hash: str
    policy_hash: str
    calibrations: str
    summary: str
    body: bytes
    facts: bytes

    @cached_property
    def solution(self) -> Solution:
        """The solution, without what its calibrations say.

        Raises:
            DamagedError: It is not what was written.
        """
        bare: Solution = value_codec.from_json(Solution, self._value)
        return bare

    @cached_property
    def _value(self) -> Json:
        return parse(inflate(self.body))

    def encode(self, solution: Solution) -> EncodedSolution:
        """A solution that differs from this one in its gates, findings and policy alone.

        What is the same value is the same text: numbers are not written anew.

        Raises:
            DamagedError: What is stored beside it is not what was written.
        """
        before = self.solution
        with as_written():
            value = {
                **self._value,
                "gates": _changed(self._value["gates"], before.gates, solution.gates),
                "findings": _changed(self._value["findings"], before.findings, solution.findings),
                "policy_hash": solution.policy_hash,
            }
            keys = tuple(parse(self.calibrations))
        summary = summarize_gates(read_summary(self.summary), solution)
        return EncodedSolution({}, keys, summary, compress(value), self.facts)


def _changed(values: Sequence[Json], before: Sequence[object], now: Sequence[object]) -> list[Json]:
    """JSON values of what was before, with those of what is another value now."""
    return [
        value if old is new else value_codec.to_json(new)
        for value, old, new in zip(values, before, now, strict=True)
    ]


def kept_solutions(
    session: Session, group_ids: Sequence[int], policies: Collection[str]
) -> list[KeptSolution]:
    """One solution of each group under one of the policies, of those that have facts beside them.

    Args:
        session: Any session.
        group_ids: At most a few hundred.
        policies: Hashes of policies.
    """
    group, model = GroupModel, SolutionModel
    # mypy would have it that facts may be None; the condition says that they are not.
    statement: Any = (
        select(
            group.id, group.key, model.inputs_hash, model.policy_hash,
            model.calibrations, model.summary, model.body, model.facts,
        )
        .join(group, group.id == model.group_id)
        .where(
            model.group_id.in_(group_ids),
            model.inputs_hash == group.inputs_hash,
            model.policy_hash.in_(list(policies)),
            model.solver_version == SOLVER_VERSION,
            model.facts.is_not(None),
        )
        .order_by(model.id)
    )  # fmt: skip
    rows = (KeptSolution(*row) for row in session.execute(statement))
    return list({row.group_id: row for row in rows}.values())
