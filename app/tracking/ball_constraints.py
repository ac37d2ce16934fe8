"""Constraints of a track that people's corrections are: events that happened, events that did not, and places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.tracking.ball_models import NOTHING

_SAME_S = 1e-3
"""Between an instant that is said and the knot that it is."""


@dataclass(frozen=True)
class EventConstraint:
    """An event that happened between two instants, or did not.

    Attributes:
        kind: By number, ``ball_models.KICK`` or ``BOUNCE``.
        first, last: Between which instants, seconds.
        happened: Whether it did.
    """

    kind: int
    first: float
    last: float
    happened: bool


@dataclass(frozen=True)
class PlaceConstraint:
    """Where a ball is at an instant, in one direction.

    Attributes:
        time: Seconds.
        normal: The direction, a unit vector, shape (3,).
        value: Along it, metres from the centre mark.
        sigma: How surely, metres.
    """

    time: float
    normal: tuple[float, float, float]
    value: float
    sigma: float


@dataclass(frozen=True)
class TrackConstraints:
    """All that is said of a stretch."""

    events: tuple[EventConstraint, ...] = ()
    places: tuple[PlaceConstraint, ...] = ()


@dataclass(frozen=True)
class ConstraintsByKnot:
    """What is said, by the knots of a run.

    Attributes:
        wanted: Kind of the event that happens once before one of the knots of its window, ``NOTHING`` for
            knots of none, shape (K,).
        begin: First knot of the window, shape (K,).
        due: Whether a knot is the last of its window, shape (K,).
        may_not: Kinds that do not happen before each knot but for what is wanted, as bits, shape (K,).
        at: Knot of each place, increasing, shape (Q,).
        normal: Directions of places, shape (Q, 3).
        value: Metres along them, shape (Q,).
        sigma: Metres, shape (Q,).
    """

    wanted: IntArray
    begin: IntArray
    due: BoolArray
    may_not: IntArray
    at: IntArray
    normal: FloatArray
    value: FloatArray
    sigma: FloatArray

    @property
    def required_event_windows(self) -> list[tuple[int, int, int]]:
        """First and last knot before which each event that is wanted may happen, and its kind."""
        ends = np.flatnonzero(self.due).tolist()
        return [(int(self.begin[end]), end, int(self.wanted[end])) for end in ends]

    def allows_event(self, kind: int, origin: int, to: int) -> bool:
        """Whether an event that stands before one knot may stand before another."""
        if int(self.wanted[origin]) == kind:
            return bool(self.wanted[to] == kind and self.begin[to] == self.begin[origin])
        return not int(self.may_not[to]) >> kind & 1


def build_constraints_by_knot(times: FloatArray, said: TrackConstraints) -> ConstraintsByKnot:
    """What is said of a run.

    Args:
        times: Of its knots, increasing, seconds, shape (K,).
        said: Of the stretch; what lies beside the run is left out.
    """
    count = len(times)
    wanted = np.full(count, NOTHING, dtype=np.int64)
    begin, may_not = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    due = np.zeros(count, dtype=bool)
    for event in sorted(said.events, key=lambda one: (one.last, one.kind)):
        # The intervals before these knots share time with the event's.
        knots = np.flatnonzero((times[1:] > event.first) & (times[:-1] < event.last)) + 1
        if not event.happened:
            may_not[knots] |= 1 << event.kind
        elif len(knots):
            free = knots[wanted[knots] == NOTHING]
            if not len(free):
                free = np.flatnonzero((wanted == NOTHING) & (np.arange(count) > knots[-1]))[:1]
            wanted[free], begin[free] = event.kind, free[:1]
            due[free[-1:]] = True
    places = []
    for place in said.places:
        at = int(np.abs(times - place.time).argmin())
        if abs(times[at] - place.time) < _SAME_S:
            places.append((at, place))
    places.sort(key=lambda one: one[0])
    return ConstraintsByKnot(
        wanted,
        begin,
        due,
        may_not,
        np.array([at for at, _ in places], dtype=np.int64),
        np.array([place.normal for _, place in places], dtype=float).reshape(-1, 3),
        np.array([place.value for _, place in places], dtype=float),
        np.array([place.sigma for _, place in places], dtype=float),
    )
