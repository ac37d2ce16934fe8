"""Webhooks over HTTP: made with a secret that is shown once, tried, turned off, deleted."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from sqlalchemy import text
from standardwebhooks import Webhook

from app.features.imports.ingest import import_groups
from app.features.webhooks.messages import sign_message

API = "/api/v1"
URL = "https://hooks.example.org/touchline"


@pytest.fixture
def hooks(app, group, monkeypatch: pytest.MonkeyPatch) -> str:
    """Where the webhooks of the group's dataset are; the operator allows an address."""
    store = app.state.services.store
    import_groups(store, "demo", [group], source="test", actor="local")
    settings = store.settings.model_copy(update={"webhooks": [URL]})
    monkeypatch.setattr(store, "settings", settings)
    return f"{API}/datasets/demo/webhooks"


def test_one_is_made_changed_tried_and_deleted(api, hooks: str) -> None:
    made = api.post(hooks, json={"url": f"{URL}/a", "kinds": ["group.judged", "job.failed"]})
    assert made.status_code == 201, made.text
    webhook, secret = made.json()["webhook"], made.json()["secret"]
    at, body = datetime.now(UTC), '{"a": 1}'
    assert Webhook(secret).verify(body, sign_message(secret, "msg_1", at, body)) == {"a": 1}
    listed = api.get(hooks).json()
    assert listed["items"] == [webhook]
    assert listed["allowed"] == [URL]
    assert secret not in api.get(hooks).text
    one = f"{hooks}/{webhook['id']}"
    pinged = api.post(f"{one}/ping")
    assert (pinged.status_code, pinged.json()["kind"]) == (201, "ping")
    (delivery,) = api.get(f"{one}/deliveries").json()["items"]
    assert delivery["message"] == pinged.json()["message"]
    again = api.post(f"{one}/deliveries/{delivery['id']}")
    assert (again.status_code, again.json()["state"]) == (200, "waiting")
    assert api.post(f"{one}/secret").json()["secret"] != secret
    off = api.patch(one, json={"on": False, "kinds": ["job.done"]}).json()
    assert (off["kinds"], off["off"]) == (["job.done"], "a person turned it off")
    assert api.post(f"{one}/ping").status_code == 409
    assert api.delete(one).status_code == 204
    assert api.delete(one).status_code == 404
    assert api.get(hooks).json()["items"] == []


@pytest.mark.parametrize(
    ("body", "status", "pointer"),
    [
        ({"url": "https://evil.test/", "kinds": ["job.done"]}, 400, "/url"),
        ({"url": f"{URL}/../admin", "kinds": ["job.done"]}, 400, "/url"),
        ({"url": URL, "kinds": ["ping"]}, 400, "/kinds"),
        ({"url": URL, "kinds": []}, 422, "/kinds"),
        ({"url": URL, "kinds": ["edit"]}, 422, "/kinds/0"),
    ],
)
def test_what_cannot_be_told_is_refused_with_its_field(
    api, hooks: str, body, status, pointer
) -> None:
    refused = api.post(hooks, json=body)
    assert (refused.status_code, refused.json()["pointer"]) == (status, pointer)


def test_a_webhook_of_another_dataset_is_unknown(api, hooks: str, app, group) -> None:
    import_groups(app.state.services.store, "other", [group], source="test", actor="local")
    made = api.post(hooks, json={"url": URL, "kinds": ["job.done"]}).json()["webhook"]["id"]
    elsewhere = f"{API}/datasets/other/webhooks/{made}"
    for answer in (
        api.patch(elsewhere, json={"on": False}),
        api.delete(elsewhere),
        api.post(f"{elsewhere}/ping"),
        api.post(f"{elsewhere}/secret"),
        api.get(f"{elsewhere}/deliveries"),
    ):
        assert answer.status_code == 404


def test_the_secret_is_not_kept_among_the_answers(api, hooks: str, app) -> None:
    key = {"Idempotency-Key": "once"}
    made = api.post(hooks, json={"url": URL, "kinds": ["job.done"]}, headers=key)
    assert made.status_code == 201
    with app.state.services.store.read() as session:
        assert session.execute(text("SELECT count(*) FROM answer WHERE key = 'once'")).scalar() == 0
