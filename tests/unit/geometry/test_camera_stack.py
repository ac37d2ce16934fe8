"""Camera stack: the bits of each camera, whoever else is looked through at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera_stack import CameraStack
from tests.cameras import EVERY_COEFFICIENT, WIDE_LENSES, looking, wide

PLACES = ((2.0, 62.0, -14.0), (75.0, -10.0, -8.0), (-30.0, -70.0, -20.0))
PINHOLES = [looking(place, (10.0, 0.0, 0.0), 2000.0) for place in PLACES]
BENT = [looking(place, (10.0, 0.0, 0.0), 2000.0, bend=-0.02) for place in PLACES]
WIDE = [wide(PLACES[0], (10.0, 0.0, 0.0), lens) for lens in WIDE_LENSES]
SKEWED = [replace(EVERY_COEFFICIENT, skew=2.5)]
ALL = [*PINHOLES, *BENT, *SKEWED, *WIDE]


@pytest.mark.parametrize("cameras", [PINHOLES, BENT, SKEWED, ALL])
def test_each_pixel_and_derivative_has_the_bits_of_its_camera(cameras):
    rng = np.random.default_rng(5)
    points = rng.uniform([-20, -20, -5], [30, 20, 0], (6, 3))
    which = rng.integers(0, len(cameras), (6, 2))
    pixels, jacobians = CameraStack(cameras).linearize(points, which)
    for row, point in enumerate(points):
        for place, camera in enumerate(cameras[number] for number in which[row]):
            assert np.array_equal(pixels[row, place], camera.project(point[None])[0])
            assert np.array_equal(jacobians[row, place], camera.jacobian(point))


def test_what_a_camera_does_not_show_has_no_pixel():
    behind, beyond = [2.0, 90.0, -10.0], [60.0, 35.0, 0.0]
    folding = replace(
        PINHOLES[0], focal_length=(600.0, 600.0), distortion=np.array([-0.3, *np.zeros(11)])
    )
    pixels, _ = CameraStack([folding, PINHOLES[0]]).linearize(
        np.array([behind, beyond]), np.array([[0, 1], [0, 1]])
    )
    assert np.isnan(pixels[0]).all()
    assert np.isnan(pixels[1]).all(axis=1).tolist() == [True, False]
