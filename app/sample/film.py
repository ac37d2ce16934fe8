"""Film: what a camera on a tripod shows of play, picture after picture, quickly.

Stadium and grass are drawn once for each place (``render_view`` takes a second for so many rays) as the inside of a
cylinder around it; a picture is a look at that, with people and ball drawn anew.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.sample.cameras import CENTER, CORNER_RADIUS, HEIGHT, WIDTH
from app.sample.figures import draw_distant_person, draw_person, list_people_in_view, pose_people
from app.sample.fixture import MatchAppearance
from app.sample.play import HALF_LENGTH, Instant
from app.sample.props import Image, draw_ball, draw_goal_posts, draw_net
from app.sample.render import (
    light_direction_in_image,
    light_gain_at,
    make_camera_shading_inputs,
    make_grass_shading_inputs,
    make_noise_tiles,
    make_stadium_shading_inputs,
)
from app.sample.surface import shade_frame

STRIP = 16
"""Columns of a cylinder that are drawn as a plane: their middle is 0.4 degrees from their rim at most."""
MOST_PIXELS = 24_000_000
GRID = 16
"""Pixels between those for which it is computed where they lie on the cylinder."""
CORNER_PX, CORNER_BY_ZOOM = 11.0, 6.0
"""What the lens displaces in the corners at 2000 px of focal length, and more at e times as much."""
REACH = 1.6
"""How far hands and feet are from where somebody stands, metres."""
TALL_PX = 110
"""People from this height on are drawn in full."""
GRAIN = 0.9
"""Standard deviation of the sensor's noise, grey levels."""
LEVEL = np.pi / 2


def aim_cameras(
    position: FloatArray, aims: FloatArray, focal: FloatArray, roll: float
) -> list[Camera]:
    """Cameras of one place that look at places in turn; the lens follows the zoom.

    Args:
        position: Pitch frame, metres, shape (3,).
        aims: What stands in the middle of each picture, pitch frame, metres, shape (N, 3).
        focal: Pixels, shape (N,).
        roll: Radians.
    """
    toward = aims - position
    pan = np.arctan2(toward[:, 0], -toward[:, 1])
    tilt = np.arccos(toward[:, 2] / np.linalg.norm(toward, axis=1))
    corner = CORNER_PX + CORNER_BY_ZOOM * np.log(focal / 2000.0)
    k1 = corner * focal**2 / CORNER_RADIUS**3
    return [
        Camera(
            rotation=rotation_from_pan_tilt_roll(pan[at], tilt[at], roll),
            position=position,
            focal_length=(float(focal[at]), float(focal[at])),
            principal_point=(float(CENTER[0]), float(CENTER[1])),
            distortion=np.array([k1[at], *np.zeros(11)]),
        )
        for at in range(len(aims))
    ]


@dataclass(frozen=True, eq=False)
class Backdrop:
    """The empty stadium around a place, on a cylinder about the vertical.

    Attributes:
        image: Blue green red, shape (H, W, 3).
        pan: Of its first column, radians.
        focal: Pixels a radian, and rows by the tangent of the height.
        horizon: Its row.
    """

    image: Image
    pan: float
    focal: float
    horizon: float

    def render_from(self, camera: Camera) -> Image:
        """What a camera at the place sees, shape (720, 1280, 3)."""
        rows, columns = (
            np.arange(-GRID, size + GRID, GRID) + GRID / 2 - 0.5 for size in (HEIGHT, WIDTH)
        )
        grid = np.stack(np.meshgrid(columns, rows), axis=-1)
        pan, rise = _compute_pixel_directions(camera, grid.reshape(-1, 2), self.pan)
        across, down = (
            cv2.resize(
                part.reshape(grid.shape[:2]).astype(np.float32),
                (grid.shape[1] * GRID, grid.shape[0] * GRID),
            )[GRID:-GRID, GRID:-GRID]
            for part in (pan * self.focal, self.horizon + rise * self.focal)
        )
        return np.asarray(
            cv2.remap(self.image, across, down, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.uint8
        )  # fmt: skip


def _compute_pixel_directions(
    camera: Camera, pixels: FloatArray, pan: float
) -> tuple[FloatArray, FloatArray]:
    """How far to the right of a pan the rays of pixels go, radians, and how far they fall a metre, both shape (N,)."""
    ray = camera.rays(pixels)
    ahead = ray[:, 0] * np.sin(pan) - ray[:, 1] * np.cos(pan)
    aside = ray[:, 0] * np.cos(pan) + ray[:, 1] * np.sin(pan)
    return np.arctan2(aside, ahead), ray[:, 2] / np.hypot(ray[:, 0], ray[:, 1])


def make_backdrop(cameras: Sequence[Camera], look: MatchAppearance) -> Backdrop:
    """The empty stadium as far as cameras of one place see it."""
    across, down = np.linspace(-8, WIDTH + 8, 9), np.linspace(-8, HEIGHT + 8, 7)
    rim = np.array(
        [(x, y) for x in across for y in down if x in across[[0, -1]] or y in down[[0, -1]]]
    )
    middle = np.radians(cameras[len(cameras) // 2].pan_tilt_roll_degrees[0])
    seen = [
        _compute_pixel_directions(camera, rim, middle) for camera in [*cameras[::5], cameras[-1]]
    ]
    pan, rise = (np.concatenate(part) for part in zip(*seen, strict=True))
    size = float(np.ptp(pan) * np.ptp(rise))
    focal = min(max(camera.focal_length[0] for camera in cameras), (MOST_PIXELS / size) ** 0.5)
    width, height = (int(np.ptp(part) * focal) + 2 for part in (pan, rise))
    drawn = Backdrop(
        np.empty((height, width, 3), np.uint8),
        float(middle + pan.min()),
        focal,
        float(-rise.min() * focal),
    )
    background = np.empty((height, width), np.uint8)
    exposure, light = np.array(look.light.exposure), np.full((height, STRIP), 255, np.uint8)
    strip, behind = np.empty((height, STRIP, 3), np.uint8), np.empty((height, STRIP), np.uint8)
    bowl = make_stadium_shading_inputs(cameras[0], look)
    for left in range(0, width, STRIP):
        eye = make_camera_shading_inputs(
            _make_level_camera(drawn, cameras[0], drawn.pan + (left + STRIP / 2) / focal, STRIP)
        )
        shade_frame(
            strip,
            behind,
            light,
            exposure,
            eye,
            make_grass_shading_inputs(look),
            bowl,
            *make_noise_tiles(),
        )
        columns = min(STRIP, width - left)
        drawn.image[:, left : left + columns] = strip[:, :columns]
        background[:, left : left + columns] = behind[:, :columns]
    blurred = cv2.GaussianBlur(drawn.image, (0, 0), float(np.clip(focal / 2600.0, 0.5, 2.4)))
    cv2.copyTo(blurred, background, drawn.image)
    for sign in (-1.0, 1.0):
        _draw_goal(drawn, cameras[0], sign, look)
    return drawn


def _make_level_camera(backdrop: Backdrop, camera: Camera, pan: float, width: int) -> Camera:
    """A level camera at the same place, whose rows are those of the cylinder where it looks."""
    return Camera(
        rotation=rotation_from_pan_tilt_roll(pan, LEVEL, 0.0),
        position=camera.position,
        focal_length=(backdrop.focal, backdrop.focal),
        principal_point=(width / 2, backdrop.horizon),
    )


def _draw_goal(backdrop: Backdrop, camera: Camera, sign: float, look: MatchAppearance) -> None:
    """Put the goal at x = ``sign`` * 52.5 m onto the cylinder: it is drawn on a plane, where lines are straight."""
    toward = np.array([sign * (HALF_LENGTH + 1.0), 0.0]) - camera.position[:2]
    far, first = float(np.hypot(*toward)), backdrop.pan
    # To the right of the first column, however the angle of that is counted.
    pan = first + float(
        np.arctan2(
            toward @ (np.cos(first), np.sin(first)), toward @ (np.sin(first), -np.cos(first))
        )
    )
    height, width = backdrop.image.shape[:2]
    wide = 2 * round(backdrop.focal * 6.5 / far)
    left = round((pan - backdrop.pan) * backdrop.focal - wide / 2)
    if left < 0 or left + wide > width or far < 10.0:
        return
    flat = _make_level_camera(backdrop, camera, pan, wide)
    angle = (np.arange(left, left + wide) / backdrop.focal + backdrop.pan - pan)[None]
    fall = (np.arange(height)[:, None] - backdrop.horizon) / np.cos(angle)
    there = np.tan(angle) * backdrop.focal + wide / 2 + np.zeros((height, 1))
    wanted = (there.astype(np.float32), (fall + backdrop.horizon).astype(np.float32))
    column = np.arange(wide) - wide / 2
    turn = np.arctan(column / backdrop.focal)[None]
    back = (turn + pan - backdrop.pan) * backdrop.focal - left + np.zeros((height, 1))
    down = (np.arange(height)[:, None] - backdrop.horizon) * np.cos(turn) + backdrop.horizon
    back, down = back.astype(np.float32), down.astype(np.float32)
    area = backdrop.image[:, left : left + wide]
    plane = np.asarray(cv2.remap(area, back, down, cv2.INTER_LINEAR), np.uint8)
    before = plane.copy()
    draw_net(plane, flat, sign, look.light.exposure)
    draw_goal_posts(plane, flat, sign, look.light.exposure)
    changed = cv2.dilate((plane != before).any(axis=2).astype(np.uint8), np.ones((3, 3), np.uint8))
    there_too = cv2.remap(changed, *wanted, cv2.INTER_NEAREST)
    cv2.copyTo(np.asarray(cv2.remap(plane, *wanted, cv2.INTER_LINEAR)), there_too, area)


def render_picture(
    backdrop: Backdrop, camera: Camera, instant: Instant, look: MatchAppearance
) -> Image:
    """A picture: blue green red, shape (720, 1280, 3), without noise and captions."""
    image = backdrop.render_from(camera)
    people = list_people_in_view(camera, instant, pose_people(instant), image)
    for person in people:
        _draw_soft_shadow(image, camera, instant.feet[person.index], 0.42)
    if instant.ball[2] > -3.0:
        _draw_soft_shadow(image, camera, instant.ball[:2], 0.16)
    side, gain = light_direction_in_image(camera, look), look.light.exposure
    depth = float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    is_drawn = depth < 0.5
    for person in sorted(people, key=lambda one: -float(one.depths.mean())):
        if not is_drawn and person.depths.mean() < depth:
            draw_ball(image, camera, instant, light_gain_at(look, instant.ball[:2]), side)
            is_drawn = True
        if person.scale * person.height < TALL_PX:
            draw_distant_person(image, person, look, gain)
        else:
            draw_person(image, person, look, instant.numbers[person.index], gain, side)
    if not is_drawn:
        draw_ball(image, camera, instant, light_gain_at(look, instant.ball[:2]), side)
    return image


def is_ball_hidden(camera: Camera, instant: Instant) -> bool:
    """Whether somebody stands between a camera and the ball."""
    toward = camera.position[:2] - instant.ball[:2]
    away = instant.feet - instant.ball[:2]
    aside = np.abs(away @ (-toward[1], toward[0])) / float(np.hypot(*toward))
    if not ((aside < REACH) & (away @ toward > 0)).any():
        return False
    image = np.empty((HEIGHT, WIDTH, 3), np.uint8)
    pixel = camera.project(instant.ball[None])[0]
    depth = float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    return any(
        person.depths.mean() < depth
        and bool((person.joints.min(axis=0) - 1 < pixel).all())
        and bool((pixel < person.joints.max(axis=0) + 1).all())
        for person in list_people_in_view(camera, instant, pose_people(instant), image)
    )


def _draw_soft_shadow(image: Image, camera: Camera, place: FloatArray, radius: float) -> None:
    """The soft shadow below somebody or something that stands at a place on the grass."""
    corners = place + radius * np.array([(-1.3, -0.8), (1.3, -0.8), (1.3, 0.8), (-1.3, 0.8)])
    pixels = camera.project(np.column_stack([corners, np.zeros(4)]))
    if np.isnan(pixels).any():
        return
    low, high = (
        pixels.min(axis=0).round().astype(int),
        pixels.max(axis=0).round().astype(int) + 1,
    )
    rows, columns = image.shape[:2]
    if (low < 0).any() or high[0] > columns or high[1] > rows or (high - low < 2).any():
        return
    area = image[low[1] : high[1], low[0] : high[0]]
    light = cv2.resize(_make_shadow_mask(), (high - low).tolist())
    area[...] = (area * light[..., None]).astype(np.uint8)


@lru_cache(maxsize=1)
def _make_shadow_mask() -> FloatArray:
    y, x = np.mgrid[-1:1:25j, -1:1:25j]
    return np.asarray(1.0 - 0.5 * np.clip(1.2 * (1 - np.hypot(x, y)), 0, 1))


def add_grain(image: Image, number: int) -> Image:
    """The picture with the sensor's noise of a frame."""
    lighter, darker = _make_grain_tiles()
    row, column = (number * 7919) % 61, (number * 104_729) % 67
    there = np.s_[row : row + HEIGHT, column : column + WIDTH]
    return np.asarray(cv2.subtract(cv2.add(image, lighter[there]), darker[there]), np.uint8)


@lru_cache(maxsize=1)
def _make_grain_tiles() -> tuple[Image, Image]:
    noise = np.random.default_rng(7).normal(0, GRAIN, (HEIGHT + 61, WIDTH + 67, 1)).round()
    both = [
        np.repeat(np.clip(sign * noise, 0, 255), 3, axis=2).astype(np.uint8) for sign in (1, -1)
    ]
    return both[0], both[1]
