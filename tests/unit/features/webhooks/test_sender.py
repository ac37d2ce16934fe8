"""Sending: signed, once, again where nobody answered, and nowhere else."""

from __future__ import annotations

import ssl
import threading
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text

from app.db.home import WEBHOOKS
from app.db.session import format_utc_time
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.datasets.service import delete_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.jobs.queries import NewJob, insert_job, update_job
from app.features.jobs.service import Jobs
from app.features.maintenance.upkeep import delete_old_deliveries
from app.features.people.roles import Role
from app.features.people.service import change_person, find_person, give_role, invite
from app.features.verdicts.service import set_verdict
from app.features.webhooks import sender as module
from app.features.webhooks.messages import CHOSEN, MessageKind, sign_message
from app.features.webhooks.sender import RETRY_DELAYS, WebhookSender
from app.features.webhooks.service import (
    change_webhook,
    list_deliveries,
    list_webhooks,
    make_webhook,
    remove_webhook,
    renew_secret,
    resend_delivery,
    send_ping,
)
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from tests.unit.features.webhooks.conftest import Receiver
from tests.waiting import SECONDS

BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))


class Clock:
    """A time that tests set."""

    def __init__(self) -> None:
        self.now = datetime.now(UTC) + timedelta(minutes=1)

    def __call__(self) -> datetime:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def sender(allowed: Store, clock: Clock) -> WebhookSender:
    return WebhookSender(allowed, clock)


@pytest.fixture
def hook(allowed: Store, receiver: Receiver, state) -> int:
    """A webhook that wants everything, of a receiver that verifies it."""
    webhook, receiver.secret = make_webhook(allowed, "demo", receiver.url, CHOSEN, actor="ann")
    return webhook.id


def judge(store, state, verdict="accepted"):
    return set_verdict(store, state.id, verdict, None, None, if_match=state.etag, actor="ann")


def end_job(store: Store, state: str) -> None:
    with store.write() as session:
        number = session.execute(text("SELECT id FROM dataset")).scalar_one()
        job = insert_job(session, NewJob("export", "COCO", "ann", number))
        at = datetime.now(UTC).isoformat(timespec="microseconds")
        update_job(session, job, state=state, ended=at)


class TestTelling:
    def test_what_happens_is_told_signed_and_once(
        self, allowed, sender, receiver, hook, state
    ) -> None:
        after = submit_edit(
            allowed,
            state.id,
            make_set_ball_edit(state.group.views[0].key, BALL),
            if_match=state.etag,
            actor="ann",
        )
        after = undo_group_edit(allowed, state.id, if_match=after.etag, actor="ann")
        after = judge(allowed, after)
        end_job(allowed, "failed")
        assert sender.queue_new_messages() == 3
        assert sender.send_due_messages() == 3
        assert sorted(receiver.kinds) == [
            MessageKind.CHANGED,
            MessageKind.JUDGED,
            MessageKind.JOB_FAILED,
        ]
        by_kind = {body["type"]: body["data"] for _, body in receiver.got}
        changed = by_kind[MessageKind.CHANGED]
        assert [entry["kind"] for entry in changed["entries"]] == ["edit", "undo"]
        assert {entry["group"] for entry in changed["entries"]} == {state.id}
        assert (changed["dataset"], changed["actor"]) == ("demo", "ann")
        assert by_kind[MessageKind.JOB_FAILED]["job"]["kind"] == "export"
        assert (sender.queue_new_messages(), sender.send_due_messages()) == (0, 0)
        (webhook,) = list_webhooks(allowed, "demo")
        assert (webhook.waiting, webhook.delivered, webhook.failed) == (0, 3, 0)
        judge(allowed, after, "deferred")
        assert (sender.queue_new_messages(), sender.send_due_messages()) == (1, 1)
        assert len(receiver.got[-1][1]["data"]["entries"]) == 1

    def test_certificates_are_read_once(
        self, allowed, sender, receiver, hook, state, monkeypatch
    ) -> None:
        found, read = [], ssl.create_default_context
        monkeypatch.setattr(
            ssl, "create_default_context", lambda **asked: found.append(asked) or read(**asked)
        )
        module._tls_context.cache_clear()
        for verdict in ("accepted", "deferred"):
            state = judge(allowed, state, verdict)
            assert (sender.queue_new_messages(), sender.send_due_messages()) == (1, 1)
        assert len(found) == 1

    def test_what_was_before_and_kinds_that_nobody_wants_are_not_told(
        self, allowed, sender, receiver, state
    ) -> None:
        state = judge(allowed, state)
        make_webhook(allowed, "demo", receiver.url, [MessageKind.JOB_DONE], actor="ann")
        state = judge(allowed, state, "deferred")
        end_job(allowed, "done")
        end_job(allowed, "cancelled")
        sender.queue_new_messages()
        sender.send_due_messages()
        assert receiver.kinds == [MessageKind.JOB_DONE]

    def test_an_end_that_is_written_late_or_by_an_earlier_clock_is_told(
        self, allowed, receiver, sender, hook, state, monkeypatch
    ) -> None:
        jobs = Jobs(allowed)
        with allowed.write() as session:
            number = session.execute(text("SELECT id FROM dataset")).scalar_one()
            ids = [insert_job(session, NewJob("export", "COCO", "ann", number)) for _ in range(3)]
        hour = datetime.now(UTC) + timedelta(hours=1)
        with monkeypatch.context() as patch:
            patch.setattr("app.features.jobs.queries.now", lambda: format_utc_time(hour))
            jobs._save_end(ids[2], state="done")
        sender.queue_new_messages()
        for job in ids[:2]:
            jobs._save_end(job, state="failed")
            sender.queue_new_messages()
        sender.send_due_messages()
        told = [body["data"]["job"]["id"] for _, body in receiver.got if "job" in body["data"]]
        # Messages are sent side by side.
        assert sorted(told) == ids

    def test_a_sender_that_died_before_it_sent_is_followed_by_one_that_does(
        self, allowed, sender, receiver, hook, state, clock
    ) -> None:
        judge(allowed, state)
        sender.queue_new_messages()
        later = WebhookSender(allowed, clock)
        assert (later.queue_new_messages(), later.send_due_messages()) == (0, 1)
        assert receiver.kinds == [MessageKind.JUDGED]

    def test_a_server_sends_by_itself(self, allowed, receiver, hook, state) -> None:
        running = WebhookSender(allowed)
        running.start()
        judge(allowed, state)
        deadline = datetime.now(UTC) + timedelta(seconds=SECONDS)
        while not receiver.got and datetime.now(UTC) < deadline:
            running._closing.wait(0.02)
        running.close()
        assert receiver.kinds == [MessageKind.JUDGED]


class TestTryingAgain:
    def test_one_that_fails_is_tried_again_later_under_the_same_id(
        self, allowed, sender, receiver, hook, clock
    ) -> None:
        # The library takes no message of another hour; here it is the sender's clock that runs.
        receiver.answers, receiver.secret = [500, 302], None
        send_ping(allowed, "demo", hook, actor="ann")
        assert sender.send_due_messages() == 1
        assert sender.send_due_messages() == 0
        clock.now += RETRY_DELAYS[0]
        assert sender.send_due_messages() == 1
        (delivery,) = list_deliveries(allowed, "demo", hook)
        assert delivery.problem == "it answered 302 (redirects are not followed)"
        clock.now += RETRY_DELAYS[1]
        assert sender.send_due_messages() == 1
        (delivery,) = list_deliveries(allowed, "demo", hook)
        assert (delivery.state, delivery.attempts, delivery.status) == ("delivered", 3, 204)
        assert delivery.problem is None
        assert {headers["webhook-id"] for headers, _ in receiver.got} == {delivery.message}
        assert receiver.kinds == [MessageKind.PING] * 3

    def test_who_takes_nothing_for_days_is_told_no_more(
        self, allowed, sender, receiver, hook, clock, state
    ) -> None:
        receiver.answers, receiver.secret = [500] * 20, None
        send_ping(allowed, "demo", hook, actor="ann")
        for pause in (*RETRY_DELAYS, timedelta()):
            assert sender.send_due_messages() == 1
            clock.now += pause
        assert sender.send_due_messages() == 0
        (webhook,) = list_webhooks(allowed, "demo")
        assert webhook.failed == 1
        assert "nothing arrived since" in (webhook.off or "")
        judge(allowed, state)
        assert sender.queue_new_messages() == 0
        with pytest.raises(ConflictError, match="nothing arrived since"):
            send_ping(allowed, "demo", hook, actor="ann")

    def test_turned_on_again_it_is_told_what_happens_from_then_on(
        self, allowed, sender, receiver, hook, state
    ) -> None:
        change_webhook(allowed, "demo", hook, on=False, actor="local")
        state = judge(allowed, state)
        change_webhook(allowed, "demo", hook, on=True, actor="local")
        assert sender.queue_new_messages() == 0
        judge(allowed, state, "deferred")
        assert (sender.queue_new_messages(), sender.send_due_messages()) == (1, 1)

    def test_who_answers_410_wants_nothing_more(self, allowed, sender, receiver, hook) -> None:
        receiver.answers = [410]
        send_ping(allowed, "demo", hook, actor="ann")
        sender.send_due_messages()
        (webhook,) = list_webhooks(allowed, "demo")
        assert "410" in (webhook.off or "")

    def test_a_message_is_sent_again_when_somebody_asks(
        self, allowed, sender, receiver, hook
    ) -> None:
        send_ping(allowed, "demo", hook, actor="ann")
        sender.send_due_messages()
        (delivery,) = list_deliveries(allowed, "demo", hook)
        resend_delivery(allowed, "demo", hook, delivery.id)
        assert sender.send_due_messages() == 1
        assert receiver.kinds == [MessageKind.PING, MessageKind.PING]
        with pytest.raises(NotFoundError):
            resend_delivery(allowed, "demo", hook, delivery.id + 1)

    def test_one_that_nobody_listens_to_says_so(
        self, allowed, sender, hook, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        url = "http://127.0.0.1:9/hook"
        settings = allowed.settings.model_copy(update={"webhooks": [url]})
        monkeypatch.setattr(allowed, "settings", settings)
        change_webhook(allowed, "demo", hook, url=url, actor="local")
        send_ping(allowed, "demo", hook, actor="ann")
        sender.send_due_messages()
        (delivery,) = list_deliveries(allowed, "demo", hook)
        assert (delivery.state, delivery.status) == ("waiting", None)
        assert "could not be reached" in (delivery.problem or "")


class TestTogether:
    @pytest.fixture
    def slow(self, allowed, hook, receiver) -> int:
        """A webhook whose receiver takes what is sent and says nothing; a message waits for it."""
        made, _ = make_webhook(allowed, "demo", f"{receiver.url}/slow", CHOSEN, actor="ann")
        send_ping(allowed, "demo", made.id, actor="ann")
        return made.id

    def test_a_receiver_that_says_nothing_holds_up_nobody_else(
        self, allowed, sender, receiver, hook, slow, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "SECONDS", 0.5)
        send_ping(allowed, "demo", hook, actor="ann")
        assert sender.send_due_messages() == 2
        assert receiver.kinds == [MessageKind.PING]
        (delivery,) = list_deliveries(allowed, "demo", slow)
        assert "no answer" in (delivery.problem or "")

    def test_what_happens_meanwhile_is_told_to_others_at_once(
        self, allowed, sender, hook, slow, state, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "LOOK_SECONDS", 0.01)
        said: list[str] = []

        def look() -> None:
            (*_, first) = list_deliveries(allowed, "demo", hook) or (None,)
            if first is None:
                judge(allowed, state)
                sender.queue_new_messages()
            elif first.state == "delivered":
                said.extend(item.state for item in list_deliveries(allowed, "demo", slow))
                sender.stop()

        sender.send_due_messages(look)
        assert "waiting" in said and "delivered" not in said

    def test_one_of_many_messages_to_it_is_no_reason_to_let_others_wait(
        self, allowed, sender, receiver, hook, slow, state, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(module, "SECONDS", 0.5)
        monkeypatch.setattr(module, "TOGETHER", 2)
        for verdict in ("accepted", "deferred", "accepted"):
            state = judge(allowed, state, verdict)
            sender.queue_new_messages()
        assert sender.send_due_messages() == 2
        assert receiver.kinds == [MessageKind.JUDGED]

    def test_a_server_that_stops_does_not_wait_for_it(
        self, allowed, sender, receiver, slow
    ) -> None:
        sending = threading.Thread(target=sender.send_due_messages)
        sending.start()
        sender.close()
        sending.join(SECONDS)
        assert not sending.is_alive()
        (delivery,) = list_deliveries(allowed, "demo", slow)
        assert (delivery.state, delivery.attempts) == ("waiting", 0)

    def test_whatever_goes_wrong_with_one_message_the_others_arrive(
        self, allowed, sender, receiver, hook, state, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def spoilt(secret: str, message: str, *rest: object) -> dict[str, str]:
            if "ping" in message:
                raise UnicodeError("label empty or too long")
            return sign_message(secret, message, *rest)  # type: ignore[arg-type]

        monkeypatch.setattr(module, "sign_message", spoilt)
        send_ping(allowed, "demo", hook, actor="ann")
        judge(allowed, state)
        sender.queue_new_messages()
        assert (sender.send_due_messages(), sender.send_due_messages()) == (2, 0)
        assert receiver.kinds == [MessageKind.JUDGED]
        (_, pinged) = list_deliveries(allowed, "demo", hook)
        assert (pinged.attempts, pinged.problem) == (
            1,
            "it could not be sent: label empty or too long",
        )

    def test_a_ping_that_waits_is_not_doubled(self, allowed, hook) -> None:
        first = send_ping(allowed, "demo", hook, actor="ann")
        assert send_ping(allowed, "demo", hook, actor="ann").id == first.id


class TestWhere:
    def test_an_address_that_is_allowed_no_more_gets_nothing(
        self, allowed, sender, receiver, hook, monkeypatch
    ) -> None:
        send_ping(allowed, "demo", hook, actor="ann")
        elsewhere = allowed.settings.model_copy(update={"webhooks": ["https://other.test/"]})
        monkeypatch.setattr(allowed, "settings", elsewhere)
        sender.send_due_messages()
        assert receiver.got == []
        (delivery,) = list_deliveries(allowed, "demo", hook)
        assert "does not allow" in (delivery.problem or "")

    def test_no_other_address_can_be_given(self, allowed, hook) -> None:
        with pytest.raises(InputError, match="does not allow"):
            make_webhook(allowed, "demo", "http://127.0.0.1:1/", CHOSEN, actor="ann")
        with pytest.raises(InputError, match="does not allow"):
            change_webhook(allowed, "demo", hook, url="http://169.254.169.254/", actor="local")

    def test_who_is_deleted_or_whose_dataset_is_hears_nothing_more(
        self, allowed, sender, receiver, hook
    ) -> None:
        other, _ = make_webhook(allowed, "demo", receiver.url, CHOSEN, actor="ann")
        for number in (hook, other.id):
            send_ping(allowed, "demo", number, actor="ann")
        remove_webhook(allowed, "demo", hook, actor="local")
        delete_dataset(allowed, "demo", confirm="demo", actor="ann")
        assert (sender.queue_new_messages(), sender.send_due_messages()) == (0, 0)
        with allowed.read() as session:
            assert session.execute(text("SELECT count(*) FROM webhook_delivery")).scalar_one() == 0


class TestWhoLeft:
    @pytest.fixture
    def team(self, allowed: Store, hook: int, monkeypatch: pytest.MonkeyPatch) -> Store:
        """Where ann, who made the webhook, has an account; and so has bob."""
        settings = allowed.settings.model_copy(update={"team": True})
        monkeypatch.setattr(allowed, "settings", settings)
        for name in ("ann", "bob"):
            invite(allowed, name, Role.LEAD, actor="local")
        return allowed

    @pytest.mark.parametrize("how", ["disabled", "none here", "viewer"])
    def test_a_webhook_is_told_nothing_once_its_maker_may_not_lead(
        self, team: Store, sender, receiver, hook, state, how: str
    ) -> None:
        ann = find_person(team, "ann").id
        sender.queue_new_messages()
        assert list_webhooks(team, "demo")[0].off is None
        if how == "disabled":
            change_person(team, ann, actor="local", disabled=True)
        elif how == "viewer":
            change_person(team, ann, actor="local", role=Role.VIEWER)
        else:
            give_role(team, "demo", ann, Role.NONE, actor="local")
        judge(team, state)
        assert sender.queue_new_messages() == 0
        sender.send_due_messages()
        assert receiver.kinds == []
        off = list_webhooks(team, "demo")[0].off or ""
        assert "ann, who made it" in off
        # Whoever turns it on again answers for it.
        change_webhook(team, "demo", hook, on=True, actor="bob")
        sender.queue_new_messages()
        told = list_webhooks(team, "demo")[0]
        assert (told.off, told.created_by) == (None, "bob")


class TestSecrets:
    def test_the_database_alone_signs_nothing(self, allowed, receiver, hook) -> None:
        with allowed.read() as session:
            rows = session.execute(text("SELECT * FROM webhook")).all()
        assert receiver.secret is not None
        assert receiver.secret.removeprefix("whsec_") not in str(rows)
        key = allowed.settings.home / WEBHOOKS
        assert key.stat().st_mode & 0o777 == 0o600

    def test_a_new_secret_takes_the_place_of_the_old(self, allowed, sender, receiver, hook) -> None:
        _, renewed = renew_secret(allowed, "demo", hook, actor="local")
        assert renewed != receiver.secret
        receiver.secret = renewed
        send_ping(allowed, "demo", hook, actor="ann")
        sender.send_due_messages()
        assert receiver.kinds == [MessageKind.PING]


class TestForgetting:
    def test_what_was_sent_long_ago_is_forgotten_and_what_waits_is_not(
        self, allowed, sender, hook, clock, monkeypatch
    ) -> None:
        send_ping(allowed, "demo", hook, actor="ann")
        sender.send_due_messages()
        send_ping(allowed, "demo", hook, actor="ann")
        clock.now += timedelta(days=31)
        assert delete_old_deliveries(allowed, clock.now) == 1
        monkeypatch.setattr(allowed, "write", None)
        assert delete_old_deliveries(allowed, clock.now) == 0, "and nothing is written"
        (left,) = list_deliveries(allowed, "demo", hook)
        assert left.state == "waiting"

    def test_a_job_that_was_told_is_not_told_again_once_that_is_forgotten(
        self, allowed, sender, receiver, hook, clock
    ) -> None:
        end_job(allowed, "done")
        end_job(allowed, "done")
        assert (sender.queue_new_messages(), sender.send_due_messages()) == (2, 2)
        clock.now += timedelta(days=31)
        assert delete_old_deliveries(allowed, clock.now) == 2
        assert sender.queue_new_messages() == 0
        assert receiver.kinds == [MessageKind.JOB_DONE] * 2
