"""Tracks of a version as the library gives them: bit for bit what was frozen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import touchline
from app.tracking.ball_track import BallTrack
from tests.flights import FIRST, write_flight_export
from touchline.errors import DataError


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, BallTrack]:
    out = tmp_path_factory.mktemp("flight") / "v1"
    return out, write_flight_export(out)


class TestTracks:
    def test_numbers_are_those_that_were_frozen(self, flight) -> None:
        out, frozen = flight
        (track,) = touchline.open(out).tracks
        assert (track.stretch, len(track), track.frames[0]) == ("rig", 60, FIRST)
        for name in ("times", "position", "velocity", "covariance", "sigma"):
            assert np.array_equal(getattr(track, name), getattr(frozen, name), equal_nan=True), name
        assert (track.state, track.mode, track.cameras) == (frozen.state, frozen.mode, frozen.views)
        assert [(item.frame, item.kind) for item in track.events] == [
            (item.frame, item.kind) for item in frozen.events
        ]
        assert track.events[0].position == tuple(frozen.events[0].position)

    def test_flights_are_where_it_flies(self, flight) -> None:
        (track,) = touchline.open(flight[0]).tracks
        longest = max(track.flights(), key=lambda rows: rows.stop - rows.start)
        assert set(track.mode[longest]) == {"flight"}
        assert np.nanmax(track.height_m[longest]) > 2.0
        assert track.known[longest].all()

    def test_tables_have_a_row_a_frame_and_a_row_an_event(self, flight) -> None:
        version = touchline.open(flight[0])
        assert version.table("tracks").num_rows == 60
        assert version.table("events").column_names[:2] == ["stretch", "frame"]
        assert version.manifest["counts"]["tracks"] == 1

    def test_frames_are_still_looked_for_elsewhere(self, flight) -> None:
        assert not touchline.files.Export(flight[0]).has_frames

    def test_a_version_without_tracks_has_none(self, export) -> None:
        version = touchline.open(export)
        assert version.tracks == ()
        with pytest.raises(DataError, match=r"contains no tracks\.parquet"):
            version.table("tracks")
        with pytest.raises(ValueError, match="views, groups, balls, tracks, events"):
            version.table("goals")
