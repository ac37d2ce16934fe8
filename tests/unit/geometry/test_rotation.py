import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.errors import ShapeError
from app.geometry.rotation import (
    pan_tilt_roll_from_rotation,
    rotation_from_pan_tilt_roll,
    rotation_from_vector,
)

ANGLE = st.floats(-3.1, 3.1)


class TestRotationFromPanTiltRoll:
    def test_pan_zero_and_tilt_ninety_look_along_minus_y(self):
        rotation = rotation_from_pan_tilt_roll(0.0, np.pi / 2, 0.0)
        assert np.allclose(rotation @ [0.0, -1.0, 0.0], [0.0, 0.0, 1.0])

    def test_less_tilt_looks_down(self):
        forward = rotation_from_pan_tilt_roll(0.0, np.radians(70), 0.0)[2]
        assert forward[2] > 0  # z points down

    def test_is_the_published_matrix_of_a_soccernet_camera(self):
        # From the camera JSON convention: R = (Rz(pan) Rx(tilt) Rz(roll))^T, written out.
        pan, tilt, roll = np.radians([40.5, 75.8, -0.23])
        sp, cp, st_, ct = np.sin(pan), np.cos(pan), np.sin(tilt), np.cos(tilt)
        sr, cr = np.sin(roll), np.cos(roll)
        expected = [
            [-sp * sr * ct + cp * cr, sp * cr + sr * cp * ct, sr * st_],
            [-sp * cr * ct - sr * cp, -sp * sr + cp * cr * ct, st_ * cr],
            [sp * st_, -st_ * cp, ct],
        ]
        assert np.allclose(rotation_from_pan_tilt_roll(pan, tilt, roll), expected, atol=1e-15)


class TestPanTiltRollFromRotation:
    @given(ANGLE, st.floats(0.05, 3.0), st.floats(-1.5, 1.5))
    def test_gives_back_the_angles_of_a_camera_that_is_not_upside_down(self, pan, tilt, roll):
        rotation = rotation_from_pan_tilt_roll(pan, tilt, roll)
        assert pan_tilt_roll_from_rotation(rotation) == pytest.approx((pan, tilt, roll), abs=1e-9)

    @given(ANGLE, st.floats(-3.1, 3.1), ANGLE)
    def test_any_rotation_is_rebuilt_from_its_angles(self, pan, tilt, roll):
        rotation = rotation_from_pan_tilt_roll(pan, tilt, roll)
        again = rotation_from_pan_tilt_roll(*pan_tilt_roll_from_rotation(rotation))
        assert np.allclose(again, rotation, atol=1e-9)

    def test_straight_down_has_no_roll(self):
        rotation = rotation_from_pan_tilt_roll(0.4, 0.0, 0.3)
        pan, tilt, roll = pan_tilt_roll_from_rotation(rotation)
        assert (pan, tilt, roll) == pytest.approx((0.7, 0.0, 0.0))


class TestRotationFromVector:
    @pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, np.pi, 7.0])
    def test_is_what_the_library_of_computer_vision_makes_of_it(self, angle: float) -> None:
        axis = np.array([0.48, -0.6, 0.64])
        expected, _ = cv2.Rodrigues(axis * angle)
        assert np.allclose(rotation_from_vector(axis * angle), expected, atol=1e-14)

    def test_is_a_rotation_also_for_a_tiny_vector(self) -> None:
        found = rotation_from_vector(np.array([1e-9, -2e-9, 1e-10]))
        assert np.allclose(found @ found.T, np.eye(3), atol=1e-15)

    def test_another_shape_is_refused(self) -> None:
        with pytest.raises(ShapeError):
            rotation_from_vector(np.zeros((3, 1)))
