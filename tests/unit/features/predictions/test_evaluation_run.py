from __future__ import annotations

from app.evaluation.frame import Frame
from app.evaluation.result import Table
from app.features.predictions.evaluation_run import AcceptedTruth
from app.soccer.frames import Box, ImageSize

BOXES = {"annotated": Box(1, 2, 3, 4)}


def frame(identity: int, source: str = "", **more: object) -> Frame:
    values = {"boxes": BOXES, "predicted_by": source, **more}
    return Frame(identity, 1, "g", f"{identity}.png", "m", ImageSize(1280, 720), **values)


class TestAcceptedTruth:
    def test_counts_frames_that_have_the_box_by_where_their_ball_is_from(self) -> None:
        frames = [frame(1), frame(2, "yolo"), frame(3, "old"), frame(4, "yolo", boxes={})]
        assert AcceptedTruth.count(frames, "annotated", "yolo") == AcceptedTruth(2, 1, 3)
        assert AcceptedTruth.count(frames, "annotated", None) == AcceptedTruth(2, 0, 3)
        assert AcceptedTruth.count(frames, "exact", "yolo") == AcceptedTruth(0, 0, 0)

    def test_warns_in_the_tables_that_it_flatters_alone(self) -> None:
        tables = [Table(name, name, (), (), "Note.") for name in ("detection", "cameras")]
        assert AcceptedTruth(0, 0, 3).warn(tables) == tables
        first, second = AcceptedTruth(2, 1, 3).warn(tables)
        assert first.note.startswith("Note. Warning: the ball of 2 of 3 frames")
        assert "1 of them from the very set" in first.note
        assert second == tables[1]
