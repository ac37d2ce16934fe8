"""The flight of ``flights`` filmed: a ball drawn into the pictures of static cameras, and few of its views annotated."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from app.geometry.camera import Camera
from app.soccer.group import Group, Media
from app.tracking.ball_follow import expected_ball_diameter
from app.video.frames import Image
from tests.drawn_balls import drawn, grass
from tests.flights import FIRST, flight_groups
from tests.rigs import TRUTH
from tests.videos import write_pictures

GROUND = grass(1280, 720)
NOISE = 3.0


def pictured(
    ground: Image, camera: Camera, center: tuple[float, float] | None, *, seed: int = 0
) -> Image:
    """A picture of grass with a ball as large as its camera shows it; None: without one."""
    picture = ground.astype(np.int16)
    noise = np.random.default_rng(seed).normal(0, NOISE, ground.shape[:2])
    picture += noise.round().astype(np.int16)[..., None]
    found = np.clip(picture, 0, 255).astype(np.uint8)
    if center is not None:
        x, y = center
        size = expected_ball_diameter(camera, x, y) or 8.0
        reach = int(2 * size) + 4
        left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
        part = found[top : int(y) + reach, left : int(x) + reach]
        shape = part.shape[1], part.shape[0]
        found[top : int(y) + reach, left : int(x) + reach] = drawn(
            [(x - left, y - top, size)], size=shape, ground=part, noise=0
        )
    return found


@cache
def centers(count: int, camera: str) -> dict[int, tuple[float, float]]:
    """Where the ball is in the pictures of a camera, by number of the frame."""
    found = {}
    for group in flight_groups(count, noise_px=0.0):
        view = group.view(camera)
        if view is not None and view.ball is not None and view.ball.center is not None:
            found[int(group.key)] = view.ball.center.x, view.ball.center.y
    return found


def filmed_groups(
    folder: Path,
    count: int,
    camera: str,
    *,
    said: Collection[int],
    others: bool = True,
    video: bool = False,
    hidden: Collection[int] = (),
) -> list[Group]:
    """Groups of the flight with the pictures of one camera.

    Args:
        folder: Where its pictures go.
        count: Frames.
        camera: Key of the camera.
        said: Frames in which its ball is annotated.
        others: Whether the other cameras have their balls.
        video: Whether the pictures are one video, and not a file each.
        hidden: Frames whose pictures show no ball.
    """
    numbers = range(FIRST, FIRST + count)
    files = {number: _file(count, camera, number, number in hidden) for number in numbers}
    media = _written(folder, camera, files, video)
    groups = flight_groups(count, noise_px=0.0)
    return [_with_pictures(group, camera, media, said, others) for group in groups]


@cache
def _file(count: int, camera: str, number: int, hidden: bool) -> bytes:
    """A picture as JPEG."""
    lens = TRUTH[camera]
    shown = None if hidden else centers(count, camera).get(number)
    picture = pictured(GROUND, lens, shown, seed=number)[:, :, ::-1]
    return bytes(cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1])


def _written(
    folder: Path, camera: str, files: Mapping[int, bytes], video: bool
) -> dict[int, Media]:
    if video:
        path = folder / f"{camera}.mp4"
        pictures = (cv2.imdecode(np.frombuffer(one, np.uint8), 1) for one in files.values())
        write_pictures(path, "mp4v", pictures)
        return {number: Media(str(path), frame=number - FIRST) for number in files}
    (folder / camera).mkdir(parents=True)
    found = {}
    for number, content in files.items():
        path = folder / camera / f"{number:06d}.jpg"
        path.write_bytes(content)
        found[number] = Media(str(path))
    return found


def _with_pictures(
    group: Group, camera: str, media: Mapping[int, Media], said: Collection[int], others: bool
) -> Group:
    number = int(group.key)
    views = []
    for view in group.views:
        if view.key != camera:
            views.append(view if others else replace(view, balls=()))
            continue
        balls = view.balls if number in said else ()
        views.append(replace(view, media=media[number], balls=balls))
    return replace(group, views=tuple(views))
