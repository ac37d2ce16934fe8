from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import pytest
from sqlalchemy import func, insert, select, text, update

from app.db.log import verify_chain
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets.tables import GroupModel
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.state import VerdictState
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import ensure_dataset
from app.features.queue.refresh_queries import refresh_queue
from app.features.queue.service import list_groups, summarize_groups
from app.features.queue.tables import QueueModel
from app.features.solutions.service import solve_dataset
from app.features.verdicts import bulk, bulk_undo
from app.features.verdicts.bulk import (
    BulkVerdictRun,
    ReplacedVerdicts,
    give_verdicts,
    list_bulk_verdicts,
    plan_verdicts,
)
from app.features.verdicts.bulk_undo import undo_bulk_verdict
from app.features.verdicts.service import check_verdict, set_verdict
from tests.unit.features.pending import keyed_request


def judge(store: Store, group: int, state: str, actor: str = "ann", **more: Any) -> None:
    etag = load_group_state(store, group).etag
    set_verdict(store, group, state, if_match=etag, actor=actor, **more)


def statuses(store: Store) -> list[str]:
    return [row.status for row in list_groups(store, 1, limit=500).items]


def verdict_of(store: Store, group: int) -> VerdictState:
    return load_group_state(store, group).verdict


def before_write(
    store: Store, monkeypatch: pytest.MonkeyPatch, number: int, act: Callable[[], object]
) -> None:
    """Let somebody else do something just before the transaction of some number begins."""
    write, left = store.write, [number]

    def somebody_else_first() -> Any:
        left[0] -= 1
        if left[0] == 0:
            act()
        return write()

    monkeypatch.setattr(store, "write", somebody_else_first)


@pytest.fixture
def ids(fill, make_group) -> list[int]:
    """Three groups that pass, and one whose balls do not meet."""
    return fill(make_group(7), make_group(8), make_group(9, shift=90.0), make_group(10))


class TestPlanVerdicts:
    def test_counts_and_shows_what_would_change(self, store, ids) -> None:
        judge(store, ids[0], "accepted")
        plan = plan_verdicts(store, 1, "", "accepted")
        assert (plan.matches, plan.would_change) == (4, 2)
        assert [(item.reason, item.groups) for item in plan.refused] == [("needs_note", 1)]
        assert [group.id for group in plan.sample] == [ids[1], ids[3]]
        assert (plan.unchanged, plan.replaced) == (1, ())
        assert statuses(store) == ["accepted", *["unreviewed"] * 3]

    def test_counts_the_verdicts_that_are_replaced_by_their_state(self, store, ids) -> None:
        judge(store, ids[0], "rejected", reason="duplicate_view")
        judge(store, ids[1], "deferred")
        judge(store, ids[3], "rejected", reason="bad_calibration")
        plan = plan_verdicts(store, 1, "", "rejected", "bad_calibration")
        assert (plan.matches, plan.would_change, plan.unchanged) == (4, 3, 1)
        assert plan.replaced == (ReplacedVerdicts("deferred", 1), ReplacedVerdicts("rejected", 1))
        etag = load_group_state(store, ids[3]).etag
        edit = make_set_ball_edit("10_1.png", None)
        submit_edit(store, ids[3], edit, if_match=etag, actor="ann")
        # The same verdict, given on an earlier state of the group: it is only renewed.
        again = plan_verdicts(store, 1, "", "rejected", "bad_calibration")
        assert (again.would_change, again.unchanged, again.replaced) == (4, 0, plan.replaced)

    def test_balls_that_cannot_be_used_are_counted_and_left_alone(
        self, store, fill, make_group
    ) -> None:
        below = make_group(8, ball=(5.0, 2.0, 10.2))
        ids = fill(make_group(7), below, make_group(9, ball=(0.0, 42.0, -14.0)))
        plan = plan_verdicts(store, 1, "passes:yes", "accepted")
        assert [group.id for group in plan.sample] == ids[:1]
        assert [(item.reason, item.groups) for item in plan.refused] == [("unusable_ball", 2)]
        assert plan_verdicts(store, 1, "", "accepted", note="by eye").would_change == 3
        assert plan_verdicts(store, 1, "", "deferred").would_change == 3

    def test_a_ball_of_which_nothing_is_known_is_left_alone(self, store, fill, make_group) -> None:
        ids = fill(make_group(7), make_group(8), make_group(9))
        with store.write() as session:
            for group, sigma in zip(ids, (1.9, 64.0, None), strict=True):
                session.execute(
                    update(QueueModel)
                    .where(QueueModel.group_id == group)
                    .values(findings=",high_uncertainty,", sigma_m=sigma)
                )
        plan = plan_verdicts(store, 1, "", "accepted")
        assert [group.id for group in plan.sample] == ids[:1]
        assert [(item.reason, item.groups) for item in plan.refused] == [("unusable_ball", 2)]

    @pytest.mark.parametrize("open_ones", [",", ",bad_point,"])
    def test_a_finding_that_was_dismissed_still_says_that_the_ball_cannot_be_used(
        self, store, fill, make_group, open_ones: str
    ) -> None:
        fill(make_group(7), make_group(8))
        for kind, sigma in (("high_uncertainty", 64.0), ("implausible_ball", 0.1)):
            values = {"findings": open_ones, "dismissed": f",{kind},", "sigma_m": sigma}
            with store.write() as session:
                session.execute(update(QueueModel).values(values))
            plan = plan_verdicts(store, 1, "", "accepted")
            assert [(item.reason, item.groups) for item in plan.refused] == [("unusable_ball", 2)]
        assert plan_verdicts(store, 1, "", "accepted", note="by eye").would_change == 2

    def test_what_an_earlier_solver_solved_is_accepted_once_this_one_has(
        self, store, ids, upgrade_solver
    ) -> None:
        upgrade_solver()
        for note in (None, "checked by eye"):
            plan = plan_verdicts(store, 1, "", "accepted", note=note)
            assert [(item.reason, item.groups) for item in plan.refused] == [("unsolved", 4)]
            assert give_verdicts(store, 1, "", "accepted", note=note, actor="ben").changed == 0
        assert [row.passes for row in list_groups(store, 1).items] == [True, True, False, True]
        assert plan_verdicts(store, 1, "", "deferred").would_change == 4
        solve_dataset(store, 1)
        assert give_verdicts(store, 1, "", "accepted", actor="ben").changed == 3

    def test_with_a_note_only_unsolved_groups_are_refused(
        self, store, ids, fill, make_group
    ) -> None:
        fill(make_group(11), solved=False)
        plan = plan_verdicts(store, 1, "", "accepted", note="checked by eye")
        assert (plan.matches, plan.would_change) == (5, 4)
        assert [(item.reason, item.groups) for item in plan.refused] == [("unsolved", 1)]

    @pytest.mark.parametrize(
        ("query", "state", "reason"),
        [("colour:red", "accepted", None), ("", "rejected", None), ("", "maybe", None)],
    )
    def test_an_impossible_verdict_is_refused(self, store, ids, query, state, reason) -> None:
        with pytest.raises(InputError):
            plan_verdicts(store, 1, query, state, reason)


class TestGiveVerdicts:
    def test_each_group_has_its_verdict_and_its_place_in_the_log(
        self, store, ids, monkeypatch
    ) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 2)
        report = give_verdicts(store, 1, "passes:yes", "accepted", actor="ben")
        assert (report.changed, report.refused) == (3, ())
        assert statuses(store) == ["accepted", "accepted", "unreviewed", "accepted"]
        with store.read() as session:
            replayed, present = replay_log(session), read_state_snapshot(session)
            kinds = session.execute(text("SELECT kind FROM log ORDER BY id DESC LIMIT 4")).all()
        assert replayed == present
        assert [kind for (kind,) in kinds] == ["verdict_batch", *["verdict"] * 3]
        assert verdict_of(store, ids[0]).actor == "ben"

    def test_gives_the_same_state_as_single_verdicts(self, store, ids) -> None:
        submit_edit(
            store,
            ids[1],
            make_set_ball_edit("8_1.png", None),
            if_match=load_group_state(store, ids[1]).etag,
            actor="ann",
        )
        give_verdicts(store, 1, "", "accepted", note="seen", actor="ben")
        alone = []
        for number in ids:
            many = verdict_of(store, number)
            judge(store, number, "accepted", actor="ben", note="seen")
            alone.append(replace(verdict_of(store, number), at=many.at) == many)
        assert alone == [True] * 4
        assert [verdict_of(store, number).override for number in ids] == [
            None,
            "ball",
            "reprojection",
            None,
        ]
        # The edited one fails a gate, so nobody mended it.
        assert [verdict_of(store, number).fixed for number in ids] == [False] * 4

    def test_the_queue_shows_what_writing_it_anew_would(self, store, ids) -> None:
        give_verdicts(store, 1, "", "rejected", "other", "no ball", actor="ben")
        before = list_groups(store, 1, limit=500)
        with store.write() as session:
            refresh_queue(session, ids)
        assert list_groups(store, 1, limit=500) == before

    def test_groups_can_be_named_one_by_one_or_left_out(self, store, ids) -> None:
        give_verdicts(store, 1, f"id:{ids[3]},{ids[0]}", "deferred", actor="ben")
        assert statuses(store) == ["deferred", "unreviewed", "unreviewed", "deferred"]
        give_verdicts(store, 1, f"status:unreviewed -id:{ids[1]}", "deferred", actor="ben")
        assert statuses(store) == ["deferred", "unreviewed", "deferred", "deferred"]

    def test_thousands_can_be_named(self, store, ids) -> None:
        named = ",".join(map(str, range(ids[1], ids[1] + 12_764)))
        report = give_verdicts(store, 1, f"id:{named}", "deferred", actor="ben")
        assert report.changed == 3
        (batch,) = list_bulk_verdicts(store, 1)
        assert batch.query == f"id:{named}"
        assert undo_bulk_verdict(store, report.batch, actor="ben").restored == 3
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_an_etag_of_before_is_stale(self, store, ids) -> None:
        etag = load_group_state(store, ids[0]).etag
        give_verdicts(store, 1, "", "deferred", actor="ben")
        with pytest.raises(ConflictError):
            set_verdict(store, ids[0], "accepted", if_match=etag, actor="ann")

    def test_the_same_verdict_again_changes_nothing(self, store, ids) -> None:
        first = give_verdicts(store, 1, "", "deferred", actor="ben")
        again = give_verdicts(store, 1, "", "deferred", actor="ann")
        assert (first.changed, again.changed, again.batch) == (4, 0, None)
        assert len(list_bulk_verdicts(store, 1)) == 1

    def test_a_page_is_full_where_batches_between_are_for_reviewers_alone(
        self, store, ids, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        for number in range(5):
            asked = "submissions<9" if number in (1, 2, 3) else ""
            give_verdicts(store, 1, asked, "deferred", note=f"round {number}", actor="ben")
        monkeypatch.setattr(bulk, "sees_independent_work", lambda _: False)
        shown = list_bulk_verdicts(store, 1, 2)
        assert [one.id for one in shown] == [5, 1]
        assert [one.id for one in list_bulk_verdicts(store, 1, 2, before=5)] == [1]

    def test_the_same_verdict_with_a_note_of_its_own_is_a_new_one(self, store, ids) -> None:
        give_verdicts(store, 1, "", "deferred", actor="ben")
        again = give_verdicts(store, 1, "", "deferred", note="until Monday", actor="ann")
        assert again.changed == 4
        assert verdict_of(store, ids[0]).note == "until Monday"

    def test_a_verdict_that_is_out_of_date_is_given_again(self, store, ids) -> None:
        give_verdicts(store, 1, "", "deferred", actor="ben")
        etag = load_group_state(store, ids[0]).etag
        submit_edit(store, ids[0], make_set_ball_edit("7.png", None), if_match=etag, actor="ann")
        assert (summarize_groups(store, 1).stale, summarize_groups(store, 1, "stale:no").stale) == (
            1,
            0,
        )
        assert give_verdicts(store, 1, "", "deferred", actor="ben").changed == 1
        assert summarize_groups(store, 1).stale == 0

    def test_a_request_that_is_being_carried_out_is_not_carried_out_twice(self, store, ids) -> None:
        verdict = check_verdict("deferred", None, None)
        first, second = (BulkVerdictRun(1, "", verdict, "ann") for _ in range(2))
        with keyed_request().activate():
            with store.write() as session:
                assert (first.resume(session), second.resume(session)) == (None, None)
            with store.write() as session:
                first.save_remaining(session, {"left": [[1, 2]]})
            with pytest.raises(ConflictError, match="is still running"), store.write() as session:
                second.save_remaining(session, {"left": [[1, 2]]})
            with store.write() as session:
                first.save_remaining(session, {"left": [[2, 2]]})

    def test_another_number_than_expected_changes_nothing(self, store, ids) -> None:
        with pytest.raises(ConflictError, match="4 groups would change, not 3"):
            give_verdicts(store, 1, "", "deferred", actor="ben", expected=3)
        assert set(statuses(store)) == {"unreviewed"}
        assert give_verdicts(store, 1, "", "deferred", actor="b", expected=4).changed == 4

    def test_killed_between_two_chunks_the_rest_follows_and_all_can_be_undone(
        self, store, ids, monkeypatch
    ) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 3)
        save, calls = bulk.BulkVerdictRun.save_chunk, []

        def killed(self, session, rows):
            calls.append(rows)
            if len(calls) == 2:
                raise KeyboardInterrupt
            save(self, session, rows)

        monkeypatch.setattr(bulk.BulkVerdictRun, "save_chunk", killed)
        with pytest.raises(KeyboardInterrupt):
            give_verdicts(store, 1, "", "deferred", actor="ben")
        assert statuses(store) == ["deferred"] * 3 + ["unreviewed"]
        (left,) = list_bulk_verdicts(store, 1)
        assert (left.changed, left.done) == (3, False)
        rest = give_verdicts(store, 1, "", "deferred", actor="ben")
        assert rest.changed == 1
        for batch in (rest.batch, left.id):
            undo_bulk_verdict(store, batch, actor="ben")
        assert set(statuses(store)) == {"unreviewed"}

    def test_others_write_between_the_chunks(self, store, ids, monkeypatch) -> None:
        """A group that somebody judges meanwhile and that matches no more is left alone."""
        monkeypatch.setattr(bulk, "CHUNK", 1)
        before_write(store, monkeypatch, 2, lambda: judge(store, ids[1], "accepted", actor="ann"))
        report = give_verdicts(store, 1, "status:unreviewed", "deferred", actor="ben")
        assert report.changed == 3
        assert statuses(store) == ["deferred", "accepted", "deferred", "deferred"]


class TestUndoBatch:
    def test_each_group_has_its_former_verdict_and_person_again(self, store, ids) -> None:
        judge(store, ids[0], "rejected", actor="ann", reason="other", note="blurred")
        judge(store, ids[1], "accepted", actor="ben")
        judge(store, ids[1], "deferred", actor="ann")
        before = [verdict_of(store, number) for number in ids]
        report = give_verdicts(store, 1, "", "accepted", note="all", actor="ben")
        assert report.changed == 4
        undone = undo_bulk_verdict(store, report.batch, actor="eve")
        assert (undone.restored, undone.kept) == (4, 0)
        after = [verdict_of(store, number) for number in ids]
        assert after[:2] == before[:2]
        assert [item.state for item in after[2:]] == ["unreviewed"] * 2
        # Of ben there is left what he had said before.
        assert {item.actor: item.state for item in load_group_state(store, ids[1]).verdicts} == {
            "ann": "deferred",
            "ben": "accepted",
        }
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_group_that_was_judged_since_keeps_its_verdict(self, store, ids) -> None:
        report = give_verdicts(store, 1, "", "deferred", actor="ben")
        judge(store, ids[2], "rejected", actor="ann", reason="bad_calibration")
        undone = undo_bulk_verdict(store, report.batch, actor="ben")
        assert (undone.restored, undone.kept) == (3, 1)
        assert statuses(store)[2] == "rejected"

    def test_a_batch_is_taken_back_only_once(self, store, ids) -> None:
        report = give_verdicts(store, 1, "", "deferred", actor="ben")
        undo_bulk_verdict(store, report.batch, actor="ben")
        (batch,) = list_bulk_verdicts(store, 1)
        assert (batch.undone_by, batch.done) == ("ben", True)
        with pytest.raises(ConflictError, match="ben has undone this batch"):
            undo_bulk_verdict(store, report.batch, actor="ann")

    def test_two_who_take_it_back_at_once_do_it_once(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 2)
        batch = give_verdicts(store, 1, "", "deferred", actor="ben").batch
        before_write(store, monkeypatch, 2, lambda: undo_bulk_verdict(store, batch, actor="eve"))
        with pytest.raises(ConflictError, match="eve has undone this batch"):
            undo_bulk_verdict(store, batch, actor="ann")
        (found,) = list_bulk_verdicts(store, 1)
        assert (found.undone_by, found.undo_spans) == ("eve", [[5, 8]])
        with store.read() as session:
            kinds = session.scalars(text("SELECT kind FROM log WHERE kind LIKE '%undo'")).all()
            assert kinds == ["verdict_batch_undo"]

    def test_what_another_run_took_back_before_it_was_stopped_is_counted(
        self, store, ids, monkeypatch
    ) -> None:
        restore = bulk_undo._restore_chunk

        def stopped(session: Session, batch: Any, first: int, last: int, actor: str) -> Any:
            if actor == "eve" and first == 3:
                raise RuntimeError("killed")
            return restore(session, batch, first, last, actor)

        def somebody_else_begins() -> None:
            with pytest.raises(RuntimeError, match="killed"):
                undo_bulk_verdict(store, batch, actor="eve")

        monkeypatch.setattr(bulk, "CHUNK", 1)
        monkeypatch.setattr(bulk_undo, "_restore_chunk", stopped)
        batch = give_verdicts(store, 1, "", "deferred", actor="ben").batch
        before_write(store, monkeypatch, 2, somebody_else_begins)
        undone = undo_bulk_verdict(store, batch, actor="ann")
        assert (undone.restored, undone.kept) == (4, 0)
        assert set(statuses(store)) == {"unreviewed"}

    def test_a_batch_that_is_taken_back_while_it_is_given_ends_there(
        self, store, ids, monkeypatch
    ) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 1)
        before_write(store, monkeypatch, 3, lambda: undo_bulk_verdict(store, 1, actor="eve"))
        with pytest.raises(ConflictError, match="were undone meanwhile"):
            give_verdicts(store, 1, "", "deferred", actor="ben")
        assert set(statuses(store)) == {"unreviewed"}
        (found,) = list_bulk_verdicts(store, 1)
        assert (found.changed, found.done, found.undone_by) == (2, False, "eve")

    def test_an_unknown_batch_is_not_found(self, store) -> None:
        with pytest.raises(NotFoundError):
            undo_bulk_verdict(store, 5, actor="ben")


class TestManyGroups:
    def test_are_judged_and_taken_back_in_short_transactions(self, store, monkeypatch) -> None:
        count = 1500
        _many(store, count)
        turns: list[Session] = []
        write = store.write

        @contextmanager
        def counted() -> Iterator[Session]:
            with write() as session:
                turns.append(session)
                yield session

        monkeypatch.setattr(store, "write", counted)
        report = give_verdicts(store, 1, "", "deferred", actor="ben")
        assert report.changed == count
        assert undo_bulk_verdict(store, report.batch, actor="ben").restored == count
        assert len(turns) == 2 * (count // bulk.CHUNK)
        with store.read() as session:
            assert verify_chain(session) == 1 + count + 1 + count + 1


def _many(store: Store, count: int) -> None:
    ensure_dataset(store, "many", "ann")
    rows = [
        {
            "id": number,
            "dataset_id": 1,
            "number": number,
            "key": f"m/{number}.png",
            "match": "m",
            "split": "",
            "label": "",
            "pitch_length": 105.0,
            "pitch_width": 68.0,
            "revision": 1,
            "changed": "2030-01-01T00:00:00.000000+00:00",
            "inputs_hash": f"{number}",
            "source_hash": "h",
        }
        for number in range(1, count + 1)
    ]
    with store.write() as session:
        session.execute(insert(GroupModel), rows)
        refresh_queue(session, [row["id"] for row in rows])
        assert session.scalar(select(func.count()).select_from(QueueModel)) == count
