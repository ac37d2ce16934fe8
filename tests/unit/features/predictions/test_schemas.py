from __future__ import annotations

from dataclasses import replace

from app.features.predictions.accept import AcceptPlan, ViewAcceptDecision
from app.features.predictions.queries import PredictedBox, PredictionSet
from app.features.predictions.schemas import AcceptOutcome, GroupPrediction, ViewPrediction

SET = PredictionSet(
    3, 1, "old", "coco", "old.json", "2030-08-17T18:00:00Z", "ann", "0" * 64, 1, 1, 0, 0, 0, {}
)
BOX = PredictedBox(7, 3, 31, 1.0, 2.0, 3e9, 4.0, 0.9)
PLAN = AcceptPlan(SET, (ViewAcceptDecision(31, "7.png", 5, "m/7.png", BOX, None),), {})


class TestStoredBox:
    def test_of_a_view_is_told_however_absurd(self) -> None:
        assert ViewPrediction.of(SET, BOX).box == (1.0, 2.0, 3e9, 4.0)
        assert ViewPrediction.of(SET, replace(BOX, width=-1.0)).box[2] == -1

    def test_of_a_dry_run_is_told_however_absurd(self) -> None:
        assert AcceptOutcome.of_plan(PLAN).sample[0].box == (1.0, 2.0, 3e9, 4.0)


class TestAcceptedView:
    def test_says_which_view_of_which_group_and_how_sure_its_prediction_is(self) -> None:
        (shown,) = AcceptOutcome.of_plan(PLAN).sample
        assert (shown.view, shown.key, shown.group, shown.group_key) == (31, "7.png", 5, "m/7.png")
        assert shown.score == 0.9


class TestGroupPrediction:
    def test_is_what_its_view_has_and_says_which_view_that_is(self) -> None:
        alone, shown = (
            kind.of(SET, BOX).model_dump() for kind in (ViewPrediction, GroupPrediction)
        )
        assert shown == {**alone, "view": 31}
        assert (alone["id"], alone["predictions"], alone["name"]) == (7, 3, "old")
