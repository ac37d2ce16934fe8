"""Links found from the ball: where it is seen in both shots, with the cameras over time, tells which times are the same.

The ball is seen where a file (``ball.csv``) says it, or where the groups that were taken from the shots have it; in the
frames of the live shot between these, a track of the ball says where it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from app.config import Settings
from app.db.database_worker import SILENCE, run_in_worker
from app.db.json_columns import Json
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, TooLargeError
from app.features.file_tools.shots import read_ball_rows
from app.features.groups.queries import read_groups
from app.features.imports.upload_queries import find_complete_upload_path, get_upload
from app.features.jobs.job_run import JobProgress, leave_work_to_next_server
from app.features.jobs.queries import Job
from app.features.jobs.service import Jobs
from app.features.recordings.cameras import read_cameras_of_frames
from app.features.recordings.link_values import (
    LinkedShot,
    LinkTimeMap,
    RayMiss,
    make_link_etag,
    make_link_time_map,
    parse_linked_shots,
)
from app.features.recordings.links import (
    compute_instant_times,
    compute_link_residuals,
    get_link,
    log_link_event,
    read_link_times,
    require_link,
    save_link_time_map,
)
from app.features.recordings.service import Recording, find_group_ids_by_frame, get_recording
from app.features.tracks.service import list_tracks, read_track_detail
from app.formats.report import ReaderReport
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.progress import ReportProgress
from app.tracking.ball_rays import BallRays, build_ball_rays
from app.tracking.link import explain_by_half_turn, fit_time_map, measure_ray_distances
from app.wording import plural
from app.worker_process import WorkerEnded, WorkerLimits

KIND = "link"
SURE_M = 0.5
"""Largest sigma of a track's ball that is looked for in the replay."""
_BATCH = 100
_Seen = tuple[tuple[float, float], Camera | None]
"""Pixel of the ball, and the camera of its view where that has one of its own."""


@dataclass(frozen=True)
class LinkByBallResult:
    """What became of a link that was sought from the ball.

    Attributes:
        link: Its id.
        recording: Id of the recording of its live shot.
        outcome: That of its map.
        reason: Why the ball does not tell the times; None: it does.
        rays: Frames of the live shot and of the replay whose ball has a camera.
        left_out: Frames of both shots whose ball has none, and rows that cannot be read.
    """

    link: int
    recording: int
    outcome: str
    reason: str | None
    rays: tuple[int, int]
    left_out: int


def request_link_by_ball(
    jobs: Jobs,
    store: Store,
    recording_id: int,
    link_id: int,
    uploads: Mapping[str, str | None],
    *,
    actor: str,
) -> Job:
    """Find the times of a link from the ball, soon.

    Args:
        jobs: Carries it out.
        store: The database.
        recording_id: One of its recordings.
        link_id: Which.
        uploads: Ids of the uploads of ``ball.csv`` of ``live`` and ``replay``; None: the balls of groups.
        actor: Who wants it.

    Raises:
        NotFoundError: There is no such link or upload.
    """
    link = get_link(store, recording_id, link_id)
    for upload in uploads.values():
        if upload is not None:
            find_complete_upload_path(store.settings, upload)
    return jobs.submit(
        KIND,
        f"Link frames {link.replay.first} to {link.replay.last} of {link.replay.name} by the ball",
        partial(run_link_by_ball_job, store),
        dataset_id=link.dataset_id,
        actor=actor,
        request={"recording": recording_id, "link": link_id, "uploads": dict(uploads)},
    )


def run_link_by_ball_job(store: Store, progress: JobProgress) -> Json:
    """The work itself; its result says what the ball told."""
    asked, settings = progress.job.request, store.settings
    limits = WorkerLimits(settings.import_memory, settings.import_seconds, SILENCE)
    progress(0, None, "Looking for the times under which the rays of the ball meet.")
    with leave_work_to_next_server(progress):
        try:
            found = run_in_worker(
                store,
                "recordings",
                link_by_ball,
                asked["recording"],
                asked["link"],
                asked["uploads"],
                progress.job.actor,
                limits=limits,
                progress=progress,
                stop=progress.check,
            )
        except WorkerEnded as error:
            raise TooLargeError(
                f"the search for the offset and speed of the replay {error}",
                hint="Link two frames by hand, or try it again.",
            ) from error
    return asdict(found)


def register_link_by_ball_jobs(jobs: Jobs, store: Store) -> None:
    """Let what an earlier server was at begin again."""
    jobs.register_resume(KIND, partial(run_link_by_ball_job, store))


def link_by_ball(
    store: Store,
    recording_id: int,
    link_id: int,
    uploads: Mapping[str, str | None],
    actor: str,
    _progress: ReportProgress,
) -> LinkByBallResult:
    """Find the map of a link from the ball, near its instants, and keep it; in a worker process.

    Where the ball does not tell it, a map of instants stays, with the reason beside it.

    Raises:
        ConflictError: Somebody changed the link meanwhile, or an index is gone.
        DatasetFormatError: A file is no ``ball.csv``.
        InputError: A shot has no frame with a ball and a camera.
        NotFoundError: There is no such link or upload.
    """
    with store.read() as session:
        row = require_link(session, recording_id, link_id)
    live, replay = parse_linked_shots(row)
    live_times, times = read_link_times(store.settings, row)
    report = ReaderReport()
    sides = [
        _collect_ball_rays(store, shot, seconds, (live, replay), uploads.get(name), report, link_id)
        for name, shot, seconds in (("live", live, live_times), ("replay", replay, times))
    ]
    (live_rays, live_left), (rays, replay_left) = sides
    before = get_link(store, recording_id, link_id)
    pairs = [(one.live, one.replay) for one in before.instants]
    given = compute_instant_times(row, pairs, live_times, times)
    found = explain_by_half_turn(fit_time_map(live_rays, rays, given), live_rays, rays, given)
    reason = None if found.pieces else found.reason
    if reason is None:
        made = make_link_time_map(found, replay, times, "ball")
        at, misses = measure_ray_distances(live_rays, rays, found)
        frames = replay.first + np.searchsorted(times, at)
        each = zip(frames.tolist(), misses.tolist(), strict=True)
        made = replace(made, misses=tuple(RayMiss(*one) for one in each))
    elif before.map.is_usable and before.map.found_by == "instants":
        made = replace(before.map, ball_reason=reason, turned=found.turned)
    else:
        made = LinkTimeMap("unobservable", "ball", reason, miss_m=found.miss, turned=found.turned)
    with store.write() as session:
        present = require_link(session, recording_id, link_id)
        if make_link_etag(present) != make_link_etag(row):
            raise ConflictError(
                "somebody changed this link while its time map was computed",
                hint="Start it again: it uses the link as it is now.",
            )
        residuals = compute_link_residuals(made, given, live_times)
        if save_link_time_map(session, present, pairs, made, residuals):
            log_link_event(session, actor, "link found from the ball", present)
    left = live_left + replay_left + len(report.problems)
    return LinkByBallResult(
        link_id, live.recording, made.outcome, reason, (len(live_rays), len(rays)), left
    )


def _collect_ball_rays(
    store: Store,
    shot: LinkedShot,
    seconds: FloatArray,
    shots: Sequence[LinkedShot],
    upload: str | None,
    report: ReaderReport,
    link_id: int,
) -> tuple[BallRays, int]:
    """The rays of the ball in a shot, and how many of its frames with a ball have no camera."""
    if upload is None:
        seen = dict(_iterate_balls_of_groups(store, shot, shots))
    else:
        seen = _read_balls_from_file(store.settings, upload, report)
    inside = {number: one for number, one in seen.items() if number in shot.frames}
    recording = get_recording(store, shot.recording)
    places = (
        {}
        if upload or shot != shots[0]
        else read_tracked_ball_positions(store, recording, shot, link_id)
    )
    tracked = read_cameras_of_frames(store, recording, inside.keys() | places.keys())
    for number in places.keys() - inside.keys():
        frame = tracked.get(number)
        if frame is not None and frame.camera is not None:
            x, y = frame.camera.project(places[number][None])[0].tolist()
            if np.isfinite(x):
                inside[number] = ((x, y), frame.camera)
    rays, last = [], -1.0
    for number in sorted(inside):
        pixel, own = inside[number]
        frame = tracked.get(number)
        camera = own if frame is None or frame.camera is None else frame.camera
        time = float(seconds[number - shot.first])
        # Frames that are shown at once have one time.
        if camera is not None and time > last:
            rays.append((time, pixel, camera))
            last = time
    if not rays:
        where = "in their groups" if upload is None else "in the file"
        frames = f"frames {shot.first} to {shot.last} of {shot.name}"
        if not inside:
            raise InputError(
                f"{frames} have no ball {where}",
                hint="Mark the ball in frames of the shot that have a camera, or send a ball.csv.",
            )
        raise InputError(
            f"{frames} have {plural(len(inside), 'ball')} {where}, but no camera in any of those frames",
            hint="Track the camera of the shot, or mark the ball in frames that have a camera.",
        )
    rays_found = build_ball_rays(*(list(column) for column in zip(*rays, strict=True)))
    return rays_found, len(inside) - len(rays)


def read_tracked_ball_positions(
    store: Store, recording: Recording, shot: LinkedShot, link_id: int
) -> dict[int, FloatArray]:
    """Where tracks put the ball in frames of a shot, pitch frame, metres, shape (3,), by frame.

    Tracks that were rejected or are stale say nothing, nor do those in which a view of the link takes part: their
    times come from it.
    """
    found: dict[int, FloatArray] = {}
    for track in list_tracks(store, recording.dataset_id):
        overlaps = track.first <= shot.last and shot.first <= track.last
        if track.match != recording.name or not overlaps or track.stale or track.summary.reason:
            continue
        if track.verdict == "rejected":
            continue
        try:
            detail = read_track_detail(store, track.id)
        except NotFoundError:
            # Deleted since it was listed.
            continue
        if any(view.endswith(f" link {link_id}") for view in detail.inputs.measurements.view_names):
            continue
        known = np.isfinite(detail.ball.position).all(axis=1)
        known &= detail.ball.sigma <= SURE_M
        for row in np.flatnonzero(known):
            if (number := int(detail.ball.frames[row])) in shot.frames:
                found[number] = detail.ball.position[row]
    return found


def _read_balls_from_file(
    settings: Settings, upload: str, report: ReaderReport
) -> dict[int, _Seen]:
    """Where a ``ball.csv`` says that the ball is, by frame of its recording."""
    rows = read_ball_rows(
        find_complete_upload_path(settings, upload), get_upload(settings, upload).name, report
    )
    return {frame: (pixel, None) for frame, _, pixel in rows}


def _iterate_balls_of_groups(
    store: Store, shot: LinkedShot, shots: Sequence[LinkedShot]
) -> Iterator[tuple[int, _Seen]]:
    """Where groups that were taken from either shot have the ball in frames of one, with given cameras."""
    sha256 = get_recording(store, shot.recording).require_readable()
    ids: set[int] = set()
    for number in {one.recording for one in shots}:
        ids |= set(find_group_ids_by_frame(store, get_recording(store, number)).values())
    wanted = sorted(ids)
    for start in range(0, len(wanted), _BATCH):
        with store.read() as session:
            stored = read_groups(session, wanted[start : start + _BATCH])
        for group in stored.values():
            for view in group.group.views:
                told: Any = (view.extras.metadata or {}).get("recording")
                if not isinstance(told, dict) or told.get("sha256") != sha256:
                    continue
                ball = view.ball if view.included else None
                if ball is not None and ball.center is not None and not ball.inferred:
                    yield told["frame"], ((ball.center.x, ball.center.y), view.station.given)
