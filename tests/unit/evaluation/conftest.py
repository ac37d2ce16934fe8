"""Frames with a known camera and a known ball."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from app.evaluation.frame import Detection, FrameWithDetections, GroundTruthFrame
from app.geometry.camera import Camera
from app.geometry.sphere import optimal_diameter
from app.soccer.frames import Box, ImagePoint
from tests.cameras import SIZE, looking

DIAMETER = 0.226
MakeFrame = Callable[..., GroundTruthFrame]


def camera_at(distance: float, distortion: float = 0.0) -> Camera:
    """A camera on the near side that looks at the centre mark from that far, horizontally."""
    camera = looking((0.0, distance, -0.113), (0.0, 0.0, -0.113), 2000.0)
    return replace(camera, distortion=np.array([distortion, *np.zeros(11)]))


@pytest.fixture
def make_frame() -> MakeFrame:
    """Makes a frame whose ball lies at a point, with its optimised box."""

    def make(
        identity: int = 1,
        distance: float = 50.0,
        match: str = "m",
        point: tuple[float, float, float] = (0.0, 0.0, -0.113),
        distortion: float = 0.0,
    ) -> GroundTruthFrame:
        camera = camera_at(distance, distortion)
        x, y = camera.project(np.array([point]))[0]
        center = ImagePoint(float(x), float(y))
        diameter, _ = optimal_diameter(camera, np.array(center), np.array(point), DIAMETER)
        box = Box.square(center, diameter)
        loose = Box.square(center, diameter * 1.25)
        return GroundTruthFrame(
            id=identity,
            group_id=identity,
            group=f"{match}/{identity}.png",
            view=f"{identity}.png",
            match=match,
            size=SIZE,
            boxes={"optimized": box, "annotated": loose, "exact": box},
            camera=camera,
            point=point,
            parallax_degrees=30.0,
        )

    return make


@pytest.fixture
def make_judged(make_frame: MakeFrame) -> Callable[..., FrameWithDetections]:
    """Makes a judged frame from boxes with scores."""

    def make(
        truth: Box | None, *found: tuple[Box, float], identity: int = 1, match: str = "m"
    ) -> FrameWithDetections:
        detections = tuple(Detection(box, score) for box, score in found)
        return FrameWithDetections(make_frame(identity, match=match), truth, detections)

    return make
