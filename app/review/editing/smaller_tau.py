"""A dataset's solutions under a smaller tau, made from the kept ones instead of solved again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.errors import DamagedError
from app.review.datasets.dataset import DatasetHead
from app.review.editing.solve_encoded import Result
from app.soccer.policy import Policy
from app.solving.another_tau import alike_under, has_smaller_tau, retold
from app.solving.facts_codec import facts_from_bytes
from app.store.kept_solutions import KeptSolution, kept_solutions
from app.store.policies import policy_history
from app.store.solutions import SolutionKey
from app.store.store import Store

CHUNK = 200
"""Groups a task: a fraction of a second."""


@dataclass(frozen=True)
class RetellTask:
    """Groups on their way to a worker: solutions under policies of before, those by their hash."""

    kept: tuple[KeptSolution, ...]
    before: Mapping[str, Policy]
    policy: Policy


def retell_tasks(store: Store, dataset: DatasetHead, ids: Sequence[int]) -> Iterator[RetellTask]:
    """What can be retold of groups that have no solution under the policy of their dataset."""
    with store.read() as session:
        history = policy_history(session, dataset.id)
    policy = dataset.policy
    before = {
        item.policy.hash: item.policy for item in history if has_smaller_tau(policy, item.policy)
    }
    for start in range(0, len(ids) if before else 0, CHUNK):
        with store.read() as session:
            kept = kept_solutions(session, ids[start : start + CHUNK], before)
        if kept:
            yield RetellTask(tuple(kept), before, policy)


def retell_task(task: RetellTask) -> list[Result]:
    """The solutions of those groups of which tau decides nothing new; runs in a worker.

    What is damaged is left out, like all others: it is solved.
    """
    try:
        return [result for kept in _by_policy(task) for result in _retell(task, kept)]
    except DamagedError:
        return []


def _by_policy(task: RetellTask) -> Iterator[list[KeptSolution]]:
    for digest in task.before:
        kept = [item for item in task.kept if item.policy_hash == digest]
        if kept:
            yield kept


def _retell(task: RetellTask, kept: Sequence[KeptSolution]) -> Iterator[Result]:
    policy = task.policy
    facts = facts_from_bytes([item.facts for item in kept])
    same = alike_under(facts, task.before[kept[0].policy_hash], policy)
    ends = np.cumsum(np.bincount(facts.view_group, minlength=facts.groups))
    diagonals = np.split(facts.view_diagonal, ends[:-1])
    for place in np.flatnonzero(same).tolist():
        item = kept[place]
        solution = retold(item.solution, diagonals[place].tolist(), policy)
        if solution is not None:
            key = SolutionKey(item.group_id, item.inputs_hash, policy.hash)
            yield Result(key, item.group, solution.passes, item.encode(solution))
