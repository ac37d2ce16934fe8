"""Plausible: where a ball can be, and what is wrong with a place where it cannot."""

from __future__ import annotations

from app.soccer.frames import height_above_grass
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.numbers import format_metres

LOW_BALL_M = 2.0
"""Up to this height beside the pitch a ball counts as one that lies there."""


def is_plausible_position(point: tuple[float, float, float], pitch: Pitch, policy: Policy) -> bool:
    """Whether a ball can be there: on or near the pitch, not below it, not sky-high.

    Args:
        point: Pitch frame, metres.
        pitch: The pitch.
        policy: Holds the limits.
    """
    return not implausible_reasons(point, pitch, policy)


def implausible_reasons(
    point: tuple[float, float, float], pitch: Pitch, policy: Policy
) -> list[tuple[float, float, str]]:
    """What is wrong with a place: number and limit, metres, and the words for it.

    Beside the pitch balls lie and roll, and high balls fly over it: the higher a ball, the less far
    outside may it be, down to nothing at the largest height.
    """
    x, y, z = point
    height = height_above_grass(z)
    outside = max(abs(x) - pitch.length / 2, abs(y) - pitch.width / 2)
    reach = policy.outside_pitch_m * (1 - height / policy.max_height_m)
    if LOW_BALL_M < height <= policy.max_height_m and reach < outside <= policy.outside_pitch_m:
        words = f"is {outside:.0f} m outside the pitch at a height of {format_metres(height)}"
        return [(outside, reach, words)]
    return [
        (number, limit, words)
        for number, limit, words in (
            (z, policy.below_grass_m, f"lies {format_metres(z)} below the grass"),
            (height, policy.max_height_m, f"flies {format_metres(height)} above the grass"),
            (outside, policy.outside_pitch_m, f"is {outside:.0f} m outside the pitch"),
        )
        if number > limit
    ]
