"""Exports made over REST: the job that writes one, whose id is the export's, and the folder that keeps them."""

from __future__ import annotations

import json
import re
import secrets
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

from app.db.database_worker import ServerProxy
from app.db.home import DAY, delete_path, find_last_write_time
from app.db.json_columns import Json
from app.db.session import now
from app.db.store import Store
from app.durable import PARTIAL, replace_file
from app.errors import InputError, NotFoundError
from app.features.datasets.service import get_dataset_head
from app.features.exports.service import ExportReport, export_dataset, require_exportable
from app.features.jobs.job_run import JobProgress, make_counts_reporter, run_job_in_worker
from app.features.jobs.queries import EXPORT, Job
from app.features.jobs.service import Jobs
from app.formats.export_formats import describe_missing_content
from app.formats.file_tree import Root
from app.formats.output import require_new_zip_in_store
from app.formats.safe_path import require_safe_path
from app.json_text import json_text
from app.media.frames import EncodedPicture, FrameProvider
from app.object_store.path import StoredPath, resolve_target_path
from app.object_store.store import SCHEME
from app.soccer.group import Media
from app.wording import plural

_ID = re.compile(r"[0-9a-f]{32}|[1-9][0-9]{0,18}")
"""Ids of jobs, and those of exports that were made before there were jobs."""


KIND = EXPORT


@dataclass(frozen=True)
class ExportEntry:
    """One finished export: what was asked for, and what came of it."""

    id: str
    request: dict[str, Any]
    created: str
    counts: dict[str, int]
    left_out: dict[str, int]
    missing_images: list[str]
    bytes: int
    stored: str | None = None
    """Where in an object store the zip lies, and what its content is called; None: here."""
    expired: bool = False
    """The zip was deleted because it was old; what it held is still known."""

    def find_expiry_time(self, days: int) -> datetime | None:
        """When the zip is deleted where zips are kept for so many days (0: for good); None: never,
        or it is gone."""
        if not days or self.expired or self.stored is not None:
            return None
        return datetime.fromisoformat(self.created) + timedelta(days=days)

    @property
    def incomplete(self) -> str | None:
        """What the files still lack before they can be used; None: nothing."""
        return describe_missing_content(self.request["format"], self.counts)


class ExportFolder:
    """Exports by id; ids and file names are ours, never the caller's."""

    def __init__(self, folder: Path):
        self.folder = folder

    @contextmanager
    def reserve_partial_path(self, name: str) -> Iterator[Path]:
        """A path beside the zip of an export, for this run to call its half written files after.

        What a server or a process that was killed at an export has left of it goes before, also
        under a server that is still at it: it is no longer theirs. After it goes what is this run's
        alone, for another server may have begun with it anew.
        """
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._delete_partial_files(f"{name}.zip")
        beside = self.folder / f"{name}.zip.{secrets.token_hex(4)}"
        try:
            yield beside
        finally:
            self._delete_partial_files(beside.name)

    def save_entry(
        self, name: str, request: Mapping[str, Any], report: ExportReport
    ) -> ExportEntry:
        """Record an export whose zip is written; only then it can be found.

        Args:
            name: Its id.
            request: What was asked for, plain JSON values.
            report: What came of it.
        """
        stored = None
        if isinstance(report.out, StoredPath):
            stored = report.out.make_object_path(report.out.store.head(report.out.key))
        entry = ExportEntry(
            id=name,
            request=dict(request),
            created=now(),
            counts=dict(report.counts),
            left_out=dict(report.left_out),
            missing_images=list(report.missing_images),
            bytes=self.get_zip_path(name).stat().st_size if stored is None else stored.size,
            stored=None if stored is None else stored.make_pinned_address(),
        )
        self._write_record(entry)
        return entry

    def find_entry(self, export_id: str) -> ExportEntry | None:
        """The finished export of that id, or None."""
        if not _ID.fullmatch(export_id) or not self._record_path(export_id).is_file():
            return None
        return ExportEntry(**json.loads(self._record_path(export_id).read_bytes()))

    def get_entry(self, export_id: str) -> ExportEntry:
        """The finished export of that id.

        Raises:
            NotFoundError: There is none.
        """
        entry = self.find_entry(export_id)
        if entry is None:
            raise NotFoundError("there is no such export")
        return entry

    def get_zip_path(self, name: str) -> Path:
        """Path of the zip of an export."""
        return self.folder / f"{name}.zip"

    def delete_export(self, name: str) -> None:
        """Delete an export, its record first: what is listed has a file.

        One that lies in an object store was delivered there, and stays.
        """
        if _ID.fullmatch(name):
            self._record_path(name).unlink(missing_ok=True)
            self.get_zip_path(name).unlink(missing_ok=True)

    def delete_expired_zips(self, days: int) -> int:
        """Delete zips that were finished so many days ago (0: none), and say how many.

        Their records stay, and say that they expired. What was delivered to an object store stays.
        """
        at, gone = datetime.now(UTC), 0
        for name in [path.stem for path in self.folder.glob("*.json")]:
            try:
                entry = self.find_entry(name)
            except (ValueError, TypeError):
                # A record that is none of ours says nothing of its age.
                entry = None
            if entry is None:
                continue
            expires = entry.find_expiry_time(days)
            if expires is not None and expires < at:
                # The record first: what is listed as ready has a file.
                entry = replace(entry, expired=True)
                self._write_record(entry)
                gone += 1
            if entry.expired:
                self.get_zip_path(name).unlink(missing_ok=True)
        return gone

    def delete_unfinished_zips(self) -> int:
        """Delete zips that never got their record, or lost it, and say how many: nothing lists them.

        One that was written within a day may get its record yet.
        """
        gone = 0
        for path in self.folder.glob("*.zip"):
            name, written = path.name.removesuffix(".zip"), find_last_write_time(path)
            known = not _ID.fullmatch(name) or self._record_path(name).exists()
            if not known and written is not None and written < time.time() - DAY:
                path.unlink(missing_ok=True)
                gone += 1
        return gone

    def _write_record(self, entry: ExportEntry) -> None:
        replace_file(self._record_path(entry.id), json_text(asdict(entry), ascii_=True).encode())

    def _delete_partial_files(self, name: str) -> None:
        for path in self.folder.glob(f".{name}.*{PARTIAL}"):
            delete_path(path)

    def _record_path(self, name: str) -> Path:
        return self.folder / f"{name}.json"


def request_export(
    jobs: Jobs,
    store: Store,
    folder: ExportFolder,
    frames: FrameProvider,
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
        require_new_zip_in_store(_parse_store_target(store, request["to"]))
    require_exportable(
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
        partial(run_export_job, store, folder, frames),
        dataset_id=found.id,
        actor=actor,
        request=named,
    )


def resume_exports(jobs: Jobs, store: Store, folder: ExportFolder, frames: FrameProvider) -> None:
    """Let exports that an earlier server was at be written from their beginning."""

    jobs.register_resume(KIND, partial(run_export_job, store, folder, frames))


def run_export_job(
    store: Store, folder: ExportFolder, frames: FrameProvider, progress: JobProgress
) -> Json:
    """The work itself; the zip appears whole or not at all, and its record after it."""
    request, name = progress.job.request, str(progress.job_id)
    to = request.get("to")
    progress(0, None, f"Writing {request['format']}.")
    content = folder.get_zip_path(name)
    with folder.reserve_partial_path(name) as beside:
        report = run_job_in_worker(
            store,
            "exports",
            "the export",
            _export_in_worker,
            progress.dataset_id,
            content if to is None else _parse_store_target(store, to),
            beside,
            request,
            dataset_id=progress.dataset_id,
            progress=progress,
            report=make_counts_reporter(progress, "groups written"),
            answer=lambda frame: frames.read(*frame),
        )
    # It is done, also where somebody cancels it now.
    progress.place = report.groups, report.groups, f"{plural(report.groups, 'group')} written"
    entry = folder.save_entry(name, request, report)
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
    caller: ServerProxy,
) -> ExportReport:
    """``export_dataset`` in a worker process, as it was requested.

    Frames are untrusted files: the caller has them made where they are made for requests.
    """

    def request_picture(media: Media, width: int | None, flipped: bool) -> EncodedPicture:
        picture: EncodedPicture = caller.ask((media, width, flipped))
        return picture

    version = request.get("version")
    return export_dataset(
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
        read=request_picture,
        beside=beside,
    )


def _parse_store_target(store: Store, address: str) -> StoredPath:
    """Where in a store an export goes.

    Raises:
        InputError: It is no address.
        NotFoundError: There is no such store.
    """
    try:
        require_safe_path(address.removeprefix(SCHEME))
        return resolve_target_path(store.settings, address)
    except (InputError, NotFoundError) as error:
        raise type(error)(error.message, hint=error.hint, pointer="/to") from error
