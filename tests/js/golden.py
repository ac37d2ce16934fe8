"""The numbers that server and browser must agree on: ``python -m tests.js.golden`` writes them.

Cameras travel as the API sends them, so that the browser's reading of a camera is tested too.
tests/js/golden.test.mjs holds the browser to the file, tests/integration/test_golden.py the server.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import DegenerateGeometryError
from app.features.groups.solution_schemas import SolutionDocument
from app.features.queue.fields import FIELDS
from app.features.queue.routes import QueryFieldDocument
from app.formats.camera_json import camera_to_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.lens import ARCTAN_POLYNOMIAL as ARCTAN
from app.geometry.lens import BROWN_CONRADY, FISHEYE, LENSES
from app.geometry.sphere import optimal_diameter, tight_box
from app.geometry.triangulation import parallax_angle, triangulate_pairs
from app.sample.scene import Scene
from app.soccer.annotation import BallAnnotation
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.scenes import make_scenes

FILE = Path(__file__).with_name("golden.json")
SEED = 4
DIAMETER = PAPER.ball_diameter_m
FULL = (-0.21, 0.06, 0.0011, -0.0007, -0.004, 0.01, 0.002, 0.0, 0.0004, -0.0002, 0.0003, 0.0001)
KANNALA_BRANDT = (0.021, -0.017, 0.006, -0.0011)
# Of the order of a real one's, with the constant that its fit left.
POLYNOMIAL = (-7.1e-4, 0.769, -0.119, 0.251, -0.408, 0.037, 0.268, -0.181, 0.037)


def golden() -> dict[str, Any]:
    """Everything in the file."""
    cameras = _cameras()
    points = _points()
    return {
        "ball_diameter_m": DIAMETER,
        "query_fields": [QueryFieldDocument.model_validate(item).model_dump() for item in FIELDS],
        "cameras": {name: camera_to_json(camera) for name, camera in cameras.items()},
        "projections": [_projection(name, cameras[name], points) for name in cameras],
        "triangulations": _triangulations(cameras, points),
        "boxes": [box for name in cameras for box in _boxes(name, cameras[name], points)],
        "groups": [_solved(scene) for scene in make_scenes(2, SEED, faults=False)],
    }


def _camera(
    angles: tuple[float, float, float],
    position: tuple[float, float, float],
    focal_length: tuple[float, float],
    skew: float = 0.0,
    distortion: tuple[float, ...] = (),
    lens: str = BROWN_CONRADY,
) -> Camera:
    coefficients = np.zeros(LENSES[lens].count)
    coefficients[: len(distortion)] = distortion
    return Camera(
        rotation=rotation_from_pan_tilt_roll(*np.radians(angles)),
        position=np.array(position),
        focal_length=focal_length,
        principal_point=(639.5, 359.5),
        skew=skew,
        distortion=coefficients,
        lens=lens,
    )


def _cameras() -> dict[str, Camera]:
    """A pinhole, one with skew, two lenses of one term, one with every term, and two wide ones."""
    return {
        "pinhole": _camera((8.0, 78.0, 0.3), (1.5, 60.0, -12.0), (2100.0, 2100.0)),
        "skewed": _camera((-21.0, 80.0, -0.5), (-8.0, 55.0, -14.0), (1700.0, 1690.0), 2.5),
        "pincushion": _camera(
            (30.0, 75.0, 0.0), (20.0, 58.0, -16.0), (1500.0, 1500.0), 0.0, (0.06,)
        ),
        "barrel": _camera((-88.0, 84.0, 0.8), (74.0, 3.0, -7.0), (1300.0, 1300.0), 0.0, (-0.24,)),
        "full": _camera((168.0, 79.0, 0.4), (6.0, -52.0, -10.0), (1400.0, 1405.0), -1.2, FULL),
        "fisheye": _camera(
            (2.0, 62.0, 0.5), (-2.0, 41.0, -9.0), (420.0, 424.0), 0.7, KANNALA_BRANDT, FISHEYE
        ),
        "panorama": _camera(
            (181.0, 66.0, -0.4), (3.0, -40.0, -12.0), (1280.0, 1280.0), 0.0, POLYNOMIAL, ARCTAN
        ),
    }


def _points() -> FloatArray:
    """Places of the ball and corners of the pitch; no camera sees all of them."""
    random = np.random.default_rng(SEED)
    low, high = np.array([-40.0, -25.0, -9.0]), np.array([50.0, 25.0, -0.113])
    balls = random.uniform(low, high, size=(16, 3))
    corners = np.array([[x, y, 0.0] for x in (-52.5, 0.0, 52.5) for y in (-34.0, 0.0, 34.0)])
    return np.vstack([balls, corners])


def _projection(name: str, camera: Camera, points: FloatArray) -> dict[str, Any]:
    pixels = camera.project(points)
    seen = ~np.isnan(pixels[:, 0])
    return {
        "camera": name,
        "points": points.tolist(),
        "pixels": [pixel.tolist() if ok else None for pixel, ok in zip(pixels, seen, strict=True)],
        "ideal_pixels": [
            camera.undistort(pixel[None])[0].tolist() if ok else None
            for pixel, ok in zip(pixels, seen, strict=True)
        ],
    }


def _triangulations(cameras: dict[str, Camera], points: FloatArray) -> list[dict[str, Any]]:
    """Every pair of cameras on balls that both see, each click a few pixels off."""
    random = np.random.default_rng(SEED + 1)
    found = []
    names = list(cameras)
    for i, a in enumerate(names):
        for b in names[i + 1 :]:
            # The file stays small: wide lenses meet each other and the pinhole.
            if cameras[b].is_wide and not (cameras[a].is_wide or a == "pinhole"):
                continue
            for point in points[:16]:
                pixels = [cameras[name].project(point[None])[0] for name in (a, b)]
                clicks = [pixel + random.normal(0.0, 2.0, 2) for pixel in pixels]
                if all(_within(click) for click in clicks):
                    found.append(_pair(cameras, (a, b), clicks))
    return found


def _within(pixel: FloatArray) -> bool:
    """Whether the picture shows it; a NaN is nowhere."""
    return bool(0 <= pixel[0] < 1280 and 0 <= pixel[1] < 720)


def _pair(
    cameras: dict[str, Camera], names: tuple[str, str], clicks: list[FloatArray]
) -> dict[str, Any]:
    a, b = (cameras[name] for name in names)
    ideal = [camera.undistort(click[None]) for camera, click in zip((a, b), clicks, strict=True)]
    point = triangulate_pairs(a.P[None], b.P[None], ideal[0], ideal[1])
    return {
        "cameras": names,
        "pixels": [click.tolist() for click in clicks],
        "point": point[0].tolist(),
        "reprojected": [camera.project(point)[0].tolist() for camera in (a, b)],
        "parallax_degrees": float(
            np.degrees(parallax_angle(a.position[None], b.position[None], point)[0])
        ),
    }


def _boxes(name: str, camera: Camera, points: FloatArray) -> list[dict[str, Any]]:
    """The optimised and the exact box of balls in the picture, clicked beside their centre."""
    found = []
    for point in points[:16]:
        pixel = camera.project(point[None])[0]
        if not _within(pixel):
            continue
        center = pixel + np.array([1.25, -0.75])
        try:
            diameter, distance = optimal_diameter(camera, center, point, DIAMETER)
            left, top, right, bottom = tight_box(camera, point, DIAMETER / 2).tolist()
        except DegenerateGeometryError:
            continue
        found.append(
            {
                "camera": name,
                "point": point.tolist(),
                "center": center.tolist(),
                "diameter": diameter,
                "distance": distance,
                "exact_box": [left, top, right - left, bottom - top],
            }
        )
    return found


def _solved(scene: Scene) -> dict[str, Any]:
    """A whole group as the API shows it, without what is only drawn."""
    group = scene.group
    document = SolutionDocument.of(solve_group(group, PAPER), group).model_dump(mode="json")
    for view in document["views"]:
        view["calibration"]["markings"] = []
        # Seventy numbers a camera, of which the browser reads none.
        view["calibration"]["camera"].pop("covariance")
    kept = ("views", "pairs", "ball")
    return {
        "policy": {
            "tau_percent": PAPER.tau_percent,
            "min_baseline_m": PAPER.min_baseline_m,
            "ball_diameter_m": DIAMETER,
        },
        "views": [
            {
                "key": view.key,
                "width": view.size.width,
                "height": view.size.height,
                "included": view.included,
                "lines": {},
                "balls": [_ball(ball) for ball in view.balls],
            }
            for view in group.views
        ],
        "solution": {name: document[name] for name in kept} | {"gates": [], "findings": []},
    }


def _ball(ball: BallAnnotation) -> dict[str, Any]:
    return {
        "box": None if ball.box is None else list(vars(ball.box).values()),
        "point": ball.point,
        "occluded": ball.occluded,
        "out_of_view": ball.out_of_view,
    }


def main() -> None:
    """Write the file."""
    FILE.write_text(json.dumps(golden(), separators=(",", ":")) + "\n", "utf-8")


if __name__ == "__main__":
    main()
