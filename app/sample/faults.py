"""Faults: mistakes planted into a scene, each with the record of what was done."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.sample.play import Instant, advance_instant
from app.sample.scene import FAULT_KINDS, PlantedFault
from app.soccer.annotation import Lines, make_lines
from app.soccer.group import View
from app.soccer.pitch import CIRCLES, opposite_marking

FAULT_SHARE = 1 / 3
POINT_SHIFT_PX = (30.0, 90.0)
TINY_BASELINE_M = (0.1, 0.7)
BALL_SHIFT_M = (1.8, 7.0)
PLAIN_PX = 250.0
"""Length from which on nobody can miss a line."""
UNDRAWN = 2
"""Lines that are left undrawn: with one alone most views still pass."""
SMALLEST_GAP_M = 1.2
"""Distance of two rays that no longer meet, so that the fault can be seen at all."""


@dataclass(frozen=True)
class FaultPlan:
    """What shall go wrong in a group, drawn before anything is made."""

    kind: str
    view_index: int
    seed: int


def plan_fault(rng: np.random.Generator, views: int) -> FaultPlan | None:
    """About every third group gets one fault, all kinds alike."""
    draw, kind, replay, any_view = rng.random(), rng.integers(6), rng.random(), rng.random()
    if draw >= FAULT_SHARE:
        return None
    name = FAULT_KINDS[int(kind)]
    # These three are faults of a replay against the main camera.
    of_replay = name in ("swapped_sides", "not_synchronous", "tiny_baseline")
    index = 1 + int(replay * (views - 1)) if of_replay else int(any_view * views)
    return FaultPlan(name, index, int(rng.integers(1 << 31)))


def choose_position_beside_main(
    rng: np.random.Generator, main: FloatArray
) -> tuple[FloatArray, float]:
    """A replay camera next to the main camera, and its distance from it, metres."""
    direction = rng.normal(0, 1, 3) * (1.0, 0.6, 0.3)
    distance = float(rng.uniform(*TINY_BASELINE_M))
    return main + direction / np.linalg.norm(direction) * distance, distance


def choose_another_instant(
    rng: np.random.Generator, instant: Instant, main: FloatArray, replay: FloatArray
) -> tuple[Instant, float]:
    """A moment at which the ball is elsewhere, such that the two rays miss each other.

    Args:
        main: Position of the camera that shows ``instant``, metres, shape (3,).
        replay: Position of the camera that shows the other moment, metres, shape (3,).

    Returns:
        The moment, and how far the ball moved, metres.
    """
    best: tuple[float, Instant, float] | None = None
    for _ in range(30):
        angle, distance = rng.uniform(0, 2 * np.pi), rng.uniform(*BALL_SHIFT_M)
        shift = np.array([np.cos(angle), np.sin(angle), -abs(rng.normal(0, 0.25))]) * distance
        moved = advance_instant(instant, float(rng.choice([-1, 1]) * rng.uniform(0.3, 0.9)), shift)
        moved_by = float(np.linalg.norm(moved.ball - instant.ball))
        gap = _distance_between_rays(main, instant.ball, replay, moved.ball)
        on_pitch = abs(moved.ball[0]) < 53.5 and abs(moved.ball[1]) < 34.5
        if on_pitch and (best is None or gap > best[0]):
            best = gap, moved, moved_by
        if best is not None and best[0] > SMALLEST_GAP_M:
            break
    if best is None:
        return instant, 0.0
    return best[1], best[2]


def _distance_between_rays(
    a: FloatArray, ball_a: FloatArray, b: FloatArray, ball_b: FloatArray
) -> float:
    normal = np.cross(ball_a - a, ball_b - b)
    return float(abs((b - a) @ normal) / max(float(np.linalg.norm(normal)), 1e-12))


def plant_annotation_fault(plan: FaultPlan, view: View) -> tuple[View, PlantedFault]:
    """Plant a fault of annotation into a view.

    Args:
        plan: Of kind ``bad_point``, ``swapped_sides``, ``missing_ball`` or ``wrong_label``.
    """
    rng = np.random.default_rng([plan.seed, 0xBAD])
    if plan.kind == "missing_ball":
        return replace(view, balls=()), PlantedFault(plan.kind, view.key)
    if plan.kind == "swapped_sides":
        lines = {opposite_marking(name): points for name, points in view.station.lines.items()}
        return _replace_lines(view, make_lines(lines)), PlantedFault(plan.kind, view.key)
    if plan.kind == "bad_point":
        return _misplace_point(rng, view)
    return _swap_label(rng, view)


def remove_markings(plan: FaultPlan, view: View) -> tuple[View, tuple[PlantedFault, ...]]:
    """Take the points of straight markings away that are plain to see, as if nobody drew them.

    Args:
        plan: Of kind ``undrawn_line``.
    """
    rng = np.random.default_rng([plan.seed, 0xBAD])
    lines = dict(view.station.lines)
    plain = sorted(
        n for n, p in lines.items() if n not in CIRCLES and _measure_point_extent(p) > PLAIN_PX
    )
    count = min(UNDRAWN, len(plain))
    chosen = [str(name) for name in rng.choice(plain or [""], count, replace=False)]
    for name in chosen:
        del lines[name]
    faults = tuple(PlantedFault(plan.kind, view.key, name) for name in chosen)
    return _replace_lines(view, make_lines(lines)), faults


def _misplace_point(rng: np.random.Generator, view: View) -> tuple[View, PlantedFault]:
    lines = dict(view.station.lines)
    straight = [
        n
        for n, p in lines.items()
        if n not in CIRCLES and len(p) >= 3 and _measure_point_extent(p) > 60
    ]
    marking = str(rng.choice(straight or list(lines)))
    points = list(lines[marking])
    index = int(rng.integers(len(points)))
    along = np.subtract(points[-1], points[0])
    across = np.array([-along[1], along[0]]) / max(float(np.linalg.norm(along)), 1e-9)
    amount = float(rng.uniform(*POINT_SHIFT_PX))
    moved = (np.array(points[index]) + across * amount * rng.choice([-1, 1])).round(2)
    points[index] = type(points[index])(float(moved[0]), float(moved[1]))
    lines[marking] = tuple(points)
    fault = PlantedFault("bad_point", view.key, marking, marking, index, amount)
    return _replace_lines(view, make_lines(lines)), fault


def _swap_label(rng: np.random.Generator, view: View) -> tuple[View, PlantedFault]:
    lines = dict(view.station.lines)
    mistakes = [
        (true, label)
        for true, points in lines.items()
        for label in list_confusable_markings(true)
        if label not in lines and _measure_point_extent(points) > 60
    ]
    if not mistakes:
        # All that could be confused is annotated itself: the wrong clicks replace the right ones.
        longest = max(lines, key=lambda name: _measure_point_extent(lines[name]))
        mistakes = [(longest, label) for label in list_confusable_markings(longest)]
    true, label = mistakes[int(rng.integers(len(mistakes)))]
    lines[label] = lines.pop(true)
    return _replace_lines(view, make_lines(lines)), PlantedFault(
        "wrong_label", view.key, label, true
    )


def list_confusable_markings(marking: str) -> tuple[str, ...]:
    """Names that annotators write for this marking by mistake.

    Example:
        >>> list_confusable_markings("Small rect. left main")
        ('Big rect. left main', 'Small rect. right main')
    """
    other_side = _swap_words(marking, "left", "right")
    if marking in CIRCLES:
        return tuple(name for name in CIRCLES if name != marking)
    if "rect." in marking:
        kind = _swap_words(marking, "Big", "Small")
        return (
            kind,
            other_side if marking.endswith("main") else _swap_words(marking, "top", "bottom"),
        )
    if marking == "Middle line":
        return ("Side line left", "Side line right")
    if marking.startswith("Side line"):
        sides = ("left", "right") if marking.endswith(("top", "bottom")) else ("top", "bottom")
        opposite = (
            other_side
            if marking.endswith(("left", "right"))
            else _swap_words(marking, "top", "bottom")
        )
        return (opposite, *(f"Side line {side}" for side in sides))
    if "post" in marking:
        goal, post = marking.split(" post ")
        return (
            f"{goal} post {_swap_words(post, 'left', 'right')}",
            f"{_swap_words(goal, 'left', 'right')} post {post}",
        )
    return (other_side,)


def _swap_words(text: str, a: str, b: str) -> str:
    words = {a: b, b: a}
    return " ".join(words.get(word, word) for word in text.split(" "))


def _measure_point_extent(points: tuple[tuple[float, float], ...]) -> float:
    array = np.array(points)
    return float(np.linalg.norm(array.max(axis=0) - array.min(axis=0)))


def _replace_lines(view: View, lines: Lines) -> View:
    return replace(view, station=replace(view.station, lines=lines))
