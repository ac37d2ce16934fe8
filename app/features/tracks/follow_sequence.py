"""A ball followed through the frames of a camera that stands still: what a worker process is given, and its work."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

from app.config import Settings
from app.errors import InputError
from app.geometry.camera import Camera
from app.media.camera_frames import CameraFrameReader, Image, ViewFrame, map_frames_by_number
from app.soccer.frames import ImageSize
from app.soccer.group import Media
from app.tracking.ball_follow import follow_ball
from app.tracking.ball_run import BallClick, BallRun, ExpectedPlace, FollowHints

MOST_STEP = 5
"""Frames from one to the next: within more of them a ball goes farther than it is looked for."""


UNSEEN = 24
"""Frames in a row that nobody has, beyond which there is no way on."""


FollowEnd = Literal["lost", "left", "known", "end", "limit"]


@dataclass(frozen=True)
class BallFollowInputs:
    """What a worker process needs to follow a ball.

    Attributes:
        views: Frames of views that show it, or may, in order.
        click: Where it is; the number of its frame is one of these.
        clicks: The nearest balls that people placed before and after.
        expected: Where other views say that it is, by frame.
        each_way: Frames to either side.
        ends: Why there are no views further on, before and after.
    """

    views: tuple[ViewFrame, ...]
    click: BallClick
    clicks: tuple[BallClick, ...]
    camera: Camera | None
    expected: Mapping[int, Sequence[ExpectedPlace]]
    size: ImageSize
    each_way: int
    ends: tuple[FollowEnd, FollowEnd]


@dataclass(frozen=True)
class FollowedSequence:
    """A run through a sequence, and why it ends; None: nothing near the click looks like a ball.

    ``unreadable`` are the frames that are there and could not be read.
    """

    run: BallRun | None
    before: FollowEnd = "lost"
    after: FollowEnd = "lost"
    unreadable: tuple[int, ...] = ()


def follow_ball_in_sequence(
    _: Media, flipped: bool, settings: Settings, asked: BallFollowInputs
) -> FollowedSequence:
    """The work of the process."""
    media = map_frames_by_number(asked.views, settings)
    frames = CameraFrameReader(media, flipped, asked.size, settings)
    click = asked.click
    _require_near_frame(media, click.frame)
    numbers = _fill_frame_gaps(sorted(media))
    before = [number for number in reversed(numbers) if number < click.frame]
    after = [number for number in numbers if number > click.frame]
    ways = before[: asked.each_way], after[: asked.each_way]
    cameras = {} if asked.camera is None else dict.fromkeys(numbers, asked.camera)
    hints = FollowHints(cameras, expected=asked.expected, still=True, clicks=asked.clicks)

    def read_frame(number: int) -> Image | None:
        # Without the clicked frame there is nothing to follow, and it is said why.
        return frames.read(number) if number == click.frame else frames.read_or_none(number)

    try:
        run = follow_ball(read_frame, click, *ways, hints)
    finally:
        frames.close()
    if run is None:
        return FollowedSequence(None)
    clicked = {one.frame for one in asked.clicks}

    def find_end_reason(
        why: FollowEnd, way: Sequence[int], every: Sequence[int], further: FollowEnd
    ) -> FollowEnd:
        if why != "limit":
            return why
        if clicked.intersection(way):
            return "known"
        return "limit" if len(way) < len(every) else further

    ends = asked.ends
    return FollowedSequence(
        run,
        find_end_reason(run.before, ways[0], before, ends[0]),
        find_end_reason(run.after, ways[1], after, ends[1]),
        frames.unreadable,
    )


def _require_near_frame(frames: Iterable[int], clicked: int) -> None:
    """Refuse frames so far apart that a ball in one says nothing of where it is in the next.

    Raises:
        InputError: All others are too far from the clicked one.
    """
    nearest = min((abs(number - clicked) for number in frames if number != clicked), default=0)
    if nearest > MOST_STEP:
        raise InputError(
            f"the nearest other frame of this camera is {nearest} frames away; a ball is followed"
            f" through frames that are at most {MOST_STEP} apart",
            hint="Put the files of the frames between beside those of the groups, or place each ball by hand.",
        )


def _fill_frame_gaps(numbers: Sequence[int]) -> list[int]:
    """Numbers of frames, and between them, in the usual step, those that nobody has: the ball goes on there, too."""
    step = min((b - a for a, b in pairwise(numbers)), default=1)
    found = set(numbers)
    for here, there in pairwise(numbers):
        missing = range(here + step, there, step)
        found |= set(missing[: UNSEEN + 1])
    return sorted(found)
