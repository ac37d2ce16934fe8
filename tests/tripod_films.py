"""Films of the sample's stadium, taken by a camera on a tripod whose every pose is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from app.geometry.camera import Camera
from app.geometry.resection import LOG_FOCAL, PAN, camera_from_parameters, parameters_from_camera
from app.sample.render import render_view
from app.sample.scene import Scene
from tests.scenes import make_scenes

FRAMES = 10
PAN_DEGREES, ZOOM = 0.35, 1.005
"""A frame."""


@dataclass(frozen=True)
class Film:
    """A film and the truth of its frames."""

    images: list[np.ndarray]
    cameras: list[Camera]

    def write(self, folder: Path, images: list[np.ndarray] | None = None) -> Path:
        """A file of it, or of other pictures in its place."""
        path = folder / "film.avi"
        images = self.images if images is None else images
        height, width = images[0].shape[:2]
        video = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 25, (width, height))
        assert video.isOpened()
        for image in images:
            video.write(image)
        video.release()
        return path

    def off_px(self, number: int, camera: Camera) -> float:
        """How far a camera lays the grass of a frame from where it is, the most of a grid."""
        truth = self.cameras[number]
        height, width = self.images[number].shape[:2]
        grid = np.stack(np.meshgrid(np.linspace(0, width, 9), np.linspace(0, height, 7)), -1)
        pixels = grid.reshape(-1, 2)
        ground = truth.project_to_ground(pixels)
        inside = np.isfinite(ground).all(axis=1) & (np.abs(ground) < (52.5, 34)).all(axis=1)
        places = np.column_stack([ground[inside], np.zeros(inside.sum())])
        return float(np.hypot(*(camera.project(places) - pixels[inside]).T).max())


def pose_scene(scene: Scene, camera: Camera) -> Scene:
    main, *others = scene.truth.views
    return replace(scene, truth=replace(scene.truth, views=(replace(main, camera=camera), *others)))


def render_film(frames: int = FRAMES) -> Film:
    """A pan with a zoom, 1280 x 720."""
    scene = make_scenes(1, 1, faults=False)[0]
    view = scene.group.views[0]
    truth = scene.truth.view(view.key)
    assert truth is not None
    start = truth.camera
    half = view.size.diagonal / 2
    cameras, images = [], []
    for number in range(frames):
        parameters = parameters_from_camera(start, half)
        parameters[PAN] += np.radians(PAN_DEGREES) * number
        parameters[LOG_FOCAL] += np.log(ZOOM) * number
        camera = camera_from_parameters(parameters, start.principal_point, half)
        cameras.append(camera)
        images.append(render_view(pose_scene(scene, camera), view.key))
    return Film(images, cameras)
