"""Mean ball: the paper's 3D ball of one group, the mean of its valid pairs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.geometry.arrays import row_by_row
from app.soccer.policy import Policy
from app.soccer.solution import GATES, Ball3D, BestBall, ChiSquare, Pair
from app.solving.ball_covariance import MeanCovariance, major_axis_sigma
from app.solving.chi_square import group_sigma_widening
from app.solving.facts import Facts
from app.solving.judgement import PASSES, Judgement
from app.solving.triangulate import PairPoint


def judged_pairs(pair_points: Sequence[PairPoint], judgement: Judgement) -> tuple[Pair, ...]:
    """Every pair of views with its point, and the gate that makes it invalid."""
    return tuple(
        Pair(
            a=item.a.view,
            b=item.b.view,
            point=item.place,
            errors_px=item.errors_px,
            baseline_m=item.baseline_m,
            parallax_degrees=item.parallax_degrees,
            valid=gate == PASSES,
            failed=None if gate == PASSES else GATES[gate],
        )
        for item, gate in zip(pair_points, judgement.pair_failed.tolist(), strict=True)
    )


def mean_ball(
    keys: Sequence[str],
    facts: Facts,
    judgement: Judgement,
    uncertainty: MeanCovariance,
    policy: Policy,
    chi_square: ChiSquare | None = None,
) -> Ball3D | None:
    """The mean of the valid pairs with its uncertainty; None without a valid pair.

    Where the views contradict each other its sigma is multiplied by ``widening_of`` them.

    Args:
        keys: Of the views.
        facts: Of the one group.
        judgement: What the policy makes of them.
        uncertainty: Of the same facts.
        policy: How noisy a click is.
        chi_square: The test of the views, or None.
    """
    if not judgement.valid.any():
        return None
    covariance = uncertainty.covariances(judgement.valid, np.array([0]), judgement.point, policy)
    covariance = covariance * group_sigma_widening(chi_square) ** 2
    x, y, z = judgement.point[0].tolist()
    return Ball3D(
        point=(x, y, z),
        covariance=row_by_row(covariance[0]),
        sigma_m=float(major_axis_sigma(covariance)[0]),
        parallax_degrees=float(judgement.parallax[0]),
        views=tuple(keys[place] for place in np.unique(facts.pair_view[judgement.valid]).tolist()),
    )


def exported_ball(mean: Ball3D | None, best: BestBall | None, policy: Policy) -> Ball3D | None:
    """The ball that leaves: the mean of pairs, or the most likely point where the policy says so.

    Its views and its parallax are those of the valid pairs in either case: they are what the
    gates judge.

    Args:
        mean: Of the valid pairs; without it no ball leaves.
        best: The most likely ball.
        policy: Says which.
    """
    if mean is None or best is None or policy.point == "mean":
        return mean
    return replace(mean, point=best.point, covariance=best.covariance, sigma_m=best.sigma_m)
