"""Predicted tracks against true ones, by numbers that can be checked by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InputError
from app.evaluation.prediction_run import PredictedTrack
from app.evaluation.result import Evaluation
from app.evaluation.track_scores import GroundTruthTrack, evaluate_tracks

COUNT = 50
FRAMES = 100 + np.arange(COUNT)
TIMES = FRAMES / 25.0
PLACES = np.column_stack([0.2 * np.arange(COUNT), np.zeros(COUNT), np.full(COUNT, -1.0)])
TRUTH = GroundTruthTrack(
    "cup/final 1",
    "cup_final 1",
    FRAMES,
    TIMES,
    np.where((np.arange(COUNT) >= 40)[:, None], np.nan, PLACES),
    ("measured",) * 20 + ("one_view",) * 20 + ("gap",) * 10,
    ("flight",) * 30 + ("roll",) * 10 + ("",) * 10,
    (("kick", 4.2), ("bounce", 4.8)),
)


def predicted(off: float = 0.0, sigma: float | None = 0.1, rows: range = range(COUNT)):
    places = PLACES + np.array([off, 0.0, 0.0])
    return PredictedTrack(
        tuple(int(FRAMES[row]) for row in rows),
        tuple(float(TIMES[row]) for row in rows),
        tuple(tuple(places[row].tolist()) for row in rows),
        tuple(None if sigma is None else (sigma,) * 3 for _ in rows),
        (("kick", 106, None), ("bounce", None, 5.6), ("out", 110, None)),
    )


def value(found: Evaluation, row: str, column: str, table: str = "tracks") -> float | None:
    return found.table(table).cell(row, column).value


class TestEvaluateTracks:
    def test_errors_and_coverage_have_their_denominators(self) -> None:
        found = evaluate_tracks([TRUTH], {"": predicted(0.3, rows=range(10))})
        cell = found.table("tracks").cell("all", "mae_m")
        assert (cell.value, cell.count, cell.of) == (pytest.approx(0.3), 10, 40)
        assert value(found, "all", "coverage") == 0.25
        assert value(found, "all", "p_2m") == 1.0
        assert value(found, "all", "p_2m_all") == 0.25
        assert value(found, "one_view", "mae_m") is None
        assert value(found, "measured", "coverage") == 0.5

    def test_the_curve_is_that_of_the_errors(self) -> None:
        found = evaluate_tracks([TRUTH], {"": predicted(3.0)})
        (panel,) = found.figures[0].panels
        solid = panel.series[0]
        assert value(found, "all", "p_2m") == 0.0
        assert dict(zip(solid.x, solid.y, strict=True))[2.95] == 0.0
        assert dict(zip(solid.x, solid.y, strict=True))[3.05] == 1.0

    def test_sigma_is_checked_where_there_is_one(self) -> None:
        generator = np.random.default_rng(1)
        places = PLACES + generator.normal(0, 0.1, PLACES.shape)
        honest = replace(predicted(), position=tuple(map(tuple, places.tolist())))
        bold = replace(honest, sigma=((0.02,) * 3,) * COUNT)
        shares = [
            value(evaluate_tracks([TRUTH], {"": item}), "all", "inside_95")
            for item in (honest, bold, predicted(sigma=None))
        ]
        assert shares[0] > 0.85
        assert shares[1] < 0.2
        assert shares[2] is None

    def test_events_are_one_and_the_same_within_two_frames(self) -> None:
        found = evaluate_tracks([TRUTH], {"": predicted()})
        # The kick of frame 106 is that of 4.2 s (frame 105); 5.6 s is no bounce of 4.8 s.
        assert value(found, "kick", "f1", "track_events") == 1.0
        assert value(found, "bounce", "recall", "track_events") == 0.0
        assert value(found, "any", "precision", "track_events") == pytest.approx(1 / 3)
        assert value(found, "any", "f1", "track_events") == pytest.approx(2 / 5)
        assert value(found, "out", "recall", "track_events") is None

    def test_without_predicted_events_there_is_no_table_of_them(self) -> None:
        found = evaluate_tracks([TRUTH], {"": replace(predicted(), events=None)})
        assert found.table("track_events") is None

    @pytest.mark.parametrize(("rate", "shift"), [(25, 0.019), (25, -0.013), (30, 0.0), (24, 0.0)])
    def test_a_ball_is_compared_at_its_own_time(self, rate: int, shift: float) -> None:
        """Whatever runs at another rate, or between the frames, is neither punished nor left out."""
        times = np.arange(TIMES[0] - 0.1, TIMES[-1], 1 / rate) + shift
        x = (times - TIMES[0]) * 5.0 + 0.1
        right = PredictedTrack(
            (None,) * len(times),
            tuple(times.tolist()),
            tuple((float(at), 0.0, -1.0) for at in x),
            (None,) * len(times),
            (("kick", None, 4.2 + 2.2 / 25),),
        )
        found = evaluate_tracks([TRUTH], {"": right})
        assert value(found, "all", "mae_m") == pytest.approx(0.1, abs=1e-9)
        assert found.counts["track_frames_compared"] == 40
        assert value(found, "kick", "f1", "track_events") == 0.0

    def test_a_late_clock_is_an_error(self) -> None:
        late = replace(predicted(), frames=(None,) * COUNT, times=tuple((TIMES + 0.013).tolist()))
        found = evaluate_tracks([TRUTH], {"": late})
        assert value(found, "all", "mae_m") == pytest.approx(5.0 * 0.013, abs=1e-9)

    def test_few_balls_a_second_count_for_their_own_frames_alone(self) -> None:
        few = predicted(rows=range(0, COUNT, 5))
        few = replace(few, frames=(None,) * len(few.frames))
        found = evaluate_tracks([TRUTH], {"": few})
        assert value(found, "all", "coverage") == 0.2
        assert value(found, "all", "mae_m") == pytest.approx(0)

    def test_the_error_of_each_frame_is_shown(self) -> None:
        found = evaluate_tracks([TRUTH], {"": predicted(0.3, rows=range(2, 10))})
        figure = next(one for one in found.figures if one.name == "track_error")
        series = figure.panels[0].series[0]
        assert series.x == tuple(range(102, 110))
        assert series.y == pytest.approx((0.3,) * 8)

    @pytest.mark.parametrize("rate", [50, 100])
    def test_of_several_predictions_of_a_frame_the_nearest_in_time_is_compared(
        self, rate: int
    ) -> None:
        times = np.arange(TIMES[0] - 0.1, TIMES[-1], 1 / rate)
        x = np.interp(times, TIMES, PLACES[:, 0])
        dense = PredictedTrack(
            (None,) * len(times),
            tuple(times.tolist()),
            tuple((float(at), 0.0, -1.0) for at in x),
            (None,) * len(times),
            None,
        )
        found = evaluate_tracks([TRUTH], {"": dense})
        assert value(found, "all", "mae_m") == pytest.approx(0, abs=1e-9)
        assert found.counts["predicted_frames_without_truth"] < len(times) / 3


class TestJoins:
    """What misses is counted and named."""

    def test_balls_without_a_true_one_are_counted(self) -> None:
        counts = evaluate_tracks([TRUTH], {"": predicted()}).counts
        assert counts["predicted_frames"] == 50
        assert counts["predicted_frames_without_truth"] == 10
        assert counts["track_frames"] == counts["track_frames_compared"] == 40

    def test_stretches_are_found_by_key_and_by_folder(self) -> None:
        other = replace(TRUTH, key="cup/other", folder="cup_other")
        found = evaluate_tracks(
            [TRUTH, other], {"CUP_final 1": predicted(), "cup/OTHER": predicted(1.0)}
        )
        assert value(found, "stretch cup/other", "mae_m") == pytest.approx(1.0)
        assert found.counts["stretches_not_predicted"] == 0

    def test_those_that_miss_are_named(self) -> None:
        other = replace(TRUTH, key="cup/other", folder="cup_other")
        found = evaluate_tracks([TRUTH, other], {"cup_other": predicted(), "nobody": predicted()})
        note = found.table("tracks").note
        assert "Not predicted: cup/final 1." in note
        assert "Predicted, but no stretch of the truth: nobody." in note
        assert found.counts["predicted_stretches_unknown"] == 1
        assert found.counts["predicted_frames_without_truth"] == 60

    def test_nothing_in_common_is_refused_with_the_names(self) -> None:
        far = replace(predicted(), frames=tuple(int(frame) + 900 for frame in FRAMES))
        with pytest.raises(InputError, match="stretches: cup/final 1"):
            evaluate_tracks([TRUTH], {"": far})
        other = replace(TRUTH, key="b", folder="b")
        with pytest.raises(InputError, match="predicted: nobody"):
            evaluate_tracks([TRUTH, other], {"nobody": predicted()})
