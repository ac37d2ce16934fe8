"""Numbers written so that a reader that scales or shifts them has exactly the same ones again."""

from __future__ import annotations

import math
from collections.abc import Callable

_STEPS = 4


def exact_inverse(guess: float, target: float, read: Callable[[float], float]) -> float:
    """The number next to ``guess`` from which ``read`` makes exactly ``target``.

    A reader that multiplies or subtracts rounds, and so does the writer's inverse; without this
    a value would wander by a last digit with every export and import.

    Args:
        guess: The inverse but for rounding.
        target: What must be read.
        read: What the reader does with the number in the file.

    Returns:
        The guess where no neighbour is exact, which happens only to values that no file held.
    """
    below = above = guess
    for _ in range(_STEPS):
        if read(below) == target:
            return below
        if read(above) == target:
            return above
        below, above = math.nextafter(below, -math.inf), math.nextafter(above, math.inf)
    return guess
