"""Rater agreement: how far several people judge alike beyond what chance alone would give, and how far apart two
annotations of a group may lie and still agree.

Every coefficient is a function of sums over items, so a resample of the items is one matrix
product; intervals are percentiles of resampled items (``bootstrap``), seeded.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.evaluation.annotation_distance import GroupDistance, ViewDistance
from app.evaluation.bootstrap import MatchResamples, percentile_interval
from app.geometry.arrays import FloatArray

Rated = Sequence[Sequence[Hashable | None]]
"""What each rater said of each item, one row per item; None where a rater did not judge it."""


@dataclass(frozen=True)
class AgreementCoefficient:
    """One coefficient of agreement.

    Attributes:
        name: ``cohen``, ``fleiss`` or ``krippendorff``.
        value: 1 is complete agreement, 0 what chance gives; None where nobody could disagree:
            no item was judged twice, or all judgements are the same.
        low: Lower end of the 95 % interval; None where there is none.
        high: Upper end.
        observed: Share of pairs of judgements that agree; None without any pair.
        items: How many items it was computed from.
    """

    name: Literal["cohen", "fleiss", "krippendorff"]
    value: float | None
    low: float | None
    high: float | None
    observed: float | None
    items: int


def cohen_kappa(first: Sequence[Hashable], second: Sequence[Hashable]) -> AgreementCoefficient:
    """Cohen's kappa of two raters who judged the same items.

    kappa = (p_o - p_e) / (1 - p_e), with p_o the share of items both call the same, and p_e the
    sum over categories of the product of both raters' shares of it.

    Args:
        first: One rater's category of each item.
        second: The other's, of the same length.

    Source: Cohen, "A coefficient of agreement for nominal scales", 1960, eq. 1.
    """
    names = _index_categories([first, second])
    count = len(names)
    parts = np.zeros((len(first), count, count))
    for row, (a, b) in enumerate(zip(first, second, strict=True)):
        parts[row, names[a], names[b]] = 1
    return _compute_coefficient_with_interval("cohen", parts, _cohen_kappa_from_tables)


def fleiss_kappa(rated: Rated) -> AgreementCoefficient:
    """Fleiss' kappa of items that were judged by equally many people, not always the same.

    Args:
        rated: As many judgements of each item, None nowhere.

    Raises:
        ValueError: Items were judged by different numbers of people, or by one alone.

    Source: Fleiss, "Measuring nominal scale agreement among many raters", 1971, eq. 2-7.
    """
    if len({len(row) for row in rated}) > 1 or (rated and len(rated[0]) < 2):
        raise ValueError(
            "Fleiss' kappa needs the same number of judgements of each item, two or more"
        )
    counts = _count_categories(rated)
    raters = counts.sum(axis=1, keepdims=True)
    agreeing = (counts * (counts - 1)).sum(axis=1, keepdims=True) / (raters * (raters - 1))
    return _compute_coefficient_with_interval(
        "fleiss", np.hstack([agreeing, counts / raters]), _fleiss_kappa_from_sums
    )


def krippendorff_alpha(rated: Rated) -> AgreementCoefficient:
    """Krippendorff's alpha of categories, where not everybody judged every item.

    alpha = 1 - D_o / D_e over the coincidence matrix o_ck, to which an item with m judgements
    gives each of its ordered pairs with weight 1 / (m - 1). Items judged once say nothing.

    Args:
        rated: None where a rater did not judge an item.

    Source: Krippendorff, "Computing Krippendorff's alpha-reliability", 2011, section C.
    """
    counts = _count_categories(
        [row for row in rated if sum(value is not None for value in row) > 1]
    )
    judged = counts.sum(axis=1)
    pairs = counts[:, :, None] * counts[:, None, :]
    places = np.arange(counts.shape[1])
    pairs[:, places, places] -= counts
    return _compute_coefficient_with_interval(
        "krippendorff", pairs / (judged - 1)[:, None, None], _alpha_from_coincidence_matrices
    )


def _compute_coefficient_with_interval(
    name: Literal["cohen", "fleiss", "krippendorff"],
    parts: FloatArray,
    compute: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
) -> AgreementCoefficient:
    """A coefficient from each item's part, shape (N, ...), and its interval by resampling."""
    items = len(parts)
    if not items:
        return AgreementCoefficient(name, None, None, None, None, 0)
    value, observed = compute(parts.sum(axis=0)[None])
    keys = [f"{number:09d}" for number in range(items)]
    counts = MatchResamples.draw(keys).counts
    low, high = None, None
    if np.isfinite(value[0]) and len(counts):
        sums = (counts @ parts.reshape(items, -1)).reshape(len(counts), *parts.shape[1:])
        low, high = percentile_interval(compute(sums)[0])
    known = float(value[0]) if np.isfinite(value[0]) else None
    return AgreementCoefficient(name, known, low, high, float(observed[0]), items)


def _cohen_kappa_from_tables(table: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Kappa and observed agreement of tables of counts, shape (R, K, K)."""
    share = table / table.sum(axis=(1, 2), keepdims=True)
    observed = np.trace(share, axis1=1, axis2=2)
    chance = (share.sum(axis=1) * share.sum(axis=2)).sum(axis=1)
    return _correct_for_chance(observed, chance), observed


def _fleiss_kappa_from_sums(sums: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Kappa and observed agreement of sums of agreement and shares, shape (R, 1 + K)."""
    items = sums[:, 1:].sum(axis=1)
    observed = sums[:, 0] / items
    chance = ((sums[:, 1:] / items[:, None]) ** 2).sum(axis=1)
    return _correct_for_chance(observed, chance), observed


def _alpha_from_coincidence_matrices(coincidences: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Alpha and observed agreement of coincidence matrices, shape (R, K, K)."""
    totals = coincidences.sum(axis=2)
    judged = totals.sum(axis=1)
    observed = np.trace(coincidences, axis1=1, axis2=2) / judged
    chance = (totals * (totals - 1)).sum(axis=1) / (judged * (judged - 1))
    return _correct_for_chance(observed, chance), observed


def _correct_for_chance(observed: FloatArray, chance: FloatArray) -> FloatArray:
    """(observed - chance) / (1 - chance), NaN where chance alone agrees always."""
    room = 1 - chance
    found = np.full(len(room), np.nan)
    there = room > 1e-12
    found[there] = (observed[there] - chance[there]) / room[there]
    return found


def _index_categories(rows: Rated) -> dict[Hashable, int]:
    names: dict[Hashable, int] = {}
    for row in rows:
        for value in row:
            if value is not None:
                names.setdefault(value, len(names))
    return names


def _count_categories(rated: Rated) -> FloatArray:
    """How often each item was given each category, shape (N, K)."""
    names = _index_categories(rated)
    counts = np.zeros((len(rated), len(names)))
    for row, ratings in enumerate(rated):
        for value in ratings:
            if value is not None:
                counts[row, names[value]] += 1
    return counts


@dataclass(frozen=True)
class AgreementLimits:
    """The most that two annotations may differ by.

    Attributes:
        line_px: Any point of a line from the line of the other, pixels.
        markings: Markings of a view that one alone drew.
        ball_px: Centres of the ball, pixels.
        diameter_px: Its diameters, pixels.
        ball_m: 3D balls, metres.
        jac: The least JaC of one's camera with the other's lines, 0 to 1.
    """

    line_px: float = 5.0
    markings: int = 1
    ball_px: float = 3.0
    diameter_px: float = 5.0
    ball_m: float = 0.5
    jac: float = 0.7


@dataclass(frozen=True)
class Disagreement:
    """One thing that two annotations say differently.

    Attributes:
        kind: ``verdict``, ``ball``, ``ball_px``, ``diameter_px``, ``ball_3d``, ``ball_m``,
            ``view``, ``markings``, ``line_px`` or ``jac``.
        sentence: For people, ``a`` and ``b`` standing for the two.
        view: Its key; None where it is about the whole group.
        marking: Its name, or None.
        value: What was measured, and ``limit`` what is allowed; None where it is no number.
    """

    kind: str
    sentence: str
    view: str | None = None
    marking: str | None = None
    value: float | None = None
    limit: float | None = None

    @property
    def severity(self) -> float:
        """By which disagreements are ordered: how many times the limit it is."""
        if self.value is None or not self.limit:
            return 2.0
        over = self.value / self.limit
        return 1 / max(over, 1e-3) if self.kind == "jac" else over


@dataclass(frozen=True)
class MedianAndTail:
    """The middle and the bad end of one measure.

    Attributes:
        count: Of how many numbers; the other two are None of none.
        tail: 95th percentile; of JaC, of which more is better, the 5th.
    """

    count: int
    median: float | None = None
    tail: float | None = None


MEASURES = ("line_px", "ball_px", "diameter_px", "ball_m", "jac", "position_m")


def find_disagreements(
    distance: GroupDistance, verdicts: tuple[str | None, str | None], limits: AgreementLimits
) -> tuple[Disagreement, ...]:
    """What two annotations say differently, the worst first; nothing: they agree.

    Args:
        distance: How far they lie apart.
        verdicts: Of each, None where there is none yet.
        limits: What is allowed.
    """
    found = list(_find_group_disagreements(distance, verdicts, limits))
    for view in distance.views:
        found.extend(_find_view_disagreements(view, limits))
    return tuple(sorted(found, key=lambda item: -item.severity))


def compute_medians_and_tails(distances: Iterable[GroupDistance]) -> dict[str, MedianAndTail]:
    """Each of ``MEASURES`` over many groups: of every line, every ball, every view and group."""
    values: dict[str, list[float | None]] = {name: [] for name in MEASURES}
    for distance in distances:
        values["ball_m"].append(distance.ball.distance_m)
        for view in distance.views:
            values["line_px"].extend(line.largest_px for line in view.lines)
            values["ball_px"].append(view.ball.center_px)
            wider = view.ball.diameter_px
            values["diameter_px"].append(None if wider is None else abs(wider))
            values["jac"].extend(view.jac)
            values["position_m"].append(view.position_m)
    return {
        name: _compute_median_and_tail(numbers, name == "jac") for name, numbers in values.items()
    }


def _compute_median_and_tail(numbers: list[float | None], low: bool) -> MedianAndTail:
    known = [number for number in numbers if number is not None]
    if not known:
        return MedianAndTail(0)
    median, tail = np.quantile(known, [0.5, 0.05 if low else 0.95]).tolist()
    return MedianAndTail(len(known), median, tail)


def _find_group_disagreements(
    distance: GroupDistance, verdicts: tuple[str | None, str | None], limits: AgreementLimits
) -> Iterator[Disagreement]:
    first, second = verdicts
    if first != second and first is not None and second is not None:
        yield Disagreement("verdict", f"annotation a: {first}, annotation b: {second}")
    ball = distance.ball
    if ball.a != ball.b:
        yield Disagreement("ball_3d", f"only annotation {'a' if ball.a else 'b'} yields a 3D ball")
    elif ball.distance_m is not None and ball.distance_m > limits.ball_m:
        words = {
            True: ", which both uncertainties explain",
            False: ", more than their uncertainties explain",
        }
        explained = "" if ball.is_explained is None else words[ball.is_explained]
        text = f"the 3D balls are {ball.distance_m:.2f} m apart{explained}"
        yield Disagreement("ball_m", text, None, None, ball.distance_m, limits.ball_m)


def _find_view_disagreements(view: ViewDistance, limits: AgreementLimits) -> Iterator[Disagreement]:
    if view.included[0] != view.included[1]:
        yield Disagreement(
            "view", f"only annotation {'ba'[view.included[0]]} uses the view", view.view
        )
    ball = view.ball
    if not ball.is_same_state:
        words = {
            "none": "not annotated",
            "out_of_view": "out of view",
            "several": "drawn several times",
        }
        first, second = (words.get(state, state) for state in (ball.a, ball.b))
        yield Disagreement(
            "ball", f"the ball is {first} in annotation a, {second} in annotation b", view.view
        )
    apart = ball.center_px
    if apart is not None and apart > limits.ball_px:
        text = f"the centres of the ball are {apart:.1f} px apart"
        yield Disagreement("ball_px", text, view.view, None, apart, limits.ball_px)
    wider = ball.diameter_px
    if wider is not None and abs(wider) > limits.diameter_px:
        text = f"the ball of annotation {'b' if wider > 0 else 'a'} is {abs(wider):.1f} px wider"
        yield Disagreement("diameter_px", text, view.view, None, abs(wider), limits.diameter_px)
    yield from _find_line_disagreements(view, limits)
    jac = view.lowest_jac
    if jac is not None and jac < limits.jac:
        text = f"the camera of one annotation fits the lines of the other with JaC {jac:.2f}"
        yield Disagreement("jac", text, view.view, None, jac, limits.jac)


def _find_line_disagreements(view: ViewDistance, limits: AgreementLimits) -> Iterator[Disagreement]:
    alone = [line for line in view.lines if line.only is not None]
    if len(alone) > limits.markings:
        names = ", ".join(f"{line.marking} (annotation {line.only})" for line in alone)
        count, limit = float(len(alone)), float(limits.markings)
        yield Disagreement(
            "markings", f"drawn by only one person: {names}", view.view, None, count, limit
        )
    for line in view.lines:
        if line.largest_px is not None and line.largest_px > limits.line_px:
            text = f"{line.marking} lies up to {line.largest_px:.1f} px apart"
            value, limit = line.largest_px, limits.line_px
            yield Disagreement("line_px", text, view.view, line.marking, value, limit)
