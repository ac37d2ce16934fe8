"""JaC in the direction that the paper prints: from the projection to the annotation.

The public evaluator, and Touchline with it, asks whether every *annotated* point lies near the
projection. The paper's text asks whether every point of the *projected* marking lies near the
annotated polyline, which also counts wherever nobody clicked up to a marking's end.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_line_files
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.polyline import distance_to_polyline
from app.soccer.annotation import Lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import MARKINGS, Pitch
from app.soccer.policy import CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.jaccard import (
    FALSE_NEGATIVE,
    FALSE_POSITIVE,
    TRUE_POSITIVE,
    camera_jaccard,
    jaccard,
    project_markings,
)

LINES = (
    Path(os.environ.get("TOUCHLINE_REAL_DATA", Path(__file__).parents[3] / "shared" / "data"))
    / "sn22-dev"
    / "lines.zip"
)
SIZE, PITCH = ImageSize(960, 540), Pitch()


def printed_jaccard(
    camera: Camera, lines: Lines, pitch: Pitch, size: ImageSize, gamma_px: float
) -> float:
    """JaC of a camera as the paper's text defines it.

    Args:
        camera: The camera to measure.
        lines: Annotated points by marking, pixels.
        pitch: The pitch.
        size: Annotated size.
        gamma_px: Threshold, pixels.
    """
    projected = project_markings(camera, pitch, size)
    found = {}
    for marking in MARKINGS:
        said = lines.get(marking)
        if marking not in projected:
            if said:
                found[marking] = FALSE_NEGATIVE
            continue
        near = said and _all_near(projected[marking], np.array(said), gamma_px)
        found[marking] = TRUE_POSITIVE if near else FALSE_POSITIVE
    return jaccard(found)


def _all_near(polyline: FloatArray, said: FloatArray, gamma_px: float) -> bool:
    if len(said) < 2:
        return False
    apart, _ = distance_to_polyline(polyline, said)
    return bool(np.all(apart < gamma_px))


@dataclass(frozen=True)
class Directions:
    """Mean JaC of the same cameras, and of how many frames.

    Attributes:
        public: From the annotation to the projection, as the public evaluator measures.
        printed: From the projection to the annotation, as the paper prints.
    """

    public: float
    printed: float
    frames: int


def both_directions(lines: Path = LINES) -> Directions | None:
    """JaC of cameras from real lines, both ways; None where the lines are not there."""
    if not lines.is_file():
        return None
    gamma, rows = 0.005 * SIZE.diagonal, []
    for file in read_line_files(lines, SIZE, ReaderReport()):
        camera = calibrate(file.lines, PITCH, SIZE, CalibrationPolicy()).camera
        if camera is not None:
            public = camera_jaccard(camera, file.lines, PITCH, SIZE, (gamma,))[0]
            rows.append((public, printed_jaccard(camera, file.lines, PITCH, SIZE, gamma)))
    return Directions(*np.mean(rows, axis=0).tolist(), len(rows))
