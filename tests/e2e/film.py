"""A short film by six static cameras, as an ISSIA folder: most frames fit, three do not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from app.formats.camera_json import camera_to_json
from app.geometry.camera import Camera
from app.soccer.pitch import MARKINGS, Pitch
from tests.cameras import FULL_HD, looking

FRAMES = range(100, 140)
SEEN_BY_TWO = range(130, 133)
"""Frames that two cameras see alone, which then disagree."""
WORST = 131
OFFSET = 8
"""The numbers in the files run ahead of the video's by this much."""
STANDS = (
    ((-34.0, 88.0, -20.0), (-34.0, 0.0, 0.0)),
    ((-34.0, -88.0, -20.0), (-34.0, 0.0, 0.0)),
    ((2.0, 90.0, -21.0), (0.0, 0.0, 0.0)),
    ((-2.0, -90.0, -21.0), (0.0, 0.0, 0.0)),
    ((34.0, 88.0, -20.0), (34.0, 0.0, 0.0)),
    ((34.0, -88.0, -20.0), (34.0, 0.0, 0.0)),
)
FOCAL = 1500.0


def camera(stand: int) -> Camera:
    """The camera of a stand, without roll and lens."""
    return looking(*STANDS[stand], FOCAL, size=FULL_HD)


def ball(frame: int) -> tuple[float, float, float]:
    """Where the ball is: a high pass along the pitch."""
    share = (frame - FRAMES.start) / len(FRAMES)
    return (-12.0 + 24.0 * share, 4.0 * share, -0.2 - 20.0 * share * (1 - share))


def write_film(folder: Path) -> Path:
    """The folder with tracks, given cameras and field lines of six cameras."""
    (folder / "truth").mkdir(parents=True)
    (folder / "lines").mkdir()
    cameras = {}
    for stand in range(len(STANDS)):
        name = f"cam{stand + 1}"
        cameras[name] = camera_to_json(camera(stand))
        (folder / "truth" / f"ground_truth_{stand + 1}.xgtf").write_text(_track(stand))
        (folder / "lines" / f"{name}.json").write_text(json.dumps(_lines(stand)))
    (folder / "issia_calibration.json").write_text(json.dumps({"cameras": cameras}))
    return folder


def _track(stand: int) -> str:
    points = []
    for frame in FRAMES:
        if frame in SEEN_BY_TWO and stand > 1:
            continue
        ((x, y),) = camera(stand).project(np.array([ball(frame)]))
        # The ball of these frames is not the ball that the other camera sees.
        off = (280.0 if frame == WORST else 160.0) if frame in SEEN_BY_TWO and stand == 1 else 0.0
        shown = frame + OFFSET
        points.append(
            f'<data:point framespan="{shown}:{shown}" x="{round(x + off)}" y="{round(y)}"/>'
        )
    return (
        '<viper xmlns="http://lamp.cfar.umd.edu/viper#"'
        ' xmlns:data="http://lamp.cfar.umd.edu/viperdata#"><data><sourcefile>'
        '<object name="BALL" id="0"><attribute name="BallPos">'
        f"{''.join(points)}</attribute></object></sourcefile></data></viper>"
    )


def _lines(stand: int) -> dict[str, list[dict[str, float]]]:
    """What a careful person would click on: about six points a marking."""
    lines = {}
    for marking in MARKINGS:
        pixels = camera(stand).project(Pitch().sample(marking, 0.9, 0.2))
        inside = [
            {"x": round(float(x), 2), "y": round(float(y), 2)}
            for x, y in pixels
            if 3 <= x < FULL_HD.width - 3 and 3 <= y < FULL_HD.height - 3
        ]
        if len(inside) > 1:
            lines[marking] = inside[:: max(len(inside) // 6, 1)]
    return lines
