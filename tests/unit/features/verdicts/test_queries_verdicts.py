from __future__ import annotations

from dataclasses import replace

from app.db.store import Store
from app.features.solutions.queries import read_current_solution_keys
from app.features.verdicts.queries import (
    StoredVerdict,
    count_groups_by_judge,
    insert_verdicts_and_end_work,
    list_groups_of_verdict_range,
    list_groups_with_newest_verdict_in_range,
    read_judged_inputs_hashes,
    read_last_verdicts,
    read_verdicts,
)

FIRST = StoredVerdict(1, 1, "ann", "2030-01-01", "accepted", None, None, "a", "p", False, None)
LATER = replace(FIRST, id=2, actor="bob", at="2030-01-02", inputs_hash="b")


class TestReadLastVerdicts:
    def test_of_each_person_the_last_the_newest_first(self, filled: Store) -> None:
        again = replace(FIRST, id=3, state="rejected", reason="other")
        with filled.write() as session:
            insert_verdicts_and_end_work(session, 1, [FIRST, LATER, again], actor="ann", at="t")
            assert read_last_verdicts(session, [1, 9]) == {1: [again, LATER]}
            assert read_verdicts(session, [1, 9]) == {1: [again, LATER, FIRST]}


class TestRanges:
    def test_a_group_that_was_judged_again_is_not_of_the_earlier_range(self, filled: Store) -> None:
        with filled.write() as session:
            insert_verdicts_and_end_work(session, 1, [FIRST, LATER], actor="ann", at="t")
            assert list_groups_with_newest_verdict_in_range(session, 1, 1) == []
            assert (
                list_groups_with_newest_verdict_in_range(session, 1, 2)
                == list_groups_with_newest_verdict_in_range(session, 2, 9)
                == [1]
            )
            assert list_groups_of_verdict_range(session, 1, 2) == [1, 1]
            assert read_judged_inputs_hashes(session, 1, 1, [1, 9]) == {1: "a"}
            assert read_judged_inputs_hashes(session, 2, 2, [1]) == {1: "b"}
            assert read_judged_inputs_hashes(session, 1, 2, [9]) == {}


class TestCountByJudge:
    def test_everybody_with_their_last_time_and_the_groups_since_some_time(
        self, filled: Store
    ) -> None:
        with filled.write() as session:
            given = [FIRST, LATER, replace(LATER, id=3)]
            insert_verdicts_and_end_work(session, 1, given, actor="ann", at="t")
            rows = count_groups_by_judge(session, 1, since="2030-01-02")
            assert {tuple(row) for row in rows} == {
                ("ann", "2030-01-01", 0),
                ("bob", "2030-01-02", 1),
            }
            assert count_groups_by_judge(session, 2, since="") == []


class TestPresentKeys:
    def test_a_group_has_one_whether_it_is_solved_or_not(self, filled: Store) -> None:
        with filled.read() as session:
            (key,) = read_current_solution_keys(session, [1, 9]).values()
        assert (key.group_id, key.policy_hash) == (1, "p")
