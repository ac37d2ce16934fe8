"""Requests that change a group, or what belongs to one, each made ready to be sent."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from app.db.store import Store
from app.features.batches.leases import BatchMember, LeaseService
from app.features.batches.service import NewBatch, make_batch
from app.features.independent_annotations.service import begin_annotation, submit_annotation
from app.features.people.queries import find_person_by_name, update_person
from app.features.people.roles import Role
from app.features.people.service import invite
from app.http.deps import Services
from tests.waiting import SECONDS

API = "/api/v1"
Request = tuple[str, str, Any, dict[str, str]]
"""Method, address, body and headers."""
Made = Callable[[Any], Request]
"""Brings the application to where a request changes something, and makes that request."""


def services_of(api: Any) -> Services:
    services: Services = api.app.state.services
    return services


def store_of(api: Any) -> Store:
    return services_of(api).store


def send(api: Any, request: Request) -> Any:
    """The answer to a request, which is a success."""
    method, path, body, headers = request
    answer = api.request(method, f"{API}{path}", json=body, headers=headers)
    assert answer.status_code // 100 == 2, answer.text
    return answer


def ended(api: Any, request: Request) -> Any:
    """The job that a request starts, once it is over."""
    job = services_of(api).jobs.wait(send(api, request).json()["id"], SECONDS)
    assert job.state == "done", job.problem
    return job


def idle(api: Any) -> None:
    """Wait until no job is under way."""
    jobs = services_of(api).jobs
    for job in jobs.find():
        jobs.wait(job.id, SECONDS)


def etag_of(api: Any, path: str) -> dict[str, str]:
    return {"If-Match": api.get(f"{API}{path}").headers["etag"]}


def ball(api: Any) -> Request:
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    return "PATCH", f"/views/{view}/ball", {"point": [600.5, 300.25]}, etag_of(api, "/groups/1")


def lines(api: Any) -> Request:
    view = api.get(f"{API}/groups/1").json()["views"][0]
    name, points = next(iter(view["lines"].items()))
    moved = [{"x": point["x"] + 2.0, "y": point["y"]} for point in points]
    return (
        "PATCH",
        f"/views/{view['id']}/lines",
        {"lines": {name: moved}},
        etag_of(api, "/groups/1"),
    )


def bulk_edits(api: Any) -> Request:
    """The ball and lines of two views of one group, and a view that is not there."""
    body = lines(api)[2]
    one, two = (view["id"] for view in api.get(f"{API}/groups/1").json()["views"][:2])
    items = [
        {"view": one, **body, "ball": {"point": [600.5, 300.25]}},
        {"view": two, "ball": None},
        {"view": 10**9, "ball": None},
    ]
    return "POST", "/datasets/broadcast/edits", {"items": items, "if_match": "*"}, {}


def left_out(api: Any) -> Request:
    view = api.get(f"{API}/groups/1").json()["views"][0]["id"]
    body = {"included": False, "reason": "not_same_instant"}
    return "PATCH", f"/views/{view}", body, etag_of(api, "/groups/1")


def undo(api: Any) -> Request:
    send(api, ball(api))
    return "POST", "/groups/1/undo", None, etag_of(api, "/groups/1")


def redo(api: Any) -> Request:
    send(api, undo(api))
    return "POST", "/groups/1/redo", None, etag_of(api, "/groups/1")


def verdict(api: Any) -> Request:
    return "PUT", "/groups/1/verdict", {"state": "deferred"}, etag_of(api, "/groups/1")


def dismissal(api: Any) -> Request:
    group, finding = next(
        (one["id"], found)
        for one in api.get(f"{API}/groups?dataset=broadcast").json()["items"]
        for found in api.get(f"{API}/groups/{one['id']}").json()["solution"]["findings"]
    )
    names = ("kind", "view", "marking", "suggested", "number")
    body = {**{name: finding[name] for name in names}, "dismissed": True}
    path = f"/groups/{group}"
    return "PUT", f"{path}/dismissal", body, etag_of(api, path)


def station_of(api: Any) -> str:
    number = api.get(f"{API}/groups/4").json()["views"][0]["station"]["id"]
    return f"/stations/{number}"


def station_lines(api: Any) -> Request:
    path = station_of(api)
    body = {"lines": {"Side line top": [{"x": 10.0, "y": 50.0}, {"x": 90.0, "y": 52.0}]}}
    return "PATCH", f"{path}/lines", body, etag_of(api, path)


def station_calibration(api: Any) -> Request:
    path = station_of(api)
    return "PATCH", path, {"calibration": "lines"}, etag_of(api, path)


def station_undo(api: Any) -> Request:
    send(api, station_lines(api))
    idle(api)
    path = station_of(api)
    return "POST", f"{path}/undo", None, etag_of(api, path)


def station_redo(api: Any) -> Request:
    send(api, station_undo(api))
    idle(api)
    path = station_of(api)
    return "POST", f"{path}/redo", None, etag_of(api, path)


def thread(_api: Any) -> Request:
    return "POST", "/groups/1/threads", {"text": "Look at the near post."}, {}


def begun_thread(api: Any) -> tuple[str, str]:
    """Addresses of a thread, and of its comment."""
    made = send(api, thread(api)).json()
    path = f"/groups/1/threads/{made['id']}"
    return path, f"{path}/comments/{made['comments'][0]['id']}"


def thread_resolved(api: Any) -> Request:
    return "PATCH", begun_thread(api)[0], {"resolved": True}, {}


def comment(api: Any) -> Request:
    return "POST", f"{begun_thread(api)[0]}/comments", {"text": "It is the far one."}, {}


def comment_edited(api: Any) -> Request:
    return "PATCH", begun_thread(api)[1], {"text": "Look at the far post."}, {}


def comment_deleted(api: Any) -> Request:
    return "DELETE", begun_thread(api)[1], None, {}


def own_annotations(api: Any) -> list[int]:
    """Copies of a group that two people annotated, who do not agree."""
    store = api.app.state.services.store
    copies = [begin_annotation(store, 1, person=person).group for person in ("ann", "ben")]
    for copy, state in zip(copies, ("accepted", "rejected"), strict=True):
        body = {"state": state, "note": "seen", "reason": None if copy == copies[0] else "other"}
        headers = etag_of(api, f"/groups/{copy}")
        said = api.put(f"{API}/groups/{copy}/verdict", json=body, headers=headers)
        assert said.status_code == 200, said.text
    return copies


def adjudication(api: Any) -> Request:
    own_annotations(api)
    case = api.get(f"{API}/groups/1/adjudication").json()
    return "POST", "/groups/1/adjudication", {"annotation": case["annotations"][1]["id"]}, {}


def adjudication_back(api: Any) -> Request:
    own_annotations(api)
    case = api.get(f"{API}/groups/1/adjudication").json()
    body = {"annotation": case["annotations"][1]["id"], "reason": "The ball in B is the spot."}
    return "POST", "/groups/1/adjudication/return", body, {}


def adoption(api: Any) -> Request:
    return "POST", f"/groups/{own_annotations(api)[0]}/adoption", None, {}


def take(_api: Any) -> Request:
    return "POST", "/groups/1/independent-annotations", None, {}


def take_handed_in(api: Any) -> Request:
    return "POST", f"/groups/{send(api, take(api)).json()['group']}/submission", None, {}


def take_handed_back(api: Any) -> Request:
    own = begin_annotation(store_of(api), 1, person="ann")
    submit_annotation(store_of(api), own.id, actor="ann")
    return "POST", f"/groups/{own.group}/return", {"reason": "Look again."}, {}


def gold(api: Any) -> Request:
    body = {"state": "accepted", "note": "seen"}
    send(api, ("PUT", "/groups/1/verdict", body, etag_of(api, "/groups/1")))
    return "PUT", "/groups/1/gold", {"start": "bare"}, {}


def gold_start(api: Any) -> Request:
    send(api, gold(api))
    return "PATCH", "/groups/1/gold", {"start": "imported"}, {}


def no_gold(api: Any) -> Request:
    send(api, gold(api))
    return "DELETE", "/groups/1/gold", None, {}


def own_of_batch(api: Any) -> str:
    """Address of an own annotation in a batch in which two annotate each group."""
    made = make_batch(store_of(api), "broadcast", NewBatch("Twice", verdicts=2), actor="local")
    taken = send(api, ("POST", f"/batches/{made.id}/next", {}, {})).json()
    return f"/batches/{made.id}/groups/{taken['group']}"


def submitted(api: Any) -> Request:
    return "PUT", f"{own_of_batch(api)}/submission", None, {}


def hand_in_taken_back(api: Any) -> Request:
    store = store_of(api)
    invite(store, "ann", Role.ANNOTATOR, actor="local")
    made = make_batch(store, "broadcast", NewBatch("Once", annotators=["ann"]), actor="local")
    with store.write() as session:
        # Whoever asks a server without accounts is an annotator of this batch.
        update_person(session, find_person_by_name(session, "ann").id, name="local")
    LeaseService(store).submit_group(made.id, 1, BatchMember("local"), actor="local")
    return "DELETE", f"/batches/{made.id}/groups/1/submission", None, {}


def returned_group(api: Any) -> Request:
    store = store_of(api)
    invite(store, "ann", Role.ANNOTATOR, actor="local")
    made = make_batch(store, "broadcast", NewBatch("Once", annotators=["ann"]), actor="local")
    LeaseService(store).submit_group(made.id, 1, BatchMember("ann"), actor="ann")
    return "POST", f"/batches/{made.id}/groups/1/return", {"reason": "Look again."}, {}
