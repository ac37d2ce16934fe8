"""The figure of docs/calibration.md: ``python -m tests.bench.figure OUT.jpg``."""

from __future__ import annotations

import sys

import cv2
import numpy as np

from app.sample.render import render_view
from app.soccer.policy import PAPER
from app.solving.calibrate import calibrate
from app.solving.jaccard import project_markings
from tests.scenes import make_scenes

SEED = 20260101
GAIN = 20.0
BLUE, ORANGE, WHITE, INK = (255, 169, 90), (67, 159, 255), (255, 255, 255), (22, 17, 14)


def main(out: str) -> None:
    """Draw the main camera of the first scene with its calibration."""
    scene = make_scenes(3, SEED, faults=False)[2]
    view = scene.group.views[0]
    calibration = calibrate(view.station.lines, scene.group.pitch, view.size, PAPER.calibration)
    image = render_view(scene, view.key).copy()
    for polyline in project_markings(calibration.camera, scene.group.pitch, view.size).values():
        _polyline(image, polyline, BLUE)
    for fit in calibration.markings:
        points = np.array(view.station.lines.get(fit.marking, ()))
        for point, nearest in zip(points, np.array(fit.nearest), strict=True):
            _polyline(image, np.array([nearest, nearest + GAIN * (point - nearest)]), ORANGE)
            center = _fixed(point)
            cv2.circle(image, center, 4 * 16, INK, -1, cv2.LINE_AA, 4)
            cv2.circle(image, center, 3 * 16, WHITE, -1, cv2.LINE_AA, 4)
    words = f"JaC 0.5 %: {calibration.jac[0]:.2f}   median {calibration.error_px:.2f} px   offsets x{GAIN:.0f}"
    cv2.rectangle(image, (16, 674), (560, 706), INK, -1)
    cv2.putText(image, words, (26, 696), cv2.FONT_HERSHEY_SIMPLEX, 0.55, WHITE, 1, cv2.LINE_AA)
    cv2.imwrite(out, image, [cv2.IMWRITE_JPEG_QUALITY, 82])


def _polyline(image: np.ndarray, points: np.ndarray, colour: tuple[int, int, int]) -> None:
    fixed = np.array([_fixed(point) for point in points], dtype=np.int32)
    cv2.polylines(image, [fixed.reshape(-1, 1, 2)], False, colour, 2, cv2.LINE_AA, 4)


def _fixed(point: np.ndarray) -> tuple[int, int]:
    """Sixteenths of a pixel, as OpenCV draws them."""
    return round(16 * float(point[0])), round(16 * float(point[1]))


if __name__ == "__main__":
    main(sys.argv[1])
