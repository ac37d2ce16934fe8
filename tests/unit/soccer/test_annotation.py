"""What a dataset brings beside lines and balls."""

from __future__ import annotations

from app.soccer.annotation import Extras
from app.soccer.frames import Box


def test_people_lie_where_their_corners_say_and_what_has_none_is_left_out():
    boxes = (
        {"class": "Referee", "points": {"x1": "30.5", "y1": 8, "x2": 10.5, "y2": 28}},
        {"class": None, "points": {"x1": float("nan"), "y1": 0, "x2": 1, "y2": 1}},
        {"class": "Player", "points": {"x1": 1}},
        {"class": "Player", "points": None},
        {"class": "Player"},
    )
    assert Extras(boxes).pixel_boxes == (Box(10.5, 8.0, 20.0, 20.0),)
