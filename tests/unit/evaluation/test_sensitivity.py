from __future__ import annotations

import numpy as np
import pytest

from app.evaluation.sensitivity import (
    choose_frames,
    error_slopes,
    make_box_shift_percents,
    make_box_size_percents,
    make_sensitivity_figure,
    make_sensitivity_table,
    measure_frame_sensitivity,
)
from app.geometry.sphere import position_from_diameter
from app.soccer.frames import Box, ImagePoint
from tests.cameras import WIDE_LENSES, wide
from tests.unit.evaluation.conftest import DIAMETER

POINTS = [(0.0, 0.0, -0.113), (9.0, -4.0, -3.0)]


class TestSlopes:
    @pytest.mark.parametrize("distortion", [0.0, 0.2, -0.1])
    @pytest.mark.parametrize("point", POINTS)
    def test_are_the_difference_quotients(self, make_frame, point, distortion: float) -> None:
        frame = make_frame(point=point, distortion=distortion)
        camera, box = frame.camera, frame.boxes["optimized"]
        center, step = np.array(box.center), 1e-4

        def place(shift: float, more: float) -> np.ndarray:
            moved = center + np.array([shift, 0.0])
            return position_from_diameter(camera, moved, box.diameter + more, DIAMETER)

        by_size = np.linalg.norm(place(0, step) - place(0, -step)) / (2 * step)
        by_shift = np.linalg.norm(place(step, 0) - place(-step, 0)) / (2 * step)
        assert error_slopes(camera, box, DIAMETER) == pytest.approx((by_size, by_shift), rel=1e-5)

    @pytest.mark.parametrize("lens", WIDE_LENSES)
    def test_through_a_wide_lens_are_the_difference_quotients(self, lens: str) -> None:
        camera = wide((0.0, 40.0, -9.0), (0.0, 10.0, 0.0), lens)
        center = camera.project(np.array([[-30.0, 25.0, -1.0]]))[0]
        box = Box.square(ImagePoint(*center.tolist()), 4.0)

        def place(shift: float, more: float) -> np.ndarray:
            moved = center + np.array([shift, 0.0])
            return position_from_diameter(camera, moved, 4.0 + more, DIAMETER)

        by_size = np.linalg.norm(place(0, 1e-4) - place(0, -1e-4)) / 2e-4
        by_shift = np.linalg.norm(place(1e-4, 0) - place(-1e-4, 0)) / 2e-4
        assert error_slopes(camera, box, DIAMETER) == pytest.approx((by_size, by_shift), rel=1e-3)

    def test_a_ball_fifty_metres_away_has_the_slopes_computed_by_hand(self, make_frame) -> None:
        # 50 m away: one per cent of the size is half a metre; a pixel is 50 m / 2000.
        frame = make_frame(distance=50.0)
        box = frame.boxes["optimized"]
        by_size, by_shift = error_slopes(frame.camera, box, DIAMETER)
        assert by_size * box.diameter / 100 == pytest.approx(0.5)
        assert by_shift == pytest.approx(0.025)


class TestMeasure:
    def test_ten_per_cent_too_small_is_a_ninth_of_the_distance_too_far(self, make_frame) -> None:
        found = measure_frame_sensitivity(make_frame(distance=50.0), DIAMETER)
        assert found.distance_m == pytest.approx(50)
        assert found.by_size[0] == pytest.approx(50 * (1 / 0.9 - 1))
        assert found.by_size[-1] == pytest.approx(50 * (1 - 1 / 1.1))
        assert found.by_size[len(make_box_size_percents()) // 2] == 0

    def test_two_per_cent_of_the_diagonal_move_it_across(self, make_frame) -> None:
        frame = make_frame(distance=50.0)
        found = measure_frame_sensitivity(frame, DIAMETER)
        assert found.by_shift[-1] == pytest.approx(0.02 * frame.size.diagonal / 2000 * 50)

    def test_the_derivative_touches_the_curve(self, make_frame) -> None:
        found = measure_frame_sensitivity(make_frame(distance=70.0, point=POINTS[1]), DIAMETER)
        for places, curve, slope in (
            (make_box_size_percents(), found.by_size, found.size_slope),
            (make_box_shift_percents(), found.by_shift, found.shift_slope),
        ):
            middle = len(places) // 2
            step = abs(places[middle + 1])
            # The mean of both sides leaves a fault of second order alone.
            measured = (curve[middle + 1] + curve[middle - 1]) / 2 / step
            assert measured == pytest.approx(slope, rel=2e-3)

    def test_grows_with_the_distance(self, make_frame) -> None:
        near, far = (
            measure_frame_sensitivity(make_frame(distance=metres), DIAMETER)
            for metres in (30.0, 90.0)
        )
        assert far.by_size[0] == pytest.approx(3 * near.by_size[0])


class TestChoose:
    def test_is_seeded_and_needs_a_ball(self, make_frame) -> None:
        from dataclasses import replace

        frames = [make_frame(number) for number in range(1, 31)]
        frames[0] = replace(frames[0], point=None)
        chosen = choose_frames(frames, seed=4, size=10)
        assert len(chosen) == 10
        assert frames[0] not in choose_frames(frames, seed=4, size=100)
        assert chosen == choose_frames(frames[::-1], seed=4, size=10)
        assert chosen != choose_frames(frames, seed=5, size=10)


class TestTable:
    def test_tells_ends_and_correlation(self, make_frame) -> None:
        frames = [make_frame(number, distance=20.0 + 10 * number) for number in range(1, 5)]
        samples = [measure_frame_sensitivity(frame, DIAMETER) for frame in frames]
        table = make_sensitivity_table(samples, able=9)
        assert table.cell("size", "smallest_m").value == pytest.approx(30 / 9)
        assert table.cell("size", "largest_m").value == pytest.approx(60 / 9)
        assert table.cell("size", "correlation").value == pytest.approx(1)
        assert (table.rows[0].cells[0].count, table.rows[0].cells[0].of) == (4, 9)

    def test_without_balls_the_table_is_empty(self) -> None:
        assert make_sensitivity_table([], 0).cell("shift", "median_m").value is None


class TestFigure:
    def test_shows_curve_and_derivative_of_every_ball(self, make_frame) -> None:
        figure = make_sensitivity_figure(
            [measure_frame_sensitivity(make_frame(distance=50.0), DIAMETER)]
        )
        assert [len(panel.series) for panel in figure.panels] == [2, 2]
        assert [item.kind for item in figure.panels[0].series] == ["line", "dashed"]
        assert figure.panels[0].series[0].color == pytest.approx(50)
