from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from app.errors import InputError
from app.formats.camera_matrix import read_camera_arrays
from app.formats.file_tree import ImportLimits
from app.formats.tracks_writer import (
    TrackRecord,
    position_sigma,
    write_cdf,
    write_tracab,
    write_track_arrays,
    write_tracks,
)
from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.tracking.ball_track import BallEvent, BallTrack, ViewJump
from tests.flights import FIRST, places
from tests.foreign_readers import read_by
from tests.rigs import TRUTH


def track(first: int = 100, count: int = 4) -> BallTrack:
    """A ball that rolls along x, with a gap in its third frame."""
    position = np.column_stack(
        [np.arange(count) * 0.5, np.full(count, -2.0), np.full(count, -0.11)]
    )
    velocity = np.tile([12.5, 0.0, 0.0], (count, 1))
    covariance = np.tile(np.diag([0.01, 0.04, 0.09, 1.0, 1.0, 1.0]), (count, 1, 1))
    for values in (position, velocity, covariance):
        values[2] = np.nan
    return BallTrack(
        np.arange(first, first + count),
        np.arange(first, first + count) / 25,
        position,
        velocity,
        covariance,
        ("measured", "one_view", "gap", "predicted"),
        ("roll", "roll", "", "flight"),
        (("cam3", "cam4"), ("cam3",), (), ()),
        (BallEvent(first + 3, 4.12, "kick", np.array([1.5, -2.0, -0.11]), 0.01),),
        jumps=(ViewJump(first + 1, 4.04, 0.4, ("cam3",)),),
    )


def record(
    key: str = "issia", cameras: Mapping[str, Mapping[int, Camera]] | None = None
) -> TrackRecord:
    return TrackRecord(key, track(), Pitch(), 25.0, cameras or {})


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


class TestPositionSigma:
    def test_is_the_major_axis_and_nan_in_gaps(self) -> None:
        found = position_sigma(track().covariance)
        assert found[0] == pytest.approx(0.3)
        assert np.isnan(found).tolist() == [False, False, True, False]


class TestWriteTracks:
    def test_a_row_a_frame_empty_where_there_is_a_gap(self, tmp_path: Path) -> None:
        counts = write_tracks(tmp_path, [record()])
        assert counts == {"tracks": 1, "frames": 4, "frames_with_ball": 3, "events": 1}
        text = (tmp_path / "ball.csv").read_text().splitlines()
        assert text[0] == "frame,time_s,x_m,y_m,z_m,sigma_m,state,cameras"
        assert text[1] == "100,4.0,0.0,-2.0,-0.11,0.3,measured,cam3 cam4"
        assert text[3] == "102,4.08,,,,,gap,"
        (event,) = rows(tmp_path / "events.csv")
        assert event == {
            "frame": "103", "time_s": "4.12", "kind": "kick",
            "x_m": "1.5", "y_m": "-2.0", "z_m": "-0.11", "sigma_s": "0.01",
        }  # fmt: skip

    def test_names_with_spaces_are_one_word_each(self, tmp_path: Path) -> None:
        named = replace(track(), views=(("cup final", "cup final link 3"), (), (), ()))
        write_tracks(tmp_path, [TrackRecord("cup", named, Pitch(), 25.0)])
        first = rows(tmp_path / "ball.csv")[0]
        assert first["cameras"].split(" ") == ["cup_final", "cup_final_link_3"]

    def test_without_pyarrow_there_is_no_parquet_and_all_else(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("app.formats.tracks_writer.find_spec", lambda name: None)
        assert write_tracks(tmp_path, [record()])["tracks"] == 1
        assert sorted(path.name for path in tmp_path.iterdir()) == ["ball.csv", "events.csv"]

    def test_parquet_has_covariance_velocity_and_mode(self, tmp_path: Path) -> None:
        write_tracks(tmp_path, [record()])
        found = pq.read_table(tmp_path / "ball.parquet").to_pylist()
        assert [row["frame"] for row in found] == [100, 101, 102, 103]
        assert (found[0]["mode"], found[0]["cameras"]) == ("roll", ["cam3", "cam4"])
        assert found[0]["vx_m_s"] == 12.5
        assert [row["jump_m"] for row in found] == [None, 0.4, None, None]
        assert np.array_equal(np.reshape(found[0]["covariance"], (6, 6)), track().covariance[0])
        assert [found[2][name] for name in ("x_m", "covariance", "mode", "sigma_m")] == [None] * 4

    def test_several_tracks_have_a_folder_each(self, tmp_path: Path) -> None:
        counts = write_tracks(tmp_path, [record("cup 0-90"), record("cup/x 91-99")])
        assert counts["tracks"] == 2
        assert sorted(path.name for path in tmp_path.iterdir()) == ["cup 0-90", "cup_x 91-99"]

    def test_two_tracks_of_one_folder_are_refused(self, tmp_path: Path) -> None:
        with pytest.raises(
            InputError, match='the tracks "a/b" and "a:b" would be written to the same folder, a_b'
        ):
            write_tracks(tmp_path, [record("a/b"), record("a:b")])


class TestWriteTrackArrays:
    def test_ball_and_cameras_are_z_up_with_a_row_a_frame(self, tmp_path: Path) -> None:
        cameras = {"cam1": dict.fromkeys((100, 102), TRUTH["cam1"]), "cam2": {}}
        counts = write_track_arrays(tmp_path, [record(cameras=cameras)])
        assert counts == {"tracks": 1, "frames": 4, "frames_with_ball": 3, "cameras": 1}
        found = np.load(tmp_path / "ball.npz")
        assert found["frame"].tolist() == [100, 101, 102, 103]
        assert found["ball"][0].tolist() == [0.0, 2.0, 0.11]
        assert np.isnan(found["ball"][2]).all()
        point = found["ball"][1]
        in_camera = found["cam1/R"][0] @ point + found["cam1/t"][0]
        ideal = (found["cam1/K"][0] @ in_camera)[:2] / in_camera[2]
        plain = replace(TRUTH["cam1"], distortion=np.zeros(12))
        assert np.allclose(ideal, plain.project(track().position[1][None])[0])
        assert np.isnan(found["cam1/K"][1]).all()
        assert len(found["cam1/t"]) == 4

    def test_a_camera_of_it_is_read_as_a_camera_file_is(self, tmp_path: Path) -> None:
        cameras = {"cam1": dict.fromkeys(range(100, 104), TRUTH["cam1"])}
        write_track_arrays(tmp_path, [record(cameras=cameras)])
        found = np.load(tmp_path / "ball.npz")
        part = {name: found[f"cam1/{name}"] for name in ("K", "R", "t", "k")}
        np.savez(tmp_path / "cam1.npz", **part)
        content = (tmp_path / "cam1.npz").read_bytes()
        ((name, values),) = read_camera_arrays(content, "cam1", "cam1.npz", ImportLimits())
        assert name is None
        assert np.allclose(values["K"], TRUTH["cam1"].K)


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
def flight_record() -> TrackRecord:
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
        self, flight_record: TrackRecord, tmp_path: Path
    ) -> None:
        assert write_tracab(tmp_path, [flight_record]) == {
            "tracks": 1,
            "frames": 60,
            "frames_with_ball": 58,
        }
        found = read_by(KLOPPY, tmp_path, tmp_path)
        assert found["rate"] == 25
        assert np.allclose(found["pitch"], [104.0, 67.0])
        there = flight_record.has_position
        assert found["frames"] == flight_record.track.frames[there].tolist()
        balls = np.array(found["balls"]) / 100
        assert np.abs(balls - flight_record.track.position[there] * (1, -1, -1)).max() < 0.01
        assert balls[:, 2].max() > 2.0
        assert found["seconds"][3] == pytest.approx(3 / 25)
        assert [found["states"].count(state) for state in ("alive", "dead")] == [57, 1]


class TestWriteCdf:
    def test_its_validator_is_silent(self, flight_record: TrackRecord, tmp_path: Path) -> None:
        assert write_cdf(tmp_path, [flight_record]) == {
            "tracks": 1,
            "frames": 60,
            "frames_with_ball": 58,
            "balls_too_far_away": 0,
            "balls_raised_to_the_grass": 0,
        }
        assert read_by(VALIDATOR, tmp_path, tmp_path) == {"valid": True, "raised": []}

    def test_the_ball_is_z_up_and_frames_in_gaps_are_left_out(
        self, flight_record: TrackRecord, tmp_path: Path
    ) -> None:
        write_cdf(tmp_path, [flight_record])
        lines = list(map(json.loads, (tmp_path / "tracking.jsonl").read_text().splitlines()))
        assert lines[0]["timestamp"] == "1970-01-01T00:00:04.000+00:00"
        assert [line["frame_id"] for line in lines] == [n for n in range(60) if n not in (20, 21)]
        x, y, z = flight_record.track.position[32]
        assert lines[30]["ball"] == {"x": x, "y": -y, "z": -z, "status": True}
        assert lines[-1]["ball"]["status"] is False

    def test_balls_that_it_has_no_room_for_are_counted(
        self, flight_record: TrackRecord, tmp_path: Path
    ) -> None:
        position = flight_record.track.position.copy()
        position[5, 1], position[6, 2] = 43.0, 0.02
        far = replace(flight_record, track=replace(flight_record.track, position=position))
        counts = write_cdf(tmp_path, [far])
        assert counts["frames_with_ball"] == 57
        assert (counts["balls_too_far_away"], counts["balls_raised_to_the_grass"]) == (1, 1)
        assert read_by(VALIDATOR, tmp_path, tmp_path) == {"valid": True, "raised": []}
