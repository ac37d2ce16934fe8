from __future__ import annotations

import numpy as np
import pytest

from app.sample.cameras import MIN_PARALLAX, parallax_angle_at_ball
from app.sample.order import SEED
from app.sample.scene import Scene
from app.sample.scenes import make_match, true_ball_box
from app.soccer.policy import PAPER, TOUCHLINE
from app.solving.solve import solve
from tests.scenes import make_scenes


class TestMakeScenes:
    def test_the_same_seed_gives_the_same_scenes(self):
        first, second = make_scenes(8, 11), make_scenes(8, 11)
        assert [scene.group for scene in first] == [scene.group for scene in second]
        assert [scene.truth for scene in first] == [scene.truth for scene in second]

    def test_another_seed_gives_others(self):
        assert make_scenes(4, 11)[0].truth != make_scenes(4, 12)[0].truth

    def test_groups_have_two_to_four_views_and_the_main_camera_first(
        self, faulty_scenes: list[Scene]
    ):
        counts = [len(scene.group.views) for scene in faulty_scenes]
        assert set(counts) == {2, 3, 4}
        assert np.mean(counts) == pytest.approx(2.66, abs=0.2)
        for scene in faulty_scenes:
            number = scene.group.key.rsplit("/", 1)[1].removesuffix(".png")
            names = [f"{number}.png"] + [
                f"{number}_{i}.png" for i in range(1, len(scene.group.views))
            ]
            assert [view.key for view in scene.group.views] == names

    def test_the_true_ball_projects_into_the_annotated_box(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.group.views:
                true = scene.truth.view(view.key)
                assert true.ball == scene.truth.ball
                x, y = true.camera.project(np.array([true.ball]))[0]
                box = view.ball.box
                assert box.x < x < box.x + box.width
                assert box.y < y < box.y + box.height

    def test_views_of_a_clean_scene_see_the_ball_from_apart(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            main, *others = (view.camera.position for view in scene.truth.views)
            for other in others:
                assert (
                    parallax_angle_at_ball(main, other, np.array(scene.truth.ball))
                    > MIN_PARALLAX * 0.95
                )

    def test_clean_scenes_are_solved_within_a_decimetre(self, clean_scenes: list[Scene]):
        errors = []
        for scene in clean_scenes[:12]:
            solution = solve(scene.group, PAPER)
            if solution.ball is not None:
                errors.append(np.linalg.norm(np.subtract(solution.ball.point, scene.truth.ball)))
        assert len(errors) >= 11
        assert np.median(errors) < 0.10


class TestMakeMatch:
    def test_some_groups_alone_are_the_same_as_among_all(self):
        whole = make_match(1, 6, 11)
        some = make_match(1, 6, 11, numbers=[4])
        assert some[0].group == whole[4].group
        assert some[0].truth == whole[4].truth

    def test_of_the_sample_a_group_that_lacks_two_stubs_passes_without_a_click(self):
        """Half a pixel of either cost its main camera a quarter of JaC."""
        [scene] = make_match(1, 15, SEED, numbers=[2])
        paper, curated = (solve(scene.group, policy) for policy in (PAPER, TOUCHLINE))
        missing = {fit.marking: fit.length_px for fit in paper.views[0].calibration.markings}
        for fit in curated.views[0].calibration.markings:
            del missing[fit.marking]
        assert sorted(missing) == ["Small rect. left main", "Small rect. left top"]
        assert max(missing.values()) < 1.0
        assert (paper.passes, curated.passes) == (False, True)


class TestBallBox:
    def test_holds_the_outline_of_the_sphere(self, clean_scenes: list[Scene]):
        view = clean_scenes[0].truth.views[0]
        box = true_ball_box(view.camera, np.array(view.ball))
        depth = view.camera.pitch_to_camera(np.array([view.ball]))[0, 2]
        expected = PAPER.ball_diameter_m * view.camera.focal_length[0] / depth
        assert box.diameter == pytest.approx(expected, rel=0.06)
        assert box == view.ball_box
