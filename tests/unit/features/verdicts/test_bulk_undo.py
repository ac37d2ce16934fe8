from __future__ import annotations

from typing import Any

import pytest
from sqlalchemy import text, update

from app.errors import ConflictError, NotFoundError
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.queue.service import list_groups
from app.features.queue.tables import QueueModel
from app.features.verdicts import bulk
from app.features.verdicts.bulk import give_verdicts, list_bulk_verdicts
from app.features.verdicts.bulk_undo import redo_bulk_verdict, undo_bulk_verdict
from app.features.verdicts.service import set_verdict


@pytest.fixture
def ids(fill, make_group) -> list[int]:
    """Three groups that pass, and one whose balls do not meet."""
    return fill(make_group(7), make_group(8), make_group(9, shift=90.0), make_group(10))


def statuses(store) -> list[str]:
    return [row.status for row in list_groups(store, 1, limit=500).items]


def judge(store, group: int, state: str, **more: Any) -> None:
    set_verdict(
        store, group, state, if_match=load_group_state(store, group).etag, actor="ann", **more
    )


@pytest.fixture
def undone(store, ids) -> int:
    """A batch that was taken back."""
    batch = give_verdicts(store, 1, "", "rejected", "other", "blurred", actor="ben").batch
    undo_bulk_verdict(store, batch, actor="ben")
    return batch


def stopped_redo(store, monkeypatch) -> int:
    """A batch of two chunks that ben was giving again when something stopped him after one."""
    batch = give_verdicts(store, 1, "", "rejected", "other", "blurred", actor="ben").batch
    undo_bulk_verdict(store, batch, actor="ben")
    write, turns = store.write, []

    def once() -> Any:
        turns.append(None)
        if len(turns) > 1:
            raise RuntimeError("killed")
        return write()

    with monkeypatch.context() as patch:
        patch.setattr(bulk, "CHUNK", 2)
        patch.setattr(store, "write", once)
        with pytest.raises(RuntimeError, match="killed"):
            redo_bulk_verdict(store, batch, actor="ben")
    return batch


class TestRedoBatch:
    def test_every_group_has_the_verdict_again_and_it_can_be_taken_back_again(
        self, store, ids, undone, monkeypatch
    ) -> None:
        assert statuses(store) == ["unreviewed"] * 4
        done = redo_bulk_verdict(store, undone, actor="ben")
        assert (done.changed, done.kept, done.refused) == (4, 0, ())
        assert statuses(store) == ["rejected"] * 4
        verdict = load_group_state(store, ids[3]).verdict
        assert (verdict.reason, verdict.note, verdict.actor) == ("other", "blurred", "ben")
        assert undo_bulk_verdict(store, done.batch, actor="ben").restored == 4
        assert redo_bulk_verdict(store, done.batch, actor="eve").changed == 4
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_group_that_it_is_refused_for_is_told_with_the_reason(
        self, store, ids, monkeypatch
    ) -> None:
        batch = give_verdicts(store, 1, "", "accepted", actor="ben").batch
        undo_bulk_verdict(store, batch, actor="ben")
        with store.write() as session:
            changed = update(QueueModel).where(QueueModel.group_id == ids[0])
            session.execute(changed.values(pictures=0))
        done = redo_bulk_verdict(store, batch, actor="ben")
        assert (done.changed, done.kept) == (2, 0)
        assert [(item.reason, item.groups) for item in done.refused] == [("no_picture", 1)]

    def test_taking_a_redone_batch_back_restores_the_verdicts_before_it(self, store, ids) -> None:
        judge(store, ids[0], "accepted")
        batch = give_verdicts(store, 1, "", "deferred", actor="ben").batch
        undo_bulk_verdict(store, batch, actor="eve")
        done = redo_bulk_verdict(store, batch, actor="ben")
        undo_bulk_verdict(store, done.batch, actor="ben")
        assert statuses(store) == ["accepted", *["unreviewed"] * 3]

    def test_many_chunks_are_one_batch(self, store, ids, monkeypatch) -> None:
        monkeypatch.setattr(bulk, "CHUNK", 3)
        batch = give_verdicts(store, 1, "", "deferred", actor="ben").batch
        undo_bulk_verdict(store, batch, actor="ben")
        assert redo_bulk_verdict(store, batch, actor="ben").changed == 4
        newest, old = list_bulk_verdicts(store, 1)
        assert (newest.changed, newest.done, old.redone) == (4, True, newest.id)

    def test_a_group_that_was_judged_since_keeps_its_verdict(self, store, ids, undone) -> None:
        judge(store, ids[1], "deferred")
        done = redo_bulk_verdict(store, undone, actor="ben")
        assert (done.changed, done.kept) == (3, 1)
        assert statuses(store) == ["rejected", "deferred", "rejected", "rejected"]

    def test_a_group_that_was_edited_since_is_another_one(self, store, ids, undone) -> None:
        etag = load_group_state(store, ids[0]).etag
        submit_edit(store, ids[0], make_set_ball_edit("7.png", None), if_match=etag, actor="ann")
        done = redo_bulk_verdict(store, undone, actor="ben")
        assert (done.changed, done.kept) == (3, 1)
        assert statuses(store)[0] == "unreviewed"

    def test_where_all_were_judged_since_there_is_no_batch(self, store, ids, undone) -> None:
        for number in ids:
            judge(store, number, "deferred")
        done = redo_bulk_verdict(store, undone, actor="ben")
        assert (done.batch, done.changed, done.kept) == (None, 0, 4)
        assert len(list_bulk_verdicts(store, 1)) == 1

    def test_only_a_batch_that_was_taken_back_is_given_again_and_only_once(
        self, store, ids, undone
    ) -> None:
        done = redo_bulk_verdict(store, undone, actor="ben")
        with pytest.raises(ConflictError, match="redone already"):
            redo_bulk_verdict(store, undone, actor="ben")
        with pytest.raises(ConflictError, match="was not undone"):
            redo_bulk_verdict(store, done.batch, actor="ben")
        with pytest.raises(NotFoundError):
            redo_bulk_verdict(store, 99, actor="ben")

    def test_one_that_was_stopped_is_finished_under_another_key_as_the_same_batch(
        self, store, ids, monkeypatch
    ) -> None:
        batch = stopped_redo(store, monkeypatch)
        done = redo_bulk_verdict(store, batch, actor="ben")
        assert (done.batch, done.changed, done.kept) == (batch + 1, 4, 0)
        newest, _ = list_bulk_verdicts(store, 1)
        assert (newest.changed, newest.spans, newest.done) == (4, [[9, 12]], True)
        assert undo_bulk_verdict(store, done.batch, actor="ben").restored == 4

    def test_one_that_somebody_else_has_begun_is_theirs_to_finish(
        self, store, ids, monkeypatch
    ) -> None:
        batch = stopped_redo(store, monkeypatch)
        with pytest.raises(ConflictError, match="ben is redoing") as refused:
            redo_bulk_verdict(store, batch, actor="eve")
        assert "ben" in refused.value.hint

    def test_two_who_give_it_again_at_once_make_one_batch(
        self, store, ids, undone, monkeypatch
    ) -> None:
        write = store.write

        def somebody_else_first() -> Any:
            monkeypatch.setattr(store, "write", write)
            redo_bulk_verdict(store, undone, actor="eve")
            return write()

        monkeypatch.setattr(store, "write", somebody_else_first)
        with pytest.raises(ConflictError, match="redone already"):
            redo_bulk_verdict(store, undone, actor="ben")
        newest, old = list_bulk_verdicts(store, 1)
        assert (newest.actor, old.redone) == ("eve", newest.id)

    def test_a_batch_that_an_older_version_took_back_says_what_to_do(self, store, undone) -> None:
        with store.write() as session:
            session.execute(text("UPDATE verdict_batch SET undo_spans = NULL"))
        with pytest.raises(ConflictError, match="older version") as refused:
            redo_bulk_verdict(store, undone, actor="ben")
        assert "again" in refused.value.hint
