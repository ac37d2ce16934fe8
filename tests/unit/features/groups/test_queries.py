from __future__ import annotations

from app.features.groups import queries as spare
from app.features.groups.queries import (
    iterate_sorted_unassigned_frames,
    iterate_unassigned_frames,
    read_unassigned_extras,
    upsert_unassigned_frames,
)

BODIES = {("cam2", "9"): b"a", ("cam1", "10"): b"b", ("cam1", "9"): b"c"}


class TestPutSpare:
    def test_what_is_known_is_replaced(self, filled) -> None:
        with filled.write() as session:
            upsert_unassigned_frames(session, 1, BODIES)
            upsert_unassigned_frames(session, 1, {("cam2", "9"): b"new"})
            assert read_unassigned_extras(session, 1, {"9"}) == {
                ("cam2", "9"): b"new",
                ("cam1", "9"): b"c",
            }


class TestSpareRows:
    def test_all_come_whatever_the_size_of_a_batch(self, filled, monkeypatch) -> None:
        monkeypatch.setattr(spare, "BATCH", 2)
        with filled.write() as session:
            upsert_unassigned_frames(session, 1, BODIES)
            found = [(row.camera, row.frame) for row in iterate_unassigned_frames(session, 1)]
            assert found == list(BODIES)
            assert list(iterate_unassigned_frames(session, 2)) == []


class TestSortedSpareRows:
    def test_they_come_by_camera_and_frame(self, filled) -> None:
        with filled.write() as session:
            upsert_unassigned_frames(session, 1, BODIES)
            found = [
                (row.camera, row.frame, row.extras)
                for row in iterate_sorted_unassigned_frames(session, 1)
            ]
        assert found == [("cam1", "10", b"b"), ("cam1", "9", b"c"), ("cam2", "9", b"a")]
