from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.formats.opentrackio_writer import (
    camera_to_opentrackio,
    estimate_frame_rate,
    find_opentrackio_problem,
    pan_tilt_roll_z_up,
)
from app.geometry.camera import Camera
from tests.cameras import EVERY_COEFFICIENT, SIZE, looking, wide

BENT = replace(
    EVERY_COEFFICIENT,
    distortion=np.array([0.1, -0.02, 0.0, 0.0, 0.3, 0.04, 0.05, 0.06, 0.0, 0.0, 0.0, 0.0]),
)
POINTS = np.array([(0.0, 0.0, 0.0), (-4.0, 20.0, -2.0), (9.0, 10.0, -0.11), (3.0, -30.0, -8.0)])


def seen_by_a_reader(sample: dict[str, Any], points: np.ndarray) -> np.ndarray:
    """Pixels as OpenTrackIO's documents have them, in millimetres on the sensor; nothing of ours.

    Args:
        points: x along the pitch, y away from the main stand, z up, metres, shape (N, 3).
    """
    transform, lens = sample["transforms"][0], sample["lens"]
    angles = [transform["rotation"][name] for name in ("pan", "tilt", "roll")]
    at = np.array([transform["translation"][name] for name in "xyz"])
    right, forward, up = Rotation.from_euler("ZXY", angles, degrees=True).inv().apply(points - at).T
    focal = lens["pinholeFocalLength"]
    x, y = focal * right / forward, -focal * up / forward
    assert lens["distortion"][0].keys() == {"model", "radial"}
    assert lens["distortion"][0]["model"] == "Brown-Conrady U-D"
    radial = lens["distortion"][0]["radial"]
    square = x * x + y * y
    growth = (1 + radial[0] * square + radial[2] * square**2 + radial[4] * square**3) / (
        1 + radial[1] * square + radial[3] * square**2 + radial[5] * square**3
    )
    camera = sample["static"]["camera"]
    pixels, millimetres = (
        camera["activeSensorResolution"], camera["activeSensorPhysicalDimensions"],
    )  # fmt: skip
    offset = lens["projectionOffset"]
    # From the corner of the first pixel.
    u = pixels["width"] * (0.5 + (x * growth + offset["x"]) / millimetres["width"])
    v = pixels["height"] * (0.5 + (y * growth + offset["y"]) / millimetres["height"])
    return np.column_stack([u, v])


class TestOpentrackioSample:
    @pytest.mark.parametrize(
        "camera",
        [
            looking((0.0, 62.0, -16.0), (3.0, 0.0, 0.0), 2000.0),
            looking((-62.0, 6.0, -3.0), (-30.0, 0.0, 0.0), 1500.0, bend=0.01),
            replace(BENT, principal_point=(600.0, 380.0)),
        ],
    )
    def test_a_reader_sees_the_same_pixels(self, camera: Camera) -> None:
        sample = camera_to_opentrackio(camera, SIZE, 7, source="clip")
        seen = seen_by_a_reader(sample, POINTS * (1.0, -1.0, -1.0))
        assert np.allclose(seen, camera.project(POINTS) + 0.5, atol=1e-6)

    def test_times_are_exact_and_ids_are_those_of_the_recording(self) -> None:
        made = [
            camera_to_opentrackio(
                BENT, SIZE, frame, source="clip", time=frame * 0.04, rate=Fraction(25),
                status="tracked",
            )
            for frame in (3, 4)
        ]  # fmt: skip
        assert made[0]["timing"] == {
            "mode": "internal",
            "sequenceNumber": 3,
            "sampleTimestamp": {"seconds": 0, "nanoseconds": 120_000_000},
            "sampleRate": {"num": 25, "denom": 1},
        }
        assert made[0]["tracker"] == {"status": "tracked"}
        assert made[0]["sourceId"] == made[1]["sourceId"]
        assert made[0]["sampleId"] != made[1]["sampleId"]
        assert made[0]["sampleId"].startswith("urn:uuid:")
        assert made[0] == camera_to_opentrackio(
            BENT, SIZE, 3, source="clip", time=0.12, rate=Fraction(25), status="tracked"
        )

    def test_what_nobody_knows_is_left_out(self) -> None:
        sample = camera_to_opentrackio(BENT, SIZE, 3, source="clip")
        assert sample["timing"] == {"mode": "internal", "sequenceNumber": 3}
        assert "tracker" not in sample


class TestPanTiltRollZUp:
    """What the angles mean, from cameras whose aim is plain."""

    @pytest.mark.parametrize(
        ("position", "target", "pan", "tilt"),
        [
            ((0.0, 50.0, 0.0), (0.0, 0.0, 0.0), 0.0, 0.0),
            ((0.0, 50.0, 0.0), (-50.0, 0.0, 0.0), 45.0, 0.0),
            ((0.0, 50.0, -50.0), (0.0, 0.0, 0.0), 0.0, -45.0),
            ((50.0, 0.0, 0.0), (0.0, 0.0, 0.0), 90.0, 0.0),
        ],
    )
    def test_aims(self, position: Any, target: Any, pan: float, tilt: float) -> None:
        found = pan_tilt_roll_z_up(looking(position, target, 1000.0).rotation)
        assert found == pytest.approx((pan, tilt, 0.0), abs=1e-9)

    def test_a_camera_that_leans_to_the_right_sees_the_pitch_turned_to_the_left(self) -> None:
        level = looking((0.0, 50.0, 0.0), (0.0, 0.0, 0.0), 1000.0)
        angle = np.radians(10)
        lean = np.array(
            [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
        )
        assert pan_tilt_roll_z_up(lean @ level.rotation)[2] == pytest.approx(10.0)


class TestWhyNotOpentrackio:
    def test_lenses_that_it_has(self) -> None:
        assert find_opentrackio_problem(BENT) is None

    def test_those_that_it_has_not(self) -> None:
        assert "tangential" in (find_opentrackio_problem(EVERY_COEFFICIENT) or "")
        prism = replace(BENT, distortion=np.array([*BENT.distortion[:8], 1e-4, 0.0, 0.0, 0.0]))
        assert "thin prism" in (find_opentrackio_problem(prism) or "")
        assert "fisheye" in (find_opentrackio_problem(wide((0, 60, -20), (0, 0, 0))) or "")
        assert "skewed" in (find_opentrackio_problem(replace(BENT, skew=0.1)) or "")


class TestFrameRate:
    @pytest.mark.parametrize(
        "rate", [Fraction(25), Fraction(50), Fraction(30000, 1001), Fraction(24000, 1001)]
    )
    def test_television(self, rate: Fraction) -> None:
        times = {frame: round(float(frame / rate), 4) for frame in range(200)}
        assert estimate_frame_rate(times) == rate

    def test_missing_frames_change_nothing(self) -> None:
        assert estimate_frame_rate({3: 0.12, 50: 2.0}) == 25

    def test_too_few(self) -> None:
        assert estimate_frame_rate({}) is None
        assert estimate_frame_rate({3: 1.0}) is None
        assert estimate_frame_rate({3: 1.0, 4: 1.0}) is None
