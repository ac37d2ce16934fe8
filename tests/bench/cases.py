"""Cases: groups with known truth in which one assumption of the solver does not hold.

Made apart from the sample, so that nothing was tuned to them: cameras stand anywhere around the
pitch, clicks are noisy as each case says, and the rest is as the solver assumes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.soccer.annotation import BallAnnotation, Lines, make_lines
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch, opposite_marking

SIZE = ImageSize(1920, 1080)
BALL_M = 0.226
BALL_SHARE = 0.04
"""Of the ball's diameter in the picture, added to the noise of its click."""
FINE_M, COARSE_M = 0.25, 1.5
FIELD_M = (22.0, 60.0)
"""Width of the picture at the ball."""
RIM_M = 2.0
TRIALS = 400
FEWEST_MARKINGS = 6
SHORTEST_PX = 40.0
KAPPA = (0.0, 0.05)
"""Displacement at the corner by the lens, as a share of half the diagonal."""


@dataclass(frozen=True)
class Case:
    """How groups are made.

    Attributes:
        name: What people read.
        ball_px: Standard deviation of a clicked ball, each axis, pixels at 1920 x 1080.
        line_px: Standard deviation of a clicked point of a marking, each axis, pixels.
        together: Share of the variance of a marking's points that all of them have in common.
        views: Fewest and most views of a group.
        parallax: Smallest and largest angle of the first two views at the ball, degrees.
        delay_s: The last view shows the ball so much later, seconds.
        speed: Of the ball, metres a second.
        pitch: As it is; solved as 105 x 68 m.
        aspect: Width of a pixel of the last view by its height.
        shift: How far the last view's principal point is off, as a share of the width.
        field_m: Smallest and largest width of the picture at the ball, metres.
        clicks: Fewest and most points of a straight marking; circles have three to four more.
        kappa: Smallest and largest displacement at the corner by the lens.
        ball_share: Of the ball's diameter in the picture, added to the noise of its click.
        swapped: The last view's markings carry the names of the pitch turned by half a turn.
    """

    name: str
    ball_px: float = 1.0
    line_px: float = 1.2
    together: float = 0.0
    views: tuple[int, int] = (2, 4)
    parallax: tuple[float, float] = (15.0, 165.0)
    delay_s: float = 0.0
    speed: float = 15.0
    pitch: Pitch = field(default_factory=Pitch)
    aspect: float = 1.0
    shift: float = 0.0
    swapped: bool = False
    field_m: tuple[float, float] = FIELD_M
    clicks: tuple[int, int] = (2, 6)
    kappa: tuple[float, float] = KAPPA
    ball_share: float = BALL_SHARE

    @property
    def film(
        self,
    ) -> tuple[
        tuple[int, int], tuple[float, float], Pitch, tuple[float, float], tuple[float, float]
    ]:
        """What cameras and balls depend on."""
        return self.views, self.parallax, self.pitch, self.field_m, self.kappa


@dataclass(frozen=True)
class Made:
    """A group and its truth: where the ball is in the first view, and the cameras."""

    group: Group
    ball: FloatArray
    cameras: tuple[Camera, ...]


def make_case(case: Case, groups: int, seed: int) -> list[Made]:
    """Groups of a case, the same for the same seed; like cases share cameras and clicks.

    Args:
        case: What is special about them.
        groups: How many to make.
        seed: Of everything that is drawn.
    """
    return [_make(case, number, seed) for number in range(groups)]


def _make(case: Case, number: int, seed: int) -> Made:
    ball, velocity, cameras = _film(seed, number, *case.film)
    rng = np.random.default_rng([seed, number, 0xC1])
    shown = [*cameras[:-1], _deformed(cameras[-1], case)]
    views = []
    for index, camera in enumerate(shown):
        last = index == len(shown) - 1
        there = ball + velocity * (case.speed * case.delay_s if last else 0.0)
        lines = _clicks(rng, camera, case)
        if last and case.swapped:
            lines = make_lines({opposite_marking(name): lines[name] for name in lines})
        key = f"{number}_{index}.png"
        station = Station(key, SIZE, lines=lines)
        views.append(View(key, station, (_ball(rng, camera, there, case),)))
    return Made(Group(f"{number}.png", tuple(views)), ball, tuple(shown))


@cache
def _film(
    seed: int,
    number: int,
    views: tuple[int, int],
    parallax: tuple[float, float],
    pitch: Pitch,
    field_m: tuple[float, float],
    kappa: tuple[float, float],
) -> tuple[FloatArray, FloatArray, tuple[Camera, ...]]:
    """A ball, the direction in which it flies, and cameras that see it."""
    rng = np.random.default_rng([seed, number])
    while True:
        ball = np.array([rng.uniform(-48, 48), rng.uniform(-30, 30), -rng.choice([0.113, 2, 6])])
        velocity, count = _direction(rng), int(rng.integers(views[0], views[1] + 1))
        cameras: list[Camera] = []
        for _ in range(TRIALS):
            place = _place(rng, ball, pitch, is_main=not cameras)
            if place is not None and _stands_apart(place, cameras, ball, parallax):
                camera = _aimed(rng, place, ball, field_m, kappa)
                if _in_picture(camera, ball) and _shows_enough(camera, pitch):
                    cameras.append(camera)
            if len(cameras) == count:
                return ball, velocity, tuple(cameras)


def _direction(rng: np.random.Generator) -> FloatArray:
    """A direction of flight, rather level, shape (3,)."""
    way = rng.normal(size=3) * (1.0, 1.0, 0.3)
    unit: FloatArray = way / np.linalg.norm(way)
    return unit


def _place(
    rng: np.random.Generator, ball: FloatArray, pitch: Pitch, *, is_main: bool
) -> FloatArray | None:
    """Where a camera stands, metres, shape (3,); None on the pitch."""
    if is_main:
        return np.array([rng.normal(0, 3), rng.uniform(50, 85), -rng.uniform(11, 24)])
    angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(25, 80)
    x, y = ball[0] + far * np.cos(angle), ball[1] + far * np.sin(angle)
    beside = abs(x) > pitch.length / 2 + RIM_M or abs(y) > pitch.width / 2 + RIM_M
    return np.array([x, y, -rng.uniform(2, 20)]) if beside else None


def _aimed(
    rng: np.random.Generator,
    place: FloatArray,
    ball: FloatArray,
    field_m: tuple[float, float] = FIELD_M,
    kappa: tuple[float, float] = KAPPA,
) -> Camera:
    """A camera that looks near the ball."""
    toward = ball + rng.normal(0, 3, 3) * (1, 1, 0) - place
    distance = float(np.linalg.norm(toward))
    focal = SIZE.width * distance / rng.uniform(*field_m)
    k1 = rng.uniform(*kappa) * (focal / (SIZE.diagonal / 2)) ** 2
    return Camera(
        rotation_from_pan_tilt_roll(
            np.arctan2(toward[0], -toward[1]),
            np.arccos(toward[2] / distance),
            rng.normal(0, np.radians(0.5)),
        ),
        place,
        (focal, focal),
        ((SIZE.width - 1) / 2, (SIZE.height - 1) / 2),
        distortion=np.array([k1, k1 * k1 / 2, *np.zeros(10)]),
    )


def _shows_enough(camera: Camera, pitch: Pitch) -> bool:
    seen = [name for name, _ in _visible(camera, pitch, COARSE_M)]
    straight = [pitch.shapes[name] for name in seen if name not in CIRCLES]
    lengthwise = any(shape.start[1] == shape.end[1] for shape in straight)  # type: ignore[union-attr]
    across = any(shape.start[0] == shape.end[0] for shape in straight)  # type: ignore[union-attr]
    return len(seen) >= FEWEST_MARKINGS and lengthwise and across


def _in_picture(camera: Camera, ball: FloatArray) -> bool:
    x, y = camera.project(ball[None])[0]
    return bool(60 < x < SIZE.width - 60 and 60 < y < SIZE.height - 60)


def _stands_apart(
    place: FloatArray, others: list[Camera], ball: FloatArray, parallax: tuple[float, float]
) -> bool:
    """Whether the angles at the ball with the other cameras suit the case."""
    u, low, high = place - ball, *parallax
    others_v = (other.position - ball for other in others)
    angles = (np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v)) for v in others_v)
    return all(low <= angle <= high for angle in angles)


def _deformed(camera: Camera, case: Case) -> Camera:
    """The camera of the last view, whose pixels or principal point may be unusual."""
    x, y = camera.focal_length
    (x0, y0), middle = camera.principal_point, (SIZE.width - 1) / 2
    return Camera(
        camera.rotation,
        camera.position,
        (x * case.aspect, y),
        ((x0 - middle) * case.aspect + middle + case.shift * SIZE.width, y0),
        distortion=camera.distortion,
    )


@cache
def _samples(pitch: Pitch, marking: str, spacing: float) -> FloatArray:
    return pitch.sample(marking, spacing, spacing)


def _visible(camera: Camera, pitch: Pitch, spacing: float) -> list[tuple[str, FloatArray]]:
    """Markings of which enough is in the picture, with their pixels, shape (N, 2) each."""
    found = []
    for name in MARKINGS:
        pixels = camera.project(_samples(pitch, name, spacing))
        with np.errstate(invalid="ignore"):
            inside = (pixels > 0).all(axis=1) & (pixels < (SIZE.width - 1, SIZE.height - 1)).all(1)
        kept = pixels[inside]
        if len(kept) > 3 and np.ptp(kept, axis=0).max() > SHORTEST_PX:
            found.append((name, kept))
    return found


def _clicks(rng: np.random.Generator, camera: Camera, case: Case) -> Lines:
    lines = {}
    own, common = np.sqrt(1 - case.together), np.sqrt(case.together)
    for name, pixels in _visible(camera, case.pitch, FINE_M):
        few, many = case.clicks
        circle = name in CIRCLES
        count = int(rng.integers(few + 3 * circle, many + 1 + 4 * circle))
        places = np.linspace(0, len(pixels) - 1, count).round().astype(int)
        noise = own * rng.normal(size=(count, 2)) + common * rng.normal(size=2)
        lines[name] = (pixels[places] + case.line_px * noise).tolist()
    return make_lines(lines)


def _ball(rng: np.random.Generator, camera: Camera, ball: FloatArray, case: Case) -> BallAnnotation:
    depth = camera.pitch_to_camera(ball[None])[0, 2]
    diameter = BALL_M * camera.focal_length[1] / depth
    x, y = camera.project(ball[None])[0] + np.hypot(
        case.ball_px, case.ball_share * diameter
    ) * rng.normal(size=2)
    return BallAnnotation(box=Box.square(ImagePoint(float(x), float(y)), float(diameter)))
