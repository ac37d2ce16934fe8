"""Spheres in an image: where a ball of known size is, and how large it appears."""

from __future__ import annotations

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray, cross, require_shape
from app.geometry.camera import Camera

_OUTLINE_POINTS = 64
_ANGLES = np.linspace(0, 2 * np.pi, _OUTLINE_POINTS, endpoint=False)[:, None]
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
_DOWN = np.array([0.0, 1.0, 0.0])


def position_from_diameter(
    camera: Camera, center: FloatArray, diameter_px: float, diameter_m: float
) -> FloatArray:
    """Centre of a sphere from the centre and diameter of its image, pitch frame, metres, (3,).

    Args:
        camera: The camera.
        center: Pixels as the image shows them, shape (2,).
        diameter_px: Vertical extent, pixels; through a wide lens the mean of width and height.
        diameter_m: True diameter, metres.

    Raises:
        DegenerateGeometryError: The diameter is not positive.

    Source: SoccerNet-v3D (arXiv 2504.10106), 3D ball localisation from its diameter; through a
        wide lens ``sphere_image_scale``.
    """
    center = require_shape(center, (2,), "center")
    if not diameter_px > 0:
        raise DegenerateGeometryError(
            "the diameter of a ball in the picture must be above 0 pixels"
        )
    if camera.is_wide:
        ideal = camera.pixel_to_ideal(center[None])[0]
        ray = camera.rotation.T @ np.append(ideal, 1.0)
        distance = diameter_m * sphere_image_scale(camera, ideal) / diameter_px
        return np.asarray(camera.position + distance / np.linalg.norm(ray) * ray)
    half = np.array([0.0, diameter_px / 2])
    ideal = camera.pixel_to_ideal(np.vstack([center, center + half, center - half]))
    apart = np.linalg.norm(ideal[1] - ideal[2])
    ray = np.append(ideal[0], 1.0)
    position: FloatArray = diameter_m / apart * (camera.rotation.T @ ray) + camera.position
    return position


def optimal_diameter(
    camera: Camera, center: FloatArray, point: FloatArray, diameter_m: float
) -> tuple[float, float]:
    """Image diameter whose monocular position lies nearest to a point, in closed form.

    With a = R^T p_c the nearest place on the ray is at lambda = a.(p - C) / a.a, and the
    diameter is that of a sphere there.

    Args:
        camera: The camera.
        center: Annotated centre, pixels as the image shows them, shape (2,).
        point: Pitch frame, metres, shape (3,).
        diameter_m: True diameter, metres.

    Returns:
        Diameter in pixels, and the distance of the point from the ray in metres.

    Raises:
        DegenerateGeometryError: The point lies behind the camera, or no ray goes through the centre.

    Source: closed form of the box optimisation of SoccerNet-v3D (arXiv 2504.10106); through a
        wide lens ``sphere_image_scale``.
    """
    center = require_shape(center, (2,), "center")
    ideal = camera.pixel_to_ideal(center[None])[0]
    ray = camera.rotation.T @ np.append(ideal, 1.0)
    offset = require_shape(point, (3,), "point") - camera.position
    depth = float(ray @ offset / (ray @ ray))
    if not np.isfinite(ideal).all():
        raise DegenerateGeometryError(
            "the centre of the ball lies outside the field of view of the lens"
        )
    if not depth > 0:
        raise DegenerateGeometryError("the point lies behind the camera")
    off_ray = float(np.linalg.norm(offset - depth * ray))
    if camera.is_wide:
        distance = depth * float(np.linalg.norm(ray))
        return diameter_m * sphere_image_scale(camera, ideal) / distance, off_ray
    # With skew, "vertical in the image" leans in normalised coordinates.
    upright = np.array([-camera.skew / camera.focal_length[0], 1.0])
    half = diameter_m / depth / 2 * upright / np.linalg.norm(upright)
    ends = _normalised_to_pixel(
        camera, camera.model.distort(np.vstack([ideal + half, ideal - half]), camera.distortion)
    )
    return float(np.hypot(*(ends[0] - ends[1]))), off_ray


def sphere_image_scale(camera: Camera, ideal: FloatArray) -> float:
    """Mean of width and height of a small sphere's image, pixels for each radian that it fills.

    A disc that is parallel to the image, which the paper measures a ball by, is seen from its
    edge at the rim of a wide lens; the outline of a sphere faces the camera everywhere. To first
    order it is the ellipse ``A u``, u a unit vector across the ray, and the sides of its box are
    the lengths of the rows of A.

    Args:
        camera: The camera.
        ideal: Ideal normalised coordinates of the centre, shape (2,).
    """
    x, y = ideal.tolist()
    # Derivative of the ideal coordinates by a point at distance 1; its null space is the ray.
    across = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]]) * np.sqrt(1 + x * x + y * y)
    bent = camera.model.jacobian(ideal[None], camera.distortion)[0]
    rows = camera.K[:2, :2] @ bent @ across
    return float(np.linalg.norm(rows, axis=1).mean())


def tight_box(camera: Camera, center: FloatArray, radius: float) -> FloatArray:
    """Tight box of a sphere's outline: left, top, right, bottom in pixels, shape (4,).

    Exact for a pinhole, from the dual conic of the outline; with distortion the bounds of 64
    points of it.

    Args:
        camera: The camera.
        center: Centre of the sphere, pitch frame, metres, shape (3,).
        radius: Metres.

    Raises:
        DegenerateGeometryError: The sphere does not lie wholly in front of the camera, or of
            a wide lens.

    Source: Hartley & Zisserman, result 8.6 for the dual of a projected quadric.
    """
    in_camera = camera.pitch_to_camera(require_shape(center, (3,), "center")[None])[0]
    if in_camera[2] <= radius:
        raise DegenerateGeometryError("the ball does not lie wholly in front of the camera")
    if camera.has_distortion:
        outline = camera.project(
            _outline_points(in_camera, radius) @ camera.rotation + camera.position
        )
        if camera.is_wide and np.isnan(outline).any():
            raise DegenerateGeometryError(
                "the ball does not lie wholly in the field of view of the lens"
            )
        return np.concatenate([outline.min(axis=0), outline.max(axis=0)])
    # A line l touches the outline when the plane K^T l is at distance r from the centre.
    dual = camera.K @ (np.outer(in_camera, in_camera) - radius**2 * np.eye(3)) @ camera.K.T
    middle = dual[:2, 2] / dual[2, 2]
    half = np.sqrt(dual[:2, 2] ** 2 - np.diag(dual)[:2] * dual[2, 2]) / dual[2, 2]
    return np.concatenate([middle - half, middle + half])


def _outline_points(center: FloatArray, radius: float) -> FloatArray:
    """Points of the circle where rays from the camera touch the sphere, camera frame, (64, 3)."""
    squared = float(center @ center)
    shrink = 1 - radius**2 / squared
    axis = center / np.sqrt(squared)
    across = cross(axis, _DOWN)
    across /= np.linalg.norm(across)
    up = cross(axis, across)
    circle = _COSINES * across + _SINES * up
    outline: FloatArray = center * shrink + radius * np.sqrt(shrink) * circle
    return outline


def _normalised_to_pixel(camera: Camera, points: FloatArray) -> FloatArray:
    return points @ camera.K[:2, :2].T + camera.K[:2, 2]
