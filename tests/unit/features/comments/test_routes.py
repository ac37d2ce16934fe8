"""Comments over HTTP: text is text, and what is one's own is said to be."""

from __future__ import annotations

from app.features.imports.ingest import import_groups

THREADS = "/api/v1/groups/1/threads"
HOSTILE = "<img src=x onerror=alert(1)> @anna"


def test_a_thread_is_begun_replied_to_changed_and_resolved(api, app, group) -> None:
    import_groups(app.state.services.store, "demo", [group], source="test", actor="local")
    view = api.get("/api/v1/groups/1").json()["views"][0]["key"]
    began = {"text": HOSTILE, "view": view, "at": {"x": 1.5, "y": 2.0}}
    made = api.post(THREADS, json=began, headers={"Idempotency-Key": "one"})
    assert made.status_code == 201, made.text
    thread = made.json()
    assert (thread["view"], thread["at"]) == (view, {"x": 1.5, "y": 2.0})
    (comment,) = thread["comments"]
    assert (comment["text"], comment["mine"], comment["mentions"]) == (HOSTILE, True, [])
    again = api.post(THREADS, json=began, headers={"Idempotency-Key": "one"})
    assert again.json() == thread
    one = f"{THREADS}/{thread['id']}"
    own = f"{one}/comments/{comment['id']}"
    other = {"X-Actor": "nightly"}
    assert api.patch(own, json={"text": "b"}, headers=other).status_code == 403
    assert api.delete(own, headers=other).status_code == 403
    assert api.post(f"{one}/comments", json={"text": "c"}, headers=other).status_code == 201
    assert api.patch(own, json={"text": "b"}).json()["comments"][0]["text"] == "b"
    assert api.patch(one, json={"resolved": True}).json()["resolved_by"] == "local"
    assert api.delete(own).status_code == 204
    (listed,) = api.get(THREADS).json()["items"]
    assert [said["text"] for said in listed["comments"]] == [None, "c"]
    entries = api.get("/api/v1/groups/1/history").json()["items"]
    assert [entry["body"]["did"] for entry in entries[1:]] == [
        *("said", "said", "edited", "resolved", "deleted")
    ]
    assert "onerror" not in api.get("/api/v1/groups/1/history").text, "it was deleted"


def test_the_audit_is_a_table_without_formulas_and_lines_of_json(api, app, group) -> None:
    import_groups(app.state.services.store, "demo", [group], source="test", actor="=cmd")
    api.post(THREADS, json={"text": "one,\n=two"})
    table = api.get("/api/v1/audit/export.csv?dataset=demo")
    assert table.headers["content-type"].startswith("text/csv")
    assert ",'=cmd," in table.text and ",=" not in table.text
    lines = api.get("/api/v1/audit/export.jsonl?q=commented").text.splitlines()
    assert len(lines) == 1 and '"family":"comment"' in lines[0]
    assert api.get("/api/v1/audit?group=99").status_code == 404
