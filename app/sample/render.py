"""Render: the frame that a camera of a scene would have taken, 1280 x 720."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from app.datasets.soccernet_record import IMAGE
from app.errors import NotFoundError
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.figures import Person, draw_person, people_in_view
from app.sample.film import develop
from app.sample.instant import HALF_LENGTH, HALF_WIDTH, Instant
from app.sample.look import Colour, Look
from app.sample.pose import pose_people
from app.sample.props import draw_ball, draw_flag, draw_frame, draw_net
from app.sample.scene import Scene
from app.sample.score_bug import draw_score_bug
from app.sample.shadows import shadow_mask
from app.sample.surface import shade
from app.sample.textures import board_atlas, noise_tiles
from app.sample.views import HEIGHT, WIDTH

Image = npt.NDArray[np.uint8]
MOWING = {"across": 0.0, "along": 1.0, "checks": 2.0}
GRAIN = 2.2
"""Standard deviation of the sensor's noise, grey levels."""


def render(scene: Scene, view_key: str) -> Image:
    """The frame of one view: blue green red, shape (720, 1280, 3).

    The same scene gives the same pixels.

    Raises:
        NotFoundError: The scene has no view of that key.
    """
    truth = scene.truth.view(view_key)
    if truth is None:
        raise NotFoundError(f"scene {scene.truth.key} has no view {view_key}")
    camera, instant, look = truth.camera, scene.instants[view_key], scene.fixture.look
    image = _empty_stadium(camera, instant, look)
    _draw_movers(image, camera, instant, look)
    number = sum(map(ord, scene.truth.key + view_key))
    image = _develop(image, np.random.default_rng([look.seed, number]))
    main = scene.group.views[0]
    time = str(main.extras.metadata[IMAGE]["gameTime"])
    draw_score_bug(image, scene.fixture, time, main.key == view_key)
    return image


def _empty_stadium(camera: Camera, instant: Instant, look: Look) -> Image:
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    background = np.empty((HEIGHT, WIDTH), np.uint8)
    shadow = shadow_mask(camera, instant, pose_people(instant), look.light, HEIGHT, WIDTH)
    atlas, levels = board_atlas(look.seed)
    coarse, fine = noise_tiles()
    stands = look.stands
    shade(
        image, background, shadow, _camera_numbers(camera), _look_numbers(look),
        _sides(camera, look), stands.profile, np.array(stands.kinds), stands.crowd,
        np.array(stands.seat), atlas, levels, coarse, fine,
    )  # fmt: skip
    # A long lens that is focused on the play shows the crowd out of focus.
    sigma = float(np.clip(camera.focal_length[0] / 2600.0, 0.5, 2.4))
    blurred = cv2.GaussianBlur(image, (0, 0), sigma)
    cv2.copyTo(blurred, background, image)
    return image


def _camera_numbers(camera: Camera) -> FloatArray:
    numbers = [*camera.position, camera.focal_length[0], *camera.principal_point]
    return np.concatenate([camera.rotation.ravel(), numbers, camera.distortion[:1]])


def _look_numbers(look: Look) -> FloatArray:
    light, grass = look.light, look.grass
    evening = len(light.lamps) > 1
    y, slope, darkness = light.shade or (0.0, 0.0, 0.0)
    return np.array(
        [
            *grass.colour, grass.band, grass.contrast, MOWING[grass.mowing], grass.wear,
            *light.exposure, 0.58 if evening else 0.95, look.stands.empty,
            *light.sky[0], *light.sky[1], y, slope, darkness, *look.stands.wall,
        ]
    )  # fmt: skip


def _sides(camera: Camera, look: Look) -> FloatArray:
    """Which sides have stands, as ``shade`` wants it."""
    x, y = (float(value) for value in camera.position[:2])
    along, beyond = look.stands.board_distance
    ends = [_side(sign * x - HALF_LENGTH, beyond - 1.0, camera, look) for sign in (1, -1)]
    sides = [_side(sign * y - HALF_WIDTH, along - 2.0, camera, look) for sign in (1, -1)]
    return np.array([*ends, *sides, beyond, beyond, along, along], dtype=np.float64)


def _side(distance: float, limit: float, camera: Camera, look: Look) -> float:
    """1 where the stand is seen from the pitch; 0 or 2 (from above) where the camera stands.

    Args:
        distance: Of the camera beyond the line of this side, metres.
        limit: Distance from which on the side is the camera's own.
    """
    if distance < limit:
        return 1.0
    (front, low), (back, high) = look.stands.profile[1:3]
    surface = low + (distance - front) * (high - low) / (back - front)
    above = distance > front and -float(camera.position[2]) > surface + 1.5
    return 2.0 if above else 0.0


def _draw_movers(image: Image, camera: Camera, instant: Instant, look: Look) -> None:
    """Everything that stands on the grass, far things first."""
    lit_from = _lit_from(camera, look)
    gain = look.light.exposure
    # Play is between the goal lines: a goal hides it, or is hidden, as a whole.
    near_goals = [sign for sign in (-1.0, 1.0) if sign * camera.position[0] > HALF_LENGTH]
    for sign in (-1.0, 1.0):
        if sign not in near_goals:
            draw_net(image, camera, sign, gain)
            draw_frame(image, camera, sign, gain)
    _draw_play(image, camera, instant, look, lit_from)
    for sign in near_goals:
        draw_frame(image, camera, sign, gain)
        draw_net(image, camera, sign, gain)


def _draw_play(image: Image, camera: Camera, instant: Instant, look: Look, lit_from: float) -> None:
    """People, ball and corner flags, far ones first."""
    people = people_in_view(camera, instant, pose_people(instant), image)
    corners = [(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
    flags = [(x * HALF_LENGTH, y * HALF_WIDTH, -0.8) for x, y in corners]
    order: list[tuple[float, Person | tuple[float, float] | None]] = [
        (_depth(camera, tuple(instant.ball)), None),
        *((float(person.depths.mean()), person) for person in people),
        *((_depth(camera, flag), corner) for flag, corner in zip(flags, corners, strict=True)),
    ]
    for depth, what in sorted(order, key=lambda item: -item[0]):
        if depth < 0.5:
            continue
        if what is None:
            draw_ball(image, camera, instant, _gain_at(look, instant.ball[:2]), lit_from)
        elif isinstance(what, Person):
            gain = _gain_at(look, instant.feet[what.index])
            draw_person(image, what, look, instant.numbers[what.index], gain, lit_from)
        else:
            draw_flag(image, camera, what, look.light.exposure)


def _depth(camera: Camera, point: tuple[float, ...]) -> float:
    return float(camera.pitch_to_camera(np.array([point]))[0, 2])


def _lit_from(camera: Camera, look: Look) -> float:
    """Which side of the image the light comes from, -1 left to +1 right."""
    if len(look.light.lamps) > 1:
        return 0.3
    shift = np.array([*look.light.lamps[0].shift, 0.0])
    length = float(np.linalg.norm(shift))
    return float(-(camera.rotation[0] @ shift) / max(length, 0.3))


def _gain_at(look: Look, place: FloatArray) -> Colour:
    """Light on somebody who stands there, per channel."""
    b, g, r = look.light.exposure
    if look.light.shade is None:
        return b, g, r
    y, slope, darkness = look.light.shade
    left = 1.0 - darkness if place[1] > y + slope * place[0] else 1.0
    return b * left, g * left, r * left


def _develop(image: Image, rng: np.random.Generator) -> Image:
    """What lens and sensor add: softness, a darker border, grain."""
    soft = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.6), np.uint8)
    row, column = (int(v) for v in rng.integers(0, (HEIGHT, WIDTH)))
    develop(soft, _grain(), row, column)
    return soft


@lru_cache(maxsize=1)
def _grain() -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(7)
    return rng.normal(0, GRAIN, (HEIGHT, WIDTH)).astype(np.float32)
