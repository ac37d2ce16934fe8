"""Runs of the ball, and how another click mends them."""

from __future__ import annotations

from dataclasses import replace

from app.tracking.ball_run import BallClick, BallRun, End, FollowedBall


def ball(frame: int, x: float, state: str = "followed") -> FollowedBall:
    return FollowedBall(frame, x, 50.0, 8.0, 0.2, 0.9, state)  # type: ignore[arg-type]


def run(
    click: int, frames: range, x: float = 0.0, before: End = "lost", after: End = "lost"
) -> BallRun:
    """The ball at 10 px a frame, or beside that."""
    balls = tuple(ball(frame, 10.0 * frame + x) for frame in frames)
    return BallRun((BallClick(click, 10.0 * click + x, 50.0),), balls, before, after)


def places(found: BallRun) -> dict[int, float]:
    return {one.frame: one.x - 10.0 * one.frame for one in found.balls}


class TestMended:
    def test_a_click_behind_the_end_makes_it_longer(self) -> None:
        found = run(5, range(20)).merge_run(run(24, range(15, 40), after="limit"))
        assert [one.frame for one in found.balls] == list(range(40))
        assert [click.frame for click in found.clicks] == [5, 24]
        assert (found.before, found.after) == ("lost", "limit")

    def test_what_was_followed_wrongly_goes_and_what_agrees_stays(self) -> None:
        right, wrong = range(12), range(12, 30)
        balls = (*(ball(n, 10.0 * n) for n in right), *(ball(n, 10.0 * n + 60) for n in wrong))
        old = BallRun((BallClick(5, 50, 50),), balls, "left", "lost")
        found = old.merge_run(run(15, range(8, 25)))
        assert set(places(found)) == set(range(25))
        assert set(places(found).values()) == {0.0}
        assert (found.before, found.after) == ("left", "lost")

    def test_an_earlier_click_and_what_lies_behind_it_stays(self) -> None:
        old = run(5, range(40)).merge_run(run(30, range(25, 40)))
        found = old.merge_run(run(20, range(18, 23), x=100.0))
        assert places(found)[20] == 100.0
        assert places(found)[5] == places(found)[4] == places(found)[30] == 0.0
        assert 10 not in places(found) and 25 not in places(found)

    def test_the_same_frame_again_is_another_place_of_the_same_click(self) -> None:
        found = run(5, range(10)).merge_run(run(5, range(3, 9), x=30.0))
        assert [click.x for click in found.clicks] == [80.0]
        assert places(found) == dict.fromkeys(range(3, 9), 30.0)


class TestSurest:
    def test_it_is_the_click_that_was_seen_best_however_far_off(self) -> None:
        found = run(5, range(40)).merge_run(run(20, range(18, 23)))
        balls = [replace(one, sigma_px=0.5) if one.frame == 20 else one for one in found.balls]
        assert replace(found, balls=tuple(balls)).find_most_certain_click().frame == 5  # type: ignore[union-attr]
        unseen = FollowedBall(30, 300.0, 50.0, 8.0, 2.0, 1.0, "followed")
        blind = BallRun((BallClick(30, 300.0, 50.0),), (unseen,), "lost", "lost")
        assert found.merge_run(blind).find_most_certain_click().frame == 5  # type: ignore[union-attr]
        assert blind.find_most_certain_click() == unseen
