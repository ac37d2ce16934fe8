"""Frames in which a ball is sought, and how their background moves from one to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.tracking.ball_picture import BallGreyConversion, Grey, Image
from app.tracking.motion import match_background

BACKGROUND_WIDTH = 640
"""Pixels of width at which the background is followed."""


@dataclass(frozen=True)
class BallFrame:
    """A frame as the search sees it.

    Attributes:
        image: Red green blue, shape (H, W, 3).
        colour: Makes it the grey picture in which a ball stands out.
        small: For the motion of the background, where cameras do not say it.
    """

    number: int
    image: Image
    colour: BallGreyConversion
    small: Grey

    @staticmethod
    def of(number: int, image: Image, colour: BallGreyConversion) -> BallFrame:
        scale = min(1.0, BACKGROUND_WIDTH / image.shape[1])
        small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        grey = np.asarray(cv2.cvtColor(small, cv2.COLOR_RGB2GRAY), np.uint8)
        return BallFrame(number, image, colour, grey)

    @property
    def size(self) -> FloatArray:
        """Width and height."""
        return np.array(self.image.shape[1::-1], float)

    def crop_grey(self, left: int, top: int, right: int, bottom: int) -> Grey:
        """The grey picture from a corner to before another one; beyond the rim it goes on as it ends."""
        height, width = self.image.shape[:2]
        rows = np.clip(np.arange(top, bottom), 0, height - 1)
        columns = np.clip(np.arange(left, right), 0, width - 1)
        return self.colour.to_grey(self.image[rows[0] : rows[-1] + 1][rows - rows[0]][:, columns])


def estimate_background_homography(
    here: BallFrame, there: BallFrame, cameras: Mapping[int, Camera]
) -> FloatArray:
    """How the background moves from a frame to another one, a homography of pixels, shape (3, 3)."""
    one, other = cameras.get(here.number), cameras.get(there.number)
    width, height = here.size
    if one is not None and other is not None:
        grid = np.stack(np.meshgrid(np.linspace(0, width, 5), np.linspace(0, height, 5)), -1)
        pixels = grid.reshape(-1, 2)
        moved = other.project(other.position + 60.0 * one.rays(pixels))
        seen = np.isfinite(moved).all(axis=1)
        if seen.sum() >= 8:
            found, _ = cv2.findHomography(pixels[seen], moved[seen], 0)
            if found is not None:
                return np.asarray(found, float)
    match = match_background(here.small, there.small)
    if match is None:
        return np.eye(3)
    found, _ = cv2.findHomography(match.here, match.there, 0)
    scale = width / here.small.shape[1]
    half = (scale - 1) / 2
    enlarge = np.array([[scale, 0, half], [0, scale, half], [0, 0, 1.0]])
    return np.asarray(enlarge @ found @ np.linalg.inv(enlarge)) if found is not None else np.eye(3)


def apply_homography(turn: FloatArray, points: FloatArray) -> FloatArray:
    """Points (N, 2) after a homography."""
    whole = points @ turn[:, :2].T + turn[:, 2]
    return np.asarray(whole[:, :2] / whole[:, 2:])


def invert_homography(turn: FloatArray) -> FloatArray:
    """The homography back."""
    return np.asarray(np.linalg.inv(turn), float)
