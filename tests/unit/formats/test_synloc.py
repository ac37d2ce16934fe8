from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.errors import DatasetFormatError
from app.formats.cameras import read_cameras
from app.formats.report import ReaderReport
from app.formats.synloc import camera_from_synloc
from app.geometry.camera import rotation_from_pan_tilt_roll

# The highest term first, as the files have it.
POLYNOMIAL = (0.037, -0.181, 0.268, 0.037, -0.408, 0.251, -0.119, 0.769, -7.1e-4)
WIDTH, HEIGHT = 3840, 2160


def record(**changes: Any) -> dict[str, Any]:
    """A camera 40 m beside the centre mark and 15 m up, in single precision like the files."""
    # Its own frame: x across, y along the length, z up; the camera looks towards -x and down.
    turn = rotation_from_pan_tilt_roll(0.0, np.radians(68.0), 0.0) @ np.array(
        [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]
    )
    place = np.array([40.0, 3.0, 15.0])
    matrix = np.column_stack([turn, -turn @ place]).astype(np.float32) * np.float32(2.5)
    return {
        "id": 3,
        "file_name": "images/000003.jpg",
        "width": WIDTH,
        "height": HEIGHT,
        "camera_matrix": matrix.tolist(),
        "dist_poly": list(POLYNOMIAL),
        "undist_poly": [0.0] * 9,
    } | changes


def published(value: dict[str, Any], points: np.ndarray) -> np.ndarray:
    """Pixels of points of their frame, by the formulas of the dataset's kit."""
    seen = np.column_stack([points, np.ones(len(points))]) @ np.array(value["camera_matrix"]).T
    ideal = seen[:, :2] / seen[:, 2:]
    radius = np.hypot(*ideal.T)
    bent = ideal * (np.polyval(value["dist_poly"], np.arctan(radius)) / radius)[:, None]
    middle = ((value["width"] - 1) / 2, (value["height"] - 1) / 2)
    return value["width"] * bent + middle


class TestCameraFromSynloc:
    def test_shows_the_pitch_where_the_datasets_kit_does(self) -> None:
        value = record()
        random = np.random.default_rng(1)
        theirs = random.uniform((-33, -50, 0), (33, 50, 2), (200, 3))
        ours = theirs[:, [1, 0, 2]] * (1, 1, -1)
        pixels = camera_from_synloc(value, "val.json", "3").project(ours)
        assert np.isfinite(pixels).all()
        assert np.ptp(pixels[:, 0]) > 0.6 * WIDTH
        # Single precision of the matrix: a hundredth of a pixel.
        assert np.abs(pixels - published(value, theirs)).max() < 0.01

    def test_stands_where_it_stands_in_our_frame(self) -> None:
        camera = camera_from_synloc(record(), "val.json", "3")
        assert np.allclose(camera.position, (3.0, 40.0, -15.0), atol=1e-4)
        assert camera.focal_length == (WIDTH, WIDTH)
        assert camera.principal_point == (1919.5, 1079.5)
        assert camera.pan_tilt_roll_degrees == pytest.approx((0.0, 68.0, 0.0), abs=1e-4)

    @pytest.mark.parametrize(
        ("changes", "field", "problem"),
        [
            ({"camera_matrix": [[1, 0, 0, 0]] * 2}, "camera_matrix", "has 2 rows"),
            ({"camera_matrix": [[0, 0, 0, 0]] * 3}, "camera_matrix", "is singular"),
            (
                {"camera_matrix": [[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 9]]},
                "camera_matrix",
                "is not a rotation",
            ),
            (
                {"camera_matrix": [[1, 0, 0, 0], [0, 1, 0, float("nan")], [0, 0, 1, 9]]},
                "camera_matrix",
                "not a finite number",
            ),
            ({"dist_poly": [1.0]}, "dist_poly", "has 1 terms"),
            ({"dist_poly": [0.1] * 10}, "dist_poly", "has 10 terms"),
            ({"dist_poly": [0.0, -0.7, 0.0]}, "dist_poly", "does not grow"),
            ({"width": 0}, "width", "is 0 pixels"),
            ({"height": None}, "height", "null"),
        ],
    )
    def test_what_makes_no_camera_is_refused_by_name(
        self, changes: dict[str, Any], field: str, problem: str
    ) -> None:
        with pytest.raises(DatasetFormatError, match=problem) as error:
            camera_from_synloc(record(**changes), "val.json", "3")
        assert error.value.field == field


class TestReadCameras:
    def test_a_coco_file_gives_a_camera_for_each_image(self, tmp_path: Path) -> None:
        bad = record(file_name="images/000004.jpg", dist_poly=[])
        path = tmp_path / "val.json"
        path.write_text(json.dumps({"images": [record(), bad], "annotations": []}))
        report = ReaderReport()
        cameras = read_cameras(path, report)
        assert list(cameras) == ["000003"]
        assert cameras["000003"].lens == "arctan_polynomial"
        assert (report.read, report.imported) == (2, 1)
        assert "000004" in str(report.problems[0])
