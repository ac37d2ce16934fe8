"""Play: where ball, players and referee are, at one moment (pitch frame, metres) and over minutes: passes that roll or
fly, bounces, and who runs where.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

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


def choose_shirt_numbers(rng: np.random.Generator) -> tuple[int, ...]:
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


RADIUS = BALL_DIAMETER / 2
GRAVITY, DRAG = 9.81, 0.012
"""Metres a second squared; and of the air, a metre."""
ROLLING, BOUNCE, BOUNCE_LOSS = 0.6, 0.6, 0.3
"""What the grass takes of a rolling ball, metres a second squared; and of a bounce: a share, and metres a second."""
BALL_STEP, PEOPLE_STEP = 0.01, 0.04
"""Seconds."""
REACH = np.array([46.0, 28.0])
"""Passes stay within it, metres."""
ATTACK_SECONDS, ATTACK_M = 55.0, 36.0
"""Play goes from one end to the other, and back."""
RUN, SPRINT = 6.0, 8.5
"""Metres a second."""

BallMode = Literal["held", "roll", "flight"]


def step_ball(place: FloatArray, velocity: FloatArray, seconds: float) -> BallMode:
    """Let a ball that nobody touches move on: both change, metres and metres a second, heights upwards, shape (3,)."""
    flies = place[2] > RADIUS + 0.01 or velocity[2] > 0.5
    if flies:
        velocity -= seconds * DRAG * float(np.linalg.norm(velocity)) * velocity
        velocity[2] -= seconds * GRAVITY
    else:
        pace = float(np.hypot(velocity[0], velocity[1]))
        velocity[:2] *= max(0.0, 1 - seconds * ROLLING / max(pace, 0.1))
    place += seconds * velocity
    if place[2] < RADIUS:
        place[2], velocity[2] = RADIUS, max(0.0, -BOUNCE * velocity[2] - BOUNCE_LOSS)
    return "flight" if flies else "roll"


@dataclass(frozen=True, eq=False)
class Play:
    """Some minutes of a match.

    Attributes:
        ball: Its centre every ``BALL_STEP`` seconds, pitch frame, metres, shape (N, 3).
        modes: What it does meanwhile, N of them.
        feet: Where people stand every ``PEOPLE_STEP`` seconds, shape (M, 23, 2).
        heading, speed, stride: As an ``Instant`` has them, shape (M, 23).
        height: Of each person, shape (23,).
        numbers: Of the shirts.
    """

    ball: FloatArray
    modes: list[BallMode]
    feet: FloatArray
    heading: FloatArray
    speed: FloatArray
    stride: FloatArray
    height: FloatArray
    numbers: tuple[int, ...]

    def ball_at(self, seconds: FloatArray) -> FloatArray:
        """Where the ball is at times, shape (T, 3)."""
        steps = np.arange(len(self.ball)) * BALL_STEP
        return np.column_stack([np.interp(seconds, steps, axis) for axis in self.ball.T])

    def mode_at(self, seconds: float) -> BallMode:
        """What the ball does at a time."""
        return self.modes[min(max(round(seconds / BALL_STEP), 0), len(self.modes) - 1)]

    def instant_at(self, seconds: float) -> Instant:
        """Everything that moves, at a time between the first and the last."""
        at = min(max(seconds / PEOPLE_STEP, 0.0), len(self.feet) - 1.001)
        low, share = int(at), at - int(at)

        def interpolate(values: FloatArray) -> FloatArray:
            return np.asarray(values[low] + share * (values[low + 1] - values[low]))

        ball = self.ball_at(np.array([seconds]))[0]
        # A ball that rolls turns once along its rim.
        spin = np.array([ball[1], -ball[0], 0.0]) / RADIUS
        return Instant(
            ball=ball,
            spin=spin,
            feet=interpolate(self.feet),
            heading=interpolate(self.heading),
            speed=interpolate(self.speed),
            stride=interpolate(self.stride),
            height=self.height,
            numbers=self.numbers,
        )


def make_play(seconds: float, seed: int, numbers: tuple[int, ...]) -> Play:
    """Play of so many seconds: the same for the same seed; longer play begins as shorter does.

    Args:
        numbers: Of the shirts, 23.
    """
    ball, modes, receptions = _simulate_ball(seconds + 1.0, np.random.default_rng([seed, 0xBA]))
    rng = np.random.default_rng([seed, 0x9E])
    height = np.clip(rng.normal(1.82, 0.06, PEOPLE), 1.66, 1.98)
    feet, velocity = _simulate_people(ball, receptions, rng)
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    every = round(PEOPLE_STEP / BALL_STEP)
    to_ball = ball[::every, None, :2][: len(feet)] - feet
    toward = velocity + to_ball / np.maximum(np.linalg.norm(to_ball, axis=2, keepdims=True), 1.0)
    heading = np.unwrap(np.arctan2(toward[..., 1], toward[..., 0]), axis=0)
    stride = np.cumsum((2.0 + 1.25 * speed) * PEOPLE_STEP, axis=0) + rng.uniform(0, 6, PEOPLE)
    return Play(ball, modes, feet, heading, speed, stride, height, numbers)


def _simulate_ball(
    seconds: float, rng: np.random.Generator
) -> tuple[FloatArray, list[BallMode], list[tuple[int, int]]]:
    """Its places and modes; and each pass: the steps at which it is kicked, and received."""
    place, velocity = np.array([0.0, 0.0, RADIUS]), np.zeros(3)
    places, modes, passes = [], list[BallMode](), list[tuple[int, int]]()
    kicked, until, held = 0, 0.6, True
    for step in range(round(seconds / BALL_STEP)):
        now = step * BALL_STEP
        places.append(place * (1.0, 1.0, -1.0))
        modes.append("held" if held else step_ball(place, velocity, BALL_STEP))
        if held:
            place += BALL_STEP * velocity
        if held and now >= until:
            held, kicked = False, step
            velocity, until = _plan_pass(place, now, rng)
        elif (
            not held
            and place[2] < RADIUS + 0.08
            and (now >= until or (np.abs(place[:2]) > REACH + 3.0).any())
        ):
            held, until = True, now + rng.uniform(0.4, 1.6)
            way = _choose_pass_target(now, rng) - place[:2]
            velocity = np.array([*(rng.uniform(0.5, 3.5) * way / np.linalg.norm(way)), 0.0])
            place[2] = RADIUS
            passes.append((kicked, step))
    return np.array(places), modes, passes


def _choose_pass_target(now: float, rng: np.random.Generator) -> FloatArray:
    focus = ATTACK_M * np.sin(2 * np.pi * (now / ATTACK_SECONDS + 0.08))
    aim = np.array([focus, 0.0]) + rng.normal(0, (8.0, 12.0))
    return np.asarray(np.clip(aim, -REACH, REACH))


def _plan_pass(
    place: FloatArray, now: float, rng: np.random.Generator
) -> tuple[FloatArray, float]:  # fmt: skip
    """Velocity of a pass, and when somebody may stop it."""
    way = _choose_pass_target(now, rng) - place[:2]
    far = float(np.linalg.norm(way)) + 1e-6
    if far > 14.0 and rng.random() < 0.75:
        lasts = float(np.clip(far / 15.0, 1.0, 2.4))
        return np.array([*(1.12 * way / lasts), GRAVITY * lasts / 2]), now + 1.1 * lasts
    pace = float(np.clip(3.0 + np.sqrt(4.0 + 2 * ROLLING * far), 6.0, 16.0))
    return np.array([*(pace * way / far), 0.0]), now + max(far / (0.9 * pace), 0.4)


def _simulate_people(
    ball: FloatArray, passes: list[tuple[int, int]], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Feet and velocities, shape (M, 23, 2): everybody keeps to a place that follows the ball; who gets it runs there."""
    every = round(PEOPLE_STEP / BALL_STEP)
    steps = len(ball) // every
    phase, pace = rng.uniform(0, 2 * np.pi, (2, PEOPLE, 2)), rng.uniform(0.25, 0.6, (PEOPLE, 2))
    passes = [*passes, (len(ball), len(ball))]
    feet = push_people_apart(_compute_formation_positions(ball[0, :2]))
    velocity, smooth = np.zeros((PEOPLE, 2)), ball[0, :2].copy()
    turn, receiver = 0, 0
    all_feet, all_velocity = np.empty((2, steps, PEOPLE, 2))
    for step in range(steps):
        at, now = step * every, step * PEOPLE_STEP
        smooth += PEOPLE_STEP / 1.2 * (ball[at, :2] - smooth)
        wanted = _compute_formation_positions(smooth) + 2.2 * np.sin(
            phase[0] + pace * now
        ) * np.cos(phase[1])
        caps = np.full(PEOPLE, RUN)
        while at >= passes[turn + 1][0] if turn + 1 < len(passes) else False:
            turn += 1
        kicked, received = passes[turn]
        if kicked <= at < kicked + every:
            there = ball[min(received, len(ball) - 1), :2]
            field = np.r_[1:TEAM, TEAM + 1 : 2 * TEAM]
            receiver = int(field[np.argmin(np.linalg.norm(feet[field] - there, axis=1))])
        if kicked <= at:
            ahead = ball[min(max(at + 8, received), len(ball) - 1), :2]
            back = ahead - ball[max(min(max(at, received), len(ball) - 1) - 30, 0), :2]
            wanted[receiver] = ahead - 0.45 * back / max(float(np.linalg.norm(back)), 1e-6)
            caps[receiver] = SPRINT
        pull = (wanted - feet) / 0.7
        pull *= np.minimum(1.0, caps / np.maximum(np.linalg.norm(pull, axis=1), 1e-9))[:, None]
        velocity += PEOPLE_STEP / 0.35 * (pull - velocity)
        feet = push_people_apart(feet + PEOPLE_STEP * velocity)
        all_feet[step], all_velocity[step] = feet, velocity
    return all_feet, all_velocity


def _compute_formation_positions(ball: FloatArray) -> FloatArray:
    """Where people would stand for a ball there, shape (23, 2)."""
    focus = ball * (0.72, 0.35)
    teams = [
        np.vstack(
            [
                np.array([-sign * 50.5, 0.0]) + 0.1 * (ball + np.array([sign * 50.5, 0.0])),
                focus + FORMATION * (17.0, 21.0) * (sign, 1.0),
            ]
        )
        for sign in (1.0, -1.0)
    ]
    spots = np.vstack([*teams, ball + np.array([-6.0, 9.0])])
    return np.asarray(np.clip(spots, (-53.0, -34.5), (53.0, 34.5)))
