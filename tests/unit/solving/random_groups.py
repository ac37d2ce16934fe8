"""Random groups with given cameras, and policies near what decides about them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Station, View
from app.soccer.policy import PAPER, Policy
from app.soccer.solution import Calibration, MarkingFit, PaintFit
from tests.cameras import FULL_HD, looking


def random_views(seed: int) -> tuple[tuple[View, ...], list[Calibration]]:
    """One to five views of a ball, each with its calibration: some given, some uncertain."""
    rng = np.random.default_rng(seed)
    ball = rng.uniform([-40, -25, -6], [40, 25, 0])
    views, calibrations = [], []
    for place in range(rng.integers(1, 6)):
        camera = _random_camera(rng, ball)
        if place and rng.random() < 0.1:
            camera = views[0].station.given
        x, y = camera.project(ball[None])[0] + rng.normal(0, rng.choice([0.5, 10.0, 40.0]), 2)
        seen = BallAnnotation(box=Box(float(x) - 6, float(y) - 6, 12, 14))
        balls = ((seen,), (replace(seen, inferred=True),), ())[rng.choice(3, p=[0.8, 0.1, 0.1])]
        station = Station(f"v{place}", FULL_HD, given=camera)
        views.append(View(f"v{place}", station, balls, included=bool(rng.random() > 0.1)))
        calibrations.append(_random_calibration(rng, camera))
    return tuple(views), calibrations


def random_policy(seed: int) -> Policy:
    """Thresholds that let some of these groups through and stop some at each gate."""
    rng = np.random.default_rng(seed)
    return replace(
        PAPER,
        min_jac=float(rng.choice([0.0, 0.5, 0.75])),
        tau_percent=float(rng.choice([0.02, 0.3, 1.0, 5.0, 100.0])),
        min_baseline_m=float(rng.choice([0.0, 1.0, 80.0])),
        min_parallax_degrees=rng.choice([None, 20.0, 60.0]),
        max_sigma_m=rng.choice([None, 0.03, 0.1, 0.5]),
        min_p_value=rng.choice([None, 0.002, 0.2]),
        click_sigma_px=float(rng.choice([0.3, 1.0, 4.0])),
        box_sigma_share=float(rng.choice([0.0, 0.04, 0.2])),
        min_agreement=rng.choice([None, 0.3, 0.6]),
    )


def _random_camera(rng: np.random.Generator, ball: np.ndarray) -> Camera:
    angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(60, 110)
    place = np.array([far * np.cos(angle), far * np.sin(angle), -rng.uniform(5, 30)])
    focal = rng.uniform(1500, 4000)
    return looking(place, ball + rng.normal(0, 3, 3), focal, size=FULL_HD)


def _random_calibration(rng: np.random.Generator, camera: Camera) -> Calibration:
    if rng.random() < 0.4:
        return Calibration("given", camera)
    if rng.random() < 0.1:
        return Calibration("lines", None, "too few lines")
    root = rng.normal(0, [2e-4, 2e-4, 2e-4, 0.1, 0.1, 0.1, 1e-3, 1e-3], (12, 8))
    marks = [
        MarkingFit(str(mark), "tp", tuple(rng.uniform(0, 12, rng.integers(0, 4)).tolist()))
        for mark in range(rng.integers(0, 7))
    ]
    covariance = tuple((root.T @ root / 12).ravel().tolist())
    seen = rng.spawn(1)[0]
    paint = PaintFit(float(seen.random()), 0.8, 90) if seen.random() < 0.4 else None
    return Calibration(
        "lines",
        camera,
        jac=(0.5, 0.5, 0.5),
        markings=tuple(marks),
        covariance=covariance,
        paint=paint,
    )
