"""Play: ball and people of some minutes, moment by moment: passes that roll or fly, bounces, and who runs where."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.geometry.arrays import FloatArray
from app.sample.instant import BALL_DIAMETER, FORMATION, PEOPLE, TEAM, Instant, push_people_apart

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

    def at(self, seconds: float) -> Instant:
        """Everything that moves, at a time between the first and the last."""
        at = min(max(seconds / PEOPLE_STEP, 0.0), len(self.feet) - 1.001)
        low, share = int(at), at - int(at)

        def between(values: FloatArray) -> FloatArray:
            return np.asarray(values[low] + share * (values[low + 1] - values[low]))

        ball = self.ball_at(np.array([seconds]))[0]
        # A ball that rolls turns once along its rim.
        spin = np.array([ball[1], -ball[0], 0.0]) / RADIUS
        return Instant(
            ball=ball,
            spin=spin,
            feet=between(self.feet),
            heading=between(self.heading),
            speed=between(self.speed),
            stride=between(self.stride),
            height=self.height,
            numbers=self.numbers,
        )


def make_play(seconds: float, seed: int, numbers: tuple[int, ...]) -> Play:
    """Play of so many seconds: the same for the same seed; longer play begins as shorter does.

    Args:
        numbers: Of the shirts, 23.
    """
    ball, modes, receptions = _play_ball(seconds + 1.0, np.random.default_rng([seed, 0xBA]))
    rng = np.random.default_rng([seed, 0x9E])
    height = np.clip(rng.normal(1.82, 0.06, PEOPLE), 1.66, 1.98)
    feet, velocity = _run_people(ball, receptions, rng)
    speed = np.hypot(velocity[..., 0], velocity[..., 1])
    every = round(PEOPLE_STEP / BALL_STEP)
    to_ball = ball[::every, None, :2][: len(feet)] - feet
    toward = velocity + to_ball / np.maximum(np.linalg.norm(to_ball, axis=2, keepdims=True), 1.0)
    heading = np.unwrap(np.arctan2(toward[..., 1], toward[..., 0]), axis=0)
    stride = np.cumsum((2.0 + 1.25 * speed) * PEOPLE_STEP, axis=0) + rng.uniform(0, 6, PEOPLE)
    return Play(ball, modes, feet, heading, speed, stride, height, numbers)


def _play_ball(
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
            way = _pass_target(now, rng) - place[:2]
            velocity = np.array([*(rng.uniform(0.5, 3.5) * way / np.linalg.norm(way)), 0.0])
            place[2] = RADIUS
            passes.append((kicked, step))
    return np.array(places), modes, passes


def _pass_target(now: float, rng: np.random.Generator) -> FloatArray:
    focus = ATTACK_M * np.sin(2 * np.pi * (now / ATTACK_SECONDS + 0.08))
    aim = np.array([focus, 0.0]) + rng.normal(0, (8.0, 12.0))
    return np.asarray(np.clip(aim, -REACH, REACH))


def _plan_pass(
    place: FloatArray, now: float, rng: np.random.Generator
) -> tuple[FloatArray, float]:  # fmt: skip
    """Velocity of a pass, and when somebody may stop it."""
    way = _pass_target(now, rng) - place[:2]
    far = float(np.linalg.norm(way)) + 1e-6
    if far > 14.0 and rng.random() < 0.75:
        lasts = float(np.clip(far / 15.0, 1.0, 2.4))
        return np.array([*(1.12 * way / lasts), GRAVITY * lasts / 2]), now + 1.1 * lasts
    pace = float(np.clip(3.0 + np.sqrt(4.0 + 2 * ROLLING * far), 6.0, 16.0))
    return np.array([*(pace * way / far), 0.0]), now + max(far / (0.9 * pace), 0.4)


def _run_people(
    ball: FloatArray, passes: list[tuple[int, int]], rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Feet and velocities, shape (M, 23, 2): everybody keeps to a place that follows the ball; who gets it runs there."""
    every = round(PEOPLE_STEP / BALL_STEP)
    steps = len(ball) // every
    phase, pace = rng.uniform(0, 2 * np.pi, (2, PEOPLE, 2)), rng.uniform(0.25, 0.6, (PEOPLE, 2))
    passes = [*passes, (len(ball), len(ball))]
    feet = push_people_apart(_formation_positions(ball[0, :2]))
    velocity, smooth = np.zeros((PEOPLE, 2)), ball[0, :2].copy()
    turn, receiver = 0, 0
    all_feet, all_velocity = np.empty((2, steps, PEOPLE, 2))
    for step in range(steps):
        at, now = step * every, step * PEOPLE_STEP
        smooth += PEOPLE_STEP / 1.2 * (ball[at, :2] - smooth)
        wanted = _formation_positions(smooth) + 2.2 * np.sin(phase[0] + pace * now) * np.cos(
            phase[1]
        )
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


def _formation_positions(ball: FloatArray) -> FloatArray:
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
