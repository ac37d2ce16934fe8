"""Cameras of Spiideo SoccerNet SynLoc: an image record of its COCO files, read.

``camera_matrix`` takes a point of its pitch frame (metres, origin at the centre mark, x across, y along
the length, z up) to the camera; ``dist_poly`` is a polynomial of the angle off the axis, the highest
term first, in units of the image width. ``undist_poly`` is a fit to its inverse, and is not read: the
polynomial itself is inverted, to the last digit.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from app.errors import DatasetFormatError, GeometryError
from app.formats import fields
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.fisheye import ARCTAN_POLYNOMIAL as TERMS
from app.geometry.lens import ARCTAN_POLYNOMIAL
from app.soccer.frames import MAX_SIDE

MATRIX, POLYNOMIAL = "camera_matrix", "dist_poly"
MAX_SKEWNESS = 1e-3
"""How far the rows of a matrix may be from a rotation's; the files have single precision."""
_TO_PITCH = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Their pitch frame to ours: x along the length, z down."""


def is_synloc_image_record(value: Any) -> bool:
    """Whether a value is an image record with a camera."""
    return isinstance(value, dict) and MATRIX in value and POLYNOMIAL in value


def index_image_records(value: Mapping[str, Any]) -> dict[str, Any] | None:
    """The records of a COCO file by stem; None where it has no cameras."""
    images = value.get("images")
    if not isinstance(images, list) or not any(map(is_synloc_image_record, images)):
        return None
    return {
        PurePosixPath(str(item.get("file_name", place))).stem: item
        for place, item in enumerate(images)
        if isinstance(item, dict)
    }


def camera_from_synloc(value: Mapping[str, Any], path: str, record: str | None) -> Camera:
    """The camera of an image record.

    Args:
        value: The record, with ``width`` and ``height``.
        path: File as the user knows it, for the error.
        record: Name of the image, for the error.

    Raises:
        DatasetFormatError: A field is missing, no number, or makes no camera.
    """
    name = MATRIX
    try:
        matrix = np.array(
            [fields.parse_numbers(row, 4) for row in _require_three_rows(value.get(MATRIX))]
        )
        rotation, position = _decompose_pose_matrix(matrix)
        name = POLYNOMIAL
        terms = _parse_polynomial_terms(value.get(POLYNOMIAL))
        name = "width"
        width = _read_side_length(value.get(name))
        name = "height"
        height = _read_side_length(value.get(name))
    except ValueError as error:
        raise DatasetFormatError(path, record, name, str(error)) from error
    try:
        return Camera(
            rotation=rotation,
            position=position,
            focal_length=(float(width), float(width)),
            principal_point=((width - 1) / 2, (height - 1) / 2),
            distortion=terms,
            lens=ARCTAN_POLYNOMIAL,
        )
    except GeometryError as error:
        raise DatasetFormatError(path, record, POLYNOMIAL, error.message) from error


def _require_three_rows(value: Any) -> list[Any]:
    rows = fields.require_list(value)
    if len(rows) != 3:
        raise ValueError(f"has {len(rows)} rows, not 3")
    return rows


def _decompose_pose_matrix(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Rotation, pitch to camera, and position in our pitch frame of ``s [R | -R C]``."""
    scale = np.cbrt(np.linalg.det(matrix[:, :3]))
    if not np.isfinite(scale) or scale == 0:
        raise ValueError("is singular, so the camera has no position")
    found = matrix / scale
    left, _, right = np.linalg.svd(found[:, :3])
    rotation = left @ right
    if np.abs(rotation - found[:, :3]).max() > MAX_SKEWNESS:
        raise ValueError("is not a rotation and a translation, [R | t], up to scale")
    position = -rotation.T @ found[:, 3]
    return rotation @ _TO_PITCH.T, _TO_PITCH @ position


def _parse_polynomial_terms(value: Any) -> FloatArray:
    """The polynomial's terms, the constant one first."""
    listed = fields.require_list(value)
    if not 2 <= len(listed) <= TERMS:
        raise ValueError(f"has {len(listed)} terms, not 2 to {TERMS}")
    terms = np.zeros(TERMS)
    terms[: len(listed)] = fields.parse_numbers(listed, len(listed))[::-1]
    return terms


def _read_side_length(value: Any) -> int:
    side = fields.parse_whole_number(value)
    if not 2 <= side <= MAX_SIDE:
        raise ValueError(f"is {side} pixels, not 2 to {MAX_SIDE:,}")
    return side
