"""Accepted ball runs as measurements of tracks, in frames of recordings that are of no group.

A run measures the ball of its own recording's match, and through a link that of the live shot which its frames
show again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.config import Settings
from app.db.session import Session
from app.errors import ConflictError
from app.features.recordings.ball_run_values import build_run_from_row
from app.features.recordings.cameras import read_cameras
from app.features.recordings.index import read_frame_times
from app.features.recordings.link_frames import find_repeated_or_blended_frames
from app.features.recordings.link_values import ShotLink, build_link_from_row
from app.features.recordings.links import read_link_times
from app.features.recordings.queries import (
    find_ball_run,
    list_link_rows,
    list_tracked_stretches,
    list_views_of_video,
)
from app.features.tracks.queries import list_accepted_run_rows, read_recording_shots
from app.soccer.frames import ImagePoint
from app.soccer.policy import Policy
from app.soccer.solution import Calibration
from app.solving.ball_covariance import ball_click_variance
from app.solving.triangulate import BallObservation
from app.tracking.ball_run import FollowedBall
from app.tracking.track import FrameCamera


@dataclass(frozen=True)
class AcceptedRun:
    """An accepted run that shows the ball of a match.

    Attributes:
        first, last: Live frames of the shot that it shows, or shows again.
        state: What it depends on: the run, its link, and the cameras over time.
        row: Of the table of runs without its frames, with ``name`` and ``video`` (sha256) of its recording.
        link: Through which it shows the live shot; None: it is of that shot itself.
        link_row: Of that link.
        cameras: Digests of the cameras over time of its recording, with first and last frame.
    """

    first: int
    last: int
    state: tuple[Any, ...]
    row: Any
    link: ShotLink | None
    link_row: Any
    cameras: tuple[tuple[str, int, int], ...]


@dataclass(frozen=True)
class AcceptedRunObservation:
    """A ball of an accepted run.

    Attributes:
        frame: The live frame that shows the same, or the nearest one.
        frame_time: When that is shown, seconds.
        time: Of the ball, as the live recording counts.
        view: Name of its view in a stretch.
        ball: What is measured, with the camera of its frame.
    """

    frame: int
    frame_time: float
    time: float
    view: str
    ball: BallObservation


def format_linked_view_name(recording: str, link: int) -> str:
    """The name of the view of a linked replay in a stretch."""
    return f"{recording} link {link}"


def list_accepted_runs(session: Session, dataset_id: int) -> dict[str, list[AcceptedRun]]:
    """The accepted runs of a dataset by the match whose ball they show: recordings name their matches."""
    rows = list_accepted_run_rows(session, dataset_id)
    shots = read_recording_shots(session, dataset_id) if rows else {}
    cameras = {
        number: _list_stretch_cameras(session, number)
        for number in {row.recording_id for row in rows}
    }
    links = {
        number: [row for row in list_link_rows(session, number) if row.replay_id == number]
        for number in cameras
    }
    found: dict[str, list[AcceptedRun]] = {}
    for row in rows:
        stretches = cameras[row.recording_id]
        mine = tuple(one for one in stretches if one[1] <= row.last and row.first <= one[2])
        if not mine:
            continue
        said = (row.id, row.revision, *(digest for digest, *_ in mine))
        inside = (shot for shot in shots.get(row.name, ()) if shot[0] <= row.first <= shot[1])
        first, last = next(inside, (row.first, row.last))
        live = AcceptedRun(first, last, said, row, None, None, mine)
        found.setdefault(row.name, []).append(live)
        for other in links[row.recording_id]:
            link = build_link_from_row(other)
            overlaps = row.first <= link.replay.last and link.replay.first <= row.last
            if overlaps and link.map.outcome == "linked":
                ends, state = (link.live.first, link.live.last), (*said, link.id, link.etag)
                again = AcceptedRun(*ends, state, row, link, other, mine)
                found.setdefault(link.live.name, []).append(again)
    return found


def list_run_states(runs: Sequence[AcceptedRun], first: int, last: int) -> list[list[Any]]:
    """What a track from one frame to another depends on of runs: those of its shot."""
    return [list(run.state) for run in runs if run.first <= last and first <= run.last]


def collect_accepted_run_observations(
    session: Session,
    settings: Settings,
    runs: Mapping[str, Sequence[AcceptedRun]],
    policy: Policy,
) -> dict[str, list[AcceptedRunObservation]]:
    """The balls of accepted runs in frames that no group has, by match, each frame of a view once.

    Args:
        session: Any session.
        settings: Say where indexes and cameras lie.
        runs: By match.
        policy: Says how noisy clicks are.
    """
    grouped: dict[str, set[int]] = {}
    found: dict[str, list[AcceptedRunObservation]] = {}
    for match, items in runs.items():
        seen: set[tuple[str, int]] = set()
        for run in items:
            video = run.row.video
            if video not in grouped:
                shown = list_views_of_video(session, int(run.row.dataset_id), video)
                grouped[video] = {view.number for view in shown}
            with suppress(ConflictError):
                balls = build_run_from_row(find_ball_run(session, run.row.id), video).trusted_balls
                for number, one in _iterate_observations(
                    settings, run, balls, grouped[video], policy
                ):
                    if (one.view, number) not in seen:
                        seen.add((one.view, number))
                        found.setdefault(match, []).append(one)
    return found


def _list_stretch_cameras(session: Session, recording_id: int) -> list[tuple[str, int, int]]:
    rows = list_tracked_stretches(session, recording_id)
    return [(row.digest, row.first, row.last) for row in rows]


def _iterate_observations(
    settings: Settings,
    run: AcceptedRun,
    trusted: Mapping[int, FollowedBall],
    grouped: set[int],
    policy: Policy,
) -> Iterator[tuple[int, AcceptedRunObservation]]:
    """The balls of a run in frames of its recording that no group has."""
    link, row = run.link, run.row
    numbers = range(run.first, run.last + 1) if link is None else link.replay.frames
    balls = {
        number: ball
        for number, ball in trusted.items()
        if number in numbers and number not in grouped
    }
    cameras = {
        each.number: each
        for digest, first, last in run.cameras
        if any(first <= number <= last for number in balls)
        for each in read_cameras(settings, digest)
    }
    if link is None:
        view, seconds = row.name, read_frame_times(settings, row.video)
        times = {number: float(seconds[number]) for number in balls}
    else:
        view, seconds = (
            format_linked_view_name(row.name, link.id),
            read_frame_times(settings, run.link_row.live_sha256),
        )
        _, replay = read_link_times(settings, run.link_row)
        live = seconds[link.live.first] + link.map.to_live_times(replay)
        unsound = find_repeated_or_blended_frames(settings, row.video, link.replay)
        times = {
            number: float(live[number - link.replay.first])
            for number in balls
            if number not in unsound
        }
    of_shot = seconds[run.first : run.last + 1]
    half = float(np.median(np.diff(of_shot))) / 2 if len(of_shot) > 1 else 0.0
    for number, time in times.items():
        frame = cameras.get(number)
        near = int(np.abs(of_shot - time).argmin())
        if frame is None or frame.camera is None or abs(of_shot[near] - time) > half + 1e-9:
            continue
        ball = _make_observation(view, balls[number], frame, policy)
        at = float(of_shot[near])
        yield number, AcceptedRunObservation(run.first + near, at, time, view, ball)


def _make_observation(
    view: str, ball: FollowedBall, frame: FrameCamera, policy: Policy
) -> BallObservation:
    calibration = Calibration("given", frame.camera, covariance=frame.covariance)
    diagonal, size = np.array([frame.size.diagonal]), np.array([ball.diameter])
    usual = float(np.sqrt(ball_click_variance(diagonal, size, policy)[0]))
    return BallObservation(
        view,
        calibration,
        ImagePoint(ball.x, ball.y),
        ball.diameter,
        frame.size,
        ball.sigma_px / usual,
    )
