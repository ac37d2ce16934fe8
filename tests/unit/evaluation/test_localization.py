from __future__ import annotations

from dataclasses import replace

import pytest

from app.evaluation.bootstrap import MatchResamples
from app.evaluation.localization import make_localization_table, make_precision_distance_figure
from app.evaluation.result import FrameResult

RESULT = FrameResult(1, 1, "g", "v", "m", ball=True, detections=1, distance_m=50.0)


@pytest.fixture
def frames() -> list[FrameResult]:
    """Errors of 1 and 4 m, a detection that hits nothing and lies 30 m off, and a miss."""
    near = replace(RESULT, error_m=1.0, error_percent=2.0, any_error_m=1.0)
    far = replace(RESULT, error_m=4.0, error_percent=8.0, any_error_m=4.0, match="n")
    return [near, far, replace(RESULT, any_error_m=30.0), RESULT]


class TestLocalizationTable:
    def test_as_the_paper_counts(self, frames) -> None:
        table = make_localization_table(frames, MatchResamples.draw(["m", "n"]), predicted=False)
        cells = {name: table.cell("oracle", name) for name in ("mae_m", "mae_percent", "p_2m")}
        assert [cell.value for cell in cells.values()] == [2.5, 5, 0.5]
        assert all((cell.count, cell.of) == (2, 4) for cell in cells.values())
        assert table.cell("oracle", "median_m").value == 2.5

    def test_over_all_frames_a_miss_is_a_miss(self, frames) -> None:
        table = make_localization_table(frames, MatchResamples.draw(["m", "n"]), predicted=False)
        places, near = table.cell("oracle_all", "mae_m"), table.cell("oracle_all", "p_2m")
        assert places.value == pytest.approx(35 / 3)
        assert (places.count, places.of) == (3, 4)
        assert (near.value, near.count, near.of) == (0.25, 4, 4)

    def test_predicted_cameras_have_rows_of_their_own(self, frames) -> None:
        frames[0] = replace(frames[0], predicted_error_m=3.0, predicted_error_percent=6.0)
        table = make_localization_table(frames, MatchResamples.draw(["m", "n"]), predicted=True)
        cell = table.cell("predicted", "mae_m")
        assert (cell.value, cell.count, cell.of) == (3, 1, 4)
        assert table.cell("predicted", "mae_percent").value == 6

    def test_an_error_of_exactly_two_metres_is_not_within(self) -> None:
        frame = replace(RESULT, error_m=2.0, error_percent=4.0, any_error_m=2.0)
        table = make_localization_table([frame], MatchResamples.draw(["m"]), predicted=False)
        assert table.cell("oracle", "p_2m").value == 0


class TestPrecisionDistance:
    def test_counts_frames_with_a_smaller_error(self, frames) -> None:
        (panel,) = make_precision_distance_figure(frames, predicted=False).panels
        curve, everywhere = panel.series
        at = dict(zip(curve.x, curve.y, strict=True))
        assert (at[0.0], at[1.0], at[1.1], at[4.0], at[4.1], at[20.0]) == (0, 0, 0.5, 0.5, 1, 1)
        assert everywhere.y[-1] == 0.5
        assert "of 4" in everywhere.label

    def test_a_point_opens_the_frames_that_its_curve_counts(self, frames) -> None:
        frames = [replace(frame, predicted_error_m=3.0) for frame in frames]
        (panel,) = make_precision_distance_figure(frames, predicted=True).panels
        assert [series.frames[0].field for series in panel.series] == [
            "error_m", "any_error_m", "predicted_error_m", "predicted_any_error_m",
        ]  # fmt: skip
        for series in panel.series:
            for behind, count in zip(series.frames, series.count, strict=True):
                errors = [getattr(frame, behind.field) for frame in frames]
                assert sum(error is not None and error < behind.high for error in errors) == count
