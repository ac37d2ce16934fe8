"""Looking for proposals as a job: what it counts, and how it goes on after a restart."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from app.errors import NotFoundError
from app.review.editing import proposals as editing
from app.review.editing.proposals import get_proposals
from app.review.importing.ingest import ingest
from app.review.jobs import proposals as proposals_job
from app.review.jobs.jobs import Jobs
from app.review.jobs.proposals import request_proposals, resume_proposals
from app.soccer.group import Group, Media, Station, View
from app.store.session import Store
from tests.cameras import SIZE
from tests.unit.review.editing.test_paint import Here
from tests.waiting import SECONDS

VIEWS = 5


@pytest.fixture
def gone(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Views without lines whose pictures are gone; no process looks for them."""
    monkeypatch.setattr(editing, "ChildPool", Here)
    groups = [
        Group(f"{n}", (View("a", Station(f"{n}", SIZE), media=Media(str(tmp_path / f"{n}.png"))),))
        for n in range(VIEWS)
    ]
    ingest(store, "demo", groups, source="files", actor="ann")
    return store


def test_it_counts_and_solves_nothing(gone: Store) -> None:
    jobs = Jobs(gone)
    done = jobs.wait(request_proposals(jobs, gone, "demo", None, actor="ann").id, SECONDS)
    assert (done.state, done.sentence) == ("done", f"{VIEWS} of {VIEWS} views looked at")
    assert (done.result["views"], done.result["missing"], done.result["left"]) == (5, 5, 0)
    assert jobs.find(kinds=["solve"]) == []
    with pytest.raises(NotFoundError):
        request_proposals(jobs, gone, "demo", "final", actor="ann")
    jobs.close()


def test_a_server_that_stops_leaves_it_to_the_next_one(gone: Store, monkeypatch) -> None:
    started, whole = threading.Event(), proposals_job.propose_views
    monkeypatch.setattr(editing, "_A_CHILD", 1)

    def stopping(*arguments, progress, **options):
        def told(done, total):
            started.set()
            while True:
                progress(done, total)

        return whole(*arguments, progress=told, children=1, **options)

    first = Jobs(gone)
    with monkeypatch.context() as patch:
        patch.setattr(proposals_job, "propose_views", stopping)
        job = request_proposals(first, gone, "demo", None, actor="ann")
        assert started.wait(SECONDS)
        first.close()
    assert get_proposals(gone, "demo").count("looked") == 1
    second = Jobs(gone)
    resume_proposals(second, gone)
    second.start()
    assert second.wait(job.id, SECONDS).state == "done"
    second.close()
    assert get_proposals(gone, "demo").count("looked") == VIEWS
