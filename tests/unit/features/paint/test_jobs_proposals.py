"""Looking for proposals as a job: what it counts, and how it goes on after a restart."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.db.store import Store
from app.errors import NotFoundError
from app.features.imports.ingest import import_groups
from app.features.jobs.service import Jobs
from app.features.paint import jobs as proposals_job
from app.features.paint import proposals as editing
from app.features.paint.jobs import PROPOSALS, cancel_and_forget_proposals
from app.features.paint.proposals import get_proposal_counts
from app.soccer.group import Group, Media, Station, View
from tests.cameras import SIZE
from tests.unit.features.jobs.steps import Held, stopped_at_its_first_step
from tests.unit.features.paint.test_service import Here
from tests.waiting import SECONDS

VIEWS = 5


@pytest.fixture
def gone(store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Store:
    """Views without lines whose pictures are gone; no process looks for them."""
    monkeypatch.setattr(editing, "WorkerPool", Here)
    groups = [
        Group(f"{n}", (View("a", Station(f"{n}", SIZE), media=Media(str(tmp_path / f"{n}.png"))),))
        for n in range(VIEWS)
    ]
    import_groups(store, "demo", groups, source="files", actor="ann")
    return store


def test_it_counts_and_solves_nothing(gone: Store) -> None:
    jobs = Jobs(gone)
    done = jobs.wait(PROPOSALS.request(jobs, gone, "demo", None, actor="ann").id, SECONDS)
    assert done.state == "done"
    assert done.sentence.startswith(f"{VIEWS} views looked at: ")
    assert (done.result["views"], done.result["missing"], done.result["left"]) == (5, 5, 0)
    assert jobs.find(kinds=["solve"]) == []
    with pytest.raises(NotFoundError):
        PROPOSALS.request(jobs, gone, "demo", "final", actor="ann")
    jobs.close()


def test_a_job_is_asked_for_without_a_count_of_every_match(gone: Store, monkeypatch) -> None:
    def refuse(*_arguments):
        raise AssertionError("every match was counted")

    monkeypatch.setattr(editing, "count_proposals_by_match", refuse)
    jobs = Jobs(gone)
    job = PROPOSALS.request(jobs, gone, "demo", "", actor="ann")
    assert jobs.wait(job.id, SECONDS).result["views"] == VIEWS
    jobs.close()


def test_what_a_search_finds_after_all_is_forgotten_is_not_kept(gone: Store, monkeypatch) -> None:
    monkeypatch.setattr(editing, "_PER_WORKER", 2)
    jobs, looked = Jobs(gone), Held(editing._run_tasks, calls=2)
    monkeypatch.setattr(editing, "_run_tasks", looked)
    job = PROPOSALS.request(jobs, gone, "demo", None, actor="ann")
    waiting = PROPOSALS.request(jobs, gone, "demo", None, actor="ann")
    looked.wait()
    kept = get_proposal_counts(gone, "demo").sum_counts("looked")
    assert 0 < cancel_and_forget_proposals(jobs, gone, "demo") == kept < VIEWS
    looked.go_on.set()
    assert jobs.wait(job.id, SECONDS).state == jobs.get(waiting.id).state == "cancelled"
    assert get_proposal_counts(gone, "demo").sum_counts("looked") == 0
    jobs.close()


def test_a_server_that_stops_leaves_it_to_the_next_one(gone: Store, monkeypatch) -> None:
    monkeypatch.setattr(editing, "_PER_WORKER", 1)
    first = Jobs(gone)
    with stopped_at_its_first_step(proposals_job, "propose_cameras_for_views", first, workers=1):
        job = PROPOSALS.request(first, gone, "demo", None, actor="ann")
    assert get_proposal_counts(gone, "demo").sum_counts("looked") == 1
    second = Jobs(gone)
    PROPOSALS.register_with_jobs(second, gone)
    second.start()
    assert second.wait(job.id, SECONDS).state == "done"
    second.close()
    assert get_proposal_counts(gone, "demo").sum_counts("looked") == VIEWS
