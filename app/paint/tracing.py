"""Tracing: places along the painted markings of a pitch, as a camera shows them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.geometry.curve_residuals import (
    NEAR,
    distort_step,
    pitch_to_camera,
    radial_growth_factor,
    rotate_to_camera,
    unpack_camera,
    write_derivative_row,
)
from app.geometry.resection import parameters_from_camera
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.observations import pitch_curves

PAINTED = tuple(name for name in MARKINGS if not name.startswith("Goal"))
"""Markings that are paint on grass; a goal is none."""


@dataclass(frozen=True)
class TracedPlaces:
    """Places along the projected markings of one camera, a few pixels apart.

    Attributes:
        places: Pitch frame, metres, shape (N, 3).
        pixels: The middle of the paint there, shape (N, 2).
        normals: Unit normals of the markings in the picture, shape (N, 2).
        widths: Of the paint across, pixels, shape (N,).
        marking: Index into ``MARKINGS``, shape (N,), increasing.
        jacobian: Derivative along the normal by the camera's parameters, shape (N, 8).
        visible: Places in all, those too that were left out because their paint is too thin.
    """

    places: FloatArray
    pixels: FloatArray
    normals: FloatArray
    widths: FloatArray
    marking: IntArray
    jacobian: FloatArray
    visible: int

    def only(self, chosen: IntArray, visible: int) -> TracedPlaces:
        """Some of the places."""
        return TracedPlaces(
            self.places[chosen], self.pixels[chosen], self.normals[chosen],
            self.widths[chosen], self.marking[chosen], self.jacobian[chosen], visible,
        )  # fmt: skip


def trace_places(
    camera: Camera, pitch: Pitch, width: int, height: int, spacing_px: float, most: int
) -> TracedPlaces:
    """Places along the markings that lie in the picture, hidden ones too.

    Args:
        camera: Pixels of the picture; one focal length and one radial term count.
        pitch: The pitch.
        width: Of the picture, pixels, like ``height``.
        spacing_px: Between places.
        most: After so many no more are looked for.
    """
    curves, half = pitch_curves(pitch), float(np.hypot(width, height)) / 2
    places, pixels, normals = (np.empty((most, n)) for n in (3, 2, 2))
    widths, marking, rows = np.empty(most), np.empty(most, np.int64), np.empty((most, 8))
    count = trace_markings(
        parameters_from_camera(camera, half), curves.kinds, curves.shapes, which_markings_are_painted(),
        np.array(camera.principal_point), half, width, height, spacing_px,
        places, pixels, normals, widths, marking, rows,
    )  # fmt: skip
    written = slice(count)
    return TracedPlaces(
        places[written], pixels[written], normals[written],
        widths[written], marking[written], rows[written], count,
    )  # fmt: skip


@lru_cache(maxsize=1)
def which_markings_are_painted() -> BoolArray:
    return np.array([name in PAINTED for name in MARKINGS])


compiled = njit(cache=True, nogil=True, error_model="numpy")

SEGMENT = 0
STEP_M, ARC_STEP_M = 0.7, 0.35
"""Metres between the places that are projected first."""
PAINT_WIDTH_M = 0.12


@compiled
def trace_markings(
    parameters, kinds, shapes, chosen, principal, half_diagonal, width, height, spacing,
    places, pixels, normals, widths, marking, rows,
):  # fmt: skip
    """Writes places along the markings that lie in the picture; returns how many.

    Args:
        parameters: The camera, see ``geometry.resection``, shape (8,).
        kinds: Of the curves, shape (M,); ``shapes``: shape (M, 6).
        chosen: Which curves are followed, shape (M,).
        principal: Principal point, pixels, shape (2,).
        spacing: Between places, pixels.
        places: Result, pitch frame, shape (N, 3).
        pixels: Result: middle of the paint as seen, shape (N, 2).
        normals: Result: unit normal of the marking in the picture, shape (N, 2).
        widths: Result: of the paint across, pixels, shape (N,).
        marking: Result: index of the curve, shape (N,).
        rows: Result: derivative of the place along the normal by the parameters, shape (N, 8).
    """
    camera = unpack_camera(parameters, half_diagonal)
    x0, y0 = principal[0], principal[1]
    derivatives = np.empty((1, 2, 8))
    count = 0
    for m in range(len(kinds)):
        if not chosen[m]:
            continue
        shape = shapes[m]
        if kinds[m] == SEGMENT:
            length = np.sqrt((shape[3] - shape[0]) ** 2 + (shape[4] - shape[1]) ** 2)
            steps = int(length / STEP_M) + 1
        else:
            steps = int(shape[2] * (shape[4] - shape[3]) / ARC_STEP_M) + 1
        carried = 0.5 * spacing
        last_x, last_y, was_seen = 0.0, 0.0, False
        for k in range(steps + 1):
            place = point_at_fraction(kinds[m], shape, k / steps)
            x, y, seen = _project_to_pixel(camera, x0, y0, place[0], place[1], place[2])
            # Far outside nothing is followed; the margin keeps steps that enter the picture.
            seen = seen and -width < x < 2 * width and -height < y < 2 * height
            if seen and was_seen:
                apart = np.sqrt((x - last_x) ** 2 + (y - last_y) ** 2)
                at = spacing - carried
                while at <= apart:
                    share = (k - 1 + at / apart) / steps
                    place = point_at_fraction(kinds[m], shape, share)
                    if _write_traced_place(
                        camera, x0, y0, place, width, height, m, count, derivatives,
                        places, pixels, normals, widths, marking, rows,
                    ):  # fmt: skip
                        count += 1
                        if count == len(places):
                            return count
                    at += spacing
                carried = apart - (at - spacing)
            elif seen:
                carried = 0.5 * spacing
            last_x, last_y, was_seen = x, y, seen
    return count


@compiled
def point_at_fraction(kind, shape, share):
    """The place of a curve at a share of its length, and the direction along it, six numbers."""
    if kind == SEGMENT:
        ax, ay, az = shape[3] - shape[0], shape[4] - shape[1], shape[5] - shape[2]
        return shape[0] + share * ax, shape[1] + share * ay, shape[2] + share * az, ax, ay, az
    angle = shape[3] + share * (shape[4] - shape[3])
    sine, cosine, radius = np.sin(angle), np.cos(angle), shape[2]
    return (
        shape[0] + radius * cosine, shape[1] + radius * sine, 0.0,
        -radius * sine, radius * cosine, 0.0,
    )  # fmt: skip


@compiled
def _project_to_pixel(camera, x0, y0, x, y, z):
    x, y, z = pitch_to_camera(camera, x, y, z)
    if z < NEAR:
        return 0.0, 0.0, False
    px, py = camera[12] * x / z, camera[12] * y / z
    growth = radial_growth_factor(camera[13] * (px * px + py * py))
    return x0 + px * growth, y0 + py * growth, True


@compiled
def _project_direction(camera, place, vx, vy):
    """How a step on the grass looks in the picture, pixels a metre."""
    ux, uy, uz = pitch_to_camera(camera, place[0], place[1], place[2])
    wx, wy, wz = rotate_to_camera(camera, vx, vy, 0.0)
    focal, kappa = camera[12], camera[13]
    nx, ny = ux / uz, uy / uz
    px, py = focal * nx, focal * ny
    ix, iy = focal * (wx - nx * wz) / uz, focal * (wy - ny * wz) / uz
    _, sx, sy = distort_step(kappa, px, py, ix, iy)
    return sx, sy


@compiled
def _write_traced_place(
    camera, x0, y0, place, width, height, m, n, derivatives,
    places, pixels, normals, widths, marking, rows,
):  # fmt: skip
    """Writes one place; False where it lies outside the picture."""
    x, y, seen = _project_to_pixel(camera, x0, y0, place[0], place[1], place[2])
    if not (seen and 0 <= x <= width - 1 and 0 <= y <= height - 1):
        return False
    length = np.sqrt(place[3] ** 2 + place[4] ** 2)
    tx, ty = place[3] / length, place[4] / length
    gx, gy = _project_direction(camera, place, tx, ty)
    size = np.sqrt(gx * gx + gy * gy)
    if size < 1e-9:
        return False
    nx, ny = -gy / size, gx / size
    half = 0.5 * PAINT_WIDTH_M
    ax, ay = half * ty, half * tx
    lx, ly, left_seen = _project_to_pixel(camera, x0, y0, place[0] - ax, place[1] + ay, place[2])
    rx, ry, right_seen = _project_to_pixel(camera, x0, y0, place[0] + ax, place[1] - ay, place[2])
    if not (left_seen and right_seen):
        return False
    across = abs(nx * (lx - rx) + ny * (ly - ry))
    # The middle between both edges as seen is not quite the image of the middle.
    middle = nx * (0.5 * (lx + rx) - x) + ny * (0.5 * (ly + ry) - y)
    dx, dy, dz = place[0] - camera[9], place[1] - camera[10], place[2] - camera[11]
    write_derivative_row(camera, dx, dy, dz, derivatives, 0)
    places[n, 0], places[n, 1], places[n, 2] = place[0], place[1], place[2]
    pixels[n, 0], pixels[n, 1] = x + middle * nx, y + middle * ny
    normals[n, 0], normals[n, 1] = nx, ny
    widths[n] = across
    marking[n] = m
    for k in range(8):
        rows[n, k] = nx * derivatives[0, 0, k] + ny * derivatives[0, 1, k]
    return True
