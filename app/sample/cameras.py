"""Cameras of a match: the main camera, its replays, how an operator aims them, what determines them, and what many trial
cameras would see.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from app.geometry.arrays import FloatArray
from app.geometry.camera import MIN_DEPTH, Camera, rotation_from_pan_tilt_roll
from app.sample.play import BALL_DIAMETER, HALF_LENGTH, HALF_WIDTH
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch

WIDTH, HEIGHT = 1280, 720
CENTER = np.array([(WIDTH - 1) / 2, (HEIGHT - 1) / 2])
CORNER_RADIUS = float(np.hypot(*CENTER))
PITCH = Pitch()


Mask = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True)
class MarkingPoints:
    """Points along every marking of the pitch, one after the other.

    Attributes:
        points: Pitch frame, metres, shape (N, 3).
        tangents: Unit direction of the marking at each point, shape (N, 3).
        starts: Where each marking of ``MARKINGS`` begins, shape (26,).
        ends: Where it ends (exclusive), shape (26,).
        marking: Number of the marking of each point, shape (N,).
        runs_along_x: Whether each marking is straight and parallel to x, shape (26,).
        runs_along_y: The same for y; the goals' parts count as neither.
    """

    points: FloatArray
    tangents: FloatArray
    starts: Indices
    ends: Indices
    marking: Indices
    runs_along_x: Mask
    runs_along_y: Mask


def sample_marking_points(spacing: float, fewest: int) -> MarkingPoints:
    """Sample the markings at most ``spacing`` metres apart, each at ``fewest`` points or more."""
    points, tangents, counts = [], [], []
    for marking in MARKINGS:
        dense = PITCH.sample(marking, 0.1, 0.1)
        # Circles bend, so their samples stand twice as close.
        wanted = spacing / (2 if marking in CIRCLES else 1)
        step = max(1, min(int(wanted / 0.1), (len(dense) - 1) // (fewest - 1)))
        keep = np.unique(np.append(np.arange(0, len(dense), step), len(dense) - 1))
        direction = np.gradient(dense, axis=0)[keep]
        points.append(dense[keep])
        tangents.append(direction / np.linalg.norm(direction, axis=1, keepdims=True))
        counts.append(len(keep))
    ends = np.cumsum(counts, dtype=np.int64)
    straight = [name not in CIRCLES and not name.startswith("Goal") for name in MARKINGS]
    first = [tangent[0] for tangent in tangents]
    return MarkingPoints(
        points=np.vstack(points),
        tangents=np.vstack(tangents),
        starts=ends - np.array(counts, dtype=np.int64),
        ends=ends,
        marking=np.repeat(np.arange(len(MARKINGS)), counts),
        runs_along_x=np.array(
            [s and abs(t[0]) > 0.99 for s, t in zip(straight, first, strict=True)]
        ),
        runs_along_y=np.array(
            [s and abs(t[1]) > 0.99 for s, t in zip(straight, first, strict=True)]
        ),
    )


COARSE = sample_marking_points(spacing=3.0, fewest=5)
FINE = sample_marking_points(spacing=0.6, fewest=9)


@dataclass(frozen=True)
class TrialCameras:
    """Trial cameras: position (N, 3), pan, tilt, roll in radians, focal length, k1, all (N,)."""

    position: FloatArray
    pan: FloatArray
    tilt: FloatArray
    roll: FloatArray
    focal: FloatArray
    k1: FloatArray

    @property
    def rotation(self) -> FloatArray:
        """Pitch to camera, shape (N, 3, 3); the same as ``rotation_from_pan_tilt_roll``."""
        cp, sp = np.cos(self.pan), np.sin(self.pan)
        ct, st = np.cos(self.tilt), np.sin(self.tilt)
        cr, sr = np.cos(self.roll), np.sin(self.roll)
        rows = [
            [cp * cr - sp * ct * sr, sp * cr + cp * ct * sr, st * sr],
            [-cp * sr - sp * ct * cr, -sp * sr + cp * ct * cr, st * cr],
            [sp * st, -cp * st, ct],
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def project_trials(trials: TrialCameras, points: FloatArray) -> FloatArray:
    """Pixels of every point under every trial camera, NaN where not visible, shape (N, M, 2).

    Args:
        points: Pitch frame, metres, shape (M, 3).
    """
    offset = points[None] - trials.position[:, None]
    # Sums of three products, written out: no BLAS, so the same bits on every machine.
    R = trials.rotation[:, None]
    x, y, z = (
        R[..., i, 0] * offset[..., 0]
        + R[..., i, 1] * offset[..., 1]
        + R[..., i, 2] * offset[..., 2]
        for i in range(3)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / z, y / z
        r2 = x * x + y * y
        k1 = trials.k1[:, None]
        visible = (z > MIN_DEPTH) & (3 * k1 * r2 > -1.0)
        scale = np.where(visible, trials.focal[:, None] * (1 + k1 * r2), np.nan)
    return np.stack([x * scale + CENTER[0], y * scale + CENTER[1]], axis=-1)


def is_inside_image(pixels: FloatArray, margin: float = 0.0) -> Mask:
    """Whether each pixel lies in the image, at least ``margin`` pixels from its border."""
    with np.errstate(invalid="ignore"):
        x, y = pixels[..., 0], pixels[..., 1]
        return (
            (x >= margin) & (x <= WIDTH - 1 - margin) & (y >= margin) & (y <= HEIGHT - 1 - margin)
        )


def count_seen_points(seen: Mask, skeleton: MarkingPoints) -> Indices:
    """How many points of each marking are seen, (..., N) booleans to (..., 26) counts."""
    return np.add.reduceat(seen.astype(np.int64), skeleton.starts, axis=-1)


CLICK_SIGMA = 1.0
DISTORTION_SIGMA = 12.0
"""Prior on the distortion: displacement at the corner, pixels."""
POINTS_PER_MARKING = 5


@dataclass(frozen=True)
class BallCertainty:
    """Standard deviations that follow from clicks with 1 px noise.

    ``ball_sigma_m``: of the ray to the ball, metres at the ball, its longest axis.
    ``size_sigma``: relative, of the ball's projected diameter.
    """

    ball_sigma_m: float
    size_sigma: float


def estimate_ball_certainty(camera: Camera, ball: FloatArray, seen: Mask) -> BallCertainty:
    """What a calibration from the visible markings would know about a ball.

    Args:
        ball: Pitch frame, metres, shape (3,).
        seen: Which points of ``COARSE`` are in view, shape (N,).
    """
    counts = np.maximum(count_seen_points(seen, COARSE), 1)
    index = np.flatnonzero(seen)
    # Annotators click a few points a marking, however many the skeleton has.
    weights = np.minimum(1.0, POINTS_PER_MARKING / counts[COARSE.marking[index]])
    x = camera.pitch_to_camera(np.vstack([COARSE.points[index], ball]))
    jacobian = _point_jacobian(camera, x)
    tangents = COARSE.tangents[index] @ camera.rotation.T
    normals = _project_normals(x[:-1], tangents)
    rows = normals[:, 0, None] * jacobian[:-1, 0] + normals[:, 1, None] * jacobian[:-1, 1]
    rows *= np.sqrt(weights)[:, None]
    information = np.einsum("ni,nj->ij", rows, rows) / CLICK_SIGMA**2
    # One unit of k1 moves a corner by f (r / f)^3 pixels.
    focal = camera.focal_length[0]
    information[7, 7] += (CORNER_RADIUS**3 / focal**2 / DISTORTION_SIGMA) ** 2
    # Priors so weak that they only keep the inverse finite.
    information[np.arange(8), np.arange(8)] += 1e-9
    covariance = np.linalg.inv(information)
    of_ball = jacobian[-1]
    spread = of_ball @ covariance @ of_ball.T
    sigma = float(np.sqrt(max(float(np.linalg.eigvalsh(spread)[-1]), 0.0)))
    size = _ball_size_gradient(camera, x[-1])
    size_sigma = float(np.sqrt(max(float(size @ covariance @ size), 0.0)))
    return BallCertainty(sigma * float(x[-1, 2]) / focal, size_sigma)


def _project_normals(x: FloatArray, tangents: FloatArray) -> FloatArray:
    """Unit normals of projected markings; points and tangents in the camera frame, (N, 3)."""
    depth = x[:, 2]
    along_u = tangents[:, 0] - tangents[:, 2] * x[:, 0] / depth
    along_v = tangents[:, 1] - tangents[:, 2] * x[:, 1] / depth
    length = np.maximum(np.hypot(along_u, along_v), 1e-12)
    return np.column_stack([-along_v / length, along_u / length])


def _point_jacobian(camera: Camera, x: FloatArray) -> FloatArray:
    """Derivative of pixels by (rotation, position, log focal length, k1), shape (N, 2, 8).

    The bend of distortion is left out: it changes these derivatives by a few per cent.

    Args:
        x: Camera frame, metres, shape (N, 3).
    """
    focal = camera.focal_length[0]
    depth = x[:, 2]
    a, b = x[:, 0] / depth, x[:, 1] / depth
    r2 = a * a + b * b
    jacobian = np.empty((len(x), 2, 8))
    R = camera.rotation
    # A turn w moves X by w x X; a step of the camera moves it by -R dC.
    jacobian[:, 0, 0], jacobian[:, 0, 1], jacobian[:, 0, 2] = -a * b, 1 + a * a, -b
    jacobian[:, 1, 0], jacobian[:, 1, 1], jacobian[:, 1, 2] = -1 - b * b, a * b, a
    jacobian[:, 0, 3:6] = (np.outer(a, R[2]) - R[0]) / depth[:, None]
    jacobian[:, 1, 3:6] = (np.outer(b, R[2]) - R[1]) / depth[:, None]
    jacobian[:, 0, 6], jacobian[:, 1, 6] = a, b
    jacobian[:, 0, 7], jacobian[:, 1, 7] = a * r2, b * r2
    jacobian *= focal
    return jacobian


def _ball_size_gradient(camera: Camera, ball: FloatArray) -> FloatArray:
    """Derivative of log(focal / depth), shape (8,); the ball in the camera frame, (3,)."""
    x, y, depth = ball
    turn = np.array([-y, x, 0.0]) / depth
    move = camera.rotation[2] / depth
    return np.concatenate([turn, move, [1.0, 0.0]])


TRIALS = 8
ROUNDS = 5
MAIN_FOCAL = (1200.0, 6100.0)
REPLAY_FOCAL = (900.0, 6100.0)
MAIN_TILT = (np.radians(65.2), np.radians(83.8))
SMALLEST_BALL, LARGEST_BALL = 5.4, 58.0
FEWEST_MARKINGS = 6
LONGEST_STEP_PX = 880.0
"""Between samples of a marking, about 3 m apart, that are in view."""
RIM = 7.0
"""Metres around the pitch that a frame may begin with."""
MIN_PARALLAX = np.radians(9.0)
REPLAYS = (
    "opposite",
    "behind_high",
    "behind_low",
    "touchline",
    "sixteen",
    "behind_stand",
)
REPLAY_SHARE = (0.18, 0.24, 0.15, 0.15, 0.16, 0.12)


@dataclass(frozen=True)
class CameraPositions:
    """Where the cameras of one match stand.

    Attributes:
        main: Position of the main camera, metres, shape (3,).
        seats: Positions of replay cameras by kind; ends and sides come in pairs.
    """

    main: FloatArray
    seats: dict[str, tuple[FloatArray, ...]]


def place_cameras(rng: np.random.Generator) -> CameraPositions:
    """Cameras as broadcasters place them."""
    y = rng.uniform(46.0, 90.0)
    height = np.clip(9.5 + 0.24 * (y - 41.0) + rng.normal(0, 2.0), 9.3, 24.7)
    main = np.array([np.clip(rng.normal(0, 3.0), -9.5, 10.5), y, -height])
    beside = np.array([rng.uniform(33, 39), main[1] + rng.normal(0, 2), main[2]])
    ends = (1.0, -1.0)
    seats = {
        "opposite": (np.array([rng.uniform(-14, 14), -rng.uniform(46, 72), -rng.uniform(8, 19)]),),
        "behind_high": tuple(
            np.array([end * rng.uniform(64, 82), rng.uniform(-6, 6), -rng.uniform(8, 17)])
            for end in ends
        ),
        "behind_low": tuple(
            np.array([end * rng.uniform(57, 60), rng.choice([-1, 1]) * rng.uniform(5, 12), -rng.uniform(1.7, 3.6)])
            for end in ends
        ),
        "touchline": tuple(
            np.array([end * rng.uniform(14, 44), rng.uniform(36.4, 37.8), -rng.uniform(1.5, 2.4)])
            for end in ends
        ),
        "sixteen": tuple(np.array([end, 1.0, 1.0]) * beside for end in ends),
        "behind_stand": tuple(
            np.array([end * rng.uniform(84, 104), rng.uniform(-20, 20), -rng.uniform(19, 29)])
            for end in ends
        ),
    }  # fmt: skip
    return CameraPositions(main, seats)


def choose_replay_position(
    rng: np.random.Generator, rig: CameraPositions, ball: FloatArray
) -> tuple[str, FloatArray]:
    """A replay camera, most often one at the ball's end; where it stands, metres, shape (3,)."""
    kind = str(rng.choice(REPLAYS, p=REPLAY_SHARE))
    seats = rig.seats[kind]
    near = 0 if ball[0] > 0 else -1
    far_end = kind in ("behind_high", "behind_stand") and rng.random() < 0.15
    seat = seats[(-1 - near) if far_end else near]
    return kind, seat + rng.normal(0, 0.25, 3) * (1, 1, 0.3)


def parallax_angle_at_ball(a: FloatArray, b: FloatArray, ball: FloatArray) -> float:
    """Angle between the rays from two positions to the ball, radians."""
    u, v = a - ball, b - ball
    return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def find_camera(
    rng: np.random.Generator, position: FloatArray, ball: FloatArray, is_main: bool
) -> Camera | None:
    """A camera at that position from which ball and enough markings are in view.

    Args:
        position: Pitch frame, metres, shape (3,).
        ball: Pitch frame, metres, shape (3,).
        is_main: Keep to the tilts and focal lengths of main cameras.

    Returns:
        None when no trial was good enough: the ball would be too small, or too little of the
        pitch would determine the camera.
    """
    for attempt in range(ROUNDS):
        trials = _draw_trial_cameras(rng, position, ball, is_main, zoom=1.0 - 0.2 * attempt)
        if trials is None:
            return None
        pixels = project_trials(trials, COARSE.points)
        seen = is_inside_image(pixels, 4.0)
        good = _find_acceptable_trials(trials, ball, seen, is_main) & ~_has_too_close_marking(
            pixels, seen
        )
        for index in np.flatnonzero(good):
            camera = _make_camera_of_trial(trials, int(index))
            if _is_good_certainty(estimate_ball_certainty(camera, ball, seen[index])):
                return camera
    return None


def _is_good_certainty(known: BallCertainty) -> bool:
    return known.ball_sigma_m < 0.06 and known.size_sigma < 0.04


def _draw_trial_cameras(
    rng: np.random.Generator, position: FloatArray, ball: FloatArray, is_main: bool, zoom: float
) -> TrialCameras | None:
    toward = ball - position
    distance = float(np.linalg.norm(toward))
    low, high = MAIN_FOCAL if is_main else REPLAY_FOCAL
    low = max(low, SMALLEST_BALL * distance / BALL_DIAMETER)
    high = min(high, LARGEST_BALL * distance / BALL_DIAMETER, low * (1.0 + 2.2 * zoom))
    if low >= high:
        return None
    focal = np.exp(rng.uniform(np.log(low), np.log(high), TRIALS))
    # The ball stands anywhere but at the border, rather towards the middle.
    u = np.clip(rng.normal(0, 0.24, TRIALS), -0.42, 0.42) * WIDTH
    v = np.clip(rng.normal(0.02, 0.17, TRIALS), -0.38, 0.40) * HEIGHT
    corner = rng.uniform(5.0, 25.0, TRIALS)
    return TrialCameras(
        position=np.broadcast_to(position, (TRIALS, 3)),
        pan=np.arctan2(toward[0], -toward[1]) - np.arctan2(u, focal),
        tilt=np.arccos(toward[2] / distance) + np.arctan2(v, focal),
        roll=np.radians(np.clip(rng.normal(0, 0.4, TRIALS), -0.99, 0.99)),
        focal=focal,
        k1=corner * focal**2 / CORNER_RADIUS**3,
    )


def _find_acceptable_trials(
    trials: TrialCameras, ball: FloatArray, seen: Mask, is_main: bool
) -> Mask:
    counts = count_seen_points(seen, COARSE)
    markings = counts >= 3
    straight_x = markings[:, COARSE.runs_along_x].sum(axis=1)
    straight_y = markings[:, COARSE.runs_along_y].sum(axis=1)
    good: Mask = (markings.sum(axis=1) >= FEWEST_MARKINGS) & (straight_x >= 1) & (straight_y >= 1)
    # Scraps at the border are easily overlooked, and would count against the annotation.
    good &= (counts == 1).sum(axis=1) <= 1
    good &= is_inside_image(project_trials(trials, ball[None])[:, 0], 30.0)
    good &= _shows_pitch_at_bottom(trials)
    if is_main:
        good &= (trials.tilt >= MAIN_TILT[0]) & (trials.tilt <= MAIN_TILT[1])
    return good


def _shows_pitch_at_bottom(trials: TrialCameras) -> Mask:
    """Whether the bottom of the image shows the pitch or its rim, not the own stand, (N,)."""
    rotation = trials.rotation
    ray = rotation[:, 2] + rotation[:, 1] * (CENTER[1] / trials.focal)[:, None]
    # The camera is above the grass and looks down, so the ray meets it.
    reach = -trials.position[:, 2] / np.maximum(ray[:, 2], 1e-6)
    x, y = (trials.position[:, i] + reach * ray[:, i] for i in (0, 1))
    pitch: Mask = (np.abs(x) < HALF_LENGTH + RIM) & (np.abs(y) < HALF_WIDTH + RIM)
    return pitch


def _has_too_close_marking(pixels: FloatArray, seen: Mask) -> Mask:
    """Whether a marking passes so near the camera that its samples stand far apart, shape (N,).

    Scorers join samples of a marking by straight lines, which miss a bent image there.
    """
    together = COARSE.marking[1:] == COARSE.marking[:-1]
    shown = together & (seen[:, 1:] | seen[:, :-1])
    with np.errstate(invalid="ignore"):
        long = (np.abs(pixels[:, 1:] - pixels[:, :-1]) > LONGEST_STEP_PX).any(axis=2)
    close: Mask = (shown & long).any(axis=1)
    return close


def _make_camera_of_trial(trials: TrialCameras, index: int) -> Camera:
    distortion = np.zeros(12)
    distortion[0] = trials.k1[index]
    focal = float(trials.focal[index])
    return Camera(
        rotation=rotation_from_pan_tilt_roll(
            trials.pan[index], trials.tilt[index], trials.roll[index]
        ),
        position=trials.position[index],
        focal_length=(focal, focal),
        principal_point=(float(CENTER[0]), float(CENTER[1])),
        distortion=distortion,
    )
