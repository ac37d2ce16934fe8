from __future__ import annotations

import numpy as np
import pytest

from app.tracking.time_map import TimeMap, fit_map_to_instants

STEP = 0.04
Pairs = list[tuple[float, float]]


def made_of(pairs: Pairs, assumed: float | None = None) -> TimeMap:
    return fit_map_to_instants(np.array(pairs).reshape(-1, 2), STEP, assumed)


def slow(times: np.ndarray) -> np.ndarray:
    """Live times of a replay that runs at a quarter for four seconds, then as fast as live."""
    return np.where(times < 4, 2 + times / 4, 3 + (times - 4))


class TestMapOfInstants:
    def test_none_is_no_map(self) -> None:
        assert made_of([]).offset is None
        assert "No instant" in (made_of([]).reason or "")

    @pytest.mark.parametrize(("assumed", "speed"), [(None, 1.0), (0.25, 0.25)])
    def test_one_says_the_offset_at_a_speed_that_is_assumed(
        self, assumed: float | None, speed: float
    ) -> None:
        made = made_of([(5.0, 2.0)], assumed)
        assert (made.speed, made.offset) == (speed, 5.0 - speed * 2.0)
        assert f"{speed:g} is assumed" in (made.reason or "")

    def test_two_say_offset_and_speed_each_known_to_a_frame(self) -> None:
        made = made_of([(3.0, 4.0), (2.0, 0.0)])
        assert (made.offset, made.speed) == pytest.approx((2.0, 0.25))
        assert made.reason is None
        assert made.sigma_at(0.0) == made.sigma_at(4.0) == pytest.approx(STEP)
        assert made.sigma_at(2.0) == pytest.approx(STEP / np.sqrt(2))

    def test_two_that_are_close_together_tell_no_speed(self) -> None:
        made = made_of([(2.0, 0.0), (2.12, 0.04)], 0.5)
        assert (made.speed, made.offset) == pytest.approx((0.5, 2.05))
        assert "too close together to tell the speed (3 ± 1.4)" in (made.reason or "")
        assert "0.5 is assumed" in (made.reason or "")

    def test_two_that_do_not_tell_the_time_of_an_end_are_too_close_together(self) -> None:
        # A third of a second apart, one a frame off: the end of a replay of ten seconds is 1.25 s wrong.
        pairs = np.array([(2.0, 0.0), (2.2, 0.32)])
        made = fit_map_to_instants(pairs, STEP, None, 10.0)
        assert (made.too_close, made.by_hand) == (True, True)
        assert made.reason == (
            "The instants are too close together: the end of the replay is known to ± 1.7 s only;"
            " link one farther away, near that end; 0.625 is assumed."
        )
        assert fit_map_to_instants(pairs, STEP, 0.5, 10.0).speed == 0.5
        assert fit_map_to_instants(pairs, STEP, None, 0.5).reason is None
        farther = np.array([(2.0, 0.0), (6.0, 8.0)])
        assert fit_map_to_instants(farther, STEP, None, 10.0).reason is None

    def test_the_start_has_to_be_known_too_and_that_of_a_first_piece(self) -> None:
        late = fit_map_to_instants(np.array([(6.0, 9.0), (6.25, 9.5)]), STEP, None, 10.0)
        assert "the start of the replay is known to ± 1 s only" in (late.reason or "")
        times = np.array([3.0, 3.4, 3.8, 4.2, 6.0, 8.0])
        live = np.where(times < 3.8, 2 + times / 4, 2.95 + (times - 3.8))
        changed = fit_map_to_instants(np.column_stack([live, times]), STEP, None, 8.0)
        assert changed.offset is None and not changed.pieces
        assert "the start of the replay" in (changed.reason or "")

    def test_no_replay_is_much_faster_than_what_it_shows(self) -> None:
        made = made_of([(2.0, 0.0), (14.0, 4.0)])
        assert made.speed is None
        assert (
            made.reason
            == "The instants make the replay run at 3 times the live speed, which is unlikely: check them."
        )

    def test_more_are_fitted_and_inaccuracy_of_a_frame_is_no_change_of_speed(self) -> None:
        random = np.random.default_rng(1)
        times = np.linspace(0, 8, 9)
        for _ in range(20):
            live = 2 + 0.25 * times + random.normal(0, STEP, len(times))
            made = made_of(list(zip(live, times, strict=True)))
            assert made.pieces == ()
            assert made.speed == pytest.approx(0.25, abs=0.03)

    def test_a_change_of_speed_is_found_at_an_instant(self) -> None:
        times = np.array([0.0, 1.3, 2.9, 4.0, 5.0, 6.2])
        made = made_of(list(zip(slow(times), times, strict=True)))
        assert [piece.speed for piece in made.pieces] == pytest.approx([0.25, 1.0])
        assert (made.pieces[0].last, made.pieces[1].first) == (4.0, 4.0)
        assert "change near 4.00 s" in (made.reason or "")
        asked = np.array([-1.0, 0.5, 3.9, 4.1, 7.0])
        assert made.to_live_times(asked) == pytest.approx(slow(asked))

    def test_those_that_run_backwards_are_no_map(self) -> None:
        made = made_of([(3.0, 1.0), (2.0, 2.0)])
        assert made.offset is None
        assert "backwards" in (made.reason or "")
