"""The figure of docs/paint.md: ``python -m tests.bench.paint_figure OUT.jpg``."""

from __future__ import annotations

import sys

import cv2
import numpy as np

from app.paint.evidence import find_paint, prepare_picture, trace_visible_markings
from app.paint.grass import find_field_of_play
from app.paint.ridges import find_line_like_pixels
from app.sample.render import render_view
from app.soccer.pitch import Pitch
from tests.scenes import make_scenes

SEED = 1
BLUE, ORANGE = (255, 169, 90), (67, 159, 255)


def main(out: str) -> None:
    """Draw line-like paint, and the evidence at the true camera, on a rendered frame."""
    scene = make_scenes(3, SEED, faults=False)[0]
    key = scene.group.views[0].key
    image = render_view(scene, key).copy()
    picture = np.ascontiguousarray(image[:, :, ::-1])
    field = find_field_of_play(picture)
    truth = scene.truth.view(key)
    assert truth is not None
    reading = prepare_picture(picture, field)
    evidence = find_paint(
        reading, trace_visible_markings(reading, truth.camera, Pitch(), 14.0), 3.0
    )
    image[~field] //= 2
    image[
        cv2.dilate(find_line_like_pixels(picture, field).astype(np.uint8), np.ones((2, 2))) > 0
    ] = ORANGE
    for x, y in evidence.pixels:
        cv2.circle(image, (round(float(x)), round(float(y))), 4, BLUE, 1, cv2.LINE_AA)
    cv2.imwrite(out, image, [cv2.IMWRITE_JPEG_QUALITY, 80])


if __name__ == "__main__":
    main(sys.argv[1])
