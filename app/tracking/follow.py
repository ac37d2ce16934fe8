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
from app.paint.agreement import PaintAgreement, measure_agreement
from app.paint.candidates import MAIN, WIDE, CameraSearchSpace
from app.paint.ranking import measure_weakest_marking
from app.paint.snap import SnappedCamera, snap_to_prepared_picture
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.missing_marking import propose_missing_marking_cameras
from app.tracking.motion import BackgroundMatches, apply_background_motion
from app.tracking.picture import FramePicture, propose_camera_in_picture

Outcome = Literal["tracked", "bridged", "lost"]
TRACKED: Outcome = "tracked"
BRIDGED: Outcome = "bridged"
LOST: Outcome = "lost"
OUTCOMES = (TRACKED, BRIDGED, LOST)
NO_CAMERA = "there is no camera to follow"
UNSOLVED = "the paint cannot be solved"
MISSING = "a marking that would be seen has no paint"

GRID = (6, 4)
ANGLE_SIGMA = np.radians(4.0)
"""By which a camera changes from frame to frame beside what the background says."""
FOCAL_SIGMA, KAPPA_SIGMA = 0.05, 0.001
LEAST_SUPPORTED, LEAST_OF_USUAL, LEAST_WEAKEST = 0.30, 0.6, 0.25
"""A camera has this share of its markings on paint, of what frames before had, and of each marking."""
MOST_ERROR_PX = 0.6
PATCHY_WEAKEST, PATCHY_OF_USUAL, PATCHY_PX, RATHER = 0.5, 0.9, 0.3, 1.1
"""Where less has paint another camera is looked for, and how much better that has to agree."""
AGAIN_AFTER = 4
"""Frames after which it is sought once more farther off where that was in vain."""
MOST_MOVED_ANEW_PX = 12.0
"""How far a camera through a marking that was missing may move what was seen, in the median, at 960 wide."""
SAID_ONCE = 4.0
"""How many places on the grass the background tells."""
MOST_BRIDGED = 20
"""Frames in a row that the background alone may carry a camera."""
USUAL_DECAY = 0.995
LIKELY, LIKELY_WEAKEST, MOST_UNSURE = 0.65, 0.25, 12
"""Support of a camera that is likely, also by its weakest marking, and how many of these are kept."""
EVERYWHERE = (1, 3, 7, 15, 31)
"""Searches in vain after which all libraries are searched."""
SAME_VIEW, SAME_VIEW_FRAMES = 0.05, 24
"""Share of a picture by which it has to move until a search that was in vain is worth another, or so many frames."""
PROPOSED_AFTER, PROPOSED_EVERY, PATCHY_EVERY, PATCHY_LEAST_OFTEN, CLEARLY = 3, 5, 12, 48, 1.1
"""Frames without paint from which on a camera is proposed, between two tries, and between two where the camera has
paint, but less than usual: ever more of them while that is in vain, and another has to agree clearly better."""


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
        covariance: Of the camera's parameters (``geometry.resection``), shape (8, 8).
        error_px: Median distance of the paint from its markings, pixels.
        weakest: Lowest share of a marking that has paint.
    """

    number: int
    time: float
    outcome: Outcome
    camera: Camera | None = None
    snapped: SnappedCamera | None = None
    seen: PaintAgreement | None = None
    is_key: bool = False
    age: int = 0
    reason: str | None = None
    covariance: FloatArray | None = None
    error_px: float | None = None
    weakest: float = 1.0

    @property
    def score(self) -> float:
        """How well its camera agrees with the paint, and its weakest marking with it, 0 to 1."""
        return 0.0 if self.seen is None else self.seen.combined_score * min(1.0, 0.5 + self.weakest)


@dataclass(frozen=True)
class PaintSearchReach:
    """How far from a predicted camera paint is sought.

    Attributes:
        windows: To either side, round by round, pixels at 960 wide.
        flow_px: Standard deviation of where the background lays the grass, likewise.
        move_sigma_m: Of the position from frame to frame, metres.
        roll_sigma: Of the roll from frame to frame, radians.
        most_moved_px: How far the markings may move in the median, pixels at 960 wide.
    """

    windows: tuple[float, ...]
    flow_px: float
    move_sigma_m: float
    roll_sigma: float
    most_moved_px: float


REACHES = (
    PaintSearchReach((6.0, 4.0, 3.0, 3.0), 0.6, 0.07, np.radians(0.02), 3.0),
    PaintSearchReach((14.0, 10.0, 7.0, 5.0, 4.0, 3.0, 3.0), 4.0, 1.0, np.radians(0.03), 10.0),
)


@dataclass(frozen=True)
class LikelyCamera:
    """A camera that a frame may have, and how well it agrees with the paint, 0 to 1."""

    picture: FramePicture
    camera: Camera
    score: float


@dataclass
class CameraFollower:
    """Carries a camera from frame to frame, in either direction.

    Attributes:
        pitch: The pitch.
        policy: Prior of the distortion.
        known: Cameras of the clip, for what is proposed.
        last: The frame before; None at the start.
        usual: Share of the markings with paint in the frames so far.
        tried: Frame in which a camera was proposed last, in vain.
        unsure: Frames with a camera that is likely and not certain.
        patchy_every: Frames between two tries to propose another camera for one that has paint.
        sought: Frame in which paint was sought farther off in vain.
        missed: Frame in which no line was found for a marking without paint.
        in_vain: How often a camera was proposed in vain since one was found, or since a cut.
        turned_since: Share of the picture by which it has moved since.
    """

    pitch: Pitch
    policy: CalibrationPolicy
    known: list[Camera] = field(default_factory=list)
    last: TrackedFrame | None = None
    usual: float = 0.0
    tried: int | None = None
    unsure: list[LikelyCamera] = field(default_factory=list)
    patchy_every: int = PATCHY_EVERY
    sought: int | None = None
    missed: int | None = None
    in_vain: int = 0
    turned_since: float = 0.0

    def start(
        self, picture: FramePicture, camera: Camera, covariance: FloatArray | None
    ) -> TrackedFrame:
        """The frame of a frame whose camera is given: drawn onto the paint where that agrees."""
        try:
            snapped = self._snap_camera(
                picture, camera, covariance, (10.0, 8.0, 6.0, 5.0, 4.0, 3.0, 3.0)
            )
            seen = measure_agreement(snapped.camera, picture.field, picture.paint, self.pitch)
        except (GeometryError, np.linalg.LinAlgError):
            alone = TrackedFrame(
                picture.number, picture.time, BRIDGED, camera, is_key=True, reason=UNSOLVED
            )
            return self._remember_frame(replace(alone, covariance=covariance))
        found = TrackedFrame(
            picture.number, picture.time, TRACKED, snapped.camera, snapped, seen, is_key=True
        )  # fmt: skip
        if snapped.reason is not None:
            reason = snapped.reason
            found = replace(found, outcome=BRIDGED, camera=camera, snapped=None, reason=reason)
            found = replace(found, covariance=covariance)
        return self._remember_frame(found)

    def step(self, picture: FramePicture, match: BackgroundMatches | None) -> TrackedFrame:
        """The frame of the next frame.

        Args:
            picture: The frame.
            match: From the frame before; None where nothing moves together.
        """
        found = self._follow_background(picture, match)
        if match is None:
            # What is shown now is another picture than the one that was tried.
            self.tried, self.patchy_every, self.in_vain = None, PATCHY_EVERY, 0
        else:
            self.turned_since += _compute_motion_fraction(match, picture.image.shape[1])
        if found.outcome is TRACKED and found.seen is not None:
            return self._remember_frame(
                self._prefer_proposed_camera(picture, found)
                if self._has_weak_paint(found)
                else found
            )
        if found.outcome is LOST or found.age >= PROPOSED_AFTER:
            again = self.propose_camera_from_paint_alone(picture)
            if again is not None:
                return self._remember_frame(again)
        return self._remember_frame(found)

    def _prefer_proposed_camera(self, picture: FramePicture, found: TrackedFrame) -> TrackedFrame:
        """The frame with the camera that the paint alone says where that agrees clearly better."""
        if self._was_recently_proposed(picture, self.patchy_every):
            return found
        again = self.propose_camera_from_paint_alone(picture, self.patchy_every)
        if again is not None and _agreement_product(again) > CLEARLY * _agreement_product(found):
            self.patchy_every = PATCHY_EVERY
            return again
        self.patchy_every = min(2 * self.patchy_every, PATCHY_LEAST_OFTEN)
        return found

    def propose_camera_from_paint_alone(
        self, picture: FramePicture, every: int = PROPOSED_EVERY
    ) -> TrackedFrame | None:
        """A frame whose camera the paint alone says; None where it does not, or was asked lately."""
        if self._was_recently_proposed(picture, every):
            return None
        self.tried, self.turned_since = picture.number, 0.0
        libraries = self._choose_search_spaces()
        self.in_vain += 1
        try:
            found = propose_camera_in_picture(
                picture, self.pitch, self.known[-1:], self.policy, libraries
            )
        except (GeometryError, np.linalg.LinAlgError):
            return None
        if found.camera is None or found.snapped is None or found.agreement is None:
            return None
        if found.outcome != "proposed":
            is_likely = (
                found.agreement.supported >= LIKELY and (found.weakest or 0) >= LIKELY_WEAKEST
            )
            if is_likely and not self.known and len(self.unsure) < MOST_UNSURE:
                self.unsure.append(
                    LikelyCamera(picture, found.camera, found.agreement.combined_score)
                )
            return None
        # One that was found is no reason to wait until the view is another one.
        self.in_vain, self.turned_since = 0, np.inf
        return TrackedFrame(
            picture.number, picture.time, TRACKED, found.camera, found.snapped, found.agreement,
            is_key=True,
        )  # fmt: skip

    def _choose_search_spaces(self) -> tuple[CameraSearchSpace, ...]:
        """Where a camera is sought besides the positions that are known: a tripod stays where it is.

        The farther off, the more seldom: to look everywhere costs ten times what a frame may.
        """
        if self.in_vain in EVERYWHERE:
            return (MAIN, WIDE)
        return () if self.known else (MAIN,)

    def _was_recently_proposed(self, picture: FramePicture, every: int) -> bool:
        """Whether a camera was proposed, in vain, in one of so many frames before, or of this view."""
        if self.tried is None:
            return False
        ago = abs(picture.number - self.tried)
        return ago < every or (ago < SAME_VIEW_FRAMES and self.turned_since < SAME_VIEW)

    def _follow_background(
        self, picture: FramePicture, match: BackgroundMatches | None
    ) -> TrackedFrame:
        last = self.last
        nothing = TrackedFrame(picture.number, picture.time, LOST)
        if last is None or last.camera is None:
            return replace(nothing, reason=NO_CAMERA)
        if match is None:
            return replace(nothing, reason="the background cannot be followed: a cut, or a blur")
        half = picture.reading.half_diagonal
        try:
            camera, _ = apply_background_motion(last.camera, match, half)
        except (GeometryError, np.linalg.LinAlgError):
            return replace(nothing, reason="the background cannot be followed")
        unit = max(picture.reading.width / 960, 0.6)
        age = last.age + 1
        predicted = replace(nothing, outcome=BRIDGED, camera=camera, age=age)
        found, why = self._snap_predicted_camera(picture, camera, predicted, unit)
        if found is None:
            return replace(nothing, reason=why)
        if why is None:
            return found
        if age > MOST_BRIDGED:
            return replace(nothing, seen=found.seen, reason=why)
        return replace(predicted, seen=found.seen, reason=why)

    def _snap_predicted_camera(
        self, picture: FramePicture, camera: Camera, predicted: TrackedFrame, unit: float
    ) -> tuple[TrackedFrame | None, str | None]:
        """The predicted camera drawn onto the paint, and why that does not hold.

        Where it does not, or some marking has little paint, paint is sought once more, farther
        off: a camera may have kept to paint that it met by chance.
        """
        best: TrackedFrame | None = None
        best_score, best_why = -1.0, UNSOLVED
        told: str | None = best_why
        for reach in REACHES:
            known = predicted_covariance(picture, camera, reach, unit, 1 + self.frames_since_paint)
            try:
                snapped = self._snap_camera(picture, camera, known, reach.windows)
                seen = measure_agreement(snapped.camera, picture.field, picture.paint, self.pitch)
            except (GeometryError, np.linalg.LinAlgError):
                continue
            weakest = 0.0
            if snapped.reason is None:
                weakest = measure_weakest_marking(picture.reading, snapped, self.pitch)
            most = reach.most_moved_px * unit * float(np.sqrt(1 + self.frames_since_paint))
            why = self._explain_rejection(snapped, seen, weakest, unit, most)
            outcome = TRACKED if why is None else BRIDGED
            found = replace(
                predicted, outcome=outcome, camera=snapped.camera, snapped=snapped, seen=seen,
                age=0, weakest=weakest,
            )  # fmt: skip
            score = found.score * (1.0 if why is None else 0.5)
            if best is not None and told is None:
                self.sought = None if score > best_score * RATHER else picture.number
            if score > best_score * (1.0 if best is None else RATHER):
                best_score, told, best = score, why, found
            if told is None and not self._needs_wider_search(best, picture):
                break
        if told == MISSING and best is not None and best.snapped is not None:
            moved = self._snap_through_missing_marking(picture, best, best.snapped, unit)
            if moved is not None:
                return moved, None
        return best, told

    def _snap_through_missing_marking(
        self, picture: FramePicture, best: TrackedFrame, snapped: SnappedCamera, unit: float
    ) -> TrackedFrame | None:
        """The frame with a camera on whose paint the missing marking is as well; None where there is none."""
        if self.missed is not None and abs(picture.number - self.missed) < AGAIN_AFTER:
            return None
        self.missed = picture.number
        for camera in propose_missing_marking_cameras(picture, snapped, self.pitch, self.policy):
            try:
                found = self._snap_camera(picture, camera, None, REACHES[1].windows)
                seen = measure_agreement(found.camera, picture.field, picture.paint, self.pitch)
            except (GeometryError, np.linalg.LinAlgError):
                continue
            if (
                found.reason is not None
                or _measure_median_shift_px(snapped, found) > MOST_MOVED_ANEW_PX * unit
            ):
                continue
            weakest = measure_weakest_marking(picture.reading, found, self.pitch)
            frame = replace(
                best,
                outcome=TRACKED,
                camera=found.camera,
                snapped=found,
                seen=seen,
                weakest=weakest,
            )
            if self._explain_rejection(found, seen, weakest, unit, np.inf) is None and (
                frame.score > CLEARLY * best.score
            ):
                self.missed = None
                return frame
        return None

    def _needs_wider_search(self, found: TrackedFrame | None, picture: FramePicture) -> bool:
        """Whether paint is sought farther off for a camera that has paint."""
        if self.sought is not None and abs(picture.number - self.sought) < AGAIN_AFTER:
            return False
        return self._has_weak_paint(found)

    def _has_weak_paint(self, found: TrackedFrame | None) -> bool:
        """Whether a camera has less paint, or worse, than one that is right would have."""
        if found is None or found.seen is None or found.snapped is None:
            return True
        unit = max(found.snapped.size[1] / 960, 0.6)
        return (
            found.weakest < PATCHY_WEAKEST
            or found.seen.supported < PATCHY_OF_USUAL * self.usual
            or (found.snapped.error_px or 0.0) > PATCHY_PX * unit
        )

    def has_camera(self) -> bool:
        """Whether there is a camera to follow."""
        return self.last is not None and self.last.camera is not None

    @property
    def frames_since_paint(self) -> int:
        """Frames since one that lies on the paint."""
        return 0 if self.last is None else self.last.age

    def _explain_rejection(
        self,
        snapped: SnappedCamera,
        seen: PaintAgreement,
        weakest: float,
        unit: float,
        most_moved_px: float,
    ) -> str | None:
        if snapped.reason is not None:
            return snapped.reason
        if snapped.error_px is None or snapped.error_px > MOST_ERROR_PX * unit:
            return "the paint lies beside the markings"
        if snapped.moved_px > most_moved_px:
            return "the paint lies elsewhere than the background says"
        if seen.supported < max(LEAST_SUPPORTED, LEAST_OF_USUAL * self.usual):
            return "much of the markings has no paint"
        if weakest < LEAST_WEAKEST:
            return MISSING
        return None

    def _snap_camera(
        self,
        picture: FramePicture,
        camera: Camera,
        known: FloatArray | None,
        windows: Sequence[float],
    ) -> SnappedCamera:
        return snap_to_prepared_picture(
            picture.reading, camera, self.pitch, windows, self.policy, known,
            circles_count_twice=True, position_is_known=known is not None, most_surprising=np.inf,
        )  # fmt: skip

    def _remember_frame(self, found: TrackedFrame) -> TrackedFrame:
        self.last = found
        if found.outcome is TRACKED and found.seen is not None and found.camera is not None:
            share = found.seen.supported
            self.usual = max(share, USUAL_DECAY * self.usual)
            self.known = [*self.known[:1], found.camera]
        return found


def _compute_motion_fraction(match: BackgroundMatches, width: int) -> float:
    """By which share of its width the picture moved, or grew."""
    moved = match.there - match.here
    shift = float(np.hypot(*np.median(moved, axis=0)))
    spread = [float(np.std(each)) for each in (match.here, match.there)]
    return shift / width + abs(float(np.log(spread[1] / spread[0])))


def _measure_median_shift_px(before: SnappedCamera, after: SnappedCamera) -> float:
    """How far the places on which paint was seen are moved by another camera, in the median, pixels."""
    places = before.evidence.traced.places
    apart = np.hypot(*(after.camera.project(places) - before.camera.project(places)).T)
    return float(np.median(np.nan_to_num(apart, nan=np.inf)))


def _agreement_product(frame: TrackedFrame) -> float:
    return 0.0 if frame.seen is None else frame.seen.combined_score


def predicted_covariance(
    picture: FramePicture, camera: Camera, reach: PaintSearchReach, unit: float, frames: int
) -> FloatArray:
    """How well a camera is known that the background turned, shape (8, 8).

    The grass in the picture lies where it should to the flow's accuracy; where the camera stands
    may have changed a little, and then it looks elsewhere for it.

    Args:
        camera: As predicted.
        reach: How far off it may be.
        unit: Pixels for a pixel at 960 wide.
        frames: How many frames the prediction spans.
    """
    half = picture.reading.half_diagonal
    height, width = picture.field.shape
    columns, rows = np.meshgrid(*(np.linspace(0.1, 0.9, n) for n in GRID))
    pixels = np.column_stack([columns.ravel() * width, rows.ravel() * height])
    ground = camera.project_to_ground(pixels)
    ground = ground[np.isfinite(ground).all(axis=1) & (np.hypot(*np.nan_to_num(ground).T) < 150)]
    sigma = np.empty(PARAMETERS)
    sigma[[PAN, TILT]], sigma[ROLL] = ANGLE_SIGMA, reach.roll_sigma * np.sqrt(frames)
    sigma[X : Z + 1] = reach.move_sigma_m * np.sqrt(frames)
    sigma[LOG_FOCAL], sigma[KAPPA] = FOCAL_SIGMA, KAPPA_SIGMA * np.sqrt(frames)
    information = np.diag(sigma**-2.0)
    if len(ground):
        points = np.column_stack([ground, np.zeros(len(ground))])
        parameters = np.tile(parameters_from_camera(camera, half), (len(points), 1))
        slopes = projection_jacobians(parameters, points, np.full(len(points), half))
        slopes = slopes.reshape(-1, PARAMETERS)
        share = SAID_ONCE / len(ground) / ((reach.flow_px * unit) ** 2 * frames)
        information = information + share * slopes.T @ slopes
    scale = np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information / np.outer(scale, scale)) / np.outer(scale, scale)
    return np.asarray(0.5 * (inverse + inverse.T))
