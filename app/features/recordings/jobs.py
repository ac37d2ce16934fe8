"""Recordings as jobs: indexed and cut into shots, and groups made of their instants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.database_worker import SILENCE, run_in_worker
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import JobCancelled, NotFoundError, TooLargeError
from app.features.imports.upload_queries import (
    find_complete_upload_path,
    get_upload,
    mark_upload_permanent,
)
from app.features.imports.uploads import resolve_folder
from app.features.jobs.job_run import JobProgress, leave_work_to_next_server
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.paint.jobs import PROPOSALS
from app.features.recordings.index import has_usable_index, index_recording_in_worker
from app.features.recordings.instants import make_groups_of_instants, validate_instant_frames
from app.features.recordings.service import (
    Recording,
    add_recording,
    find_group_ids_by_frame,
    get_recording,
    require_name_for_recordings,
    require_video_file,
)
from app.features.recordings.shots import detect_shots_again
from app.features.solve.jobs import request_solve_job
from app.progress import ReportProgress
from app.wording import plural
from app.worker_process import WorkerEnded, WorkerLimits

INDEX, INSTANTS = "recording", "instants"


def request_recording_import(
    jobs: Jobs,
    store: Store,
    settings: Settings,
    dataset: str,
    source: Mapping[str, str],
    *,
    actor: str,
) -> Job:
    """Bring a recording into a dataset, which is made where there is none of that name, and index it.

    Args:
        jobs: Carries it out.
        store: The database.
        settings: Where uploads lie, and which folders may be read.
        dataset: Name of the dataset.
        source: ``{"upload": id}`` or ``{"folder": path}`` of the file.
        actor: Who wants it.

    Raises:
        InputError: It is not a video file by its name, or the name of the dataset cannot be one.
        NotFoundError: There is no such upload or file.
    """
    path = _resolve_video_path(settings, source)
    require_name_for_recordings(store, dataset)
    if "upload" in source:
        # It is read where it is, so it stays; from before there is a recording that reads it.
        mark_upload_permanent(settings, source["upload"])
    recording = add_recording(store, dataset, path, actor=actor)
    return request_index(jobs, store, recording, actor=actor)


def _resolve_video_path(settings: Settings, source: Mapping[str, str]) -> Path:
    if "upload" in source:
        upload = get_upload(settings, source["upload"])
        return require_video_file(find_complete_upload_path(settings, upload.id).absolute())
    found = resolve_folder(settings, source["folder"])
    if not isinstance(found, Path):
        raise TooLargeError(
            "recordings cannot be read from an object store",
            hint="Copy it into a folder that the operator allows, or upload it.",
            pointer="/source/folder",
        )
    return require_video_file(found.absolute())


def request_index(
    jobs: Jobs, store: Store, recording: Recording, *, shots: bool = False, actor: str
) -> Job:
    """Index a recording, soon; ``shots``: where its index fits, its shots alone are found anew."""
    return jobs.submit(
        INDEX,
        f"Find the shots of {recording.name}" if shots else f"Index {recording.name}",
        partial(run_index_job, store),
        dataset_id=recording.dataset_id,
        actor=actor,
        request={"recording": recording.id, "shots": shots},
    )


def run_index_job(store: Store, progress: JobProgress) -> Json:
    """The work itself; its result is what was found.

    Raises:
        JobCancelled: The recording was removed meanwhile.
    """
    try:
        return _index_recording(store, progress)
    except NotFoundError as error:
        try:
            get_recording(store, progress.job.request["recording"])
        except NotFoundError:
            raise JobCancelled("The recording was removed.") from error
        raise


def _index_recording(store: Store, progress: JobProgress) -> Json:
    recording_id = progress.job.request["recording"]
    recording = get_recording(store, recording_id)
    name = recording.name
    progress(0, None, f"Reading {name}.")

    def report_frames_read(done: int, total: int | None = None, sentence: str = "") -> None:
        # Whoever removes it needs no index of it.
        get_recording(store, recording_id)
        progress(done, total, sentence or f"{plural(done, 'frame')} of {name} read.")

    actor = progress.job.actor
    with leave_work_to_next_server(progress):
        if progress.job.request["shots"] and has_usable_index(store, recording):
            detect_shots_again(
                store,
                recording_id,
                actor=actor,
                progress=report_frames_read,
                stop=progress.check,
            )
            found = get_recording(store, recording_id)
        else:
            found = index_recording_in_worker(
                store, recording_id, actor=actor, progress=report_frames_read, stop=progress.check
            )
    return {
        "recording": found.id,
        "name": found.name,
        "frames": found.frames,
        "shots": found.shots,
    }


@dataclass(frozen=True)
class InstantOptions:
    """How groups are made of instants.

    Attributes:
        propose: Whether cameras are proposed for the new groups afterwards.
        linked: Whether the frames of linked replays are further views.
        dry_run: Whether nothing is kept, and what would become of them is counted.
    """

    propose: bool = True
    linked: bool = False
    dry_run: bool = False


def request_groups_of_instants(
    jobs: Jobs,
    store: Store,
    recording_id: int,
    frames: Sequence[int],
    options: InstantOptions,
    *,
    actor: str,
) -> Job:
    """Make groups of instants, soon.

    Args:
        jobs: Carries it out.
        store: The database.
        recording_id: Which recording.
        frames: Numbers of its frames.
        options: How.
        actor: Who wants it.

    Raises:
        NotFoundError, ConflictError, InputError: As ``instants.validate_instant_frames``.
    """
    recording = get_recording(store, recording_id)
    numbers = validate_instant_frames(recording, frames)
    return jobs.submit(
        INSTANTS,
        f"{'Dry run: make' if options.dry_run else 'Make'} {plural(len(numbers), 'group')} of {recording.name}",
        partial(run_instants_job, jobs, store),
        dataset_id=recording.dataset_id,
        actor=actor,
        request={"recording": recording_id, "frames": numbers, **asdict(options)},
    )


def run_instants_job(jobs: Jobs, store: Store, progress: JobProgress) -> Json:
    """The work itself; its result counts groups, and names the first one and the jobs that follow."""
    asked, actor = progress.job.request, progress.job.actor
    recording = get_recording(store, asked["recording"])

    def report_instants_taken(done: int, total: int | None = None, _: str = "") -> None:
        progress(done, total, f"{plural(done, 'instant')} of {recording.name} taken.")

    with leave_work_to_next_server(progress):
        taken = make_groups_in_worker(
            store,
            recording,
            asked["frames"],
            linked=asked.get("linked", False),
            dry_run=asked.get("dry_run", False),
            actor=actor,
            progress=report_instants_taken,
            stop=progress.check,
        )
    solve = proposals = None
    dry_run = asked.get("dry_run", False)
    begun = progress.was_begun_before
    if (taken["new"] or taken["changed"] or begun) and not dry_run:
        solve = request_solve_job(jobs, store, recording.dataset_id, actor=actor).id
        views = taken["new"] + taken["changed"] + taken["linked_views"]
        if asked["propose"] and (taken["cameras"] < views or begun):
            number, match = recording.dataset_id, recording.name
            job = PROPOSALS.request(jobs, store, number, match, actor=actor, follows=True)
            proposals = job.id
    groups = find_group_ids_by_frame(store, recording)
    return {
        **taken,
        "dry_run": dry_run,
        "group": groups.get(asked["frames"][0]) if asked["frames"] else None,
        "solve_job": solve,
        "proposals_job": proposals,
    }


def make_groups_in_worker(
    store: Store,
    recording: Recording,
    frames: Sequence[int],
    *,
    linked: bool,
    actor: str,
    progress: ReportProgress,
    stop: Any,
    dry_run: bool = False,
) -> dict[str, Any]:
    """``instants.make_groups_of_instants`` in a worker process, within the limits of imports."""
    limits = WorkerLimits(store.settings.import_memory, store.settings.import_seconds, SILENCE)
    try:
        taken = run_in_worker(
            store,
            "recordings",
            partial(make_groups_of_instants, dry_run=dry_run),
            recording.id,
            frames,
            linked,
            actor,
            limits=limits,
            progress=progress,
            stop=stop,
        )
    except WorkerEnded as error:
        raise TooLargeError(f"{recording.name} {error}") from error
    return asdict(taken)


def register_recording_jobs(jobs: Jobs, store: Store) -> None:
    """Let what an earlier server was at go on; what is done stays as it is."""
    jobs.register_resume(INDEX, partial(run_index_job, store))
    jobs.register_resume(INSTANTS, partial(run_instants_job, jobs, store))
