"""Following a ball from a click in a worker process, with what is known beside the pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from pathlib import Path
from threading import Lock
from typing import Any

from app.config import Settings
from app.db.store import Store
from app.errors import OverloadedError
from app.features.recordings.cameras import read_cameras_of_frames
from app.features.recordings.frame_boxes import read_detected_balls_in_frames
from app.features.recordings.index import read_index
from app.features.recordings.queries import list_views_of_video, read_predicted_boxes
from app.features.recordings.service import Recording
from app.media.frames import make_picture_error
from app.tracking.ball_follow import follow_ball
from app.tracking.ball_run import BallClick, BallRun, DetectedBall, FollowHints
from app.video.frames import Image, RecordingReader
from app.worker_pool import Explain, PoolTask, WorkerPool
from app.worker_process import COUNTS, WorkerEnded, WorkerLimits

LIMITS = WorkerLimits(memory=1536 * 2**20, processor=120.0, silence=120.0)
"""For one click."""
WAITING = 16
EACH_WAY = 250
"""Frames that a click is followed to either side: ten seconds."""
KEPT_BYTES, BEHIND = 160 * 2**20, 16
"""Of decoded frames; and how many are decoded together where it goes backwards."""


class BallFollower:
    """Follows balls in a worker process, which decodes."""

    def __init__(self, settings: Settings):
        self._settings = settings
        self._pool = WorkerPool(LIMITS, 1, WAITING, "balls", COUNTS["recordings"])
        self._lock = Lock()
        self._at_work: list[tuple[int, int]] = []

    @contextmanager
    def mark_frame_being_followed(self, recording_id: int, frame: int) -> Iterator[None]:
        """While a click in a frame of a recording is followed, and until what came of it is kept."""
        with self._lock:
            self._at_work.append((recording_id, frame))
        try:
            yield
        finally:
            with self._lock:
                self._at_work.remove((recording_id, frame))

    def list_frames_being_followed(self, recording_id: int) -> list[int]:
        """Frames of a recording whose clicks are being followed now."""
        with self._lock:
            return sorted(frame for recording, frame in self._at_work if recording == recording_id)

    def follow(
        self, recording: Recording, click: BallClick, bounds: tuple[int, int], hints: FollowHints
    ) -> BallRun | None:
        """The ball run from a click, None where there is none; waits for the process.

        Args:
            recording: Of which recording.
            click: Where the ball is.
            bounds: First and last frame of the shot.
            hints: What is known beside the pictures.

        Raises:
            OverloadedError: Too many wait, or the server is shutting down.
            ImageError: A frame cannot be decoded.
        """
        sha256 = recording.require_readable()

        def explain(error: WorkerEnded) -> Exception:
            return make_picture_error(f"{recording.name} around frame {click.frame}", error)

        asked = (recording.path, sha256, click, bounds, hints, self._settings)
        task = self.submit(follow_ball_in_recording, *asked, explain=explain)
        try:
            found: BallRun | None = task.future.result()
        except CancelledError as error:
            raise OverloadedError(
                "the server is shutting down", hint="Nothing was saved. Try it again in a moment."
            ) from error
        return found

    def submit(self, work: Callable[..., Any], *arguments: Any, explain: Explain) -> PoolTask:
        """Have a ball followed by a function of its own; ``explain`` says of what a process ended.

        Raises:
            OverloadedError: Too many wait.
        """
        return self._pool.submit(work, *arguments, explain=explain)

    def close(self) -> None:
        """End the process."""
        self._pool.close()


def follow_ball_in_recording(
    path: Path,
    sha256: str,
    click: BallClick,
    bounds: tuple[int, int],
    hints: FollowHints,
    settings: Settings,
) -> BallRun | None:
    """The work of the process."""
    reader = RecordingReader(path, read_index(settings, sha256), KEPT_BYTES)

    def read_frame(number: int) -> Image:
        if number < click.frame and not reader.has(number):
            # To decode forwards from a key frame costs as much for one frame as for those before it.
            for before in range(max(number - BEHIND, bounds[0]), number):
                reader.read(before)
        return reader.read(number)

    first, last = max(bounds[0], click.frame - EACH_WAY), min(bounds[1], click.frame + EACH_WAY)
    try:
        return follow_ball(
            read_frame,
            click,
            range(click.frame - 1, first - 1, -1),
            range(click.frame + 1, last + 1),
            hints,
        )
    finally:
        reader.close()


def collect_follow_hints(store: Store, recording: Recording, frames: range) -> FollowHints:
    """What is known of frames of a recording: cameras over time, and what detectors say."""
    found = read_cameras_of_frames(store, recording, frames)
    cameras = {number: one.camera for number, one in found.items() if one.camera is not None}
    detected = _read_detected_balls(store, recording, frames)
    for number, balls in read_detected_balls_in_frames(store.settings, recording, frames).items():
        detected[number] = (*detected.get(number, ()), *balls)
    return FollowHints(cameras, detected)


def _read_detected_balls(
    store: Store, recording: Recording, frames: range
) -> dict[int, tuple[DetectedBall, ...]]:
    """What detectors predicted in views of groups that show the frames."""
    with store.read() as session:
        shown = list_views_of_video(session, recording.dataset_id, recording.require_readable())
        rows = read_predicted_boxes(session, [view for view in shown if view.number in frames])
    return {
        number: tuple(
            DetectedBall(
                row.x + row.width / 2, row.y + row.height / 2, (row.width + row.height) / 2, row.score
            )
            for row in boxes
        )
        for number, boxes in rows.items()
    }  # fmt: skip
