"""Reading paint as a job: what it says, what follows, and how it goes on after a restart."""

from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from app.review.editing import paint as editing
from app.review.editing.paint import get_paint
from app.review.importing.ingest import ingest
from app.review.jobs import paint as paint_job
from app.review.jobs.jobs import Jobs
from app.review.jobs.paint import request_paint, resume_reading, take_paint_back
from app.review.policies.policy import change_policy
from app.soccer.group import Group, Media
from app.soccer.policy import TOUCHLINE
from app.store.log import read_log
from app.store.session import Store
from tests.unit.review.editing.test_positions import match
from tests.waiting import SECONDS


def without_files(groups: list[Group]) -> list[Group]:
    """Groups with pictures that an import once found and that are not there."""
    return [
        replace(
            group,
            views=tuple(replace(view, media=Media(f"/gone/{view.key}")) for view in group.views),
        )
        for group in groups
    ]


@pytest.fixture
def asked(store: Store) -> Store:
    """A match whose pictures are gone, and a policy that uses their paint."""
    ingest(store, "demo", without_files(match()), source="files", actor="ann")
    change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
    return store


def test_it_counts_solves_and_is_taken_back(asked: Store) -> None:
    jobs = Jobs(asked)
    done = jobs.wait(request_paint(jobs, asked, "demo", None, actor="ann").id, SECONDS)
    assert (done.state, done.result["views"], done.result["no_frame"]) == ("done", 12, 12)
    assert (done.result["read"], done.result["without_picture"]) == (12, 0)
    assert done.sentence == "6 of 6 groups looked at"
    (solve,) = jobs.find(kinds=["solve"])
    assert jobs.wait(solve.id, SECONDS).state == "done"
    back = jobs.wait(take_paint_back(jobs, asked, "demo", actor="ann").id, SECONDS)
    assert (back.kind, get_paint(asked, "demo").items[0].read) == ("solve", 0)
    jobs.close()


def test_a_server_that_stops_leaves_it_to_the_next_one(asked: Store, monkeypatch) -> None:
    started, whole = threading.Event(), paint_job.read_paint
    monkeypatch.setattr(editing, "_A_CHILD", 1)

    def stopping(*arguments, progress, **options):
        def told(done, total):
            started.set()
            while True:
                progress(done, total)

        return whole(*arguments, progress=told, **options)

    first = Jobs(asked)
    with monkeypatch.context() as patch:
        patch.setattr(paint_job, "read_paint", stopping)
        job = request_paint(first, asked, "demo", None, actor="ann")
        assert started.wait(SECONDS)
        first.close()
    second = Jobs(asked)
    resume_reading(second, asked)
    second.start()
    assert second.wait(job.id, SECONDS).state == "done"
    second.close()
    with asked.read() as session:
        runs = [entry.body["run"] for entry in read_log(session) if entry.kind == "paint"]
    assert (len(runs), len(set(runs))) == (6, 1)
