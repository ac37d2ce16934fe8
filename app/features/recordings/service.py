"""Recordings of a dataset: brought in, indexed once, cut into shots.

The file stays where it is and is known by its sha256. What is found when it is decoded once lies in
the home: the index under its sha256, facts and shots in the database.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, get_args

from app.canonical import canonical, digest_of
from app.config import Settings
from app.db.idempotency import without_response
from app.db.json_columns import parse
from app.db.session import Session
from app.db.store import Store
from app.durable import replace_file
from app.errors import ConflictError, ImageError, InputError, NotFoundError, StorageError
from app.features.audit.audit_events import add_audit_event
from app.features.datasets.queries import find_dataset
from app.features.datasets.service import insert_dataset, require_name
from app.features.groups.state import require_etag
from app.features.recordings.link_queries import delete_links
from app.features.recordings.match_clock import MatchClock, require_clocks
from app.features.recordings.queries import (
    RecordingRow,
    delete_recording,
    find_recording,
    insert_recording,
    list_rows,
    names_and_paths,
    taken_frames,
    update_recording,
)
from app.formats.csv_text import csv_line
from app.formats.frame_names import VIDEO_SUFFIXES
from app.geometry.arrays import FloatArray
from app.media.frames import refused_picture
from app.plural import plural
from app.progress import ReportProgress
from app.soccer.choices import ShotKind, ShotStart
from app.soccer.policy import TOUCHLINE
from app.video.index import RecordingIndex, index_from_bytes, index_to_bytes, read_index_seconds
from app.video.indexing import index_recording
from app.video.shots import shots_of_indexed
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits, WorkerProcess

LIMITS = WorkerLimits(memory=1536 * 2**20, processor=6 * 3600.0, silence=600.0)
"""For decoding a whole recording once."""
MAX_SHOTS = 20_000
Send = Callable[[tuple[int, int | None, str]], object]
"""Takes what is done, how much there is, and what is being done."""
KINDS: tuple[str, ...] = get_args(ShotKind)
STARTS: tuple[str, ...] = get_args(ShotStart)
Found = TypeVar("Found")
_Details = dict[str, str | int | None]
"""What an event of the log says of a recording."""
_UNSAFE = re.compile(r"[^\w .()-]+")


@dataclass(frozen=True)
class Shot:
    """A stretch of a recording without a cut.

    Attributes:
        first, last: Numbers of its frames, decoded ones from 0.
        kind: ``main``, ``replay``, ``closeup`` or ``other``.
        entered_by: How it begins: ``start``, ``cut``, ``dissolve``, ``wipe`` or ``fade``. The frames of
            a soft transition belong to neither shot.
        kept: Whether somebody wants to work on it; None: nobody said.
    """

    first: int
    last: int
    kind: ShotKind
    entered_by: ShotStart
    kept: bool | None = None


@dataclass(frozen=True)
class Recording:
    """A recording as it stands.

    Attributes:
        dataset: Name of its dataset.
        name: Unique in its dataset; groups that are taken from it have it as their match.
        indexed: Whether its frames are known; all that follows is null until then.
        frames: How many it has, as our decoder returns them.
        fps: Frames a second; of a variable rate the mean.
        seconds: How long it is.
        width, height: Of a frame as people see it, pixels.
        interlaced: Whether its frames show two fields; None where that cannot be told.
        damaged: How many pictures of the file cannot be decoded; they are left out, and have no number.
        shots: How many it has.
        groups: How many groups were taken from it.
        problem: Why its frames cannot be read now, in a sentence; None: they can.
        clocks: What the clock of the match shows in frames of it.
    """

    id: int
    dataset_id: int
    dataset: str
    name: str
    path: Path
    indexed: bool
    sha256: str | None
    bytes: int | None
    frames: int | None
    fps: float | None
    variable: bool | None
    seconds: float | None
    width: int | None
    height: int | None
    rotation: int | None
    interlaced: bool | None
    damaged: int | None
    shots: int
    groups: int
    problem: str | None
    actor: str
    created: str
    clocks: tuple[MatchClock, ...] = ()

    def require_readable(self) -> str:
        """The sha256 of the file.

        Raises:
            ConflictError: It is not indexed yet, is gone, or is another one by now.
        """
        if self.sha256 is None or self.problem is not None:
            raise ConflictError(
                self.problem or f'"{self.name}" is not indexed yet',
                hint="Index it again." if self.problem else "Wait for the job that does it.",
            )
        return self.sha256


@dataclass(frozen=True)
class RecordingShots:
    """The shots of a recording in their order; ``times`` are those of their first and last frames."""

    recording: Recording
    items: tuple[Shot, ...]
    times: tuple[tuple[float, float], ...]
    etag: str


def list_recordings(store: Store, dataset_id: int | None = None) -> list[Recording]:
    """The recordings of a dataset, or of all, the newest first."""
    with store.read() as session:
        return [_recording(row) for row in list_rows(session, dataset_id)]


def get_recording(store: Store, recording_id: int) -> Recording:
    """A recording by its id.

    Raises:
        NotFoundError: There is none.
    """
    with store.read() as session:
        return _recording(need_recording(session, recording_id))


def need_recording(session: Session, recording_id: int) -> RecordingRow:
    """The row of a recording; raises NotFoundError when there is none."""
    row = find_recording(session, recording_id)
    if row is None:
        raise NotFoundError(f"there is no recording {recording_id}")
    return row


def add_recording(store: Store, dataset: str, path: Path, *, actor: str) -> Recording:
    """A recording for a file, which is the same again where it was added before.

    Args:
        store: The database.
        dataset: Name of its dataset; where there is none it is made, and its cameras come from the
            paint of its pictures.
        path: The file, absolute.
        actor: Who adds it.

    Raises:
        InputError: The name of the dataset cannot be one.
    """
    with store.write() as session, without_response():
        row = find_dataset(session, dataset)
        if row is None:
            require_name(dataset, "a dataset", pointer="/dataset")
        number = insert_dataset(session, dataset, TOUCHLINE, actor) if row is None else int(row.id)
        known = names_and_paths(session, number)
        there = next((row.id for row in known if row.path == str(path)), None)
        if there is None:
            name = _free_name(path.stem, {row.name for row in known})
            there = insert_recording(session, number, name, str(path), actor=actor)
            add_audit_event(session, actor, "recording added", number, recording=there, name=name)
        return _recording(need_recording(session, there))


def remove_recording(store: Store, recording_id: int, *, actor: str) -> None:
    """Forget a recording; its file stays, and so do the groups that were taken from it.

    Raises:
        NotFoundError: There is none.
    """
    with store.write() as session:
        row = need_recording(session, recording_id)
        delete_recording(session, recording_id)
        what: _Details = {"recording": recording_id, "name": row.name}
        add_audit_event(session, actor, "recording removed", row.dataset_id, **what)
        session.respond(None)


def set_clocks(
    store: Store, recording_id: int, clocks: Sequence[MatchClock], *, actor: str
) -> Recording:
    """Replace the readings of the clock of the match; groups that are taken later tell its time.

    Raises:
        InputError: As ``require_clocks``.
        NotFoundError: There is no such recording.
    """
    with store.write() as session:
        row = need_recording(session, recording_id)
        found = require_clocks(clocks, parse(row.facts)["frames"] if row.facts else 0)
        text = canonical([asdict(clock) for clock in found]) if found else None
        if text != row.clocks:
            update_recording(session, recording_id, clocks=text)
            what: _Details = {"recording": recording_id, "name": row.name, "clocks": len(found)}
            add_audit_event(session, actor, "match clock set", row.dataset_id, **what)
        recording = _recording(need_recording(session, recording_id))
        session.respond(recording)
    return recording


def require_video(path: Path) -> Path:
    """A file whose name is that of a video; what it is, indexing says.

    Raises:
        InputError: It is a folder, or no file of such a name.
    """
    if path.suffix.lower() not in VIDEO_SUFFIXES or not path.is_file():
        raise InputError(
            f"{path.name} is no video ({', '.join(sorted(VIDEO_SUFFIXES))})",
            hint="Name the file of the recording itself; a zip has to be unpacked first.",
        )
    return path


def index_now(
    store: Store,
    recording_id: int,
    *,
    progress: ReportProgress,
    stop: Callable[[], None],
) -> Recording:
    """Decode a recording once in a worker process: its index, its facts, and its shots.

    Shots that people have changed stay, unless the file is another one than before.

    Args:
        store: The database.
        recording_id: Which.
        progress: Called with frames decoded, and about how many there are.
        stop: Called every now and then; an error that it raises ends the process.

    Raises:
        ImageError: It is no video that can be read, or a part of it is missing.
        NotFoundError: The file is not there.
    """
    with store.read() as session:
        row = need_recording(session, recording_id)
    path = Path(row.path)
    stamp = _stamp(path)
    if stamp is None:
        raise NotFoundError(f"{path.name} is not where it was imported from")
    facts, shots = in_worker(path, index_file, store.settings, progress=progress, stop=stop)
    if _stamp(path) != stamp:
        raise ImageError(f"{path.name} changed while it was read", hint="Import it again.")
    with store.write() as session:
        row = need_recording(session, recording_id)
        found = {"stamp": stamp, "sha256": facts["sha256"], "facts": canonical(facts)}
        if row.sha256 != facts["sha256"] or row.shots == "[]":
            found |= {"shots": canonical(shots), "revision": row.revision + 1}
        if row.sha256 != facts["sha256"] and (gone := delete_links(session, recording_id)):
            # Their frames are those of another film.
            what: _Details = {"recording": recording_id, "name": row.name, "links": gone}
            add_audit_event(session, row.actor, "links removed", row.dataset_id, **what)
        update_recording(session, recording_id, **found)
        return _recording(need_recording(session, recording_id))


def in_worker(
    path: Path,
    work: Callable[..., Found],
    *arguments: Any,
    progress: ReportProgress,
    stop: Callable[[], None],
    limits: WorkerLimits = LIMITS,
) -> Found:
    """The result of ``work(path, *arguments, send)`` in a worker process."""

    def answer(place: tuple[int, int | None, str]) -> None:
        done, total, sentence = place
        progress(done, total, *([sentence] if sentence else []))

    with closing(WorkerProcess(limits)) as worker, COUNTS["recordings"].working():
        try:
            found: Found = worker.run(work, path, *arguments, on_message=answer, stop=stop)
        except WorkerEnded as error:
            raise refused_picture(path.name, error) from error
    return found


def index_file(
    path: Path, settings: Settings, send: Send
) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """Facts and shots of a recording, whose index is written; in a worker process."""
    index = index_recording(path, settings, lambda done, total: send((done, total, "")))
    place = index_place(settings, index.facts.sha256)
    try:
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(place, index_to_bytes(index))
    except OSError as error:
        raise StorageError(f"the index of {path.name} cannot be kept ({error.strerror})") from error
    facts = {
        **asdict(index.facts),
        "frames": len(index),
        "fps": index.fps,
        "variable": index.is_variable,
        "seconds": index.end,
    }
    return facts, _found_shots(path, index, send)


def _found_shots(path: Path, index: RecordingIndex, send: Send) -> list[dict[str, Any]]:
    def tell(done: int, total: int | None = None, sentence: str = "") -> None:
        send((done, total, sentence))

    found = shots_of_indexed(path, index, tell).shots
    return [asdict(Shot(one.first, one.last, one.kind, one.entered_by)) for one in found]


def index_place(settings: Settings, sha256: str) -> Path:
    """Where the index of a recording lies."""
    return settings.recordings / f"{sha256}.npz"


def read_index(settings: Settings, sha256: str) -> RecordingIndex:
    """The index of a recording.

    Raises:
        ConflictError: It is gone, or of an older version.
    """
    return read_index_at(index_place(settings, sha256))


def read_index_at(place: Path) -> RecordingIndex:
    """The same by the place where it lies."""
    try:
        return index_from_bytes(place.read_bytes())
    except (OSError, InputError) as error:
        raise _no_index() from error


def _no_index() -> ConflictError:
    return ConflictError("the index of this recording cannot be read", hint="Index it again.")


def has_index(store: Store, recording: Recording) -> bool:
    """Whether the index of a recording fits its file, and this version can read it."""
    try:
        read_index_seconds(index_place(store.settings, recording.require_readable()))
    except (ConflictError, InputError, OSError):
        return False
    return True


def find_again(
    store: Store,
    recording_id: int,
    *,
    actor: str,
    progress: ReportProgress,
    stop: Callable[[], None],
) -> RecordingShots:
    """Find the shots of a recording anew, in place of those that it has.

    Raises:
        ConflictError: It cannot be read.
        StaleRevisionError: Somebody changed them meanwhile.
    """
    before = get_shots(store, recording_id)
    path, sha256 = before.recording.path, before.recording.require_readable()
    asked = (shots_of, store.settings, sha256)
    found = in_worker(path, *asked, progress=progress, stop=stop)
    shots = [Shot(**one) for one in found]
    return put_shots(store, recording_id, shots, before.etag, actor=actor)


def shots_of(path: Path, settings: Settings, sha256: str, send: Send) -> list[dict[str, Any]]:
    """Shots of a recording that is indexed; in a worker process."""
    return _found_shots(path, read_index(settings, sha256), send)


def get_shots(store: Store, recording_id: int) -> RecordingShots:
    """The shots of a recording.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        row = need_recording(session, recording_id)
    return _shots(store.settings, row)


def shots_csv(found: RecordingShots) -> str:
    """The shots of a recording as CSV, a row for each."""
    columns = ("first", "last", "start_s", "end_s", "kind", "entered_by", "kept")
    lines = [csv_line(("recording", "shot", *columns))]
    for number, (shot, times) in enumerate(zip(found.items, found.times, strict=True), 1):
        place = (found.recording.name, number, shot.first, shot.last, *times)
        lines.append(csv_line((*place, shot.kind, shot.entered_by, shot.kept)))
    return "".join(lines)


def put_shots(
    store: Store, recording_id: int, shots: Sequence[Shot], if_match: str | None, *, actor: str
) -> RecordingShots:
    """Replace the list of shots: split, merged, of other kinds, kept or dropped.

    Args:
        store: The database.
        recording_id: Which.
        shots: All of them, in their order.
        if_match: ETag of the list that the change builds on; None: whatever it is.
        actor: Who changes it.

    Raises:
        InputError: Shots overlap, are out of order, or are outside of the recording.
        StaleRevisionError: Somebody else was faster.
    """
    with store.write() as session:
        row = need_recording(session, recording_id)
        if if_match is not None:
            require_etag(_etag(row), if_match, f'the list of shots of "{row.name}"')
        frames = parse(row.facts)["frames"] if row.facts else 0
        _require_sound(shots, frames)
        text = canonical([asdict(shot) for shot in shots])
        if text != row.shots:
            update_recording(session, recording_id, shots=text, revision=row.revision + 1)
            what: _Details = {"recording": recording_id, "name": row.name, "shots": len(shots)}
            add_audit_event(session, actor, "shots changed", row.dataset_id, **what)
        found = _shots(store.settings, need_recording(session, recording_id))
        session.respond(found)
    return found


def _require_sound(shots: Sequence[Shot], frames: int) -> None:
    if len(shots) > MAX_SHOTS:
        raise InputError(f"a recording has at most {MAX_SHOTS:,} shots", pointer="/shots")
    before = -1
    for number, shot in enumerate(shots):
        if not before < shot.first <= shot.last < frames:
            raise InputError(
                f"shot {number + 1} has the frames {shot.first} to {shot.last}: shots follow each "
                f"other without overlap, in a recording of {plural(frames, 'frame')}",
                pointer=f"/shots/{number}",
            )
        before = shot.last


def groups_taken(store: Store, recording: Recording) -> dict[int, int]:
    """Ids of the groups that were taken from a recording, by the number of their frame."""
    with store.read() as session:
        rows = taken_frames(session, recording.dataset_id, recording.name)
    ids = {row.key: int(row.id) for row in rows}
    return {number: ids[key] for number, key in frames_of_keys(ids).items()}


def single_views(store: Store, recording: Recording) -> set[int]:
    """Numbers of the frames whose groups have no view but theirs."""
    with store.read() as session:
        rows = taken_frames(session, recording.dataset_id, recording.name)
    return set(frames_of_keys(row.key for row in rows if row.views == 1))


def frames_of_keys(keys: Iterable[str]) -> dict[int, str]:
    """Keys of groups that were taken from a recording, by the number of their frame."""
    found = {}
    for key in keys:
        number = key.rpartition("/")[2].removesuffix(".png")
        if number.isascii() and number.isdigit():
            found[int(number)] = key
    return found


def _shots(settings: Settings, row: RecordingRow) -> RecordingShots:
    recording = _recording(row)
    items = tuple(Shot(**shot) for shot in parse(row.shots))
    times: tuple[tuple[float, float], ...] = ()
    if items and recording.sha256 is not None:
        seconds = _seconds(index_place(settings, recording.sha256))
        ends = ((float(seconds[shot.first]), float(seconds[shot.last])) for shot in items)
        times = tuple(ends)
    return RecordingShots(recording, items, times, _etag(row))


@lru_cache(maxsize=4)
def _seconds(index: Path) -> FloatArray:
    """When each frame is shown, by the place of an index: that of a whole match takes a second to read."""
    try:
        return read_index_seconds(index)
    except (OSError, InputError) as error:
        raise _no_index() from error


def frame_seconds(settings: Settings, sha256: str) -> FloatArray:
    """When each frame of a recording is shown, seconds after the first one, shape (N,).

    Raises:
        ConflictError: Its index is gone, or of an older version.
    """
    return _seconds(index_place(settings, sha256))


def _etag(row: RecordingRow) -> str:
    return f'"{row.revision}-{digest_of(row.shots.encode())[:12]}"'


def _recording(row: RecordingRow) -> Recording:
    path = Path(row.path)
    facts: Mapping[str, Any] = {} if row.facts is None else parse(row.facts)
    names = ("bytes", "frames", "fps", "variable", "seconds")
    shape = ("width", "height", "rotation", "interlaced", "damaged")
    return Recording(
        id=int(row.id),
        dataset_id=int(row.dataset_id),
        dataset=row.dataset,
        name=row.name,
        path=path,
        indexed=row.facts is not None,
        sha256=row.sha256,
        **{name: facts.get(name) for name in (*names, *shape)},
        shots=len(parse(row.shots)),
        groups=int(row.groups),
        problem=None if row.stamp is None else _problem(path, row.stamp),
        actor=row.actor,
        created=row.created,
        clocks=tuple(MatchClock(**one) for one in parse(row.clocks or "[]")),
    )


def _problem(path: Path, stamp: str) -> str | None:
    present = _stamp(path)
    if present is None:
        return f"{path.name} is not where it was imported from"
    return None if present == stamp else f"{path.name} has changed since it was indexed"


def _stamp(path: Path) -> str | None:
    """Size and time of change of a file; None where there is none, or a link that may lead anywhere."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return (
        f"{status.st_size} {status.st_mtime_ns}"
        if path.is_file() and not path.is_symlink()
        else None
    )


def _free_name(stem: str, taken: set[str]) -> str:
    """A name for a recording that no other of its dataset has."""
    clean = _UNSAFE.sub("_", stem).strip(" .")[:100] or "recording"
    name, number = clean, 2
    while name in taken:
        name, number = f"{clean}-{number}", number + 1
    return name
