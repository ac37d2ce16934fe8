"""Small groups, cameras and files of our own in the quirky shapes of the real ones."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from app.formats.export_record import ExportRecord
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.frames import Box, ImagePoint, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.solution import (
    Ball3D,
    BallFit,
    Calibration,
    Solution,
    TriangulatedPair,
    ViewSolution,
)
from tests.cameras import EVERY_COEFFICIENT

# The same examples every time, and no clock: other work on the machine is not our failure.
settings.register_profile("datasets", deadline=None, derandomize=True)
settings.load_profile("datasets")

MATCH = "north_league/2030-2031/2030-08-17 - 18-00 Alder Town 3 - 1 Birch Rovers"
SIZE = ImageSize(1280, 720)


@pytest.fixture
def report() -> ReaderReport:
    return ReaderReport()


@pytest.fixture
def camera() -> Camera:
    return EVERY_COEFFICIENT


@pytest.fixture
def camera_json() -> dict[str, Any]:
    """A camera as the sn-calibration writer leaves it: no matrix, no distortion arrays."""
    return {
        "pan_degrees": 12.3,
        "tilt_degrees": 78.9,
        "roll_degrees": -0.4,
        "x_focal_length": 2100.5,
        "y_focal_length": 2099.25,
        "principal_point": [639.5, 359.5],
        "position_meters": [1.25, 61.5, -18.75],
    }


def _image(**changes: Any) -> dict[str, Any]:
    value = {
        "imageMetadata": {
            "width": 1280,
            "height": 720,
            "set": "train",
            "gameTime": "1 - 12:41",
            "position": "761000",
        },
        "bboxes": [
            {"class": "Ball", "ID": None, "points": {"x1": 610, "y1": 300, "x2": 622, "y2": 311}},
            {
                "class": "Player team left",
                "ID": "10",
                "points": {"x1": 100, "y1": 200, "x2": 140, "y2": 290},
            },
        ],
        "lines": [
            {"class": "Goal left post left ", "points": [20, 100, 22, 160.5]},
            {"class": "Side line top", "points": [0, 80, 640, 82, 1279, 85]},
            {"class": None, "points": [1, 2, 3, 4]},
        ],
    }
    return value | changes


@pytest.fixture
def image() -> Callable[..., dict[str, Any]]:
    """One image record of Labels-v3.json, with changes."""
    return _image


@pytest.fixture
def labels() -> dict[str, Any]:
    """One match: an action with two replays, and an action alone."""
    return {
        "GameMetadata": {
            "UrlLocal": MATCH,
            "list_actions": ["7.png", "8.png"],
            "list_replays": ["7_0.png", "7_1.png"],
            "gameHomeTeam": "Alder Town",
        },
        "actions": {
            "7.png": _image(linked_replays=["7_1.png", "7_0.png"]),
            "8.png": _image(linked_replays=[]),
        },
        "replays": {
            "7_1.png": _image(linked_action="7.png"),
            "7_0.png": _image(linked_action="7.png"),
        },
    }


@pytest.fixture
def match() -> str:
    return MATCH


@pytest.fixture
def write_labels(tmp_path: Path) -> Callable[[Any], Path]:
    """Put a Labels-v3.json where it belongs below the dataset's root; the root."""

    def write(value: Any) -> Path:
        folder = tmp_path / "root" / MATCH
        folder.mkdir(parents=True, exist_ok=True)
        text = value if isinstance(value, str) else json.dumps(value)
        (folder / "Labels-v3.json").write_text(text)
        return tmp_path / "root"

    return write


@pytest.fixture
def make_zip(tmp_path: Path) -> Callable[..., Path]:
    """A zip of names and contents."""

    def make(members: dict[str, bytes | str], path: Path | None = None) -> Path:
        path = path or tmp_path / "archive.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        return path

    return make


def _fit() -> BallFit:
    return BallFit(
        reprojected=ImagePoint(616.5, 305.0),
        error_px=0.75,
        error_percent=0.05,
        optimized_diameter_px=10.5,
        optimized_box=Box(610.75, 300.25, 10.5, 10.5),
        optimized_error_m=0.125,
        exact_box=Box(610.5, 300.0, 10.6, 10.4),
        size_ratio=1.1,
        depth_m=55.0,
    )


@pytest.fixture
def solved(camera: Camera) -> Callable[..., ExportRecord]:
    """A record of a group whose first two views make a valid pair; further views fell."""

    def make(group: Group, ball: bool = True, verdict: str = "accepted") -> ExportRecord:
        views = []
        for index, view in enumerate(group.views):
            valid = index < 2
            calibration = Calibration("lines", camera if index < 3 else None, jac=(0.9, 1.0, 1.0))
            failed = None if valid else "jac"
            fit = _fit() if ball else None
            views.append(ViewSolution(view.key, calibration, "k", valid and ball, failed, fit))
        point = Ball3D((1.5, -2.25, -0.113), (0.0,) * 9, 0.1, 20.0, ("a", "b"))
        pairs: tuple[TriangulatedPair, ...] = ()
        solution = Solution(tuple(views), pairs, point if ball else None, ())
        return ExportRecord(group, solution, verdict)

    return make


@pytest.fixture
def soccer_group() -> Callable[..., Group]:
    """A SoccerNet group; the key's last part is the action image."""

    def make(action: str = "7.png", replays: int = 1, match: str = MATCH, **changes: Any) -> Group:
        stem = action.removesuffix(".png")
        keys = [action, *(f"{stem}_{index}.png" for index in range(1, replays + 1))]
        lines = make_lines({"Side line top": [(0.0, 80.0), (1279.0, 85.5)]})
        ball = BallAnnotation(box=Box(610.0, 300.0, 12.0, 11.0))
        views = [View(key, Station(f"{match}/{key}", SIZE, lines=lines), (ball,)) for key in keys]
        values = {"match": match, "split": "train"} | changes
        return Group(f"{match}/{action}", tuple(views), **values)

    return make


@pytest.fixture
def issia_group() -> Callable[..., Group]:
    """An ISSIA group: the cameras that annotate the ball of one frame."""

    def make(frame: int = 358, cameras: tuple[int, ...] = (3, 4)) -> Group:
        size = ImageSize(1920, 1080)
        views = [
            View(
                f"cam{camera}",
                Station(f"cam{camera}", size, shared=True),
                (BallAnnotation(point=ImagePoint(100.0 * camera, 50.5)),),
            )
            for camera in cameras
        ]
        return Group(str(frame), tuple(views), match="issia")

    return make
