from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.tracking.ball_rays import BallRays
from app.tracking.link import find_time_map
from app.tracking.time_map import TimeMap
from tests.bench.link import (
    Filmed,
    Planted,
    at_times,
    film,
    made_ball,
    outcome_of,
    plant,
    spoilt,
)

BALL = made_ball()
FRAMES, PERCENT = 0.1, 1.0
"""What a planted map is found within: live frames in the middle of the replay, and of the speed."""
LIVE_STAND, OPPOSITE = (0.0, 62.0, -16.0), (0.0, -75.0, -18.0)
BEHIND_GOAL = (-62.0, 6.0, -3.0)


def linked(planted: Planted, *hints: tuple[float, float]) -> TimeMap:
    return find_time_map(planted.live.rays(), planted.replay.rays(), hints)


def ball_of(*columns: object) -> np.ndarray:
    """A ball at the times of ``BALL``, x, y and z of each."""
    times = BALL[:, 0]
    return np.column_stack([times, *(np.broadcast_to(one, times.shape) for one in columns)])


def two_speeds(first: float, second: float, seed: int = 0) -> tuple[BallRays, BallRays, float]:
    """A replay that changes its speed after three seconds of play, and when it does."""
    generator = np.random.default_rng(seed)
    live_times = np.arange(10.0, 22.0, 0.04)
    before, after = np.arange(0, 3 / first, 0.02), np.arange(0.02, 3 / second, 0.02)
    times = np.concatenate([before, before[-1] + after])
    shown = 11.5 + np.concatenate([first * before, first * before[-1] + second * after])
    live = film(at_times(BALL, live_times), live_times - 10.0, LIVE_STAND, 2000.0)
    replay = film(at_times(BALL, shown), times, OPPOSITE, 1800.0, lag=40)
    views = [spoilt(view, generator, noise_px=0.7).rays() for view in (live, replay)]
    return views[0], views[1], float(before[-1])


class TestPlanted:
    @pytest.mark.parametrize("speed", [1.08, 1.0, 0.5, 0.25, 0.125])
    def test_offset_and_speed_are_found(self, speed: float) -> None:
        for seed in (1, 2):
            planted = plant(BALL, seed, speed=speed, noise_px=0.5, stand=OPPOSITE)
            made = outcome_of(planted)
            assert made.found.reason is None
            assert abs(made.frames) < FRAMES
            assert abs(made.percent) < PERCENT
            assert made.found.miss is not None and made.found.miss < 0.1

    def test_whole_pixels_gaps_and_gross_errors_do_little(self) -> None:
        planted = plant(
            BALL, 3, noise_px=0.5, whole=True, missing=0.35, wrong=0.06, stand=BEHIND_GOAL
        )
        made = outcome_of(planted)
        assert made.found.reason is None
        assert abs(made.frames) < FRAMES
        assert abs(made.percent) < PERCENT

    def test_sigmas_are_those_of_the_errors(self) -> None:
        every = [outcome_of(plant(BALL, seed, noise_px=1.0)) for seed in range(30, 46)]
        z = np.array([one.z for one in every if one.found.reason is None])
        assert len(z) > 10
        assert (np.abs(z) < 1.96).mean() > 0.85
        assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4

    def test_times_of_the_replay_may_begin_anywhere(self) -> None:
        planted = plant(BALL, 4, speed=0.5, noise_px=0.5, stand=OPPOSITE)
        later = replace(planted.replay, times=planted.replay.times + 1000.0)
        first, second = linked(planted), linked(replace(planted, replay=later))
        assert second.speed == pytest.approx(first.speed, abs=1e-5)
        assert second.offset == pytest.approx(first.offset - 1000 * first.speed, abs=1e-2)
        # The offset lies a thousand seconds before the replay: sigma says how little is known of it.
        assert second.covariance[0, 0] > 1000 * first.covariance[0, 0]


class TestUnobservable:
    def test_recordings_of_an_hour_are_too_long(self) -> None:
        planted = plant(BALL, 1, stand=OPPOSITE)
        views = []
        for view in (planted.live, planted.replay):
            rays = view.rays()
            hour = np.concatenate([rays.times + 60.0 * minute for minute in range(60)])
            views.append(replace(rays.part(np.arange(len(hour)) % len(rays)), times=hour))
        made = find_time_map(*views)
        assert made.reason is not None and "too long to be linked" in made.reason

    def test_a_ball_at_rest(self) -> None:
        for seed in range(3):
            planted = plant(ball_of(10.0, 5.0, -0.11), seed, whole=seed == 2)
            assert "hardly moves" in linked(planted).reason

    def test_a_ball_in_the_plane_of_both_cameras(self) -> None:
        t = BALL[:, 0]
        ball = ball_of(0.0, 25 * np.sin(0.5 * t), -0.11 - 2 * np.maximum(0, np.sin(1.3 * t)))
        for seed in range(2):
            made = linked(plant(ball, seed, stand=OPPOSITE))
            assert "plane with both cameras" in made.reason

    def test_a_ball_that_goes_round_and_round(self) -> None:
        t = BALL[:, 0] * np.pi
        made = linked(plant(ball_of(8 * np.cos(t), 8 * np.sin(t), -0.11), 1, stand=OPPOSITE))
        assert "fit as well" in made.reason

    def test_another_action(self) -> None:
        other = made_ball(seed=5)
        for seed in range(3):
            a, b = plant(BALL, seed, stand=OPPOSITE), plant(other, seed, stand=OPPOSITE)
            assert linked(Planted(a.live, b.replay, 0.0, 1.0)).reason

    @pytest.mark.parametrize("turn", [np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0])])
    def test_mirrored_cameras(self, turn: np.ndarray) -> None:
        for seed in range(3):
            planted = plant(BALL, seed, stand=BEHIND_GOAL)
            cameras = [
                replace(
                    camera,
                    position=turn @ camera.position,
                    rotation=np.diag([-1.0, 1.0, 1.0]) @ camera.rotation @ turn,
                )
                for camera in planted.replay.cameras
            ]
            mirrored = replace(planted, replay=replace(planted.replay, cameras=cameras))
            assert linked(mirrored).reason

    def test_cameras_that_were_tracked_turned_are_told(self) -> None:
        planted = plant(BALL, 1, speed=0.5, noise_px=0.5, stand=OPPOSITE)
        made = find_time_map(planted.live.rays(), planted.replay.rays().rotate_half_turn())
        assert made.turned and made.pieces == ()
        assert "turned to the other side of the pitch" in (made.reason or "")
        assert not linked(planted).turned

    def test_exchanged_cameras(self) -> None:
        for seed in range(3):
            planted = plant(BALL, seed, stand=BEHIND_GOAL)
            live, replay = planted.live, planted.replay
            count = min(len(live.times), len(replay.times))

            def with_cameras(view: Filmed, other: Filmed, n: int = count) -> Filmed:
                return Filmed(view.times[:n], view.pixels[:n], other.cameras[:n])

            exchanged = Planted(with_cameras(live, replay), with_cameras(replay, live), 0.0, 1.0)
            assert linked(exchanged).reason

    def test_too_few_rays(self) -> None:
        planted = plant(BALL, 1)
        few = planted.replay.rays().part(np.arange(10))
        assert "replay has 10 rays" in find_time_map(planted.live.rays(), few).reason

    def test_half_a_second_is_too_short(self) -> None:
        planted = plant(BALL, 1, speed=0.25, noise_px=0.3, missing=0.0, stand=OPPOSITE)
        replay = planted.replay.rays()
        short = replay.part(np.flatnonzero(replay.times < replay.times[0] + 2.0))
        assert find_time_map(planted.live.rays(), short).reason


class TestSpeedThatChanges:
    @pytest.mark.parametrize(("first", "second"), [(1.0, 0.3), (0.5, 0.25)])
    def test_each_piece_has_its_map(self, first: float, second: float) -> None:
        live, replay, change = two_speeds(first, second)
        made = find_time_map(live, replay)
        assert made.reason.startswith("One offset and speed do not fit")
        assert [piece.speed for piece in made.pieces] == pytest.approx([first, second], rel=0.02)
        assert made.pieces[0].last == pytest.approx(change, abs=0.4)

    def test_one_speed_is_one_piece(self) -> None:
        live, replay, _ = two_speeds(0.5, 0.5)
        made = find_time_map(live, replay)
        assert made.reason is None
        assert made.pieces == ()


class TestInstantsOfAPerson:
    REST = plant(ball_of(10.0, 5.0, -0.11), 0, speed=0.5)

    def at(self, planted: Planted, replay: float, off: float = 0.0) -> tuple[float, float]:
        return planted.offset + planted.speed * replay + off, replay

    def test_two_link_what_the_ball_does_not(self) -> None:
        first = self.REST.replay.times[0]
        hints = [self.at(self.REST, first + 1, 0.02), self.at(self.REST, first + 5, -0.02)]
        made = linked(self.REST, *hints)
        assert made.reason is None
        assert made.speed == pytest.approx(0.49)
        # Two instants of a frame's sigma each, four seconds apart.
        assert np.sqrt(made.covariance[1, 1]) == pytest.approx(0.04 * np.sqrt(2) / 4, rel=0.1)

    def test_more_say_it_better(self) -> None:
        first = self.REST.replay.times[0]
        two = [self.at(self.REST, first + later) for later in (1, 5)]
        many = [self.at(self.REST, first + later) for later in (1, 1.5, 2, 4, 4.5, 5)]
        sigmas = [linked(self.REST, *hints).covariance[1, 1] for hints in (two, many)]
        assert sigmas[1] < 0.7 * sigmas[0]

    def test_one_alone_says_no_speed(self) -> None:
        assert linked(self.REST, self.at(self.REST, 1.0)).reason

    def test_the_ball_makes_them_exact(self) -> None:
        planted = plant(BALL, 1, speed=0.5, noise_px=0.5, stand=OPPOSITE)
        first = planted.replay.times[0]
        hints = [self.at(planted, first + 1, 0.04), self.at(planted, first + 5, -0.04)]
        made = linked(planted, *hints)
        assert not made.by_hand
        assert made.offset + made.speed * (first + 3) == pytest.approx(
            self.at(planted, first + 3)[0], abs=0.1 * 0.04
        )

    def test_those_that_run_backwards_are_no_map(self) -> None:
        assert "backwards" in linked(self.REST, (3.0, 1.0), (2.0, 2.0)).reason

    def test_one_that_the_ball_contradicts_is_named(self) -> None:
        planted = plant(BALL, 1, speed=0.5, noise_px=0.5, stand=OPPOSITE)
        time, replay = self.at(planted, float(planted.replay.times[0]) + 2, 0.25)
        assert f"{time:g}={replay:g}" in linked(planted, (time, replay)).reason
