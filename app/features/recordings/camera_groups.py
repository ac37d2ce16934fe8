"""Cameras over time given to groups: views that show a frame of a stretch get the camera of that frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from app.db.session import Session
from app.features.groups.queries import StoredGroup, read_groups
from app.features.imports.cameras import GivenCamera, NamedStation, attach_cameras
from app.features.imports.ingest import IngestReport
from app.features.recordings.camera_queries import views_of_video
from app.features.recordings.service import Recording
from app.tracking.track import FrameCamera

SOURCE = "track"
"""Where given cameras come from, for the log and for the metadata of views."""
_BATCH = 100

ShownFrame = tuple[int, StoredGroup, str]
"""Number of a frame, a group with a view that shows it, and the key of that view."""


def views_of_stretch(
    session: Session, recording: Recording, first: int, last: int, *, with_lines: bool = False
) -> list[ShownFrame]:
    """The views that show a frame of a stretch; those of drawn lines alone where asked."""
    shown = views_of_video(session, recording.dataset_id, recording.require_readable())
    wanted = [one for one in shown if first <= one.number <= last]
    wanted = [one for one in wanted if one.has_lines or not with_lines]
    ids, groups = sorted({one.group for one in wanted}), dict[int, StoredGroup]()
    for start in range(0, len(ids), _BATCH):
        groups |= read_groups(session, ids[start : start + _BATCH])
    return [(one.number, groups[one.group], one.key) for one in wanted if one.group in groups]


def give_cameras(
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
