"""A rig for tests: four static cameras around a pitch, balls over time, and cameras that are off."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from app.geometry.camera import Camera
from app.geometry.resection import camera_from_parameters, parameters_from_camera
from app.soccer.annotation import BallAnnotation, Lines, make_lines
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.pitch import MARKINGS, Pitch
from app.solving.rig import RigCamera, RigFrame
from tests.cameras import SIZE, looking

TRUTH = {
    "cam1": looking((-10.0, 90.0, -21.0), (-8.0, 0.0, 0.0), 1500.0, bend=0.01),
    "cam2": looking((-12.0, -88.0, -20.0), (-8.0, 0.0, 0.0), 1500.0, bend=0.01),
    "cam3": looking((25.0, 90.0, -21.0), (15.0, 0.0, 0.0), 1500.0),
    "cam4": looking((28.0, -88.0, -20.0), (15.0, 0.0, 0.0), 1500.0, bend=-0.005),
}
WRONG = np.array(
    [
        (0.004, -0.002, 0.001, 0.6, -0.8, 0.3, 0.01, 0.0),
        (-0.003, 0.003, -0.002, -0.5, 0.9, -0.4, -0.01, 0.0),
        (0.002, 0.002, 0.001, 0.3, 0.7, 0.2, -0.005, 0.0),
        (-0.004, -0.002, 0.002, 0.4, -0.5, 0.5, 0.008, 0.0),
    ]
)
"""What is added to the parameters of the true cameras: a few pixels in the picture."""


def off(camera: Camera, by: np.ndarray) -> Camera:
    """A camera with other parameters."""
    parameters = parameters_from_camera(camera, SIZE.diagonal / 2) + by
    return camera_from_parameters(parameters, camera.principal_point, SIZE.diagonal / 2)


GIVEN = {key: off(camera, by) for (key, camera), by in zip(TRUTH.items(), WRONG, strict=True)}


def clicked(camera: Camera, noise_px: float, generator: np.random.Generator) -> Lines:
    """Four points of every marking that a camera shows."""
    lines = {}
    for marking in MARKINGS:
        pixels = camera.project(Pitch().sample(marking, 0.5, 0.2))
        inside = pixels[((pixels >= 0) & (pixels < (SIZE.width, SIZE.height))).all(axis=1)]
        if len(inside) >= 4:
            chosen = inside[np.linspace(0, len(inside) - 1, 4).astype(int)]
            lines[marking] = chosen + generator.normal(0, noise_px, chosen.shape)
    return make_lines(lines)


def cameras(
    noise_px: float = 1.0, seed: int = 0, lines: bool = True, given: Mapping[str, Camera] = GIVEN
) -> list[RigCamera]:
    """The cameras as they are thought to stand, with lines as the true ones show them."""
    generator = np.random.default_rng(seed)
    return [
        RigCamera(key, SIZE, clicked(TRUTH[key], noise_px, generator) if lines else {}, camera)
        for key, camera in given.items()
    ]


def flight(times: np.ndarray) -> np.ndarray:
    """Where the ball is at times (frames), now on the grass and now in the air, shape (N, 3)."""
    t = times / 25.0
    x, y = 3.0 + 14.0 * np.sin(0.9 * t), 14.0 * np.sin(1.3 * t + 1.0)
    return np.column_stack([x, y, -0.11 - 4.0 * np.maximum(0.0, np.sin(2.1 * t))])


def frames(
    count: int = 200, noise_px: float = 0.5, seed: int = 1, ahead: Mapping[str, float] = {}
) -> list[RigFrame]:
    """Balls as the true cameras show them; ``ahead``: by how many
    frames; frame t of such a camera shows the instant of frame t + ahead of the others.
    """
    generator = np.random.default_rng(seed)
    times = np.arange(count)
    balls: list[dict[str, ImagePoint]] = [{} for _ in times]
    for key, camera in TRUTH.items():
        pixels = camera.project(flight(times + ahead.get(key, 0.0)))
        pixels += generator.normal(0, noise_px, pixels.shape)
        for place, (x, y) in enumerate(pixels.tolist()):
            if 0 <= x < SIZE.width and 0 <= y < SIZE.height:
                balls[place][key] = ImagePoint(x, y)
    return [RigFrame(int(time), seen) for time, seen in zip(times, balls, strict=True)]


def groups(count: int) -> list[Group]:
    """The instants of so many frames that show a ball, from cameras that are given."""
    stations = {c.key: Station(c.key, SIZE, shared=True, given=c.camera) for c in cameras()}
    return [
        Group(
            str(frame.time),
            tuple(
                View(key, stations[key], (BallAnnotation(point=center),))
                for key, center in frame.balls.items()
            ),
        )
        for frame in frames(count)
        if frame.balls
    ]
