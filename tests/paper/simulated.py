"""Stand-ins with known faults for what the paper trained: a detector, and a line detector.

Nothing here looks at a picture. A detection is the true ball with noise on its place and size. The
numbers below were not fitted to results, but they were chosen with the paper at hand: a size noise
of seven per cent is about what its YOLO_opt must have had to err by 5.5 per cent of the distance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from app.evaluation.frame import Detection
from app.geometry.camera import Camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import View
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate

MISSED = 0.12
"""Share of the balls that are not found."""
FALSE_ALARMS = 0.4
"""Of a frame, on average."""
SIZE_NOISE = 0.07
"""Standard deviation of the logarithm of the diameter."""
PLACE_NOISE_PX = 0.35
PLACE_NOISE_SHARE = 0.04
"""Of the centre along each axis: pixels, and a share of the diameter."""
LINE_NOISE_PX = 2.0
"""What is added to the clicks of field lines to stand for a line detector."""


@dataclass(frozen=True)
class SimulatedDetector:
    """A detector that learnt its size of a ball from boxes.

    ``looseness`` is the mean ratio of its training boxes' diameter to the true one: a network
    that is trained on loose boxes predicts loose boxes.
    """

    looseness: float
    seed: int

    def detect(self, key: str, true: Box, size: ImageSize) -> list[Detection]:
        """Detections of one frame, in no particular order."""
        rng = np.random.default_rng([self.seed, *key.encode()])
        found = [self._false_alarm(rng, true, size) for _ in range(rng.poisson(FALSE_ALARMS))]
        ball = self._ball(rng, true)
        return found if rng.random() < MISSED else [ball, *found]

    def _ball(self, rng: np.random.Generator, true: Box) -> Detection:
        diameter = true.diameter * self.looseness * float(np.exp(rng.normal(0, SIZE_NOISE)))
        spread = PLACE_NOISE_PX + PLACE_NOISE_SHARE * true.diameter
        x, y = rng.normal(true.center, spread).tolist()
        score = float(np.clip(rng.normal(0.72, 0.16), 0.02, 0.99))
        return Detection(Box.square(ImagePoint(x, y), diameter), score)

    def _false_alarm(self, rng: np.random.Generator, true: Box, size: ImageSize) -> Detection:
        x, y = rng.uniform((0, 0), (size.width, size.height)).tolist()
        diameter = true.diameter * float(np.exp(rng.normal(0, 0.3)))
        score = float(np.clip(rng.normal(0.32, 0.16), 0.02, 0.99))
        return Detection(Box.square(ImagePoint(x, y), diameter), score)


def looseness(pairs: Mapping[str, tuple[Box, Box]]) -> float:
    """Mean ratio of the diameters of training boxes and true boxes."""
    return float(np.mean([said.diameter / true.diameter for said, true in pairs.values()]))


def camera_from_noisy_lines(view: View, pitch: Pitch, seed: int) -> Camera | None:
    """The camera of a view from its lines with more noise, by our own calibration."""
    rng = np.random.default_rng([seed, *view.station.key.encode()])
    moved: Lines = make_lines(
        {
            marking: [tuple(rng.normal(point, LINE_NOISE_PX)) for point in points]
            for marking, points in view.station.lines.items()
        }
    )
    return calibrate(moved, pitch, view.size, CalibrationPolicy()).camera
