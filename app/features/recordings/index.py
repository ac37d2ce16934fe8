"""The index of a recording: its file decoded once in a worker process, and what is kept of each frame."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from app.config import Settings
from app.db.store import Store
from app.durable import replace_file
from app.errors import (
    ConflictError,
    ImageError,
    InputError,
    NotFoundError,
    StorageError,
    TooLargeError,
)
from app.features.audit.service import add_audit_event
from app.features.recordings.queries import RecordingRow, delete_links, update_recording
from app.features.recordings.service import (
    PUT_BACK,
    Details,
    Recording,
    build_recording_from_row,
    choose_name_for_video,
    clock_readings_from_column,
    clock_readings_to_column,
    compute_file_stamp,
    differs_in_time_alone,
    find_video_file,
    get_recording,
    index_file_path,
    require_recording,
)
from app.geometry.arrays import FloatArray
from app.json_text import canonical_json_text
from app.media.frames import make_picture_error
from app.progress import ReportProgress
from app.video.index import RecordingIndex, index_from_bytes, index_to_bytes, read_index_seconds
from app.video.indexing import hash_file, index_recording
from app.video.shots import find_shots_of_indexed_recording
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits, WorkerProcess

LIMITS = WorkerLimits(memory=1536 * 2**20, processor=6 * 3600.0, silence=600.0)
"""For decoding a whole recording once."""
Send = Callable[[tuple[int, int | None, str]], object]
"""Takes what is done, how much there is, and what is being done."""
Found = TypeVar("Found")


def index_recording_in_worker(
    store: Store,
    recording_id: int,
    *,
    actor: str,
    progress: ReportProgress,
    stop: Callable[[], None],
) -> Recording:
    """Decode a recording once in a worker process: its index, its facts, and its shots.

    Shots that people have changed, links and readings of the match clock stay, unless the file is another one than before.

    Args:
        store: The database.
        recording_id: Which.
        actor: Who wants it, for the log.
        progress: Called with frames decoded, and about how many there are.
        stop: Called every now and then; an error that it raises ends the process.

    Raises:
        ImageError: It is not a video that can be read, or a part of it is missing.
        NotFoundError: The file is not there.
    """
    with store.read() as session:
        row = require_recording(session, recording_id)
    path = find_video_file(store.settings, row)
    stamp = compute_file_stamp(path)
    if stamp is None:
        raise NotFoundError(
            f"{path.name} is no longer in the place that it was imported from", hint=PUT_BACK
        )
    if _is_copy_with_another_time(store.settings, row, stamp, stop):
        with store.write() as session:
            update_recording(session, recording_id, stamp=stamp)
        return get_recording(store, recording_id)
    try:
        facts, shots = run_in_worker(
            path, index_recording_file, store.settings, progress=progress, stop=stop
        )
    except (ImageError, TooLargeError) as error:
        if row.sha256 is None:
            problem = f"{error.message}. {error.hint}" if error.hint else error.message
            with store.write() as session:
                text = canonical_json_text({"problem": problem})
                update_recording(session, recording_id, facts=text)
        raise
    if compute_file_stamp(path) != stamp:
        raise ImageError(f"{path.name} changed while it was read", hint="Import it again.")
    with store.write() as session:
        row = require_recording(session, recording_id)
        what: Details
        another = row.sha256 != facts["sha256"]
        found: dict[str, Any] = {"stamp": stamp, "sha256": facts["sha256"]}
        found["facts"] = canonical_json_text(facts)
        if another:
            name = choose_name_for_video(session, row, facts["sha256"])
            if name != row.name:
                found["name"] = name
                what = {"recording": recording_id, "name": name, "before": row.name}
                add_audit_event(session, actor, "recording renamed", row.dataset_id, **what)
        if another or row.shots == "[]":
            found |= {"shots": canonical_json_text(shots), "revision": row.revision + 1}
        if another and (gone := delete_links(session, recording_id)):
            # Their frames are those of another film.
            what = {"recording": recording_id, "name": row.name, "links": gone}
            add_audit_event(session, actor, "links removed", row.dataset_id, **what)
        clocks = clock_readings_from_column(row.clocks)
        kept = [one for one in clocks if not another and one.frame < facts["frames"]]
        if gone := len(clocks) - len(kept):
            found["clocks"] = clock_readings_to_column(kept)
            what = {"recording": recording_id, "name": row.name, "clocks": gone}
            add_audit_event(session, actor, "match clocks removed", row.dataset_id, **what)
        update_recording(session, recording_id, **found)
        return build_recording_from_row(require_recording(session, recording_id), store.settings)


def _is_copy_with_another_time(
    settings: Settings, row: RecordingRow, stamp: str, stop: Callable[[], None]
) -> bool:
    """Whether the file of an indexed recording is the same, byte for byte, and was written anew."""
    if row.sha256 is None or row.stamp is None or not differs_in_time_alone(row.stamp, stamp):
        return False
    try:
        read_index_seconds(index_file_path(settings, row.sha256))
    except (InputError, OSError):
        return False
    return hash_file(find_video_file(settings, row), stop)[0] == row.sha256


def run_in_worker(
    path: Path,
    work: Callable[..., Found],
    *arguments: Any,
    progress: ReportProgress,
    stop: Callable[[], None],
    limits: WorkerLimits = LIMITS,
) -> Found:
    """The result of ``work(path, *arguments, send)`` in a worker process."""

    def report_progress(place: tuple[int, int | None, str]) -> None:
        done, total, sentence = place
        progress(done, total, *([sentence] if sentence else []))

    with closing(WorkerProcess(limits)) as worker, COUNTS["recordings"].track_task():
        try:
            found: Found = worker.run(work, path, *arguments, on_message=report_progress, stop=stop)
        except WorkerEnded as error:
            raise make_picture_error(path.name, error) from error
    return found


def index_recording_file(
    path: Path, settings: Settings, send: Send
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Facts and shots of a recording, whose index is written; in a worker process."""
    index = index_recording(path, settings, lambda done, total: send((done, total, "")))
    place = index_file_path(settings, index.facts.sha256)
    try:
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(place, index_to_bytes(index))
    except OSError as error:
        raise StorageError(
            f"the index of {path.name} cannot be stored ({error.strerror})"
        ) from error
    facts = {
        **asdict(index.facts),
        "frames": len(index),
        "fps": index.fps,
        "variable": index.is_variable,
        "seconds": index.end,
    }
    return facts, _detect_shots(path, index, send)


def _detect_shots(path: Path, index: RecordingIndex, send: Send) -> list[dict[str, Any]]:
    def send_progress(done: int, total: int | None = None, sentence: str = "") -> None:
        send((done, total, sentence))

    found = find_shots_of_indexed_recording(path, index, send_progress).shots
    return [
        {
            "first": one.first,
            "last": one.last,
            "kind": one.kind,
            "entered_by": one.entered_by,
            "kept": None,
        }
        for one in found
    ]


def read_index(settings: Settings, sha256: str) -> RecordingIndex:
    """The index of a recording.

    Raises:
        ConflictError: It is gone, or of an older version.
    """
    return read_index_file(index_file_path(settings, sha256))


def read_index_file(place: Path) -> RecordingIndex:
    """The same by the place where it lies."""
    try:
        return index_from_bytes(place.read_bytes())
    except (OSError, InputError) as error:
        raise _missing_index_error() from error


def _missing_index_error() -> ConflictError:
    return ConflictError("the index of this recording cannot be read", hint="Index it again.")


def has_usable_index(store: Store, recording: Recording) -> bool:
    """Whether the index of a recording fits its file, and this version can read it."""
    try:
        read_index_seconds(index_file_path(store.settings, recording.require_readable()))
    except (ConflictError, InputError, OSError):
        return False
    return True


def detect_shots_in_file(
    path: Path, settings: Settings, sha256: str, send: Send
) -> list[dict[str, Any]]:
    """Shots of a recording that is indexed; in a worker process."""
    return _detect_shots(path, read_index(settings, sha256), send)


@lru_cache(maxsize=4)
def _read_frame_times(index: Path) -> FloatArray:
    """When each frame is shown, by the place of an index: that of a whole match takes a second to read."""
    try:
        return read_index_seconds(index)
    except (OSError, InputError) as error:
        raise _missing_index_error() from error


def read_frame_times(settings: Settings, sha256: str) -> FloatArray:
    """When each frame of a recording is shown, seconds after the first one, shape (N,).

    Raises:
        ConflictError: Its index is gone, or of an older version.
    """
    return _read_frame_times(index_file_path(settings, sha256))
