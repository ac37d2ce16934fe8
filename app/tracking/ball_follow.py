"""One click on a ball follows it through the frames of a shot, forwards and backwards.

Several histories of where it may have gone are kept beside each other, each with a score of how much the places
look like the ball and how smoothly it moves beside the background; what comes later decides between them. A place
that looked the same before the ball came there is clutter, and no history jumps to it for nothing.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.errors import ImageError
from app.geometry.arrays import BoolArray, FloatArray, IntArray
from app.geometry.camera import Camera
from app.tracking.ball_candidates import (
    STATIC_LAGS,
    BallCandidates,
    find_candidates,
    make_clicked_candidate,
    make_empty_candidates,
    reweight_by_other_views,
)
from app.tracking.ball_frames import (
    BallFrame,
    apply_homography,
    estimate_background_homography,
    invert_homography,
)
from app.tracking.ball_picture import (
    BallGreyConversion,
    BallSpot,
    Image,
    find_ball,
    find_similar_ball,
    fit_disc,
)
from app.tracking.ball_run import (
    BallClick,
    BallRun,
    End,
    FollowedBall,
    FollowHints,
    State,
)

BALL_M = 0.22
BEAM, DEEPEST = 24, 18.0
"""How many histories are kept, and how much worse than the best one they may be."""
REACH, LARGEST_ROI = 5.0, 420
"""How far a ball is kicked from one frame to the next, diameters; and how much of a picture is searched, pixels."""
KICKED = 0.04
"""Probability of a kick or bounce a frame."""
LEAD = 6
"""Frames between two clicks up to which both tell how the ball moves."""
MISSED = -2.0
"""Score of a frame in which the ball is not seen."""
MOST_MISSED = 24
"""Frames in a row without the ball after which it is lost."""
STATIC_SHARE, STATIC = 0.75, 5.0
"""A place that looked the same to this share a few frames before is clutter; what that costs."""
LOOK_AHEAD = 8
"""Frames that decide between histories, as far as a frame's confidence goes."""
CERTAIN = 0.5
"""Confidence below which a frame is uncertain."""
SAME = 0.7
"""Diameters within which two places are the same ball."""


def expected_ball_diameter(camera: Camera, x: float, y: float) -> float | None:
    """Of a ball that lies on the grass where a pixel looks, pixels; None where it looks at none.

    One in the air is nearer and larger.
    """
    ground = camera.project_to_ground(np.array([[x, y]]))[0]
    if not np.isfinite(ground).all() or np.hypot(*ground) > 150:
        return None
    depth = float(camera.pitch_to_camera(np.array([[*ground, -BALL_M / 2]]))[0, 2])
    return BALL_M * camera.focal_length[0] / depth if depth > 0 else None


def follow_ball(
    read: Callable[[int], Image | None],
    click: BallClick,
    before: Iterable[int],
    after: Iterable[int],
    hints: FollowHints | None = None,
    tell: Callable[[int], None] | None = None,
) -> BallRun | None:
    """Follow a ball from a click.

    Args:
        read: Gives a frame by its number: red green blue, shape (H, W, 3); None: nobody has it, and the ball goes on
            unseen. Clicked frames can be read.
        click: Where the ball is.
        before: Numbers of the frames before it, the nearest first.
        after: Numbers of the frames behind it, the nearest first.
        hints: What is known beside the pictures.
        tell: Called with frames done.

    Returns:
        None where nothing near the click looks like a ball.
    """
    hints = hints or FollowHints()
    number, x, y = click.frame, click.x, click.y
    image = _read_required_frame(read, number)
    camera = hints.cameras.get(number)
    expected = None if camera is None else expected_ball_diameter(camera, x, y)
    if hints.seen is None:
        found = find_ball(image, x, y, expected)
        if found is None:
            return None
        spot, colour = found
    else:
        spot, colour = _find_ball_by_appearance(
            _read_required_frame(read, hints.seen.frame), image, click, expected, hints
        )
    first = FollowedBall(number, spot.x, spot.y, spot.diameter, spot.sigma_px, 1.0, "followed")
    clicks = {one.frame: one for one in hints.clicks if one.frame != number} | {number: click}
    ways, ends = [], list[End]()
    done = 0
    sides = list(before), list(after)
    for wanted, behind in (sides, sides[::-1]):
        lead = _list_lead_in_frames(click, clicks, behind)
        begin = read(lead[0]) if lead else None
        if begin is None:
            start, at, begin, lead = click, spot, image, []
        else:
            start = clicks[lead[0]]
            at = replace(spot, x=start.x, y=start.y)
        way = _BallFollower(BallFrame.of(start.frame, begin, colour), at, hints, clicks)
        for each in lead[1:]:
            way.step(each, read(each), colour)
        end: End = "limit"
        for each in wanted:
            stopped = way.step(each, read(each), colour)
            done += 1
            if tell is not None:
                tell(done)
            if stopped is not None:
                end = stopped
                break
            if each in clicks:
                break
        balls = way.balls(max(len(lead) - 1, 0))
        goal = next((one for one in wanted if one in clicks), wanted[-1] if wanted else number)
        if end == "limit" and (balls[-1].frame if balls else number) != goal:
            # Its last frames do not show it.
            end = "lost"
        ways.append(balls)
        ends.append(end)
    return BallRun((click,), (*reversed(ways[0]), first, *ways[1]), *ends)


def _read_required_frame(read: Callable[[int], Image | None], number: int) -> Image:
    image = read(number)
    if image is None:
        raise ImageError(f"frame {number} cannot be read")
    return image


def _list_lead_in_frames(
    click: BallClick, clicks: Mapping[int, BallClick], behind: Sequence[int]
) -> list[int]:
    """Frames from the nearest other click behind a click to itself, which tell how the ball moves; empty without one.

    Args:
        click: Where the way begins.
        clicks: All, by frame.
        behind: Frames to the other side, the nearest first.
    """
    near = behind[:LEAD]
    place = next((at for at, frame in enumerate(near) if frame in clicks), None)
    return [] if place is None else [*reversed(near[: place + 1]), click.frame]


def _find_ball_by_appearance(
    other: Image, image: Image, click: BallClick, expected: float | None, hints: FollowHints
) -> tuple[BallSpot, BallGreyConversion]:
    """The ball at a click by how it looks in another frame, and at the click itself where it does not."""
    seen = hints.seen
    assert seen is not None
    colour, size = BallGreyConversion.of(other, seen.x, seen.y, seen.diameter), seen.diameter
    camera = hints.cameras.get(seen.frame)
    there = None if camera is None else expected_ball_diameter(camera, seen.x, seen.y)
    if expected is not None and there is not None:
        size *= expected / there
    return find_similar_ball(colour.to_grey(image), click.x, click.y, size), colour


@dataclass(frozen=True)
class _FrameHistories:
    """The histories that are kept at a frame, H of them.

    Attributes:
        places: Where each has the ball, shape (H, 2).
        parents: Which one of the frame before each continues, shape (H,).
        chosen: Which candidate each took, -1: none, shape (H,).
        scores: Of the whole histories, shape (H,).
    """

    number: int
    diameter: float
    places: FloatArray
    parents: IntArray
    chosen: IntArray
    scores: FloatArray
    candidates: BallCandidates


class _BallFollower:
    """Follows a ball one way, frame by frame."""

    def __init__(
        self,
        frame: BallFrame,
        spot: BallSpot,
        hints: FollowHints,
        clicks: Mapping[int, BallClick],
    ):
        self._last, self._hints, self._clicks = frame, hints, clicks
        self._diameter = spot.diameter
        self._places = spot.center[None]
        self._speeds = np.zeros((1, 2))
        self._missed = np.zeros(1, np.int64)
        self._ages = np.zeros(1, np.int64)
        self._scores = np.zeros(1)
        longest = max(STATIC_LAGS)
        self._trail: FloatArray = np.full((1, longest, 2), np.nan)
        self._earlier: deque[tuple[BallFrame, FloatArray]] = deque(maxlen=longest)
        self._steps: list[_FrameHistories] = []

    def step(self, number: int, image: Image | None, colour: BallGreyConversion) -> End | None:
        """Look at the next frame, or pass one that nobody has; returns why the way ends there."""
        still = self._hints.still or image is None
        if image is None:
            frame = replace(self._last, number=number)
        else:
            frame = BallFrame.of(number, image, colour)
        turn = (
            np.eye(3)
            if still
            else estimate_background_homography(self._last, frame, self._hints.cameras)
        )
        self._transform_to_frame(frame, turn)
        click = self._clicks.get(number)
        if image is None:
            candidates = make_empty_candidates()
        elif click is None:
            others = self._hints.expected.get(number, ())
            candidates = reweight_by_other_views(self._find_frame_candidates(frame), others)
        else:
            candidates = make_clicked_candidate(frame, self._diameter, click.x, click.y)
        self._extend_histories(frame, candidates)
        self._last = frame
        best = self._places[0]
        margin = self._diameter / 2
        if self._missed[0] and ((best < margin).any() or (best > frame.size - margin).any()):
            return "left"
        return "lost" if self._missed[0] > MOST_MISSED else None

    def _transform_to_frame(self, frame: BallFrame, turn: FloatArray) -> None:
        """Everything in pixels of the next frame."""
        self._earlier = deque(
            ((one, turn @ way) for one, way in [(self._last, np.eye(3)), *self._earlier]),
            maxlen=self._earlier.maxlen,
        )
        places = apply_homography(turn, self._places)
        ahead = apply_homography(turn, self._places + self._speeds)
        trail: FloatArray = np.concatenate([self._places[:, None], self._trail[:, :-1]], axis=1)
        self._trail = apply_homography(turn, trail.reshape(-1, 2)).reshape(trail.shape)
        one = np.array([[1.0, 0.0], [0.0, 1.0]])
        edge = apply_homography(turn, self._places[:1] + one) - places[:1]
        scale = float(np.sqrt(abs(np.linalg.det(edge))))
        self._diameter *= float(np.clip(scale, 0.9, 1.1))
        self._places, self._speeds = places, ahead - places
        camera = self._hints.cameras.get(frame.number)
        if camera is not None and (lies := expected_ball_diameter(camera, *places[0])) is not None:
            self._diameter = float(np.clip(self._diameter, 0.85 * lies, 1.8 * lies))

    def _find_frame_candidates(self, frame: BallFrame) -> BallCandidates:
        """The places that look most like the ball where histories may have gone."""
        size = self._diameter
        speed = np.hypot(*self._speeds.T)
        reach = size * REACH * (1 + 0.15 * self._missed) + 0.5 * speed * (1 + self._missed)
        ahead = self._predict_places()
        worth = self._scores > self._scores.max() - DEEPEST / 2
        centers = [*ahead[worth], *self._places[worth]]
        reaches = [*reach[worth], *np.full(int(worth.sum()), size * REACH)]
        both = np.array(centers), np.array(reaches)[:, None]
        low, high = (both[0] - both[1]).min(axis=0), (both[0] + both[1]).max(axis=0)
        middle = ahead[0]
        low = np.maximum(low, middle - LARGEST_ROI / 2).round()
        high = np.minimum(high, middle + LARGEST_ROI / 2).round()
        detected = self._hints.detected.get(frame.number, ())
        return find_candidates(
            frame, size, (low, high), self._list_motion_blurs(), detected, list(self._earlier)
        )

    def _predict_places(self) -> FloatArray:
        return np.asarray(self._places + self._speeds)

    def _list_motion_blurs(self) -> list[tuple[float, float]]:
        """How the ball may be smeared: not at all, or by its motion in the picture while the shutter is open."""
        best = self._places[0] + self._speeds[0]
        earlier = self._trail[0, 0]
        if not np.isfinite(earlier).all():
            return [(0.0, 0.0)]
        # In the picture, not beside the background.
        _, way = self._earlier[0]
        before = apply_homography(invert_homography(way), earlier[None])[0]
        moved = best - before
        far = float(np.hypot(*moved))
        if far < 0.8 * self._diameter:
            return [(0.0, 0.0)]
        angle = float(np.arctan2(moved[1], moved[0]) % np.pi)
        return [(0.0, 0.0), (round(min(0.4 * far, 3 * self._diameter)), round(angle / 0.2) * 0.2)]

    def _extend_histories(self, frame: BallFrame, found: BallCandidates) -> None:
        """Extend every history by every candidate and by none, and keep the best."""
        size, count = self._diameter, len(found.places)
        ahead, speed = self._predict_places(), np.hypot(*self._speeds.T)
        wait = 1.0 + self._missed
        spread = (0.15 * size + 0.4 + 0.12 * speed) * (1 + 0.6 * self._missed)
        spread = np.where(self._ages == 0, 2.0 * size, spread)
        off = found.places[None] - ahead[:, None]
        smooth = -0.5 * (off**2).sum(axis=2) / spread[:, None] ** 2
        smooth -= np.log(2 * np.pi * (spread / size) ** 2)[:, None]
        from_here = np.hypot(*(found.places[None] - self._places[:, None]).transpose(2, 0, 1))
        far = REACH * np.sqrt(wait)[:, None] + (speed * wait / size)[:, None]
        kicked = np.log(KICKED) - np.log(np.pi * far**2)
        kicked = kicked - 4.0 * np.maximum(from_here / size / far - 1, 0)
        moves = np.logaddexp(smooth, kicked)
        was_kicked = kicked > smooth
        # Where it looked the same before the history came there, it is not what the history follows.
        came = np.stack([self._trail[:, lag - 1] for lag in STATIC_LAGS], axis=1)
        away = np.hypot(*(found.places[None, :, None] - came[:, None]).transpose(3, 0, 1, 2))
        with np.errstate(invalid="ignore"):
            clutter = ((away > 1.5 * size) & (found.static[None] > STATIC_SHARE)).any(axis=2)
        total = self._scores[:, None] + moves + found.looks[None] - STATIC * clutter
        clicked = frame.number in self._clicks and count > 0
        unseen = self._scores + (-np.inf if clicked else MISSED)
        every = np.concatenate([total.ravel(), unseen])
        order = np.argsort(-every)[: 8 * BEAM]
        parents = np.where(order < total.size, order // max(count, 1), order - total.size)
        chosen = np.where(order < total.size, order % max(count, 1), -1)
        places = np.where(
            (chosen >= 0)[:, None],
            found.places[chosen] if count else ahead[parents],
            ahead[parents],
        )
        fresh = (places - self._places[parents]) / wait[parents, None]
        kick = np.array([c >= 0 and was_kicked[p, c] for p, c in zip(parents, chosen, strict=True)])
        kick |= self._ages[parents] == 0
        smoothed = self._speeds[parents] + 0.5 * (places - ahead[parents]) / wait[parents, None]
        speeds = np.where((kick & (chosen >= 0))[:, None], fresh, smoothed)
        kept = _select_distinct_histories(places, speeds, every[order], size)
        self._places, self._speeds = places[kept], speeds[kept]
        self._missed = np.where(chosen[kept] >= 0, 0, self._missed[parents[kept]] + 1)
        self._ages = self._ages[parents[kept]] + (chosen[kept] >= 0)
        self._trail = self._trail[parents[kept]]
        self._scores = every[order][kept]
        step = _FrameHistories(
            frame.number, size, self._places, parents[kept], chosen[kept], self._scores, found
        )
        self._steps.append(step)
        if (place := chosen[kept][0]) >= 0:
            self._update_diameter(found, int(place))

    def _update_diameter(self, found: BallCandidates, place: int) -> None:
        """The size follows what is seen, slowly."""
        spot = self._fit_candidate_disc(found, place, self._diameter)
        if spot is not None and spot.likeness > 0.6:
            share = np.clip(spot.diameter / self._diameter, 0.8, 1.25)
            self._diameter *= float(share**0.1)

    def _fit_candidate_disc(
        self, found: BallCandidates, place: int, size: float
    ) -> BallSpot | None:
        part, corner = found.parts[place]
        x, y = found.places[place] - corner
        smear, angle = found.smears[place]
        return fit_disc(part, float(x), float(y), size, float(smear), float(angle))

    def balls(self, skipped: int) -> list[FollowedBall]:
        """The frames of the best history, the nearest to the click first, as far as the ball was seen.

        Args:
            skipped: Frames before the click.
        """
        steps, rows = self._steps, list[int]()
        row = 0
        for step in reversed(steps):
            rows.append(row)
            row = int(step.parents[row])
        rows.reverse()
        seen = [step.chosen[row] >= 0 for step, row in zip(steps, rows, strict=True)]
        last = max((at for at, one in enumerate(seen) if one), default=-1)
        return [self._make_followed_ball(at, rows) for at in range(skipped, last + 1)]

    def _make_followed_ball(self, at: int, rows: Sequence[int]) -> FollowedBall:
        step, row = self._steps[at], rows[at]
        margin = self._compute_score_margin(at, rows)
        choice = int(step.chosen[row])
        spot = (
            None if choice < 0 else self._fit_candidate_disc(step.candidates, choice, step.diameter)
        )
        if choice < 0:
            x, y = step.places[row]
            size = step.diameter
            return FollowedBall(step.number, float(x), float(y), size, size, 0.1, "uncertain")
        looks = float(step.candidates.looks[choice])
        confidence = float(1 / (1 + np.exp(-(0.9 * looks + 0.5 * min(margin, 8.0) - 2.0))))
        state: State = "followed" if confidence >= CERTAIN else "uncertain"
        if spot is None:
            x, y = step.places[row]
            size = step.diameter
            return FollowedBall(
                step.number, float(x), float(y), size, 0.3 * size, confidence, state
            )
        corner = step.candidates.parts[choice][1]
        return FollowedBall(
            step.number, spot.x + float(corner[0]), spot.y + float(corner[1]), spot.diameter,
            spot.sigma_px, confidence, state,
        )  # fmt: skip

    def _compute_score_margin(self, at: int, rows: Sequence[int]) -> float:
        """How much better the best history is than those that have the ball elsewhere in a frame."""
        end = min(at + LOOK_AHEAD, len(self._steps) - 1)
        back = np.arange(len(self._steps[end].scores))
        scores = self._steps[end].scores
        for number in range(end, at, -1):
            back = self._steps[number].parents[back]
        step = self._steps[at]
        off = np.hypot(*(step.places[back] - step.places[rows[at]]).T)
        other = off > SAME * step.diameter
        mine = scores[~other]
        if not other.any() or not len(mine):
            return DEEPEST
        return float(mine.max() - scores[other].max())


def _select_distinct_histories(
    places: FloatArray, speeds: FloatArray, scores: FloatArray, size: float
) -> BoolArray:
    """Which histories are kept, the best first: those whose future is not that of a better one."""
    kept = np.zeros(len(places), bool)
    mine: list[int] = []
    for at in range(len(places)):
        if scores[at] < scores[0] - DEEPEST or len(mine) >= BEAM:
            break
        if mine:
            close = np.hypot(*(places[mine] - places[at]).T) < 0.3 * size
            alike = np.hypot(*(speeds[mine] - speeds[at]).T) < 0.4 * size + 0.5
            if (close & alike).any():
                continue
        kept[at] = True
        mine.append(at)
    return kept
