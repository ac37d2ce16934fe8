"""A camera that lies on a circle and a touchline from metres beside its tripod finds back by the middle line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import (
    LOG_FOCAL,
    PAN,
    PARAMETERS,
    ROLL,
    TILT,
    X,
    Z,
    camera_from_parameters,
    parameters_from_camera,
)
from app.paint.ranking import measure_weakest_marking
from app.paint.snap import SnappedCamera, snap_to_prepared_picture
from app.sample.render import render_view
from app.soccer.pitch import Pitch
from app.soccer.policy import CalibrationPolicy
from app.tracking.clip import ClipFrame
from app.tracking.follow import REACHES
from app.tracking.missing_marking import propose_missing_marking_cameras
from app.tracking.picture import FramePicture, make_frame_picture
from tests.scenes import make_scenes
from tests.tripod_films import pose_scene

PITCH, POLICY = Pitch(), CalibrationPolicy()
STAND, BESIDE = (0.0, 63.0, -10.6), np.array([2.0, -2.5, 0.4])
SEEN = ("Circle central", "Side line top")
AIM = [PAN, TILT, ROLL, LOG_FOCAL]


@pytest.fixture(scope="module")
def scene() -> tuple[FramePicture, Camera, FloatArray]:
    """A picture of the right half of the circle, its camera, and the same with pixels of half a diagonal."""
    drawn = make_scenes(1, 1, faults=False)[0]
    view = drawn.group.views[0]
    truth = drawn.truth.view(view.key)
    assert truth is not None
    half = view.size.diagonal / 2
    parameters = parameters_from_camera(truth.camera, half)
    parameters[[PAN, TILT, ROLL]] = np.radians([9.5, 79.3, 0.5])
    parameters[X : Z + 1], parameters[LOG_FOCAL] = STAND, np.log(3000.0)
    camera = camera_from_parameters(parameters, truth.camera.principal_point, half)
    image = render_view(pose_scene(drawn, camera), view.key)
    return make_frame_picture(ClipFrame(0, 0.0, image)), camera, parameters


def beside(picture: FramePicture, camera: Camera, parameters: FloatArray) -> SnappedCamera:
    """A camera metres beside the true one, drawn onto circle and touchline."""
    half = picture.reading.half_diagonal
    places = np.concatenate([PITCH.sample(name, 0.5, 0.5) for name in SEEN])
    there = camera.project(places)
    inside = ((there > 0) & (there < (picture.reading.width, picture.reading.height))).all(axis=1)
    start = parameters.copy()
    start[X : Z + 1] += BESIDE

    def off(aim: FloatArray) -> FloatArray:
        moved = start.copy()
        moved[AIM] = aim
        found = camera_from_parameters(moved, camera.principal_point, half)
        return np.asarray(found.project(places[inside]) - there[inside]).ravel()

    start[AIM] = least_squares(off, start[AIM], x_scale="jac").x
    known = np.diag(np.full(PARAMETERS, 1e-3) ** 2)
    known[X : Z + 1, X : Z + 1] = np.eye(3) * 0.02**2
    return snap_to_prepared_picture(
        picture.reading, camera_from_parameters(start, camera.principal_point, half), PITCH,
        REACHES[0].windows, POLICY, known, circles_count_twice=True, position_is_known=True,
        most_surprising=np.inf,
    )  # fmt: skip


def test_the_middle_line_that_lies_elsewhere_leads_back_to_the_tripod(
    scene: tuple[FramePicture, Camera, FloatArray],
):
    picture, camera, parameters = scene
    wrong = beside(picture, camera, parameters)
    assert wrong.reason is None and measure_weakest_marking(picture.reading, wrong, PITCH) < 0.25
    assert np.linalg.norm(wrong.camera.position - camera.position) > 2
    found = next(propose_missing_marking_cameras(picture, wrong, PITCH, POLICY))
    snapped = snap_to_prepared_picture(
        picture.reading, found, PITCH, REACHES[1].windows, POLICY, None, circles_count_twice=True
    )
    assert measure_weakest_marking(picture.reading, snapped, PITCH) > 0.5
    assert np.linalg.norm(snapped.camera.position - camera.position) < 1


def test_nothing_is_sought_where_every_marking_has_paint(
    scene: tuple[FramePicture, Camera, FloatArray],
):
    picture, camera, _ = scene
    right = snap_to_prepared_picture(
        picture.reading, camera, PITCH, REACHES[0].windows, POLICY, None, circles_count_twice=True
    )
    assert right.reason is None
    assert list(propose_missing_marking_cameras(picture, right, PITCH, POLICY)) == []


def test_a_marking_whose_paint_is_nowhere_has_no_camera(
    scene: tuple[FramePicture, Camera, FloatArray],
):
    picture, camera, parameters = scene
    wrong = beside(picture, camera, parameters)
    grass = np.median(picture.image[picture.field], axis=0).astype(np.uint8)
    unpainted = replace(picture, image=np.broadcast_to(grass, picture.image.shape).copy())
    assert list(propose_missing_marking_cameras(unpainted, wrong, PITCH, POLICY)) == []
