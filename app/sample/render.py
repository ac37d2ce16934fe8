"""Render: the frame that a camera of a scene would have taken, 1280 x 720."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.errors import NotFoundError
from app.formats.soccernet_v3 import IMAGE
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.cameras import HEIGHT, WIDTH
from app.sample.figures import (
    INDEX,
    LIMBS,
    Pose,
    ProjectedPerson,
    draw_person,
    list_people_in_view,
    pose_people,
)
from app.sample.fixture import Colour, Lamp, Light, MatchAppearance
from app.sample.play import BALL_DIAMETER, HALF_LENGTH, HALF_WIDTH, Instant
from app.sample.props import draw_ball, draw_goal_posts, draw_net, draw_scoreboard
from app.sample.scene import Scene
from app.sample.surface import (
    BOARD_HEIGHT,
    TILE,
    ShadingCamera,
    ShadingGrass,
    ShadingStadium,
    shade_frame,
)

Tile = npt.NDArray[np.float32]

BOARD_PIXELS = 76
PANEL_METRES = 7.6
PANELS = 10
SIZES = 5
# Brands that nobody owns, and their colours (blue, green, red): ground, letters.
BRANDS = (
    ("VELOMAR", (120, 28, 20), (245, 245, 245)),
    ("Nordkap Tea", (238, 238, 236), (40, 90, 20)),
    ("KILNWORKS", (24, 24, 26), (60, 200, 245)),
    ("Otterby Bank", (92, 60, 8), (250, 250, 250)),
    ("SOLENNE", (40, 40, 205), (250, 250, 250)),
    ("glimmr", (225, 120, 30), (255, 255, 255)),
    ("PELICORE", (245, 245, 245), (190, 60, 20)),
    ("Marrow & Finch", (50, 92, 20), (215, 240, 250)),
    ("TRANZEO AIR", (150, 40, 90), (255, 255, 255)),
    ("Hoppkorn", (30, 190, 245), (30, 30, 30)),
    ("ALPENSTROM", (235, 240, 240), (30, 30, 200)),
    ("quibit", (60, 20, 60), (235, 200, 90)),
)


@lru_cache(maxsize=1)
def make_noise_tiles() -> tuple[Tile, Tile]:
    """Wrapping noise with unit spread: broad patches, and blades of grass."""
    rng = np.random.default_rng(20_260_101)
    coarse = sum(
        weight * _make_smooth_noise(rng, sigma)
        for sigma, weight in ((24.0, 0.6), (9.0, 0.5), (3.0, 0.6))
    )
    fine = 0.8 * _make_smooth_noise(rng, 0.8) + 0.5 * _make_smooth_noise(rng, 2.2)
    return _normalise_to_unit_spread(np.asarray(coarse)), _normalise_to_unit_spread(
        np.asarray(fine)
    )


def _make_smooth_noise(rng: np.random.Generator, sigma: float) -> Tile:
    noise = rng.standard_normal((TILE, TILE)).astype(np.float32)
    margin = int(4 * sigma) + 1
    wrapped = np.pad(noise, margin, mode="wrap")
    blurred = cv2.GaussianBlur(wrapped, (0, 0), sigma)[margin:-margin, margin:-margin]
    return _normalise_to_unit_spread(blurred)


def _normalise_to_unit_spread(tile: npt.NDArray[Any]) -> Tile:
    unit: Tile = ((tile - tile.mean()) / tile.std()).astype(np.float32)
    return unit


@lru_cache(maxsize=8)
def make_board_mipmap(seed: int) -> tuple[Image, npt.NDArray[np.float64]]:
    """The boards of a match at five sizes, one below the other.

    Returns:
        The image, and a row (first row, height, width, length in metres) for each size.
    """
    rng = np.random.default_rng([seed, 0xB0])
    order = rng.permutation(len(BRANDS))[:PANELS]
    width = int(PANEL_METRES / BOARD_HEIGHT * BOARD_PIXELS)
    strip = np.hstack([_draw_board_image(*BRANDS[index], width) for index in order])
    sizes, rows, top = [], [], 0
    for level in range(SIZES):
        height, length = BOARD_PIXELS >> level, strip.shape[1] >> level
        small = cv2.resize(strip, (length, height), interpolation=cv2.INTER_AREA)
        padded = np.zeros((height, strip.shape[1], 3), np.uint8)
        padded[:, :length] = small
        sizes.append(padded)
        rows.append((top, height, length, PANEL_METRES * PANELS))
        top += height
    return np.vstack(sizes), np.array(rows, dtype=np.float64)


def _draw_board_image(
    text: str, ground: tuple[int, int, int], letters: tuple[int, int, int], width: int
) -> Image:
    panel = np.full((BOARD_PIXELS, width, 3), ground, np.uint8)
    font = cv2.FONT_HERSHEY_DUPLEX if text.isupper() else cv2.FONT_HERSHEY_TRIPLEX
    scale, thickness = 1.75, 5
    (length, height), _ = cv2.getTextSize(text, font, scale, thickness)
    if length > width - 50:
        scale *= (width - 50) / length
        (length, height), _ = cv2.getTextSize(text, font, scale, thickness)
    origin = ((width - length) // 2 + 18, (BOARD_PIXELS + height) // 2)
    cv2.putText(panel, text, origin, font, scale, letters, thickness, cv2.LINE_AA)
    cv2.circle(panel, (origin[0] - 34, BOARD_PIXELS // 2), 17, letters, 6, cv2.LINE_AA)
    cv2.line(panel, (0, 0), (0, BOARD_PIXELS), (20, 20, 20), 3)
    return panel


HALVED = 2
"""Shadows are drawn at half size: they are soft, and there are many."""
_TURN = np.linspace(0, 2 * np.pi, 8, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
_SHIFT = 4


def make_grass_light_mask(
    camera: Camera, instant: Instant, pose: Pose, light: Light, height: int, width: int
) -> Image:
    """Light left on the grass, 255 is all, shape (height, width)."""
    scale = camera.focal_length[0] / float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    left: Image = np.full((height // HALVED, width // HALVED), 255, np.uint8)
    ball_radius = BALL_DIAMETER / 2
    for lamp in light.lamps:
        layer = np.full_like(left, 255)
        _draw_shadows_of_people(layer, camera, pose, lamp)
        _draw_shadow_of_ball(layer, camera, instant.ball, lamp, ball_radius)
        sigma = float(np.clip(light.softness * scale / HALVED, 0.5, 7.0))
        left = _darken_by_layer(left, cv2.GaussianBlur(layer, (0, 0), sigma))
    left = _darken_by_layer(left, _draw_contact_shadows(left, camera, instant, scale))
    return np.asarray(cv2.resize(left, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def _darken_by_layer(light: Image, layer: npt.NDArray[Any]) -> Image:
    return np.asarray(cv2.multiply(light, layer, scale=1 / 255), np.uint8)


def _draw_shadows_of_people(layer: Image, camera: Camera, pose: Pose, lamp: Lamp) -> None:
    shade = int(255 * (1 - lamp.darkness))
    ends = np.array([[INDEX[a], INDEX[b]] for a, b, _, _ in LIMBS])
    radii = np.array([(ra, rb) for _, _, ra, rb in LIMBS]) * 1.8
    joints = pose.joints[:, ends]  # people, limbs, 2, 3
    ground = joints[..., :2] - joints[..., 2:] * np.array(lamp.shift)
    rims = ground[..., None, :] + radii[None, :, :, None, None] * _CIRCLE
    people, limbs = joints.shape[:2]
    hulls = _project_ground(camera, rims.reshape(-1, 2)).reshape(
        people * limbs, 2 * len(_CIRCLE), 2
    )
    rows, columns = layer.shape
    with np.errstate(invalid="ignore"):
        low, high = hulls.min(axis=1), hulls.max(axis=1)
        shown = (high > 0).all(axis=1) & (low[:, 0] < columns) & (low[:, 1] < rows)
    for hull in hulls[shown]:
        _fill_polygon(layer, hull, shade)


def _draw_shadow_of_ball(
    layer: Image, camera: Camera, ball: FloatArray, lamp: Lamp, radius: float
) -> None:
    shift = np.array(lamp.shift)
    length = float(np.hypot(*shift))
    along = shift / max(length, 1e-9)
    across = np.array([-along[1], along[0]])
    # The shadow of a sphere is longer along the light.
    rim = np.outer(_CIRCLE[:, 0] * np.hypot(1.0, length), along) + np.outer(_CIRCLE[:, 1], across)
    center = ball[:2] - ball[2] * shift
    pixels = _project_ground(camera, center + radius * rim)
    if np.isfinite(pixels).all():
        _fill_polygon(layer, pixels, int(255 * (1 - lamp.darkness)))


def _draw_contact_shadows(like: Image, camera: Camera, instant: Instant, scale: float) -> Image:
    """The dark patch right below feet and ball, whatever the light."""
    layer = np.full_like(like, 255)
    for place in instant.feet:
        pixels = _project_ground(camera, place + 0.30 * _CIRCLE)
        if np.isfinite(pixels).all():
            _fill_polygon(layer, pixels, 168)
    height = -float(instant.ball[2]) - BALL_DIAMETER / 2
    if height < 0.3:
        pixels = _project_ground(camera, instant.ball[:2] + 0.11 * _CIRCLE)
        if np.isfinite(pixels).all():
            _fill_polygon(layer, pixels, int(120 + 300 * height))
    sigma = float(np.clip(0.06 * scale / HALVED, 0.5, 6.0))
    return np.asarray(cv2.GaussianBlur(layer, (0, 0), sigma), np.uint8)


def _project_ground(camera: Camera, places: FloatArray) -> FloatArray:
    """Pixels of the halved picture for places on the grass, both shape (N, 2)."""
    pixels = camera.project(np.column_stack([places, np.zeros(len(places))]))
    return (pixels + 0.5) / HALVED - 0.5


def _fill_polygon(layer: Image, points: FloatArray, shade: int) -> None:
    fixed = np.clip(np.round(points * (1 << _SHIFT)), -(1 << 20), 1 << 20).astype(np.int32)
    cv2.fillConvexPoly(layer, cv2.convexHull(fixed), shade, 8, _SHIFT)


Image = npt.NDArray[np.uint8]
GRAIN = 2.2
"""Standard deviation of the sensor's noise, grey levels."""


def render_view(scene: Scene, view_key: str) -> Image:
    """The frame of one view: blue green red, shape (720, 1280, 3).

    The same scene gives the same pixels.

    Raises:
        NotFoundError: The scene has no view of that key.
    """
    truth = scene.truth.view(view_key)
    if truth is None:
        raise NotFoundError(f"scene {scene.truth.key} has no view {view_key}")
    camera, instant, look = truth.camera, scene.instants[view_key], scene.fixture.look
    image = _render_empty_stadium(camera, instant, look)
    _draw_people_ball_and_goals(image, camera, instant, look)
    number = sum(map(ord, scene.truth.key + view_key))
    image = _apply_lens_and_sensor(image, np.random.default_rng([look.seed, number]))
    main = scene.group.views[0]
    time = str(main.extras.metadata[IMAGE]["gameTime"])
    draw_scoreboard(image, scene.fixture, time, main.key == view_key)
    return image


def _render_empty_stadium(camera: Camera, instant: Instant, look: MatchAppearance) -> Image:
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    background = np.empty((HEIGHT, WIDTH), np.uint8)
    shadow = make_grass_light_mask(camera, instant, pose_people(instant), look.light, HEIGHT, WIDTH)
    exposure = np.array(look.light.exposure)
    shade_frame(
        image,
        background,
        shadow,
        exposure,
        make_camera_shading_inputs(camera),
        make_grass_shading_inputs(look),
        make_stadium_shading_inputs(camera, look),
        *make_noise_tiles(),
    )
    # A long lens that is focused on the play shows the crowd out of focus.
    sigma = float(np.clip(camera.focal_length[0] / 2600.0, 0.5, 2.4))
    blurred = cv2.GaussianBlur(image, (0, 0), sigma)
    cv2.copyTo(blurred, background, image)
    return image


def make_camera_shading_inputs(camera: Camera) -> ShadingCamera:
    """The camera as ``shade_frame`` takes it."""
    lens = (camera.focal_length[0], *camera.principal_point, float(camera.distortion[0]))
    return ShadingCamera(camera.rotation, camera.position, *lens)


def make_grass_shading_inputs(look: MatchAppearance) -> ShadingGrass:
    """The grass of a match."""
    grass, shadow = look.grass, look.light.shade or (0.0, 0.0, 0.0)
    return ShadingGrass(*grass.colour, grass.across, grass.band, grass.contrast, *shadow)


def make_stadium_shading_inputs(camera: Camera, look: MatchAppearance) -> ShadingStadium:
    """What stands around the grass, as far as a camera there sees it."""
    stands, light = look.stands, look.light
    atlas, levels = make_board_mipmap(look.seed)
    along, beyond = stands.board_distance
    x, y = (float(value) for value in camera.position[:2])
    # A camera beyond a line stands before the boards of that side, or among the crowd.
    ends = [sign * x - HALF_LENGTH < beyond - 1.0 for sign in (1, -1)]
    sides = [sign * y - HALF_WIDTH < along - 2.0 for sign in (1, -1)]
    return ShadingStadium(
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


def _draw_people_ball_and_goals(
    image: Image, camera: Camera, instant: Instant, look: MatchAppearance
) -> None:
    """Everything that stands on the grass, far things first."""
    side = light_direction_in_image(camera, look)
    gain = look.light.exposure
    # Play is between the goal lines: a goal hides it, or is hidden, as a whole.
    near_goals = [sign for sign in (-1.0, 1.0) if sign * camera.position[0] > HALF_LENGTH]
    for sign in (-1.0, 1.0):
        if sign not in near_goals:
            draw_net(image, camera, sign, gain)
            draw_goal_posts(image, camera, sign, gain)
    _draw_people_and_ball(image, camera, instant, look, side)
    for sign in near_goals:
        draw_goal_posts(image, camera, sign, gain)
        draw_net(image, camera, sign, gain)


def _draw_people_and_ball(
    image: Image, camera: Camera, instant: Instant, look: MatchAppearance, side: float
) -> None:
    """People and the ball, far ones first."""
    people = list_people_in_view(camera, instant, pose_people(instant), image)
    ball_depth = float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    order: list[tuple[float, ProjectedPerson | None]] = [(ball_depth, None)]
    order += [(float(person.depths.mean()), person) for person in people]
    for depth, person in sorted(order, key=lambda item: -item[0]):
        if depth < 0.5:
            continue
        if person is None:
            draw_ball(image, camera, instant, light_gain_at(look, instant.ball[:2]), side)
        else:
            gain = light_gain_at(look, instant.feet[person.index])
            draw_person(image, person, look, instant.numbers[person.index], gain, side)


def light_direction_in_image(camera: Camera, look: MatchAppearance) -> float:
    """Which side of the image the light comes from, -1 left to +1 right."""
    if len(look.light.lamps) > 1:
        return 0.3
    shift = np.array([*look.light.lamps[0].shift, 0.0])
    length = float(np.linalg.norm(shift))
    return float(-(camera.rotation[0] @ shift) / max(length, 0.3))


def light_gain_at(look: MatchAppearance, place: FloatArray) -> Colour:
    """Light on somebody who stands there, per channel."""
    b, g, r = look.light.exposure
    if look.light.shade is None:
        return b, g, r
    y, slope, darkness = look.light.shade
    left = 1.0 - darkness if place[1] > y + slope * place[0] else 1.0
    return b * left, g * left, r * left


def _apply_lens_and_sensor(image: Image, rng: np.random.Generator) -> Image:
    """What lens and sensor add: softness, a darker border, grain."""
    soft = cv2.GaussianBlur(image, (0, 0), 0.6)
    row, column = (int(v) for v in rng.integers(0, (HEIGHT, WIDTH)))
    noise = np.roll(_make_sensor_grain(), (-row, -column), axis=(0, 1))
    return np.asarray(np.clip(soft * _make_vignette() + noise + 0.5, 0, 255), np.uint8)


@lru_cache(maxsize=1)
def _make_vignette() -> npt.NDArray[np.float32]:
    """How much of the light the lens lets through, shape (720, 1280, 1)."""
    y, x = np.linspace(-1, 1, HEIGHT)[:, None], np.linspace(-1, 1, WIDTH)
    return (1.03 - 0.09 * (x * x + y * y))[..., None].astype(np.float32)


@lru_cache(maxsize=1)
def _make_sensor_grain() -> npt.NDArray[np.float32]:
    rng = np.random.default_rng(7)
    return rng.normal(0, GRAIN, (HEIGHT, WIDTH, 1)).astype(np.float32)
