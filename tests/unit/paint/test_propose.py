from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from app.geometry.camera import rotation_from_pan_tilt_roll
from app.paint.agreement import PaintAgreement
from app.paint.candidates import CameraSearchSpace
from app.paint.evidence import (
    find_paint,
    prepare_picture,
    to_paint_evidence,
    trace_visible_markings,
)
from app.paint.propose import (
    explain_non_square_pixels,
    explain_uncertain_camera,
    propose_camera,
    resize_and_prepare_frame,
    scale_snapped_camera,
)
from app.paint.ranking import FrameToSearch, RankedCamera, measure_weakest_marking
from app.paint.snap import SnappedCamera, snap_to_prepared_picture
from app.sample.render import render_view
from app.sample.scene import Scene
from app.sample.scenes import make_match_scenes
from app.soccer.annotation import make_lines
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import NO_PAINT
from app.soccer.policy import CalibrationPolicy
from app.solving.jaccard import camera_jaccard, project_markings
from tests.cameras import looking
from tests.unit.paint.lawns import PITCH, SMALL, TRUE, drawn, lawn, marked

Image = npt.NDArray[np.uint8]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_match_scenes(0, 2, 20_260_101, faults=False, numbers=[0])[0]


@pytest.fixture(scope="module")
def frame(scene: Scene) -> Image:
    return np.ascontiguousarray(render_view(scene, scene.group.views[0].key)[:, :, ::-1])


class TestPropose:
    def test_a_rendered_frame_gets_its_camera(self, scene: Scene, frame: Image):
        true = scene.truth.views[0].camera
        size = ImageSize(frame.shape[1], frame.shape[0])
        found = propose_camera(frame)
        assert (found.outcome, found.reason) == ("proposed", None)
        assert found.camera is not None
        seen = make_lines(
            {name: p[::5].tolist() for name, p in project_markings(true, PITCH, size).items()}
        )
        assert camera_jaccard(found.camera, seen, PITCH, size, (0.005 * size.diagonal,))[0] > 0.75

    def test_what_the_match_knows_is_enough(
        self, scene: Scene, frame: Image, monkeypatch: pytest.MonkeyPatch
    ):
        nowhere = CameraSearchSpace(
            "nowhere", np.array([[0.0, 500.0, -5.0]]), (1.0, 1.0), np.ones(3)
        )
        monkeypatch.setattr("app.paint.propose.MAIN", nowhere)
        monkeypatch.setattr("app.paint.propose.WIDE", nowhere)
        true = scene.truth.views[0].camera
        assert propose_camera(frame).outcome == "unsure"
        found = propose_camera(frame, known=[true])
        assert found.outcome == "proposed"
        assert found.camera is not None
        assert np.linalg.norm(found.camera.position - true.position) < 2.0

    def test_what_is_fainter_than_paint_makes_no_camera_unsure(
        self, monkeypatch: pytest.MonkeyPatch
    ):
        picture = lawn(drawn(TRUE, 3)).astype(np.float64)
        rng = np.random.default_rng(4)
        for x, y in zip(rng.integers(0, 900, 200), rng.integers(100, 530, 200), strict=True):
            picture[y : y + 2, x : x + rng.integers(30, 60)] += 30
        blocks = np.clip(picture, 0, 255).astype(np.uint8)
        found = propose_camera(blocks)
        assert found.outcome == "proposed" and found.agreement is not None
        assert found.camera is not None and found.agreement.explained > 0.8
        assert np.linalg.norm(found.camera.position - TRUE.position) < 0.5
        monkeypatch.setattr("app.paint.propose.CLOSER", 0)
        found = propose_camera(blocks)
        assert found.reason is not None and "looks like paint" in found.reason

    def test_a_line_that_is_seen_in_the_picture_as_it_is_tells_the_position(
        self, monkeypatch: pytest.MonkeyPatch
    ):
        size = ImageSize(1920, 1080)
        true = looking((-0.9, 58.0, -14.0), (-2.0, -6.0, 0.0), 2304.0, size=size)
        picture = np.full((size.height, size.width, 3), (48, 120, 50), np.float64)
        for name, color, broad in (
            ("Circle central", (225, 230, 225), 6),
            ("Middle line", (225, 230, 225), 6),
            ("Side line top", (140, 175, 140), 1),
        ):
            points = np.round(16 * project_markings(true, PITCH, size)[name]).astype(np.int32)
            cv2.polylines(picture, [points], False, color, broad, cv2.LINE_AA, 4)
        noise = np.random.default_rng(1).normal(0, 2, picture.shape)
        image = (cv2.GaussianBlur(picture, (0, 0), 0.6) + noise).clip(0, 255).astype(np.uint8)
        found = propose_camera(image)
        assert (found.outcome, found.reason) == ("proposed", None)
        assert found.camera is not None and found.snapped is not None
        assert found.snapped.size == (size.height, size.width)
        assert np.linalg.norm(found.camera.position - true.position) < 1.0
        monkeypatch.setattr("app.paint.propose.CLOSER", 0)
        found = propose_camera(image)
        assert found.reason is not None and "where the camera stands" in found.reason

    def test_a_camera_stands_where_y_is_positive(self):
        found = propose_camera(lawn(drawn(TRUE, 3)))
        assert found.outcome == "proposed"
        assert found.camera is not None
        assert found.camera.position[1] > 0

    def test_the_centre_circle_tells_as_much_as_two_lines(self):
        true = looking((0.5, 66.0, -17.0), (3.0, -2.0, 0.0), 1750.0, size=SMALL)
        picture = lawn(marked(true, "Circle central", "Middle line"))
        reading = prepare_picture(picture, np.ones(picture.shape[:2], np.bool_))
        asked = (reading, true, PITCH, (4.0, 3.0, 3.0), CalibrationPolicy())
        assert snap_to_prepared_picture(*asked).reason == NO_PAINT
        assert snap_to_prepared_picture(*asked, circles_count_twice=True).reason is None

    def test_at_full_size_it_is_drawn_as_it_was_found(self, monkeypatch: pytest.MonkeyPatch):
        asked = []

        def snap(*given, **named):
            asked.append((given[0].width, given[4], named))
            return snap_to_prepared_picture(*given, **named)

        monkeypatch.setattr("app.paint.ranking.snap_to_prepared_picture", snap)
        small = lawn(drawn(TRUE, 3))
        picture = np.asarray(cv2.resize(small, (1280, 720), interpolation=cv2.INTER_CUBIC))
        assert propose_camera(picture, known=[TRUE]).outcome == "proposed"
        (found, *_, last) = asked
        assert (found[0], last[0]) == (960, 1280)
        # The lens of the match is known, and a circle counts as two lines.
        assert found[1] == last[1] != CalibrationPolicy()
        assert last[2] == {"circles_count_twice": True, "position_is_known": False}

    def test_what_was_found_in_the_small_picture_is_told_in_pixels_of_the_large_one(self):
        reading = prepare_picture(lawn(drawn(TRUE, 3)), np.ones((540, 960), np.bool_))
        pan, tilt, roll = np.radians(TRUE.pan_tilt_roll_degrees)
        aside = replace(TRUE, rotation=rotation_from_pan_tilt_roll(pan + 0.004, tilt, roll))
        seen = find_paint(reading, trace_visible_markings(reading, aside, PITCH), 12.0)
        assert np.median(np.abs(seen.offsets)) > 1.0
        snapped = SnappedCamera(aside, seen, 1.0, None, 0.5, None, (540, 960))
        large = scale_snapped_camera(snapped, 1080, 1920)
        before, after = (to_paint_evidence(item.evidence, item.camera) for item in (snapped, large))
        for name, places in before.points.items():
            told = np.array(after.points[name])
            wanted = np.array(places) * 2 + (0.5, 0.5, 0.0)
            assert told == pytest.approx(wanted, abs=0.001)
        assert (large.error_px, large.moved_px, large.size) == (2.0, 1.0, (1080, 1920))

    def test_what_paint_leaves_open_the_match_tells(self):
        true = looking((-1.0, 60.0, -16.0), (0.0, -4.0, 0.0), 2600.0, size=SMALL)
        picture = lawn(drawn(true, 3))
        alone = propose_camera(picture)
        assert alone.outcome == "unsure"
        assert alone.reason is not None and "where the camera stands" in alone.reason
        found = propose_camera(
            picture, known=[replace(true, position=true.position + np.array([0.6, -0.3, 0.2]))]
        )
        assert (found.outcome, found.reason) == ("proposed", None)
        assert found.camera is not None
        assert np.linalg.norm(found.camera.position - true.position) < 1.0

    def test_a_position_of_another_match_moves_no_camera_that_paint_determines(self):
        alone = propose_camera(lawn(drawn(TRUE, 3)))
        other = replace(TRUE, position=TRUE.position + np.array([2.5, 1.5, -1.0]))
        found = propose_camera(lawn(drawn(TRUE, 3)), known=[other])
        assert alone.camera is not None and found.camera is not None
        assert np.linalg.norm(found.camera.position - TRUE.position) < 0.3

    def test_a_known_position_counts_for_a_marking(self):
        true = looking((-3.0, 56.0, -16.0), (50.0, 0.0, 0.0), 2900.0, size=SMALL)
        picture = lawn(marked(true, "Side line right", "Small rect. right top"))
        reading = prepare_picture(picture, np.ones(picture.shape[:2], np.bool_))
        spread = np.diag(np.array([0.05, 0.05, 0.01, 0.5, 0.5, 0.5, 0.2, 0.01]) ** 2)
        asked = (reading, true, PITCH, (4.0, 3.0, 3.0), CalibrationPolicy(), spread)
        assert snap_to_prepared_picture(*asked).reason == NO_PAINT
        assert snap_to_prepared_picture(*asked, position_is_known=True).reason is None

    def test_a_small_picture_is_read_enlarged_and_told_in_its_own_pixels(
        self, scene: Scene, frame: Image
    ):
        height, width = frame.shape[:2]
        small = cv2.resize(frame, (400, 400 * height // width), interpolation=cv2.INTER_AREA)
        read = resize_and_prepare_frame(small)
        assert isinstance(read, FrameToSearch) and read.image.shape[1] == 800
        found = propose_camera(np.asarray(small, np.uint8))
        assert found.outcome == "proposed"
        assert found.camera is not None and found.snapped is not None
        assert found.snapped.size == small.shape[:2]
        true = scene.truth.views[0].camera.scaled(400 / width, small.shape[0] / height)
        assert found.camera.principal_point == pytest.approx(true.principal_point, abs=0.01)
        seen = true.project_to_ground(np.array([[150.0, 120.0], [250.0, 160.0], [350.0, 200.0]]))
        seen = np.column_stack([seen, np.zeros(len(seen))])
        apart = np.hypot(*(found.camera.project(seen) - true.project(seen)).T)
        assert np.nanmax(apart) < 0.5

    def test_a_squeezed_picture_is_not_proposed(self, frame: Image):
        squeezed = np.asarray(cv2.resize(frame, (1024, 1024), interpolation=cv2.INTER_AREA))
        found = propose_camera(squeezed)
        assert found.outcome == "unsure"
        assert found.reason is not None

    def test_a_square_picture_needs_a_goal_that_says_so(self):
        # Twice as narrow as it was taken: the grass is foreshortened as from farther up.
        blank = np.full((800, 800, 3), 60, np.uint8)
        reason = explain_non_square_pixels(blank, TRUE, PITCH)
        assert reason is not None and "aspect ratio is not that of a broadcast" in reason
        assert explain_non_square_pixels(np.full((540, 960, 3), 60, np.uint8), TRUE, PITCH) is None

    def test_three_lines_say_too_little_of_the_camera(self):
        true = looking((-3.0, 56.0, -16.0), (50.0, 0.0, 0.0), 2900.0, size=SMALL)
        names = ("Side line right", "Small rect. right main", "Small rect. right top")
        frame = resize_and_prepare_frame(lawn(marked(true, *names)))
        assert isinstance(frame, FrameToSearch)
        snapped = snap_to_prepared_picture(
            frame.reading, true, PITCH, (4.0, 3.0, 3.0), CalibrationPolicy()
        )
        assert snapped.reason is None
        seen = PaintAgreement(0.9, 0.9, 400)
        reason = explain_uncertain_camera([RankedCamera(snapped, seen, 1.0)])
        assert reason is not None and "too few markings" in reason

    def test_a_marking_behind_people_is_not_missed(self):
        picture = lawn(drawn(TRUE, 3))
        hidden = marked(TRUE, "Small rect. right main")
        picture[cv2.dilate(hidden.astype(np.uint8), np.ones((13, 13), np.uint8)) > 0] = (
            190,
            30,
            30,
        )
        reading = prepare_picture(picture, np.ones(picture.shape[:2], np.bool_))
        snapped = snap_to_prepared_picture(
            reading, TRUE, PITCH, (4.0, 3.0, 3.0), CalibrationPolicy()
        )
        assert snapped.reason is None
        assert measure_weakest_marking(reading, snapped, PITCH) > 0.7

    @pytest.mark.parametrize(
        ("picture", "reason"),
        [
            (lawn(np.zeros((540, 960), np.bool_)), "no straight line"),
            (np.zeros((540, 960, 3), np.uint8), "no colours"),
            (np.full((540, 960, 3), 240, np.uint8), "white"),
            (lawn(drawn(TRUE, 3))[:100, :100], "too small"),
        ],
        ids=["grass alone", "night", "snow", "tiny"],
    )
    def test_a_picture_without_lines_gets_nothing_and_a_reason(self, picture: Image, reason: str):
        found = propose_camera(picture)
        assert found.outcome == "nothing"
        assert found.camera is None
        assert reason in (found.reason or "")

    def test_lines_of_another_sport_are_no_pitch(self):
        mask = np.zeros((SMALL.height, SMALL.width), np.uint8)
        for x in range(100, 900, 90):
            cv2.line(mask, (x, 60), (x - 80, 500), 1, 3)
        found = propose_camera(lawn(mask.astype(np.bool_)))
        assert found.outcome == "unsure"
        assert found.reason
