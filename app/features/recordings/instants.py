"""Instants: frames of a recording that become groups, and are kept without loss in the home.

The recording may be gone later: its groups have their frames, and say which ones they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import cv2

from app.config import Settings
from app.db.store import Store
from app.durable import replace_file
from app.errors import ImageError, InputError, StorageError
from app.features.file_tools.track import frame_row
from app.features.imports.ingest import BATCH, IngestReport, Origin, ingest_batch
from app.features.recordings.cameras import SOURCE, cameras_at
from app.features.recordings.service import Recording, get_recording, groups_taken, read_index
from app.progress import ReportProgress
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.media import Media
from app.tracking.track import FrameCamera
from app.video.frames import read_frames
from app.video.index import RecordingIndex

MOST_AT_ONCE = 5000
"""Instants of one request; 720p takes about 1.3 MB each."""


@dataclass(frozen=True)
class Taken:
    """What became of the instants that were asked for.

    Attributes:
        name: Of the recording.
        new: Groups that were made.
        unchanged: Groups that were there already.
        cameras: New ones that have the camera of their frame.
    """

    name: str
    new: int
    unchanged: int
    cameras: int


def require_instants(recording: Recording, frames: Sequence[int]) -> list[int]:
    """The numbers of frames in their order, each once.

    Raises:
        ConflictError: The recording cannot be read.
        InputError: One is outside of the recording, or they are too many.
    """
    recording.require_readable()
    numbers = sorted(set(frames))
    if len(numbers) > MOST_AT_ONCE:
        raise InputError(
            f"{len(numbers):,} instants are too many at once; {MOST_AT_ONCE:,} can be taken",
            hint="Take fewer of them, or a part of the recording after the other.",
            pointer="/frames",
        )
    if numbers and numbers[-1] >= (recording.frames or 0):
        raise InputError(
            f'"{recording.name}" has no frame {numbers[-1]}; its last one is '
            f"{(recording.frames or 0) - 1}",
            pointer="/frames",
        )
    return numbers


def take_instants(
    store: Store, recording_id: int, frames: Sequence[int], actor: str, progress: ReportProgress
) -> Taken:
    """Make a group of one view of each instant; in a worker process, which decodes.

    Killed anywhere and started again, it ends in the same state.

    Args:
        store: The database.
        recording_id: Which recording.
        frames: Numbers of its frames.
        actor: Who wants it.
        progress: Called with instants done and in all.

    Raises:
        ConflictError, InputError: As ``require_instants``.
        ImageError: A frame cannot be decoded.
        StorageError: The disk refuses.
    """
    recording = get_recording(store, recording_id)
    numbers = require_instants(recording, frames)
    there = groups_taken(store, recording)
    wanted = [number for number in numbers if number not in there]
    index = read_index(store.settings, recording.require_readable())
    origin, report = Origin(recording.dataset_id, recording.name, actor), IngestReport()
    done, total = len(numbers) - len(wanted), len(numbers)
    progress(done, total)
    tracked = cameras_at(store, recording, wanted)
    groups = _groups(store.settings, recording, index, wanted, tracked)
    while batch := list(islice(groups, BATCH)):
        with store.write() as session:
            ingest_batch(session, origin, batch, report, set())
        done += len(batch)
        progress(done, total)
    known = sum(frame.camera is not None for frame in tracked.values())
    return Taken(recording.name, report.new, len(numbers) - len(wanted), known)


def _groups(
    settings: Settings,
    recording: Recording,
    index: RecordingIndex,
    numbers: Iterable[int],
    tracked: Mapping[int, FrameCamera],
) -> Iterator[Group]:
    facts = index.facts
    size = ImageSize(facts.width, facts.height)
    folder = settings.recordings / facts.sha256
    for number, image in read_frames(recording.path, index, numbers):
        key = f"{recording.name}/{number}.png"
        path = _kept(folder / f"{number}.png", image)
        station, shown = Station(key, size), _provenance(recording, index, number)
        frame = tracked.get(number)
        if frame is not None and frame.camera is not None:
            station = station.with_given(frame.camera, frame.covariance)
            shown["camera"] = _given_by_track(frame)
        view = View(
            f"{number}.png",
            station,
            media=Media(str(path)),
            extras=Extras(metadata={"recording": shown}),
        )
        yield Group(key, (view,), match=recording.name, label=f"Frame {number}")


def _provenance(recording: Recording, index: RecordingIndex, number: int) -> dict[str, Any]:
    """Which frame of what a group shows: time stamp in ticks of its time base, and seconds."""
    over, under = index.facts.time_base
    return {
        "name": recording.name,
        "sha256": index.facts.sha256,
        "frame": number,
        "timestamp": int(index.pts[number]),
        "time_base": f"{over}/{under}",
        "seconds": float(index.seconds[number]),
    }


def _given_by_track(frame: FrameCamera) -> dict[str, Any]:
    """What the tracker says of the camera that it gives a frame."""
    row = frame_row(frame)
    names = ("outcome", "keyframe", "supported", "explained", "error_px", "sigma")
    return {"source": SOURCE, **{name: row[name] for name in names}}


def _kept(place: Path, image: Any) -> Path:
    """Where a frame is kept, as PNG; nothing is written where it is."""
    if place.is_file():
        return place
    done, data = cv2.imencode(".png", image[:, :, ::-1])
    if not done:
        raise ImageError(f"frame {place.stem} cannot be encoded as PNG")
    try:
        place.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(place, data.tobytes())
    except OSError as error:
        raise StorageError(
            f"frame {place.stem} cannot be kept ({error.strerror})",
            hint="Free some space, and take the instants again.",
        ) from error
    return place
