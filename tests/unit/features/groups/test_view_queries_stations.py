from __future__ import annotations

from app.db.store import Store
from app.features.groups.view_queries import list_station_pitches
from app.soccer.pitch import Pitch


class TestStationPitches:
    def test_static_cameras_alone_each_size_of_pitch_once(self, filled: Store) -> None:
        with filled.read() as session:
            found = list_station_pitches(session, 1)
            assert [size for _, size in found] == [Pitch(104.5, 67.25)]
            assert list_station_pitches(session, 2) == []
