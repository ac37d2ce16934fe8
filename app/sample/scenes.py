"""Scenes: the sample itself, group by group, the same for the same seed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from app.formats.soccernet_record import IMAGE
from app.formats.soccernet_v3 import group_label
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.sphere import tight_box
from app.sample.annotate import click_lines, loose_box, person_boxes, person_tags
from app.sample.cameras import (
    MIN_PARALLAX,
    CameraStands,
    choose_replay_position,
    find_camera,
    parallax_angle_at_ball,
    place_cameras,
)
from app.sample.faults import (
    FaultPlan,
    another_instant,
    plan_fault,
    plant_annotation_fault,
    position_beside_main,
    remove_markings,
)
from app.sample.fixture import Fixture, make_fixture
from app.sample.instant import (
    BALL_DIAMETER,
    Instant,
    clear_lines_of_sight,
    make_instant,
    shirt_numbers,
)
from app.sample.scene import PlantedFault, Scene, SceneTruth, ViewTruth
from app.sample.views import HEIGHT, PITCH, WIDTH
from app.soccer.annotation import Extras
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Station, View

SIZE = ImageSize(WIDTH, HEIGHT)
REPLAY_COUNT_SHARE = (0.50, 0.3374, 0.1626)
"""One, two or three replays: 2.66 views a group, as SoccerNet-v3 has."""


@dataclass(frozen=True)
class Shot:
    """One camera at one moment."""

    camera: Camera
    instant: Instant


@dataclass(frozen=True)
class Stage:
    """What all groups of a match share."""

    fixture: Fixture
    rig: CameraStands
    numbers: tuple[int, ...]
    seed: int
    groups: int


def make_match(
    match: int, groups: int, seed: int, faults: bool = True, numbers: Iterable[int] | None = None
) -> list[Scene]:
    """The scenes of one match, or some of them.

    Args:
        match: Number of the match, from 0.
        groups: How many groups it has.
        numbers: Which groups to make, all when None.
    """
    stage = make_stage(match, groups, seed)
    wanted = range(groups) if numbers is None else numbers
    return [_make_scene(stage, number, faults) for number in wanted]


def make_stage(match: int, groups: int, seed: int) -> Stage:
    """What the groups of a match share: the same for the same seed."""
    rng = np.random.default_rng([seed, match, 0x21])
    return Stage(make_fixture(match, seed), place_cameras(rng), shirt_numbers(rng), seed, groups)


def _make_scene(stage: Stage, number: int, faults: bool) -> Scene:
    # Faults draw from their own stream, so that a scene without them is else the same.
    fault_rng = np.random.default_rng([stage.seed, stage.fixture.index, number, 0xFA])
    plan = plan_fault(fault_rng, _draw_replay_count(_scene_rng(stage, number)) + 1)
    return make_scene(stage, number, plan if faults else None)


def _scene_rng(stage: Stage, number: int) -> np.random.Generator:
    return np.random.default_rng([stage.seed, stage.fixture.index, number])


def _draw_replay_count(rng: np.random.Generator) -> int:
    return 1 + int(rng.choice(3, p=REPLAY_COUNT_SHARE))


def make_scene(stage: Stage, number: int, plan: FaultPlan | None) -> Scene:
    """One scene of a match, with the fault that somebody planned for it, or none.

    Args:
        stage: The match.
        number: Number of the group in its match, from 0; it decides all but the fault.
        plan: What shall be wrong with it.
    """
    rng = _scene_rng(stage, number)
    replays = _draw_replay_count(rng)
    shots, planted = _film_moment(rng, stage, replays, plan)
    keys = [f"{number}.png"] + [f"{number}_{index}.png" for index in range(1, replays + 1)]
    tags = person_tags(rng, shots[0].instant)
    metadata = {IMAGE: _image_metadata(rng, stage, number)}
    views = []
    truths = []
    for key, shot in zip(keys, shots, strict=True):
        box = true_ball_box(shot.camera, shot.instant.ball)
        truths.append(ViewTruth(key, shot.camera, _to_triple(shot.instant.ball), box))
        station = Station(
            f"{stage.fixture.folder}/{key}", SIZE, lines=click_lines(rng, shot.camera)
        )
        ball = loose_box(rng, box)
        people = person_boxes(rng, shot.camera, shot.instant, tags)
        views.append(View(key, station, (ball,), extras=Extras(people, metadata=metadata)))
    recorded = _record_fault(plan, planted, keys)
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


def _film_moment(
    rng: np.random.Generator, stage: Stage, replays: int, plan: FaultPlan | None
) -> tuple[list[Shot], float | None]:
    """Main camera and replays of a new moment, and the size of a fault of filming."""
    instant, main = _main_shot(rng, stage)
    cameras = [main] + [_aim_replay(rng, stage, main, instant.ball) for _ in range(replays)]
    instants = [instant] * len(cameras)
    amount: float | None = None
    if plan is not None and plan.kind in ("tiny_baseline", "not_synchronous"):
        own = np.random.default_rng([plan.seed, 0xBAD])
        index = plan.view_index
        if plan.kind == "tiny_baseline":
            cameras[index], amount = _aim_neighbour(own, stage, main, instant.ball)
        else:
            cameras[index], instants[index], amount = _film_other_moment(own, stage, main, instant)
    positions = np.array([camera.position for camera in cameras])
    cleared = clear_lines_of_sight(instant, positions)
    instants = [
        cleared if one is instant else clear_lines_of_sight(one, positions) for one in instants
    ]
    return [Shot(c, i) for c, i in zip(cameras, instants, strict=True)], amount


def _main_shot(rng: np.random.Generator, stage: Stage) -> tuple[Instant, Camera]:
    while True:
        instant = make_instant(rng, stage.numbers)
        # The main camera turns about its tripod; its lens moves a little with it.
        position = stage.rig.main + rng.normal(0, 0.05, 3)
        camera = find_camera(rng, position, instant.ball, is_main=True)
        if camera is not None:
            return instant, camera


def _aim_replay(rng: np.random.Generator, stage: Stage, main: Camera, ball: FloatArray) -> Camera:
    while True:
        _, seat = choose_replay_position(rng, stage.rig, ball)
        if parallax_angle_at_ball(main.position, seat, ball) < MIN_PARALLAX:
            continue
        camera = find_camera(rng, seat, ball, is_main=False)
        if camera is not None:
            return camera


def _aim_neighbour(
    rng: np.random.Generator, stage: Stage, main: Camera, ball: FloatArray
) -> tuple[Camera, float]:
    while True:
        position, distance = position_beside_main(rng, main.position)
        camera = find_camera(rng, position, ball, is_main=False)
        if camera is not None:
            return camera, distance


def _film_other_moment(
    rng: np.random.Generator, stage: Stage, main: Camera, instant: Instant
) -> tuple[Camera, Instant, float]:
    while True:
        _, seat = choose_replay_position(rng, stage.rig, instant.ball)
        moved, amount = another_instant(rng, instant, main.position, seat)
        camera = find_camera(rng, seat, moved.ball, is_main=False) if amount > 0 else None
        if camera is not None:
            return camera, moved, amount


def _record_fault(
    plan: FaultPlan | None, amount: float | None, keys: list[str]
) -> tuple[PlantedFault, ...]:
    if plan is None or amount is None:
        return ()
    return (PlantedFault(plan.kind, keys[plan.view_index], amount=amount),)


def _image_metadata(rng: np.random.Generator, stage: Stage, number: int) -> dict[str, Any]:
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


def true_ball_box(camera: Camera, ball: FloatArray) -> Box:
    """The box that a careful annotator would draw, pixels.

    Args:
        ball: Centre, pitch frame, metres, shape (3,).
    """
    left, top, right, bottom = map(float, tight_box(camera, ball, BALL_DIAMETER / 2))
    return Box(left, top, right - left, bottom - top)


def _to_triple(vector: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
