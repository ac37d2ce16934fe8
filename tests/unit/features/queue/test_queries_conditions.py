from __future__ import annotations

import pytest
from sqlalchemy import update

from app.features.queue.queries import (
    Condition,
    Listing,
    compares,
    contains,
    either,
    has_all_pictures,
    is_absent,
    is_empty,
    is_flag,
    is_one_of,
    is_text,
    lists,
    opposite,
)
from app.features.queue.tables import QueueModel

ROW = {
    "status": "accepted",
    "min_jac": 0.75,
    "sigma_m": None,
    "reviewer": None,
    "reason": "",
    "split": "test",
    "label": "100% _ ö",
    "findings": ",low_parallax,bad_point,",
    "passes": None,
    "solved": True,
    "views": 3,
    "pictures": 2,
}


class TestConditions:
    @pytest.mark.parametrize(
        ("condition", "holds"),
        [
            (compares("min_jac", "<", 0.75), False),
            (compares("min_jac", "<=", 0.75), True),
            (compares("min_jac", ">", 0.7), True),
            (compares("min_jac", ">=", 0.76), False),
            (compares("min_jac", "=", 0.75), True),
            (compares("status", "=", "accepted"), True),
            (compares("sigma_m", "<", 1e9), False),
            (opposite(compares("sigma_m", "<", 1e9)), False),
            (is_absent("sigma_m"), True),
            (is_absent("min_jac"), False),
            (is_empty("reviewer"), True),
            (is_empty("reason"), True),
            (is_empty("split"), False),
            (is_text("split", "test"), True),
            (is_text("reviewer", "ann"), False),
            (opposite(is_text("reviewer", "ann")), True),
            (is_flag("solved", True), True),
            (is_flag("passes", False), False),
            (contains("label", "0% _"), True),
            (contains("label", "1_0"), False),
            (contains("label", "1%ö"), False),
            (lists("findings", "bad_point"), True),
            (lists("findings", "point"), False),
            (has_all_pictures(), False),
            (is_one_of([7, 1]), True),
            (is_one_of([7]), False),
            (is_one_of(range(2, 20_000)), False),
            (either([is_one_of([7]), is_flag("solved", True)]), True),
            (either([is_one_of([7]), is_flag("solved", False)]), False),
        ],
    )
    def test_a_group_is_meant_or_not(self, filled, condition: Condition, holds: bool) -> None:
        with filled.write() as session:
            session.execute(update(QueueModel).values(ROW))
            assert Listing(session, 1, [condition]).count() == holds
