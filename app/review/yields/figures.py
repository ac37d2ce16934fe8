"""Yield figures: what is asked of the groups of a table beside the gates."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.solving.facts import Facts
from app.solving.judgement import MIN_VIEWS

JAC_STEPS = tuple((np.arange(101) / 100).tolist())
"""Where the curves are counted: JaC from 0 to 1."""


def qualifying_jac(facts: Facts, jac: FloatArray) -> FloatArray:
    """The JaC that a threshold must lie below so that two views with a ball qualify, (G,).

    A camera that was given and cannot be measured qualifies whatever the threshold; -1 where
    no threshold leaves two views.

    Args:
        facts: The groups.
        jac: ``view_jac`` at some gamma, shape (V,).
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


def qualifying_steps(facts: Facts, jac: FloatArray) -> npt.NDArray[np.uint8]:
    """At how many of ``JAC_STEPS``, from the first on, a group qualifies, shape (G,).

    It does at every threshold strictly below the JaC of its second best view.
    """
    return np.searchsorted(JAC_STEPS, qualifying_jac(facts, jac), "left").astype(np.uint8)


def is_unmeasured(facts: Facts) -> BoolArray:
    """Whether gate ``jac`` passes because the cameras are given and have no lines, shape (G,)."""
    measured = _count(facts, facts.view_included & facts.view_measured)
    given = _count(facts, facts.view_included & facts.view_camera & facts.view_given)
    unmeasured: BoolArray = (measured == 0) & (given > 0)
    return unmeasured


def _count(facts: Facts, chosen: BoolArray) -> IntArray:
    return np.bincount(facts.view_group[chosen], minlength=facts.groups)
