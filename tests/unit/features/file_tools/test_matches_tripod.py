"""Frames of one tripod get covariances that know the pitch which they show together."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.errors import InputError
from app.features.file_tools.matches import SnappedFrame, refine_shared_tripod_cameras
from app.formats.cameras import camera_file_name, format_camera_file, read_cameras
from app.formats.report import ReaderReport
from app.geometry.arrays import flatten_covariance
from app.geometry.resection import LOG_FOCAL, PAN, camera_from_parameters, parameters_from_camera
from app.paint.evidence import DetectedPaint
from app.paint.snap import SnappedCamera
from app.paint.tracing import trace_places
from app.soccer.pitch import Pitch
from tests.unit.paint.lawns import SMALL, TRUE

HALF = SMALL.diagonal / 2
WIDE = 4.0 * np.eye(8)
"""A covariance that nobody has."""


def drawn(number: int, out: Path) -> SnappedFrame:
    """A frame on its paint, and the file of its camera."""
    parameters = parameters_from_camera(TRUE, HALF)
    parameters[PAN] += np.radians(3.0) * number
    parameters[LOG_FOCAL] += 0.01 * number
    camera = camera_from_parameters(parameters, TRUE.principal_point, HALF)
    traced = trace_places(camera, Pitch(), SMALL.width, SMALL.height, 8.0, 2000)
    sigmas = np.full(len(traced.pixels), 0.1)
    offsets = np.random.default_rng(number).normal(0, 0.1, len(sigmas))
    evidence = DetectedPaint(traced, offsets, sigmas, np.full(len(sigmas), 50.0))
    shape = (SMALL.height, SMALL.width)
    snapped = SnappedCamera(camera, evidence, 0.1, WIDE, 0.0, None, shape)
    text = format_camera_file(camera, flatten_covariance(WIDE), SMALL)
    (out / camera_file_name(str(number))).write_text(text)
    return SnappedFrame(str(number), snapped, camera, SMALL, Pitch())


def known(out: Path) -> dict[str, Any]:
    covariances: dict[str, Any] = {}
    read_cameras(out, ReaderReport(), covariances=covariances)
    return {name: np.reshape(each, (8, 8)) for name, each in covariances.items()}


@pytest.fixture
def frames(tmp_path: Path) -> list[SnappedFrame]:
    return [drawn(number, tmp_path) for number in range(4)]


def rows_of(frames: list[SnappedFrame]) -> list[dict[str, Any]]:
    return [{"frame": each.frame} for each in frames]


def test_frames_of_one_tripod_show_their_pitch_together(frames: list[SnappedFrame], tmp_path: Path):
    rows = rows_of(frames)
    refine_shared_tripod_cameras(frames, "one", rows, tmp_path)
    assert all(row["shown"]["frames"] == 4 and row["shown"]["other"] is None for row in rows)
    for covariance in known(tmp_path).values():
        assert np.linalg.eigvalsh(covariance)[0] > 0
        assert np.sqrt(np.diag(covariance)[:3]).max() < 1.0


def test_a_file_says_which_frames_are_of_which_camera(frames: list[SnappedFrame], tmp_path: Path):
    rows, file, before = rows_of(frames), tmp_path / "cameras.csv", known(tmp_path)
    file.write_text("frame,match\n0,main\n1,main\n2,main\n")
    refine_shared_tripod_cameras(frames, str(file), rows, tmp_path)
    assert ["shown" in row for row in rows] == [True, True, True, False]
    changed = [name for name, each in known(tmp_path).items() if (each != before[name]).any()]
    assert sorted(changed) == ["0", "1", "2"]


def test_nothing_changes_where_nothing_is_said_or_shown(frames: list[SnappedFrame], tmp_path: Path):
    rows, before = rows_of(frames), known(tmp_path)
    refine_shared_tripod_cameras(frames, None, rows, tmp_path)
    refine_shared_tripod_cameras(frames[:2], "one", rows, tmp_path)
    mixed = [*frames[:2], SnappedFrame("2", frames[2].snapped, TRUE, SMALL, Pitch(101, 68))]
    refine_shared_tripod_cameras(mixed, "one", rows, tmp_path)
    assert not any("shown" in row for row in rows)
    assert all((each == before[name]).all() for name, each in known(tmp_path).items())


def test_a_file_that_is_none_or_names_no_frame_is_refused(
    frames: list[SnappedFrame], tmp_path: Path
):
    with pytest.raises(InputError, match=r'"two" is not one, and there is no such file'):
        refine_shared_tripod_cameras(frames, "two", rows_of(frames), tmp_path)
    file = tmp_path / "cameras.json"
    file.write_text(json.dumps({"a": "main"}))
    with pytest.raises(InputError, match="names none of the 4 frames, such as 0"):
        refine_shared_tripod_cameras(frames, str(file), rows_of(frames), tmp_path)
