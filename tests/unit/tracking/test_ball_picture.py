"""Balls found near a click, and fitted to a fraction of a pixel."""

from __future__ import annotations

import numpy as np
import pytest

from app.tracking.ball_picture import (
    BallGreyConversion,
    find_ball,
    find_similar_ball,
    fit_disc,
    make_ball_template,
    match_template,
)
from tests.drawn_balls import drawn, grass

PLACES = [(60.0, 50.0), (60.37, 50.0), (60.5, 49.5), (59.81, 50.24)]


class TestFindBall:
    @pytest.mark.parametrize(("x", "y"), PLACES)
    @pytest.mark.parametrize("diameter", [4.0, 8.0, 14.0])
    def test_a_click_beside_it_snaps_to_centre_and_size(
        self, x: float, y: float, diameter: float
    ) -> None:
        found = find_ball(drawn([(x, y, diameter)], size=(640, 100)), x + 2, y - 1.5)
        assert found is not None
        spot, _ = found
        assert np.hypot(spot.x - x, spot.y - y) < 0.1
        assert abs(spot.diameter - diameter) < 0.15 * diameter + 0.3
        assert 0.05 < spot.sigma_px < 0.8

    def test_the_expected_size_tells_the_ball_from_what_is_larger(self) -> None:
        picture = drawn([(60, 50, 7.0), (75, 57, 18.0)])
        found = find_ball(picture, 61, 51, expected=7.0)
        assert found is not None and abs(found[0].x - 60) < 1.0

    def test_grass_is_no_ball(self) -> None:
        assert find_ball(grass(640, 360), 60, 50) is None

    def test_at_the_rim_of_the_picture_nothing_breaks(self) -> None:
        assert find_ball(drawn([(1, 1, 8)]), 1, 1) is None


class TestFitDisc:
    def test_a_smeared_ball_has_its_centre_in_the_middle(self) -> None:
        picture = drawn([(60.3 + step, 50.6, 8.0) for step in np.linspace(-5, 5, 21)])
        grey = BallGreyConversion.of(picture, 60.3, 50.6, 8).to_grey(picture)
        spot = fit_disc(grey, 61, 50, 8, smear=10, angle=0)
        assert spot is not None
        assert np.hypot(spot.x - 60.3, spot.y - 50.6) < 0.15

    def test_sigma_says_how_far_centres_are_off(self) -> None:
        off, sigma = [], []
        for seed in range(40):
            x, y = 60 + seed % 7 / 7, 50 + seed % 5 / 5
            picture = drawn([(x, y, 6.0)], noise=14.0, seed=seed)
            spot = fit_disc(BallGreyConversion.of(picture, x, y, 6).to_grey(picture), 60.3, 50.3, 6)
            assert spot is not None
            off += [spot.x - x, spot.y - y]
            sigma.append(spot.sigma_px)
        assert np.std(off) < 0.15 and np.std(off) < np.median(sigma) < 0.5

    def test_nothing_bright_has_no_fit(self) -> None:
        grey = np.full((60, 60), 100, np.uint8)
        assert fit_disc(grey, 30, 30, 8) is None
        assert fit_disc(grey, 2, 30, 8) is None


class TestLikeness:
    def test_is_highest_where_the_ball_is_and_its_contrast_one(self) -> None:
        picture = drawn([(60, 50, 8.0)], noise=1.0)
        template = make_ball_template(8.0)
        alike, contrast = match_template(
            BallGreyConversion.of(picture, 60, 50, 8).to_grey(picture), template
        )
        row, column = np.unravel_index(int(alike.argmax()), alike.shape)
        reach = template.shape[0] // 2
        assert (column + reach, row + reach) == (60, 50)
        assert alike.max() > 0.9 and abs(contrast[row, column] - 1) < 0.2


class TestFindLike:
    """A click that mends: the ball looks as in another frame, or is where the person says."""

    PICTURE = drawn([(60.3, 50.6, 8.0)])
    GREY = BallGreyConversion.of(PICTURE, 60.3, 50.6, 8.0).to_grey(
        drawn([(40.4, 30.2, 8.0)], seed=4)
    )

    def test_a_click_beside_it_snaps_to_its_centre(self) -> None:
        spot = find_similar_ball(self.GREY, 42.0, 29.0, 8.0)
        assert np.hypot(spot.x - 40.4, spot.y - 30.2) < 0.4 and spot.sigma_px < 1.0

    def test_where_nothing_looks_like_it_the_click_counts(self) -> None:
        for x, y in ((90.0, 70.0), (1.0, 1.0)):
            spot = find_similar_ball(self.GREY, x, y, 8.0)
            assert (spot.x, spot.y, spot.diameter, spot.sigma_px) == (x, y, 8.0, 2.0)
