"""Instant: where ball, players and referee are at one moment, pitch frame, metres."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.soccer.policy import PAPER

BALL_DIAMETER = PAPER.ball_diameter_m
HALF_LENGTH, HALF_WIDTH = 52.5, 34.0
TEAM = 11
PEOPLE = 2 * TEAM + 1
"""Home keeper and ten, away keeper and ten, referee."""
PLAYER_RADIUS = 0.32
FORMATION = np.array(
    [
        (-0.75, -0.75), (-0.85, -0.25), (-0.85, 0.25), (-0.75, 0.75),
        (0.0, -0.8), (-0.15, -0.25), (-0.1, 0.3), (0.05, 0.85), (0.75, -0.3), (0.85, 0.25),
    ]
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Instant:
    """Everything that moves, at one moment.

    Attributes:
        ball: Centre of the ball, shape (3,); on the grass z is minus its radius.
        spin: How the ball is turned, a rotation vector, shape (3,).
        feet: Where people stand on the grass, shape (23, 2).
        heading: Direction each one faces, radians from +x to +y, shape (23,).
        speed: Metres a second, shape (23,).
        stride: Phase of the running stride, radians, shape (23,).
        height: Of each person, metres, shape (23,).
        numbers: Of the shirts; 0 for the referee.
    """

    ball: FloatArray
    spin: FloatArray
    feet: FloatArray
    heading: FloatArray
    speed: FloatArray
    stride: FloatArray
    height: FloatArray
    numbers: tuple[int, ...]


def make_instant(rng: np.random.Generator, numbers: tuple[int, ...]) -> Instant:
    """A moment of play, most often near one of the penalty areas."""
    ball, attack = _place_ball(rng)
    feet = _place_people(rng, ball, attack)
    to_ball = ball[:2] - feet
    heading = np.arctan2(to_ball[:, 1], to_ball[:, 0]) + rng.normal(0, 0.6, PEOPLE)
    speed = np.clip(rng.gamma(1.4, 1.6, PEOPLE), 0, 7.5)
    speed[[0, TEAM]] *= 0.25
    return Instant(
        ball=ball,
        spin=rng.normal(0, 1.4, 3),
        feet=push_people_apart(feet),
        heading=heading,
        speed=speed,
        stride=rng.uniform(0, 2 * np.pi, PEOPLE),
        height=np.clip(rng.normal(1.82, 0.06, PEOPLE), 1.66, 1.98),
        numbers=numbers,
    )


def shirt_numbers(rng: np.random.Generator) -> tuple[int, ...]:
    """Shirt numbers of a match: a keeper wears 1, the others do not repeat within a team."""
    teams = []
    for _ in range(2):
        field = np.sort(rng.choice(np.arange(2, 40), TEAM - 1, replace=False))
        teams += [1, *map(int, field)]
    return (*teams, 0)


def advance_instant(instant: Instant, seconds: float, ball_shift: FloatArray) -> Instant:
    """The moment some seconds later (earlier if negative): everybody ran on, the ball moved.

    Args:
        ball_shift: Metres, shape (3,); the ball stays above the grass.
    """
    ball = instant.ball + ball_shift
    ball[2] = min(ball[2], -BALL_DIAMETER / 2)
    direction = np.column_stack([np.cos(instant.heading), np.sin(instant.heading)])
    feet = instant.feet + direction * (instant.speed * seconds)[:, None]
    return replace(
        instant,
        ball=ball,
        spin=instant.spin + 0.7 * seconds,
        feet=push_people_apart(feet),
        stride=instant.stride + 9.0 * seconds,
    )


def clear_lines_of_sight(instant: Instant, cameras: FloatArray) -> Instant:
    """The same moment with nobody between the ball and a camera, or inside the ball.

    Args:
        cameras: Camera positions, shape (N, 3).
    """
    feet = instant.feet.copy()
    for _ in range(3):
        _move_people_aside(feet, instant.ball, cameras)
    return replace(instant, feet=feet)


def _move_people_aside(feet: FloatArray, ball: FloatArray, cameras: FloatArray) -> None:
    for camera in cameras:
        toward = camera - ball
        distance = float(np.hypot(toward[0], toward[1]))
        direction = toward[:2] / distance
        rise = -toward[2] / distance
        # The line of sight is above a head from here on, and below one before an airborne ball.
        clear = (2.1 + ball[2]) / rise if rise > 1e-6 else distance
        offset = feet - ball[:2]
        along, across = offset @ direction, offset @ np.array([-direction[1], direction[0]])
        blocks = (along > -0.2) & (along < min(clear, distance) + 0.4) & (np.abs(across) < 0.75)
        side = np.where(across >= 0, 1.0, -1.0)
        shift = np.where(blocks, side * 0.85 - across, 0.0)
        feet += shift[:, None] * np.array([-direction[1], direction[0]])


def _place_ball(rng: np.random.Generator) -> tuple[FloatArray, float]:
    attack = 1.0 if rng.random() < 0.5 else -1.0
    if rng.random() < 0.85:
        x = attack * (HALF_LENGTH - np.clip(rng.gamma(2.2, 6.0), 1.0, 32.0))
        y = np.clip(rng.normal(0, 14.0), -32.0, 32.0)
    else:
        x, y = rng.uniform(-22, 22), rng.uniform(-26, 26)
    radius = BALL_DIAMETER / 2
    kind = rng.random()
    if kind < 0.55:
        height = radius
    elif kind < 0.82:
        height = radius + abs(rng.normal(0, 0.5))
    else:
        height = rng.uniform(1.0, 8.0)
    return np.array([x, y, -height]), attack


def _place_people(rng: np.random.Generator, ball: FloatArray, attack: float) -> FloatArray:
    """Attackers of ``attack`` are the home team when attack is +1; both teams crowd the ball."""
    focus = np.array([0.72 * ball[0] + 0.02 * attack, 0.35 * ball[1]])
    scale = np.array([17.0, 21.0])
    teams = []
    for sign in (1.0, -1.0):  # home attacks +x, away attacks -x
        spots = focus + FORMATION * scale * np.array([sign, 1.0]) + rng.normal(0, 3.2, (10, 2))
        pulled = rng.random(10) < 0.35
        spots[pulled] += 0.5 * (ball[:2] - spots[pulled])
        keeper = np.array([-sign * HALF_LENGTH, 0.0])
        reach = rng.uniform(0.06, 0.16) * (ball[:2] - keeper)
        teams.append(np.vstack([keeper + reach + rng.normal(0, 0.3, 2), spots]))
    home, away = teams
    angles = rng.uniform(0, 2 * np.pi, 2)
    near = ball[:2] + np.column_stack([np.cos(angles), np.sin(angles)]) * [[0.75], [2.1]]
    home[1 + int(rng.integers(10))] = near[0]
    away[1 + int(rng.integers(10))] = near[1]
    referee = ball[:2] - np.array([attack * rng.uniform(7, 13), rng.normal(0, 8)])
    people = np.vstack([home, away, referee])
    limit = np.array([HALF_LENGTH + 0.5, HALF_WIDTH + 0.5])
    inside: FloatArray = np.clip(people, -limit, limit)
    return inside


def push_people_apart(feet: FloatArray) -> FloatArray:
    feet = feet.copy()
    for _ in range(4):
        offset = feet[:, None] - feet[None]
        distance = np.sqrt((offset**2).sum(axis=2)) + np.eye(len(feet)) * 9.0
        push = np.clip(1.3 - distance, 0, None) / 2
        # Two people on the very same spot part along x.
        direction = np.where(
            distance[..., None] > 1e-6, offset / (distance[..., None] + 1e-12), [1.0, 0.0]
        )
        feet += (direction * push[..., None]).sum(axis=1)
    return feet
