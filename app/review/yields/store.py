"""YieldStore: one table a dataset, built when first asked for and kept in step with the database."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.errors import NotFoundError
from app.geometry.arrays import FloatArray, IntArray
from app.review.yields.cache import forget_table, keep_table, kept_table
from app.review.yields.facts import Wanted, read_facts
from app.review.yields.figures import is_unmeasured, qualifying_jac
from app.review.yields.table import EMPTY, YieldTable, join
from app.soccer.policy import Policy
from app.soccer.solution import GAMMAS_PERCENT, SOLVER_VERSION
from app.solving.spread import MeanSpread
from app.solving.verdict import Verdict, judge
from app.store.datasets import find_dataset, policy_of
from app.store.log import newest_entry
from app.store.session import Session, Store
from app.store.solutions import newest_solution, present_solutions

MAX_BYTES = 512 * 1024 * 1024
"""What all tables together may hold; beyond it the one that was asked for longest ago goes."""
WORTH_KEEPING = 500
"""So many new groups are written to the cache; fewer are read again in a moment."""


@dataclass(frozen=True)
class Heads:
    """Groups as they are now, in the order of the table where they are in it.

    Attributes:
        split: Index in ``splits`` of each group, shape (N,); ``match`` likewise.
        pitch: Length and width, metres, shape (N, 2).
    """

    group_id: IntArray
    split: IntArray
    splits: tuple[str, ...]
    match: IntArray
    matches: tuple[str, ...]
    pitch: FloatArray


@dataclass(frozen=True)
class Snapshot:
    """A dataset's table with what is computed from it, all of one state.

    Attributes:
        policy: The present one.
        unsolved: Groups that the table does not hold yet.
        unmeasured: Groups whose cameras are given and have no lines to measure JaC.
        heads: Of the groups in the table, then of the others.
        present: What the present policy makes of the table.
        spread: Of the table.
        qualifying: For each gamma: ``figures.qualifying_jac``, sorted.
        leaks: Matches in several splits, with the number of groups in each.
    """

    policy: Policy
    table: YieldTable
    unsolved: int
    unmeasured: int
    heads: Heads
    present: Verdict
    spread: MeanSpread
    qualifying: tuple[FloatArray, ...]
    leaks: tuple[tuple[str, tuple[tuple[str, int], ...]], ...]


@dataclass
class _Kept:
    """A dataset's snapshot, and the mark of the state that it was made from."""

    lock: threading.Lock = field(default_factory=threading.Lock)
    mark: tuple[int, int, str] | None = None
    calibration: str | None = None
    snapshot: Snapshot | None = None


class YieldStore:
    """The tables of the datasets that somebody asked about."""

    def __init__(self, store: Store):
        self._store = store
        self._lock = threading.Lock()
        self._kept: OrderedDict[int, _Kept] = OrderedDict()

    def snapshot(self, dataset_id: int) -> Snapshot:
        """The table of a dataset as it is now.

        The first time it is read from all solutions (seconds for ten thousand groups), then
        only what has changed since; a copy in the cache outlives the process.

        Raises:
            NotFoundError: There is no such dataset.
        """
        with self._lock:
            kept = self._kept.setdefault(dataset_id, _Kept())
            self._kept.move_to_end(dataset_id)
        with kept.lock:
            try:
                snapshot = self._refreshed(dataset_id, kept)
            except NotFoundError:
                self._drop(dataset_id)
                raise
        self._forget()
        return snapshot

    def _refreshed(self, dataset_id: int, kept: _Kept) -> Snapshot:
        with self._store.read() as session:
            policy = read_policy(session, dataset_id)
            mark = _mark(session, policy)
            if kept.snapshot is not None and kept.mark == mark:
                return kept.snapshot
            rows: Rows = {group: rest for group, *rest in present_solutions(session, dataset_id)}
        calibration = f"{policy.calibration_hash} {SOLVER_VERSION}"
        place = self._store.settings.cache / "yields" / f"{dataset_id}.npz"
        if kept.snapshot is None:
            old = kept_table(place, calibration)
        else:
            old = kept.snapshot.table if kept.calibration == calibration else EMPTY
        table = self._table(old, rows)
        if table.groups - old.groups >= WORTH_KEEPING:
            keep_table(place, calibration, table)
        heads, spread = _heads(rows, table), MeanSpread(table.facts)
        kept.snapshot = Snapshot(
            policy=policy,
            table=table,
            unsolved=len(rows) - table.groups,
            unmeasured=int(is_unmeasured(table.facts).sum()),
            heads=heads,
            present=judge(table.facts, policy, spread),
            spread=spread,
            qualifying=tuple(
                np.sort(qualifying_jac(table.facts, gamma)) for gamma in GAMMAS_PERCENT
            ),
            leaks=_leaks(heads),
        )
        kept.mark, kept.calibration = mark, calibration
        return kept.snapshot

    def _table(self, old: YieldTable, rows: Rows) -> YieldTable:
        """The old table without what has changed, and with what is new."""
        same = [rows.get(group) for group in old.group_id.tolist()]
        kept = np.array(
            [
                row is not None and row[0] == inputs
                for row, inputs in zip(same, old.inputs.tolist(), strict=True)
            ],
            bool,
        )
        there = set(old.group_id[kept].tolist())
        wanted = [
            Wanted(group, row[0], row[1])
            for group, row in rows.items()
            if row[1] is not None and group not in there
        ]
        if not wanted and kept.all():
            return old
        return join([old.only(kept), read_facts(self._store, wanted)])

    def _drop(self, dataset_id: int) -> None:
        """Forget a dataset that is gone; its id is never given again."""
        with self._lock:
            self._kept.pop(dataset_id, None)
        forget_table(self._store.settings.cache / "yields" / f"{dataset_id}.npz")

    def _forget(self) -> None:
        with self._lock:
            sizes = {
                key: kept.snapshot.table.nbytes
                for key, kept in self._kept.items()
                if kept.snapshot is not None
            }
            for key in list(sizes)[:-1]:
                if sum(sizes.values()) <= MAX_BYTES:
                    return
                del self._kept[key], sizes[key]


Rows = dict[int, list[Any]]
"""By group: hash of its inputs, id of its solution or None, split, match, size of its pitch."""


def read_policy(session: Session, dataset_id: int) -> Policy:
    """The present policy of a dataset; raises NotFoundError when there is none."""
    row = find_dataset(session, dataset_id)
    if row is None:
        raise NotFoundError(f'there is no dataset "{dataset_id}"')
    return policy_of(row.policy)


def _mark(session: Session, policy: Policy) -> tuple[int, int, str]:
    """Differs whenever the log, the solutions or the policy do."""
    return newest_entry(session), newest_solution(session), policy.hash


def _heads(rows: Rows, table: YieldTable) -> Heads:
    inside = set(table.group_id.tolist())
    order = [*table.group_id.tolist(), *(group for group in rows if group not in inside)]
    splits, split = _coded([rows[group][2] for group in order])
    matches, match = _coded([rows[group][3] for group in order])
    return Heads(
        group_id=np.array(order, np.int64),
        split=split,
        splits=splits,
        match=match,
        matches=matches,
        pitch=np.array([rows[group][4:6] for group in order], float).reshape(-1, 2),
    )


def _leaks(heads: Heads) -> tuple[tuple[str, tuple[tuple[str, int], ...]], ...]:
    pairs, counts = np.unique(
        np.column_stack([heads.match, heads.split]), axis=0, return_counts=True
    )
    found: dict[str, list[tuple[str, int]]] = {}
    for (match, split), count in zip(pairs.tolist(), counts.tolist(), strict=True):
        if heads.splits[split]:
            found.setdefault(heads.matches[match], []).append((heads.splits[split], count))
    return tuple((match, tuple(splits)) for match, splits in found.items() if len(splits) > 1)


def _coded(names: list[str]) -> tuple[tuple[str, ...], IntArray]:
    different = sorted(set(names))
    places = {name: place for place, name in enumerate(different)}
    return tuple(different), np.array([places[name] for name in names], np.int64)
