"""The pitch and its 26 named markings in the pitch frame (docs/coordinates.md).

Metres, origin at the centre mark, x to the right goal, y to the touchline of the main cameras
("bottom"), z down. Heights above the grass are negative z.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from app.errors import InputError, UnknownMarkingError
from app.geometry.arrays import FloatArray
from app.soccer.choices import GoalEdge

PENALTY_AREA_LENGTH = 16.5
PENALTY_AREA_WIDTH = 40.32
GOAL_AREA_LENGTH = 5.5
GOAL_AREA_WIDTH = 18.32
PENALTY_MARK_DISTANCE = 11.0
CIRCLE_RADIUS = 9.15
GOAL_WIDTH = 7.32
GOAL_HEIGHT = 2.44
FRAME_WIDTH = 0.12
"""Of posts and crossbar: the Laws allow no more, and nobody builds less. Lines are as wide."""
LENGTH_RANGE = (90.0, 120.0)
WIDTH_RANGE = (45.0, 90.0)

MARKINGS: tuple[str, ...] = (
    "Big rect. left bottom",
    "Big rect. left main",
    "Big rect. left top",
    "Big rect. right bottom",
    "Big rect. right main",
    "Big rect. right top",
    "Circle central",
    "Circle left",
    "Circle right",
    "Goal left crossbar",
    "Goal left post left",
    "Goal left post right",
    "Goal right crossbar",
    "Goal right post left",
    "Goal right post right",
    "Middle line",
    "Side line bottom",
    "Side line left",
    "Side line right",
    "Side line top",
    "Small rect. left bottom",
    "Small rect. left main",
    "Small rect. left top",
    "Small rect. right bottom",
    "Small rect. right main",
    "Small rect. right top",
)
CIRCLES = ("Circle central", "Circle left", "Circle right")
GOAL_PARTS = tuple(name for name in MARKINGS if name.startswith("Goal"))
WITHOUT_GEOMETRY = ("Line unknown", "Goal unknown")


def canonical_marking(name: str) -> str:
    """The name as Touchline spells it; spaces at the ends do not matter.

    Raises:
        UnknownMarkingError: None of the 26 markings has that name.
    """
    stripped = name.strip()
    if stripped not in _KNOWN:
        raise UnknownMarkingError(name, MARKINGS)
    return stripped


def find_marking_like(name: str) -> str | None:
    """The marking that a name means, whatever its capitals, spaces, dots and underscores.

    Example:
        >>> find_marking_like("Big_rect_left_top"), find_marking_like("Line unknown")
        ('Big rect. left top', None)
    """
    return _LOOSE.get(_keep_letters_and_digits(name))


def _keep_letters_and_digits(name: str) -> str:
    return "".join(letter for letter in name.lower() if letter.isalnum())


def opposite_marking(marking: str) -> str:
    """The marking that this one becomes when the pitch is turned by 180 degrees.

    Example:
        >>> opposite_marking("Big rect. left top")
        'Big rect. right bottom'
    """
    if marking.startswith("Goal") and "post" in marking:
        # Both goals name their posts as seen from the pitch, so a half turn keeps the post.
        side, post = marking.split()[1], marking.split()[3]
        return f"Goal {_SWAP[side]} post {post}"
    return " ".join(_SWAP.get(word, word) for word in marking.split(" "))


def mirrored_marking(marking: str) -> str:
    """The marking that this one becomes when left and right of the pitch are exchanged as in a mirror.

    Example:
        >>> mirrored_marking("Goal left post left"), mirrored_marking("Side line top")
        ('Goal right post right', 'Side line top')
    """
    return " ".join(_MIRROR.get(word, word) for word in marking.split(" "))


_KNOWN = frozenset(MARKINGS)
_LOOSE = {_keep_letters_and_digits(marking): marking for marking in MARKINGS}
_SWAP = {"left": "right", "right": "left", "top": "bottom", "bottom": "top"}
_MIRROR = {"left": "right", "right": "left"}


@dataclass(frozen=True)
class Segment:
    """A straight marking from ``start`` to ``end``, pitch frame, metres."""

    start: tuple[float, float, float]
    end: tuple[float, float, float]


@dataclass(frozen=True)
class Arc:
    """A circular marking on the grass, counted from angle ``first`` up to ``last``, radians.

    The angle grows from +x to +y. A full circle has ``last - first = 2 pi``.
    """

    center: tuple[float, float]
    radius: float
    first: float
    last: float

    @property
    def is_full(self) -> bool:
        """Whether the marking is a full circle."""
        return self.last - self.first >= 2 * math.pi - 1e-12


@dataclass(frozen=True)
class Pitch:
    """A pitch of the given size; everything else is fixed by the Laws of the Game.

    ``goal`` says which line of a goal's frame and of the paint its markings are. It is no property of a pitch, so
    nothing of it is stored: ``CalibrationPolicy.pitch_for_fitted_lines`` chooses it where lines are fitted.
    """

    length: float = 105.0
    width: float = 68.0
    goal: GoalEdge = field(default="inner", repr=False, kw_only=True)

    def __post_init__(self) -> None:
        for name, value, (low, high) in (
            ("length", self.length, LENGTH_RANGE),
            ("width", self.width, WIDTH_RANGE),
        ):
            if not low <= value <= high:
                raise InputError(
                    f"pitch {name} is {value} m; the Laws of the Game allow {low} to {high}"
                )

    @cached_property
    def shapes(self) -> dict[str, Segment | Arc]:
        """Geometry of each marking, by name."""
        half = FRAME_WIDTH / 2
        beside, inside = half * (self.goal != "inner"), half * (self.goal == "laws")
        return _make_marking_shapes(self.length / 2, self.width / 2, beside, inside)

    def with_goal_edge(self, goal: GoalEdge) -> Pitch:
        """The same pitch with that line of its goals, and of its lines."""
        return self if goal == self.goal else replace(self, goal=goal)

    def sample(self, marking: str, spacing: float, circle_spacing: float) -> FloatArray:
        """Points along a marking, pitch frame, shape (N, 3).

        Steps are counted from the start, as the public sn-calibration evaluator counts them:
        the last step may be longer (up to twice) and the central circle stays open by one step.

        Args:
            marking: One of ``MARKINGS``.
            spacing: Step on straight markings, metres.
            circle_spacing: Step on circles, metres.
        """
        shape = self.shapes[marking]
        if isinstance(shape, Arc):
            return _sample_arc(shape, circle_spacing)
        start, end = np.array(shape.start), np.array(shape.end)
        length = float(np.linalg.norm(end - start))
        steps = np.arange(int(length / spacing - 1) + 1)
        direction = (end - start) / length
        return np.vstack([start + np.outer(steps * spacing, direction), end])


def _sample_arc(arc: Arc, spacing: float) -> FloatArray:
    count = int(arc.radius * (arc.last - arc.first) / spacing)
    angles = arc.first + np.arange(count + (0 if arc.is_full else 1)) * spacing / arc.radius
    if not arc.is_full:
        angles = np.append(angles, arc.last)
    x = arc.center[0] + arc.radius * np.cos(angles)
    y = arc.center[1] + arc.radius * np.sin(angles)
    return np.column_stack([x, y, np.zeros_like(x)])


def _make_marking_shapes(
    half_length: float, half_width: float, beside: float, inside: float
) -> dict[str, Segment | Arc]:
    """All shapes; those of goals lie ``beside`` their inner edges, lines ``inside`` the plan, metres.

    Goals stand on the outer edge of the goal line, and marks lie where the plan has them.
    """
    end, side_line, radius = half_length - inside, half_width - inside, CIRCLE_RADIUS - inside
    shapes: dict[str, Segment | Arc] = {
        "Side line top": _make_grass_segment((-end, -side_line), (end, -side_line)),
        "Side line bottom": _make_grass_segment((-end, side_line), (end, side_line)),
        "Side line left": _make_grass_segment((-end, -side_line), (-end, side_line)),
        "Side line right": _make_grass_segment((end, -side_line), (end, side_line)),
        "Middle line": _make_grass_segment((0.0, -side_line), (0.0, side_line)),
        "Circle central": Arc((0.0, 0.0), radius, 0.0, 2 * math.pi),
    }
    # The penalty arc is what lies outside the penalty area.
    half_opening = math.acos((PENALTY_AREA_LENGTH - inside - PENALTY_MARK_DISTANCE) / radius)
    for side, sign in (("left", -1.0), ("right", 1.0)):
        goal_line = sign * half_length
        for name, depth, width in (
            ("Big rect.", PENALTY_AREA_LENGTH, PENALTY_AREA_WIDTH),
            ("Small rect.", GOAL_AREA_LENGTH, GOAL_AREA_WIDTH),
        ):
            front = goal_line - sign * (depth - inside)
            left, right = sorted((sign * end, front))
            half = width / 2 - inside
            shapes[f"{name} {side} top"] = _make_grass_segment((left, -half), (right, -half))
            shapes[f"{name} {side} bottom"] = _make_grass_segment((left, half), (right, half))
            shapes[f"{name} {side} main"] = _make_grass_segment((front, -half), (front, half))
        mark = goal_line - sign * PENALTY_MARK_DISTANCE
        facing = 0.0 if side == "left" else math.pi
        shapes[f"Circle {side}"] = Arc(
            (mark, 0.0), radius, facing - half_opening, facing + half_opening
        )
        # Posts are named as seen from the pitch.
        half, height = GOAL_WIDTH / 2 + beside, GOAL_HEIGHT + beside
        post_left, post_right = -sign * half, sign * half
        top_left = (goal_line, post_left, -height)
        top_right = (goal_line, post_right, -height)
        crossbar = (top_right, top_left) if side == "left" else (top_left, top_right)
        shapes[f"Goal {side} crossbar"] = Segment(*crossbar)
        shapes[f"Goal {side} post left"] = Segment(top_left, (goal_line, post_left, 0.0))
        shapes[f"Goal {side} post right"] = Segment(top_right, (goal_line, post_right, 0.0))
    return shapes


def _make_grass_segment(start: tuple[float, float], end: tuple[float, float]) -> Segment:
    return Segment((*start, 0.0), (*end, 0.0))
