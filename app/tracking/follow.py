"""Follow: from the camera of one frame to that of the next.

The background says how the camera turned, the paint where it then looks. A camera on which the
paint does not agree is none: the frame is bridged by the background alone for a while, and after
that the camera is lost until a frame is proposed again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from app.errors import GeometryError
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    KAPPA,
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    TILT,
    X,
    Z,
    parameters_from_camera,
    projection_jacobians,
)
from app.paint.agreement import PaintAgreement, agreement
from app.paint.propose import propose, weakest_marking
from app.paint.snap import Snapped, snap_reading
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.motion import BackgroundMatches, rotate_camera
from app.tracking.picture import Picture

Outcome = Literal["tracked", "bridged", "lost"]
TRACKED: Outcome = "tracked"
BRIDGED: Outcome = "bridged"
LOST: Outcome = "lost"
OUTCOMES = (TRACKED, BRIDGED, LOST)

WINDOWS = (6.0, 4.0, 3.0, 3.0)
"""Pixels at 960 wide, round by round: the background leaves little to seek."""
FLOW_PX, SAID_ONCE = 0.8, 4.0
"""Standard deviation of where the background lays the grass, and of how many such places it tells."""
GRID = (6, 4)
MOVE_SIGMA_M, ANGLE_SIGMA, ROLL_SIGMA = 0.10, np.radians(4.0), np.radians(0.15)
"""By which a camera changes from frame to frame beside what the background says."""
FOCAL_SIGMA, KAPPA_SIGMA = 0.05, 0.001
LEAST_SUPPORTED, LEAST_OF_USUAL, LEAST_WEAKEST = 0.30, 0.6, 0.15
"""A camera has this share of its markings on paint, of what frames before had, and of each marking."""
MOST_ERROR_PX, MOST_MOVED_PX = 0.6, 3.0
"""Median distance of paint from its marking, and of the markings from where the background laid them."""
MOST_BRIDGED = 20
"""Frames in a row that the background alone may carry a camera."""
USUAL_SHARE = 0.1
PROPOSED_AFTER, PROPOSED_EVERY = 3, 5
"""Frames without paint from which on a camera is proposed, and between two tries."""


@dataclass(frozen=True)
class TrackedFrame:
    """What is known of the camera of a frame.

    Attributes:
        number, time: Of the frame; seconds.
        outcome: ``tracked``: it lies on the paint; ``bridged``: between frames that do, by the
            background; ``lost``: there is none.
        camera: Pixels of the work size.
        snapped: How it lies on the paint, where it does.
        seen: Agreement with all paint.
        is_key: Whether it was given, or proposed from nothing.
        age: Frames since one that lies on the paint.
        reason: Why it is not tracked.
    """

    number: int
    time: float
    outcome: Outcome
    camera: Camera | None = None
    snapped: Snapped | None = None
    seen: PaintAgreement | None = None
    is_key: bool = False
    age: int = 0
    reason: str | None = None


@dataclass
class Follower:
    """Carries a camera from frame to frame, in either direction.

    Attributes:
        pitch: The pitch.
        policy: Prior of the distortion.
        known: Cameras of the clip, for what is proposed.
        last: The frame before; None at the start.
        usual: Share of the markings with paint in the frames so far.
    """

    pitch: Pitch
    policy: CalibrationPolicy
    known: list[Camera] = field(default_factory=list)
    last: TrackedFrame | None = None
    usual: float = 0.0
    tried: int | None = None

    def start(
        self, picture: Picture, camera: Camera, covariance: FloatArray | None
    ) -> TrackedFrame:
        """The frame of a frame whose camera is given: drawn onto the paint where that agrees."""
        snapped = self._snap(picture, camera, covariance, (10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 3.0))
        seen = agreement(snapped.camera, picture.field, picture.paint, self.pitch)
        found = TrackedFrame(
            picture.number, picture.time, TRACKED, snapped.camera, snapped, seen, is_key=True
        )  # fmt: skip
        if snapped.reason is not None:
            found = replace(found, outcome=BRIDGED, snapped=None, reason=snapped.reason)
        return self._now(found)

    def step(
        self, picture: Picture, match: BackgroundMatches | None, may_propose: bool = True
    ) -> TrackedFrame:
        """The frame of the next frame.

        Args:
            picture: The frame.
            match: From the frame before; None where nothing moves together.
            may_propose: Whether a camera is proposed where none can be followed.
        """
        found = self._followed(picture, match)
        if found.outcome is TRACKED:
            return self._now(found)
        if may_propose and (found.outcome is LOST or found.age >= PROPOSED_AFTER):
            again = self.propose(picture)
            if again is not None:
                return self._now(again)
        return self._now(found)

    def propose(self, picture: Picture) -> TrackedFrame | None:
        """A frame whose camera the paint alone says; None where it does not, or was asked lately."""
        if self.tried is not None and abs(picture.number - self.tried) < PROPOSED_EVERY:
            return None
        self.tried = picture.number
        try:
            found = propose(picture.image, self.pitch, self.known[-1:], self.policy)
        except (GeometryError, np.linalg.LinAlgError):
            return None
        if found.outcome != "proposed" or found.camera is None or found.snapped is None:
            return None
        return TrackedFrame(
            picture.number, picture.time, TRACKED, found.camera, found.snapped, found.agreement,
            is_key=True,
        )  # fmt: skip

    def _followed(self, picture: Picture, match: BackgroundMatches | None) -> TrackedFrame:
        last = self.last
        nothing = TrackedFrame(picture.number, picture.time, LOST)
        if last is None or last.camera is None:
            return replace(nothing, reason="there is no camera to follow")
        if match is None:
            return replace(nothing, reason="the background cannot be followed: a cut, or a blur")
        half = picture.reading.half_diagonal
        camera, _ = rotate_camera(last.camera, match, half)
        unit = max(picture.reading.width / 960, 0.6)
        known = predicted_covariance(picture, camera, FLOW_PX * unit, 1 + last.age)
        age = last.age + 1
        predicted = replace(nothing, outcome=BRIDGED, camera=camera, age=age)
        try:
            snapped = self._snap(picture, camera, known, WINDOWS)
            seen = agreement(snapped.camera, picture.field, picture.paint, self.pitch)
        except (GeometryError, np.linalg.LinAlgError):
            return replace(nothing, reason="the paint cannot be solved")
        predicted = replace(predicted, seen=seen)
        why = self._why_not(picture, snapped, seen, unit, age)
        if why is None:
            return TrackedFrame(
                picture.number, picture.time, TRACKED, snapped.camera, snapped, seen
            )
        if age > MOST_BRIDGED:
            return replace(nothing, seen=seen, reason=why)
        return replace(predicted, reason=why)

    def _why_not(
        self, picture: Picture, snapped: Snapped, seen: PaintAgreement, unit: float, age: int
    ) -> str | None:
        if snapped.reason is not None:
            return snapped.reason
        if snapped.error_px is None or snapped.error_px > MOST_ERROR_PX * unit:
            return "the paint lies beside the markings"
        if snapped.moved_px > MOST_MOVED_PX * unit * np.sqrt(age):
            return "the paint lies elsewhere than the background says"
        if seen.supported < max(LEAST_SUPPORTED, LEAST_OF_USUAL * self.usual):
            return "much of the markings has no paint"
        if weakest_marking(picture.reading, snapped, self.pitch) < LEAST_WEAKEST:
            return "a marking that would be seen has no paint"
        return None

    def _snap(
        self, picture: Picture, camera: Camera, known: FloatArray | None, windows: Sequence[float]
    ) -> Snapped:
        return snap_reading(
            picture.reading, camera, self.pitch, windows, self.policy, known,
            circles_count_twice=True, position_is_known=known is not None, most_surprising=np.inf,
        )  # fmt: skip

    def _now(self, found: TrackedFrame) -> TrackedFrame:
        self.last = found
        if found.outcome is TRACKED and found.seen is not None and found.camera is not None:
            share = found.seen.supported
            self.usual = (
                share if not self.usual else self.usual + USUAL_SHARE * (share - self.usual)
            )
            self.known = [*self.known[:1], found.camera]
            self.tried = None
        return found


def predicted_covariance(
    picture: Picture, camera: Camera, flow_px: float, frames: float
) -> FloatArray:
    """How well a camera is known that the background turned, shape (8, 8).

    The grass in the picture lies where it should to the flow's accuracy; where the camera stands
    may have changed a little, and then it looks elsewhere for it.

    Args:
        camera: As predicted.
        flow_px: Standard deviation of a place, pixels.
        frames: How many frames the prediction spans.
    """
    half = picture.reading.half_diagonal
    height, width = picture.field.shape
    columns, rows = np.meshgrid(*(np.linspace(0.1, 0.9, n) for n in GRID))
    pixels = np.column_stack([columns.ravel() * width, rows.ravel() * height])
    ground = camera.on_ground(pixels)
    ground = ground[np.isfinite(ground).all(axis=1) & (np.hypot(*np.nan_to_num(ground).T) < 150)]
    sigma = np.empty(PARAMETERS)
    sigma[[PAN, TILT]], sigma[ROLL] = ANGLE_SIGMA, ROLL_SIGMA * np.sqrt(frames)
    sigma[X : Z + 1] = MOVE_SIGMA_M * np.sqrt(frames)
    sigma[LOG_FOCAL], sigma[KAPPA] = FOCAL_SIGMA, KAPPA_SIGMA * np.sqrt(frames)
    information = np.diag(sigma**-2.0)
    if len(ground):
        points = np.column_stack([ground, np.zeros(len(ground))])
        parameters = np.tile(parameters_from_camera(camera, half), (len(points), 1))
        slopes = projection_jacobians(parameters, points, np.full(len(points), half))
        slopes = slopes.reshape(-1, PARAMETERS)
        share = SAID_ONCE / len(ground) / (flow_px**2 * frames)
        information = information + share * slopes.T @ slopes
    scale = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))
