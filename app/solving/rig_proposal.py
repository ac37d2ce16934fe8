"""Rig proposal: adjusted cameras beside those in use, with what judges them.

The judge is held out: cameras are adjusted to every other block of time and measured on the
blocks between.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from app.geometry.arrays import FloatArray, flatten_covariance
from app.geometry.bundle import optimize_points, ray_pair_distances_px
from app.geometry.camera import Camera
from app.geometry.resection import X, Z, projection_jacobians
from app.soccer.pitch import Pitch
from app.soccer.policy import Policy
from app.solving.rig import (
    ANCHOR_POINTS,
    PRIOR_SIGMA,
    Rig,
    RigCamera,
    RigFit,
    RigFrame,
    adjust_rig,
    make_rig,
    measure_line_distances,
    sample_grass_in_view,
)

PROPOSAL_VERSION = 2
"""Part of what a proposal's digest is of; raised by one whenever it says another number."""
BLOCK = 50
"""Frames in a block of time: two seconds at 25 frames a second."""
MIN_OFFSET_FRAMES = 50
"""Instants with a moving ball that a time offset of two cameras needs."""
MAX_SIGMAS = 4.0
"""A ball farther off is another ball; it says nothing about time."""


@dataclass(frozen=True)
class CameraChange:
    """A camera of a rig before and after.

    Attributes:
        key: Of its station.
        before: The camera in use.
        after: The adjusted camera.
        covariance: Of the adjusted camera's parameters, 8 x 8, row by row.
        covariance_before: The same for the camera in use: what is unknown of the adjusted one,
            and an error as large in the picture as its distance from it.
        moved_m: How far its position moves.
        turned_degrees: How far it turns.
        focal_percent: How much longer its focal length becomes.
        picture_px: How far the grass moves in its picture, in the median.
        position_sigma_m: Of the adjusted position, all axes together.
        picture_sigma_px: How well the grass is known in the adjusted picture, in the median.
        lines_before_px: Median distance of the annotated lines; None without any.
        lines_after_px: The same with the adjusted camera.
    """

    key: str
    before: Camera
    after: Camera
    covariance: tuple[float, ...]
    covariance_before: tuple[float, ...]
    moved_m: float
    turned_degrees: float
    focal_percent: float
    picture_px: float
    position_sigma_m: float
    picture_sigma_px: float
    lines_before_px: float | None
    lines_after_px: float | None


@dataclass(frozen=True)
class PairChange:
    """Two cameras of a rig: how far their rays to one ball pass each other, before and after.

    Attributes:
        a: Key of the one; ``b`` of the other.
        frames: Instants in which both show the ball.
        before_px: Median gap of the rays, both reprojection errors added.
        after_px: The same with the adjusted cameras.
        held_out: Instants in blocks of time that the judged cameras were not adjusted to.
        held_out_before_px: Median gap there; None without any.
        held_out_after_px: The same with cameras that never saw those instants.
        offset_frames: How far camera b is ahead of a: its frame t shows the instant that a shows
            at t + offset. None where too few balls move.
        offset_sigma_frames: Standard deviation of that.
    """

    a: str
    b: str
    frames: int
    before_px: float
    after_px: float
    held_out: int
    held_out_before_px: float | None
    held_out_after_px: float | None
    offset_frames: float | None
    offset_sigma_frames: float | None


@dataclass(frozen=True)
class RigProposal:
    """Adjusted cameras, for a person to accept or not.

    Attributes:
        cameras: Those that share enough balls.
        pairs: Every two of them that show one ball together.
        left_alone: Keys of cameras that share too few balls, or have no calibration.
        frames: Instants that the cameras were adjusted to.
        gross: Instants that were left out, because their rays pass each other by more than tau.
        ball_sigma_px: Noise of a ball's click at 1920 x 1080, never below the policy's.
        line_points: Annotated points of lines that hold the rig in its place.
        ball_moved_m: How far balls move, in the median; ``ball_moved_p95_m`` 95 % of them less.
    """

    cameras: tuple[CameraChange, ...]
    pairs: tuple[PairChange, ...]
    left_alone: tuple[str, ...]
    frames: int
    gross: int
    ball_sigma_px: float
    line_points: int
    ball_moved_m: float
    ball_moved_p95_m: float


def propose_rig(
    cameras: Sequence[RigCamera], frames: Sequence[RigFrame], pitch: Pitch, policy: Policy
) -> RigProposal:
    """Adjust a rig to all its instants, and judge it by an adjustment to half of them.

    Raises:
        InputError: Too few cameras share balls, or one has a lens that cannot be adjusted.
    """
    rig, gross = make_rig(cameras, frames, pitch, policy)
    odd = rig.times // BLOCK % 2 == 1
    fit = adjust_rig(rig)
    halved = adjust_rig(rig.only_instants(~odd)) if odd.any() and not odd.all() else None
    balls = optimize_points(fit.parameters, rig.rays, np.inf)
    moved = np.linalg.norm(
        balls - optimize_points(rig.initial_parameters, rig.rays, np.inf), axis=1
    )
    used = {camera.key for camera in rig.cameras}
    return RigProposal(
        cameras=tuple(
            _compare_camera(rig, fit, row, balls[rig.rays.point[rig.rays.camera == row]])
            for row in range(len(rig.cameras))
        ),
        pairs=tuple(_compare_pairs(rig, fit, halved, odd)),
        left_alone=tuple(camera.key for camera in cameras if camera.key not in used),
        frames=rig.rays.point_count,
        gross=gross,
        ball_sigma_px=fit.ball_sigma * policy.click_sigma_px,
        line_points=sum(len(item) for camera in rig.cameras for item in camera.lines.values()),
        ball_moved_m=float(np.median(moved)),
        ball_moved_p95_m=float(np.percentile(moved, 95)),
    )


def compute_error_covariance(
    camera: RigCamera, parameters: FloatArray, balls: FloatArray
) -> FloatArray:
    """Covariance of the camera in use about the adjusted one, shape (8, 8).

    Of its error one example is known. The square of that would say that the error can be no other
    one: two rays could then not miss each other by more than the root of two in sigmas, and balls
    elsewhere would count as exact. What is kept of it is how large it is in the picture, in the
    mean square over the balls; its shape is that of any error which moves the grass alike.

    Args:
        camera: With the camera in use.
        parameters: Of the adjusted camera, shape (8,).
        balls: That it shows, pitch frame, metres, shape (N, 3).
    """
    after, step = camera.camera_of_parameters(parameters), camera.parameters - parameters
    moved = camera.camera.project(balls, folded=True) - after.project(balls, folded=True)
    shown = np.isfinite(moved).all(axis=1)
    grass = sample_grass_in_view(camera)
    slopes = _pixel_derivatives(camera, parameters, grass)
    information = np.einsum("nia,nib->ab", slopes, slopes) / max(len(grass), 1)
    square = float(step @ information @ step)
    if not (square > 0 and shown.any()):
        return np.outer(step, step)
    information *= ANCHOR_POINTS / square
    covariance = np.linalg.inv(information + np.diag(1 / PRIOR_SIGMA**2))
    slopes = _pixel_derivatives(camera, parameters, balls[shown])
    expected = np.einsum("nia,ab,nib->", slopes, covariance, slopes)
    scaled: FloatArray = covariance * float((moved[shown] ** 2).sum() / expected)
    return scaled


def _pixel_derivatives(camera: RigCamera, parameters: FloatArray, points: FloatArray) -> FloatArray:
    """Derivatives of points' pixels by the parameters of their camera, shape (N, 2, 8)."""
    rows = np.repeat(parameters[None], len(points), axis=0)
    return projection_jacobians(rows, points, np.full(len(points), camera.half_diagonal))


def _compare_camera(rig: Rig, fit: RigFit, row: int, balls: FloatArray) -> CameraChange:
    camera, parameters, covariance = rig.cameras[row], fit.parameters[row], fit.covariance_of(row)
    after = camera.camera_of_parameters(parameters)
    turn = after.rotation @ camera.camera.rotation.T
    grass = sample_grass_in_view(camera)
    moved = after.project(grass) - camera.camera.project(grass)
    slopes = _pixel_derivatives(camera, parameters, grass)
    variances = np.trace(slopes @ covariance @ slopes.transpose(0, 2, 1), axis1=1, axis2=2)
    lines = any(camera.lines.values())
    return CameraChange(
        key=camera.key,
        before=camera.camera,
        after=after,
        covariance=flatten_covariance(covariance),
        covariance_before=flatten_covariance(
            covariance + compute_error_covariance(camera, parameters, balls)
        ),
        moved_m=float(np.linalg.norm(after.position - camera.camera.position)),
        turned_degrees=float(np.degrees(np.arccos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))),
        focal_percent=100 * (after.focal_length[0] / camera.camera.focal_length[0] - 1),
        picture_px=_median_or_none(np.hypot(*moved.T)) or 0.0,
        position_sigma_m=float(np.sqrt(np.trace(covariance[X : Z + 1, X : Z + 1]))),
        picture_sigma_px=_median_or_none(np.sqrt(variances)) or 0.0,
        lines_before_px=_median_or_none(
            measure_line_distances(camera, rig.initial_parameters[row], rig.pitch)
        )
        if lines
        else None,
        lines_after_px=_median_or_none(measure_line_distances(camera, parameters, rig.pitch))
        if lines
        else None,
    )


def _compare_pairs(
    rig: Rig, fit: RigFit, halved: RigFit | None, odd: FloatArray
) -> list[PairChange]:
    pairs = []
    for a, b in combinations(range(len(rig.cameras)), 2):
        rays, rows = rig.rays.select_common_points(a, b)
        if len(rows) == 0:
            continue
        before, after = (
            ray_pair_distances_px(rig.initial_parameters, rays)[0],
            ray_pair_distances_px(fit.parameters, rays)[0],
        )
        out = odd[rows] if halved is not None else np.zeros(len(rows), bool)
        unseen = None if halved is None else ray_pair_distances_px(halved.parameters, rays)[0]
        offset = estimate_time_offset(rig, fit, a, b)
        pairs.append(
            PairChange(
                a=rig.cameras[a].key,
                b=rig.cameras[b].key,
                frames=len(rows),
                before_px=float(np.median(before)),
                after_px=float(np.median(after)),
                held_out=int(out.sum()),
                held_out_before_px=_median_or_none(before[out]),
                held_out_after_px=None if unseen is None else _median_or_none(unseen[out]),
                offset_frames=None if offset is None else offset[0],
                offset_sigma_frames=None if offset is None else offset[1],
            )
        )
    return pairs


def estimate_time_offset(rig: Rig, fit: RigFit, a: int, b: int) -> tuple[float, float] | None:
    """How many frames camera b is ahead of camera a, and the sigma of that.

    Ahead by ``offset``: frame t of b shows the instant that a shows at t + offset. A ball that
    moves is then seen in b where it is a little later, so that the rays pass each other in
    proportion to its speed. The sigma is that of blocks of time, because the gaps of
    neighbouring frames are alike.

    Returns:
        None where too few instants show a ball before and after.
    """
    rays, rows = rig.rays.select_common_points(a, b)
    times = rig.times[rows]
    order = {time: place for place, time in enumerate(times.tolist())}
    around = [
        (place, order[time - 1], order[time + 1])
        for time, place in order.items()
        if time - 1 in order and time + 1 in order
    ]
    if len(around) < MIN_OFFSET_FRAMES:
        return None
    here, earlier, later = np.array(around).T
    _, gaps, free = ray_pair_distances_px(fit.parameters, rays)
    in_b = np.argsort(rays.point, kind="stable").reshape(-1, 2)
    second = np.where(rays.camera[in_b] == b, 1, 0).argmax(axis=1)
    row = in_b[np.arange(len(in_b)), second]
    pixels = rays.pixels[row]
    speed = (pixels[later] - pixels[earlier]) / 2 / rays.sigma[row][here, None]
    along = free.reshape(-1, 2, 2)[here, second[here]]
    # Residuals are projected less measured: a later picture lowers them.
    slope, gap = -(along * speed).sum(axis=1), gaps[here]
    sound = np.abs(gap - np.median(gap)) < MAX_SIGMAS
    slope, gap, block = slope[sound], gap[sound], times[here][sound] // BLOCK
    slope, gap = slope - slope.mean(), gap - gap.mean()
    power = float((slope**2).sum())
    if not power > 0:
        return None
    offset = float((slope * gap).sum()) / power
    _, blocks = np.unique(block, return_inverse=True)
    pulls = np.bincount(blocks, slope * (gap - offset * slope))
    return offset, float(np.sqrt((pulls**2).sum())) / power


def _median_or_none(values: FloatArray) -> float | None:
    return float(np.median(values)) if len(values) else None
