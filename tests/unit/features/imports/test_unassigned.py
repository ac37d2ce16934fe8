from __future__ import annotations

from app.features.imports.unassigned import UnassignedFrame, ingest_unassigned, unassigned_frames
from app.soccer.annotation import Extras


def frames(count: int, x: float = 1.5) -> list[UnassignedFrame]:
    box = {"class": "Person", "ID": "3", "points": {"x1": x, "y1": 2}}
    return [UnassignedFrame("cam1", str(number), Extras(boxes=(box,))) for number in range(count)]


def kept(store) -> list[UnassignedFrame]:
    """The spare frames of the only dataset."""
    with store.read() as session:
        return list(unassigned_frames(session, 1))


class TestIngestSpare:
    def test_frames_come_back(self, store) -> None:
        report = ingest_unassigned(store, "demo", frames(3), source="x", actor="ann")
        assert report.new == 3
        assert kept(store) == frames(3)

    def test_again_it_changes_nothing_and_follows_changes(self, store) -> None:
        ingest_unassigned(store, "demo", frames(3), source="x", actor="ann")
        same = ingest_unassigned(store, "demo", frames(3), source="x", actor="ann")
        assert (same.new, same.changed, same.unchanged) == (0, 0, 3)
        moved = ingest_unassigned(store, "demo", frames(3, 9.0)[:1], source="x", actor="ann")
        assert moved.changed == 1
        assert kept(store) == [frames(1, 9.0)[0], *frames(3)[1:]]

    def test_many_come_in_batches(self, store, monkeypatch) -> None:
        monkeypatch.setattr("app.features.imports.unassigned.BATCH", 4)
        ingest_unassigned(store, "demo", frames(10), source="x", actor="ann")
        assert len(kept(store)) == 10
