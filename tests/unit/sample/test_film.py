from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.paint.evidence import find_paint, prepare_picture, trace_visible_markings
from app.paint.grass import find_field_of_play
from app.sample.cameras import CENTER, CORNER_RADIUS
from app.sample.film import (
    Backdrop,
    add_grain,
    aim_cameras,
    is_ball_hidden,
    make_backdrop,
    render_picture,
)
from app.sample.fixture import make_sample_match
from app.sample.play import PEOPLE, Instant, make_play
from app.soccer.pitch import Pitch

LOOK = make_sample_match(1, 5).look
POSITION = np.array([-3.0, 62.0, -16.0])
AIMS = np.array([[0.0, 0.0, 0.0], [30.0, -4.0, 0.0], [42.0, 6.0, 0.0]])


@pytest.fixture(scope="module")
def cameras() -> list[Camera]:
    return aim_cameras(POSITION, AIMS, np.array([1700.0, 2200.0, 2900.0]), 0.004)


@pytest.fixture(scope="module")
def backdrop(cameras: list[Camera]) -> Backdrop:
    return make_backdrop([camera for camera in cameras for _ in range(5)], LOOK)


@pytest.fixture(scope="module")
def instant() -> Instant:
    return make_play(8.0, 3, tuple(range(PEOPLE))).instant_at(5.0)


class TestAimed:
    def test_what_is_aimed_at_stands_in_the_middle(self, cameras: list[Camera]) -> None:
        for camera, aim in zip(cameras, AIMS, strict=True):
            assert np.allclose(camera.project(aim[None])[0], CENTER, atol=1e-6)
            assert np.array_equal(camera.position, POSITION)
            assert np.radians(camera.pan_tilt_roll_degrees[2]) == pytest.approx(0.004)

    def test_the_lens_follows_the_zoom(self, cameras: list[Camera]) -> None:
        displaced = [
            camera.distortion[0] * (CORNER_RADIUS / camera.focal_length[0]) ** 2 * CORNER_RADIUS
            for camera in cameras
        ]
        assert 8.0 < displaced[0] < displaced[1] < displaced[2] < 16.0


class TestBackdrop:
    def test_paint_lies_where_the_cameras_put_it(
        self, backdrop: Backdrop, cameras: list[Camera]
    ) -> None:
        for camera in cameras:
            image = np.ascontiguousarray(backdrop.render_from(camera)[..., ::-1])
            reading = prepare_picture(image, find_field_of_play(image))
            evidence = find_paint(reading, trace_visible_markings(reading, camera, Pitch()), 4.0)
            assert len(evidence.offsets) > 60
            assert np.median(np.abs(evidence.offsets)) < 0.12

    def test_goals_stand_behind_their_lines(
        self, backdrop: Backdrop, cameras: list[Camera]
    ) -> None:
        image = backdrop.render_from(cameras[2]).min(axis=2)
        post = np.column_stack([np.full(9, 52.5), np.full(9, 3.66), -np.linspace(0.4, 2.2, 9)])
        columns, rows = cameras[2].project(post).round().astype(int).T
        assert (
            min(
                image[row - 1 : row + 2, column - 1 : column + 2].max()
                for row, column in zip(rows, columns, strict=True)
            )
            > 170
        )

    def test_the_other_side_of_the_angles_is_no_edge(self) -> None:
        """A camera that looks along +y has pans of 179 and of -179 degrees in one picture."""
        camera = aim_cameras(
            np.array([0.0, -70.0, -14.0]), np.array([[0.0, 0.0, 0.0]]), np.array([1700.0]), 0.0
        )[0]
        image = make_backdrop([camera], LOOK)
        assert image.image.shape[1] < 1600
        middle = image.render_from(camera)[300:, 600:680].mean(axis=(0, 1))
        assert middle[1] > 1.2 * middle[2]


class TestTake:
    def test_people_and_ball_are_drawn_where_they_are(
        self, backdrop: Backdrop, cameras: list[Camera], instant: Instant
    ) -> None:
        camera = aim_cameras(POSITION, instant.ball[None] * (1, 1, 0), np.array([2200.0]), 0.0)[0]
        alone = make_backdrop([camera], LOOK)
        image, empty = render_picture(alone, camera, instant, LOOK), alone.render_from(camera)
        changed = np.abs(image.astype(int) - empty).max(axis=2) > 40
        places = np.column_stack([instant.feet, np.full(PEOPLE, -0.9)])
        pixels = camera.project(places)
        shown = (pixels > 30).all(axis=1) & (pixels < (1250, 690)).all(axis=1)
        assert shown.sum() > 4
        for x, y in pixels[shown].round().astype(int):
            assert changed[y - 6 : y + 7, x - 5 : x + 6].any()
        x, y = camera.project(instant.ball[None])[0].round().astype(int)
        assert changed[y - 1 : y + 2, x - 1 : x + 2].any()

    def test_somebody_before_the_ball_hides_it(self, instant: Instant) -> None:
        ball = np.array([10.0, 0.0, -0.11])
        camera = aim_cameras(POSITION, ball[None], np.array([2200.0]), 0.0)[0]
        away = np.column_stack([np.linspace(-40, -20, PEOPLE), np.full(PEOPLE, -20.0)])
        clear = replace(instant, ball=ball, feet=away)
        assert not is_ball_hidden(camera, clear)
        way = (POSITION - ball)[:2] / np.linalg.norm((POSITION - ball)[:2])
        before, behind = away.copy(), away.copy()
        before[4], behind[4] = ball[:2] + 0.8 * way, ball[:2] - 0.8 * way
        assert is_ball_hidden(camera, replace(clear, feet=before))
        assert not is_ball_hidden(camera, replace(clear, feet=behind))


class TestAddGrain:
    def test_each_frame_has_its_own_and_none_is_lighter(self) -> None:
        grey = np.full((720, 1280, 3), 120, np.uint8)
        one, other = add_grain(grey, 1), add_grain(grey, 2)
        assert np.array_equal(one, add_grain(grey, 1))
        assert (one != other).mean() > 0.3
        assert one.mean() == pytest.approx(120, abs=0.05)
        assert 0.5 < one.std() < 1.5
