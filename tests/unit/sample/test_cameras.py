from __future__ import annotations

import numpy as np

from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.sample.cameras import (
    CENTER,
    COARSE,
    CORNER_RADIUS,
    REPLAYS,
    TrialCameras,
    choose_replay_position,
    count_seen_points,
    is_inside_image,
    parallax_angle_at_ball,
    place_cameras,
    project_trials,
)
from app.sample.scene import Scene
from app.soccer.pitch import MARKINGS


class TestAim:
    def test_main_cameras_are_such_as_soccernet_has(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            camera = scene.truth.views[0].camera
            x, y, z = camera.position
            _, tilt, roll = camera.pan_tilt_roll_degrees
            assert -10 <= x <= 11
            assert 41 <= y <= 98
            assert -25 <= z <= -9
            assert 1200 <= camera.focal_length[0] <= 6100
            assert 65 <= tilt <= 84
            assert abs(roll) < 1

    def test_lenses_move_the_corners_by_five_to_twenty_five_pixels(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.truth.views:
                focal = view.camera.focal_length[0]
                corner = view.camera.distortion[0] * CORNER_RADIUS**3 / focal**2
                assert 5 <= corner <= 25

    def test_the_ball_is_in_every_view_and_five_pixels_or_more(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.truth.views:
                center = view.ball_box.center
                assert 0 < center.x < 1279
                assert 0 < center.y < 719
                assert view.ball_diameter_px >= 5.0

    def test_six_markings_and_both_directions_are_in_view(self, clean_scenes: list[Scene]):
        for scene in clean_scenes:
            for view in scene.group.views:
                names = list(view.station.lines)
                assert len(names) >= 6
                assert any(name.endswith(("top", "bottom")) for name in names)
                assert any(
                    name.endswith((" main", "Middle line")) or "Side line" in name for name in names
                )


class TestReplaySeat:
    def test_replays_come_from_all_around(self):
        rng = np.random.default_rng(1)
        rig = place_cameras(rng)
        drawn = [choose_replay_position(rng, rig, np.array([40.0, 0.0, -0.1])) for _ in range(300)]
        assert {kind for kind, _ in drawn} == set(REPLAYS)
        seats = np.array([seat for _, seat in drawn])
        assert (seats[:, 1] < -40).any()
        assert (seats[:, 0] > 55).any()
        assert (seats[:, 0] < -55).any()


class TestParallax:
    def test_rays_along_two_axes_meet_at_a_right_angle(self):
        ball = np.array([0.0, 0.0, 0.0])
        assert (
            parallax_angle_at_ball(np.array([9.0, 0, 0]), np.array([0, 4.0, 0]), ball) == np.pi / 2
        )


def _trials() -> TrialCameras:
    return TrialCameras(
        position=np.array([[1.0, 60.0, -14.0], [-70.0, 3.0, -9.0]]),
        pan=np.array([0.3, 1.4]),
        tilt=np.array([1.32, 1.40]),
        roll=np.array([0.01, -0.01]),
        focal=np.array([1800.0, 1500.0]),
        k1=np.array([0.1, 0.05]),
    )


class TestProjectTrials:
    def test_agrees_with_the_camera_of_the_geometry_floor(self):
        trials = _trials()
        pixels = project_trials(trials, COARSE.points)
        for i in range(2):
            distortion = np.zeros(12)
            distortion[0] = trials.k1[i]
            camera = Camera(
                rotation_from_pan_tilt_roll(trials.pan[i], trials.tilt[i], trials.roll[i]),
                trials.position[i],
                (trials.focal[i], trials.focal[i]),
                (CENTER[0], CENTER[1]),
                distortion=distortion,
            )
            np.testing.assert_allclose(pixels[i], camera.project(COARSE.points), atol=1e-7)


class TestSeenPoints:
    def test_counts_the_points_of_each_marking(self):
        counts = count_seen_points(np.ones(len(COARSE.points), dtype=bool), COARSE)
        assert counts.sum() == len(COARSE.points)
        assert counts.shape == (len(MARKINGS),)
        assert counts.min() >= 5


class TestInside:
    def test_what_is_not_visible_is_not_inside(self):
        assert is_inside_image(np.array([[5.0, 5.0], [-1.0, 5.0], [np.nan, np.nan]])).tolist() == [
            True,
            False,
            False,
        ]
