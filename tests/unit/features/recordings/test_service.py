"""Recordings in the database, without a server."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.db.log import read_log
from app.db.store import Store
from app.errors import ConflictError, ImageError, InputError, JobCancelled, NotFoundError
from app.features.datasets.queries import list_unused_frame_files, list_unused_uploads
from app.features.imports.upload_queries import (
    UploadWriter,
    find_complete_upload_path,
    mark_upload_permanent,
)
from app.features.jobs.service import Jobs
from app.features.recordings import index
from app.features.recordings import jobs as module
from app.features.recordings.ball_run_values import run_to_columns
from app.features.recordings.ball_runs import remove_ball_run
from app.features.recordings.index import index_recording_in_worker
from app.features.recordings.instants import make_groups_of_instants
from app.features.recordings.jobs import (
    InstantOptions,
    register_recording_jobs,
    request_groups_of_instants,
    request_index,
)
from app.features.recordings.links import add_link, list_links, remove_link
from app.features.recordings.match_clock import MatchClockReading, compute_match_time
from app.features.recordings.queries import insert_ball_run, update_recording
from app.features.recordings.service import (
    Recording,
    add_recording,
    clock_readings_to_column,
    find_group_ids_by_frame,
    get_recording,
    remove_recording,
    require_video_file,
    set_clock_readings,
)
from app.features.recordings.shots import Shot, get_shots, replace_shots
from app.tracking.ball_run import BallClick, BallRun, FollowedBall
from tests.unit.features.jobs.steps import stopped_at_its_first_step
from tests.videos import write_video
from tests.waiting import SECONDS


@pytest.fixture
def film(tmp_path: Path) -> Path:
    return write_video(tmp_path / "final.mp4", "mp4v", 60)


def indexed(store: Store, film: Path, actor: str = "ann") -> Recording:
    recording = add_recording(store, "cup", film, actor=actor)
    return index_recording_in_worker(
        store, recording.id, actor=actor, progress=lambda *_: None, stop=lambda: None
    )


class TestIndexNow:
    def test_shots_of_people_stay_unless_the_file_is_another(
        self, store: Store, film: Path
    ) -> None:
        recording = indexed(store, film)
        mine = [Shot(0, 9, "main", "start", True)]
        replace_shots(store, recording.id, mine, None, actor="ann")
        indexed(store, film)
        assert list(get_shots(store, recording.id).items) == mine
        write_video(film, "mp4v", 30)
        assert indexed(store, film).id == recording.id
        assert list(get_shots(store, recording.id).items) != mine

    def test_groups_of_a_removed_video_are_not_those_of_another_with_its_name(
        self, store: Store, film: Path
    ) -> None:
        def take(recording: Recording, *frames: int) -> int:
            return make_groups_of_instants(
                store, recording.id, frames, False, "ann", lambda *_: None
            ).new

        first, kept = indexed(store, film), film.read_bytes()
        assert take(first, 5, 6) == 2
        remove_recording(store, first.id, actor="ann")
        write_video(film, "mp4v", 30)
        second = indexed(store, film)
        assert (second.name, second.groups) == ("final-2", 0)
        assert find_group_ids_by_frame(store, second) == {}
        assert take(second, 5) == 1
        # The same video takes its groups up again, also where it lies elsewhere by now.
        again = film.with_name("other.mp4")
        again.write_bytes(kept)
        third = indexed(store, again)
        assert (third.name, sorted(find_group_ids_by_frame(store, third))) == ("final", [5, 6])

    def test_a_file_that_was_moved_is_added_from_where_it_lies_now(
        self, store: Store, film: Path, tmp_path: Path
    ) -> None:
        first = indexed(store, film)
        mine = [Shot(0, 9, "main", "start", True)]
        replace_shots(store, first.id, mine, None, actor="ann")
        make_groups_of_instants(store, first.id, [5], False, "ann", lambda *_: None)
        (tmp_path / "moved").mkdir()
        copied = tmp_path / "moved" / film.name
        copied.write_bytes(film.read_bytes())
        # Another recording, as long as the file of the first one is there.
        assert add_recording(store, "cup", copied, actor="ann").id != first.id
        remove_recording(store, first.id + 1, actor="ann")
        film.unlink()
        with pytest.raises(ConflictError) as refused:
            get_recording(store, first.id).require_readable()
        assert (refused.value.hint or "").startswith("Put the file back, or add it under the same")
        again = indexed(store, copied, actor="eve")
        assert (again.id, again.path, again.problem, again.groups) == (first.id, copied, None, 1)
        assert list(get_shots(store, first.id).items) == mine

    def test_groups_of_the_video_before_stay_when_a_file_is_replaced(
        self, store: Store, film: Path
    ) -> None:
        first = indexed(store, film)
        make_groups_of_instants(store, first.id, [5], False, "ann", lambda *_: None)
        write_video(film, "mp4v", 30)
        second = indexed(store, film, actor="eve")
        assert (second.id, second.name, second.groups) == (first.id, "final-2", 0)
        with store.read() as session:
            (event,) = [e for e in read_log(session) if e.body.get("did") == "recording renamed"]
        assert (event.body["before"], event.body["name"]) == ("final", "final-2")
        assert event.actor == "eve"

    def test_clock_readings_of_the_film_before_go_when_a_file_is_replaced(
        self, store: Store, film: Path
    ) -> None:
        first = indexed(store, film)
        clocks = [MatchClockReading(5, 1, 10.0), MatchClockReading(50, 1, 12.0)]
        set_clock_readings(store, first.id, clocks, actor="ann")
        assert indexed(store, film).clocks == tuple(clocks)
        write_video(film, "mp4v", 30)
        assert indexed(store, film, actor="eve").clocks == ()
        with store.read() as session:
            (event,) = [e for e in read_log(session) if e.body.get("did") == "match clocks removed"]
        assert (event.actor, event.body["clocks"], event.body["name"]) == ("eve", 2, "final")

    def test_a_clock_reading_beyond_the_frames_goes_with_the_same_file(
        self, store: Store, film: Path
    ) -> None:
        first, clock = indexed(store, film), MatchClockReading(5, 1, 10.0)
        set_clock_readings(store, first.id, [clock], actor="ann")
        both = clock_readings_to_column([clock, MatchClockReading(60, 1, 12.0)])
        with store.write() as session:
            update_recording(session, first.id, clocks=both)
        assert indexed(store, film).clocks == (clock,)

    def test_it_ends_when_its_job_is_cancelled_and_keeps_nothing(
        self, store: Store, film: Path
    ) -> None:
        def cancelled() -> None:
            raise JobCancelled

        recording = add_recording(store, "cup", film, actor="ann")
        with pytest.raises(JobCancelled):
            index_recording_in_worker(
                store, recording.id, actor="ann", progress=lambda *_: None, stop=cancelled
            )
        assert not get_recording(store, recording.id).indexed

    def test_a_file_that_changes_meanwhile_is_refused(
        self, store: Store, film: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        plain = index.run_in_worker

        def slowly(path: Path, *rest: Any, **more: Any) -> Any:
            found = plain(path, *rest, **more)
            path.touch()
            return found

        monkeypatch.setattr(index, "run_in_worker", slowly)
        with pytest.raises(ImageError, match="changed while it was read"):
            indexed(store, film)

    def test_a_part_of_a_file_is_said_to_be_one(self, store: Store, film: Path) -> None:
        film.write_bytes(film.read_bytes()[:-100])
        with pytest.raises(ImageError, match=r"final\.mp4"):
            indexed(store, film)
        recording = add_recording(store, "cup", film, actor="ann")
        assert not recording.indexed and recording.problem is not None
        with pytest.raises(ConflictError, match=r"final\.mp4 .*Copy the file again|final\.mp4"):
            recording.require_readable()
        film.unlink()
        with pytest.raises(NotFoundError, match="no longer in the place that it was imported from"):
            indexed(store, film)

    def test_a_link_is_not_followed(self, store: Store, film: Path, tmp_path: Path) -> None:
        (tmp_path / "link.mp4").symlink_to(film)
        with pytest.raises(NotFoundError):
            indexed(store, tmp_path / "link.mp4")


class TestComputeMatchTime:
    def test_a_reading_beyond_the_frames_is_left_out(self) -> None:
        seconds, beyond = np.arange(30) / 25, MatchClockReading(40, 2, 2700.0)
        assert compute_match_time([beyond], seconds, 20) is None
        clocks = [MatchClockReading(10, 1, 60.0), beyond]
        assert compute_match_time(clocks, seconds, 20) == (1, pytest.approx(60.4))


class TestIds:
    def test_those_of_what_was_removed_are_not_given_again(self, store: Store, film: Path) -> None:
        def link(recording: Recording) -> int:
            return add_link(store, (recording.id, 0, 9), (recording.id, 20, 29), actor="ann").id

        def run(recording: Recording) -> int:
            ball = FollowedBall(5, 10.0, 10.0, 9.0, 0.5, 0.9, "followed")
            followed = BallRun((BallClick(5, 10.0, 10.0),), (ball,), "limit", "limit")
            values = {"dataset_id": recording.dataset_id, "recording_id": recording.id}
            values |= {"sha256": recording.sha256, **run_to_columns(followed)}
            with store.write() as session:
                return insert_ball_run(session, "ann", **values)

        first = indexed(store, film)
        assert (first.id, link(first), run(first)) == (1, 1, 1)
        remove_link(store, first.id, 1, actor="ann")
        remove_ball_run(store, first.id, 1, actor="ann")
        assert (link(first), run(first)) == (2, 2)
        write_video(film, "mp4v", 30)
        first = indexed(store, film)
        assert list_links(store, first.id) == [] and link(first) == 3
        remove_recording(store, first.id, actor="ann")
        second = indexed(store, film)
        assert (second.id, link(second), run(second)) == (2, 4, 3)


class TestRequireVideo:
    @pytest.mark.parametrize("name", ["notes.txt", "films", "film.zip"])
    def test_what_is_no_file_of_a_video_is_refused(self, tmp_path: Path, name: str) -> None:
        (tmp_path / "films").mkdir()
        (tmp_path / "notes.txt").write_text("x")
        with pytest.raises(InputError, match="is not a video"):
            require_video_file(tmp_path / name)


class TestUnused:
    def test_what_no_recording_and_no_group_uses_is_named(self, store: Store, film: Path) -> None:
        recording = indexed(store, film)
        index = f"{recording.sha256}.npz"
        with store.read() as session:
            assert index not in list_unused_frame_files(session, store.settings)
        remove_recording(store, recording.id, actor="ann")
        with store.read() as session:
            assert index in list_unused_frame_files(session, store.settings)

    def test_the_upload_of_a_recording_is_read(self, store: Store, film: Path) -> None:
        writer = UploadWriter(store.settings, film.name)
        writer.write(film.read_bytes())
        upload = writer.finish()
        mark_upload_permanent(store.settings, upload.id)
        with store.read() as session:
            assert upload.id in list_unused_uploads(session, store.settings)
        add_recording(
            store, "cup", find_complete_upload_path(store.settings, upload.id), actor="ann"
        )
        with store.read() as session:
            assert upload.id not in list_unused_uploads(session, store.settings)


class TestJobs:
    def test_a_server_that_stops_leaves_them_to_the_next_one(
        self, store: Store, film: Path
    ) -> None:
        # So long that it tells how far it is.
        write_video(film, "mp4v", 120)
        recording = add_recording(store, "cup", film, actor="ann")
        first = Jobs(store)
        with stopped_at_its_first_step(module, "index_recording_in_worker", first):
            number = request_index(first, store, recording, actor="ann").id
        with closing(Jobs(store)) as second:
            register_recording_jobs(second, store)
            second.start()
            assert second.wait(number, SECONDS).state == "done"
            options = InstantOptions(propose=False)
            job = request_groups_of_instants(
                second, store, recording.id, [1, 2], options, actor="ann"
            )
            assert second.wait(job.id, SECONDS).result["new"] == 2
