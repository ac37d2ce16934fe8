"""Agreement limits: how far apart two annotations of a group may lie and still agree."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from app.evaluation.annotation_distance import GroupDistance, ViewDistance


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
    def weight(self) -> float:
        """By which disagreements are ordered: how many times the limit it is."""
        if self.value is None or not self.limit:
            return 2.0
        over = self.value / self.limit
        return 1 / max(over, 1e-3) if self.kind == "jac" else over


@dataclass(frozen=True)
class Spread:
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
    found = list(_disagreements_of_group(distance, verdicts, limits))
    for view in distance.views:
        found.extend(_disagreements_of_view(view, limits))
    return tuple(sorted(found, key=lambda item: -item.weight))


def measure_spreads(distances: Iterable[GroupDistance]) -> dict[str, Spread]:
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
    return {name: _median_and_tail(numbers, name == "jac") for name, numbers in values.items()}


def _median_and_tail(numbers: list[float | None], low: bool) -> Spread:
    known = [number for number in numbers if number is not None]
    if not known:
        return Spread(0)
    median, tail = np.quantile(known, [0.5, 0.05 if low else 0.95]).tolist()
    return Spread(len(known), median, tail)


def _disagreements_of_group(
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


def _disagreements_of_view(view: ViewDistance, limits: AgreementLimits) -> Iterator[Disagreement]:
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
    yield from _disagreements_of_lines(view, limits)
    jac = view.jac_least
    if jac is not None and jac < limits.jac:
        text = f"the camera of one annotation fits the lines of the other with JaC {jac:.2f}"
        yield Disagreement("jac", text, view.view, None, jac, limits.jac)


def _disagreements_of_lines(view: ViewDistance, limits: AgreementLimits) -> Iterator[Disagreement]:
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
