"""Synthetic stadium: cameras with known truth, and the clicks they would get."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, settings

from app.geometry.camera import Camera
from app.geometry.polyline import clip_polyline
from app.soccer.annotation import Lines, make_lines
from app.soccer.group import Group, Station, View
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch
from tests.balls import box_around
from tests.cameras import SIZE, looking

# ``make mutate`` runs a test several times in one process, each time from a new instance.
settings.register_profile(
    "mutate",
    deadline=None,
    derandomize=True,
    max_examples=10,
    suppress_health_check=[HealthCheck.differing_executors],
)

PITCH = Pitch()
BEND = 0.02
"""Of the lenses: what zoom lenses of broadcast cameras have."""


MAIN = looking((3.0, 62.0, -16.0), (34.0, -4.0, 0.0), 2200.0, bend=BEND)
BEHIND_GOAL = looking((78.0, -6.0, -9.0), (38.0, 2.0, 0.0), 1500.0, bend=BEND)
OPPOSITE = looking((20.0, -66.0, -14.0), (38.0, 2.0, 0.0), 2400.0, bend=BEND)


def click(camera: Camera, noise_px: float = 0.0, seed: int = 0, pitch: Pitch = PITCH) -> Lines:
    """Points on every visible marking, four a straight line and eight a circle."""
    generator = np.random.default_rng(seed)
    lines = {}
    for marking in MARKINGS:
        pixels = camera.project(pitch.sample(marking, 0.2, 0.05))
        visible = clip_polyline(pixels, SIZE.width, SIZE.height)
        if len(visible) < 10 or np.ptp(visible, axis=0).max() < 25:
            continue
        count = 8 if marking in CIRCLES else 4
        chosen = visible[np.linspace(0, len(visible) - 1, count).astype(int)]
        lines[marking] = chosen + generator.normal(0, noise_px, chosen.shape)
    return make_lines(lines)


def view(key: str, camera: Camera, point, *, noise_px: float = 0.0, seed: int = 0) -> View:
    station = Station(key, SIZE, lines=click(camera, noise_px, seed))
    return View(key, station, (box_around(camera, point),))


def given_view(key: str, camera: Camera, point) -> View:
    return View(key, Station(key, SIZE, given=camera), (box_around(camera, point),))


def group(*views: View, key: str = "g") -> Group:
    return Group(key, views)
