"""Goals beside the camera of the paint: where they are seen, and where something else is."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.goal import find_goal_lines, measure_goal_height
from app.soccer.pitch import GOAL_PARTS, Pitch
from tests.cameras import looking

PITCH = Pitch(goal="middle")
"""Posts and bars are painted about their middle, and sought there whatever is fitted."""
CAMERA = looking((35.0, 55.0, -12.0), (49.0, 0.0, 0.0), 1500.0)
WIDTH, HEIGHT = 1280, 720
RIGHT = tuple(name for name in GOAL_PARTS if "right" in name.split()[1])


def picture(
    *parts: str, brightness: int = 220, hidden: float = 0.0, width_px: int = 3
) -> np.ndarray:
    """Noise like a crowd, with parts of a goal over it; a share of each is hidden."""
    rng = np.random.default_rng(3)
    image = rng.integers(40, 90, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    image = cv2.GaussianBlur(image, (0, 0), 1.5)
    for part in parts:
        places = CAMERA.project(PITCH.sample(part, 0.05, 0.05))
        shown = places[int(hidden * len(places)) :].round().astype(np.int32)
        cv2.polylines(image, [shown], False, (brightness,) * 3, width_px, cv2.LINE_AA)
    return image


def off(camera: Camera, part: str, points: np.ndarray) -> float:
    """Largest distance of points from the middle of a projected part, pixels."""
    ends = camera.project(PITCH.sample(part, 0.05, 0.05))
    along = (ends[-1] - ends[0]) / np.hypot(*(ends[-1] - ends[0]))
    return float(np.abs((points - ends[0]) @ np.array([-along[1], along[0]])).max())


class TestGoalLines:
    def test_the_parts_that_are_seen_are_found_to_less_than_a_pixel(self) -> None:
        found = find_goal_lines(picture(*RIGHT), CAMERA, Pitch())
        assert sorted(found) == sorted(RIGHT) and len(RIGHT) == 3
        for part, points in found.items():
            assert len(points) == 4
            assert off(CAMERA, part, np.array(points)) < 0.9

    def test_they_are_found_beside_a_camera_that_is_a_little_off(self) -> None:
        shifted = looking((35.0, 55.0, -12.0), (49.1, 0.0, 0.0), 1500.0)
        assert 2 < off(CAMERA, RIGHT[1], shifted.project(PITCH.sample(RIGHT[1], 1.0, 1.0))) < 5
        found = find_goal_lines(picture(*RIGHT), shifted, PITCH)
        assert sorted(found) == sorted(RIGHT)
        assert max(off(CAMERA, part, np.array(found[part])) for part in found) < 1.0

    @pytest.mark.parametrize(
        "image",
        [picture(), picture(*RIGHT, hidden=0.7), picture(*RIGHT, brightness=75)],
        ids=["none", "mostly hidden", "as dark as the crowd"],
    )
    def test_what_is_not_seen_is_not_proposed(self, image: np.ndarray) -> None:
        assert find_goal_lines(image, CAMERA, PITCH) == {}

    def test_a_broad_bright_board_is_no_crossbar(self) -> None:
        image = picture(RIGHT[0], width_px=30)
        assert RIGHT[0] not in find_goal_lines(image, CAMERA, PITCH)

    def test_a_post_alone_is_proposed_alone(self) -> None:
        (post,) = [part for part in RIGHT if part.endswith("post left")]
        assert list(find_goal_lines(picture(post), CAMERA, PITCH)) == [post]


class TestGoalHeight:
    def test_a_goal_is_as_high_as_it_is(self) -> None:
        seen = measure_goal_height(picture(*RIGHT), CAMERA, PITCH)
        assert seen is not None and seen.has_expected_height
        assert seen.share == pytest.approx(1.0, abs=0.04)

    def test_beside_a_camera_that_foreshortens_too_much_it_looks_too_high(self) -> None:
        image = picture()
        for part in RIGHT:
            places = CAMERA.project(PITCH.sample(part, 0.05, 0.05) * (1.0, 1.0, 1.4))
            shown = places.round().astype(np.int32)
            cv2.polylines(image, [shown], False, (220,) * 3, 3, cv2.LINE_AA)
        seen = measure_goal_height(image, CAMERA, PITCH)
        assert seen is not None and not seen.has_expected_height and seen.is_certain
        assert seen.share == pytest.approx(1.4, abs=0.06)

    def test_a_crowd_has_no_goal(self) -> None:
        assert measure_goal_height(picture(), CAMERA, PITCH) is None
