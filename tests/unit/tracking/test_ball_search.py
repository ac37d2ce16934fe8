from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.geometry.camera import Camera
from app.soccer.pitch import Pitch
from app.tracking.ball_models import BOUNCE, FLIGHT, KICK, ROLL
from app.tracking.ball_search import (
    build_knots,
    find_likeliest_history,
    find_view_changes,
    inflate_ray_noise,
)
from tests.unit.tracking.test_ball_solve import BALL, BOTH, LEFT, PLACES, RIGHT, TIMES, seen


class TestKnots:
    def test_rays_go_through_the_ball(self) -> None:
        knots = build_knots(seen(BOTH, noise=0.0), TIMES, np.zeros(2))
        off = PLACES[knots.at] - knots.centres
        assert np.abs(np.einsum("rij,rj->ri", knots.across, off)).max() < 1e-6
        assert np.allclose(np.einsum("rij,rj->ri", knots.across, knots.along), 0.0)

    def test_views_of_other_instants_have_their_own_knots(self) -> None:
        given = seen(BOTH)
        late = np.array([view == "right" for view in given.views])
        times = given.times + np.where(late, 0.013, 0.0)
        knots = build_knots(replace(given, times=times), TIMES, np.zeros(2))
        assert len(knots.times) == 2 * len(TIMES) and (np.diff(knots.starts) == 1).all()
        moved = build_knots(replace(given, times=times), TIMES, np.array([0.0, -0.013]))
        assert len(moved.times) == len(TIMES)

    def test_a_size_says_the_distance(self) -> None:
        given = seen({"left": LEFT}, noise=0.0)
        far = np.linalg.norm(PLACES - LEFT.position, axis=1)
        sizes = 0.226 * 1100.0 / LEFT.pitch_to_camera(PLACES)[:, 2]
        knots = build_knots(
            replace(given, sizes=sizes, size_sigma=np.full(len(sizes), 1.0)), TIMES, np.zeros(1)
        )
        assert knots.far == pytest.approx(far, rel=1e-6)
        assert knots.far_sigma == pytest.approx(knots.far / sizes)


class TestChangedViews:
    def test_it_is_where_a_view_comes_or_goes(self) -> None:
        given = seen(BOTH, hide=[("left", 40, 60), ("left", 80, 90), ("right", 80, 90)])
        changed = find_view_changes(build_knots(given, TIMES, np.zeros(2)))
        assert np.flatnonzero(changed).tolist() == [40, 60]

    def test_views_between_the_frames_of_others_do_not_come_and_go(self) -> None:
        given = seen(BOTH, hide=[("left", 40, 60)])
        late = np.array([view == "right" for view in given.views])
        times = given.times + np.where(late, 0.013, 0.0)
        knots = build_knots(replace(given, times=times), np.zeros(0), np.zeros(2))
        changed = knots.times[find_view_changes(knots)]
        assert changed == pytest.approx([TIMES[39] + 0.013, TIMES[60]])


class TestLouder:
    """Cameras that are not exact: rays of one ball that pass each other."""

    @staticmethod
    def factors(shift: float) -> list[float]:
        given = seen(BOTH)
        of_left = np.array([view == "left" for view in given.views])
        pixels = given.pixels + np.where(of_left[:, None], (0.0, shift), 0.0)
        knots = build_knots(replace(given, pixels=pixels), TIMES, np.zeros(2))
        factor = inflate_ray_noise(knots, 12.0).noise / knots.noise
        return [float(factor[knots.view == view].mean()) for view in (0, 1)]

    def test_rays_that_meet_are_as_noisy_as_they_are_said_to_be(self) -> None:
        assert max(self.factors(0.0)) < 1.2

    def test_those_of_an_inexact_camera_and_its_partner_are_noisier(self) -> None:
        assert min(self.factors(4.0)) > 4.0

    def test_those_of_another_ball_are_left_to_contradict(self) -> None:
        assert self.factors(60.0) == [1.0, 1.0]


class TestSearch:
    def test_modes_are_those_of_the_ball(self) -> None:
        history = find_likeliest_history(build_knots(seen(BOTH), TIMES, np.zeros(2)), Pitch())
        high = -PLACES[:, 2] > 0.6
        assert (history.mode[high] == FLIGHT).mean() > 0.95
        assert {KICK, BOUNCE} <= set(history.event.tolist())
        assert ROLL in history.mode and history.used.all()

    def test_what_a_slip_shows_is_not_used(self) -> None:
        given = seen(BOTH)
        pixels = given.pixels.copy()
        pixels[70] += (60.0, 0.0)
        knots = build_knots(replace(given, pixels=pixels), TIMES, np.zeros(2))
        history = find_likeliest_history(knots, Pitch())
        assert knots.rows[~history.used].tolist() == [70]

    @pytest.mark.parametrize(
        ("views", "wrong"),
        [(BOTH, [0]), (BOTH, [len(TIMES)]), ({"right": RIGHT}, [0]), ({"right": RIGHT}, [0, 1])],
    )
    def test_wrong_balls_of_the_first_instants_are_not_used(
        self, views: dict[str, Camera], wrong: list[int]
    ) -> None:
        given = seen(views)
        pixels = given.pixels.copy()
        pixels[wrong] += (-300.0, 150.0)
        pixels[wrong[1:]] += 200.0
        knots = build_knots(replace(given, pixels=pixels), TIMES, np.zeros(len(views)))
        history = find_likeliest_history(knots, Pitch())
        assert knots.rows[~history.used].tolist() == wrong

    def test_one_view_finds_a_flight_between_kick_and_bounce(self) -> None:
        history = find_likeliest_history(
            build_knots(seen({"right": RIGHT}), TIMES, np.zeros(1)), Pitch()
        )
        high = -PLACES[:, 2] > 0.6
        assert (history.mode[high] == FLIGHT).mean() > 0.8
        assert BALL[:, 3].min() < -0.6

    def test_views_that_are_milliseconds_apart_are_no_two_chances_of_a_touch(self) -> None:
        given = seen(BOTH)
        late = np.array([view == "right" for view in given.views])
        times = given.times + np.where(late, 0.005, 0.0)
        knots = build_knots(replace(given, times=times), TIMES, np.zeros(2))
        usual, found = (
            find_likeliest_history(knots, Pitch(), shortest_s=shortest) for shortest in (0.0, 0.01)
        )
        short = np.diff(knots.times, prepend=-np.inf) < 0.01
        assert np.isin(usual.event[short], (KICK, BOUNCE)).any()
        assert not np.isin(found.event[short], (KICK, BOUNCE)).any()
        assert (found.mode == usual.mode).mean() > 0.97
