from __future__ import annotations

from app.db.store import Store
from app.features.predictions.queries import (
    count_prediction_sets,
    has_prediction_set,
    insert_prediction_set,
    list_prediction_sets_of_dataset,
    read_prediction_sets,
)

SET = {
    "dataset_id": 1,
    "format": "csv",
    "source": "f",
    "created": "t",
    "actor": "ann",
    "digest": "d",
    "frames": 0,
    "boxes": 0,
    "cameras": 0,
    "unknown": 0,
    "report": {"read": 1},
}


class TestPredictionSets:
    def test_are_found_by_dataset_by_id_and_by_name(self, filled: Store) -> None:
        with filled.write() as session:
            one, two = (
                insert_prediction_set(session, {**SET, "name": name}, {}, {})
                for name in ("one", "two")
            )
            assert [item.id for item in list_prediction_sets_of_dataset(session, 1)] == [two, one]
            assert list_prediction_sets_of_dataset(session, 2) == []
            assert [item.id for item in read_prediction_sets(session, {one, two, 9})] == [two, one]
            assert read_prediction_sets(session, set()) == []
            assert [has_prediction_set(session, 1, name) for name in ("one", "ONE")] == [
                True,
                False,
            ]
            assert not has_prediction_set(session, 2, "one")
            assert count_prediction_sets(session, 1) == 2
