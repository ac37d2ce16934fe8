"""Ball runs: the frames through which a clicked ball was followed, and how another click mends them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.frames import Box

State = Literal["followed", "uncertain"]
End = Literal["lost", "left", "limit"]
UNSEEN_PX = 2.0
"""Standard deviation of a centre that a person clicked where nothing looks like a ball."""
SAME = 0.5
"""Diameters within which two places are those of one ball."""


@dataclass(frozen=True)
class BallClick:
    """Where a person said that the ball is.

    Attributes:
        frame: Number of the frame.
        x, y: Pixels of the recording.
    """

    frame: int
    x: float
    y: float


@dataclass(frozen=True)
class DetectedBall:
    """What a detector takes for the ball: pixels, and how sure it is, 0 to 1."""

    x: float
    y: float
    diameter: float
    score: float


@dataclass(frozen=True)
class ExpectedPlace:
    """Where another view says that the ball is: on a segment of the picture, or at a place, whose ends are one.

    Attributes:
        start, end: Pixels, (x, y).
        sigma_px: Standard deviation across it.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    sigma_px: float

    def distance_to(self, places: FloatArray) -> FloatArray:
        """How far places (N, 2) are from it, pixels, shape (N,)."""
        start, along = np.array(self.start), np.subtract(self.end, self.start)
        share = ((places - start) @ along) / max(float(along @ along), 1e-9)
        nearest = start + np.clip(share, 0.0, 1.0)[:, None] * along
        return np.asarray(np.hypot(*(places - nearest).T))


@dataclass(frozen=True)
class FollowHints:
    """What is known beside the pictures, by number of the frame.

    Attributes:
        cameras: They say how the background moves, and how large a ball is.
        still: Whether the camera stands still, so that the background never moves.
        detected: Candidates of a detector; they take part with their score, as others do.
        expected: Where other views of the same instant say that the ball is; each makes places there likelier.
        seen: The same ball in another frame, where a person clicked it: how it looks. A click that mends is the ball
            wherever it is; None: a click is refused where nothing looks like a ball.
        clicks: Other clicks on the same ball: it is there, whatever a frame looks like.
    """

    cameras: Mapping[int, Camera] = field(default_factory=dict)
    detected: Mapping[int, Sequence[DetectedBall]] = field(default_factory=dict)
    expected: Mapping[int, Sequence[ExpectedPlace]] = field(default_factory=dict)
    still: bool = False
    seen: FollowedBall | None = None
    clicks: Sequence[BallClick] = ()


@dataclass(frozen=True)
class FollowedBall:
    """The ball in one frame.

    Attributes:
        frame: Its number.
        x, y: Centre, pixels.
        diameter: Pixels.
        sigma_px: Standard deviation of the centre along each axis.
        confidence: Probability that it is the ball, 0 to 1.
        state: ``uncertain`` where that is low, or where it was not seen and lies between frames that show it.
    """

    frame: int
    x: float
    y: float
    diameter: float
    sigma_px: float
    confidence: float
    state: State

    @property
    def box(self) -> Box:
        """Its box, pixels, to a thousandth."""
        half, side = self.diameter / 2, round(self.diameter, 3)
        return Box(round(self.x - half, 3), round(self.y - half, 3), side, side)

    def is_same_ball(self, other: FollowedBall) -> bool:
        """Whether another place of the same frame is the same ball."""
        return float(np.hypot(self.x - other.x, self.y - other.y)) < SAME * self.diameter


@dataclass(frozen=True)
class BallRun:
    """The frames through which clicks were followed.

    Attributes:
        clicks: What people said, by frame.
        balls: Where the ball is, each frame once and in their order; frames between that have none are lost.
        before, after: Why there are no more to either side: the ball was ``lost`` or not seen in the last frames that
            were asked for, it ``left`` the picture, or no further frames were asked for (``limit``).
    """

    clicks: tuple[BallClick, ...]
    balls: tuple[FollowedBall, ...]
    before: End
    after: End

    @property
    def first(self) -> int:
        """Its first frame."""
        return self.balls[0].frame

    @property
    def last(self) -> int:
        """Its last frame."""
        return self.balls[-1].frame

    def count(self, state: State) -> int:
        """How many frames are in a state."""
        return sum(ball.state == state for ball in self.balls)

    def find_most_certain_click(self) -> FollowedBall | None:
        """The clicked ball that is seen best: before socks and boots another thing may stand for a ball near by."""
        clicked = {click.frame for click in self.clicks}
        mine = (ball for ball in self.balls if ball.frame in clicked)
        return min(mine, key=lambda ball: ball.sigma_px / ball.diameter, default=None)

    def merge_run(self, new: BallRun) -> BallRun:
        """The run with what one more click says.

        From the click to either side its frames take the place of those that were there, up to where both agree or
        an earlier click was. What lies behind, and was only followed from what is wrong, goes.
        """
        (click,) = new.clicks
        old = {ball.frame: ball for ball in self.balls}
        others = sorted(one.frame for one in self.clicks if one.frame != click.frame)
        earlier = max((frame for frame in others if frame < click.frame), default=None)
        later = min((frame for frame in others if frame > click.frame), default=None)
        there = {ball.frame: ball for ball in new.balls}
        down, before = _find_merge_frame(
            range(click.frame - 1, new.first - 1, -1), there, old, earlier
        )
        up, after = _find_merge_frame(range(click.frame + 1, new.last + 1), there, old, later)
        kept = [ball for ball in self.balls if _is_kept_frame(ball.frame, down, up)]
        taken = [
            ball
            for ball in new.balls
            if (down is None or ball.frame > down) and (up is None or ball.frame < up)
        ]
        if not before:
            kept = [ball for ball in kept if ball.frame > click.frame]
        if not after:
            kept = [ball for ball in kept if ball.frame < click.frame]
        frames = {ball.frame for ball in taken}
        balls = [*taken, *(ball for ball in kept if ball.frame not in frames)]
        clicks = [one for one in self.clicks if one.frame != click.frame]
        return BallRun(
            tuple(sorted([*clicks, click], key=lambda one: one.frame)),
            tuple(sorted(balls, key=lambda ball: ball.frame)),
            self.before if before else new.before,
            self.after if after else new.after,
        )


def _is_kept_frame(frame: int, down: int | None, up: int | None) -> bool:
    """Whether an old frame lies behind the places where the new ones end."""
    return (down is not None and frame <= down) or (up is not None and frame >= up)


def _find_merge_frame(
    frames: Iterable[int],
    new: Mapping[int, FollowedBall],
    old: Mapping[int, FollowedBall],
    click: int | None,
) -> tuple[int | None, bool]:
    """The frame from which on the old ones stay, going away from a click, and whether any do."""
    for frame in frames:
        if frame == click:
            return frame, True
        one, other = new.get(frame), old.get(frame)
        if one is None or other is None or "uncertain" in (one.state, other.state):
            continue
        if one.is_same_ball(other):
            return frame, True
    # A click of a person stays, and what was followed from it to the other side.
    return (click, True) if click is not None else (None, False)
