"""Instants: frames of a recording that become groups, and are kept without loss in the home.

The recording may be gone later: its groups have their frames, and say which ones they are.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import cv2

from app.config import Settings
from app.db.store import Store
from app.durable import replace_file
from app.errors import ImageError, InputError, StorageError
from app.features.file_tools.track import frame_to_row
from app.features.groups.queries import StoredGroup, read_groups
from app.features.imports.ingest import BATCH, ImportContext, IngestReport, import_group_chunk
from app.features.recordings.ball_runs import give_accepted_balls
from app.features.recordings.cameras import SOURCE, read_cameras_of_frames
from app.features.recordings.index import read_index
from app.features.recordings.link_frames import find_linked_frames
from app.features.recordings.links import list_links
from app.features.recordings.match_clock import compute_match_time
from app.features.recordings.queries import list_views_of_video
from app.features.recordings.service import Recording, find_group_ids_by_frame, get_recording
from app.progress import ReportProgress
from app.soccer.annotation import Extras
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.tracking.track import FrameCamera
from app.video.frames import read_frames
from app.video.index import RecordingIndex

MOST_AT_ONCE = 5000
"""Instants of one request; 720p takes about 1.3 MB each."""


@dataclass(frozen=True)
class TakenInstants:
    """What became of the instants that were asked for.

    Attributes:
        name: Of the recording.
        new: Groups that were made.
        changed: Groups that were there, and got views of linked replays of which they had none.
        unchanged: Groups that were there already, and stay as they are.
        linked_views: Views of linked replays that were added to the groups that were made or changed.
        outside: Times that an instant of those is outside of the stretch of a linked replay.
        cameras: Views of those groups that have the camera of their frame.
    """

    name: str
    new: int
    changed: int
    unchanged: int
    linked_views: int
    outside: int
    cameras: int


@dataclass(frozen=True)
class _ShownFrame:
    """A frame that is a view of a group.

    Attributes:
        recording, index: Of what.
        number: Of the frame.
        tracked: What the tracker found of it; None: it was not tracked.
        link: Of a frame of a replay: what is said of how it shows the group's instant.
    """

    recording: Recording
    index: RecordingIndex
    number: int
    tracked: FrameCamera | None
    link: Mapping[str, Any] | None = None

    @property
    def picture_path(self) -> str:
        """Where it is kept, below the recordings of the home."""
        return f"{self.index.facts.sha256}/{self.number}.png"


@dataclass
class _LinkedViews:
    """Views of linked replays by their live frame."""

    of: defaultdict[int, list[_ShownFrame]] = field(default_factory=lambda: defaultdict(list))
    missed: list[int] = field(default_factory=list)
    """Live frames that are outside of the stretch of a replay, once for each such replay."""


def validate_instant_frames(recording: Recording, frames: Sequence[int]) -> list[int]:
    """The numbers of frames in their order, each once.

    Raises:
        ConflictError: The recording cannot be read.
        InputError: One is outside of the recording, or they are too many.
    """
    recording.require_readable()
    numbers = sorted(set(frames))
    if len(numbers) > MOST_AT_ONCE:
        raise InputError(
            f"{len(numbers):,} instants are too many at once; at most {MOST_AT_ONCE:,} can be"
            " taken",
            hint="Take fewer, or take one part of the recording after another.",
            pointer="/frames",
        )
    if numbers and numbers[-1] >= (recording.frames or 0):
        raise InputError(
            f'"{recording.name}" has no frame {numbers[-1]}; its last one is '
            f"{(recording.frames or 0) - 1}",
            pointer="/frames",
        )
    return numbers


def make_groups_of_instants(
    store: Store,
    recording_id: int,
    frames: Sequence[int],
    linked: bool,
    actor: str,
    progress: ReportProgress,
    dry_run: bool = False,
) -> TakenInstants:
    """Make a group of each instant: of one view, or with those of linked replays; in a worker process, which decodes.

    Killed anywhere and started again, it ends in the same state.

    Args:
        store: The database.
        recording_id: Which recording.
        frames: Numbers of its frames.
        linked: Whether the frames of linked replays that show the same are further views. Groups that are there already
            get those of replays of which they have no view.
        actor: Who wants it.
        progress: Called with instants done and in all.
        dry_run: Count what would become of them, and keep nothing.

    Raises:
        ConflictError, InputError: As ``validate_instant_frames``, also of the recording of a replay whose frames have
            to be decoded.
        ImageError: A frame cannot be decoded.
        StorageError: The disk refuses.
    """
    recording = get_recording(store, recording_id)
    numbers = validate_instant_frames(recording, frames)
    there = find_group_ids_by_frame(store, recording)
    replays = _find_linked_views(store, recording, numbers, there) if linked else _LinkedViews()
    wanted = [number for number in numbers if number not in there or number in replays.of]
    index = read_index(store.settings, recording.require_readable())
    origin, report = ImportContext(recording.dataset_id, recording.name, actor), IngestReport()
    done, total = len(numbers) - len(wanted), len(numbers)
    progress(done, total)
    tracked = read_cameras_of_frames(store, recording, wanted)
    live = [_ShownFrame(recording, index, number, tracked.get(number)) for number in wanted]
    groups, left = _build_groups(store, live, replays.of, there), live
    while not dry_run and (batch := list(islice(groups, BATCH))):
        with store.write() as session:
            import_group_chunk(session, origin, batch, report, set())
        some, left = left[: len(batch)], left[len(batch) :]
        made = [one for one in some if one.number not in there]
        made += [view for one in some for view in replays.of.get(one.number, ())]
        give_accepted_balls(store, [(one.recording.id, one.number) for one in made], actor)
        done += len(batch)
        progress(done, total)
    linked_views = [view for number in wanted for view in replays.of.get(number, ())]
    new = sum(number not in there for number in wanted)
    return TakenInstants(
        recording.name,
        new if dry_run else report.new,
        len(wanted) - new if dry_run else report.changed,
        len(numbers) - len(wanted),
        len(linked_views),
        sum(number in wanted for number in replays.missed),
        sum(
            view.tracked is not None and view.tracked.camera is not None
            for view in (*live, *linked_views)
        ),
    )


def _find_linked_views(
    store: Store, recording: Recording, numbers: Sequence[int], there: Mapping[int, int]
) -> _LinkedViews:
    """The frames of all linked replays that show what live frames show; of links whose speed is known, not
    assumed. Left out where the group of a frame (``there``) has a view of that replay already."""
    found = _LinkedViews()
    for link in list_links(store, recording.id):
        if link.live.recording != recording.id or link.map.outcome != "linked":
            continue
        inside = [number for number in numbers if number in link.live.frames]
        replay = get_recording(store, link.replay.recording)
        if not inside or replay.sha256 is None:
            continue
        with store.read() as session:
            shown = list_views_of_video(session, replay.dataset_id, replay.sha256)
        have = {view.group for view in shown if view.number in link.replay.frames}
        asked = [number for number in inside if there.get(number) not in have]
        if not asked:
            continue
        index = read_index(store.settings, replay.sha256)
        times = index.seconds - index.seconds[link.replay.first]
        same = find_linked_frames(store, link)
        frames = {number: same.replay[number - same.first] for number in asked}
        tracked = read_cameras_of_frames(
            store, replay, [one for one in frames.values() if one is not None]
        )
        for number, frame in frames.items():
            if frame is None:
                found.missed.append(number)
                continue
            told = {
                "link": link.id,
                "sigma_s": link.map.sigma_at(float(times[frame]), float(times[link.replay.last])),
                "live_frame": number,
                "off_s": same.off_s[number - same.first],
                "repeated": frame in same.repeated,
                "blended": frame in same.blended,
            }
            view = _ShownFrame(replay, index, frame, tracked.get(frame), told)
            if not (store.settings.recordings / view.picture_path).is_file():
                # It will be decoded.
                replay.require_readable()
            if all(view.picture_path != other.picture_path for other in found.of[number]):
                found.of[number].append(view)
    return found


def _build_groups(
    store: Store,
    live: Sequence[_ShownFrame],
    linked: Mapping[int, Sequence[_ShownFrame]],
    there: Mapping[int, int],
) -> Iterator[Group]:
    """Groups of live frames with further views of replays; those that are there keep the views that they have."""
    settings = store.settings
    for start in range(0, len(live), BATCH):
        some = live[start : start + BATCH]
        _store_frame_images(
            settings, [*some, *(view for one in some for view in linked.get(one.number, ()))]
        )
        with store.read() as session:
            known = read_groups(session, [there[one.number] for one in some if one.number in there])
        for one in some:
            match = one.recording.name
            key = f"{match}/{one.number}.png"
            stored = known.get(there.get(one.number, 0))
            if stored is None:
                views = [_build_view(settings, one, f"{one.number}.png", key)]
            else:
                views = [_strip_edits_from_view(stored, view, one) for view in stored.group.views]
            for other in linked.get(one.number, ()):
                name = f"{other.number}.png"
                if other.recording.id != one.recording.id:
                    name = f"{other.recording.name}_{name}"
                if all(name != view.key for view in views):
                    views.append(_build_view(settings, other, name, f"{key}/{name}"))
            yield Group(key, tuple(views), match=match, label=f"Frame {one.number}")


def _strip_edits_from_view(stored: StoredGroup, view: View, live: _ShownFrame) -> View:
    """A view of a group that is there, without what people said of it since: an import keeps that, and what is
    given. Its live view gets the camera of its frame where it has neither camera nor lines."""
    kept = stored.stations[view.key]
    station = kept.station
    if kept.edited:
        station = Station(station.key, station.size, flipped=station.flipped)
    tracked = live.tracked
    is_free = kept.station.given is None and not kept.station.lines
    if is_free and view.key == f"{live.number}.png" and tracked is not None and tracked.camera:
        station = station.with_given_camera(tracked.camera, tracked.covariance)
    if view.key in stored.edited_views:
        view = View(view.key, station, media=view.media, extras=view.extras)
    return replace(view, station=station)


def _store_frame_images(settings: Settings, views: Sequence[_ShownFrame]) -> None:
    """Keep frames, each recording read once and forwards."""
    by_place = {view.picture_path: view for view in views}
    missing = [
        one for one in by_place.values() if not (settings.recordings / one.picture_path).is_file()
    ]
    for number in {one.recording.id for one in missing}:
        mine = {one.number: one for one in missing if one.recording.id == number}
        any_one = next(iter(mine.values()))
        for at, image in read_frames(any_one.recording.path, any_one.index, sorted(mine)):
            _store_frame_png(settings.recordings / mine[at].picture_path, image)


def _build_view(settings: Settings, shown: _ShownFrame, name: str, key: str) -> View:
    """The view of a frame that is kept; ``key`` is that of its station."""
    facts, frame = shown.index.facts, shown.tracked
    station = Station(key, ImageSize(facts.width, facts.height))
    told = {
        **_describe_provenance(shown.recording, shown.index, shown.number),
        **(shown.link or {}),
    }
    if frame is not None and frame.camera is not None:
        station = station.with_given_camera(frame.camera, frame.covariance)
        # Another camera may be given later: this is what was given now.
        told["camera_when_taken"] = _describe_tracked_camera(frame)
    media = Media(str(settings.recordings / shown.picture_path))
    return View(name, station, media=media, extras=Extras(metadata={"recording": told}))


def _describe_provenance(
    recording: Recording, index: RecordingIndex, number: int
) -> dict[str, Any]:
    """Which frame of what a group shows: time stamp in ticks of its time base, seconds, and time of the match."""
    over, under = index.facts.time_base
    half, time = compute_match_time(recording.clocks, index.seconds, number) or (None, None)
    shown = {} if half is None else {"match_half": half, "match_seconds": time}
    return {
        **shown,
        "name": recording.name,
        "sha256": index.facts.sha256,
        "frame": number,
        "timestamp": int(index.pts[number]),
        "time_base": f"{over}/{under}",
        "seconds": float(index.seconds[number]),
    }


def _describe_tracked_camera(frame: FrameCamera) -> dict[str, Any]:
    """What the tracker says of the camera that it gives a frame."""
    row = frame_to_row(frame)
    names = ("outcome", "keyframe", "supported", "explained", "error_px", "sigma")
    return {"source": SOURCE, **{name: row[name] for name in names}}


def _store_frame_png(place: Path, image: Any) -> Path:
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
            f"frame {place.stem} cannot be stored ({error.strerror})",
            hint="Free some space, and take the instants again.",
        ) from error
    return place
