"""Render: the frame that a camera of a scene would have taken, 1280 x 720."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from app.errors import NotFoundError
from app.formats.soccernet_record import IMAGE
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.figures import DrawnPerson, draw_person, people_in_view
from app.sample.instant import HALF_LENGTH, HALF_WIDTH, Instant
from app.sample.look import Colour, Look
from app.sample.pose import pose_people
from app.sample.props import draw_ball, draw_frame, draw_net
from app.sample.scene import Scene
from app.sample.scoreboard import draw_scoreboard
from app.sample.shadows import shadow_mask
from app.sample.surface import Bowl, Eye, Turf, shade
from app.sample.textures import board_atlas, noise_tiles
from app.sample.views import HEIGHT, WIDTH

Image = npt.NDArray[np.uint8]
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
    draw_scoreboard(image, scene.fixture, time, main.key == view_key)
    return image


def _empty_stadium(camera: Camera, instant: Instant, look: Look) -> Image:
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    background = np.empty((HEIGHT, WIDTH), np.uint8)
    shadow = shadow_mask(camera, instant, pose_people(instant), look.light, HEIGHT, WIDTH)
    exposure = np.array(look.light.exposure)
    shade(
        image,
        background,
        shadow,
        exposure,
        _eye(camera),
        _turf(look),
        _bowl(camera, look),
        *noise_tiles(),
    )
    # A long lens that is focused on the play shows the crowd out of focus.
    sigma = float(np.clip(camera.focal_length[0] / 2600.0, 0.5, 2.4))
    blurred = cv2.GaussianBlur(image, (0, 0), sigma)
    cv2.copyTo(blurred, background, image)
    return image


def _eye(camera: Camera) -> Eye:
    lens = (camera.focal_length[0], *camera.principal_point, float(camera.distortion[0]))
    return Eye(camera.rotation, camera.position, *lens)


def _turf(look: Look) -> Turf:
    grass, shadow = look.grass, look.light.shade or (0.0, 0.0, 0.0)
    return Turf(*grass.colour, grass.across, grass.band, grass.contrast, *shadow)


def _bowl(camera: Camera, look: Look) -> Bowl:
    stands, light = look.stands, look.light
    atlas, levels = board_atlas(look.seed)
    along, beyond = stands.board_distance
    x, y = (float(value) for value in camera.position[:2])
    # A camera beyond a line stands before the boards of that side, or among the crowd.
    ends = [sign * x - HALF_LENGTH < beyond - 1.0 for sign in (1, -1)]
    sides = [sign * y - HALF_WIDTH < along - 2.0 for sign in (1, -1)]
    return Bowl(
        seen=np.array([*ends, *sides]),
        beyond=beyond,
        along=along,
        profile=stands.profile,
        kinds=np.array(stands.kinds),
        crowd=stands.crowd,
        seat=np.array(stands.seat),
        wall=np.array(stands.wall),
        empty=stands.empty,
        light=0.58 if len(light.lamps) > 1 else 0.95,
        sky=np.array(light.sky),
        atlas=atlas,
        levels=levels,
    )


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
    """People and the ball, far ones first."""
    people = people_in_view(camera, instant, pose_people(instant), image)
    ball_depth = float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    order: list[tuple[float, DrawnPerson | None]] = [(ball_depth, None)]
    order += [(float(person.depths.mean()), person) for person in people]
    for depth, person in sorted(order, key=lambda item: -item[0]):
        if depth < 0.5:
            continue
        if person is None:
            draw_ball(image, camera, instant, _gain_at(look, instant.ball[:2]), lit_from)
        else:
            gain = _gain_at(look, instant.feet[person.index])
            draw_person(image, person, look, instant.numbers[person.index], gain, lit_from)


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
    soft = cv2.GaussianBlur(image, (0, 0), 0.6)
    row, column = (int(v) for v in rng.integers(0, (HEIGHT, WIDTH)))
    noise = np.roll(_grain(), (-row, -column), axis=(0, 1))
    return np.asarray(np.clip(soft * _border() + noise + 0.5, 0, 255), np.uint8)


@lru_cache(maxsize=1)
def _border() -> npt.NDArray[np.float32]:
    """How much of the light the lens lets through, shape (720, 1280, 1)."""
    y, x = np.linspace(-1, 1, HEIGHT)[:, None], np.linspace(-1, 1, WIDTH)
    return (1.03 - 0.09 * (x * x + y * y))[..., None].astype(np.float32)


@lru_cache(maxsize=1)
def _grain() -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(7)
    return rng.normal(0, GRAIN, (HEIGHT, WIDTH, 1)).astype(np.float32)
