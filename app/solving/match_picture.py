"""Match picture: aspect and principal point of pictures, estimated from many frames.

What was done to the pictures of a match (or of one shot) was done to all of them alike. One frame
seldom tells a stretched picture from another camera; many frames do. All cameras and the three
numbers are adjusted together (see ``pitch_size``). A frame that contradicts the others fits badly, so
its clicks count as noisy and it says little.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.geometry.resection import PARAMETERS
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.observations import Observations, make_observations
from app.solving.picture_camera import PictureProblem, undo_warp, warp_to_picture
from app.solving.pitch_size import (
    CERTAIN_SIGMAS,
    MAX_FRAMES,
    Share,
    eliminate_camera,
    eliminate_frame_deviations,
    estimate_sigmas_of_shared_numbers,
    find_frames_with_enough_measurements,
)
from app.solving.resect import ResectionProblem

MIN_FRAMES = 3
PRIOR_SIGMA = np.array([0.12, 0.2, 0.2])
"""Of the logarithm of the aspect, and of both shifts (half diagonals), before any frame is seen."""
FRAME_SIGMA = np.array([0.006, 0.04, 0.04])
"""What lens, pitch and annotator of one frame may add to the error of its own numbers."""
LEAST = np.array([0.02, 0.06, 0.06])
"""A picture was changed where one of its numbers is so many sigmas, and so much, from nothing."""
_ROUNDS, _SETTLED = 10, 3e-4
_LONGEST = np.array([0.15, 0.25, 0.25])


@dataclass(frozen=True)
class PictureFrameLines:
    """Annotated points by marking, pixels of ``size``."""

    lines: Lines
    size: ImageSize
    pitch: Pitch = field(default_factory=Pitch)


@dataclass(frozen=True)
class PictureEstimate:
    """What many frames say of their pictures.

    Attributes:
        picture: The most likely numbers, and how well they are known.
        frames: Number of frames that it rests on.
    """

    picture: PictureGeometry
    frames: int

    @property
    def proposal(self) -> PictureGeometry | None:
        """The picture to calibrate frames with; None where nothing certainly happened to it.

        One frame differs from all together by ``FRAME_SIGMA``, so it is known no better.
        """
        size = np.abs([np.log(self.picture.aspect), *self.picture.shift])
        certain = size > np.maximum(LEAST, CERTAIN_SIGMAS * np.array(self.picture.sigma))
        aspect, right, down = np.hypot(self.picture.sigma, FRAME_SIGMA).tolist()
        return replace(self.picture, sigma=(aspect, right, down)) if certain.any() else None


def estimate_match_picture(
    frames: Sequence[PictureFrameLines], policy: CalibrationPolicy
) -> PictureEstimate:
    """The picture that explains the lines of many frames best.

    Args:
        frames: Of one match, or of one shot.
        policy: How frames are calibrated.

    Raises:
        DegenerateGeometryError: Too few frames show enough markings.
    """
    seen = [_FittedFrame.of(frames[index], policy) for index in select_informative_frames(frames)]
    if len(seen) < MIN_FRAMES:
        raise DegenerateGeometryError(
            f"only {len(seen)} frames show enough markings; estimating the picture geometry"
            f" needs {MIN_FRAMES}"
        )
    warp, pull, informations = _adjust_picture(seen)
    information = informations.sum(axis=0) + np.diag(PRIOR_SIGMA**-2)
    aspect, right, down = estimate_sigmas_of_shared_numbers(pull, information, spent=1).tolist()
    return PictureEstimate(warp_to_picture(warp, (aspect, right, down)), len(seen))


def select_informative_frames(frames: Sequence[PictureFrameLines]) -> list[int]:
    """Indices of the frames with the most independent measurements, ``MAX_FRAMES`` at most."""
    order = find_frames_with_enough_measurements(
        make_observations(frame.lines, frame.pitch, frame.size) for frame in frames
    )
    return sorted(order[:MAX_FRAMES])


@dataclass(frozen=True)
class _FittedFrame:
    """A frame with its best camera so far, in the picture as it was taken."""

    problem: ResectionProblem
    observations: Observations
    camera: FloatArray

    @staticmethod
    def of(frame: PictureFrameLines, policy: CalibrationPolicy) -> _FittedFrame:
        # What markings have in common is in FRAME_SIGMA.
        problem = ResectionProblem.of(frame.size, replace(policy, weighed="points"))
        observations = make_observations(
            frame.lines, policy.pitch_for_fitted_lines(frame.pitch), frame.size
        )
        return _FittedFrame(problem, observations, problem.resect(observations).parameters)

    def refit_with_warp(self, warp: FloatArray) -> _FittedFrame:
        """The frame with another picture, its camera refined."""
        seen = undo_warp(self.problem, self.observations, warp)
        return replace(self, camera=self.problem.refine(seen, self.camera[None]).parameters)

    def information_on_picture(self, warp: FloatArray) -> Share:
        """What the frame says of the picture, shapes (3,) and (3, 3), its camera eliminated."""
        search = PictureProblem(self.problem, self.observations, warp, np.full(3, np.inf))
        unknowns = np.append(self.camera, warp)
        apart, jacobian = search.rows(unknowns)
        scale = self.problem.robust_scale_px * self.problem.pixels_per_reference_pixel
        weighted = jacobian / np.sqrt(1 + (apart / scale) ** 2)[:, None]
        gradient, information = weighted.T @ apart, weighted.T @ jacobian
        prior = self.problem.prior()
        gradient[:PARAMETERS] += (self.camera - prior.mean) / prior.sigma**2
        information[range(PARAMETERS), range(PARAMETERS)] += prior.sigma**-2
        pull, reduced = eliminate_camera(gradient, information, search.click_variance(unknowns))
        # A frame that says nearly nothing may say a little less than nothing, by rounding.
        values, vectors = np.linalg.eigh((reduced + reduced.T) / 2)
        reduced = vectors * np.maximum(values, 0.0) @ vectors.T
        return eliminate_frame_deviations((pull, reduced), FRAME_SIGMA)


def _adjust_picture(seen: Sequence[_FittedFrame]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The three numbers once they settle, and each frame's pull and information."""
    warp = np.zeros(3)
    for _ in range(_ROUNDS):
        seen = [frame.refit_with_warp(warp) for frame in seen]
        shares = [frame.information_on_picture(warp) for frame in seen]
        pull, informations = (np.array(part) for part in zip(*shares, strict=True))
        information = informations.sum(axis=0) + np.diag(PRIOR_SIGMA**-2)
        step = -np.linalg.solve(information, pull.sum(axis=0) + warp / PRIOR_SIGMA**2)
        step = np.clip(step, -_LONGEST, _LONGEST)
        warp = warp + step
        if np.abs(step).max() < _SETTLED:
            break
    return warp, pull, informations
