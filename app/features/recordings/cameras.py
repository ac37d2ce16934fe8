"""Cameras over time: a camera for each frame of a stretch of a recording, as the tracker finds them.

A row counts them and one file holds them. People mend them by annotating a frame: the lines of every group
that was taken from the stretch are known to the tracker, and groups get their cameras from it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.canonical import canonical, digest_of
from app.config import Settings
from app.db.json_columns import parse
from app.db.session import Session
from app.db.store import Store
from app.durable import replace_file
from app.errors import ConflictError, InputError, NotFoundError, StorageError
from app.features.audit.audit_events import add_audit_event
from app.features.datasets.service import get_dataset_head
from app.features.file_tools.track import count_outcomes
from app.features.groups.queries import StoredGroup, read_groups
from app.features.imports.cameras import GivenCamera, NamedStation, attach_cameras
from app.features.imports.ingest import IngestReport
from app.features.pitches.queries import edited_pitches
from app.features.recordings.camera_queries import (
    delete_overlapping,
    digests_of,
    insert_cameras,
    list_cameras_rows,
    views_of_video,
)
from app.features.recordings.service import (
    Recording,
    get_recording,
    in_worker,
    need_recording,
    read_index,
)
from app.progress import ReportProgress
from app.soccer.annotation import Lines
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.calibrate import calibrate
from app.tracking.camera_file import frames_from_bytes, frames_to_bytes
from app.tracking.clip import Clip
from app.tracking.track import FrameCamera, track_clip
from app.worker_process import WorkerLimits

LIMITS = WorkerLimits(memory=3 * 2**30, processor=6 * 3600.0, silence=600.0)
"""For tracking a stretch."""
MOST_FRAMES = 15_000
"""Of one stretch: ten minutes of 25 frames a second, of which no shot has as many."""
SOURCE = "track"
"""Where given cameras come from, for the log and for the metadata of views."""
_BATCH = 100


@dataclass(frozen=True)
class CameraSummary:
    """What became of the frames of a stretch.

    Attributes:
        frames: How many it has.
        tracked: Whose camera lies on the paint.
        bridged: Whose camera is carried by the background.
        lost: Without a camera.
        worst_frame: The one whose paint lies farthest from its markings; None where none is tracked.
        worst_px: How far, median of the frame, pixels of the video.
        annotated: Frames whose lines were known.
        unusable: Frames that have lines, too few of them to make a camera.
    """

    frames: int
    tracked: int
    bridged: int
    lost: int
    worst_frame: int | None
    worst_px: float | None
    annotated: tuple[int, ...]
    unusable: tuple[int, ...]


@dataclass(frozen=True)
class ShotCameras:
    """Cameras of a stretch of a recording.

    Attributes:
        first, last: Its frames.
        before: What the cameras were that these took the place of; None: there were none.
        stale: Whether the video is another one by now.
        drawn: Frames that have lines now, which the next run knows.
        digest: Of the file that holds them.
    """

    id: int
    recording: int
    first: int
    last: int
    summary: CameraSummary
    before: CameraSummary | None
    revision: int
    stale: bool
    drawn: tuple[int, ...]
    digest: str
    digest_before: str | None
    actor: str
    created: str


@dataclass(frozen=True)
class Tracked:
    """What the process that tracks returns: a camera of each frame, and which lines were of no use."""

    frames: list[FrameCamera]
    unusable: tuple[int, ...]


def list_cameras(store: Store, recording_id: int) -> list[ShotCameras]:
    """The stretches of a recording that have cameras, in their order.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        recording = need_recording(session, recording_id)
        rows = list_cameras_rows(session, recording_id)
        sha256 = recording.sha256
        views = views_of_video(session, recording.dataset_id, sha256) if rows and sha256 else []
    drawn = sorted({view.number for view in views if view.has_lines})
    return [_of_row(row, sha256, drawn) for row in rows]


def get_cameras(store: Store, recording_id: int, frame: int) -> ShotCameras:
    """The cameras of the stretch that has a frame.

    Raises:
        NotFoundError: There are none.
    """
    for found in list_cameras(store, recording_id):
        if found.first <= frame <= found.last:
            return found
    raise NotFoundError(f"recording {recording_id} has no cameras at frame {frame}")


def pitch_of(store: Store, recording_id: int) -> Pitch:
    """The pitch of the match that a recording is of: as a person gave it, or as the Laws plan it."""
    with store.read() as session:
        row = need_recording(session, recording_id)
        return edited_pitches(session, row.dataset_id, [row.name]).get(row.name) or Pitch()


def read_cameras(settings: Settings, digest: str) -> list[FrameCamera]:
    """The cameras of a file.

    Raises:
        ConflictError: It is gone, or damaged.
    """
    try:
        return frames_from_bytes(camera_place(settings, digest).read_bytes())
    except (OSError, InputError) as error:
        raise ConflictError(
            "the cameras of this shot cannot be read", hint="Track the shot again."
        ) from error


def camera_place(settings: Settings, digest: str) -> Path:
    """Where cameras of a digest lie."""
    return settings.recordings / f"{digest}.cameras.npz"


def require_stretch(recording: Recording, first: int, last: int) -> None:
    """Require that a stretch can be tracked.

    Raises:
        ConflictError: The recording cannot be read.
        InputError: It is outside of the recording, or too long.
    """
    recording.require_readable()
    if not first <= last < (recording.frames or 0):
        raise InputError(
            f'the frames {first} to {last} are none of "{recording.name}"; its last one is '
            f"{(recording.frames or 0) - 1}",
            pointer="/last",
        )
    if last - first >= MOST_FRAMES:
        raise InputError(
            f"{last - first + 1:,} frames are too many; {MOST_FRAMES:,} can be tracked at once",
            hint="Split the shot, and track its parts.",
            pointer="/last",
        )


def track_now(
    store: Store,
    recording_id: int,
    first: int,
    last: int,
    *,
    actor: str,
    progress: ReportProgress,
    stop: Callable[[], None],
) -> tuple[ShotCameras, int]:
    """Track a stretch of a recording in a worker process, and keep its cameras.

    They take the place of those that the same frames had; other frames of the stretches that these are of
    keep theirs. Groups that were taken from the stretch get them
    as given cameras, where nobody has given them another one and no lines say otherwise.

    Args:
        store: The database.
        recording_id: Which recording.
        first, last: Numbers of its frames.
        actor: Who wants it.
        progress: Called with frames done and in all.
        stop: Called every now and then; an error that it raises ends the process.

    Returns:
        The cameras, and how many groups were given another one.

    Raises:
        ConflictError: The recording cannot be read, or it became another one meanwhile.
        InputError: As ``require_stretch``.
    """
    recording = get_recording(store, recording_id)
    require_stretch(recording, first, last)
    sha256 = recording.require_readable()
    policy = get_dataset_head(store, recording.dataset_id).policy.calibration
    lines: dict[int, Lines] = {}
    with store.read() as session:
        drawn = _views_of(session, recording, first, last, with_lines=True)
        pitch = edited_pitches(session, recording.dataset_id, [recording.name])
    for number, stored, key in drawn:
        station = stored.stations[key].station
        if not (station.flipped or station.picture):
            lines.setdefault(number, station.lines)
    known = (store.settings, sha256, first, last, lines, pitch.get(recording.name), policy)
    tracked: Tracked = in_worker(
        recording.path, track_stretch, *known, progress=progress, stop=stop, limits=LIMITS
    )
    return save_cameras(store, recording, (first, last), tracked, sorted(lines), actor)


def track_stretch(
    path: Path,
    settings: Settings,
    sha256: str,
    first: int,
    last: int,
    lines: Mapping[int, Lines],
    pitch: Pitch | None,
    policy: CalibrationPolicy,
    send: Callable[[tuple[int, int | None, str]], object],
) -> Tracked:
    """The work of the process: decode, calibrate and follow."""
    clip = Clip.open(path, read_index(settings, sha256), first, last)

    def makes_camera(drawn: Lines) -> bool:
        return calibrate(drawn, pitch or Pitch(), clip.size, CLICKED).camera is not None

    def tell(done: int) -> None:
        send((done, total, ""))

    usable = {number: drawn for number, drawn in lines.items() if makes_camera(drawn)}
    total = last - first + 1
    found = track_clip(clip, usable, pitch, policy, tell)
    return Tracked(found.frames, tuple(sorted(set(lines) - set(usable))))


def save_cameras(
    store: Store,
    recording: Recording,
    stretch: tuple[int, int],
    tracked: Tracked,
    annotated: Sequence[int],
    actor: str,
) -> tuple[ShotCameras, int]:
    """Keep what was found of a stretch (first and last frame): ``track_now`` without the tracking."""
    first, last = stretch
    made = _keep(store.settings, recording, tracked, annotated)
    rests = [
        (rest, _keep(store.settings, recording, rest, one.summary.annotated))
        for one in list_cameras(store, recording.id)
        for rest in _outside(store.settings, one, first, last)
    ]
    tracked_before = cameras_at(store, recording, range(first, last + 1))
    common = {
        "dataset_id": recording.dataset_id,
        "recording_id": recording.id,
        "sha256": recording.sha256,
    }
    with store.write() as session:
        row = need_recording(session, recording.id)
        if row.sha256 != recording.sha256:
            raise ConflictError(
                f'"{recording.name}" became another file while it was tracked',
                hint="Track the shot again.",
            )
        replaced = delete_overlapping(session, recording.id, first, last)
        same = next((old for old in replaced if (old.first, old.last) == stretch), None)
        insert_cameras(
            session,
            **common,
            **made,
            before=same and same.digest,
            before_summary=same and same.summary,
            revision=1 + max((old.revision for old in replaced), default=0),
            actor=actor,
        )
        for old in replaced:
            for rest, values in rests:
                if old.first <= rest.frames[0].number <= old.last:
                    insert_cameras(
                        session, **common, **values, revision=old.revision, actor=old.actor
                    )
        views = _views_of(session, recording, first, last)
        changed = _give(session, recording, tracked.frames, views, tracked_before, actor)
        add_audit_event(
            session,
            actor,
            "cameras tracked",
            recording.dataset_id,
            recording=recording.id,
            name=recording.name,
            frames=f"{first} to {last}",
        )
        used = digests_of(session)
    for old in replaced:
        for name in {old.digest, old.before} - used - {None}:
            # What stays is reported by doctor.
            with suppress(OSError):
                camera_place(store.settings, name).unlink(missing_ok=True)
    return get_cameras(store, recording.id, first), changed


def _keep(
    settings: Settings, recording: Recording, tracked: Tracked, annotated: Sequence[int]
) -> dict[str, Any]:
    """Write the file of some cameras; returns what their row says of them."""
    content = frames_to_bytes(tracked.frames)
    digest = digest_of(content)
    try:
        settings.recordings.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(camera_place(settings, digest), content)
    except OSError as error:
        raise StorageError(
            f"the cameras of {recording.name} cannot be kept ({error.strerror})",
            hint="Free some space, and track the shot again.",
        ) from error
    numbers = [frame.number for frame in tracked.frames]
    inside = tuple(number for number in annotated if numbers[0] <= number <= numbers[-1])
    summary = _summary(tracked, inside)
    return {
        "first": numbers[0],
        "last": numbers[-1],
        "digest": digest,
        "summary": canonical(vars(summary)),
    }


def _outside(settings: Settings, old: ShotCameras, first: int, last: int) -> list[Tracked]:
    """The parts of cameras before and behind a stretch that overlaps them; those of another video, or
    that cannot be read, are none."""
    if old.last < first or last < old.first or old.stale:
        return []
    try:
        frames = read_cameras(settings, old.digest)
    except ConflictError:
        return []
    parts = (
        [frame for frame in frames if frame.number < first],
        [frame for frame in frames if frame.number > last],
    )
    return [
        Tracked(
            part,
            tuple(one for one in old.summary.unusable if part[0].number <= one <= part[-1].number),
        )
        for part in parts
        if part
    ]


def _summary(tracked: Tracked, annotated: Sequence[int]) -> CameraSummary:
    counts = count_outcomes([{"outcome": frame.outcome} for frame in tracked.frames])
    measured = [frame for frame in tracked.frames if frame.error_px is not None]
    worst = max(measured, key=lambda frame: frame.error_px or 0.0, default=None)
    return CameraSummary(
        **counts,
        worst_frame=None if worst is None else worst.number,
        worst_px=None if worst is None else worst.error_px,
        annotated=tuple(annotated),
        unusable=tracked.unusable,
    )


def _of_row(row: Any, sha256: str | None, drawn: Sequence[int]) -> ShotCameras:
    return ShotCameras(
        id=int(row.id),
        recording=int(row.recording_id),
        first=row.first,
        last=row.last,
        summary=CameraSummary(**parse(row.summary)),
        before=None if row.before_summary is None else CameraSummary(**parse(row.before_summary)),
        revision=row.revision,
        stale=row.sha256 != sha256,
        drawn=tuple(frame for frame in drawn if row.first <= frame <= row.last),
        digest=row.digest,
        digest_before=row.before,
        actor=row.actor,
        created=row.created,
    )


def _views_of(
    session: Session, recording: Recording, first: int, last: int, *, with_lines: bool = False
) -> list[tuple[int, StoredGroup, str]]:
    """The views that show a frame of a stretch, with its number, their group and their key."""
    shown = views_of_video(session, recording.dataset_id, recording.require_readable())
    wanted = [one for one in shown if first <= one.number <= last]
    wanted = [one for one in wanted if one.has_lines or not with_lines]
    ids, groups = sorted({one.group for one in wanted}), dict[int, StoredGroup]()
    for start in range(0, len(ids), _BATCH):
        groups |= read_groups(session, ids[start : start + _BATCH])
    return [(one.number, groups[one.group], one.key) for one in wanted if one.group in groups]


def _give(
    session: Session,
    recording: Recording,
    frames: Sequence[FrameCamera],
    views: Sequence[tuple[int, StoredGroup, str]],
    before: Mapping[int, FrameCamera],
    actor: str,
) -> int:
    """Give views the cameras of their frames, unless somebody gave or drew another; returns how many have another one now."""
    found, batch = {frame.number: frame for frame in frames}, []
    for number, stored, key in views:
        kept, frame = stored.stations[key], found[number]
        station = kept.station
        by_track = station.given is not None and number in before
        by_track = by_track and station.given == before[number].camera
        free = station.given is None and not station.lines and frame.camera is not None
        if by_track or free:
            place = NamedStation(kept.id, stored.id, stored.group.match, station.size)
            batch.append((place, GivenCamera(frame.camera, frame.covariance)))
    report = IngestReport()
    attach_cameras(session, recording.dataset_id, batch, SOURCE, actor, report)
    return report.changed


def cameras_at(
    store: Store, recording: Recording, numbers: Iterable[int]
) -> dict[int, FrameCamera]:
    """What the tracker found of frames of a recording; those of no tracked stretch are left out."""
    wanted, found = set(numbers), dict[int, FrameCamera]()
    for stretch in list_cameras(store, recording.id):
        inside = {number for number in wanted if stretch.first <= number <= stretch.last}
        if inside and not stretch.stale:
            with suppress(ConflictError):
                frames = read_cameras(store.settings, stretch.digest)
                found.update({each.number: each for each in frames if each.number in inside})
    return found
