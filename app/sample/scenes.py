"""Scenes: the sample itself, group by group, the same for the same seed, with the clicks and boxes that people leave."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from app.formats.soccernet_v3 import IMAGE, group_label
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.sphere import tight_box
from app.sample.cameras import (
    FINE,
    HEIGHT,
    MIN_PARALLAX,
    PITCH,
    WIDTH,
    CameraPositions,
    Indices,
    choose_replay_position,
    find_camera,
    is_inside_image,
    parallax_angle_at_ball,
    place_cameras,
)
from app.sample.faults import (
    FaultPlan,
    choose_another_instant,
    choose_position_beside_main,
    plan_fault,
    plant_annotation_fault,
    remove_markings,
)
from app.sample.fixture import SampleMatch, make_sample_match
from app.sample.play import (
    BALL_DIAMETER,
    PLAYER_RADIUS,
    TEAM,
    Instant,
    choose_shirt_numbers,
    clear_lines_of_sight,
    make_instant,
)
from app.sample.scene import PlantedFault, Scene, SceneTruth, ViewTruth
from app.soccer.annotation import BallAnnotation, Extras, Lines, make_lines
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.pitch import CIRCLES, MARKINGS

CLICK_SIGMA = (0.6, 1.1)
"""Standard deviation of a click per axis, pixels at 1280 x 720; from careful to hasty views."""
CENTER_SIGMA_PX, CENTER_SIGMA_SHARE = 0.667, 0.04
"""Standard deviation of a ball box's centre per axis: pixels, and a share of the diameter."""
FORGOTTEN = 0.02
SHORTEST_PX = 0.5
FEWEST_KEPT = 6
BOX_EXCESS = (0.10, 0.40)
DECIMALS = 2
_IS_CIRCLE = np.array([name in CIRCLES for name in MARKINGS])
TAGS = "abcdefghijklmnopqrstuvwxyz"


def simulate_line_clicks(rng: np.random.Generator, camera: Camera) -> Lines:
    """Clicks on every marking in view, clipped at the image border.

    Straight markings get 2 to 8 points, circles 5 to 12, in any order now and then. A marking is
    forgotten rarely, and never one of the last six.
    """
    paths = find_visible_marking_paths(camera)
    markings = _drop_some_markings(rng, np.flatnonzero(paths.lengths >= SHORTEST_PX))
    owner, share = _draw_click_places(rng, markings, paths.lengths)
    clicks = paths.pixels_at(owner, share)
    clicks += rng.normal(0, rng.uniform(*CLICK_SIGMA), clicks.shape)
    points = clicks.round(DECIMALS).tolist()
    ends = np.searchsorted(owner, markings, side="right").tolist()
    starts = [0, *ends[:-1]]
    names = [MARKINGS[number] for number in markings]
    return make_lines({n: points[i:j] for n, i, j in zip(names, starts, ends, strict=True)})


@dataclass(frozen=True)
class VisibleMarkingPaths:
    """The parts of all markings that lie in the image, as short straight steps, in order.

    Attributes:
        starts: Pixels where each step begins, shape (N, 2); ``steps``: to its end, (N, 2).
        along: Length of all steps before each one, shape (N + 1,).
        lengths: Visible length of each of the 26 markings, pixels, shape (26,).
        before: Length of all markings before each one, shape (26,).
    """

    starts: FloatArray
    steps: FloatArray
    along: FloatArray
    lengths: FloatArray
    before: FloatArray

    def pixels_at(self, marking: Indices, share: FloatArray) -> FloatArray:
        """Pixels at a share (0 to 1) of the visible length of markings, shape (M, 2)."""
        place = self.before[marking] + share * self.lengths[marking]
        step = self._step_at_length(place)
        # At share 1 rounding may fall on the next marking's first step.
        step = np.clip(step, self._first_step(marking), self._last_step(marking))
        size = np.maximum(self.along[step + 1] - self.along[step], 1e-12)
        part = np.clip((place - self.along[step]) / size, 0.0, 1.0)
        places: FloatArray = self.starts[step] + part[:, None] * self.steps[step]
        return places

    def _first_step(self, marking: Indices) -> Indices:
        return self._step_at_length(self.before[marking] + 1e-9)

    def _last_step(self, marking: Indices) -> Indices:
        return self._step_at_length(self.before[marking] + self.lengths[marking] - 1e-9)

    def _step_at_length(self, place: FloatArray) -> Indices:
        return np.asarray(np.searchsorted(self.along, place, side="right") - 1, np.int64)


def find_visible_marking_paths(camera: Camera) -> VisibleMarkingPaths:
    """What each marking shows of itself, with its ends on the image border where it is cut."""
    pixels = camera.project(FINE.points)
    seen = is_inside_image(pixels)
    finite = ~np.isnan(pixels[:, 0])
    together = FINE.marking[1:] == FINE.marking[:-1]
    shown = together & (seen[1:] | seen[:-1]) & finite[1:] & finite[:-1]
    first = np.flatnonzero(shown)
    a, b = pixels[first], pixels[first + 1]
    enters, leaves = ~seen[first], ~seen[first + 1]
    a[enters] = _find_border_crossings(b[enters], a[enters])
    b[leaves] = _find_border_crossings(a[leaves], b[leaves])
    steps = b - a
    sizes = np.sqrt((steps**2).sum(axis=1))
    lengths = np.zeros(len(MARKINGS))
    np.add.at(lengths, FINE.marking[first], sizes)
    along = np.concatenate([[0.0], np.cumsum(sizes)])
    before = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    return VisibleMarkingPaths(a, steps, along, lengths, before)


def _find_border_crossings(inner: FloatArray, outer: FloatArray) -> FloatArray:
    """Where the ways from pixels in the image to pixels outside leave it, shape (N, 2)."""
    limit = np.array([WIDTH - 1.0, HEIGHT - 1.0])
    step = outer - inner
    edge = np.where(outer < 0, 0.0, limit)
    beyond = (outer < 0) | (outer > limit)
    share = np.where(beyond, (edge - inner) / np.where(beyond, step, 1.0), 1.0).min(axis=1)
    border: FloatArray = inner + share[:, None] * step
    return border


def _drop_some_markings(rng: np.random.Generator, markings: Indices) -> Indices:
    kept = rng.random(len(markings)) >= FORGOTTEN
    # A reader of the labels counts what is missing: no view shall lose more than a tenth.
    enough = kept.sum() >= max(FEWEST_KEPT, 0.9 * len(markings))
    return markings[kept] if enough else markings


def _draw_click_places(
    rng: np.random.Generator, markings: Indices, lengths: FloatArray
) -> tuple[Indices, FloatArray]:
    """Where people click: the marking of each click, and the share of its visible length."""
    circle = _IS_CIRCLE[markings]
    least, most = np.where(circle, 5, 2), np.where(circle, 12, 8)
    extra = rng.poisson(lengths[markings] / np.where(circle, 200.0, 260.0))
    counts = np.minimum(least + extra, most)
    total = int(counts.sum())
    index = np.arange(total) - np.repeat(np.cumsum(counts) - counts, counts)
    gaps = np.repeat(counts - 1, counts)
    jitter = rng.uniform(-0.3, 0.3, total) * ((index > 0) & (index < gaps))
    shuffled = np.repeat(rng.random(len(markings)) < np.where(circle, 0.4, 0.12), counts)
    key = np.where(shuffled, rng.random(total) * gaps, index)
    owner = np.repeat(markings, counts)
    return owner, ((index + jitter) / gaps)[np.lexsort((key, owner))]


def simulate_loose_box(rng: np.random.Generator, tight: Box) -> BallAnnotation:
    """A ball box as people draw it: 10 to 40 per cent too large and a little off centre."""
    grow = 1.0 + rng.uniform(*BOX_EXCESS)
    sides = np.array([tight.width, tight.height]) * grow * (1.0 + rng.uniform(-0.04, 0.04, 2))
    sigma = np.hypot(CENTER_SIGMA_PX, CENTER_SIGMA_SHARE * tight.diameter)
    center = np.array(tight.center) + rng.normal(0, sigma, 2)
    # The file holds both corners, so those are what is rounded.
    low, high = (center - sides / 2).round(DECIMALS), (center + sides / 2).round(DECIMALS)
    return BallAnnotation(box=Box(*map(float, (*low, *(high - low)))))


def make_person_tags(rng: np.random.Generator, instant: Instant) -> tuple[str, ...]:
    """The ID of each person in all views of a group: the shirt number, or a letter."""
    known = rng.random(len(instant.numbers)) < 0.7
    return tuple(
        str(number) if legible and number else TAGS[index]
        for index, (number, legible) in enumerate(zip(instant.numbers, known, strict=True))
    )


def make_person_boxes(
    rng: np.random.Generator, camera: Camera, instant: Instant, tags: tuple[str, ...]
) -> tuple[dict[str, Any], ...]:
    """Boxes of the people in view as SoccerNet-v3 keeps them, with class and ID."""
    corners = camera.project(_compute_person_corners(instant)).reshape(len(tags), -1, 2)
    low, high = corners.min(axis=1), corners.max(axis=1)
    limit = np.array([WIDTH - 1.0, HEIGHT - 1.0])
    low, high = np.clip(low, 0, limit), np.clip(high, 0, limit)
    with np.errstate(invalid="ignore"):
        seen = ((high - low) >= (4.0, 10.0)).all(axis=1)
    values = np.column_stack([low, high]) + rng.normal(0, 0.8, (len(tags), 4))
    return tuple(
        {
            "class": _person_class(index),
            "ID": tags[index],
            "points": dict(zip(("x1", "y1", "x2", "y2"), row, strict=True)),
        }
        for index, row in enumerate(values.round(DECIMALS).tolist())
        if seen[index]
    )


def _compute_person_corners(instant: Instant) -> FloatArray:
    """Eight corners of an upright box around each person, shape (8 * people, 3)."""
    signs = np.array([(sx, sy) for sx in (-1, 1) for sy in (-1, 1)]) * PLAYER_RADIUS
    ground = instant.feet[:, None] + signs
    low = np.concatenate([ground, np.zeros((*ground.shape[:2], 1))], axis=2)
    top = np.broadcast_to(-instant.height[:, None, None], (*ground.shape[:2], 1))
    return np.concatenate([low, np.concatenate([ground, top], axis=2)], axis=1).reshape(-1, 3)


def _person_class(index: int) -> str:
    # The home team defends the left goal, so SoccerNet calls it the left team.
    if index == 2 * TEAM:
        return "Main referee"
    side = "left" if index < TEAM else "right"
    return f"Goalkeeper team {side}" if index % TEAM == 0 else f"Player team {side}"


SIZE = ImageSize(WIDTH, HEIGHT)
REPLAY_COUNT_SHARE = (0.50, 0.3374, 0.1626)
"""One, two or three replays: 2.66 views a group, as SoccerNet-v3 has."""


@dataclass(frozen=True)
class CameraAtInstant:
    """One camera at one moment."""

    camera: Camera
    instant: Instant


@dataclass(frozen=True)
class MatchSetup:
    """What all groups of a match share."""

    fixture: SampleMatch
    rig: CameraPositions
    numbers: tuple[int, ...]
    seed: int
    groups: int


def make_match_scenes(
    match: int, groups: int, seed: int, faults: bool = True, numbers: Iterable[int] | None = None
) -> list[Scene]:
    """The scenes of one match, or some of them.

    Args:
        match: Number of the match, from 0.
        groups: How many groups it has.
        numbers: Which groups to make, all when None.
    """
    stage = make_match_setup(match, groups, seed)
    wanted = range(groups) if numbers is None else numbers
    return [_make_scene(stage, number, faults) for number in wanted]


def make_match_setup(match: int, groups: int, seed: int) -> MatchSetup:
    """What the groups of a match share: the same for the same seed."""
    rng = np.random.default_rng([seed, match, 0x21])
    return MatchSetup(
        make_sample_match(match, seed), place_cameras(rng), choose_shirt_numbers(rng), seed, groups
    )


def _make_scene(stage: MatchSetup, number: int, faults: bool) -> Scene:
    # Faults draw from their own stream, so that a scene without them is else the same.
    fault_rng = np.random.default_rng([stage.seed, stage.fixture.index, number, 0xFA])
    plan = plan_fault(fault_rng, _draw_replay_count(_scene_rng(stage, number)) + 1)
    return make_scene(stage, number, plan if faults else None)


def _scene_rng(stage: MatchSetup, number: int) -> np.random.Generator:
    return np.random.default_rng([stage.seed, stage.fixture.index, number])


def _draw_replay_count(rng: np.random.Generator) -> int:
    return 1 + int(rng.choice(3, p=REPLAY_COUNT_SHARE))


def make_scene(stage: MatchSetup, number: int, plan: FaultPlan | None) -> Scene:
    """One scene of a match, with the fault that somebody planned for it, or none.

    Args:
        stage: The match.
        number: Number of the group in its match, from 0; it decides all but the fault.
        plan: What shall be wrong with it.
    """
    rng = _scene_rng(stage, number)
    replays = _draw_replay_count(rng)
    shots, planted = _make_cameras_at_new_instant(rng, stage, replays, plan)
    keys = [f"{number}.png"] + [f"{number}_{index}.png" for index in range(1, replays + 1)]
    tags = make_person_tags(rng, shots[0].instant)
    metadata = {IMAGE: _make_image_metadata(rng, stage, number)}
    views = []
    truths = []
    for key, shot in zip(keys, shots, strict=True):
        box = compute_true_ball_box(shot.camera, shot.instant.ball)
        truths.append(ViewTruth(key, shot.camera, _to_triple(shot.instant.ball), box))
        station = Station(
            f"{stage.fixture.folder}/{key}", SIZE, lines=simulate_line_clicks(rng, shot.camera)
        )
        ball = simulate_loose_box(rng, box)
        people = make_person_boxes(rng, shot.camera, shot.instant, tags)
        views.append(View(key, station, (ball,), extras=Extras(people, metadata=metadata)))
    recorded = _make_planted_faults(plan, planted, keys)
    if plan is not None and plan.kind == "undrawn_line":
        views[plan.view_index], recorded = remove_markings(plan, views[plan.view_index])
    elif plan is not None and planted is None:
        views[plan.view_index], fault = plant_annotation_fault(plan, views[plan.view_index])
        recorded = (fault,)
    group = Group(
        key=f"{stage.fixture.folder}/{number}.png",
        views=tuple(views),
        match=stage.fixture.folder,
        pitch=PITCH,
        split=stage.fixture.split,
        label=group_label(stage.fixture.folder, keys[0], metadata[IMAGE]),
    )
    truth = SceneTruth(group.key, truths[0].ball, tuple(truths), recorded)
    instants = {key: shot.instant for key, shot in zip(keys, shots, strict=True)}
    return Scene(group, truth, stage.fixture, MappingProxyType(instants))


def _make_cameras_at_new_instant(
    rng: np.random.Generator, stage: MatchSetup, replays: int, plan: FaultPlan | None
) -> tuple[list[CameraAtInstant], float | None]:
    """Main camera and replays of a new moment, and the size of a fault of filming."""
    instant, main = _make_instant_and_main_camera(rng, stage)
    cameras = [main] + [_make_replay_camera(rng, stage, main, instant.ball) for _ in range(replays)]
    instants = [instant] * len(cameras)
    amount: float | None = None
    if plan is not None and plan.kind in ("tiny_baseline", "not_synchronous"):
        own = np.random.default_rng([plan.seed, 0xBAD])
        index = plan.view_index
        if plan.kind == "tiny_baseline":
            cameras[index], amount = _make_camera_beside_main(own, stage, main, instant.ball)
        else:
            cameras[index], instants[index], amount = _make_camera_at_other_instant(
                own, stage, main, instant
            )
    positions = np.array([camera.position for camera in cameras])
    cleared = clear_lines_of_sight(instant, positions)
    instants = [
        cleared if one is instant else clear_lines_of_sight(one, positions) for one in instants
    ]
    return [CameraAtInstant(c, i) for c, i in zip(cameras, instants, strict=True)], amount


def _make_instant_and_main_camera(
    rng: np.random.Generator, stage: MatchSetup
) -> tuple[Instant, Camera]:
    while True:
        instant = make_instant(rng, stage.numbers)
        # The main camera turns about its tripod; its lens moves a little with it.
        position = stage.rig.main + rng.normal(0, 0.05, 3)
        camera = find_camera(rng, position, instant.ball, is_main=True)
        if camera is not None:
            return instant, camera


def _make_replay_camera(
    rng: np.random.Generator, stage: MatchSetup, main: Camera, ball: FloatArray
) -> Camera:
    while True:
        _, seat = choose_replay_position(rng, stage.rig, ball)
        if parallax_angle_at_ball(main.position, seat, ball) < MIN_PARALLAX:
            continue
        camera = find_camera(rng, seat, ball, is_main=False)
        if camera is not None:
            return camera


def _make_camera_beside_main(
    rng: np.random.Generator, stage: MatchSetup, main: Camera, ball: FloatArray
) -> tuple[Camera, float]:
    while True:
        position, distance = choose_position_beside_main(rng, main.position)
        camera = find_camera(rng, position, ball, is_main=False)
        if camera is not None:
            return camera, distance


def _make_camera_at_other_instant(
    rng: np.random.Generator, stage: MatchSetup, main: Camera, instant: Instant
) -> tuple[Camera, Instant, float]:
    while True:
        _, seat = choose_replay_position(rng, stage.rig, instant.ball)
        moved, amount = choose_another_instant(rng, instant, main.position, seat)
        camera = find_camera(rng, seat, moved.ball, is_main=False) if amount > 0 else None
        if camera is not None:
            return camera, moved, amount


def _make_planted_faults(
    plan: FaultPlan | None, amount: float | None, keys: list[str]
) -> tuple[PlantedFault, ...]:
    if plan is None or amount is None:
        return ()
    return (PlantedFault(plan.kind, keys[plan.view_index], amount=amount),)


def _make_image_metadata(
    rng: np.random.Generator, stage: MatchSetup, number: int
) -> dict[str, Any]:
    """What SoccerNet-v3 says of each image; a replay carries the time of its action."""
    seconds = (number + float(rng.uniform(0.1, 0.9))) / stage.groups * 2 * 45 * 60
    half = 1 if seconds < 45 * 60 else 2
    in_half = seconds - (half - 1) * 45 * 60
    minutes, rest = divmod(int(in_half), 60)
    return {
        "width": WIDTH,
        "height": HEIGHT,
        "set": stage.fixture.split,
        "gameID": stage.fixture.index,
        "half": half,
        "gameTime": f"{half} - {minutes:02d}:{rest:02d}",
        "position": int(in_half * 1000),
    }


def compute_true_ball_box(camera: Camera, ball: FloatArray) -> Box:
    """The box that a careful annotator would draw, pixels.

    Args:
        ball: Centre, pitch frame, metres, shape (3,).
    """
    left, top, right, bottom = map(float, tight_box(camera, ball, BALL_DIAMETER / 2))
    return Box(left, top, right - left, bottom - top)


def _to_triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
