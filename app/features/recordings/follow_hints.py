"""What is known of a ball beside the pictures in which it is followed: cameras, detectors, and linked views."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

import numpy as np

from app.db.store import Store
from app.errors import ConflictError
from app.features.recordings.ball_run_values import run_of_row
from app.features.recordings.cameras import cameras_at
from app.features.recordings.link_frames import unsound_frames
from app.features.recordings.link_values import LinkedShot, ShotLink
from app.features.recordings.links import list_links, shot_seconds, step_of
from app.features.recordings.queries import list_run_rows, predicted_in, views_of_video
from app.features.recordings.service import Recording, get_recording
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.tracking.ball_hints import LinkedBall, predicted_places
from app.tracking.ball_run import DetectedBall, FollowedBall, FollowHints, PredictedPlace

_UNKNOWN_S = 0.02
"""Standard deviation of the times of a link whose speed changes, seconds."""


def follow_hints(store: Store, recording: Recording, frames: range) -> FollowHints:
    """What is known of frames of a recording.

    Cameras over time; what detectors say of frames that are groups; and where balls of accepted runs of linked
    views put the ball, as far as cameras and the times of the links tell.
    """
    cameras = _cameras(store, recording, frames)
    return FollowHints(
        cameras, _places(store, recording, cameras), _detected(store, recording, frames)
    )


def _cameras(store: Store, recording: Recording, frames: range) -> dict[int, Camera]:
    found = cameras_at(store, recording, frames)
    return {number: one.camera for number, one in found.items() if one.camera is not None}


def _detected(
    store: Store, recording: Recording, frames: range
) -> dict[int, tuple[DetectedBall, ...]]:
    with store.read() as session:
        shown = views_of_video(session, recording.dataset_id, recording.require_readable())
        rows = predicted_in(session, [view for view in shown if view.number in frames])
    return {
        number: tuple(
            DetectedBall(
                row.x + row.width / 2, row.y + row.height / 2, (row.width + row.height) / 2, row.score
            )
            for row in boxes
        )
        for number, boxes in rows.items()
    }  # fmt: skip


def _places(
    store: Store, recording: Recording, cameras: Mapping[int, Camera]
) -> dict[int, PredictedPlace]:
    """Where linked views put the ball in frames with cameras; of several the one that says most."""
    found: dict[int, PredictedPlace] = {}
    if not cameras:
        return found
    for link in list_links(store, recording.id):
        if link.map.outcome != "linked":
            continue
        for here, there in ((link.live, link.replay), (link.replay, link.live)):
            inside = {number: one for number, one in cameras.items() if number in here.frames}
            if here.recording != recording.id or not inside:
                continue
            with suppress(ConflictError):
                for number, place in _by_link(store, link, here, there, inside).items():
                    known = found.get(number)
                    if known is None or _spread(place) < _spread(known):
                        found[number] = place
    return found


def _by_link(
    store: Store,
    link: ShotLink,
    here: LinkedShot,
    there: LinkedShot,
    cameras: Mapping[int, Camera],
) -> dict[int, PredictedPlace]:
    """Where the other view of a link puts the ball in frames of one of them."""
    other = get_recording(store, there.recording)
    with store.read() as session:
        rows = [row for row in list_run_rows(session, there.recording) if row.accepted_by]
    unsound = unsound_frames(store.settings, other.require_readable(), there)
    balls: dict[int, FollowedBall] = {}
    for row in rows:
        run = run_of_row(row, other.sha256)
        if not run.stale:
            balls |= {
                number: ball
                for number, ball in run.trusted.items()
                if number in there.frames and number not in unsound
            }
    seen = _cameras(store, other, range(min(balls), max(balls) + 1)) if balls else {}
    numbers = sorted(balls.keys() & seen.keys())
    if not numbers:
        return {}
    mine, theirs = _live_seconds(store, link, here), _live_seconds(store, link, there)
    ball = LinkedBall.of(
        [float(theirs[number - there.first]) for number in numbers],
        [(balls[number].x, balls[number].y) for number in numbers],
        [seen[number] for number in numbers],
    )
    frames = {number: (float(mine[number - here.first]), one) for number, one in cameras.items()}
    live = mine if here == link.live else theirs
    # A frame that is repeated, or mixed with its neighbour, is of another instant than its time says.
    sigma = float(np.hypot(link.map.sigma_s or _UNKNOWN_S, step_of(live) / 2))
    return predicted_places(ball, frames, sigma)


def _live_seconds(store: Store, link: ShotLink, shot: LinkedShot) -> FloatArray:
    """When the frames of a shot of a link are, seconds after the first one of the live shot, shape (N,)."""
    sha256 = get_recording(store, shot.recording).require_readable()
    seconds = shot_seconds(store.settings, sha256, shot)
    return seconds if shot == link.live else link.map.live(seconds)


def _spread(place: PredictedPlace) -> float:
    return float(np.linalg.det(place.covariance))
