"""A server that is stopped between the commit of the work and the end of the answer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from sqlalchemy import func, select
from structlog.testing import capture_logs

from app.api.deps import Services
from app.review.takes.take import begin_take
from app.store.job_models import JobModel
from app.store.models import LogModel
from app.store.session import Session
from app.store.store import Store
from app.store.view_models import SavedViewModel

API = "/api/v1"
KEY = {"Idempotency-Key": "one"}
Request = tuple[str, str, Any, dict[str, str]]


def etag_of(api: Any, path: str) -> dict[str, str]:
    return {"If-Match": api.get(f"{API}{path}").headers["etag"]}


def edit(api: Any) -> Request:
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    return "PATCH", f"/views/{view}/ball", {"point": [600.5, 300.25]}, etag_of(api, "/groups/1")


def undo(api: Any) -> Request:
    method, path, body, headers = edit(api)
    assert api.request(method, f"{API}{path}", json=body, headers=headers).status_code == 200
    return "POST", "/groups/1/undo", None, etag_of(api, "/groups/1")


def station(api: Any) -> Request:
    number = api.get(f"{API}/groups/4").json()["views"][0]["station"]["id"]
    body = {"lines": {"Side line top": [{"x": 10.0, "y": 50.0}, {"x": 90.0, "y": 52.0}]}}
    return "PATCH", f"/stations/{number}/lines", body, etag_of(api, f"/stations/{number}")


def verdict(api: Any) -> Request:
    return "PUT", "/groups/1/verdict", {"state": "deferred"}, etag_of(api, "/groups/1")


def bulk(_api: Any) -> Request:
    body = {"q": "", "state": "deferred", "note": "All of them.", "expected": 3}
    return "POST", "/datasets/broadcast/verdicts", body, {}


def batch_undo(api: Any) -> Request:
    batch = api.post(f"{API}/datasets/broadcast/verdicts", json={"state": "deferred"}).json()
    return "POST", f"/verdict-batches/{batch['batch']}/undo", None, {}


def batch_redo(api: Any) -> Request:
    _, path, _, _ = batch_undo(api)
    assert api.post(f"{API}{path}").status_code == 200
    return "POST", path.replace("undo", "redo"), None, {}


def policy(api: Any) -> Request:
    path = "/datasets/broadcast/policy"
    return "PUT", path, {"name": "strict"}, etag_of(api, path)


def saved_view(_api: Any) -> Request:
    return "POST", "/datasets/broadcast/saved-views", {"name": "Mine", "q": "jac<0.8"}, {}


def no_view(api: Any) -> Request:
    _, path, body, _ = saved_view(api)
    made = api.post(f"{API}{path}", json=body).json()
    return "DELETE", f"/saved-views/{made['id']}", None, {}


def export(_api: Any) -> Request:
    body = {"dataset": "broadcast", "format": "cameras", "all": True}
    return "POST", "/exports", body, {}


def freeze(_api: Any) -> Request:
    return "POST", "/datasets/broadcast/versions", {"name": "v1", "groups": "passing"}, {}


def own_annotations(api: Any) -> list[int]:
    """Copies of a group that two people annotated, who do not agree."""
    store = api.app.state.services.store
    copies = [begin_take(store, 1, person=person).copy_id for person in ("ann", "ben")]
    for copy, state in zip(copies, ("accepted", "rejected"), strict=True):
        body = {"state": state, "note": "seen", "reason": None if copy == copies[0] else "other"}
        headers = etag_of(api, f"/groups/{copy}")
        said = api.put(f"{API}/groups/{copy}/verdict", json=body, headers=headers)
        assert said.status_code == 200, said.text
    return copies


def adjudication(api: Any) -> Request:
    own_annotations(api)
    case = api.get(f"{API}/groups/1/adjudication").json()
    return "POST", "/groups/1/adjudication", {"take": case["takes"][1]["id"]}, {}


def adoption(api: Any) -> Request:
    return "POST", f"/groups/{own_annotations(api)[0]}/adoption", None, {}


ROUTES = [
    adjudication,
    adoption,
    edit,
    undo,
    station,
    verdict,
    bulk,
    batch_undo,
    batch_redo,
    policy,
    saved_view,
    no_view,
    export,
    freeze,
]


@contextmanager
def stopped_after_a_commit(store: Store, patch: pytest.MonkeyPatch) -> Iterator[None]:
    """Whatever commits first never comes back."""
    plain = store.write

    @contextmanager
    def write() -> Iterator[Session]:
        with plain() as session:
            yield session
        raise SystemError("stopped")

    with patch.context() as patched, capture_logs():
        patched.setattr(store, "write", write)
        yield


def done(store: Store) -> list[int]:
    """How much was said, queued and saved."""
    with store.read() as session:
        models = (LogModel, JobModel, SavedViewModel)
        return [session.scalar(select(func.count()).select_from(model)) or 0 for model in models]


class TestStopped:
    @pytest.mark.parametrize("route", ROUTES)
    def test_sent_again_it_gets_the_answer_and_is_not_done_again(
        self, app, api, monkeypatch: pytest.MonkeyPatch, route: Callable[[Any], Request]
    ) -> None:
        method, path, body, headers = route(api)

        def send(key: dict[str, str] = KEY) -> Any:
            return api.request(method, f"{API}{path}", json=body, headers={**headers, **key})

        before = done(app.state.services.store)
        with stopped_after_a_commit(app.state.services.store, monkeypatch):
            assert send().status_code == 500
        app.state.services.close()
        app.state.services = Services.open(app.state.services.settings)
        work = done(app.state.services.store)
        assert work != before
        again = send()
        assert (again.status_code // 100, again.headers["idempotency-replayed"]) == (2, "true")
        assert done(app.state.services.store) == work
        assert send().content == again.content

    def test_the_answer_is_the_one_that_would_have_been_sent(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        method, path, body, headers = edit(api)
        with stopped_after_a_commit(app.state.services.store, monkeypatch):
            api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        again = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        now = api.get(f"{API}/groups/1")
        assert again.content == now.content
        for name in ("etag", "content-type", "cache-control"):
            assert again.headers[name] == now.headers[name]

    def test_what_is_rolled_back_has_no_answer(
        self, app, api, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        method, path, body, headers = verdict(api)
        with monkeypatch.context() as patched, capture_logs():
            patched.setattr(Session, "commit", lambda _: (_ for _ in ()).throw(SystemError("full")))
            send = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
            assert send.status_code == 500
        again = api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        assert (again.status_code, "idempotency-replayed" in again.headers) == (200, False)


class TestCost:
    @pytest.mark.parametrize(("route", "most"), [(edit, 16), (verdict, 16)])
    def test_a_change_under_a_key_is_one_durable_commit(
        self, app, api, counted, route: Any, most: int
    ) -> None:
        method, path, body, headers = route(api)
        api.get(f"{API}/groups/2")
        with counted(app.state.services.store) as cost:
            api.request(method, f"{API}{path}", json=body, headers={**headers, **KEY})
        # The group is read; the answer is written with the change. What is told by one statement,
        # the key and whose annotation it is, needs no transaction.
        assert (cost.reads, cost.writes, cost.commits) == (1, 1, 1)
        assert cost.statements <= most
