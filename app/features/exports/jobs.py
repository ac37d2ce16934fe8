"""The job that writes an export; its id is the export's."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from app.db.database_worker import Caller
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.datasets.service import get_dataset_head
from app.features.exports.folder import ExportFolder
from app.features.exports.service import ExportReport, export, require_possible
from app.features.jobs.queries import EXPORT, Job
from app.features.jobs.runner import JobProgress, counting_progress, run_job_in_worker
from app.features.jobs.service import Jobs
from app.formats.file_tree import Root
from app.formats.output import require_absent_in_store
from app.formats.safe_path import require_safe_path
from app.media.frames import Frames, SentPicture
from app.object_store.address import SCHEME
from app.object_store.path import StoredPath, target_path
from app.plural import plural
from app.soccer.group import Media

KIND = EXPORT


def request_export(
    jobs: Jobs,
    store: Store,
    folder: ExportFolder,
    frames: Frames,
    request: Mapping[str, Any],
    *,
    actor: str,
) -> Job:
    """Write an export, soon; what can be refused is refused at once.

    Args:
        jobs: Where it is queued.
        store: The database.
        folder: Where it is written.
        frames: Reads the frames that go into it.
        request: The fields of an export request, plain JSON values.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such dataset or version.
        InputError: There is nothing to export, or it cannot be written as it is asked for.
        OverloadedError: Too many jobs wait.
    """
    found = get_dataset_head(store, request["dataset"])
    version = request.get("version")
    if request.get("to") is not None:
        require_absent_in_store(_target_in_store(store, request["to"]))
    require_possible(
        store,
        found.id,
        request["format"],
        everything=request["all"],
        boxes=request["boxes"],
        images=request["images"],
        views=request.get("views", "valid"),
        version=None if version is None else str(version),
    )
    named = {**request, "dataset": found.name}
    return jobs.submit(
        KIND,
        f"Export {found.name} as {request['format']}",
        partial(export_work, store, folder, frames),
        dataset_id=found.id,
        actor=actor,
        request=named,
    )


def resume_exports(jobs: Jobs, store: Store, folder: ExportFolder, frames: Frames) -> None:
    """Let exports that an earlier server was at be written from their beginning."""

    jobs.register_resume(KIND, partial(export_work, store, folder, frames))


def export_work(store: Store, folder: ExportFolder, frames: Frames, progress: JobProgress) -> Json:
    """The work itself; the zip appears whole or not at all, and its record after it."""
    request, name = progress.job.request, str(progress.job_id)
    to = request.get("to")
    progress(0, None, f"Writing {request['format']}.")
    content = folder.content(name)
    with folder.writing(name) as beside:
        report = run_job_in_worker(
            store,
            "exports",
            "the export",
            _export_in_worker,
            progress.dataset_id,
            content if to is None else _target_in_store(store, to),
            beside,
            request,
            dataset_id=progress.dataset_id,
            progress=progress,
            report=counting_progress(progress, "groups written"),
            answer=lambda frame: frames.read(*frame),
        )
    # It is done, also where somebody cancels it now.
    progress.place = report.groups, report.groups, f"{plural(report.groups, 'group')} written"
    entry = folder.keep(name, request, report)
    return {
        "export": entry.id,
        "format": request["format"],
        "content": f"/api/v1/exports/{entry.id}/content",
        "bytes": entry.bytes,
        "counts": entry.counts,
        "left_out": entry.left_out,
        "missing_images": len(entry.missing_images),
    }


def _export_in_worker(
    store: Store,
    dataset_id: int,
    out: Root,
    beside: Path,
    request: Mapping[str, Any],
    caller: Caller,
) -> ExportReport:
    """``export`` in a worker process, as it was requested.

    Frames are untrusted files: the caller has them made where they are made for requests.
    """

    def read(media: Media, width: int | None, flipped: bool) -> SentPicture:
        picture: SentPicture = caller.ask((media, width, flipped))
        return picture

    version = request.get("version")
    return export(
        store,
        dataset_id,
        request["format"],
        out,
        everything=request["all"],
        boxes=request["boxes"],
        images=request["images"],
        # Earlier requests do not name the views.
        views=request.get("views", "valid"),
        version=None if version is None else str(version),
        progress=caller,
        read=read,
        beside=beside,
    )


def _target_in_store(store: Store, address: str) -> StoredPath:
    """Where in a store an export goes.

    Raises:
        InputError: It is no address.
        NotFoundError: There is no such store.
    """
    try:
        require_safe_path(address.removeprefix(SCHEME))
        return target_path(store.settings, address)
    except (InputError, NotFoundError) as error:
        raise type(error)(error.message, hint=error.hint, pointer="/to") from error
