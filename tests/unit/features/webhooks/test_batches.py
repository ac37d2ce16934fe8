"""What webhooks are told of work that is given out: each thing once, in the transaction of it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime, timedelta

import pytest

from app.db.store import Store
from app.errors import ConflictError
from app.features.agreement.adjudicate import adjudicate_case, read_case, return_for_correction
from app.features.agreement.service import (
    compare_or_adopt_submission,
    compare_submitted_annotations,
)
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.service import NewBatch, change_batch, make_batch
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.verdicts.service import set_verdict
from app.features.webhooks.messages import CHOSEN, MessageKind
from app.features.webhooks.sender import WebhookSender
from app.features.webhooks.service import make_webhook
from tests.unit.features.pending import stored_by
from tests.unit.features.webhooks.conftest import Receiver

OF_WORK = {
    *(MessageKind.GIVEN_OUT, MessageKind.HANDED_ON, MessageKind.DONE, MessageKind.STALLED),
    *(MessageKind.DISPUTED, MessageKind.HANDED_BACK),
}


class Told:
    """The messages that arrived about work, since they were asked for last."""

    def __init__(self, store: Store, receiver: Receiver) -> None:
        self.sender = WebhookSender(store, lambda: self.at)
        self.receiver, self.at, self._seen = receiver, datetime.now(UTC), 0

    def new(self) -> list[tuple[str, dict]]:
        self.at = max(self.at, datetime.now(UTC))
        self.sender.queue_new_messages()
        self.sender.queue_stall_messages()
        self.at = max(self.at, datetime.now(UTC))
        while self.sender.send_due_messages():
            pass
        got, self._seen = self.receiver.got[self._seen :], len(self.receiver.got)
        # Messages are under way together: when it happened says in which order.
        bodies = sorted((body for _, body in got), key=lambda body: body["timestamp"])
        return [(body["type"], body["data"]) for body in bodies if body["type"] in OF_WORK]


@pytest.fixture
def groups(allowed, fill, make_group) -> list[int]:
    ids = fill(make_group(1), make_group(2))
    for name in ("ada", "bo", "cy"):
        invite(allowed, name, Role.REVIEWER, actor="local")
    return ids


@pytest.fixture
def told(allowed, receiver, groups) -> Told:
    _, receiver.secret = make_webhook(allowed, "demo", receiver.url, CHOSEN, actor="lea")
    return Told(allowed, receiver)


def judge(store: Store, group: int, state: str, actor: str) -> None:
    reason = "other" if state == "rejected" else None
    set_verdict(
        store,
        group,
        state,
        reason,
        "seen",
        if_match=load_group_state(store, group).etag,
        actor=actor,
    )


def annotate(store: Store, batch: int, person: str, moved: float) -> int:
    copy = LeaseService(store).lease_next_group(batch, BatchMember(person)).group
    assert copy is not None
    state = load_group_state(store, copy)
    view = next(view for view in state.group.views if view.ball is not None)
    assert view.ball is not None and view.ball.box is not None
    ball = replace(view.ball, box=replace(view.ball.box, x=view.ball.box.x + moved))
    submit_edit(store, copy, make_set_ball_edit(view.key, ball), if_match=state.etag, actor=person)
    judge(store, copy, "accepted", person)
    return copy


def test_a_batch_is_told_of_from_giving_out_until_it_is_done(allowed, told, groups) -> None:
    new = NewBatch("Derby", annotators=["ada"], due=date(2031, 1, 2))
    batch = make_batch(allowed, "demo", new, actor="lea").id
    change_batch(allowed, batch, actor="lea", name="Derby day")
    change_batch(allowed, batch, actor="lea", annotators=["bo"])
    (made, (kind, handed_on)) = told.new()
    assert made[0] == MessageKind.GIVEN_OUT and kind == MessageKind.HANDED_ON
    said = {"id": batch, "name": "Derby", "due": "2031-01-02", "verdicts": 1, "blind": True}
    counts = {"annotators": ["ada"], "reviewers": [], "groups": 2, "submitted": 0, "settled": 0}
    assert made[1] == {"dataset": "demo", "actor": "lea", "batch": {**said, **counts}}
    assert handed_on["batch"]["annotators"] == ["bo"] and handed_on["batch"]["name"] == "Derby day"

    LeaseService(allowed).submit_group(batch, groups[0], BatchMember("bo"), actor="bo")
    LeaseService(allowed).return_group(batch, groups[0], BatchMember("cy"), "no ball", actor="cy")
    ((kind, back),) = told.new()
    assert (kind, back["actor"], back["person"]) == (MessageKind.HANDED_BACK, "cy", "bo")
    assert (back["group"], back["batch"]["id"]) == (groups[0], batch) and "no ball" not in str(back)
    assert MessageKind.DATASET not in told.receiver.kinds

    judge(allowed, groups[0], "accepted", "cy")
    judge(allowed, groups[1], "deferred", "cy")
    assert told.new() == []
    judge(allowed, groups[1], "rejected", "cy")
    judge(allowed, groups[1], "accepted", "cy")
    ((kind, done),) = told.new()
    assert (kind, done["actor"], done["batch"]["settled"]) == (MessageKind.DONE, "cy", 2)


def test_what_differs_is_told_of_once_and_so_is_the_end_of_the_batch(allowed, told, groups) -> None:
    new = NewBatch("Twice", size=1, annotators=["ada", "bo"], reviewers=["cy"], verdicts=2)
    batch = make_batch(allowed, "demo", new, actor="lea").id
    annotate(allowed, batch, "ada", 0.0)
    copy = annotate(allowed, batch, "bo", 40.0)
    assert compare_or_adopt_submission(allowed, copy) == "open"
    assert compare_submitted_annotations(allowed, groups[0], batch) == "open"
    (_, (kind, case)) = told.new()
    assert (kind, case["group"], case["people"]) == (MessageKind.DISPUTED, groups[0], ["ada", "bo"])
    assert case["batch"]["id"] == batch and case["disagreements"] > 0 and case["worst"] > 1
    bo = next(
        take
        for take in read_case(allowed, groups[0], actor="cy").annotations
        if take.person == "bo"
    )
    return_for_correction(allowed, groups[0], bo.id, "look again", actor="cy")
    ((kind, back),) = told.new()
    assert (kind, back["group"], back["copy"]) == (MessageKind.HANDED_BACK, groups[0], copy)

    judge(allowed, copy, "accepted", "bo")
    assert compare_or_adopt_submission(allowed, copy) == "open"
    adjudicate_case(allowed, groups[0], bo.id, actor="cy")
    assert [kind for kind, _ in told.new()] == [MessageKind.DISPUTED, MessageKind.DONE]


def test_a_batch_that_stands_still_or_is_late_is_told_of_once(allowed, told, groups) -> None:
    told.receiver.secret = None  # Who verifies takes nothing of another day.
    for name, due in (("idle", None), ("late", date(2020, 1, 2))):
        new = NewBatch(name, annotators=["ada"], due=due, skip_given=False)
        make_batch(allowed, "demo", new, actor="lea")
    late = [data for kind, data in told.new() if kind == MessageKind.STALLED]
    assert [(data["batch"]["name"], data["why"]) for data in late] == [("late", "overdue")]
    assert (late[0]["since"], late[0]["actor"]) == ("2020-01-02", "script:batches")
    told.at += timedelta(hours=23)
    assert told.new() == []
    told.at += timedelta(hours=2)
    found = {data["batch"]["name"]: data["why"] for _, data in told.new()}
    assert found == {"idle": "idle", "late": "idle"}
    told.at += timedelta(hours=2)
    assert told.new() == []
    judge(allowed, groups[0], "accepted", "ada")
    told.at += timedelta(days=2)
    assert {data["batch"]["name"] for _, data in told.new()} == {"idle", "late"}


def test_what_did_not_happen_is_not_told(allowed, told, groups) -> None:
    def fails(_session, _batch):
        raise ConflictError("the answer cannot be kept")

    with pytest.raises(ConflictError), stored_by(fails):
        make_batch(allowed, "demo", NewBatch("never"), actor="lea")
    assert told.new() == []
