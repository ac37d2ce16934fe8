from __future__ import annotations

import pytest

from app.db.session import now
from app.features.groups.submit import load_group_state
from app.features.verdicts import service as reviewers
from app.features.verdicts import service as verdict
from app.features.verdicts.bulk import give_verdicts
from app.features.verdicts.service import list_reviewers, set_verdict


@pytest.fixture
def ids(fill, make_group) -> list[int]:
    return fill(*(make_group(number) for number in range(7, 12)))


def judge(store, group: int, state: str, actor: str, reason: str | None = None) -> None:
    set_verdict(
        store, group, state, reason, if_match=load_group_state(store, group).etag, actor=actor
    )


class TestListReviewers:
    def test_counts_verdicts_that_count_and_the_groups_of_today(
        self, store, ids, monkeypatch
    ) -> None:
        give_verdicts(store, 1, "", "accepted", actor="ann")
        monkeypatch.setattr(verdict, "now", lambda: "2020-02-02T10:00:00.000000+00:00")
        judge(store, ids[0], "rejected", "ben", "bad_calibration")
        monkeypatch.undo()
        for state in ("deferred", "accepted"):
            judge(store, ids[1], state, "ann")
        ann, ben = list_reviewers(store, 1)
        assert (ann.name, ann.accepted, ann.rejected, ann.deferred) == ("ann", 4, 0, 0)
        assert (ann.today, ann.last[:10]) == (5, now()[:10])
        assert (ben.name, ben.rejected, ben.today) == ("ben", 1, 0)
        assert ben.last == "2020-02-02T10:00:00.000000+00:00"

    def test_what_was_judged_earlier_this_month_is_not_of_today(
        self, store, ids, monkeypatch
    ) -> None:
        at = {"now": "2020-02-02T23:59:59.000000+00:00"}
        monkeypatch.setattr(verdict, "now", lambda: at["now"])
        monkeypatch.setattr(reviewers, "now", lambda: at["now"])
        judge(store, ids[0], "accepted", "ann")
        at["now"] = "2020-02-03T00:00:00.000000+00:00"
        judge(store, ids[1], "accepted", "ann")
        (ann,) = list_reviewers(store, 1)
        assert (ann.accepted, ann.today) == (2, 1)

    def test_a_reviewer_whose_verdicts_were_all_replaced_is_still_listed(self, store, ids) -> None:
        judge(store, ids[0], "accepted", "ann")
        judge(store, ids[0], "deferred", "ben")
        assert [(item.name, item.accepted, item.deferred) for item in list_reviewers(store, 1)] == [
            ("ben", 0, 1),
            ("ann", 0, 0),
        ]

    def test_a_dataset_that_nobody_judged_has_nobody(self, store, ids) -> None:
        assert list_reviewers(store, 1) == []
