from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.geometry.resection import (
    PAN,
    PARAMETERS,
    camera_from_parameters,
    parameters_from_camera,
)
from app.tracking.sides import are_on_opposite_side, move_camera_to_opposite_side
from tests.tracked_frames import CAMERA, frame

HALF = 500.0
POINTS = np.array([[10.0, 5.0, 0.0], [-3.0, 20.0, 0.0], [30.0, -12.0, -1.5]])


def test_the_turned_camera_sees_the_turned_pitch_where_the_other_saw_it() -> None:
    turned = move_camera_to_opposite_side(frame(3, "tracked"))
    assert turned.camera is not None
    opposite = POINTS * (-1, -1, 1)
    np.testing.assert_allclose(turned.camera.project(opposite), CAMERA.project(POINTS), atol=1e-9)
    assert turned.camera.position.tolist() == [-0.0, -60.0, -15.0]
    assert (turned.number, turned.supported, turned.error_px) == (3, 0.9, 0.2)


def test_twice_is_as_before_to_the_last_bit_and_a_lost_frame_stays_one() -> None:
    one = frame(3, "tracked")
    again = move_camera_to_opposite_side(move_camera_to_opposite_side(one))
    assert again == one
    lost = frame(4, "lost")
    assert move_camera_to_opposite_side(lost) is lost


def test_the_covariance_is_that_of_the_turned_parameters() -> None:
    """Cameras drawn from the covariance and turned have the covariance that is given."""
    generator = np.random.default_rng(3)
    root = generator.normal(0, 0.002, (PARAMETERS, PARAMETERS))
    covariance = root @ root.T
    one = replace(frame(0, "tracked"), covariance=tuple(covariance.ravel().tolist()))
    mean = parameters_from_camera(CAMERA, HALF)
    drawn = generator.multivariate_normal(mean, covariance, 4000)
    rows = []
    for row in drawn:
        camera = camera_from_parameters(row, CAMERA.principal_point, HALF)
        turned = move_camera_to_opposite_side(replace(one, camera=camera)).camera
        assert turned is not None
        rows.append(parameters_from_camera(turned, HALF))
    found = np.array(rows)
    found[:, PAN] = np.unwrap(found[:, PAN])
    given = np.reshape(move_camera_to_opposite_side(one).covariance or (), (PARAMETERS, PARAMETERS))
    scale = np.sqrt(np.outer(np.diag(given), np.diag(given)))
    np.testing.assert_allclose(np.cov(found.T) / scale, given / scale, atol=0.08)


def test_cameras_stand_opposite_where_they_are_nearer_once_turned() -> None:
    one = frame(0, "tracked")
    before = {0: one, 1: frame(1, "lost")}
    assert not are_on_opposite_side([one, frame(1, "tracked")], before)
    assert are_on_opposite_side([move_camera_to_opposite_side(one), frame(1, "tracked")], before)
    assert not are_on_opposite_side([frame(2, "tracked")], before)
