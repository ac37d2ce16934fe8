"""The facts of a dataset's groups as arrays, and the figures that are asked of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.soccer.solution import GAMMAS_PERCENT
from app.solving.facts import COLUMNS, NOTHING, GroupFacts
from app.solving.facts import join_facts as join_facts
from app.solving.judgement import MIN_VIEWS, compute_view_jac

JAC_STEPS = tuple((np.arange(101) / 100).tolist())
"""Where the curves are counted: JaC from 0 to 1."""


def qualifying_jac(facts: GroupFacts, jac: FloatArray) -> FloatArray:
    """The JaC that a threshold must lie below so that two views with a ball qualify, (G,).

    A camera that was given and cannot be measured qualifies whatever the threshold; -1 where
    no threshold leaves two views.

    Args:
        facts: The groups.
        jac: ``compute_view_jac`` at some gamma, shape (V,).
    """
    shown = np.flatnonzero(facts.view_included & facts.view_camera & facts.view_ball)
    value = np.where(np.isnan(jac), np.inf, jac)[shown]
    order = shown[np.lexsort((-value, facts.view_group[shown]))]
    groups, starts, counts = np.unique(
        facts.view_group[order], return_index=True, return_counts=True
    )
    second = np.full(facts.groups, -1.0)
    enough = counts >= MIN_VIEWS
    chosen = order[starts[enough] + MIN_VIEWS - 1]
    second[groups[enough]] = np.where(np.isnan(jac[chosen]), np.inf, jac[chosen])
    return second


def count_qualifying_steps(facts: GroupFacts, jac: FloatArray) -> npt.NDArray[np.uint8]:
    """At how many of ``JAC_STEPS``, from the first on, a group qualifies, shape (G,).

    It does at every threshold strictly below the JaC of its second best view.
    """
    return np.searchsorted(JAC_STEPS, qualifying_jac(facts, jac), "left").astype(np.uint8)


def find_unmeasured_groups(facts: GroupFacts) -> BoolArray:
    """Whether gate ``jac`` passes because the cameras are given and have no lines, shape (G,)."""
    measured = _count_views_by_group(facts, facts.view_included & facts.view_measured)
    given = _count_views_by_group(facts, facts.view_included & facts.view_camera & facts.view_given)
    unmeasured: BoolArray = (measured == 0) & (given > 0)
    return unmeasured


def _count_views_by_group(facts: GroupFacts, chosen: BoolArray) -> IntArray:
    return np.bincount(facts.view_group[chosen], minlength=facts.groups)


HEADS = ("group_id", "inputs", "split", "match", "pitch")
"""Arrays with a row for each group, solved or not."""
FIGURES = ("jac", "steps", "unmeasured")
"""Arrays that follow from the facts, whatever the policy."""


@dataclass(frozen=True)
class YieldTable:
    """Groups with their facts.

    Attributes:
        group_id: Id of each group, shape (G,).
        inputs: Hash of what was said of each group, shape (G,).
        split: Index in ``splits`` of each group, shape (G,); ``match`` likewise.
        pitch: Length and width, metres, shape (G, 2).
        facts: What the gates read of them; of no group where they are not solved.
    """

    group_id: IntArray
    inputs: npt.NDArray[np.bytes_]
    split: IntArray
    splits: tuple[str, ...]
    match: IntArray
    matches: tuple[str, ...]
    pitch: FloatArray
    facts: GroupFacts

    @property
    def groups(self) -> int:
        """How many groups there are."""
        return len(self.group_id)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays, in memory or mapped."""
        columns = sum(getattr(self.facts, name).nbytes for name in COLUMNS)
        return int(columns + sum(getattr(self, name).nbytes for name in HEADS))

    @cached_property
    def jac(self) -> FloatArray:
        """``compute_view_jac`` at each of ``GAMMAS_PERCENT``, shape (3, V)."""
        return np.stack([compute_view_jac(self.facts, gamma) for gamma in GAMMAS_PERCENT])

    @cached_property
    def steps(self) -> npt.NDArray[np.uint8]:
        """``count_qualifying_steps`` at each of ``GAMMAS_PERCENT``, shape (3, G)."""
        return np.stack([count_qualifying_steps(self.facts, jac) for jac in self.jac])

    @cached_property
    def unmeasured(self) -> BoolArray:
        """Groups whose cameras are given and have no lines to measure JaC, shape (G,)."""
        return find_unmeasured_groups(self.facts)

    def select_groups(self, kept: BoolArray) -> YieldTable:
        """The table of some of the groups, in the same order."""
        facts = self.facts.only(kept) if self.facts.groups else self.facts
        heads = {name: getattr(self, name)[kept] for name in HEADS}
        return YieldTable(**heads, splits=self.splits, matches=self.matches, facts=facts)

    def count_groups_by_match_and_split(
        self, kept: BoolArray | None = None
    ) -> Counter[tuple[str, str]]:
        """How many of the groups lie in each match and split."""
        chosen = slice(None) if kept is None else kept
        code = self.match[chosen] * max(len(self.splits), 1) + self.split[chosen]
        counts = np.bincount(code)
        places = np.flatnonzero(counts)
        match, split = np.divmod(places, max(len(self.splits), 1))
        return Counter(
            {
                (self.matches[a], self.splits[b]): count
                for a, b, count in zip(
                    match.tolist(), split.tolist(), counts[places].tolist(), strict=True
                )
            }
        )


def make_table(rows: Sequence[Any], facts: GroupFacts) -> YieldTable:
    """The table of rows of solved groups, in the order of their facts."""
    splits, split = _encode_names([row.split for row in rows])
    matches, match = _encode_names([row.match for row in rows])
    return YieldTable(
        group_id=np.array([row.group_id for row in rows], np.int64),
        inputs=np.array([row.inputs_hash for row in rows], "S"),
        split=split,
        splits=splits,
        match=match,
        matches=matches,
        pitch=np.array([(row.pitch_length, row.pitch_width) for row in rows], float).reshape(-1, 2),
        facts=facts,
    )


def join_tables(tables: Sequence[YieldTable]) -> YieldTable:
    """The groups of several tables, one after the other."""
    splits, split = _join_encoded_names([(table.splits, table.split) for table in tables])
    matches, match = _join_encoded_names([(table.matches, table.match) for table in tables])
    return YieldTable(
        group_id=np.concatenate([table.group_id for table in tables]),
        inputs=np.concatenate([table.inputs for table in tables]),
        split=split,
        splits=splits,
        match=match,
        matches=matches,
        pitch=np.concatenate([table.pitch for table in tables]),
        facts=join_facts([table.facts for table in tables]),
    )


def _encode_names(names: list[str]) -> tuple[tuple[str, ...], IntArray]:
    different = sorted(set(names))
    places = {name: place for place, name in enumerate(different)}
    return tuple(different), np.array([places[name] for name in names], np.int64)


def _join_encoded_names(
    parts: Sequence[tuple[tuple[str, ...], IntArray]],
) -> tuple[tuple[str, ...], IntArray]:
    different = sorted({name for names, _ in parts for name in names})
    places = {name: place for place, name in enumerate(different)}
    codes = [
        np.array([places[name] for name in names], np.int64)[code] if len(code) else code
        for names, code in parts
    ]
    return tuple(different), np.concatenate(codes)


EMPTY = make_table([], NOTHING)
