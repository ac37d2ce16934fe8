"""Cameras from paint: against the sample's truth, and on real frames where they are (docs/paint.md)."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import chi2

from app.config import Settings
from app.db.store import Store
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.paint.service import read_paint_of_pictures, summarize_paint_readings
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import lines_from_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera, rotation_from_pan_tilt_roll
from app.geometry.resection import parameters_from_camera
from app.paint.agreement import measure_agreement
from app.paint.grass import find_field_of_play
from app.paint.ridges import find_line_like_pixels
from app.paint.snap import SnappedCamera, snap_camera
from app.paint.view_paint import read_paint_of_image
from app.sample.render import render_view
from app.sample.scene import Scene
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media
from app.soccer.pitch import CIRCLES, MARKINGS, Pitch
from app.soccer.policy import PAPER, TOUCHLINE
from app.soccer.solution import Calibration, Solution
from app.solving.calibrate import calibrate, compute_calibration_key, measure_calibration
from app.solving.observations import make_observations
from app.solving.resect import ResectionProblem
from app.solving.solve import solve_group
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS, SEED = 36, 20261122
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
INSIDE_95 = float(chi2.ppf(0.95, 3))
WORSE_PX = 0.3
SHIFTS_PX = (8.0, 25.0, 60.0)
PITCH = Pitch()
GRASS = np.array(
    [(x, y, 0.0) for x in np.arange(-52.0, 53.0, 2.0) for y in np.arange(-34.0, 35.0, 2.0)]
)


@dataclass(frozen=True)
class Shot:
    """One view of the sample: picture, truth, clicks, and what paint made of them."""

    image: np.ndarray
    field: np.ndarray
    truth: Camera
    lines: Lines
    size: ImageSize
    clicked: Calibration
    snapped: SnappedCamera
    milliseconds: float
    solved: Calibration | None = None
    """Through a dataset: solved with what was kept of the picture."""


def bench_paint(data: Path) -> None:
    """Print every table."""
    shots: list[Shot] = []
    balls = []
    scenes = make_scenes(GROUPS, SEED, faults=False)
    solutions = _through_a_dataset(scenes)
    for scene, solution in zip(scenes, solutions, strict=True):
        seen = {
            key: replace(shot, solved=_calibration(solution, key)) for key, shot in shots_of(scene)
        }
        shots += seen.values()
        clicked, snapped, true = _balls(scene, seen)
        balls.append((clicked, snapped, _off(solution, scene), true))
    _print_sample(shots, np.array(balls))
    _print_detector(shots)
    if (data / "broadcast" / "lines").is_dir():
        _print_real(data / "broadcast")
    else:
        print(f"\nPaint of real frames: no data in {data}, left out")


def _through_a_dataset(scenes: Sequence[Scene]) -> list[Solution]:
    """Solutions of a dataset whose pictures were read, in the order of the scenes."""
    with tempfile.TemporaryDirectory() as place, closing(_opened(Path(place) / "home")) as store:
        groups = [_with_pictures(scene, Path(place), n) for n, scene in enumerate(scenes)]
        import_groups(store, "bench", groups, source="sample", actor="bench")
        change_policy(store, "bench", TOUCHLINE, if_match=None, actor="bench")
        began = time.perf_counter()
        read_paint_of_pictures(store, "bench", actor="bench")
        between = time.perf_counter()
        solve_dataset(store, "bench")
        spent = [between - began, time.perf_counter() - between]
        (item,) = summarize_paint_readings(store, "bench").items or (None,)
        print(f"\nThrough a dataset: {item.sentence if item else 'nothing'}")
        print(f"{spent[0]:.1f} s to read, {spent[1]:.1f} s to solve {len(groups)} groups")
        return [
            solution
            for number in range(1, len(groups) + 1)
            if (solution := load_group_state(store, number).solution) is not None
        ]


def _opened(home: Path) -> Store:
    return Store.open(Settings(home=home))


def _with_pictures(scene: Scene, folder: Path, number: int) -> Group:
    """The group with its pictures in a folder."""
    views = []
    for view in scene.group.views:
        file = folder / f"{number}_{view.key}.jpg"
        cv2.imwrite(str(file), render_view(scene, view.key), JPEG)
        views.append(replace(view, media=Media(str(file))))
    return replace(scene.group, key=f"{number:03}", match="bench", views=tuple(views))


def _calibration(solution: Solution, key: str) -> Calibration | None:
    found = solution.view(key)
    return None if found is None else found.calibration


def shots_of(scene: Scene) -> Iterator[tuple[str, Shot]]:
    """Each view of a scene that its clicks calibrate, with its key."""
    for view in scene.group.views:
        truth = scene.truth.view(view.key)
        found = calibrate(view.station.lines, PITCH, view.size, PAPER.calibration)
        if truth is None or found.camera is None:
            continue
        done, data = cv2.imencode(".jpg", render_view(scene, view.key), JPEG)
        assert done
        image = np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1])
        field, snapped, spent = _snap(image, found)
        yield (
            view.key,
            Shot(image, field, truth.camera, view.station.lines, view.size, found, snapped, spent),
        )


def _snap(image: np.ndarray, found: Calibration) -> tuple[np.ndarray, SnappedCamera, float]:
    assert found.camera is not None
    known = None if found.covariance is None else np.reshape(found.covariance, (8, 8))
    began = time.thread_time()
    field = find_field_of_play(image)
    snapped = snap_camera(image, field, found.camera, start_covariance=known)
    return field, snapped, 1000 * (time.thread_time() - began)


def _balls(scene: Scene, shots: dict[str, Shot]) -> tuple[float, float, float]:
    """Error of the ball with clicked, with snapped and with true cameras, metres."""
    group, known, true = scene.group, {}, {}
    for view in group.views:
        shot = shots.get(view.key)
        if shot is None:
            continue
        key = compute_calibration_key(view.station, group.pitch, PAPER.calibration)
        found = replace(shot.clicked, camera=shot.truth)
        true[key] = measure_calibration(found, view.station.lines, group.pitch, view.size)
        if shot.snapped.planned is not None:
            covariance = tuple(shot.snapped.planned.ravel().tolist())
            found = replace(shot.clicked, camera=shot.snapped.camera, covariance=covariance)
            known[key] = measure_calibration(found, view.station.lines, group.pitch, view.size)
    return (
        _ball_error(group, scene, {}),
        _ball_error(group, scene, known),
        _ball_error(group, scene, true),
    )


def _ball_error(group: Group, scene: Scene, known: dict[str, Calibration]) -> float:
    return _off(solve_group(group, PAPER, known), scene)


def _off(solution: Solution, scene: Scene) -> float:
    ball = solution.ball
    return (
        np.nan if ball is None else float(np.linalg.norm(np.subtract(ball.point, scene.truth.ball)))
    )


def _print_sample(shots: list[Shot], balls: FloatArray) -> None:
    rows = []
    fields = np.array([[field_error(c, s.truth, s.size) for c in _cameras(s)] for s in shots])
    places = np.array(
        [[np.linalg.norm(c.position - s.truth.position) for c in _cameras(s)] for s in shots]
    )
    for column, name in enumerate(("clicks", "clicks and paint", "through a dataset")):
        held = [_holds(shot, column) for shot in shots]
        rows.append(
            [
                name,
                *_two(fields[:, column]),
                *_two(places[:, column]),
                *_two(balls[:, column]),
                100 * float(np.mean([one for one in held if one is not None])),
            ]
        )
    rows.append(["true cameras", 0.0, 0.0, 0.0, 0.0, *_two(balls[:, 3]), None])
    header = (
        f"{len(shots)} sample views", "field px median", "p95", "position m median", "p95",
        "ball m median", "p95", "position in 95 %",
    )  # fmt: skip
    print_table("Snap against truth", header, rows)
    worse = fields[:, 1] > fields[:, 0] + WORSE_PX
    reasons = [shot.snapped.reason for shot in shots]
    times = [shot.milliseconds for shot in shots]
    apart = [moved for shot in shots if (moved := _apart(shot)) is not None]
    summary = [
        ["through a dataset, from snap's camera, sigmas: median", float(np.median(apart))],
        ["the same, p95", float(np.percentile(apart, 95))],
        ["the same, largest", float(np.max(apart))],
        ["through a dataset: cameras of their paint", len(apart)],
        [f"worse than its clicks by more than {WORSE_PX} px, without a reason", int(worse.sum())],
        ["clicks' camera kept: no_paint", reasons.count("no_paint")],
        ["clicks' camera kept: paint_disagrees", reasons.count("paint_disagrees")],
        ["ms a view (CPU, decoding left out), median", float(np.median(times))],
        ["ms a view, p95", float(np.percentile(times, 95))],
    ]
    print_table("Snap on the sample", ("what", "value"), summary)


def _cameras(shot: Shot) -> tuple[Camera, Camera, Camera]:
    clicked = shot.clicked.camera
    assert clicked is not None
    solved = None if shot.solved is None else shot.solved.camera
    return clicked, shot.snapped.camera, solved or clicked


def _apart(shot: Shot) -> float | None:
    """How far the dataset's camera is from that of snap, the most of its parameters, sigmas."""
    snapped, solved = shot.snapped, shot.solved
    if snapped.planned is None or solved is None or solved.source != "paint":
        return None
    assert solved.camera is not None
    half = shot.size.diagonal / 2
    one, other = (parameters_from_camera(item, half) for item in (snapped.camera, solved.camera))
    return float(np.abs((one - other) / np.sqrt(np.diag(snapped.planned))).max())


def field_error(camera: Camera, truth: Camera, size: ImageSize) -> float:
    """Median distance between both images of the grass in view, a point every 2 m, pixels."""
    true, found = truth.project(GRASS), camera.project(GRASS)
    x, y = true.T
    seen = (x >= 0) & (x < size.width) & (y >= 0) & (y < size.height) & np.isfinite(found[:, 0])
    return float(np.median(np.hypot(*(true - found)[seen].T))) if seen.any() else np.nan


def _holds(shot: Shot, column: int) -> bool | None:
    """Whether the 95 % ellipsoid of the position holds the truth."""
    found = (shot.clicked, None, shot.solved)[column]
    if column == 1:
        # The pitches of the sample are as planned.
        covariance = shot.snapped.planned
    else:
        known = None if found is None else found.covariance
        covariance = None if known is None else np.reshape(known, (8, 8))
    if covariance is None:
        return None
    off = _cameras(shot)[column].position - shot.truth.position
    return bool(off @ np.linalg.solve(covariance[3:6, 3:6], off) < INSIDE_95)


def _print_detector(shots: list[Shot]) -> None:
    """Agreement tells right cameras from shifted ones, and from those of wrong labels."""
    rng = np.random.default_rng(SEED)
    right, times = [], []
    kept = [found for shot in shots if (found := _agreement(shot.solved)) is not None]
    kept_wrong: list[float] = []
    wrong: dict[str, list[float]] = {f"turned by {px:g} px": [] for px in SHIFTS_PX}
    wrong["a label exchanged, labels trusted"] = []
    for shot in shots:
        began = time.thread_time()
        paint = find_line_like_pixels(shot.image, shot.field)
        middle = time.thread_time()
        right.append(measure_agreement(shot.truth, shot.field, paint).combined_score)
        times.append([1000 * (middle - began), 1000 * (time.thread_time() - middle)])
        for px in SHIFTS_PX:
            camera = _turned(shot.truth, px, rng)
            wrong[f"turned by {px:g} px"].append(
                measure_agreement(camera, shot.field, paint).combined_score
            )
        planted = _mislabelled(shot, rng)
        if planted is not None and planted.camera is not None:
            name = "a label exchanged, labels trusted"
            wrong[name].append(measure_agreement(planted.camera, shot.field, paint).combined_score)
            read = read_paint_of_image(shot.image, shot.size, planted, PITCH, PAPER.calibration)
            if read.supported is not None:
                kept_wrong.append(read.supported * (read.explained or 0.0))
    area = [[name, _roc_area(right, values), len(values)] for name, values in wrong.items()]
    name = "the same, as a dataset keeps it (snapped where the paint allows)"
    area.append([name, _roc_area(kept, kept_wrong), len(kept_wrong)])
    print_table("Agreement as a detector", ("against true cameras", "ROC area", "views"), area)
    median = np.median(times, axis=0)
    rows = [
        ["line-like paint, once a picture", float(median[0])],
        ["agreement of a camera", float(median[1])],
    ]
    print_table("Agreement, CPU time", ("what", "ms median"), rows)


def _agreement(found: Calibration | None) -> float | None:
    return None if found is None else found.agreement


def _roc_area(right: Sequence[float], wrong: Sequence[float]) -> float:
    return float((np.array(right)[:, None] > np.array(wrong)[None]).mean())


def _turned(camera: Camera, px: float, rng: np.random.Generator) -> Camera:
    """The camera panned and tilted so that its picture moves by so many pixels."""
    way = rng.normal(size=2)
    turn = way * px / camera.focal_length[0] / np.linalg.norm(way)
    pan, tilt, roll = np.radians(camera.pan_tilt_roll_degrees)
    return replace(
        camera, rotation=rotation_from_pan_tilt_roll(pan + turn[0], tilt + turn[1], roll)
    )


def _mislabelled(shot: Shot, rng: np.random.Generator) -> Calibration | None:
    """The calibration of clicks with one label exchanged for a free one, trusted as it stands."""
    straight = [name for name in shot.lines if name not in CIRCLES and not name.startswith("Goal")]
    free = [
        name
        for name in MARKINGS
        if name not in shot.lines and name not in CIRCLES and not name.startswith("Goal")
    ]
    if not straight or not free:
        return None
    old, new = str(rng.choice(straight)), str(rng.choice(free))
    lines = make_lines({new if name == old else name: at for name, at in shot.lines.items()})
    trusting = replace(PAPER.calibration, check_labels=False)
    return calibrate(lines, PITCH, shot.size, trusting)


def _print_real(folder: Path) -> None:
    """Distance of the clicks before and after, and of the paint, on frames of third parties."""
    rows: list[list[float]] = []
    reasons: list[str | None] = []
    for file in sorted((folder / "lines").glob("*.json")):
        image = _real_image(folder, file.stem)
        if image is None:
            continue
        size = ImageSize(image.shape[1], image.shape[0])
        value = json.loads(file.read_text(encoding="utf-8"))
        lines, _ = lines_from_json(value, size, file.stem, ReaderReport())
        found = calibrate(lines, PITCH, size, PAPER.calibration)
        if found.camera is None:
            continue
        _, snapped, spent = _snap(image, found)
        problem = ResectionProblem.of(size, PAPER.calibration)
        seen = make_observations(lines, PITCH, size)
        apart = [
            float(np.median(problem.distances(problem.parameters(camera), seen)))
            / problem.pixels_per_reference_pixel
            for camera in (found.camera, snapped.camera)
        ]
        error = (
            np.nan
            if snapped.error_px is None
            else snapped.error_px / problem.pixels_per_reference_pixel
        )
        rows.append([*apart, error, spent])
        reasons.append(snapped.reason)
    table = np.array(rows)
    kept = [reason for reason in reasons if reason is not None]
    print_table(
        f"Snap on {len(table)} real frames (px at 960 x 540)",
        ("what", "median", "p95"),
        [
            ["clicks from their own camera", *_two(table[:, 0])],
            ["clicks from the camera in use", *_two(table[:, 1])],
            ["paint from its marking", *_two(table[:, 2])],
            ["ms a frame (CPU, decoding left out)", *_two(table[:, 3])],
            [f"clicks' camera kept in {len(kept)}: {', '.join(sorted(set(kept)))}", None, None],
        ],
    )


def _real_image(folder: Path, stem: str) -> np.ndarray | None:
    still = folder / "stills" / f"{stem}.png"
    if still.is_file():
        picture = cv2.imread(str(still))
    else:
        clip, _, number = stem.rpartition("_f")
        video = cv2.VideoCapture(str(folder / "clips" / f"{clip}.mp4"))
        picture = None
        # Jumping to a frame of a compressed clip may land beside it.
        for _ in range(int(number) + 1 if number.isdigit() else 0):
            picture = video.read()[1]
        video.release()
    return None if picture is None else np.ascontiguousarray(picture[:, :, ::-1])


def _two(values: FloatArray) -> tuple[float, float]:
    return float(np.nanmedian(values)), float(np.nanpercentile(values, 95))


if __name__ == "__main__":
    from tests.bench.__main__ import REAL_DATA

    bench_paint(REAL_DATA)
