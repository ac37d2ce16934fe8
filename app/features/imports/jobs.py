"""Imports as jobs: asked for, carried out beside the requests, taken up again after a restart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from app.config import Settings
from app.db.database_worker import SILENCE, run_in_worker
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import ConflictError, InputError, TooLargeError
from app.features.datasets.queries import find_dataset, has_more_groups, is_upload_in_use
from app.features.datasets.service import get_dataset_head, require_valid_name
from app.features.imports.sources import FORMATS, ImportSource, import_source
from app.features.imports.upload_queries import (
    find_complete_upload_path,
    get_upload,
    mark_upload_permanent,
)
from app.features.imports.uploads import resolve_folder
from app.features.jobs.job_run import FailedWithReportError, JobProgress, leave_work_to_next_server
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.match_estimates.jobs import RIG
from app.features.paint.jobs import PAINT, PROPOSALS
from app.features.paint.service import has_pictures_to_read_paint_from
from app.features.solve.jobs import request_solve_job
from app.formats.file_tree import Root
from app.progress import ReportProgress
from app.soccer.frames import ImageSize
from app.soccer.policy import POLICIES, Policy
from app.wording import plural
from app.worker_process import WorkerEnded, WorkerLimits

KIND = "import"
SHOWN = 500
RIG_FRAMES = 100
"""Groups of static cameras beyond which they can tell how they fit each other."""
"""Left-out records that a job's result names; all are counted."""
LIMITS_HINT = (
    "Import it in parts, or have the operator raise TOUCHLINE_IMPORT_MEMORY or "
    "TOUCHLINE_IMPORT_SECONDS. What was imported before the job ended stays, and is not imported twice."
)


@dataclass(frozen=True)
class ImportRequest:
    """What somebody wants imported.

    Attributes:
        source: ``{"upload": id}`` or ``{"folder": path}``.
        lines: The same for ISSIA's line files, or None.
        frames: The same for a list of frames, or None.
        options: ``calibration``, ``frame_offset``, ``flipped``, ``size`` ([width, height]),
            ``ball_category``, ``grouping``, ``propose``.
        policy: Name of a shipped one for a dataset that is made; None: as its pictures suggest.
    """

    dataset: str
    format: str
    source: Mapping[str, str]
    lines: Mapping[str, str] | None = None
    options: Mapping[str, Any] = field(default_factory=dict)
    dry_run: bool = False
    policy: str | None = None
    frames: Mapping[str, str] | None = None

    def to_job_json(self) -> dict[str, Json]:
        """As a job keeps it."""
        return {
            "dataset": self.dataset,
            "format": self.format,
            "source": dict(self.source),
            "lines": None if self.lines is None else dict(self.lines),
            "frames": None if self.frames is None else dict(self.frames),
            "options": dict(self.options),
            "dry_run": self.dry_run,
            "policy": self.policy,
        }


@dataclass(frozen=True)
class ImportOutcome:
    """The result of an import.

    Attributes:
        values: The report, as plain values.
        fresh: Whether there is something new to solve.
        nothing: Why nothing was read, with what to do about it; None where something was.
    """

    values: dict[str, Any]
    fresh: bool
    nothing: tuple[str, str] | None


def request_import(
    jobs: Jobs, store: Store, settings: Settings, request: ImportRequest, *, actor: str
) -> Job:
    """Import, soon; what can be refused is refused at once.

    Args:
        jobs: Carries it out.
        store: The database.
        settings: Where uploads lie, and which folders may be read.
        request: What to import.
        actor: Who imports.

    Raises:
        InputError: Format, name or path cannot be used.
        NotFoundError: There is no such upload or folder.
    """
    source = resolve_source(settings, request)
    with store.read() as session:
        row = find_dataset(session, request.dataset)
    if row is None:
        require_valid_name(request.dataset, "a dataset", pointer="/dataset")
    would = "Dry run of" if request.dry_run else "Import"
    return jobs.submit(
        KIND,
        f"{would} {source.name} ({request.format}) for {request.dataset}",
        partial(run_import_job, jobs, store, settings),
        dataset_id=None if row is None else int(row.id),
        actor=actor,
        request=request.to_job_json(),
    )


def resume_imports(jobs: Jobs, store: Store, settings: Settings) -> None:
    """Continue imports that an earlier server began; what is imported stays as it is."""

    jobs.register_resume(KIND, partial(run_import_job, jobs, store, settings))


def run_import_job(jobs: Jobs, store: Store, settings: Settings, progress: JobProgress) -> Json:
    """The work itself; its result is the report, also where it fails because it read nothing."""
    request, actor = ImportRequest(**progress.job.request), progress.job.actor
    source = resolve_source(settings, request)
    sentence = f"{'Reading' if request.dry_run else 'Importing'} {source.name}."
    progress(0, None, sentence)
    with _keep_upload_in_use(store, request), leave_work_to_next_server(progress):
        outcome = import_in_worker(
            store,
            request.dataset,
            source,
            actor=actor,
            dry_run=request.dry_run,
            progress=_make_group_progress(progress, sentence),
            stop=progress.check,
            policy=None if request.policy is None else POLICIES[request.policy],
        )
    with store.read() as session:
        found = find_dataset(session, request.dataset)
    if found is not None:
        jobs.set_dataset(progress.job_id, int(found.id))
    if outcome.nothing is not None:
        raise FailedWithReportError(*outcome.nothing, _make_import_result(outcome, request))
    # What an earlier server brought is not new here, and nothing may follow on it yet.
    if request.dry_run or not (outcome.fresh or progress.was_begun_before):
        return _make_import_result(outcome, request)
    return _make_import_result(
        outcome, request, **_request_following_jobs(jobs, store, request, actor)
    )


@contextmanager
def _keep_upload_in_use(store: Store, request: ImportRequest) -> Iterator[None]:
    """Let an upload stay while it is imported, and afterwards where a dataset reads frames from it."""
    upload, settings = request.source.get("upload"), store.settings
    if upload is None or request.dry_run:
        yield
        return
    # Frames are read where they are, so the file must stay from the first group on.
    marked = mark_upload_permanent(settings, upload)
    try:
        yield
    finally:
        with store.read() as session:
            used = is_upload_in_use(session, upload)
        # One that was kept before is another's to release, who may be at work with it.
        if used or marked:
            mark_upload_permanent(settings, upload, kept=used)


def import_in_worker(
    store: Store,
    dataset: str,
    source: ImportSource,
    *,
    actor: str,
    dry_run: bool,
    progress: ReportProgress,
    stop: Callable[[], None],
    policy: Policy | None = None,
) -> ImportOutcome:
    """``import_source`` in a worker process, within the limits of the settings.

    The process reads the files and writes the database in the short transactions of an import.

    Args:
        stop: Called every now and then; an error that it raises ends the import.

    Raises:
        DamagedError: The worker met damage; from then on this process refuses changes, too.
        TooLargeError: It went beyond the limits, or made the process crash.
    """
    limits = WorkerLimits(store.settings.import_memory, store.settings.import_seconds, SILENCE)
    given = import_in_this_process, dataset, source, actor, dry_run, policy
    try:
        return run_in_worker(store, "imports", *given, limits=limits, progress=progress, stop=stop)
    except WorkerEnded as error:
        raise TooLargeError(f"{source.label} {error}", hint=LIMITS_HINT) from error


def import_in_this_process(
    store: Store,
    dataset: str,
    source: ImportSource,
    actor: str,
    dry_run: bool,
    policy: Policy | None,
    progress: ReportProgress,
) -> ImportOutcome:
    """The import itself, in this process."""
    settings = store.settings
    with source.hide_places_in_errors():
        imported = import_source(
            store, dataset, source, settings, progress, actor=actor, dry_run=dry_run, policy=policy
        )
    result = imported.result
    nothing = None if imported.imported_anything else imported.explain_nothing_imported()
    return ImportOutcome(imported.to_report_values(), bool(result.new + result.changed), nothing)


def _request_following_jobs(
    jobs: Jobs, store: Store, request: ImportRequest, actor: str
) -> dict[str, int | None]:
    """Ids of the jobs that compute what is new.

    The clicks are solved first, for that takes seconds; reading the pictures is asked for next, and
    solves once more what it changes. For frames that nobody has annotated cameras are sought last.
    """
    found = get_dataset_head(store, request.dataset)
    solve, paint = request_solve_job(jobs, store, found.id, actor=actor), None
    if request.format == "frames":
        if not request.options.get("propose", True):
            return {"solve_job": solve.id}
        proposals = PROPOSALS.request(jobs, store, found.id, None, actor=actor, follows=True)
        return {"solve_job": solve.id, "proposals_job": proposals.id}
    if found.policy.calibration.source == "paint" and has_pictures_to_read_paint_from(
        store, found.id
    ):
        paint = PAINT.request(jobs, store, found.id, None, actor=actor, follows=True).id
    rig = None
    if request.format in ("issia", "issia-3d"):
        rig = _request_rig_adjustment(jobs, store, found.id, actor)
    return {"solve_job": solve.id, "paint_job": paint, "rig_job": rig}


def _request_rig_adjustment(jobs: Jobs, store: Store, dataset_id: int, actor: str) -> int | None:
    """Id of the job that proposes how the static cameras fit each other; None where few frames, or one
    camera, can tell nothing of it, and where they were adjusted already."""
    with store.read() as session:
        if not has_more_groups(session, dataset_id, RIG_FRAMES):
            return None
    try:
        job = RIG.request(
            jobs, store, dataset_id, actor=actor, follows=True, what=None, inputs=None
        )
        return job.id
    except (InputError, ConflictError):
        return None


def _make_group_progress(progress: JobProgress, sentence: str) -> ReportProgress:
    def report_step(done: int, _total: int | None = None, phase: str = "") -> None:
        more = f" {phase}" if phase else ""
        progress(done, None, f"{sentence}{more} {plural(done, 'group')} so far.")

    return report_step


def _make_import_result(
    outcome: ImportOutcome,
    request: ImportRequest,
    *,
    solve_job: int | None = None,
    paint_job: int | None = None,
    proposals_job: int | None = None,
    rig_job: int | None = None,
) -> Json:
    """The report; with the jobs that solve what is new, read its paint, propose its cameras, and adjust
    those that stand still, where there are any."""
    values = outcome.values
    hidden = max(len(values["skipped"]) - SHOWN, 0)
    return {
        **values,
        "dataset": request.dataset,
        "dry_run": request.dry_run,
        "solve_job": solve_job,
        "paint_job": paint_job,
        "proposals_job": proposals_job,
        "rig_job": rig_job,
        "skipped": values["skipped"][:SHOWN],
        "more_skipped": values["more_skipped"] + hidden,
    }


def resolve_source(settings: Settings, request: ImportRequest) -> ImportSource:
    """What a request means, under a name that tells nobody where it lies.

    Raises:
        InputError: Unknown format, unusable path, or an option that the format does not use.
        NotFoundError: There is no such upload or folder.
    """
    if request.format not in FORMATS:
        raise InputError(
            f'"{request.format}" cannot be imported; {", ".join(FORMATS)} can', pointer="/format"
        )
    path, name = _resolve_source_path(settings, request.source)
    lines, lines_name = _resolve_optional_path(settings, request.lines)
    frames, frames_name = _resolve_optional_path(settings, request.frames)
    options = dict(request.options)
    size = options.pop("size", None)
    offset = options.pop("frame_offset", 8)
    if isinstance(offset, dict):
        offset = {int(camera): number for camera, number in offset.items()}
    source = ImportSource(
        request.format,
        path,
        size=None if size is None else ImageSize(*size),
        lines=lines,
        frames=frames,
        calibration=options.get("calibration"),
        frame_offset=offset,
        flipped=frozenset(options.get("flipped", ())),
        name=name,
        ball_category=options.get("ball_category", ""),
        grouping=options.get("grouping", ""),
        propose=options.get("propose", True),
        lines_name=lines_name,
        frames_name=frames_name,
    )
    source.require_used_options(policy=request.policy is not None)
    return source


def _resolve_optional_path(
    settings: Settings, source: Mapping[str, str] | None
) -> tuple[Root | None, str]:
    return (None, "") if source is None else _resolve_source_path(settings, source)


def _resolve_source_path(settings: Settings, source: Mapping[str, str]) -> tuple[Root, str]:
    if "upload" in source:
        upload = get_upload(settings, source["upload"])
        return find_complete_upload_path(settings, upload.id), upload.name
    return resolve_folder(settings, source["folder"]), source["folder"].rstrip("/")
