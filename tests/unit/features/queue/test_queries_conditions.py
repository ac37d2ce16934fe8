from __future__ import annotations

import pytest
from sqlalchemy import update

from app.features.queue.queries import (
    Condition,
    GroupListing,
    absent_condition,
    any_condition,
    compare_condition,
    contains_text_condition,
    empty_text_condition,
    flag_condition,
    has_all_pictures,
    has_group_id,
    has_list_item,
    negate_condition,
    text_condition,
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
            (compare_condition("min_jac", "<", 0.75), False),
            (compare_condition("min_jac", "<=", 0.75), True),
            (compare_condition("min_jac", ">", 0.7), True),
            (compare_condition("min_jac", ">=", 0.76), False),
            (compare_condition("min_jac", "=", 0.75), True),
            (compare_condition("status", "=", "accepted"), True),
            (compare_condition("sigma_m", "<", 1e9), False),
            (negate_condition(compare_condition("sigma_m", "<", 1e9)), True),
            (absent_condition("sigma_m"), True),
            (absent_condition("min_jac"), False),
            (empty_text_condition("reviewer"), True),
            (empty_text_condition("reason"), True),
            (empty_text_condition("split"), False),
            (text_condition("split", "test"), True),
            (text_condition("reviewer", "ann"), False),
            (negate_condition(text_condition("reviewer", "ann")), True),
            (flag_condition("solved", True), True),
            (flag_condition("passes", False), False),
            (contains_text_condition("label", "0% _"), True),
            (contains_text_condition("label", "1_0"), False),
            (contains_text_condition("label", "1%ö"), False),
            (has_list_item("findings", "bad_point"), True),
            (has_list_item("findings", "point"), False),
            (has_all_pictures(), False),
            (has_group_id([7, 1]), True),
            (has_group_id([7]), False),
            (has_group_id(range(2, 20_000)), False),
            (any_condition([has_group_id([7]), flag_condition("solved", True)]), True),
            (any_condition([has_group_id([7]), flag_condition("solved", False)]), False),
        ],
    )
    def test_a_group_is_meant_or_not(self, filled, condition: Condition, holds: bool) -> None:
        with filled.write() as session:
            session.execute(update(QueueModel).values(ROW))
            assert GroupListing(session, 1, [condition]).count() == holds
