"""Props: goals with their nets, the ball as a shaded sphere, the scoreboard; and patches, small pictures with their own
transparency that are laid over a frame.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.sphere import tight_box
from app.sample.fixture import Colour, SampleMatch
from app.sample.play import BALL_DIAMETER, HALF_LENGTH, Instant
from app.soccer.pitch import GOAL_HEIGHT, GOAL_WIDTH

Image = npt.NDArray[np.uint8]
Paint = tuple[float, float, float, float]
_SHIFT = 4
_SUB = 1 << _SHIFT


class Patch:
    """Shapes in image pixels, drawn ``fine`` times larger and averaged down: soft, true edges.

    Colours are multiplied by their opacity when drawn, so that averaging is right.
    """

    def __init__(self, low: FloatArray, high: FloatArray, fine: int, image: Image) -> None:
        rows, columns = image.shape[:2]
        self.left = int(np.clip(np.floor(low[0]), 0, columns))
        self.top = int(np.clip(np.floor(low[1]), 0, rows))
        self.right = int(np.clip(np.ceil(high[0]) + 1, self.left, columns))
        self.bottom = int(np.clip(np.ceil(high[1]) + 1, self.top, rows))
        self.fine = fine
        self.image = image
        shape = ((self.bottom - self.top) * fine, (self.right - self.left) * fine, 4)
        self.pixels = np.zeros(shape, np.uint8)

    @property
    def is_outside_frame(self) -> bool:
        """Whether it lies outside the frame."""
        return self.pixels.size == 0

    def to_enlarged_pixels(self, points: FloatArray) -> npt.NDArray[np.int32]:
        """Image pixels in the fixed-point coordinates of the enlarged picture."""
        # The centre of pixel 0 is at 0, that of the enlarged pixel 0 at (0.5 / fine) - 0.5.
        local = (points - (self.left - 0.5, self.top - 0.5)) * self.fine - 0.5
        return np.asarray(np.round(local * _SUB), np.int32)

    def fill_polygon(self, points: FloatArray, colour: Colour) -> None:
        """Fill a convex polygon, image pixels, shape (N, 2)."""
        cv2.fillConvexPoly(
            self.pixels,
            self.to_enlarged_pixels(points),
            _premultiplied_colour(colour, 1.0),
            8,
            _SHIFT,
        )

    def fill_disc(self, center: FloatArray, radius: float, colour: Colour) -> None:
        """Fill a circle; centre and radius in image pixels."""
        self._draw_disc(
            float(center[0]), float(center[1]), radius, _premultiplied_colour(colour, 1.0)
        )

    def fill_capsule(
        self, a: FloatArray, b: FloatArray, radius_a: float, radius_b: float, colour: Colour
    ) -> None:
        """Fill a limb: two circles and what lies between them, image pixels."""
        # Plain numbers: a frame has thousands of limbs, and arrays of two are slow.
        ax, ay, bx, by = float(a[0]), float(a[1]), float(b[0]), float(b[1])
        paint = _premultiplied_colour(colour, 1.0)
        self._draw_disc(ax, ay, radius_a, paint)
        self._draw_disc(bx, by, radius_b, paint)
        length = math.hypot(bx - ax, by - ay)
        if length < 1e-6:
            return
        nx, ny = (ay - by) / length, (bx - ax) / length
        quad = [
            self._to_fixed_point(ax + nx * radius_a, ay + ny * radius_a),
            self._to_fixed_point(bx + nx * radius_b, by + ny * radius_b),
            self._to_fixed_point(bx - nx * radius_b, by - ny * radius_b),
            self._to_fixed_point(ax - nx * radius_a, ay - ny * radius_a),
        ]
        cv2.fillConvexPoly(self.pixels, np.array(quad, np.int32), paint, 8, _SHIFT)

    def _draw_disc(self, x: float, y: float, radius: float, paint: Paint) -> None:
        size = max(1, round(radius * self.fine * _SUB))
        cv2.circle(self.pixels, self._to_fixed_point(x, y), size, paint, -1, 8, _SHIFT)

    def _to_fixed_point(self, x: float, y: float) -> tuple[int, int]:
        """As ``to_enlarged_pixels``, for one point."""
        return (
            round(((x - self.left + 0.5) * self.fine - 0.5) * _SUB),
            round(((y - self.top + 0.5) * self.fine - 0.5) * _SUB),
        )

    def draw_polyline(
        self, points: FloatArray, colour: Colour, opacity: float, thickness: int
    ) -> None:
        """A thin line through image pixels, ``thickness`` in enlarged pixels."""
        path = [self.to_enlarged_pixels(points).reshape(-1, 1, 2)]
        cv2.polylines(
            self.pixels, path, False, _premultiplied_colour(colour, opacity), thickness, 8, _SHIFT
        )

    def draw_on_frame(self, gain: Colour = (1.0, 1.0, 1.0)) -> None:
        """Put it on the frame.

        Args:
            gain: Light on it, per channel.
        """
        if self.is_outside_frame:
            return
        size = (self.right - self.left, self.bottom - self.top)
        small = cv2.resize(self.pixels, size, interpolation=cv2.INTER_AREA).astype(np.float32)
        area = self.image[self.top : self.bottom, self.left : self.right]
        keep = 1.0 - small[..., 3:] / 255.0
        mixed = area * keep + small[..., :3] * np.array(gain, np.float32)
        area[...] = np.clip(mixed, 0, 255).astype(np.uint8)


def _premultiplied_colour(colour: Colour, opacity: float) -> Paint:
    b, g, r = colour
    return b * opacity, g * opacity, r * opacity, 255.0 * opacity


POST_RADIUS = 0.06
NET_DEPTH_TOP, NET_DEPTH_LOW = 0.9, 2.1
MESH = 0.20
WHITE: Colour = (238.0, 240.0, 240.0)


def draw_net(image: Image, camera: Camera, sign: float, gain: Colour) -> None:
    """The net of the goal at x = ``sign`` * 52.5 m."""
    strands = _list_net_cords(sign)
    everything = camera.project(np.vstack(strands))
    scale = _pixels_per_metre_at_goal(camera, sign)
    if scale is None or np.isnan(everything).any() or not _is_in_frame(everything, image):
        return
    patch = Patch(everything.min(axis=0) - 2, everything.max(axis=0) + 2, 2, image)
    if patch.is_outside_frame:
        return
    # A cord of 4 mm is thinner than a pixel of the enlarged patch: it covers a part of it.
    wide = 0.005 * scale * 2
    opacity = float(np.clip(0.16 + 0.5 * wide, 0.2, 0.75))
    ends = np.cumsum([len(strand) for strand in strands])
    for path in np.split(everything, ends[:-1]):
        patch.draw_polyline(path, WHITE, opacity, max(1, round(wide)))
    patch.draw_on_frame(gain)


@lru_cache(maxsize=2)
def _list_net_cords(sign: float) -> list[FloatArray]:
    """Cords of the net: across the back, over the roof and down, and on both sides."""
    half = GOAL_WIDTH / 2
    profile = np.array(
        [(0.0, GOAL_HEIGHT), (NET_DEPTH_TOP, GOAL_HEIGHT - 0.06), (NET_DEPTH_LOW, 0.0)]
    )
    cords = []
    for y in np.linspace(-half, half, round(GOAL_WIDTH / MESH) + 1):
        cords.append(_goal_points(sign, profile, y))
    lengths = np.hypot(*np.diff(profile, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    for s in np.arange(MESH, along[-1], MESH):
        depth, up = (np.interp(s, along, profile[:, axis]) for axis in (0, 1))
        sag = 0.05 * np.sin(np.linspace(0, np.pi, 7))
        row = np.column_stack([depth + sag, np.full(7, up)])
        cords.append(_goal_points(sign, row, np.linspace(-half, half, 7)))
    for y in (-half, half):
        for up in np.arange(0.0, GOAL_HEIGHT, MESH):
            end = NET_DEPTH_LOW + (NET_DEPTH_TOP - NET_DEPTH_LOW) * up / GOAL_HEIGHT
            cords.append(_goal_points(sign, np.array([(0.0, up), (end, up)]), y))
        for depth in np.arange(MESH, NET_DEPTH_LOW, MESH):
            top = GOAL_HEIGHT * min(1.0, (NET_DEPTH_LOW - depth) / (NET_DEPTH_LOW - NET_DEPTH_TOP))
            cords.append(_goal_points(sign, np.array([(depth, 0.0), (depth, top)]), y))
    return cords


def _goal_points(sign: float, profile: FloatArray, y: FloatArray | float) -> FloatArray:
    x = sign * (HALF_LENGTH + profile[:, 0])
    return np.column_stack([x, np.broadcast_to(y, x.shape), -profile[:, 1]])


def draw_goal_posts(image: Image, camera: Camera, sign: float, gain: Colour) -> None:
    """Posts and crossbar of the goal at x = ``sign`` * 52.5 m, round and 12 cm thick."""
    half = GOAL_WIDTH / 2
    corners = np.array([(-half, 0.0), (-half, GOAL_HEIGHT), (half, GOAL_HEIGHT), (half, 0.0)])
    pieces = [a + np.linspace(0, 1, 9)[:, None] * (b - a) for a, b in pairwise(corners)]
    bars = [np.column_stack([np.full(9, sign * HALF_LENGTH), p[:, 0], -p[:, 1]]) for p in pieces]
    pixels = [camera.project(bar) for bar in bars]
    everything = np.vstack(pixels)
    if np.isnan(everything).any() or not _is_in_frame(everything, image):
        return
    depths = [camera.pitch_to_camera(bar)[:, 2] for bar in bars]
    radii = [POST_RADIUS * camera.focal_length[0] / depth for depth in depths]
    margin = max(float(r.max()) for r in radii) + 2
    patch = Patch(everything.min(axis=0) - margin, everything.max(axis=0) + margin, 3, image)
    if patch.is_outside_frame:
        return
    for share, shift, colour in ((1.0, 0.0, (150.0, 150.0, 150.0)), (0.74, -0.22, WHITE)):
        for path, radius in zip(pixels, radii, strict=True):
            for i in range(len(path) - 1):
                move = np.array([shift, shift]) * radius[i]
                patch.fill_capsule(
                    path[i] + move,
                    path[i + 1] + move,
                    radius[i] * share,
                    radius[i + 1] * share,
                    colour,
                )
    patch.draw_on_frame(gain)


def draw_ball(
    image: Image, camera: Camera, instant: Instant, gain: Colour, lit_from: float
) -> None:
    """The ball where it is: each of 25 rays a pixel meets the sphere or passes it.

    Args:
        lit_from: -1 where light comes from the left of the image, +1 from the right.
    """
    radius = BALL_DIAMETER / 2
    box = tight_box(camera, instant.ball, radius)
    rows, columns = image.shape[:2]
    left, top = (int(value) for value in np.floor(box[:2]))
    right, bottom = (int(value) + 1 for value in np.ceil(box[2:]))
    left, top, right, bottom = max(left, 0), max(top, 0), min(right, columns), min(bottom, rows)
    if right <= left or bottom <= top:
        return
    fine = 5
    offsets = (np.arange(fine) + 0.5) / fine - 0.5
    xs = (np.arange(left, right)[:, None] + offsets).ravel()
    ys = (np.arange(top, bottom)[:, None] + offsets).ravel()
    grid = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    hit, normals = _intersect_sphere(camera, grid, instant.ball, radius)
    colour = _shade_ball(camera, normals, instant.spin, lit_from) * np.array(gain)
    shape = (bottom - top, fine, right - left, fine)
    cover = hit.reshape(shape).mean(axis=(1, 3))[..., None]
    summed = (colour * hit[:, None]).reshape(*shape, 3).mean(axis=(1, 3))
    area = image[top:bottom, left:right]
    area[...] = np.clip(area * (1 - cover) + summed, 0, 255).astype(np.uint8)


def _intersect_sphere(
    camera: Camera, pixels: FloatArray, center: FloatArray, radius: float
) -> tuple[FloatArray, FloatArray]:
    """1 where the ray of a pixel meets the sphere, and the normal there."""
    rays = camera.rays(pixels)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    to_center = center - camera.position
    along = rays @ to_center
    miss = (to_center @ to_center) - along**2
    hit = miss < radius**2
    t = along - np.sqrt(np.where(hit, radius**2 - miss, 0.0))
    normals = (camera.position + rays * t[:, None] - center) / radius
    return hit.astype(np.float64), normals


def _shade_ball(
    camera: Camera, normals: FloatArray, spin: FloatArray, lit_from: float
) -> FloatArray:
    """White with dark pentagons at the corners of an icosahedron, lit from above."""
    golden = (1 + 5**0.5) / 2
    corners = np.array(
        [p for a in (-1, 1) for b in (-golden, golden) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    ) / np.hypot(1.0, golden)
    angle = float(np.linalg.norm(spin)) + 1e-9
    axis = spin / angle
    turned = (
        normals * np.cos(angle)
        + np.cross(axis, normals) * np.sin(angle)
        + np.outer(normals @ axis, axis) * (1 - np.cos(angle))
    )
    dark = (turned @ corners.T).max(axis=1) > 0.957
    base = np.where(dark[:, None], (64.0, 58.0, 56.0), (244.0, 246.0, 246.0))
    light = np.array([0.0, 0.0, -0.85]) + 0.5 * lit_from * camera.rotation[0]
    light /= np.linalg.norm(light)
    shade = 0.70 + 0.36 * np.clip(normals @ light, -0.6, 1.0)
    return np.asarray(base * shade[:, None], dtype=np.float64)


def _pixels_per_metre_at_goal(camera: Camera, sign: float) -> float | None:
    depth = float(camera.pitch_to_camera(np.array([[sign * HALF_LENGTH, 0.0, -1.2]]))[0, 2])
    return camera.focal_length[0] / depth if depth > 0.5 else None


def _is_in_frame(pixels: FloatArray, image: Image) -> bool:
    rows, columns = image.shape[:2]
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return bool((high > -20).all() and low[0] < columns + 20 and low[1] < rows + 20)


LEFT, TOP, HEIGHT = 36, 30, 30
FONT = cv2.FONT_HERSHEY_DUPLEX
DARK = (44, 34, 28)
LIGHT = (240, 240, 240)


def draw_scoreboard(image: Image, fixture: SampleMatch, game_time: str, is_main: bool) -> None:
    """Teams, score and time on the main camera; a small mark on replays."""
    if not is_main:
        _draw_text_cell(image, LEFT, 84, "REPLAY", (36, 36, 190), LIGHT)
        return
    look = fixture.look
    clock = game_time.split(" - ")[-1]
    home, away = fixture.score
    x = LEFT
    x = _draw_text_cell(image, x, 66, clock, LIGHT, DARK)
    x = _draw_team(image, x, fixture.home, look.home.shirt)
    x = _draw_text_cell(image, x, 62, f"{home} - {away}", (96, 60, 24), LIGHT)
    _draw_team(image, x, fixture.away, look.away.shirt)


def _draw_team(image: Image, x: int, name: str, colour: Colour) -> int:
    cv2.rectangle(image, (x, TOP), (x + 5, TOP + HEIGHT), colour, -1)
    return _draw_text_cell(image, x + 6, 58, name[:3].upper(), DARK, LIGHT)


def _draw_text_cell(
    image: Image, x: int, width: int, text: str,
    ground: tuple[int, int, int], ink: tuple[int, int, int],
) -> int:  # fmt: skip
    cv2.rectangle(image, (x, TOP), (x + width - 1, TOP + HEIGHT), ground, -1)
    (length, height), _ = cv2.getTextSize(text, FONT, 0.55, 1)
    origin = (x + (width - length) // 2, TOP + (HEIGHT + height) // 2)
    cv2.putText(image, text, origin, FONT, 0.55, ink, 1, cv2.LINE_AA)
    return x + width
