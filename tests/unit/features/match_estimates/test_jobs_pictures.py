"""Pictures of matches as jobs: what is estimated of which match, and what a change leaves behind."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NoReturn

import pytest

from app.db.session import Session
from app.db.store import Store
from app.errors import NotFoundError
from app.features.groups.edit import SetPictureGeometry
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.match_estimates import jobs as pictures_job
from app.features.match_estimates.jobs import PICTURES
from app.features.match_estimates.pictures import read_picture_geometries, set_picture_geometries
from app.features.pitches.queries import list_groups_of_match
from app.features.solutions.service import list_stale_groups
from app.features.solve.jobs import change_and_return_solve_job
from app.progress import ReportProgress
from app.soccer.group import Group, Station, View
from app.soccer.picture import PictureGeometry
from tests.cameras import SIZE, looking
from tests.unit.features.pending import stored_by
from tests.unit.solving.conftest import BEND, click
from tests.waiting import SECONDS

WIDE, PLAIN = "wide", "plain"
DONE = {WIDE: PictureGeometry(1.06), PLAIN: PictureGeometry(1.0)}
FRAMES = 4


def frames(match: str) -> list[Group]:
    """Of a main camera that turns, its pictures 6 % too wide or as they were taken."""
    groups = []
    for number in range(FRAMES):
        camera = looking((1.0, 62.0, -16.0), (-30.0 + 20.0 * number, -4.0, 0.0), 1300.0, bend=BEND)
        lines = click(DONE[match].camera_of_annotated_picture(camera, SIZE), 0.7, number)
        view = View(f"{number}.png", Station(f"{match}/{number}", SIZE, lines=lines))
        groups.append(Group(f"{match}/{number}.png", (view,), match=match))
    return groups


@pytest.fixture
def two(store: Store) -> Store:
    """A match whose pictures are too wide, and one whose are not."""
    import_groups(store, "demo", [*frames(PLAIN), *frames(WIDE)], source="files", actor="ann")
    return store


@pytest.fixture
def jobs(two: Store) -> Iterator[Jobs]:
    runs = Jobs(two)
    yield runs
    runs.close()


def finished(jobs: Jobs, job: Job) -> Job:
    """The job once it is done."""
    done = jobs.wait(job.id, SECONDS)
    assert done.state == "done"
    return done


def aspects(store: Store) -> dict[str, float | None]:
    """What the pictures of each match are taken to be."""
    return {
        item.match: None if item.picture is None else item.picture.aspect
        for item in read_picture_geometries(store, "demo")
    }


def items(jobs: Jobs, store: Store, match: str | None) -> dict[str, Any]:
    """What an estimate says of each match."""
    job = PICTURES.request(jobs, store, "demo", match, actor="lea")
    return {item["match"]: item for item in finished(jobs, job).result["items"]}


def test_all_matches_are_looked_at_and_nothing_is_changed(jobs: Jobs, two: Store) -> None:
    asked = PICTURES.request(jobs, two, "demo", None, actor="lea")
    assert (asked.kind, asked.title, asked.actor, asked.request) == (
        "pictures",
        "Estimate the pictures of demo",
        "lea",
        {"match": None},
    )
    done = finished(jobs, asked)
    plain, wide = done.result["items"]
    assert (plain["match"], wide["match"]) == (PLAIN, WIDE)
    assert done.sentence == "2 matches estimated, 1 with a proposal."
    assert (plain["frames"], plain["proposed"]) == (FRAMES, None)
    assert plain["estimate"]["aspect"] == pytest.approx(1.0, abs=0.02)
    assert wide["estimate"]["aspect"] == pytest.approx(1.06, abs=0.02)
    assert wide["proposed"]["aspect"] == wide["estimate"]["aspect"]
    assert "% wide (sigma" in wide["sentence"]
    assert aspects(two) == {WIDE: None, PLAIN: None}


def test_one_match_is_looked_at_where_one_is_asked_for_in_a_process_of_its_own(two: Store) -> None:
    given: list[object] = []

    class Pool(ThreadPoolExecutor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Any:
            given.append(fn)
            return super().submit(fn, *args, **kwargs)

    jobs = Jobs(two, pool=lambda: Pool(1))
    assert [*items(jobs, two, WIDE)] == [WIDE]
    assert len(given) == 1
    jobs.close()


def say(jobs: Jobs, store: Store, wanted: dict[str, PictureGeometry | None]) -> Job:
    def change(session: Session) -> None:
        set_picture_geometries(session, "demo", wanted, actor="lea")

    return change_and_return_solve_job(jobs, store, "demo", change, actor="lea")


def test_a_picture_that_is_said_is_solved_and_no_longer_proposed(jobs: Jobs, two: Store) -> None:
    said = items(jobs, two, WIDE)[WIDE]["proposed"]
    picture = PictureGeometry(said["aspect"], tuple(said["shift"]), tuple(said["sigma"]))
    kept: list[Job] = []

    with stored_by(lambda _session, job: kept.append(job)):
        job = say(jobs, two, {WIDE: picture})
    assert (finished(jobs, job).kind, [one.id for one in kept]) == ("solve", [job.id])
    assert aspects(two) == {WIDE: picture.aspect, PLAIN: None}
    assert list_stale_groups(two, "demo") == []
    item = items(jobs, two, WIDE)[WIDE]
    assert item["proposed"] is None and item["estimate"]["aspect"] == picture.aspect


def test_a_match_that_is_not_there_asks_for_nothing(jobs: Jobs, two: Store) -> None:
    with pytest.raises(NotFoundError):
        PICTURES.request(jobs, two, "demo", "final", actor="lea")
    with pytest.raises(NotFoundError):
        say(jobs, two, {WIDE: DONE[WIDE], "final": None})
    assert jobs.find() == []
    assert aspects(two)[WIDE] is None


def test_a_server_that_stops_leaves_an_estimate_to_the_next_one(
    two: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = threading.Event()

    def endless(
        _store: Store, _dataset: int, _pool: object, told: ReportProgress, _only: object
    ) -> NoReturn:
        started.set()
        while True:
            told(0, 1)

    first = Jobs(two)
    with monkeypatch.context() as patch:
        patch.setattr(pictures_job, "estimate_picture_geometries", endless)
        job = PICTURES.request(first, two, "demo", WIDE, actor="lea")
        assert started.wait(SECONDS)
        first.close()
    second = Jobs(two)
    PICTURES.register_with_jobs(second, two)
    second.start()
    assert [item["match"] for item in finished(second, job).result["items"]] == [WIDE]
    second.close()


@pytest.mark.parametrize("most", [True, False])
def test_a_picture_that_only_some_frames_have_is_proposed_for_all(
    jobs: Jobs, two: Store, most: bool
) -> None:
    said = items(jobs, two, WIDE)[WIDE]["proposed"]
    picture = PictureGeometry(said["aspect"], tuple(said["shift"]), tuple(said["sigma"]))
    finished(jobs, say(jobs, two, {WIDE: picture}))
    with two.read() as session:
        ids = list_groups_of_match(session, 1, WIDE)
    for number in ids[: 1 if most else -1]:
        state = load_group_state(two, number)
        edit = SetPictureGeometry(state.group.views[0].key, None)
        submit_edit(two, number, edit, if_match=state.etag, actor="lea")
    assert items(jobs, two, WIDE)[WIDE]["proposed"] == said
