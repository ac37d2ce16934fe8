from __future__ import annotations

import numpy as np
import pytest

from app.sample import SEED
from app.sample.cameras import MIN_PARALLAX, PITCH, parallax_angle_at_ball
from app.sample.scene import Scene
from app.sample.scenes import (
    BOX_EXCESS,
    compute_true_ball_box,
    find_visible_marking_paths,
    make_match_scenes,
    simulate_loose_box,
)
from app.soccer.frames import Box
from app.soccer.pitch import CIRCLES, MARKINGS
from app.soccer.policy import PAPER, TOUCHLINE
from app.solving.solve import solve_group
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
            solution = solve_group(scene.group, PAPER)
            if solution.ball is not None:
                errors.append(np.linalg.norm(np.subtract(solution.ball.point, scene.truth.ball)))
        assert len(errors) >= 11
        assert np.median(errors) < 0.10


class TestMakeMatch:
    def test_some_groups_alone_are_the_same_as_among_all(self):
        whole = make_match_scenes(1, 6, 11)
        some = make_match_scenes(1, 6, 11, numbers=[4])
        assert some[0].group == whole[4].group
        assert some[0].truth == whole[4].truth

    def test_of_the_sample_a_group_that_lacks_two_stubs_passes_without_a_click(self):
        """Half a pixel of either cost its main camera a quarter of JaC."""
        [scene] = make_match_scenes(1, 15, SEED, numbers=[2])
        paper, curated = (solve_group(scene.group, policy) for policy in (PAPER, TOUCHLINE))
        missing = {fit.marking: fit.length_px for fit in paper.views[0].calibration.markings}
        for fit in curated.views[0].calibration.markings:
            del missing[fit.marking]
        assert sorted(missing) == ["Small rect. left main", "Small rect. left top"]
        assert max(missing.values()) < 1.0
        assert (paper.passes, curated.passes) == (False, True)


class TestBallBox:
    def test_holds_the_outline_of_the_sphere(self, clean_scenes: list[Scene]):
        view = clean_scenes[0].truth.views[0]
        box = compute_true_ball_box(view.camera, np.array(view.ball))
        depth = view.camera.pitch_to_camera(np.array([view.ball]))[0, 2]
        expected = PAPER.ball_diameter_m * view.camera.focal_length[0] / depth
        assert box.diameter == pytest.approx(expected, rel=0.06)
        assert box == view.ball_box


class TestClickLines:
    def test_clicks_lie_on_the_projected_markings_but_for_their_noise(
        self, clean_scenes: list[Scene]
    ):
        distances = []
        for scene in clean_scenes:
            for view in scene.group.views:
                camera = scene.truth.view(view.key).camera
                for marking, points in view.station.lines.items():
                    curve = camera.project(PITCH.sample(marking, 0.03, 0.03))
                    curve = curve[np.isfinite(curve[:, 0])]
                    offset = np.array(points)[:, None] - curve[None]
                    distances.extend(np.linalg.norm(offset, axis=2).min(axis=1))
        # A Rayleigh tail of at most 1.1 px a click: one in a million beyond 5.8 px.
        assert max(distances) < 7.0
        assert 0.4 < np.median(distances) < 1.3

    def test_clicks_stay_within_the_image_but_for_their_noise(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.group.views:
                points = np.array([p for line in view.station.lines.values() for p in line])
                assert (points > -6).all()
                assert (points < [1279 + 6, 719 + 6]).all()

    def test_lines_have_two_to_eight_points_and_circles_five_to_twelve(
        self, clean_scenes: list[Scene]
    ):
        for scene in clean_scenes:
            for view in scene.group.views:
                for marking, points in view.station.lines.items():
                    low, high = (5, 12) if marking in CIRCLES else (2, 8)
                    assert low <= len(points) <= high

    def test_some_markings_are_not_in_order(self, clean_scenes: list[Scene]):
        turns = 0
        for scene in clean_scenes:
            for view in scene.group.views:
                for marking, points in view.station.lines.items():
                    if marking in CIRCLES or len(points) < 4:
                        continue
                    array = np.array(points)
                    along = (array - array[0]) @ (array[-1] - array[0])
                    turns += bool((np.diff(along) < -100).any())
        assert turns > 5


class TestVisiblePaths:
    def test_a_cut_marking_ends_on_the_border(self, clean_scenes: list[Scene]):
        camera = clean_scenes[0].truth.views[0].camera
        paths = find_visible_marking_paths(camera)
        seen = np.flatnonzero(paths.lengths > 5)
        assert len(seen) > 5
        for number in seen:
            for share in (0.0, 1.0):
                x, y = paths.pixels_at(np.array([number]), np.array([share]))[0]
                ends = camera.project(PITCH.sample(MARKINGS[number], 0.5, 0.5)[[0, -1]])
                at_end = np.nanmin(np.linalg.norm(ends - (x, y), axis=1), initial=np.inf)
                at_border = min(x, 1279 - x, y, 719 - y)
                # The central circle has no end of its own.
                assert MARKINGS[number] == "Circle central" or min(at_end, abs(at_border)) < 0.1

    def test_half_of_the_length_is_half_of_the_way(self, clean_scenes: list[Scene]):
        paths = find_visible_marking_paths(clean_scenes[0].truth.views[0].camera)
        number = int(np.argmax(paths.lengths * [name not in CIRCLES for name in MARKINGS]))
        start, middle, end = paths.pixels_at(np.full(3, number), np.array([0.0, 0.5, 1.0]))
        # Distortion bends the line a little.
        assert middle == pytest.approx((start + end) / 2, abs=12)


class TestLooseBox:
    def test_boxes_are_ten_to_forty_per_cent_too_large(self):
        rng = np.random.default_rng(1)
        tight = Box(300.0, 200.0, 20.0, 20.0)
        ratios = [simulate_loose_box(rng, tight).box.diameter / 20 for _ in range(400)]
        low, high = BOX_EXCESS
        assert 1 + low - 0.05 < min(ratios) < 1 + low + 0.05
        assert 1 + high - 0.1 < max(ratios) < 1 + high + 0.06

    def test_the_size_error_is_like_the_papers(self):
        rng = np.random.default_rng(2)
        tight = Box(300.0, 200.0, 12.0, 12.0)
        errors = [
            100 * abs(simulate_loose_box(rng, tight).box.diameter - 12) / np.hypot(12, 12)
            for _ in range(400)
        ]
        assert 16 < np.mean(errors) < 21


class TestPersonBoxes:
    def test_the_same_person_has_the_same_class_and_id_in_all_views(
        self, clean_scenes: list[Scene]
    ):
        shared = 0
        for scene in clean_scenes:
            seen = [
                {(box["class"], box["ID"]) for box in view.extras.boxes}
                for view in scene.group.views
            ]
            assert all(
                len(people) == len(v.extras.boxes)
                for people, v in zip(seen, scene.group.views, strict=True)
            )
            shared += len(set.intersection(*seen))
        assert shared > 5 * len(clean_scenes)
