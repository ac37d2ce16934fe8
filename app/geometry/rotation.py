"""Rotations: SoccerNet's pan, tilt and roll."""

from __future__ import annotations

import numpy as np

from app.geometry.arrays import FloatArray, require_shape


def rotation_from_pan_tilt_roll(pan: float, tilt: float, roll: float) -> FloatArray:
    """World-to-camera rotation R = (Rz(pan) Rx(tilt) Rz(roll))^T, shape (3, 3).

    Pan 0 looks towards -y, tilt 90 degrees is horizontal, less looks down.

    Args:
        pan: Radians, as tilt and roll.
        tilt: Radians.
        roll: Radians.

    Example:
        >>> rotation_from_pan_tilt_roll(0.0, np.pi / 2, 0.0)[2].round(12) + 0.0
        array([ 0., -1.,  0.])
    """
    return (_about_z(pan) @ _about_x(tilt) @ _about_z(roll)).T


def pan_tilt_roll_from_rotation(rotation: FloatArray) -> tuple[float, float, float]:
    """Pan, tilt and roll in radians; of the two triples with this rotation the smaller roll.

    Args:
        rotation: World to camera, shape (3, 3).

    Returns:
        Pan and roll in (-pi, pi]. Where the camera looks straight up or down (tilt 0 or 180
        degrees) pan and roll turn about one axis, and roll is 0.
    """
    orientation = require_shape(rotation, (3, 3), "rotation").T
    sine = float(np.hypot(orientation[2, 0], orientation[2, 1]))
    tilt = float(np.arctan2(sine, orientation[2, 2]))
    if sine < 1e-12:
        return float(np.arctan2(orientation[1, 0], orientation[0, 0])), tilt, 0.0
    pan = float(np.arctan2(orientation[0, 2], -orientation[1, 2]))
    roll = float(np.arctan2(orientation[2, 0], orientation[2, 1]))
    if abs(roll) > np.pi / 2:
        pan = float(np.arctan2(-orientation[0, 2], orientation[1, 2]))
        roll = float(np.arctan2(-orientation[2, 0], -orientation[2, 1]))
        return pan, -tilt, roll
    return pan, tilt, roll


def _about_z(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def _about_x(angle: float) -> FloatArray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])


def rotation_from_vector(vector: FloatArray) -> FloatArray:
    """The rotation about a vector by its length in radians (Rodrigues' formula).

    Args:
        vector: Axis times angle, radians, shape (3,).

    Returns:
        Rotation matrix, shape (3, 3).

    Raises:
        ShapeError: The vector has another shape.

    Source: Hartley & Zisserman, appendix A4.3.2.

    Example:
        >>> rotation_from_vector(np.array([0.0, 0.0, np.pi / 2])).round(12) + 0.0
        array([[ 0., -1.,  0.],
               [ 1.,  0.,  0.],
               [ 0.,  0.,  1.]])
    """
    require_shape(vector, (3,), "vector")
    x, y, z = vector
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = float(np.linalg.norm(vector))
    # sin(a)/a and (1 - cos a)/a^2 without a division by zero.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * cross + second * cross @ cross, dtype=float)
