"""A click on a ball followed through pictures: past clutter, kicks and people, and said to be lost where it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from app.geometry.arrays import FloatArray
from app.tracking.ball_follow import expected_ball_diameter, follow_ball
from app.tracking.ball_run import (
    BallClick,
    BallRun,
    DetectedBall,
    ExpectedPlace,
    FollowHints,
)
from app.video.frames import Image
from tests.cameras import looking
from tests.drawn_balls import drawn, grass

FRAMES, SIZE = 50, (420, 240)
GROUND = grass(900, 400)
MAIN = looking((0, 62, -16), (0, 0, 0), 1900)
Draw = Callable[[Image, int], None]


@dataclass
class Film:
    """Pictures of a ball, and where it is."""

    way: FloatArray
    """Shape (N, 2), pixels of the picture."""
    pan: float = 0.0
    diameter: float = 8.0
    clutter: tuple[tuple[float, float], ...] = ()
    """Balls that lie about, pixels of the ground."""
    before: Draw | None = None
    """What is drawn over the ball."""

    def read(self, number: int) -> Image:
        left = 100 + round(self.pan * number)
        ground = GROUND[60 : 60 + SIZE[1], left : left + SIZE[0]]
        x, y = self.way[number]
        lying = [(cx - left, cy - 60, self.diameter) for cx, cy in self.clutter]
        picture = ground
        for one in [*lying, (x, y, self.diameter)]:
            picture = drawn([one], size=SIZE, ground=picture, noise=0, seed=number)
        picture = drawn([], size=SIZE, ground=picture, noise=3, seed=number)
        if self.before is not None:
            self.before(picture, number)
        return picture

    def followed(self, frame: int, hints: FollowHints | None = None) -> BallRun:
        x, y = self.way[frame] + np.array([1.0, -1.0])
        before, after = range(frame - 1, -1, -1), range(frame + 1, len(self.way))
        run = follow_ball(self.read, BallClick(frame, x, y), before, after, hints)
        assert run is not None
        return run

    def off(self, run: BallRun) -> FloatArray:
        """How far each frame of a run is off, pixels."""
        return np.array([np.hypot(*(self.way[b.frame] - (b.x, b.y))) for b in run.balls])


def straight(frames: int = FRAMES, speed: float = 5.0) -> FloatArray:
    steps = np.arange(frames)
    return np.column_stack([60 + speed * steps, 60 + 1.7 * steps])


def hide(picture: Image, place: FloatArray, hidden: bool) -> None:
    """Put somebody before a ball."""
    if hidden:
        x, y = place.astype(int)
        picture[y - 30 : y + 30, x - 12 : x + 12] = (120, 30, 40)


class TestFollowBall:
    @pytest.mark.parametrize("pan", [0.0, 4.0])
    def test_one_click_in_the_middle_follows_to_both_ends(self, pan: float) -> None:
        film = Film(straight(), pan)
        run = film.followed(25)
        assert [ball.frame for ball in run.balls] == list(range(FRAMES))
        assert (run.before, run.after) == ("limit", "limit")
        assert np.median(film.off(run)) < 0.15 and film.off(run).max() < 1.0
        assert {ball.state for ball in run.balls} == {"followed"}
        assert abs(np.median([ball.diameter for ball in run.balls]) - 8) < 0.6

    def test_a_large_ball_is_followed_through_a_whip_pan(self) -> None:
        size, ground, left = (1600, 300), grass(3200, 300), [0, 0, 0, 240, 480, 720, 960, 1200]

        def read(number: int) -> Image:
            part = ground[:, left[number] : left[number] + size[0]]
            ball = (1450.0 - left[number], 150.0, 32.0)
            return drawn([ball], size=size, ground=part, noise=3, seed=number)

        run = follow_ball(read, BallClick(0, 1450, 150), range(0), range(1, len(left)))
        assert run is not None and run.after == "limit"
        places = [ball.x for ball in run.balls]
        assert places == pytest.approx([1450 - one for one in left], abs=1.0)

    def test_a_kick_is_followed(self) -> None:
        steps = np.arange(FRAMES)
        way = np.column_stack([120 + 0.4 * steps, np.full(FRAMES, 120.0)])
        way[20:] = way[20] + (steps[20:, None] - 20) * np.array([9.0, -2.5])
        film = Film(way)
        run = film.followed(5)
        assert run.last > 45 and film.off(run).max() < 4.0

    def test_balls_that_lie_on_its_way_do_not_keep_it(self) -> None:
        film = Film(straight(), 2.0, clutter=((250.0, 170.0), (330.0, 190.0), (300, 140)))
        run = film.followed(3)
        assert run.last == FRAMES - 1
        sure = np.array([ball.state == "followed" for ball in run.balls])
        assert film.off(run)[sure].max() < 4.0

    def test_behind_somebody_it_is_uncertain_and_found_again(self) -> None:
        def wall(picture: Image, _: int) -> None:
            picture[40:200, 180:204] = (120, 30, 40)

        film = Film(straight(), before=wall)
        run = film.followed(5)
        hidden = [ball for ball in run.balls if 180 < film.way[ball.frame][0] < 204]
        assert run.last == FRAMES - 1
        assert hidden and {ball.state for ball in hidden} == {"uncertain"}
        assert max(film.off(run)[-10:]) < 1.0

    @pytest.mark.parametrize("last", [20, 30])
    def test_it_is_lost_where_the_last_frames_do_not_show_it(self, last: int) -> None:
        def wall(picture: Image, number: int) -> None:
            if number > 12:
                picture[:] = (120, 30, 40)

        film = Film(straight(), before=wall)
        run = follow_ball(film.read, BallClick(8, *film.way[8]), range(7, 0, -1), range(9, last))
        assert run is not None
        assert (run.before, run.after) == ("limit", "lost") and run.last < 16

    def test_it_goes_through_other_clicks_and_ends_at_them(self) -> None:
        steps = np.arange(FRAMES)
        way = np.column_stack([120 + 0.4 * steps, np.full(FRAMES, 120.0)])
        way[20:] = way[20] + (steps[20:, None] - 20) * np.array([0.0, 2.0])
        film = Film(way, before=lambda picture, at: hide(picture, way[at], 14 < at < 36))
        clicks = [BallClick(frame, *film.way[frame]) for frame in (4, 30)]
        run = film.followed(8, FollowHints(clicks=clicks))
        assert (run.first, run.last) == (4, 30)
        assert film.off(run)[[0, -1]].max() < 1.0
        assert film.followed(8).last > 30

    def test_two_clicks_tell_how_a_ball_moves(self) -> None:
        """A ball so fast that another one, which lies about, is nearer to where it was."""
        film = Film(straight(30, 11.0), clutter=((222.0, 135.0),))
        run = film.followed(5, FollowHints(clicks=[BallClick(4, *film.way[4])]))
        assert run.first == 4 and film.off(run).max() < 4.0

    def test_a_ball_that_goes_behind_a_wall_for_good_is_lost(self) -> None:
        def wall(picture: Image, _: int) -> None:
            picture[:, 200:] = GROUND[100:340, 200:420]

        run = Film(straight(66), before=wall).followed(5)
        assert run.after == "lost"
        assert run.last < 33

    def test_a_ball_that_leaves_the_picture_has_left(self) -> None:
        film = Film(straight(speed=9.0) + np.array([100.0, 0.0]))
        run = film.followed(5)
        assert run.after == "left"

    def test_other_views_tell_it_from_another_ball_that_rolls_on_as_it_did(self) -> None:
        other, way = straight(FRAMES, 4.0), straight(FRAMES, 4.0)
        way[20:] += (0.0, 30.0)

        def decoy(picture: Image, at: int) -> None:
            if at >= 20:
                x, y = other[at]
                picture[:] = drawn([(x, y, 8.0)], size=SIZE, ground=picture, noise=0)

        film = Film(way, before=decoy)
        rays = {at: [ExpectedPlace((x - 40, y), (x + 40, y), 4.0)] for at, (x, y) in enumerate(way)}
        run = film.followed(10, FollowHints(expected=rays, still=True))
        assert film.off(run)[-10:].max() < 2.0
        assert film.off(film.followed(10, FollowHints(still=True)))[-10:].max() > 10

    def test_frames_that_nobody_has_are_passed(self) -> None:
        film = Film(straight())
        gone = {12, 13, 30}
        x, y = film.way[20]
        run = follow_ball(
            lambda at: None if at in gone else film.read(at),
            BallClick(20, x, y),
            range(19, -1, -1),
            range(21, FRAMES),
        )
        assert run is not None and (run.first, run.last) == (0, FRAMES - 1)
        assert {ball.frame for ball in run.balls if ball.state == "uncertain"} == gone
        assert film.off(run).max() < 4.0

    def test_grass_is_followed_nowhere(self) -> None:
        film = Film(straight())
        assert follow_ball(film.read, BallClick(10, 300, 30), [], [11, 12]) is None

    def test_what_a_detector_says_is_a_candidate_and_no_truth(self) -> None:
        film = Film(straight())
        wrong = {n: (DetectedBall(300, 40, 8, 0.9),) for n in range(FRAMES)}
        run = film.followed(5, FollowHints(detected=wrong))
        assert film.off(run).max() < 1.0


class TestExpectedDiameter:
    def test_a_ball_on_the_grass_is_as_large_as_the_camera_says(self) -> None:
        camera = MAIN
        x, y = camera.project(np.array([[5.0, 3.0, -0.11]]))[0]
        far = np.linalg.norm(camera.position - (5.0, 3.0, -0.11))
        size = expected_ball_diameter(camera, x, y)
        assert size is not None
        assert abs(size / (0.22 * camera.focal_length[0] / far) - 1) < 0.05

    def test_the_sky_says_nothing(self) -> None:
        assert expected_ball_diameter(MAIN, 640, -4000) is None


class TestMending:
    """Another click of a run whose ball is known by its looks."""

    def test_a_click_on_a_ball_that_nobody_sees_is_the_ball_and_followed_from_there(self) -> None:
        def wall(picture: Image, number: int) -> None:
            if 20 <= number < 26:
                x, y = straight()[number].round().astype(int)
                picture[y - 12 : y + 13, x - 12 : x + 13] = (130, 40, 50)

        film = Film(straight(), before=wall)
        first = film.followed(5).balls[5]
        x, y = film.way[22]
        around = range(21, -1, -1), range(23, FRAMES)
        refused = follow_ball(film.read, BallClick(22, x, y), *around)
        assert refused is None
        run = follow_ball(film.read, BallClick(22, x, y), *around, FollowHints(seen=first))
        assert run is not None
        by_frame = {ball.frame: ball for ball in run.balls}
        assert (by_frame[22].x, by_frame[22].y, by_frame[22].sigma_px) == (x, y, 2.0)
        found = [number for number, ball in by_frame.items() if ball.state == "followed"]
        assert {10, 30, 40} <= set(found)
        assert np.median(film.off(run)) < 0.5
