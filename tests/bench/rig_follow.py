"""One click a stretch through real pictures of a static rig, in which ISSIA's annotated balls are painted.

ISSIA's own film is not in the data, but five seconds of cameras 1 and 2 at half their size are (`issia/media`): grass,
lines, a keeper, the noise and compression of these cameras, and no ball. Balls are painted there where ISSIA's
annotators clicked them, as large as the given camera says; what the follower finds is compared with these clicks.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np

from app.config import Settings
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import get_dataset
from app.features.groups.state import read_state
from app.features.imports.ingest import import_groups
from app.features.queue.service import list_ids
from app.features.recordings.follow import BallFollower
from app.features.solutions.service import solve_dataset
from app.features.tracks.follow import follow_ball_from_view
from app.formats.issia import DEFAULT_SIZE
from app.formats.issia_reader import IssiaOptions, open_issia
from app.formats.report import ReaderReport
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Media
from app.tracking.ball_follow import expected_ball_diameter
from app.video.frames import Image
from tests.bench.table import print_table
from tests.drawn_balls import drawn

FILM = "media/cam1_cam2_stacked.mp4"
CAMERAS = (1, 2)
BALL_NOISE = 3.0
LONGEST_BREAK = 3
"""Frames without a click within a stretch."""
LEAST = 40
"""Frames of a stretch that is followed."""
NEXT, STEP, CLICK_PX = 50, 20, 1.5
"""Frames to either side that are compared; between frames that a person tries; and how far clicks miss the centre."""


@dataclass
class Met:
    """What one click a stretch met.

    Attributes:
        asked: Annotated balls within ``NEXT`` frames of a click.
        off: How far what was followed is off, pixels of 1920 x 1080; and what is marked as uncertain.
    """

    clicks: int = 0
    asked: int = 0
    off: list[float] = field(default_factory=list)
    uncertain: list[float] = field(default_factory=list)

    def within(self, px: float) -> float:
        """Share of the balls asked for that were followed, unmarked, to within so many pixels."""
        return float(np.sum(np.array(self.off) <= px)) / max(self.asked, 1)

    @property
    def wrong(self) -> float:
        """Share of what was followed, unmarked, that is off by more than 5 px."""
        return float(np.mean(np.array(self.off) > 5)) if self.off else 0.0


def read_grounds(data: Path, camera: int) -> list[Image]:
    """The pictures of a camera without a ball, half as large as they were: there and back again is one film."""
    video, found = cv2.VideoCapture(str(data / FILM)), []
    while True:
        done, picture = video.read()
        if not done:
            break
        half = picture.shape[0] // 2
        found.append(picture[half * (camera - 1) : half * camera, :, ::-1].copy())
    video.release()
    return [*found, *found[-2:0:-1]]


def stretches_of(numbers: Collection[int]) -> list[list[int]]:
    """Frames that follow each other, with few of them missing."""
    found: list[list[int]] = []
    for number in sorted(numbers):
        if found and number - found[-1][-1] <= LONGEST_BREAK + 1:
            found[-1].append(number)
        else:
            found.append([number])
    return [one for one in found if len(one) >= LEAST]


def painted_groups(
    data: Path, folder: Path, camera: int, *, others: bool
) -> tuple[list[Group], dict[int, ImagePoint], list[list[int]]]:
    """Groups of a camera with painted pictures, in which no ball of this camera is annotated.

    Returns:
        The groups, where the ball is in each frame, and the stretches.
    """
    key, truth = f"cam{camera}", dict[int, ImagePoint]()
    groups = list(open_issia(data, IssiaOptions(), ReaderReport()).groups())
    for group in groups:
        view = group.view(key)
        if view is not None and view.ball is not None and view.ball.center is not None:
            truth[int(group.key)] = view.ball.center
    stretches = stretches_of(truth)
    wanted = {number for one in stretches for number in one}
    grounds, found = read_grounds(data, camera), []
    for group in groups:
        number = int(group.key)
        if number not in wanted:
            continue
        path = folder / key / f"{number:06d}.jpg"
        if not path.is_file():
            path.parent.mkdir(parents=True, exist_ok=True)
            lens = next(view.station.given for view in group.views if view.key == key)
            assert lens is not None
            at = truth[number]
            size = expected_ball_diameter(lens, at.x, at.y) or 13.0
            picture = painted(grounds[number % len(grounds)], at, size, number)
            cv2.imwrite(str(path), picture[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
        views = []
        for view in group.views:
            mine = view.key == key
            balls = view.balls if others and not mine else ()
            views.append(replace(view, balls=balls, media=Media(str(path)) if mine else None))
        found.append(replace(group, views=tuple(views)))
    return found, truth, stretches


def painted(ground: Image, at: ImagePoint, diameter: float, seed: int) -> Image:
    """A picture of half the size with a ball, shaded below as they are."""
    across, down = ground.shape[1] / DEFAULT_SIZE.width, ground.shape[0] / DEFAULT_SIZE.height
    x, y = (at.x + 0.5) * across - 0.5, (at.y + 0.5) * down - 0.5
    size, reach = diameter * across, int(2 * diameter * across) + 4
    left, top = max(int(x) - reach, 0), max(int(y) - reach, 0)
    found = ground.copy()
    part = found[top : int(y) + reach, left : int(x) + reach]
    shape, spot = (part.shape[1], part.shape[0]), (x - left, y - top)
    ball = drawn([(*spot, size)], size=shape, ground=part, noise=0).astype(float)
    rows = np.arange(shape[1])[:, None, None] - spot[1]
    shade = np.clip(1.0 - 0.35 * np.clip(rows / size, 0, 0.5) * 2, 0, 1)
    cover = (np.abs(ball - part).sum(axis=2) > 0)[..., None]
    ball = np.where(cover, ball * shade * 0.85, ball)
    ball += np.random.default_rng(seed).normal(0, BALL_NOISE, ball.shape) * cover
    found[top : int(y) + reach, left : int(x) + reach] = np.clip(ball, 0, 255).astype(np.uint8)
    return found


def follow_stretches(data: Path, folder: Path, camera: int, *, others: bool) -> Met:
    """Follow one click a stretch through the product, from its database on.

    Args:
        data: ISSIA's folder.
        folder: For pictures and a home.
        camera: Its number.
        others: Whether the other cameras' balls are annotated.
    """
    groups, truth, stretches = painted_groups(data, folder, camera, others=others)
    dice, met = np.random.default_rng(camera), Met()
    with closing(Store.open(Settings(home=folder / f"home-{camera}-{others}"))) as store:
        import_groups(store, "rig", groups, source="test", actor="test")
        solve_dataset(store, "rig")
        ids = list_ids(store, get_dataset(store, "rig").id).ids
        by_number = {int(group.key): one for group, one in zip(groups, ids, strict=True)}
        with closing(BallFollower(store.settings)) as frames:
            for stretch in stretches:
                _follow(store, frames, camera, stretch, by_number, truth, dice, met)
    return met


def _follow(
    store: Store,
    frames: BallFollower,
    camera: int,
    stretch: list[int],
    ids: Mapping[int, int],
    truth: Mapping[int, ImagePoint],
    dice: np.random.Generator,
    met: Met,
) -> None:
    """One click in the middle of a stretch, or as near to it as the ball can be told from what is around it."""
    middle = len(stretch) // 2
    for number in sorted(stretch, key=lambda one: abs(one - stretch[middle]))[::STEP]:
        with store.read() as session:
            view = read_state(session, ids[number]).view_ids[f"cam{camera}"]
        off = dice.normal(0, CLICK_PX, 2)
        at = ImagePoint(truth[number].x + off[0], truth[number].y + off[1])
        met.clicks += 1
        try:
            found = follow_ball_from_view(store, frames, view, at)
        except InputError:
            continue
        break
    else:
        return
    near = {one for one in ids if 0 < abs(one - number) <= NEXT}
    met.asked += len(near)
    for item in found.items:
        if item.frame in near:
            there = truth[item.frame]
            px = float(np.hypot(item.ball.x - there.x, item.ball.y - there.y))
            (met.off if item.ball.state == "followed" else met.uncertain).append(px)


def bench_rig_follow(data: Path) -> None:
    """Print how many of the next annotated balls one click meets."""
    table: list[list[object]] = []
    with tempfile.TemporaryDirectory() as folder:
        for camera in CAMERAS:
            for others in (False, True):
                met = follow_stretches(data, Path(folder), camera, others=others)
                table.append([
                    camera, "yes" if others else "no", met.clicks, met.asked, 100 * met.within(2), 100 * met.within(5),
                    100 * met.wrong, len(met.uncertain), float(np.median(met.off)), float(np.percentile(met.off, 95)),
                ])  # fmt: skip
    print_table(
        "Groups of a static rig: ISSIA's clicks painted into its own pictures",
        (
            "camera", "other views have balls", "clicks", f"balls within {NEXT} frames", "within 2 px %", "within 5 px %",
            "of followed, off by more %", "uncertain", "off px, median", "p95",
        ),
        table,
    )  # fmt: skip
