"""Cameras over time: a camera for each frame of a stretch of a recording, as the tracker finds them.

A row counts them and one file holds them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.config import Settings
from app.db.json_columns import parse
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError
from app.features.pitches.queries import edited_pitches
from app.features.recordings.camera_queries import (
    list_cameras_rows,
    views_of_video,
)
from app.features.recordings.service import Recording, need_recording
from app.soccer.pitch import Pitch
from app.tracking.camera_file import frames_from_bytes
from app.tracking.track import FrameCamera


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
    summary: CameraSummary
    before: CameraSummary | None
    revision: int
    stale: bool
    drawn: tuple[int, ...]
    digest: str
    digest_before: str | None
    actor: str
    created: str


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
    return read_cameras_at(camera_place(settings, digest))


def read_cameras_at(place: Path) -> list[FrameCamera]:
    """The same by the place where they lie."""
    try:
        return frames_from_bytes(place.read_bytes())
    except (OSError, InputError) as error:
        raise ConflictError(
            "the cameras of this shot cannot be read", hint="Track the shot again."
        ) from error


def camera_place(settings: Settings, digest: str) -> Path:
    """Where cameras of a digest lie."""
    return settings.recordings / f"{digest}.cameras.npz"


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
