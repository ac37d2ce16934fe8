"""Cameras over time: a camera for each frame of a stretch of a recording, as the tracker finds them.

A row counts them and one file holds them. Groups of its frames get them, and other tools their files.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from app.config import Settings
from app.db.json_columns import parse_json_column
from app.db.session import Session
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.file_tools.camera_export import export_cameras
from app.features.file_tools.track import frame_to_row, write_cameras
from app.features.groups.queries import StoredGroup, read_groups
from app.features.imports.cameras import GivenCamera, NamedStation, attach_cameras
from app.features.imports.ingest import IngestReport
from app.features.pitches.queries import read_edited_pitches
from app.features.recordings.queries import (
    list_tracked_stretches,
    list_views_of_video,
)
from app.features.recordings.service import Recording, get_recording, require_recording
from app.soccer.pitch import Pitch
from app.tracking.camera_file import frame_cameras_from_bytes
from app.tracking.track import FrameCamera


@dataclass(frozen=True)
class CameraTrackingSummary:
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
        turned: Whether a person turned them by half a turn of the pitch against what the tracker took to be its side.
        pitch: The pitch that its frames show together, as ``track.json`` has it; None where they show none.
    """

    frames: int
    tracked: int
    bridged: int
    lost: int
    worst_frame: int | None
    worst_px: float | None
    annotated: tuple[int, ...]
    unusable: tuple[int, ...]
    turned: bool = False
    pitch: dict[str, Any] | None = None


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
    summary: CameraTrackingSummary
    before: CameraTrackingSummary | None
    revision: int
    stale: bool
    drawn: tuple[int, ...]
    digest: str
    digest_before: str | None
    actor: str
    created: str


def list_shot_cameras(store: Store, recording_id: int) -> list[ShotCameras]:
    """The stretches of a recording that have cameras, in their order.

    Raises:
        NotFoundError: There is no such recording.
    """
    with store.read() as session:
        recording = require_recording(session, recording_id)
        rows = list_tracked_stretches(session, recording_id)
        sha256 = recording.sha256
        views = (
            list_views_of_video(session, recording.dataset_id, sha256) if rows and sha256 else []
        )
    drawn = sorted({view.number for view in views if view.has_lines})
    return [_build_shot_cameras(row, sha256, drawn) for row in rows]


def get_shot_cameras(store: Store, recording_id: int, frame: int) -> ShotCameras:
    """The cameras of the stretch that has a frame.

    Raises:
        NotFoundError: There are none.
    """
    for found in list_shot_cameras(store, recording_id):
        if found.first <= frame <= found.last:
            return found
    raise NotFoundError(f"recording {recording_id} has no cameras at frame {frame}")


def get_pitch_of_recording(store: Store, recording_id: int) -> Pitch:
    """The pitch of the match that a recording is of: as a person gave it, or as the Laws plan it."""
    with store.read() as session:
        row = require_recording(session, recording_id)
        return read_edited_pitches(session, row.dataset_id, [row.name]).get(row.name) or Pitch()


def read_cameras(settings: Settings, digest: str) -> list[FrameCamera]:
    """The cameras of a file.

    Raises:
        ConflictError: It is gone, or damaged.
    """
    return read_cameras_file(cameras_file_path(settings, digest))


def read_cameras_file(place: Path) -> list[FrameCamera]:
    """The same by the place where they lie."""
    try:
        return frame_cameras_from_bytes(place.read_bytes())
    except (OSError, InputError) as error:
        raise ConflictError(
            "the cameras of this shot cannot be read", hint="Track the shot again."
        ) from error


def cameras_file_path(settings: Settings, digest: str) -> Path:
    """Where cameras of a digest lie."""
    return settings.recordings / f"{digest}.cameras.npz"


def _build_shot_cameras(row: Any, sha256: str | None, drawn: Sequence[int]) -> ShotCameras:
    return ShotCameras(
        id=int(row.id),
        recording=int(row.recording_id),
        first=row.first,
        last=row.last,
        summary=CameraTrackingSummary(**parse_json_column(row.summary)),
        before=None
        if row.before_summary is None
        else CameraTrackingSummary(**parse_json_column(row.before_summary)),
        revision=row.revision,
        stale=row.sha256 != sha256,
        drawn=tuple(frame for frame in drawn if row.first <= frame <= row.last),
        digest=row.digest,
        digest_before=row.before,
        actor=row.actor,
        created=row.created,
    )


def read_cameras_of_frames(
    store: Store, recording: Recording, numbers: Iterable[int]
) -> dict[int, FrameCamera]:
    """What the tracker found of frames of a recording; those of no tracked stretch are left out."""
    wanted, found = set(numbers), dict[int, FrameCamera]()
    for stretch in list_shot_cameras(store, recording.id):
        inside = {number for number in wanted if stretch.first <= number <= stretch.last}
        if inside and not stretch.stale:
            with suppress(ConflictError):
                frames = read_cameras(store.settings, stretch.digest)
                found.update({each.number: each for each in frames if each.number in inside})
    return found


SOURCE = "track"
"""Where given cameras come from, for the log and for the metadata of views."""
_BATCH = 100

ShownFrame = tuple[int, StoredGroup, str]
"""Number of a frame, a group with a view that shows it, and the key of that view."""


def list_views_of_stretch(
    session: Session, recording: Recording, first: int, last: int, *, with_lines: bool = False
) -> list[ShownFrame]:
    """The views that show a frame of a stretch; those of drawn lines alone where asked."""
    shown = list_views_of_video(session, recording.dataset_id, recording.require_readable())
    wanted = [one for one in shown if first <= one.number <= last]
    wanted = [one for one in wanted if one.has_lines or not with_lines]
    ids, groups = sorted({one.group for one in wanted}), dict[int, StoredGroup]()
    for start in range(0, len(ids), _BATCH):
        groups |= read_groups(session, ids[start : start + _BATCH])
    return [(one.number, groups[one.group], one.key) for one in wanted if one.group in groups]


def assign_tracked_cameras(
    session: Session,
    recording: Recording,
    frames: Sequence[FrameCamera],
    views: Sequence[ShownFrame],
    before: Mapping[int, FrameCamera],
    actor: str,
) -> int:
    """Give views the cameras of their frames, unless somebody gave or drew another; returns how many have another one now.

    Args:
        session: The caller's write transaction.
        recording: Whose frames they are.
        frames: The cameras, of all frames that the views show.
        views: Views of those frames.
        before: The cameras that these take the place of, by number of their frame.
        actor: Who wants it.
    """
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


MEDIA_TYPES = {
    "soccernet": "application/zip",
    "npz": "application/octet-stream",
    "opentrackio": "application/zip",
}
"""By format."""


def export_shot_cameras(store: Store, found: ShotCameras, form: str) -> tuple[str, bytes]:
    """Name and content of a file of cameras.

    Args:
        store: The database.
        found: The cameras.
        form: ``soccernet``, ``npz`` or ``opentrackio``.

    Raises:
        ConflictError: The cameras are gone, or no frame has one.
    """
    frames = read_cameras(store.settings, found.digest)
    if all(frame.camera is None for frame in frames):
        raise ConflictError(
            "no frame of this shot has a camera yet", hint="Track the cameras of the shot first."
        )
    title = f"{get_recording(store, found.recording).name}_{found.first}-{found.last}"
    with TemporaryDirectory() as place:
        # Samples carry the name of their folder.
        folder, out = Path(place) / title, Path(place) / "out"
        write_cameras(
            folder,
            frames,
            {"frames": [frame_to_row(frame) for frame in frames], "pitch": found.summary.pitch},
        )
        if form == "npz":
            export_cameras(folder, out, form)
            return f"{title}.npz", out.read_bytes()
        if form == "opentrackio":
            export_cameras(folder, out, form, frames[0].size)
            folder = out
        return f"{title}-{form}.zip", _zip_folder(folder)


def _zip_folder(folder: Path) -> bytes:
    content = BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in sorted(folder.iterdir()):
            archive.writestr(zipfile.ZipInfo(file.name), file.read_bytes(), zipfile.ZIP_DEFLATED)
    return content.getvalue()
