"""The ball's rays in one view over time: what a link of two recordings is found from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray, IntArray
from app.geometry.camera import Camera

LONGEST_GAP_S, ROUNDED_S = 0.2, 1e-3
"""Between two rays of the ball beyond which nothing is known of those between."""
_LEAST_SIGMA_PX = 0.3
"""No centre of a ball is known better: whole pixels alone leave this."""
_GROSS, _GROSS_PX = 8.0, 4.0
"""Sigmas and pixels from both neighbours' path beyond which a ray is of something else."""
_ROUNDS = 6
"""Times that gross errors are looked for: one hides another beside it."""
_NEAR = 2
"""Rays on either side among which the worst alone is left out."""
_SLOPE_NEAR = 4
"""Rays on either side that a slope is taken from."""
_HALF_TURN = np.array([-1.0, -1.0, 1.0])

BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class BallRays:
    """Rays of the ball in one view, by time.

    Attributes:
        times: Seconds, increasing, shape (N,).
        positions: Of the cameras in the pitch frame, metres, shape (N, 3).
        directions: Of the rays in the pitch frame, unit length, shape (N, 3).
        sigma: Noise of a direction, radians, shape (N,).
        sigma_px: The same in pixels, as the path shows it.
        gross: Rays left out because their neighbours' path contradicts them.
    """

    times: FloatArray
    positions: FloatArray
    directions: FloatArray
    sigma: FloatArray
    sigma_px: float
    gross: int

    def __len__(self) -> int:
        return len(self.times)

    def part(self, rows: IntArray) -> BallRays:
        """Some of the rays."""
        return replace(
            self,
            times=self.times[rows],
            positions=self.positions[rows],
            directions=self.directions[rows],
            sigma=self.sigma[rows],
        )

    def rotate_half_turn(self) -> BallRays:
        """As cameras see them that are turned by 180 degrees about the centre mark."""
        return replace(
            self, positions=self.positions * _HALF_TURN, directions=self.directions * _HALF_TURN
        )


def build_ball_rays(
    times: Sequence[float], pixels: Sequence[Sequence[float]], cameras: Sequence[Camera]
) -> BallRays:
    """The rays of a ball, without gross errors, and how noisy its own path shows them to be.

    A ball's path has no corners within a few frames but where it is kicked, and there one side fits.

    Args:
        times: Seconds, increasing, shape (N,).
        pixels: Where the image shows the ball, shape (N, 2).
        cameras: One for each ray.
    """
    by_camera: dict[int, list[int]] = {}
    for at, camera in enumerate(cameras):
        by_camera.setdefault(id(camera), []).append(at)
    places = np.asarray(pixels, dtype=float).reshape(-1, 2)
    directions = np.empty((len(places), 3))
    for rows in by_camera.values():
        directions[rows] = cameras[rows[0]].rays(places[rows])
    length = np.linalg.norm(directions, axis=1)
    focal = np.array(
        [np.sqrt(camera.focal_length[0] * camera.focal_length[1]) for camera in cameras]
    )
    # A pixel off the axis turns the ray by less than one in the middle of the picture.
    scale = focal * length
    time = np.asarray(times, dtype=float)
    keep = np.flatnonzero(np.isfinite(length))
    unit = directions / length[:, None]
    positions = np.array([camera.position for camera in cameras]).reshape(-1, 3)
    sigma_px = _LEAST_SIGMA_PX
    for _ in range(_ROUNDS):
        sigma_px = _estimate_noise_px(time[keep], unit[keep], scale[keep])
        off = _distance_from_neighbour_path(time[keep], unit[keep], scale[keep])
        limit = max(_GROSS * sigma_px, _GROSS_PX)
        # The worst of its neighbourhood alone: beside a gross error the sound ones look wrong.
        worst = (off > limit) & (off >= _rolling_maximum(off))
        if not worst.any():
            break
        keep = keep[~worst]
    return BallRays(
        time[keep],
        positions[keep],
        unit[keep],
        sigma_px / scale[keep],
        sigma_px,
        len(places) - len(keep),
    )


def estimate_ray_velocities(rays: BallRays) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Velocities of cameras and of rays, from a line through the neighbours of each ray.

    Returns:
        Of the positions, metres per second, (N, 3); of the directions, per second, (N, 3); and the
        variance that noise gives the latter, (N,).
    """
    count = len(rays)
    at = np.arange(count)[:, None] + np.arange(-_SLOPE_NEAR, _SLOPE_NEAR + 1)
    inside = (at >= 0) & (at < count)
    at = np.clip(at, 0, count - 1)
    inside &= np.abs(rays.times[at] - rays.times[:, None]) <= LONGEST_GAP_S + ROUNDED_S
    members = inside.sum(axis=1, keepdims=True)
    mean = np.where(inside, rays.times[at], 0.0).sum(axis=1, keepdims=True) / members
    step = np.where(inside, rays.times[at] - mean, 0.0)
    spread = (step**2).sum(axis=1)
    spread[spread == 0] = np.inf
    weight = step / spread[:, None]
    moved = np.einsum("nk,nkc->nc", weight, rays.positions[at])
    turned = np.einsum("nk,nkc->nc", weight, rays.directions[at])
    return moved, turned, rays.sigma**2 / spread


def _estimate_noise_px(times: FloatArray, directions: FloatArray, scale: FloatArray) -> float:
    """Noise of one number of a ray in pixels, from how far each is from a parabola of its neighbours."""
    if len(times) < 8:
        return 1.0
    at = np.arange(1, len(times) - 2)
    t = times[at[:, None] + np.array([-1, 0, 1, 2])]
    near = t[:, 3] - t[:, 0] < 2 * LONGEST_GAP_S
    if near.sum() < 5:
        return 1.0
    at, t = at[near], t[near]
    weights = [_lagrange_weight(t[:, 1], t[:, [0, 2, 3]], which) for which in range(3)]
    miss = directions[at] - sum(
        weight[:, None] * directions[at + step]
        for weight, step in zip(weights, (-1, 1, 2), strict=True)
    )
    spread = np.sqrt(1 + sum(weight**2 for weight in weights))
    miss = _perpendicular_component(miss, directions[at]) * (scale[at] / spread)[:, None]
    # The median of a length of two normal numbers is 1.177 sigma.
    return max(float(np.median(np.linalg.norm(miss, axis=1))) / 1.177, _LEAST_SIGMA_PX)


def _lagrange_weight(x: FloatArray, nodes: FloatArray, which: int) -> FloatArray:
    value = np.ones(len(x))
    for other in range(nodes.shape[1]):
        if other != which:
            value *= (x - nodes[:, other]) / (nodes[:, which] - nodes[:, other])
    return value


def _perpendicular_component(vectors: FloatArray, directions: FloatArray) -> FloatArray:
    """What of vectors is at right angles to directions."""
    along = (vectors * directions).sum(axis=1, keepdims=True)
    across: FloatArray = vectors - along * directions
    return across


def _distance_from_neighbour_path(
    times: FloatArray, directions: FloatArray, scale: FloatArray
) -> FloatArray:
    """Pixels between each ray and the path of its neighbours, by the pair of them that fits best."""
    count = len(times)
    found = np.full(count, np.inf)
    for first, second in ((-2, -1), (-1, 1), (1, 2), (-2, 1), (-1, 2)):
        at = np.arange(max(0, -first), count - max(0, second))
        if not len(at):
            continue
        t0, t1 = times[at + first], times[at + second]
        share = (times[at] - t0) / (t1 - t0)
        path = directions[at + first] + share[:, None] * (
            directions[at + second] - directions[at + first]
        )
        miss = np.linalg.norm(
            _perpendicular_component(directions[at] - path, directions[at]), axis=1
        )
        spread = np.sqrt(1 + share**2 + (1 - share) ** 2)
        near = (
            np.maximum(np.abs(times[at] - t0), np.abs(times[at] - t1)) <= LONGEST_GAP_S + ROUNDED_S
        )
        found[at] = np.minimum(found[at], np.where(near, miss * scale[at] / spread, np.inf))
    found[~np.isfinite(found)] = 0.0
    return found


def _rolling_maximum(values: FloatArray) -> FloatArray:
    padded = np.pad(values, _NEAR, constant_values=-np.inf)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEAR + 1)
    largest: FloatArray = windows.max(axis=1)
    return largest
