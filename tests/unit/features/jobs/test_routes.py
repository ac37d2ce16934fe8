"""Jobs over HTTP."""

from __future__ import annotations

import threading
from typing import Any

from app.features.jobs.job_run import JobProgress
from tests.waiting import SECONDS

API = "/api/v1/jobs"


def submit(app: Any, work: Any = lambda progress: 1, **options: Any) -> int:
    jobs = app.state.services.jobs
    return int(jobs.submit("bulk", "Some work", work, actor="ann", **options).id)


class TestGetJob:
    def test_says_what_a_job_does_and_its_result(self, app, api) -> None:
        job = submit(app, lambda progress: {"n": 1}, dataset_id=1)
        app.state.services.jobs.wait(job, SECONDS)
        body = api.get(f"{API}/{job}").json()
        times = [body.pop(name) for name in ("created", "started", "ended")]
        assert None not in times
        assert body == {
            "id": job,
            "kind": "bulk",
            "title": "Some work",
            "dataset": "broadcast",
            "state": "done",
            "done": 0,
            "total": None,
            "sentence": "",
            "result": {"n": 1},
            "problem": None,
            "actor": "ann",
            "subject": None,
        }

    def test_says_what_it_works_on_and_nothing_else_of_what_was_asked(self, app, api) -> None:
        asked = {"recording": 3, "first": 0, "last": 9, "uploads": {"live": "secret"}}
        body = api.get(f"{API}/{submit(app, request=asked)}").json()
        frames = {"recording": 3, "first": 0, "last": 9}
        assert body["subject"] == {**frames, "link": None, "practice": None}
        assert "secret" not in str(body)

    def test_of_an_unknown_id_is_404(self, api) -> None:
        assert api.get(f"{API}/77").status_code == 404


class TestListJobs:
    def test_gives_pages_and_filters(self, app, api) -> None:
        ids = [submit(app, dataset_id=n % 2 + 1) for n in range(5)]
        app.state.services.jobs.wait(ids[-1], SECONDS)
        seen, cursor = [], {}
        while cursor is not None:
            page = api.get(API, params={"limit": 2, **cursor}).json()
            seen += [item["id"] for item in page["items"]]
            cursor = {"cursor": page["next"]} if page["next"] else None
        assert seen == ids[::-1]
        mine = api.get(API, params={"dataset": "static"}).json()
        assert [item["id"] for item in mine["items"]] == [ids[3], ids[1]]
        assert api.get(API, params={"state": "failed"}).json() == {"items": [], "next": None}
        other = app.state.services.jobs.submit("verify", "Other", lambda _: 1, actor="ann").id
        app.state.services.jobs.wait(other, SECONDS)
        for kind, expected in (("verify", [other]), ("bulk", ids[::-1])):
            found = api.get(API, params={"kind": kind}).json()["items"]
            assert [item["id"] for item in found] == expected
        done = api.get(API, params={"state": "done"}).json()["items"]
        assert [item["id"] for item in done] == [other, *ids[::-1]]
        assert api.get(API, params={"dataset": "nothing"}).status_code == 404
        assert api.get(API, params={"cursor": "x"}).status_code == 400

    def test_open_are_those_that_wait_or_run(self, app, api) -> None:
        over, going = submit(app), threading.Event()
        app.state.services.jobs.wait(over, SECONDS)

        def held(_: JobProgress) -> int:
            assert going.wait(SECONDS)
            return 1

        ids = [submit(app, held), submit(app)]
        found = api.get(API, params={"state": "open"}).json()["items"]
        going.set()
        assert [item["id"] for item in found] == ids[::-1]


class TestCancelJob:
    def test_cancelling_ends_a_running_job_and_a_finished_one_is_409(self, app, api) -> None:
        started = threading.Event()

        def endless(progress: JobProgress) -> None:
            while True:
                started.set()
                progress(1, 2)

        job = submit(app, endless)
        assert started.wait(SECONDS)
        assert api.delete(f"{API}/{job}").status_code == 200
        assert app.state.services.jobs.wait(job, SECONDS).state == "cancelled"
        assert api.delete(f"{API}/{job}").json()["state"] == "cancelled"
        done = submit(app)
        app.state.services.jobs.wait(done, SECONDS)
        assert api.delete(f"{API}/{done}").status_code == 409


class TestOverload:
    def test_too_many_jobs_are_503_with_a_time_to_come_back(self, app, api) -> None:
        app.state.services.jobs._capacity = 0
        body = {"dataset": "broadcast", "format": "cameras", "all": True}
        answer = api.post("/api/v1/exports", json=body)
        assert (answer.status_code, answer.headers["retry-after"]) == (503, "5")
