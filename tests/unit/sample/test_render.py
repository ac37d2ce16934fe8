from __future__ import annotations

import numpy as np
import pytest

from app.errors import NotFoundError
from app.sample.cameras import COARSE, is_inside_image
from app.sample.render import Image, render_view
from app.sample.scene import Scene


@pytest.fixture(scope="module")
def frame(clean_scenes: list[Scene]) -> Image:
    scene = clean_scenes[0]
    return render_view(scene, scene.group.views[0].key)


class TestRender:
    def test_a_frame_is_1280_by_720_in_colour(self, frame: Image):
        assert frame.shape == (720, 1280, 3)
        assert frame.dtype == np.uint8

    def test_the_grass_is_green(self, frame: Image, clean_scenes: list[Scene]):
        blue, green, red = frame[400:700, 100:1200].reshape(-1, 3).mean(axis=0)
        assert green > 1.25 * red
        assert green > 1.25 * blue

    def test_markings_are_white_where_the_camera_puts_them(self, clean_scenes: list[Scene]):
        brighter = []
        for scene in clean_scenes[::12]:
            view = scene.truth.views[0]
            image = render_view(scene, view.view).min(axis=2).astype(float)
            goals = COARSE.points[:, 2] < 0
            pixels = view.camera.project(COARSE.points[~goals])
            pixels = pixels[is_inside_image(pixels, 20)].round().astype(int)
            on = image[pixels[:, 1], pixels[:, 0]]
            beside = image[pixels[:, 1] - 12, pixels[:, 0] + 12]
            brighter.append(np.median(on - beside))
        assert min(brighter) > 20

    def test_the_ball_is_bright_where_it_is(self, clean_scenes: list[Scene]):
        for scene in clean_scenes[::15]:
            view = scene.truth.views[0]
            image = render_view(scene, view.view).astype(float)
            x, y = view.camera.project(np.array([view.ball]))[0]
            radius = max(2, int(view.ball_diameter_px / 2))
            column, row = round(x), round(y)
            patch = image[row - radius : row + radius + 1, column - radius : column + radius + 1]
            assert np.percentile(patch.min(axis=2), 85) > 120

    def test_the_same_scene_gives_the_same_pixels(self, frame: Image, clean_scenes: list[Scene]):
        again = render_view(clean_scenes[0], clean_scenes[0].group.views[0].key)
        np.testing.assert_array_equal(again, frame)

    def test_matches_differ(self, frame: Image, clean_scenes: list[Scene]):
        other = clean_scenes[-1]
        assert other.fixture != clean_scenes[0].fixture
        image = render_view(other, other.group.views[0].key)
        assert np.abs(image.mean(axis=(0, 1)) - frame.mean(axis=(0, 1))).max() > 3

    def test_a_view_that_is_not_there_is_named(self, clean_scenes: list[Scene]):
        with pytest.raises(NotFoundError, match=r"99\.png"):
            render_view(clean_scenes[0], "99.png")
