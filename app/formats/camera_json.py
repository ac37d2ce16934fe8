"""One camera as SoccerNet's JSON, both ways."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from app.errors import DatasetFormatError, GeometryError
from app.formats import fields
from app.geometry.arrays import FloatArray, flatten_covariance
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll, validate_camera_covariance
from app.geometry.lens import BROWN_CONRADY, LENSES
from app.geometry.resection import KAPPA, LOG_FOCAL, PAN, PARAMETERS, ROLL, X, Z
from app.json_text import quote_text
from app.soccer.frames import ImageSize

MAX_DISAGREEMENT_DEGREES = 0.01
"""Between the angles and the matrix of one file; beyond, the file contradicts itself."""
MAX_NUMBER = 1e7
"""No angle, distance or focal length of a camera is beyond."""
ROUNDING = 1e-10
"""Below, a matrix and its angles are the same rotation but for rounding."""

COVARIANCE = "covariance"
"""Ours: how well the camera is known (``covariance_to_json``)."""
LENS, LENS_COEFFICIENTS = "lens", "lens_coefficients"
"""Ours: name and numbers of a lens that SoccerNet's arrays do not hold (``geometry.lens``)."""
_ANGLES = ("pan_degrees", "tilt_degrees", "roll_degrees")
_DISTORTION = (("radial_distortion", 6), ("tangential_distortion", 2), ("thin_prism_distortion", 4))

T = TypeVar("T")


def camera_to_json(
    camera: Camera, covariance: Sequence[float] | None = None, size: ImageSize | None = None
) -> dict[str, Any]:
    """The camera as SoccerNet spells it: angles, matrix and all three distortion arrays.

    Every number is a plain float, so that ``repr`` and JSON keep it exactly. ``skew`` is ours
    and stands there only when it is not zero. A wide lens has ``lens`` and ``lens_coefficients``
    in place of the three arrays: whoever expects those must not take it for a pinhole.

    Args:
        covariance: Of the camera's parameters (``geometry.resection``), row by row, shape (64,),
            where it is known; then ``covariance`` stands there.
        size: Of its images, which such a covariance needs.
    """
    pan, tilt, roll = camera.pan_tilt_roll_degrees
    value = {
        "pan_degrees": pan,
        "tilt_degrees": tilt,
        "roll_degrees": roll,
        "x_focal_length": float(camera.focal_length[0]),
        "y_focal_length": float(camera.focal_length[1]),
        "principal_point": [float(item) for item in camera.principal_point],
        "position_meters": [float(item) for item in camera.position],
        "rotation_matrix": [[float(item) for item in row] for row in camera.rotation],
        **_lens_to_json(camera),
    }
    if camera.skew:
        value["skew"] = float(camera.skew)
    if covariance is not None and size is not None:
        value[COVARIANCE] = covariance_to_json(covariance, camera, size)
    return value


def covariance_to_json(
    covariance: Sequence[float], camera: Camera, size: ImageSize
) -> list[list[float]]:
    """How well a camera is known, in the units of its file, 8 x 8.

    In this order: x, y and z of ``position_meters`` (pitch frame, metres), pan, tilt and roll
    (degrees), focal length (pixels of ``size``), and k1, the first of ``radial_distortion``.

    Args:
        covariance: Of the camera's parameters (``geometry.resection``), row by row, shape (64,).
        camera: With one radial term.
        size: Of its images.
    """
    ways = _compute_file_value_jacobian(camera, size)
    known = np.reshape(covariance, (PARAMETERS, PARAMETERS))
    rows: list[list[float]] = (ways @ known @ ways.T).tolist()
    return rows


def covariance_from_json(
    value: Mapping[str, Any], camera: Camera, size: ImageSize
) -> tuple[float, ...] | None:
    """Back from ``covariance_to_json``; None where the camera's file says nothing.

    Raises:
        ValueError: It is no covariance of eight numbers, or that of a wide lens.
    """
    found = value.get(COVARIANCE)
    if found is None:
        return None
    if camera.is_wide:
        raise ValueError(
            "is for a lens with one radial term, and this camera has another lens: leave it out"
        )
    rows = [fields.parse_numbers(row, PARAMETERS) for row in fields.require_list(found)]
    if len(rows) != PARAMETERS:
        raise ValueError(f"has {len(rows)} rows, not {PARAMETERS}")
    known = np.reshape(validate_camera_covariance(number for row in rows for number in row), (8, 8))
    back = np.linalg.inv(_compute_file_value_jacobian(camera, size))
    return validate_camera_covariance(flatten_covariance(back @ known @ back.T))


def _compute_file_value_jacobian(camera: Camera, size: ImageSize) -> FloatArray:
    """Derivatives of a file's numbers by the camera's parameters, shape (8, 8)."""
    focal = float(np.sqrt(camera.focal_length[0] * camera.focal_length[1]))
    ways = np.zeros((PARAMETERS, PARAMETERS))
    ways[:3, X : Z + 1] = np.eye(3)
    ways[3:6, PAN : ROLL + 1] = np.degrees(np.eye(3))
    ways[6, LOG_FOCAL] = focal
    # k1 = kappa (f / half_diagonal)^2
    ways[7, LOG_FOCAL] = 2 * camera.distortion[0]
    ways[7, KAPPA] = (2 * focal / size.diagonal) ** 2
    return ways


def _lens_to_json(camera: Camera) -> dict[str, Any]:
    numbers = [float(value) for value in camera.distortion]
    if camera.is_wide:
        return {LENS: camera.lens, LENS_COEFFICIENTS: numbers}
    k1, k2, p1, p2, k3, k4, k5, k6, *prism = numbers
    return {
        "radial_distortion": [k1, k2, k3, k4, k5, k6],
        "tangential_distortion": [p1, p2],
        "thin_prism_distortion": prism,
    }


def camera_from_json(value: Any, path: str, record: str | None = None) -> Camera:
    """The camera of a SoccerNet camera object.

    The angles are authoritative; ``rotation_matrix`` may be missing and must agree when it is
    there. Missing distortion arrays are zero; a ``lens`` takes their place. The image size is not in the file and is not
    inferred. A camera below the grass is a camera: judging it is the solver's part.

    Args:
        value: The parsed JSON object.
        path: File as the user knows it, for the error.
        record: Name of the camera inside the file, for the error.

    Raises:
        DatasetFormatError: A field is missing, no number, or contradicts another.
    """
    if not isinstance(value, dict):
        raise DatasetFormatError(path, record, None, "is not a camera object")
    reader = _CameraFieldReader(value, path, record)
    rotation = _read_rotation(reader)
    lens, coefficients = _read_lens(reader)
    try:
        return Camera(
            rotation=rotation,
            position=np.array(reader.read_field("position_meters", _parse_three_numbers)),
            focal_length=(
                reader.read_field("x_focal_length", _parse_positive_number),
                reader.read_field("y_focal_length", _parse_positive_number),
            ),
            principal_point=reader.read_field("principal_point", _parse_two_numbers),
            skew=reader.read_field("skew", fields.parse_number) if "skew" in value else 0.0,
            distortion=np.array(coefficients),
            lens=lens,
        )
    except GeometryError as error:
        raise DatasetFormatError(path, record, None, error.message) from error


class _CameraFieldReader:
    """One camera object, read field by field."""

    def __init__(self, value: Mapping[str, Any], path: str, record: str | None):
        self.value, self.path, self.record = value, path, record

    def read_field(self, name: str, parse: Callable[[Any], T]) -> T:
        if name not in self.value:
            raise self.make_field_error(name, "is missing")
        try:
            return _require_plausible_magnitude(parse(self.value[name]))
        except ValueError as error:
            raise self.make_field_error(name, str(error)) from error

    def read_distortion(self, name: str, count: int) -> tuple[float, ...]:
        if self.value.get(name) is None:
            return (0.0,) * count
        return self.read_field(name, lambda value: fields.parse_numbers(value, count))

    def make_field_error(self, name: str, problem: str) -> DatasetFormatError:
        return DatasetFormatError(self.path, self.record, name, problem)


def _read_lens(reader: _CameraFieldReader) -> tuple[str, tuple[float, ...]]:
    """Name of the lens and its coefficients, in the order that the camera has them."""
    name = reader.value.get(LENS)
    if name is None or name == BROWN_CONRADY:
        if reader.value.get(LENS_COEFFICIENTS) is not None:
            raise reader.make_field_error(
                LENS_COEFFICIENTS, f"need a {LENS} that is one of {_list_lens_names()}"
            )
        radial, tangential, prism = (reader.read_distortion(*each) for each in _DISTORTION)
        k1, k2, k3, k4, k5, k6 = radial
        return BROWN_CONRADY, (k1, k2, *tangential, k3, k4, k5, k6, *prism)
    if not isinstance(name, str) or name not in LENSES:
        raise reader.make_field_error(
            LENS, f"must be {_list_lens_names()}, not {quote_text(str(name), 40)}"
        )
    for other, count in _DISTORTION:
        if any(reader.read_distortion(other, count)):
            raise reader.make_field_error(
                other, f"must be left out or zero, because the lens {name} has no such coefficients"
            )
    count = LENSES[name].count
    return name, reader.read_field(
        LENS_COEFFICIENTS, lambda value: fields.parse_numbers(value, count)
    )


def _list_lens_names() -> str:
    return " or ".join(name for name in LENSES if name != BROWN_CONRADY)


def _read_rotation(reader: _CameraFieldReader) -> FloatArray:
    pan, tilt, roll = (reader.read_field(name, fields.parse_number) for name in _ANGLES)
    rotation = rotation_from_pan_tilt_roll(*np.radians([pan, tilt, roll]))
    if reader.value.get("rotation_matrix") is None:
        return rotation
    matrix = np.array(reader.read_field("rotation_matrix", _parse_three_by_three_matrix))
    if float(np.abs(matrix - rotation).max()) < ROUNDING:
        # The same rotation: the matrix keeps the last digits that the angles lose, so what we
        # wrote comes back exactly.
        return matrix
    # The chord |A - B| of two rotations by an angle apart is 2 sqrt(2) sin(angle / 2).
    chord = float(np.linalg.norm(matrix - rotation))
    apart = float(np.degrees(2 * np.arcsin(min(chord / np.sqrt(8.0), 1.0))))
    if apart > MAX_DISAGREEMENT_DEGREES:
        problem = f"disagrees with pan, tilt and roll by {apart:.2g} degrees"
        raise reader.make_field_error("rotation_matrix", problem)
    return rotation


def _require_plausible_magnitude(value: T) -> T:
    if np.abs(np.asarray(value)).max() > MAX_NUMBER:
        raise ValueError(f"is larger than any camera has (at most {MAX_NUMBER:.0e})")
    return value


def _parse_positive_number(value: Any) -> float:
    result = fields.parse_number(value)
    if result <= 0:
        raise ValueError(f"is {result:g}; a focal length is positive")
    return result


def _parse_two_numbers(value: Any) -> tuple[float, float]:
    x, y = fields.parse_numbers(value, 2)
    return x, y


def _parse_three_numbers(value: Any) -> tuple[float, ...]:
    return fields.parse_numbers(value, 3)


def _parse_three_by_three_matrix(value: Any) -> list[tuple[float, ...]]:
    rows = fields.require_list(value)
    if len(rows) != 3:
        raise ValueError(f"has {len(rows)} rows, not 3")
    return [fields.parse_numbers(row, 3) for row in rows]
