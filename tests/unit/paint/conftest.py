"""One rendered picture with its truth and the camera of its clicks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.grass import find_field_of_play
from app.sample.render import render_view
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate
from tests.scenes import make_scenes


@dataclass(frozen=True)
class Rendered:
    """A picture of the sample."""

    image: np.ndarray
    field: np.ndarray
    truth: Camera
    clicked: Calibration


@pytest.fixture(scope="session")
def rendered() -> Rendered:
    scene = make_scenes(1, 1, faults=False)[0]
    view = scene.group.views[0]
    image = np.ascontiguousarray(render_view(scene, view.key)[:, :, ::-1])
    truth = scene.truth.view(view.key)
    assert truth is not None
    clicked = calibrate(view.station.lines, Pitch(), view.size, PAPER.calibration)
    return Rendered(image, find_field_of_play(image), truth.camera, clicked)
