from __future__ import annotations

import pytest
from sqlalchemy import insert, select

from app.db.session import Session
from app.db.store import Store
from app.features.predictions.queries import (
    FrameCondition,
    ball_without_number_condition,
    between_condition,
    count_frame_rows,
    delete_evaluation,
    find_evaluation,
    insert_evaluation,
    list_evaluations_of_dataset,
    match_condition,
    read_frame_rows,
)
from app.features.predictions.tables import EvaluationFrameModel

BARE = {
    **dict.fromkeys(EvaluationFrameModel.__table__.columns.keys()),
    "frame_id": 1,
    "group_id": 1,
    "group": "m/7.png",
    "view": "7.png",
    "match": "m",
    "ball": True,
    "detections": 1,
}
"""Errors in metres by position, and what else is not as in a frame without any number."""
FRAMES = [{"error_m": 0.5}, {"error_m": None}, {"error_m": 0.1, "match": "n"}, {"ball": False}]
RUN = {
    "dataset_id": 1,
    "created": "t",
    "actor": "ann",
    "prediction_set_id": None,
    "careful_set_id": None,
    "version_id": None,
    "pins": {},
    "counts": {},
    "tables": [],
}


@pytest.fixture
def session(filled: Store):
    with filled.write() as session:
        assert insert_evaluation(session, {**RUN, "name": "first"}, {"roc": [1]}, []) == 1
        rows = [
            {**BARE, "evaluation_id": 1, "position": place, **values}
            for place, values in enumerate(FRAMES)
        ]
        session.execute(insert(EvaluationFrameModel), rows)
        yield session


def errors(session: Session, *conditions: FrameCondition, **order) -> list[float | None]:
    return [row["error_m"] for row in read_frame_rows(session, 1, conditions, **order)]


class TestReadFrameRows:
    def test_they_stand_as_in_the_dataset_or_by_a_number_the_missing_last(self, session) -> None:
        assert errors(session) == [0.5, None, 0.1, None]
        assert errors(session, sort="error_m") == [0.1, 0.5, None, None]
        assert errors(session, sort="error_m", descending=True) == [0.5, 0.1, None, None]
        assert errors(session, sort="error_m", limit=2, offset=1) == [0.5, None]
        assert list(read_frame_rows(session, 2)) == []

    @pytest.mark.parametrize(
        ("conditions", "places"),
        [
            ([], 4),
            ([match_condition("n")], 1),
            ([between_condition("error_m", None, None)], 2),
            ([between_condition("error_m", 0.1, 0.5)], 1),
            ([between_condition("error_m", 0.2, None)], 1),
            ([ball_without_number_condition("error_m")], 1),
            ([match_condition("n"), ball_without_number_condition("error_m")], 0),
        ],
    )
    def test_all_conditions_must_hold(self, session, conditions, places: int) -> None:
        assert count_frame_rows(session, 1, conditions) == places
        assert len(errors(session, *conditions)) == places


class TestEvaluations:
    def test_runs_come_the_newest_first_until_they_are_deleted(self, session) -> None:
        second = insert_evaluation(session, {**RUN, "name": "second"}, {}, [])
        assert [run.name for run in list_evaluations_of_dataset(session, 1)] == ["second", "first"]
        assert list_evaluations_of_dataset(session, 2) == []
        found = find_evaluation(session, 1)
        assert found is not None
        assert (found.dataset, found.figures) == ("demo", ("roc",))
        delete_evaluation(session, 1)
        assert find_evaluation(session, 1) is None
        assert [run.id for run in list_evaluations_of_dataset(session, 1)] == [second]
        assert session.scalars(select(EvaluationFrameModel.position)).all() == []
