"""Yield figures: what is asked of the groups of a table beside the gates."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.solving.facts import Facts
from app.solving.verdict import MIN_VIEWS, view_jac


def qualifying_jac(facts: Facts, gamma_percent: float) -> FloatArray:
    """The JaC that a threshold must lie below so that two views with a ball qualify, (G,).

    A camera that was given and cannot be measured qualifies whatever the threshold; -1 where
    no threshold leaves two views.
    """
    jac = view_jac(facts, gamma_percent)
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


def is_unmeasured(facts: Facts) -> BoolArray:
    """Whether gate ``jac`` passes because the cameras are given and have no lines, shape (G,)."""
    measured = _count(facts, facts.view_included & facts.view_measured)
    given = _count(facts, facts.view_included & facts.view_camera & facts.view_given)
    unmeasured: BoolArray = (measured == 0) & (given > 0)
    return unmeasured


def _count(facts: Facts, chosen: BoolArray) -> IntArray:
    return np.bincount(facts.view_group[chosen], minlength=facts.groups)
