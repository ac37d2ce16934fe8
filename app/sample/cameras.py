"""Cameras of a match: the main camera, its replays, and how an operator aims them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.rotation import rotation_from_pan_tilt_roll
from app.sample.instant import BALL_DIAMETER, HALF_LENGTH, HALF_WIDTH
from app.sample.observability import Certainty, certainty
from app.sample.views import (
    CENTER,
    COARSE,
    CORNER_RADIUS,
    HEIGHT,
    WIDTH,
    Mask,
    Trials,
    inside,
    project_trials,
    seen_points,
)

TRIALS = 8
ROUNDS = 5
MAIN_FOCAL = (1200.0, 6100.0)
REPLAY_FOCAL = (900.0, 6100.0)
MAIN_TILT = (np.radians(65.2), np.radians(83.8))
SMALLEST_BALL, LARGEST_BALL = 5.4, 58.0
FEWEST_MARKINGS = 6
LONGEST_STEP_PX = 880.0
"""Between samples of a marking, about 3 m apart, that are in view."""
RIM = 7.0
"""Metres around the pitch that a frame may begin with."""
MIN_PARALLAX = np.radians(9.0)
REPLAYS = (
    "opposite",
    "behind_high",
    "behind_low",
    "touchline",
    "sixteen",
    "behind_stand",
)
REPLAY_SHARE = (0.18, 0.24, 0.15, 0.15, 0.16, 0.12)


@dataclass(frozen=True)
class CameraStands:
    """Where the cameras of one match stand.

    Attributes:
        main: Position of the main camera, metres, shape (3,).
        seats: Positions of replay cameras by kind; ends and sides come in pairs.
    """

    main: FloatArray
    seats: dict[str, tuple[FloatArray, ...]]


def make_rig(rng: np.random.Generator) -> CameraStands:
    """Cameras as broadcasters place them."""
    y = rng.uniform(46.0, 90.0)
    height = np.clip(9.5 + 0.24 * (y - 41.0) + rng.normal(0, 2.0), 9.3, 24.7)
    main = np.array([np.clip(rng.normal(0, 3.0), -9.5, 10.5), y, -height])
    beside = np.array([rng.uniform(33, 39), main[1] + rng.normal(0, 2), main[2]])
    ends = (1.0, -1.0)
    seats = {
        "opposite": (np.array([rng.uniform(-14, 14), -rng.uniform(46, 72), -rng.uniform(8, 19)]),),
        "behind_high": tuple(
            np.array([end * rng.uniform(64, 82), rng.uniform(-6, 6), -rng.uniform(8, 17)])
            for end in ends
        ),
        "behind_low": tuple(
            np.array([end * rng.uniform(57, 60), rng.choice([-1, 1]) * rng.uniform(5, 12), -rng.uniform(1.7, 3.6)])
            for end in ends
        ),
        "touchline": tuple(
            np.array([end * rng.uniform(14, 44), rng.uniform(36.4, 37.8), -rng.uniform(1.5, 2.4)])
            for end in ends
        ),
        "sixteen": tuple(np.array([end, 1.0, 1.0]) * beside for end in ends),
        "behind_stand": tuple(
            np.array([end * rng.uniform(84, 104), rng.uniform(-20, 20), -rng.uniform(19, 29)])
            for end in ends
        ),
    }  # fmt: skip
    return CameraStands(main, seats)


def replay_seat(
    rng: np.random.Generator, rig: CameraStands, ball: FloatArray
) -> tuple[str, FloatArray]:
    """A replay camera, most often one at the ball's end; where it stands, metres, shape (3,)."""
    kind = str(rng.choice(REPLAYS, p=REPLAY_SHARE))
    seats = rig.seats[kind]
    near = 0 if ball[0] > 0 else -1
    far_end = kind in ("behind_high", "behind_stand") and rng.random() < 0.15
    seat = seats[(-1 - near) if far_end else near]
    return kind, seat + rng.normal(0, 0.25, 3) * (1, 1, 0.3)


def parallax(a: FloatArray, b: FloatArray, ball: FloatArray) -> float:
    """Angle between the rays from two positions to the ball, radians."""
    u, v = a - ball, b - ball
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def aim(
    rng: np.random.Generator, position: FloatArray, ball: FloatArray, is_main: bool
) -> Camera | None:
    """A camera at that position from which ball and enough markings are in view.

    Args:
        position: Pitch frame, metres, shape (3,).
        ball: Pitch frame, metres, shape (3,).
        is_main: Keep to the tilts and focal lengths of main cameras.

    Returns:
        None when no trial was good enough: the ball would be too small, or too little of the
        pitch would determine the camera.
    """
    for attempt in range(ROUNDS):
        trials = _trials(rng, position, ball, is_main, zoom=1.0 - 0.2 * attempt)
        if trials is None:
            return None
        pixels = project_trials(trials, COARSE.points)
        seen = inside(pixels, 4.0)
        good = _acceptable(trials, ball, seen, is_main) & ~_too_close(pixels, seen)
        for index in np.flatnonzero(good):
            camera = _camera(trials, int(index))
            if _good(certainty(camera, ball, seen[index])):
                return camera
    return None


def _good(known: Certainty) -> bool:
    return known.ball_sigma_m < 0.06 and known.size_sigma < 0.04


def _trials(
    rng: np.random.Generator, position: FloatArray, ball: FloatArray, is_main: bool, zoom: float
) -> Trials | None:
    toward = ball - position
    distance = float(np.linalg.norm(toward))
    low, high = MAIN_FOCAL if is_main else REPLAY_FOCAL
    low = max(low, SMALLEST_BALL * distance / BALL_DIAMETER)
    high = min(high, LARGEST_BALL * distance / BALL_DIAMETER, low * (1.0 + 2.2 * zoom))
    if low >= high:
        return None
    focal = np.exp(rng.uniform(np.log(low), np.log(high), TRIALS))
    # The ball stands anywhere but at the border, rather towards the middle.
    u = np.clip(rng.normal(0, 0.24, TRIALS), -0.42, 0.42) * WIDTH
    v = np.clip(rng.normal(0.02, 0.17, TRIALS), -0.38, 0.40) * HEIGHT
    corner = rng.uniform(5.0, 25.0, TRIALS)
    return Trials(
        position=np.broadcast_to(position, (TRIALS, 3)),
        pan=np.arctan2(toward[0], -toward[1]) - np.arctan2(u, focal),
        tilt=np.arccos(toward[2] / distance) + np.arctan2(v, focal),
        roll=np.radians(np.clip(rng.normal(0, 0.4, TRIALS), -0.99, 0.99)),
        focal=focal,
        k1=corner * focal**2 / CORNER_RADIUS**3,
    )


def _acceptable(trials: Trials, ball: FloatArray, seen: Mask, is_main: bool) -> Mask:
    counts = seen_points(seen, COARSE)
    markings = counts >= 3
    straight_x = markings[:, COARSE.runs_along_x].sum(axis=1)
    straight_y = markings[:, COARSE.runs_along_y].sum(axis=1)
    good: Mask = (markings.sum(axis=1) >= FEWEST_MARKINGS) & (straight_x >= 1) & (straight_y >= 1)
    # Scraps at the border are easily overlooked, and would count against the annotation.
    good &= (counts == 1).sum(axis=1) <= 1
    good &= inside(project_trials(trials, ball[None])[:, 0], 30.0)
    good &= _looks_at_the_pitch(trials)
    if is_main:
        good &= (trials.tilt >= MAIN_TILT[0]) & (trials.tilt <= MAIN_TILT[1])
    return good


def _looks_at_the_pitch(trials: Trials) -> Mask:
    """Whether the bottom of the image shows the pitch or its rim, not the own stand, (N,)."""
    rotation = trials.rotation
    ray = rotation[:, 2] + rotation[:, 1] * (CENTER[1] / trials.focal)[:, None]
    # The camera is above the grass and looks down, so the ray meets it.
    reach = -trials.position[:, 2] / np.maximum(ray[:, 2], 1e-6)
    x, y = (trials.position[:, i] + reach * ray[:, i] for i in (0, 1))
    pitch: Mask = (np.abs(x) < HALF_LENGTH + RIM) & (np.abs(y) < HALF_WIDTH + RIM)
    return pitch


def _too_close(pixels: FloatArray, seen: Mask) -> Mask:
    """Whether a marking passes so near the camera that its samples stand far apart, shape (N,).

    Scorers join samples of a marking by straight lines, which miss a bent image there.
    """
    together = COARSE.marking[1:] == COARSE.marking[:-1]
    shown = together & (seen[:, 1:] | seen[:, :-1])
    with np.errstate(invalid="ignore"):
        long = (np.abs(pixels[:, 1:] - pixels[:, :-1]) > LONGEST_STEP_PX).any(axis=2)
    close: Mask = (shown & long).any(axis=1)
    return close


def _camera(trials: Trials, index: int) -> Camera:
    distortion = np.zeros(12)
    distortion[0] = trials.k1[index]
    focal = float(trials.focal[index])
    return Camera(
        rotation=rotation_from_pan_tilt_roll(
            trials.pan[index], trials.tilt[index], trials.roll[index]
        ),
        position=trials.position[index],
        focal_length=(focal, focal),
        principal_point=(float(CENTER[0]), float(CENTER[1])),
        distortion=distortion,
    )
