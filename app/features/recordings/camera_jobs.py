"""Cameras of a stretch of a recording as a job: tracked, or turned by half."""

from __future__ import annotations

from functools import partial

from app.db.json_columns import Json
from app.db.store import Store
from app.features.jobs.job_run import JobProgress, leave_work_to_next_server
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.recordings.camera_tracking import (
    require_cameras_turnable,
    require_trackable_stretch,
    rotate_cameras_half_turn,
    track_stretch_in_worker,
)
from app.features.recordings.service import get_recording
from app.features.solve.jobs import request_solve_job
from app.wording import plural

KIND = "track"


def request_camera_tracking(
    jobs: Jobs, store: Store, recording_id: int, first: int, last: int, *, actor: str
) -> Job:
    """Track a stretch of a recording, soon.

    Args:
        jobs: Carries it out.
        store: The database.
        recording_id: Which recording.
        first, last: Numbers of its frames.
        actor: Who wants it.

    Raises:
        NotFoundError, ConflictError, InputError: As ``camera_tracking.require_trackable_stretch``.
    """
    recording = get_recording(store, recording_id)
    require_trackable_stretch(recording, first, last)
    return jobs.submit(
        KIND,
        f"Track the camera of frames {first} to {last} of {recording.name}",
        partial(run_camera_job, jobs, store),
        dataset_id=recording.dataset_id,
        actor=actor,
        request={"recording": recording_id, "first": first, "last": last},
    )


def request_camera_half_turn(
    jobs: Jobs, store: Store, recording_id: int, frame: int, turned: bool, *, actor: str
) -> Job:
    """Turn the cameras of a stretch by half a turn of the pitch, or back, soon.

    Args:
        jobs: Carries it out.
        store: The database.
        recording_id: Which recording.
        frame: Any frame of the stretch.
        turned: Whether they shall be turned against what the tracker gave.
        actor: Who wants it.

    Raises:
        NotFoundError, ConflictError: As ``camera_tracking.require_cameras_turnable``.
    """
    recording = get_recording(store, recording_id)
    found = require_cameras_turnable(store, recording_id, frame, turned)
    return jobs.submit(
        KIND,
        f"Turn the camera of frames {found.first} to {found.last} of {recording.name} to the other side",
        partial(run_camera_job, jobs, store),
        dataset_id=recording.dataset_id,
        actor=actor,
        request={
            "recording": recording_id,
            "first": found.first,
            "last": found.last,
            "turned": turned,
        },
    )


def run_camera_job(jobs: Jobs, store: Store, progress: JobProgress) -> Json:
    """The work itself; its result counts outcomes."""
    asked, actor = progress.job.request, progress.job.actor
    recording = get_recording(store, asked["recording"])
    first, last = asked["first"], asked["last"]

    def report_step(done: int, total: int | None = None, _: str = "") -> None:
        rest = "; what was lost is followed backwards" if done == total else ""
        progress(
            done,
            total,
            f"{done:,} of {plural(total or last - first + 1, 'frame')} of {recording.name} followed{rest}.",
        )

    with leave_work_to_next_server(progress):
        if "turned" in asked:
            found, given = rotate_cameras_half_turn(
                store, recording.id, first, asked["turned"], actor=actor
            )
        else:
            found, given = track_stretch_in_worker(
                store,
                recording.id,
                first,
                last,
                actor=actor,
                progress=report_step,
                stop=progress.check,
            )
    solve = request_solve_job(jobs, store, recording.dataset_id, actor=actor).id if given else None
    summary = found.summary
    counts = {name: getattr(summary, name) for name in ("frames", "tracked", "bridged", "lost")}
    return {
        **counts,
        "recording": recording.id,
        "name": recording.name,
        "first": first,
        "last": last,
        "turned": summary.turned,
        "groups": given,
        "solve_job": solve,
    }


def register_camera_jobs(jobs: Jobs, store: Store) -> None:
    """Let what an earlier server was at begin again."""
    jobs.register_resume(KIND, partial(run_camera_job, jobs, store))
