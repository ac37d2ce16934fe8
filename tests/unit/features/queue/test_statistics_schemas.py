"""Histograms travel with the bins of their measure."""

from __future__ import annotations

from app.features.queue.statistics import Measure, MeasureHistogram, MeasureSeries
from app.features.queue.statistics_schemas import StatisticsHistogram

MEASURE = Measure("jac", "JaC", "", "jac", (0.0, 0.5, 1.0), open_high=False)


class TestStatisticsHistogram:
    def test_has_the_bins_of_its_measure_and_its_own_counts_beside_them(self) -> None:
        found = MeasureHistogram(
            MEASURE, ("jac<0.5", "jac>=0.5"), (MeasureSeries("train", (1, 2), 0),)
        )
        assert StatisticsHistogram.model_validate(found).model_dump() == {
            "name": "jac",
            "label": "JaC",
            "unit": "",
            "field": "jac",
            "edges": [0.0, 0.5, 1.0],
            "open_low": False,
            "open_high": False,
            "log": False,
            "queries": ["jac<0.5", "jac>=0.5"],
            "series": [{"split": "train", "counts": (1, 2), "unknown": 0}],
        }
