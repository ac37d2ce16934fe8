"""Reading paint as a job: what it says, what follows, and how it goes on after a restart."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.log import read_log
from app.db.store import Store
from app.errors import StorageError
from app.features.imports.ingest import import_groups
from app.features.jobs.queries import NewJob, insert_job
from app.features.jobs.service import Jobs
from app.features.paint import jobs as paint_job
from app.features.paint import service as editing
from app.features.paint.jobs import PAINT
from app.features.paint.service import summarize_paint_readings
from app.features.policies.service import change_policy
from app.soccer.group import Group, Media
from app.soccer.policy import TOUCHLINE
from tests.unit.features.jobs.steps import Held, stopped_at_its_first_step
from tests.unit.features.match_estimates.test_positions import match
from tests.unit.features.pending import stored_by
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
    import_groups(store, "demo", without_files(match()), source="files", actor="ann")
    change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
    return store


def test_it_counts_solves_and_is_taken_back(asked: Store) -> None:
    jobs = Jobs(asked)
    done = jobs.wait(PAINT.request(jobs, asked, "demo", None, actor="ann").id, SECONDS)
    assert (done.state, done.result["views"], done.result["no_frame"]) == ("done", 12, 12)
    assert (done.result["read"], done.result["without_picture"]) == (12, 0)
    assert done.sentence == "The paint of 12 pictures was read."
    (solve,) = jobs.find(kinds=["solve"])
    assert jobs.wait(solve.id, SECONDS).state == "done"
    back = jobs.wait(PAINT.undo_last_job(jobs, asked, "demo", actor="ann").id, SECONDS)
    assert (back.kind, summarize_paint_readings(asked, "demo").items[0].read) == ("solve", 0)
    jobs.close()


def test_a_reading_that_is_taken_back_while_it_runs_gives_nothing_more(
    asked: Store, monkeypatch
) -> None:
    monkeypatch.setattr(editing, "_PER_WORKER", 1)
    jobs, looked = Jobs(asked), Held(editing._read_paint_of_pictures, calls=2)
    monkeypatch.setattr(editing, "_read_paint_of_pictures", looked)
    job = PAINT.request(jobs, asked, "demo", None, actor="ann")
    looked.wait()
    assert summarize_paint_readings(asked, "demo").items[0].read > 0
    PAINT.undo_last_job(jobs, asked, "demo", actor="ann")
    looked.go_on.set()
    assert jobs.wait(job.id, SECONDS).state == "cancelled"
    assert summarize_paint_readings(asked, "demo").items[0].read == 0
    jobs.close()


def test_one_that_is_stopped_before_it_gave_anything_takes_no_earlier_one_along(
    asked: Store, monkeypatch
) -> None:
    jobs = Jobs(asked)
    first = PAINT.request(jobs, asked, "demo", None, actor="ann")
    assert jobs.wait(first.id, SECONDS).state == "done"
    looked = Held(editing._read_paint_of_pictures, calls=1)
    monkeypatch.setattr(editing, "_read_paint_of_pictures", looked)
    job = PAINT.request(jobs, asked, "demo", None, actor="ann")
    looked.wait()
    PAINT.undo_last_job(jobs, asked, "demo", actor="ann")
    looked.go_on.set()
    assert jobs.wait(job.id, SECONDS).state == "cancelled"
    assert summarize_paint_readings(asked, "demo").items[0].read == 12
    jobs.close()


def test_one_that_runs_goes_on_where_the_take_back_is_not_kept(asked: Store, monkeypatch) -> None:
    def full(_session, _job):
        raise StorageError("the disk is full")

    jobs, looked = Jobs(asked), Held(editing._read_paint_of_pictures, calls=1)
    monkeypatch.setattr(editing, "_read_paint_of_pictures", looked)
    job = PAINT.request(jobs, asked, "demo", None, actor="ann")
    looked.wait()
    with pytest.raises(StorageError), stored_by(full):
        PAINT.undo_last_job(jobs, asked, "demo", actor="ann")
    looked.go_on.set()
    assert jobs.wait(job.id, SECONDS).state == "done"
    assert summarize_paint_readings(asked, "demo").items[0].read == 12
    jobs.close()


def test_a_record_that_nobody_works_on_keeps_nothing_from_being_taken_back(asked: Store) -> None:
    jobs = Jobs(asked)
    job = PAINT.request(jobs, asked, "demo", None, actor="ann")
    assert jobs.wait(job.id, SECONDS).state == "done"
    with asked.write() as session:
        insert_job(session, NewJob("paint", "Read", "ann", 1, {"match": None, "run": "lost"}))
    PAINT.undo_last_job(jobs, asked, "demo", actor="ann")
    assert summarize_paint_readings(asked, "demo").items[0].read == 0
    jobs.close()


def test_a_server_that_stops_leaves_it_to_the_next_one(asked: Store, monkeypatch) -> None:
    monkeypatch.setattr(editing, "_PER_WORKER", 1)
    first = Jobs(asked)
    with stopped_at_its_first_step(paint_job, "read_paint_of_pictures", first):
        job = PAINT.request(first, asked, "demo", None, actor="ann")
    second = Jobs(asked)
    PAINT.register_with_jobs(second, asked)
    second.start()
    assert second.wait(job.id, SECONDS).state == "done"
    second.close()
    with asked.read() as session:
        runs = [entry.body["run"] for entry in read_log(session) if entry.kind == "paint"]
    assert (len(runs), len(set(runs))) == (6, 1)
