"""Shadows: what people, goals and the ball leave of the light on the grass."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.instant import BALL_DIAMETER, Instant
from app.sample.look import Lamp, Light
from app.sample.pose import INDEX, LIMBS, Pose

Image = npt.NDArray[np.uint8]
HALVED = 2
"""Shadows are drawn at half size: they are soft, and there are many."""
_TURN = np.linspace(0, 2 * np.pi, 8, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])
_SHIFT = 4


def shadow_mask(
    camera: Camera, instant: Instant, pose: Pose, light: Light, height: int, width: int
) -> Image:
    """Light left on the grass, 255 is all, shape (height, width)."""
    scale = camera.focal_length[0] / float(camera.pitch_to_camera(instant.ball[None])[0, 2])
    left: Image = np.full((height // HALVED, width // HALVED), 255, np.uint8)
    ball_radius = BALL_DIAMETER / 2
    for lamp in light.lamps:
        layer = np.full_like(left, 255)
        _draw_people(layer, camera, pose, lamp)
        _draw_ball(layer, camera, instant.ball, lamp, ball_radius)
        sigma = float(np.clip(light.softness * scale / HALVED, 0.5, 7.0))
        left = _darken(left, cv2.GaussianBlur(layer, (0, 0), sigma))
    left = _darken(left, _contact(left, camera, instant, scale))
    return np.asarray(cv2.resize(left, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)


def _darken(light: Image, layer: npt.NDArray[Any]) -> Image:
    return np.asarray(cv2.multiply(light, layer, scale=1 / 255), np.uint8)


def _draw_people(layer: Image, camera: Camera, pose: Pose, lamp: Lamp) -> None:
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
        _fill(layer, hull, shade)


def _draw_ball(layer: Image, camera: Camera, ball: FloatArray, lamp: Lamp, radius: float) -> None:
    shift = np.array(lamp.shift)
    length = float(np.hypot(*shift))
    along = shift / max(length, 1e-9)
    across = np.array([-along[1], along[0]])
    # The shadow of a sphere is longer along the light.
    rim = np.outer(_CIRCLE[:, 0] * np.hypot(1.0, length), along) + np.outer(_CIRCLE[:, 1], across)
    center = ball[:2] - ball[2] * shift
    pixels = _project_ground(camera, center + radius * rim)
    if np.isfinite(pixels).all():
        _fill(layer, pixels, int(255 * (1 - lamp.darkness)))


def _contact(like: Image, camera: Camera, instant: Instant, scale: float) -> Image:
    """The dark patch right below feet and ball, whatever the light."""
    layer = np.full_like(like, 255)
    for place in instant.feet:
        pixels = _project_ground(camera, place + 0.30 * _CIRCLE)
        if np.isfinite(pixels).all():
            _fill(layer, pixels, 168)
    height = -float(instant.ball[2]) - BALL_DIAMETER / 2
    if height < 0.3:
        pixels = _project_ground(camera, instant.ball[:2] + 0.11 * _CIRCLE)
        if np.isfinite(pixels).all():
            _fill(layer, pixels, int(120 + 300 * height))
    sigma = float(np.clip(0.06 * scale / HALVED, 0.5, 6.0))
    return np.asarray(cv2.GaussianBlur(layer, (0, 0), sigma), np.uint8)


def _project_ground(camera: Camera, places: FloatArray) -> FloatArray:
    """Pixels of the halved picture for places on the grass, both shape (N, 2)."""
    pixels = camera.project(np.column_stack([places, np.zeros(len(places))]))
    return (pixels + 0.5) / HALVED - 0.5


def _fill(layer: Image, points: FloatArray, shade: int) -> None:
    fixed = np.clip(np.round(points * (1 << _SHIFT)), -(1 << 20), 1 << 20).astype(np.int32)
    cv2.fillConvexPoly(layer, cv2.convexHull(fixed), shade, 8, _SHIFT)
