"""Ranking: cameras of the search are snapped onto the paint, and ordered by how well they agree with all of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import BoolArray, FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    ROLL,
    TILT,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.paint.agreement import PaintAgreement, measure_agreement
from app.paint.candidates import KNOWN, CameraSearchSpace
from app.paint.evidence import PreparedPicture, has_grass_beside, trace_visible_markings
from app.paint.ridges import Strength
from app.paint.search import (
    KAPPA_MEAN,
    SCOUTED,
    SEARCHED,
    PictureToScore,
    VisiblePaint,
    find_visible_paint,
    get_kernel_executor,
    is_view_among,
    search_cameras,
)
from app.paint.snap import SnappedCamera, snap_to_prepared_picture
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy

Image = npt.NDArray[np.uint8]


WORK_WIDTH = 960


SNAPPED = 12


KNOWN_SNAPPED, KNOWN_SCOUTED, KNOWN_SEARCHED = 4, 150, 24
"""Where the match says where the camera stands, fewer are looked at."""


WINDOWS = (16.0, 10.0, 6.0, 4.0, 3.0, 3.0)


VISIBLE_PX = 0.8
"""Across: narrower paint may fade into the grass."""


KNOWN_KAPPA_SIGMA = 0.015
"""How far the distortion of a lens moves with its zoom."""


MARKING_PLACES = 12
"""Places (``evidence.SPACING_PX`` apart) from which on the paint of a marking would be seen."""


LEAST_WEAKEST, WELL_PAINTED = 0.25, 0.75
"""A marking with a lower share of its paint contradicts a camera, or shows it not drawn to the end."""


NEAR_KNOWN_M, NEAR_KNOWN_SIGMAS, KEPT_AT_KNOWN = 4.0, 3.0, 0.97
"""How near a known position a camera of the other libraries has to stand to be sought there, and the
share of its agreement that it has to keep."""


MOST_UNCERTAIN_M = 1.0
"""Standard deviation of the position: three lines lie on their paint for many cameras."""


AIM_SIGMA, LENS_SIGMA = np.radians([3.0, 3.0, 1.0]), np.array([0.2, 0.01])
"""Pan, tilt and roll; logarithm of the focal length and kappa: how far a start may be off."""


AIM, MOST_TURNED = [PAN, TILT, ROLL, LOG_FOCAL], 0.3
"""Radians, and a share of the focal length, that another position may make up for."""


@dataclass(frozen=True)
class FrameToSearch:
    """A frame in the width in which it is searched."""

    image: Image
    field: BoolArray
    strength: Strength
    pieces: FloatArray
    picture: PictureToScore
    reading: PreparedPicture

    @property
    def paint(self) -> BoolArray:
        """What looks like paint."""
        return np.asarray(self.strength > 0)


@dataclass(frozen=True)
class RankedCamera:
    """A camera on the paint, and how well it agrees with all of it.

    Attributes:
        weakest: As of ``measure_weakest_marking``.
        policy: Prior of the distortion with which it was snapped.
        known: Covariance of where it started, shape (8, 8), where the match knows the position.
    """

    snapped: SnappedCamera
    agreement: PaintAgreement
    weakest: float
    policy: CalibrationPolicy = field(default_factory=CalibrationPolicy)
    known: FloatArray | None = None

    @property
    def position_sigma_m(self) -> float:
        """Largest standard deviation of the position that the paint leaves, metres."""
        covariance = self.snapped.planned
        if covariance is None:
            return np.inf
        return float(np.sqrt(np.linalg.eigvalsh(covariance[X : Z + 1, X : Z + 1])[-1]))

    @property
    def is_contradicted(self) -> bool:
        """Whether a marking that would be seen has no paint."""
        return self.weakest < LEAST_WEAKEST

    @property
    def score(self) -> float:
        """Supported x explained, and half of that where a marking is contradicted."""
        return self.agreement.combined_score * (0.5 if self.is_contradicted else 1.0)


def rank_cameras(
    frame: FrameToSearch, library: CameraSearchSpace, pitch: Pitch, policy: CalibrationPolicy
) -> list[RankedCamera]:
    """The cameras of a library that lie on the paint of a frame, best first."""
    amount = (SNAPPED, SCOUTED, SEARCHED)
    if library.name == KNOWN:
        amount = (KNOWN_SNAPPED, KNOWN_SCOUTED, KNOWN_SEARCHED)
    if library.kappa is None:
        kappa = KAPPA_MEAN
    else:
        kappa = library.kappa
        sigma = min(KNOWN_KAPPA_SIGMA, policy.distortion_sigma)
        policy = replace(policy, distortion_mean=kappa, distortion_sigma=sigma)
    found = search_cameras(
        frame.picture, frame.pieces, library, pitch, get_kernel_executor(), *amount, kappa
    )
    if not found:
        return []
    drawn = get_kernel_executor().map(
        lambda item: _snap_from_search(frame, item.camera, library, pitch, policy), found
    )
    known = _make_start_covariance(library) if library.name == KNOWN else None
    ranked = [
        _rank_snapped(frame, item, pitch, policy, known) for item in drawn if item.reason is None
    ]
    if known is not None:
        ranked = [move_to_known_position(frame, item, library, pitch) for item in ranked]
    ranked = merge_ranked_cameras(frame, [], ranked)
    again = _snap_patchy_again(frame, ranked[0], pitch) if ranked else []
    return merge_ranked_cameras(frame, again, ranked)


def _snap_patchy_again(
    frame: FrameToSearch, item: RankedCamera, pitch: Pitch
) -> list[RankedCamera]:
    """A camera that lost the paint of a marking on the way to the others, drawn from afar once more;
    nothing where that shows no more of it."""
    if item.weakest >= WELL_PAINTED or item.known is not None:
        return []
    start = item.snapped.camera
    snapped = snap_with_known_position(frame.reading, start, pitch, WINDOWS, item.policy)
    if snapped.reason is not None:
        return []
    again = _rank_snapped(frame, snapped, pitch, item.policy, None)
    return [again] if again.weakest > item.weakest else []


def _rank_snapped(
    frame: FrameToSearch,
    snapped: SnappedCamera,
    pitch: Pitch,
    policy: CalibrationPolicy,
    known: FloatArray | None,
) -> RankedCamera:
    seen = measure_agreement(snapped.camera, frame.field, frame.paint, pitch)
    return RankedCamera(
        snapped, seen, measure_weakest_marking(frame.reading, snapped, pitch), policy, known
    )


def _snap_from_search(
    frame: FrameToSearch,
    start: Camera,
    library: CameraSearchSpace,
    pitch: Pitch,
    policy: CalibrationPolicy,
) -> SnappedCamera:
    """A camera drawn onto the paint; where the paint leaves a number open or would move it far,
    once more with what is known of cameras, or at the position that the match knows."""
    alone = snap_with_known_position(frame.reading, start, pitch, WINDOWS, policy)
    if alone.reason is None:
        return alone
    known = _make_start_covariance(library)
    if library.name == KNOWN:
        start = _move_to_nearest_stand(frame.reading, start, library, pitch)
        return snap_with_known_position(frame.reading, start, pitch, WINDOWS, policy, known)
    return snap_to_prepared_picture(
        frame.reading, start, pitch, WINDOWS, policy, known, circles_count_twice=True
    )


def move_to_known_position(
    frame: FrameToSearch, item: RankedCamera, match: CameraSearchSpace, pitch: Pitch
) -> RankedCamera:
    """A camera at the position that the match knows, where the paint alone leaves that open and shows
    the markings there as well."""
    if item.position_sigma_m <= MOST_UNCERTAIN_M:
        return replace(item, known=None)
    camera = item.snapped.camera
    away = np.linalg.norm(match.stands - camera.position, axis=1)
    if away.min() > max(NEAR_KNOWN_M, NEAR_KNOWN_SIGMAS * item.position_sigma_m):
        return replace(item, known=None)
    policy = replace(item.policy, distortion_mean=match.kappa or item.policy.distortion_mean)
    start, known = (
        _move_to_nearest_stand(frame.reading, camera, match, pitch),
        _make_start_covariance(match),
    )
    snapped = snap_with_known_position(frame.reading, start, pitch, WINDOWS, policy, known)
    if snapped.reason is not None:
        return replace(item, known=None)
    there = _rank_snapped(frame, snapped, pitch, policy, known)
    return there if there.score >= KEPT_AT_KNOWN * item.score else replace(item, known=None)


def _move_to_nearest_stand(
    reading: PreparedPicture, camera: Camera, library: CameraSearchSpace, pitch: Pitch
) -> Camera:
    """The camera at the nearest stand of a library, turned and zoomed so that it shows the same."""
    away = np.linalg.norm(library.stands - camera.position, axis=1)
    moved = library.stands[away.argmin()] - camera.position
    rows = trace_visible_markings(reading, camera, pitch).jacobian
    if len(rows) < len(AIM):
        return camera
    turned = np.linalg.lstsq(rows[:, AIM], -rows[:, X : Z + 1] @ moved, rcond=None)[0]
    if np.abs(turned).max() > MOST_TURNED:
        return camera
    parameters = parameters_from_camera(camera, reading.half_diagonal)
    parameters[X : Z + 1] += moved
    parameters[AIM] += turned
    return camera_from_parameters(parameters, camera.principal_point, reading.half_diagonal)


def _make_start_covariance(library: CameraSearchSpace) -> FloatArray:
    """Covariance of a start of the search, shape (8, 8)."""
    sigma = np.concatenate([AIM_SIGMA, library.position_sigma, LENS_SIGMA])
    return np.diag(sigma**2)


def snap_with_known_position(
    reading: PreparedPicture,
    start: Camera,
    pitch: Pitch,
    windows: Sequence[float],
    policy: CalibrationPolicy,
    known: FloatArray | None = None,
) -> SnappedCamera:
    """As ``snap_to_prepared_picture``, with what is known of the position where the match knows it."""
    return snap_to_prepared_picture(
        reading, start, pitch, windows, policy, known,
        circles_count_twice=True, position_is_known=known is not None,
    )  # fmt: skip


def measure_weakest_marking(
    reading: PreparedPicture, snapped: SnappedCamera, pitch: Pitch, visible_px: float = VISIBLE_PX
) -> float:
    """The lowest share of a marking's places that have paint; short markings do not count.

    A camera that lays some markings on paint that is there by chance shows others where none is.
    Nothing is asked of places behind people and along the border of the picture.
    """
    traced, paint = trace_visible_markings(reading, snapped.camera, pitch), snapped.evidence.traced
    usable = has_grass_beside(reading, traced, WINDOWS[-1] * reading.width / WORK_WIDTH)
    usable &= traced.widths > visible_px
    shown = np.bincount(traced.marking[usable], minlength=len(MARKINGS))
    seen = np.bincount(paint.marking[paint.widths > visible_px], minlength=len(MARKINGS))
    seen = np.minimum(seen, shown)
    long = shown >= MARKING_PLACES
    return float((seen[long] / shown[long]).min()) if long.any() else 1.0


def merge_ranked_cameras(
    frame: FrameToSearch, one: Sequence[RankedCamera], other: Sequence[RankedCamera]
) -> list[RankedCamera]:
    """Both lists in one, best first, each camera once."""
    kept: list[RankedCamera] = []
    shown: list[VisiblePaint] = []
    for item in sorted([*one, *other], key=lambda item: -item.score):
        height, width = item.snapped.size
        rows, columns = frame.field.shape
        camera = item.snapped.camera
        if (height, width) != (rows, columns):
            camera = camera.scaled(columns / width, rows / height)
        if not is_view_among(shown, camera, frame.picture):
            kept.append(item)
            shown.append(find_visible_paint(camera, frame.picture))
    return kept
