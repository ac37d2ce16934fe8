from __future__ import annotations

from typing import Any

import pytest

from app.formats.coco_annotation import (
    MissingPositionError,
    ball_from_annotation,
    box_from_annotation,
    is_occluded,
)
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint

CENTRE = ImagePoint(99.5, 49.5)
"""Of what stands at (100, 50) in the files, whose pixels begin at a corner."""


class TestBallOf:
    def test_a_box_is_half_a_pixel_nearer_to_the_first_one(self) -> None:
        ball = ball_from_annotation({"bbox": [90, 40, 20, 20]})
        assert ball == BallAnnotation(box=Box(89.5, 39.5, 20, 20))
        assert ball.center == CENTRE

    @pytest.mark.parametrize(
        "item",
        [
            {"bbox": [100, 50, 0, 0]},
            {"bbox": [100.0, 50.0, 0.0, 0.0], "keypoints": [100, 50, 2]},
            {"bbox": ["100", "50", "0", "0"]},
            {"bbox": [90, 50, 20, 0]},
            {"keypoints": [100, 50, 2]},
            {"bbox": None, "keypoints": [100, 50, 2]},
            {"bbox": [], "keypoints": [0, 0, 0, 100, 50, 2]},
            {"bbox": [None, 50, 0, 0], "keypoints": [100, 50, 2]},
        ],
    )
    def test_a_ball_without_area_is_a_point(self, item: dict[str, Any]) -> None:
        assert ball_from_annotation(item) == BallAnnotation(point=CENTRE)

    def test_a_box_with_area_goes_before_its_keypoints(self) -> None:
        item = {"bbox": [90, 40, 20, 20], "keypoints": [None, 3, 2]}
        assert ball_from_annotation(item).box == Box(89.5, 39.5, 20, 20)

    def test_a_keypoint_that_is_labelled_as_not_visible_is_an_occluded_ball(self) -> None:
        assert ball_from_annotation({"keypoints": [100, 50, 1]}) == BallAnnotation(
            point=CENTRE, occluded=True
        )

    def test_of_several_keypoints_the_one_called_center_counts(self) -> None:
        item = {"keypoints": [1, 2, 2, 100, 50, 2, 3, 4, 0]}
        assert ball_from_annotation(item, ["top", "Center", "bottom"]).point == CENTRE

    def test_polygons_have_a_box_around_them(self) -> None:
        item = {"segmentation": [[90, 50, 100, 40, 110, 50], [100, 60, 95, 55, 105, 55]]}
        assert ball_from_annotation(item).box == Box(89.5, 39.5, 20, 20)

    @pytest.mark.parametrize(
        ("item", "field", "words"),
        [
            ({}, "bbox", "is missing, and so are keypoints"),
            ({"bbox": [0.5, 0.4, 0.01, 0.02]}, "bbox", "fractions of the image"),
            ({"keypoints": [0.5, 0.4, 2]}, "bbox", "fractions of the image"),
            ({"bbox": [1, 2, 3]}, "bbox", "has 3 numbers, not 4"),
            ({"bbox": [1, 2, -3, 4]}, "bbox", "negative"),
            ({"bbox": [1, 2, None, 4]}, "bbox", "null, not a number"),
            ({"segmentation": {"counts": "abc", "size": [9, 9]}}, "bbox", "RLE"),
            ({"segmentation": [[1, 2, 3, 4]]}, "segmentation", "fewer than three points"),
            ({"segmentation": [[1, 2, 3, 2, 5, 2]]}, "segmentation", "no area"),
            ({"segmentation": "x"}, "bbox", "is missing"),
            ({"keypoints": [1, 2]}, "keypoints", "three for each point"),
            ({"keypoints": [1, None, 2]}, "keypoints", "null"),
            ({"keypoints": [1, 2, 0]}, "bbox", "is missing"),
            ({"keypoints": [1, 2, 2, 3, 4, 2]}, "keypoints", "has 2 points"),
        ],
    )
    def test_one_that_says_no_place_says_why(
        self, item: dict[str, Any], field: str, words: str
    ) -> None:
        with pytest.raises(MissingPositionError, match=words) as raised:
            ball_from_annotation(item)
        assert raised.value.field == field


class TestBoxOf:
    def test_a_person_without_a_box_is_around_its_keypoints(self) -> None:
        item = {"keypoints": [10, 20, 2, 30, 60, 1, 0, 0, 0]}
        assert box_from_annotation(item) == Box(9.5, 19.5, 20, 40)

    def test_a_person_as_a_point_is_a_box_without_area(self) -> None:
        assert box_from_annotation({"bbox": [100, 50, 0, 0]}) == Box(99.5, 49.5, 0, 0)


class TestIsOccluded:
    @pytest.mark.parametrize("value", [True, 1, 1.0, "true", " Yes "])
    def test_it_stands_in_the_annotation_or_in_its_attributes(self, value: Any) -> None:
        assert is_occluded({"occluded": value})
        assert is_occluded({"attributes": {"occluded": value}})

    @pytest.mark.parametrize("value", [False, 0, None, "false", "no", [], {}])
    def test_anything_else_is_not(self, value: Any) -> None:
        assert not is_occluded({"occluded": value, "attributes": {"occluded": value}})
        assert not is_occluded({"attributes": value})
