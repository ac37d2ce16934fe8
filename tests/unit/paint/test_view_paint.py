"""What a view's picture says: in pixels of its annotations, or why it says nothing."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.paint.snap import PAINT_DISAGREES
from app.paint.view_paint import PictureScale, explain_unreadable_picture, read_paint_of_image
from app.soccer.frames import Box, ImageSize
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate
from tests.unit.paint.test_snap import panned

HALF = PictureScale.of(np.zeros((360, 640, 3), np.uint8), ImageSize(1280, 720))


class TestPictureScale:
    def test_the_corner_of_a_picture_is_the_corner_of_its_annotations(self) -> None:
        # The centre of the first pixel is 0, so its outer corner is -0.5 in both.
        assert HALF.to_annotation_point(-0.5, -0.5) == (-0.5, -0.5)
        assert HALF.to_annotation_point(639.5, 359.5) == (1279.5, 719.5)
        assert HALF.to_annotation_point(0.0, 0.0) == (0.5, 0.5)

    def test_a_box_covers_the_same_part_of_the_picture(self) -> None:
        box = HALF.to_picture_box(Box(99.5, 199.5, 40.0, 20.0))
        assert (box.x, box.y, box.width, box.height) == (49.5, 99.5, 20.0, 10.0)
        assert HALF.to_annotation_point(box.x, box.y) == (99.5, 199.5)

    def test_few_of_many_line_like_pixels_are_told_and_all_of_few(self) -> None:
        mask = np.zeros((360, 640), np.bool_)
        mask[10, 20] = mask[30, 40] = True
        assert HALF.to_annotation_line_points(mask) == (
            HALF.to_annotation_point(20, 10),
            HALF.to_annotation_point(40, 30),
        )
        assert 0 < len(HALF.to_annotation_line_points(~mask)) < 10_000
        assert HALF.to_annotation_line_points(np.zeros_like(mask)) == ()


class TestWhyUnreadable:
    @pytest.mark.parametrize(("height", "readable"), [(360, True), (361, True), (362, False)])
    def test_a_rounded_side_is_no_other_shape(self, height: int, readable: bool) -> None:
        found = explain_unreadable_picture(
            np.zeros((height, 640, 3), np.uint8), ImageSize(1280, 720)
        )
        assert (found is None) is readable

    def test_a_small_picture_is_told_with_its_width_first(self) -> None:
        found = explain_unreadable_picture(np.zeros((90, 160, 3), np.uint8), ImageSize(1280, 720))
        assert found is not None and "(160 x 90 pixels)" in found


SIZE = ImageSize(1280, 720)
POLICY = PAPER.calibration


def seen(image, start, size=SIZE):
    return read_paint_of_image(image, size, start, Pitch(), POLICY)


def test_paint_lies_on_the_markings_of_the_true_camera(rendered) -> None:
    found = seen(rendered.image, rendered.clicked)
    assert (found.outcome, found.reason, found.sentence) == ("snapped", None, "")
    assert found.error_px < 0.3 < found.moved_px + 0.3
    assert found.supported > 0.8 and found.explained > 0.5
    apart = []
    for marking, places in found.evidence.points.items():
        curve = rendered.truth.project(Pitch().sample(marking, 0.02, 0.02))
        for x, y, _ in places:
            apart.append(float(np.hypot(*(curve - (x, y)).T).min()))
    assert np.median(apart) < 0.2


def test_paint_is_sought_and_judged_on_the_lines_that_the_policy_fits(rendered) -> None:
    """The picture shows a pitch whose lines lie where the plan has them, not by the Laws."""
    laws = replace(POLICY, goal="laws")
    found = read_paint_of_image(rendered.image, SIZE, rendered.clicked, Pitch(), laws)
    plan = seen(rendered.image, rendered.clicked)
    assert found.error_px > 1.5 * plan.error_px
    assert replace(found, error_px=None) != replace(plan, error_px=None)
    middle = read_paint_of_image(
        rendered.image, SIZE, rendered.clicked, Pitch(), replace(POLICY, goal="middle")
    )
    assert middle == plan


def test_a_smaller_picture_is_told_in_the_pixels_of_its_annotations(rendered) -> None:
    small = np.asarray(cv2.resize(rendered.image, (960, 540), interpolation=cv2.INTER_AREA))
    whole, found = seen(rendered.image, rendered.clicked), seen(small, rendered.clicked)
    assert found.outcome == "snapped"
    marking = max(whole.evidence.points, key=lambda name: len(whole.evidence.points[name]))
    large, less = (np.array(one.evidence.points[marking])[:, :2] for one in (whole, found))
    apart = [np.hypot(*(large - place).T).min() for place in less]
    assert np.median(apart) < 3.0
    assert max(y for _, y in found.line_like) > 540


def test_distances_are_those_of_the_annotations_where_the_picture_is_smaller(rendered) -> None:
    start = Calibration("lines", panned(rendered.truth, 3.0))
    twice = Calibration("lines", start.camera.scaled(2, 2))
    same, found = seen(rendered.image, start), seen(rendered.image, twice, ImageSize(2560, 1440))
    assert same.outcome == found.outcome == "snapped"
    assert found.error_px == pytest.approx(2 * same.error_px, rel=1e-3)
    assert found.moved_px == pytest.approx(2 * same.moved_px, rel=1e-3)
    assert (found.supported, found.explained) == pytest.approx((same.supported, same.explained))
    for marking, places in same.evidence.points.items():
        larger = found.evidence.points[marking]
        assert [sigma for *_, sigma in larger] == pytest.approx(
            [2 * sigma for *_, sigma in places], rel=1e-3
        )


def test_nothing_is_believed_where_people_are_and_a_box_of_the_field_hides_none(rendered) -> None:
    whole = seen(rendered.image, rendered.clicked)
    places = max(whole.evidence.points.values(), key=len)
    x, y, _ = places[len(places) // 2]
    people = (Box(x - 30, y - 40, 60, 80), Box(0, 0, 1280, 720))
    small = np.asarray(cv2.resize(rendered.image, (960, 540), interpolation=cv2.INTER_AREA))
    for image in (rendered.image, small):
        found = read_paint_of_image(image, SIZE, rendered.clicked, Pitch(), POLICY, people)
        told = [
            *found.line_like,
            *(place for some in found.evidence.points.values() for place in some),
        ]
        assert found.outcome == "snapped"
        assert not [one for one in told if abs(one[0] - x) < 28 and abs(one[1] - y) < 38]
        assert [one for one in told if 32 < one[0] - x < 46 and abs(one[1] - y) < 38]
    assert [one for one in whole.line_like if abs(one[0] - x) < 28 and abs(one[1] - y) < 38]


def test_a_camera_of_other_lines_is_contradicted(rendered) -> None:
    start = replace(rendered.clicked, camera=panned(rendered.truth, 25.0))
    found = seen(rendered.image, start)
    assert (found.outcome, found.reason) == ("kept", PAINT_DISAGREES)
    assert "labels" in found.sentence


def test_without_a_camera_only_what_looks_like_paint_is_told(rendered) -> None:
    found = seen(rendered.image, calibrate({}, Pitch(), SIZE, POLICY))
    assert found.outcome == "nothing" and "do not determine a camera" in found.sentence
    assert found.line_like and not found.evidence.points


@pytest.mark.parametrize(
    ("shape", "part"), [((90, 160, 3), "too small"), ((720, 960, 3), "another shape")]
)
def test_a_picture_that_cannot_be_it_is_refused(rendered, shape, part: str) -> None:
    found = seen(np.zeros(shape, np.uint8), rendered.clicked)
    assert found.outcome == "nothing" and part in found.sentence


def test_no_grass_is_nothing_to_read(rendered) -> None:
    found = seen(np.full((720, 1280, 3), 90, np.uint8), rendered.clicked)
    assert found.outcome == "nothing" and found.sentence.startswith("There is nothing to read")


def test_pixels_that_are_not_square_are_refused(rendered) -> None:
    camera = rendered.clicked.camera
    wide = replace(camera, focal_length=(camera.focal_length[0] * 1.05, camera.focal_length[1]))
    found = seen(rendered.image, Calibration("lines", wide))
    assert found.outcome == "nothing" and "square pixels" in found.sentence
