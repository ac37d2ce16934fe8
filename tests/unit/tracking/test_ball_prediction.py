"""The error without an instant, against a fit that is made without it."""

from __future__ import annotations

import numpy as np
import pytest

from app.soccer.pitch import Pitch
from app.tracking.ball_fit import fit_ball_path
from app.tracking.ball_prediction import leave_one_out_errors, summarize_prediction_errors
from app.tracking.ball_search import build_knots, find_likeliest_history
from tests.unit.tracking.test_ball_solve import BOTH, TIMES, seen


def test_it_is_that_of_a_fit_without_the_instant() -> None:
    measurements = seen(BOTH).part(np.arange(len(seen(BOTH)))[seen(BOTH).frames < 150])
    times = TIMES[:50]
    knots = build_knots(measurements, times, np.zeros(2))
    history = find_likeliest_history(knots, Pitch())
    given = history.mode, history.event
    unseen, start = np.zeros(len(times)), np.pad(history.state, ((0, 0), (0, 3)))
    whole = fit_ball_path(knots, *given, history.used, start, knots.noise, unseen)
    px = leave_one_out_errors(knots, whole, knots.noise, np.ones(len(times), bool))
    checked = 0
    for knot in (12, 20, 33, 41):
        rays = np.flatnonzero(knots.at == knot)
        used = history.used.copy()
        used[rays] = False
        without = fit_ball_path(knots, *given, used, whole.state, knots.noise, unseen)
        for ray in rays:
            row = knots.rows[ray]
            seen_at = measurements.cameras[row].project(without.state[knot, :3][None])[0]
            miss = float(np.hypot(*(seen_at - measurements.pixels[row])))
            assert px[ray] == pytest.approx(miss, rel=0.1, abs=0.1)
            checked += 1
    assert checked == 8


def test_a_stretch_says_medians_and_what_was_predicted() -> None:
    told = summarize_prediction_errors(
        np.array([1.0, 3.0, np.nan, 8.0]), np.array([5, 5, 6, 7]), np.array([5, 6, 7])
    )
    assert told.predicted == 3 and told.median_px == 3.0
    assert told.by_frame[0] == 2.0 and np.isnan(told.by_frame[1]) and told.by_frame[2] == 8.0


def test_nothing_predicted_is_said() -> None:
    told = summarize_prediction_errors(np.full(2, np.nan), np.array([1, 2]), np.array([1, 2]))
    assert told.median_px is None and told.p95_px is None and told.predicted == 0


def test_each_frame_has_the_median_of_its_own_errors() -> None:
    draw = np.random.default_rng(4)
    px, of_frame = draw.exponential(3.0, 200), draw.integers(0, 40, 200)
    px[draw.random(200) < 0.2] = np.nan
    told = summarize_prediction_errors(px, of_frame, np.arange(45))
    own = [px[(of_frame == frame) & np.isfinite(px)] for frame in range(45)]
    wanted = [np.median(errors) if len(errors) else np.nan for errors in own]
    assert np.array_equal(told.by_frame, wanted, equal_nan=True)
