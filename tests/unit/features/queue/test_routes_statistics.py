"""Statistics over HTTP."""

from __future__ import annotations

from app.features.queue.routes import StatisticsHistogram
from app.features.queue.statistics import Measure, MeasureCountsOfSplit, MeasureHistogram

MEASURE = Measure("jac", "JaC", "", "jac", (0.0, 0.5, 1.0), open_high=False)


class TestStatisticsHistogram:
    def test_has_the_bins_of_its_measure_and_its_own_counts_beside_them(self) -> None:
        found = MeasureHistogram(
            MEASURE, ("jac<0.5", "jac>=0.5"), (MeasureCountsOfSplit("train", (1, 2), 0),)
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


class TestGetStatistics:
    def test_each_bar_has_the_query_that_finds_its_groups(self, api) -> None:
        answer = api.get("/api/v1/datasets/broadcast/statistics")
        assert answer.status_code == 200
        found = answer.json()
        assert found["groups"] == 3
        for histogram in found["histograms"]:
            (series,) = histogram["series"]
            assert sum(series["counts"]) + series["unknown"] == 3
            bar = max(range(len(series["counts"])), key=series["counts"].__getitem__)
            query = {"dataset": "broadcast", "q": histogram["queries"][bar]}
            total = api.get("/api/v1/groups", params=query).json()["total"]
            assert total == series["counts"][bar]
        assert found["splits"] == [{"split": "train", "groups": 3, "passing": 3, "accepted": 0}]
        assert sum(map(sum, found["positions"]["counts"])) == 3

    def test_a_query_that_cannot_be_understood_is_400(self, api) -> None:
        answer = api.get("/api/v1/datasets/broadcast/statistics", params={"q": "colour:red"})
        assert (answer.status_code, answer.json()["pointer"]) == (400, "/q/0")

    def test_a_dataset_that_is_not_there_is_404(self, api) -> None:
        assert api.get("/api/v1/datasets/nothing/statistics").status_code == 404
