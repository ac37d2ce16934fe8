from __future__ import annotations

import pytest

from app.sample.scene import Scene
from app.sample.table1 import box_iou, paper_table_1, size_error_percent
from app.soccer.frames import Box
from app.soccer.policy import PAPER
from app.solving.solve import solve


class TestBoxIou:
    def test_the_same_box(self):
        assert box_iou(Box(1, 2, 3, 4), Box(1, 2, 3, 4)) == 1.0

    def test_a_third(self):
        assert box_iou(Box(0, 0, 2, 2), Box(1, 0, 2, 2)) == pytest.approx(1 / 3)

    def test_boxes_apart_share_nothing(self):
        assert box_iou(Box(0, 0, 1, 1), Box(5, 5, 1, 1)) == 0.0


class TestSizeErrorPercent:
    def test_a_box_twice_as_large(self):
        assert size_error_percent(Box(0, 0, 8, 8), Box(2, 2, 4, 4)) == pytest.approx(100 / 2**0.5)


class TestPaperTable1:
    def test_optimised_boxes_beat_annotated_ones(self, clean_scenes: list[Scene]):
        scenes = clean_scenes[:8]
        solutions = {scene.group.key: solve(scene.group, PAPER) for scene in scenes}
        truth = {scene.truth.key: scene.truth for scene in scenes}
        annotated, optimized = paper_table_1([s.group for s in scenes], solutions, truth)
        assert annotated.count == optimized.count >= 14
        assert optimized.iou > annotated.iou + 0.05
        assert optimized.size_error_percent < 5 < annotated.size_error_percent

    def test_nothing_to_compare_counts_zero(self):
        rows = paper_table_1([], {}, {})
        assert [(row.boxes, row.count) for row in rows] == [("annotated", 0), ("optimized", 0)]
