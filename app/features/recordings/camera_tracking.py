"""Cameras over time made: tracked by a process, turned by half, kept in place of those before, and given to groups.

People mend them by annotating a frame: the lines of every group that was taken from the stretch are known to the tracker.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.store import Store
from app.durable import replace_file
from app.errors import ConflictError, InputError, StorageError
from app.features.audit.service import add_audit_event
from app.features.datasets.service import get_dataset_head
from app.features.file_tools.track import count_outcomes, pitch_to_row
from app.features.pitches.queries import read_edited_pitches
from app.features.recordings.cameras import (
    CameraTrackingSummary,
    ShotCameras,
    assign_tracked_cameras,
    cameras_file_path,
    get_shot_cameras,
    list_shot_cameras,
    list_views_of_stretch,
    read_cameras,
    read_cameras_of_frames,
)
from app.features.recordings.index import read_index, run_in_worker
from app.features.recordings.queries import (
    delete_overlapping_cameras,
    insert_cameras,
    list_camera_digests,
)
from app.features.recordings.service import Recording, get_recording, require_recording
from app.json_text import canonical_json_text, digest_content
from app.progress import ReportProgress
from app.soccer.annotation import Lines
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.calibrate import calibrate
from app.tracking.camera_file import frame_cameras_to_bytes
from app.tracking.clip import Clip
from app.tracking.sides import are_on_opposite_side, move_camera_to_opposite_side
from app.tracking.track import FrameCamera, track_clip
from app.worker_process import WorkerLimits

LIMITS = WorkerLimits(memory=3 * 2**30, processor=6 * 3600.0, silence=600.0)
"""For tracking a stretch."""
MOST_FRAMES = 15_000
"""Of one stretch: ten minutes of 25 frames a second, of which no shot has as many."""


@dataclass(frozen=True)
class TrackedStretch:
    """What the process that tracks returns: a camera of each frame, and which lines were of no use.

    ``turned`` and ``pitch``: as of ``CameraTrackingSummary``.
    """

    frames: list[FrameCamera]
    unusable: tuple[int, ...]
    turned: bool = False
    pitch: dict[str, Any] | None = None


def require_trackable_stretch(recording: Recording, first: int, last: int) -> None:
    """Require that a stretch can be tracked.

    Raises:
        ConflictError: The recording cannot be read.
        InputError: It is outside of the recording, or too long.
    """
    recording.require_readable()
    if not first <= last < (recording.frames or 0):
        raise InputError(
            f'"{recording.name}" does not have all of the frames {first} to {last}; its last'
            f" one is {(recording.frames or 0) - 1}",
            pointer="/last",
        )
    if last - first >= MOST_FRAMES:
        raise InputError(
            f"{last - first + 1:,} frames are too many; {MOST_FRAMES:,} can be tracked at once",
            hint="Split the shot, and track its parts.",
            pointer="/last",
        )


def track_stretch_in_worker(
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
        InputError: As ``require_trackable_stretch``.
    """
    recording = get_recording(store, recording_id)
    require_trackable_stretch(recording, first, last)
    sha256 = recording.require_readable()
    policy = get_dataset_head(store, recording.dataset_id).policy.calibration
    lines: dict[int, Lines] = {}
    with store.read() as session:
        drawn = list_views_of_stretch(session, recording, first, last, with_lines=True)
        pitch = read_edited_pitches(session, recording.dataset_id, [recording.name])
    for number, stored, key in drawn:
        station = stored.stations[key].station
        if not (station.flipped or station.picture):
            lines.setdefault(number, station.lines)
    known = (store.settings, sha256, first, last, lines, pitch.get(recording.name), policy)
    tracked: TrackedStretch = run_in_worker(
        recording.path, track_stretch, *known, progress=progress, stop=stop, limits=LIMITS
    )
    if not set(lines) - set(tracked.unusable):
        tracked = _keep_turned_side(store, recording, tracked)
    return save_cameras(store, recording, (first, last), tracked, sorted(lines), actor)


def _keep_turned_side(
    store: Store, recording: Recording, tracked: TrackedStretch
) -> TrackedStretch:
    """Cameras without lines on the side to which a person turned those before."""
    first, last = tracked.frames[0].number, tracked.frames[-1].number
    overlapping = (one for one in list_shot_cameras(store, recording.id) if one.first <= last)
    if not any(one.summary.turned and first <= one.last for one in overlapping):
        return tracked
    before = read_cameras_of_frames(store, recording, range(first, last + 1))
    if not are_on_opposite_side(tracked.frames, before):
        return tracked
    frames = [move_camera_to_opposite_side(frame) for frame in tracked.frames]
    return TrackedStretch(frames, tracked.unusable, True, _rotate_pitch_half_turn(tracked.pitch))


def _rotate_pitch_half_turn(pitch: dict[str, Any] | None) -> dict[str, Any] | None:
    """A pitch that is shown, after half a turn: its tripod stands opposite."""
    if pitch is None:
        return None
    x, y, z = pitch["tripod"]
    return {**pitch, "tripod": [-x, -y, z]}


def rotate_cameras_half_turn(
    store: Store, recording_id: int, frame: int, turned: bool, *, actor: str
) -> tuple[ShotCameras, int]:
    """Turn the cameras of a stretch by half a turn of the pitch against what the tracker gave, or back.

    Groups of its frames follow, as they do when it is tracked.

    Args:
        store: The database.
        recording_id: Which recording.
        frame: Any frame of the stretch.
        turned: Whether they shall be turned.
        actor: Who wants it.

    Returns:
        The cameras, and how many groups were given another one.

    Raises:
        ConflictError: As ``require_cameras_turnable``, the cameras cannot be read, or somebody tracked the stretch meanwhile.
        NotFoundError: There are no cameras at that frame.
    """
    found = require_cameras_turnable(store, recording_id, frame, turned)
    if found.summary.turned == turned:
        return found, 0
    frames = [
        move_camera_to_opposite_side(one) for one in read_cameras(store.settings, found.digest)
    ]
    return save_cameras(
        store,
        get_recording(store, recording_id),
        (found.first, found.last),
        TrackedStretch(
            frames, found.summary.unusable, turned, _rotate_pitch_half_turn(found.summary.pitch)
        ),
        found.summary.annotated,
        actor,
        turned_from=found,
    )


def require_cameras_turnable(
    store: Store, recording_id: int, frame: int, turned: bool
) -> ShotCameras:
    """The cameras at a frame, which may be turned by half.

    Raises:
        ConflictError: They are of another video, or lines of a frame say which half of the pitch is left.
        NotFoundError: There are none.
    """
    found = get_shot_cameras(store, recording_id, frame)
    if found.stale:
        raise ConflictError(
            "the video file has changed since the shot was tracked", hint="Track the shot again."
        )
    fixed = sorted(set(found.summary.annotated) - set(found.summary.unusable))
    if fixed and turned != found.summary.turned:
        raise ConflictError(
            f"the cameras cannot be turned: the lines of frame {fixed[0]} already say which half of the"
            " pitch is left",
            hint="Name its lines for the other half, and track the shot again.",
        )
    return found


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
) -> TrackedStretch:
    """The work of the process: decode, calibrate and follow."""
    clip = Clip.open(path, read_index(settings, sha256), first, last)

    def can_calibrate_from_lines(drawn: Lines) -> bool:
        return calibrate(drawn, pitch or Pitch(), clip.size, CLICKED).camera is not None

    def report_frames_done(done: int) -> None:
        send((done, total, ""))

    usable = {number: drawn for number, drawn in lines.items() if can_calibrate_from_lines(drawn)}
    total = last - first + 1
    found = track_clip(clip, usable, pitch, policy, report_frames_done)
    unusable = tuple(sorted(set(lines) - set(usable)))
    return TrackedStretch(found.frames, unusable, pitch=pitch_to_row(found.shown, on_shown=False))


def save_cameras(
    store: Store,
    recording: Recording,
    stretch: tuple[int, int],
    tracked: TrackedStretch,
    annotated: Sequence[int],
    actor: str,
    *,
    turned_from: ShotCameras | None = None,
) -> tuple[ShotCameras, int]:
    """Keep what was found of a stretch (first and last frame): ``track_stretch_in_worker`` without the tracking.

    ``turned_from`` are the cameras of which it was made by turning them.

    Raises:
        ConflictError: The video is another one by now, or so are the cameras that were turned.
    """
    first, last = stretch
    made = _write_cameras_file(store.settings, recording, tracked, annotated)
    rests = [
        (rest, _write_cameras_file(store.settings, recording, rest, one.summary.annotated))
        for one in list_shot_cameras(store, recording.id)
        for rest in _split_cameras_outside_stretch(store.settings, one, first, last)
    ]
    tracked_before = read_cameras_of_frames(store, recording, range(first, last + 1))
    common = {
        "dataset_id": recording.dataset_id,
        "recording_id": recording.id,
        "sha256": recording.sha256,
    }
    with store.write() as session:
        row = require_recording(session, recording.id)
        if row.sha256 != recording.sha256:
            raise ConflictError(
                f'the video file of "{recording.name}" was replaced while the shot was tracked',
                hint="Track the shot again.",
            )
        replaced = delete_overlapping_cameras(session, recording.id, first, last)
        if turned_from is not None and [old.digest for old in replaced] != [turned_from.digest]:
            raise ConflictError(
                "the cameras of this shot were changed in the meantime",
                hint="Reload the page and check the new cameras.",
            )
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
                    # Whoever tracked it, and when; the name that is shown follows from both.
                    insert_cameras(
                        session,
                        **common,
                        **values,
                        revision=old.revision,
                        actor=old.actor,
                        created=old.created,
                    )
        views = list_views_of_stretch(session, recording, first, last)
        changed = assign_tracked_cameras(
            session, recording, tracked.frames, views, tracked_before, actor
        )
        add_audit_event(
            session,
            actor,
            "cameras tracked" if turned_from is None else "cameras turned",
            recording.dataset_id,
            recording=recording.id,
            name=recording.name,
            frames=f"{first} to {last}",
        )
        used = list_camera_digests(session)
    for old in replaced:
        for name in {old.digest, old.before} - used - {None}:
            # What stays is reported by doctor.
            with suppress(OSError):
                cameras_file_path(store.settings, name).unlink(missing_ok=True)
    return get_shot_cameras(store, recording.id, first), changed


def _write_cameras_file(
    settings: Settings, recording: Recording, tracked: TrackedStretch, annotated: Sequence[int]
) -> dict[str, Any]:
    """Write the file of some cameras; returns what their row says of them."""
    content = frame_cameras_to_bytes(tracked.frames)
    digest = digest_content(content)
    try:
        settings.recordings.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(cameras_file_path(settings, digest), content)
    except OSError as error:
        raise StorageError(
            f"the cameras of {recording.name} cannot be stored ({error.strerror})",
            hint="Free some space, and track the shot again.",
        ) from error
    numbers = [frame.number for frame in tracked.frames]
    inside = tuple(number for number in annotated if numbers[0] <= number <= numbers[-1])
    summary = _summarize_cameras(tracked, inside)
    return {
        "first": numbers[0],
        "last": numbers[-1],
        "digest": digest,
        "summary": canonical_json_text(vars(summary)),
    }


def _split_cameras_outside_stretch(
    settings: Settings, old: ShotCameras, first: int, last: int
) -> list[TrackedStretch]:
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
        TrackedStretch(
            part,
            tuple(one for one in old.summary.unusable if part[0].number <= one <= part[-1].number),
            old.summary.turned,
            old.summary.pitch,
        )
        for part in parts
        if part
    ]


def _summarize_cameras(tracked: TrackedStretch, annotated: Sequence[int]) -> CameraTrackingSummary:
    counts = count_outcomes([{"outcome": frame.outcome} for frame in tracked.frames])
    measured = [frame for frame in tracked.frames if frame.error_px is not None]
    worst = max(measured, key=lambda frame: frame.error_px or 0.0, default=None)
    return CameraTrackingSummary(
        **counts,
        worst_frame=None if worst is None else worst.number,
        worst_px=None if worst is None else worst.error_px,
        annotated=tuple(annotated),
        unusable=tracked.unusable,
        turned=tracked.turned,
        pitch=tracked.pitch,
    )
