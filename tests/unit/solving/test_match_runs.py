import numpy as np

from app.solving.match_model import FramePlace
from app.solving.match_runs import guess_matches

STAND = np.array([0.3, 60.0, -14.0])
OTHER = STAND + np.array([0.0, 12.0, -4.0])


def turning(stand, count, seed=0, slope=2.0, sigma=0.4):
    """Places of a camera that looks left and right in turn and moves with its pan."""
    generator = np.random.default_rng(seed)
    pans = np.where(np.arange(count) % 2, 0.6, -0.6) + generator.normal(0, 0.1, count)
    moved = stand + np.outer(pans, [slope, 0.0, 0.0]) + generator.normal(0, sigma, (count, 3))
    return [
        FramePlace(at, sigma**2 * np.eye(3), float(pan))
        for at, pan in zip(moved, pans, strict=True)
    ]


class TestGuessMatches:
    def test_runs_of_frames_whose_places_agree_are_matches(self):
        assert guess_matches([*turning(STAND, 5), *turning(OTHER, 4, 1)]) == [0] * 5 + [1] * 4

    def test_a_frame_that_says_nothing_goes_with_the_one_before(self):
        first, second = turning(STAND, 3), turning(OTHER, 3, 1)
        found = guess_matches([None, *first, None, *second, None])
        assert found == [0, 0, 0, 0, 0, 1, 1, 1, 1]

    def test_a_camera_that_moves_with_its_pan_is_one_camera(self):
        assert guess_matches(turning(STAND, 12, slope=8.0)) == [0] * 12

    def test_stadiums_that_are_nearly_alike_are_two(self):
        near = STAND + np.array([0.0, 3.0, -1.0])
        frames = [*turning(STAND, 12), *turning(near, 12, 1)]
        assert guess_matches(frames) == [0] * 12 + [1] * 12

    def test_one_odd_frame_does_not_end_a_match(self):
        frames = turning(STAND, 8)
        frames[3] = FramePlace(STAND + np.array([0.0, 15.0, -10.0]), frames[3].covariance, 0.5)
        assert guess_matches(frames) == [0] * 8

    def test_frames_that_say_nothing_are_each_their_own(self):
        assert guess_matches([None, None]) == [0, 1]
        assert guess_matches([]) == []
