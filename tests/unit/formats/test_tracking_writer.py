from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.formats.tracking_writer import write_cdf, write_tracab
from app.formats.tracks_writer import TrackRecord
from app.soccer.pitch import Pitch
from app.tracking.ball_track import BallTrack
from tests.flights import FIRST, places
from tests.foreign_readers import read_by

KLOPPY = """
from kloppy import tracab
read = tracab.load(
    meta_data=root / "tracab_metadata.xml", raw_data=root / "tracab.dat", coordinates="tracab"
)
found["rate"] = read.metadata.frame_rate
found["pitch"] = [read.metadata.pitch_dimensions.pitch_length, read.metadata.pitch_dimensions.pitch_width]
found["frames"] = [frame.frame_id for frame in read.records]
found["seconds"] = [frame.timestamp.total_seconds() for frame in read.records]
found["states"] = [frame.ball_state.value for frame in read.records]
found["balls"] = [
    [frame.ball_coordinates.x, frame.ball_coordinates.y, frame.ball_coordinates.z]
    for frame in read.records
]
"""
VALIDATOR = """
import contextlib, io, warnings
import cdf
said = io.StringIO()
with warnings.catch_warnings(record=True) as raised, contextlib.redirect_stdout(said):
    warnings.simplefilter("always")
    cdf.TrackingSchemaValidator().validate_schema(str(root / "tracking.jsonl"), mode="extreme", limit=None)
found["valid"] = "is valid for version" in said.getvalue()
found["raised"] = [str(one.message) for one in raised]
"""


@pytest.fixture
def record() -> TrackRecord:
    """The flight as a track, with a gap of two frames and the ball out at its end."""
    position = places(60)
    position[20:22] = np.nan
    velocity = np.gradient(places(60), 1 / 25, axis=0)
    mode = ["roll" if row < 15 else "flight" for row in range(60)]
    mode[20:22], mode[59] = ["", ""], "out"
    frames = np.arange(FIRST, FIRST + 60)
    track = BallTrack(
        frames, frames / 25, position, velocity, np.tile(np.eye(6), (60, 1, 1)),
        ("measured",) * 60, tuple(mode), ((),) * 60,
    )  # fmt: skip
    return TrackRecord("a & b", track, Pitch(104.0, 67.0), 25.0)


class TestWriteTracab:
    def test_kloppy_reads_the_ball_within_a_centimetre(
        self, record: TrackRecord, tmp_path: Path
    ) -> None:
        assert write_tracab(tmp_path, [record]) == {"tracks": 1, "frames": 60, "balls": 58}
        found = read_by(KLOPPY, tmp_path, tmp_path)
        assert found["rate"] == 25
        assert np.allclose(found["pitch"], [104.0, 67.0])
        there = record.has_position
        assert found["frames"] == record.track.frames[there].tolist()
        balls = np.array(found["balls"]) / 100
        assert np.abs(balls - record.track.position[there] * (1, -1, -1)).max() < 0.01
        assert balls[:, 2].max() > 2.0
        assert found["seconds"][3] == pytest.approx(3 / 25)
        assert [found["states"].count(state) for state in ("alive", "dead")] == [57, 1]


class TestWriteCdf:
    def test_its_validator_is_silent(self, record: TrackRecord, tmp_path: Path) -> None:
        assert write_cdf(tmp_path, [record]) == {"tracks": 1, "frames": 60, "balls": 58}
        assert read_by(VALIDATOR, tmp_path, tmp_path) == {"valid": True, "raised": []}

    def test_the_ball_is_z_up_and_frames_in_gaps_are_left_out(
        self, record: TrackRecord, tmp_path: Path
    ) -> None:
        write_cdf(tmp_path, [record])
        lines = list(map(json.loads, (tmp_path / "tracking.jsonl").read_text().splitlines()))
        assert lines[0]["timestamp"] == "1970-01-01T00:00:04.000+00:00"
        assert [line["frame_id"] for line in lines] == [n for n in range(60) if n not in (20, 21)]
        x, y, z = record.track.position[32]
        assert lines[30]["ball"] == {"x": x, "y": -y, "z": -z, "status": True}
        assert lines[-1]["ball"]["status"] is False

    def test_a_ball_beyond_what_it_has_room_for_is_left_out(
        self, record: TrackRecord, tmp_path: Path
    ) -> None:
        position = record.track.position.copy()
        position[5, 1] = 43.0
        far = replace(record, track=replace(record.track, position=position))
        assert write_cdf(tmp_path, [far])["balls"] == 57
        assert read_by(VALIDATOR, tmp_path, tmp_path) == {"valid": True, "raised": []}
