"""Views that contradict each other: other instants, swapped sides, small angles, and false alarms.

``python -m tests.bench.disagreement [GROUPS [SEED]]`` prints the tables.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.sample.cameras import find_camera, parallax_angle_at_ball
from app.sample.faults import FaultPlan, plant_annotation_fault
from app.sample.scene import Scene, ViewTruth
from app.sample.scenes import compute_true_ball_box, simulate_line_clicks, simulate_loose_box
from app.soccer.group import Group, View
from app.soccer.policy import PAPER
from app.soccer.solution import Calibration, Solution
from app.solving.calibrate import calibrate_station, compute_calibration_key
from app.solving.solve import solve_group
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS = 150
SEED = 7
SPEED = 15.0
"""Of the ball between two instants, metres a second."""
DELAYS_MS = (40, 80, 200)
WRONG_M = 0.5
"""A ball that is farther off than this is wrong."""
TELLING = frozenset({"views_contradict", "view_disagrees", "not_synchronous", "implausible_ball"})
"""Findings that say that the views do not show one ball."""
UNSURE = frozenset({"low_parallax", "high_uncertainty"})


@dataclass(frozen=True)
class Case:
    """A group whose truth is known.

    Attributes:
        group: As annotated.
        ball: The truth in the main camera's view, pitch frame, metres.
        view: Key of the view that carries the fault; None for an ordinary group.
    """

    group: Group
    ball: tuple[float, float, float]
    view: str | None = None


@dataclass(frozen=True)
class Judged:
    """A case with what the solver says of it."""

    case: Case
    solution: Solution

    @property
    def kinds(self) -> frozenset[str]:
        """Of the findings."""
        return frozenset(finding.kind for finding in self.solution.findings)

    @property
    def off_m(self) -> float:
        """Distance of the ball from the truth, metres; NaN without a ball."""
        if self.solution.ball is None:
            return float("nan")
        return float(np.linalg.norm(np.array(self.solution.ball.point) - self.case.ball))

    @property
    def wrong(self) -> bool:
        """It passes, and the ball is not where it was."""
        return self.solution.passes and self.off_m > WRONG_M


def ordinary(scenes: Sequence[Scene]) -> list[Case]:
    """The groups as they are."""
    return [Case(scene.group, scene.truth.ball) for scene in scenes]


def at_other_instants(scenes: Sequence[Scene], delay_ms: float, seed: int = SEED) -> list[Case]:
    """The groups with the first replay taken later: the ball has moved on, in any direction."""
    rng = np.random.default_rng([seed, round(1000 * delay_ms)])
    return [_later(rng, scene, delay_ms / 1000) for scene in scenes]


def swapped(scenes: Sequence[Scene]) -> list[Case]:
    """The groups with the lines of the first replay labelled from the other end."""
    cases = []
    for scene in scenes:
        main, replay, *rest = scene.group.views
        spoiled, _ = plant_annotation_fault(FaultPlan("swapped_sides", 1, 1), replay)
        group = replace(scene.group, views=(main, spoiled, *rest))
        cases.append(Case(group, scene.truth.ball, replay.key))
    return cases


def from_anywhere(
    scenes: Sequence[Scene], seed: int = SEED, degrees: tuple[float, float] = (0.0, 180.0)
) -> list[Scene]:
    """The scenes with replays from anywhere around the pitch, not from a broadcaster's seats.

    Args:
        degrees: Between which the angle at the ball to the main camera lies, for every replay.
    """
    rng = np.random.default_rng([seed, 0xA4])
    moved = (_from_anywhere(rng, scene, degrees) for scene in scenes)
    return [scene for scene in moved if scene is not None]


def _from_anywhere(
    rng: np.random.Generator, scene: Scene, degrees: tuple[float, float]
) -> Scene | None:
    ball = np.array(scene.truth.ball)
    main = scene.truth.views[0].camera.position
    views, truths = [scene.group.views[0]], [scene.truth.views[0]]
    for view in scene.group.views[1:]:
        camera = _camera_anywhere(rng, main, ball, degrees)
        if camera is None:
            return None
        box = compute_true_ball_box(camera, ball)
        station = replace(view.station, lines=simulate_line_clicks(rng, camera))
        views.append(replace(view, station=station, balls=(simulate_loose_box(rng, box),)))
        truths.append(ViewTruth(view.key, camera, scene.truth.ball, box))
    return replace(
        scene,
        group=replace(scene.group, views=tuple(views)),
        truth=replace(scene.truth, views=tuple(truths)),
    )


def _camera_anywhere(
    rng: np.random.Generator, main: FloatArray, ball: FloatArray, degrees: tuple[float, float]
) -> Camera | None:
    for _ in range(300):
        angle, far = rng.uniform(0, 2 * np.pi), rng.uniform(0.0, 40.0)
        reach = np.array([57.0 + far, 39.0 + far])
        seat = np.array([*(reach * (np.cos(angle), np.sin(angle))), -rng.uniform(1.7, 8 + far / 2)])
        if degrees[1] < 90:
            # Few seats see the ball from so near the main camera's side: turn about the ball.
            turn = np.radians(rng.uniform(*degrees)) * rng.choice([-1, 1])
            x, y, z = main - ball
            seat = ball + np.array(
                [x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z]
            )
            seat = seat + rng.normal(0, 1, 3)
        if (
            degrees[0] <= np.degrees(parallax_angle_at_ball(main, seat, ball)) < degrees[1]
            and seat[2] < -1.5
        ):
            camera = find_camera(rng, seat, ball, is_main=False)
            if camera is not None:
                return camera
    return None


def with_views(scenes: Sequence[Scene], count: int) -> list[Scene]:
    """The first views of each scene that has so many."""
    return [
        replace(scene, group=replace(scene.group, views=scene.group.views[:count]))
        for scene in scenes
        if len(scene.group.views) >= count
    ]


def judged(cases: Sequence[Case], known: dict[str, Calibration]) -> list[Judged]:
    """Every case solved; cameras that are known are not sought again."""
    for case in cases:
        for view in case.group.views:
            key = compute_calibration_key(view.station, case.group.pitch, PAPER.calibration)
            if key not in known:
                known[key] = calibrate_station(view.station, case.group.pitch, PAPER.calibration)
    return [Judged(case, solve_group(case.group, PAPER, known)) for case in cases]


def bench_disagreement(groups: int = GROUPS, seed: int = SEED) -> None:
    """The tables of what contradicts itself."""
    scenes = make_scenes(groups, seed, faults=False)
    known: dict[str, Calibration] = {}
    calm = judged(ordinary(scenes), known)
    print_table(
        f"Views of other instants, the ball at {SPEED:g} m/s, and ordinary groups",
        (
            "views",
            "apart",
            "groups",
            "pass",
            "wrong by > 0.5 m",
            "of these told",
            "share",
            "named",
            "delay held",
            "called swapped",
        ),
        [*_instants(scenes, known), _calm(calm)],
    )
    anywhere = from_anywhere(scenes)
    odd = judged(ordinary(anywhere), known)
    for name, stage, quiet in (
        ("seats of a broadcaster", scenes, calm),
        ("anywhere", anywhere, odd),
    ):
        print_table(
            f"One replay labelled from the other end; replays from {name}",
            (
                "views",
                "groups",
                "found",
                "share",
                "pass untold",
                "told in ordinary groups",
                "other",
            ),
            list(_swaps(stage, known, quiet)),
        )
    near = judged(ordinary(from_anywhere(with_views(scenes, 2), degrees=(5.0, 10.0))), known)
    for name, stage in (
        ("seats of a broadcaster", calm),
        ("anywhere", odd),
        ("near the main camera", near),
    ):
        print_table(
            f"Ordinary groups that pass, by angle; replays from {name}",
            (
                "parallax",
                "groups",
                "sigma m, median",
                "wrong by > 0.5 m",
                "of these told",
                "told",
                "in 95 %",
            ),
            list(_angles(stage)),
        )


def _instants(scenes: Sequence[Scene], known: dict[str, Calibration]) -> Iterator[list[object]]:
    for count in (2, 3, 4):
        chosen = with_views(scenes, count)
        for delay in DELAYS_MS:
            found = judged(at_other_instants(chosen, delay), known)
            wrong = [item for item in found if item.wrong]
            told = [item for item in wrong if item.kinds & TELLING]
            named = [
                item
                for item in told
                if any(
                    f.view == item.case.view for f in item.solution.findings if f.kind in TELLING
                )
            ]
            passing = sum(item.solution.passes for item in found)
            share = len(told) / max(1, len(wrong))
            held = [inside for item in found if (inside := _delay_held(item, delay)) is not None]
            swaps = sum("sides_swapped" in item.kinds for item in found)
            yield [
                count,
                f"{delay} ms",
                len(found),
                passing,
                len(wrong),
                len(told),
                share,
                len(named),
                f"{sum(held)} of {len(held)}",
                swaps,
            ]


def _delay_held(item: Judged, delay_ms: float) -> bool | None:
    """Whether the interval of the delay that is said holds the true one; None without one."""
    for finding in item.solution.findings:
        said = re.search(r"about \d+ ms \((\d+) to (\d+)\)", finding.sentence)
        if said is not None:
            return int(said[1]) <= delay_ms <= int(said[2])
    return None


def _calm(calm: Sequence[Judged]) -> list[object]:
    told = sum(bool(item.kinds & TELLING) for item in calm)
    passing = sum(item.solution.passes for item in calm)
    wrong = sum(item.wrong for item in calm)
    return ["2-4", "0 ms", len(calm), passing, wrong, told, told / len(calm), "", "", ""]


def _swaps(
    scenes: Sequence[Scene], known: dict[str, Calibration], calm: Sequence[Judged]
) -> Iterator[list[object]]:
    for count in (2, 3, 4):
        found = judged(swapped(with_views(scenes, count)), known)
        named = [item for item in found if _is_named(item)]
        silent = [
            item
            for item in found
            if item.solution.passes and not item.kinds & (TELLING | {"sides_swapped"})
        ]
        quiet = [item for item in calm if len(item.case.group.views) == count]
        alarms = sum("sides_swapped" in item.kinds for item in quiet)
        others = sum(bool(item.kinds & TELLING) for item in quiet)
        share = len(named) / max(1, len(found))
        yield [
            count,
            len(found),
            len(named),
            share,
            len(silent),
            f"{alarms} of {len(quiet)}",
            others,
        ]


def _is_named(item: Judged) -> bool:
    return any(
        finding.kind == "sides_swapped" and finding.view == item.case.view
        for finding in item.solution.findings
    )


def _angles(calm: Sequence[Judged]) -> Iterator[list[object]]:
    for low, high in ((0.0, 5.0), (5.0, 10.0), (10.0, 20.0), (20.0, 40.0), (40.0, 180.0)):
        inside = [
            item
            for item in calm
            if item.solution.passes
            and item.solution.ball is not None
            and low <= item.solution.ball.parallax_degrees < high
        ]
        if not inside:
            continue
        wrong = [item for item in inside if item.wrong]
        told = sum(bool(item.kinds & (TELLING | UNSURE)) for item in wrong)
        every = sum(bool(item.kinds & (TELLING | UNSURE)) for item in inside)
        sigma = float(np.median([item.solution.ball.sigma_m for item in inside]))  # type: ignore[union-attr]
        held = float(np.mean([_distance(item) < 7.815 for item in inside]))
        yield [f"{low:g}-{high:g}°", len(inside), sigma, len(wrong), told, every, held]


def _distance(item: Judged) -> float:
    ball = item.solution.ball
    assert ball is not None
    off: FloatArray = np.array(ball.point) - np.array(item.case.ball)
    return float(off @ np.linalg.solve(np.reshape(ball.covariance, (3, 3)), off))


def _later(rng: np.random.Generator, scene: Scene, seconds: float) -> Case:
    angle, rise = rng.uniform(0, 2 * np.pi), rng.uniform(-0.25, 0.25)
    way = np.array([np.cos(angle) * np.cos(rise), np.sin(angle) * np.cos(rise), np.sin(rise)])
    ball = np.array(scene.truth.ball) + SPEED * seconds * way
    ball[2] = min(ball[2], -PAPER.ball_diameter_m / 2)
    main, replay, *rest = scene.group.views
    moved = _seen(rng, scene, replay, ball)
    group = replace(scene.group, views=(main, moved, *rest))
    return Case(group, scene.truth.ball, replay.key)


def _seen(rng: np.random.Generator, scene: Scene, view: View, ball: FloatArray) -> View:
    truth = scene.truth.view(view.key)
    assert truth is not None
    return replace(
        view, balls=(simulate_loose_box(rng, compute_true_ball_box(truth.camera, ball)),)
    )


if __name__ == "__main__":
    bench_disagreement(*map(int, sys.argv[1:]))
