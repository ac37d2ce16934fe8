"""Does sigma hold on real pictures? A tripod stands still, and no paint holds a crossbar (docs/uncertainty.md).

Of each pair of frames of a real clip the 95 % regions of the camera's position should meet: the
difference, by the sum of both covariances, within chi-square's 95 % for three numbers. Crossbars
are left out of everything that makes a camera; where people clicked them the camera predicts
them with its covariance. Frames of a clip that are drawn onto paint share the pitch that they show, as with ``snap
--tripod``, and as a dataset does for views of a match (cameras started by the same lines); stills have that of no other. ``python -m tests.bench.clips``; ``... N`` takes N frames of each clip
for the cameras that need no clicks.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

import cv2
import numpy as np
from scipy.stats import chi2

from app.config import Settings
from app.db.store import Store
from app.features.groups.submit import load_group_state
from app.features.imports.ingest import import_groups
from app.features.paint.service import read_paint_of_pictures
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import lines_from_json
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.geometry.resection import PARAMETERS, X, Z, parameters_from_camera, projection_jacobians
from app.paint.evidence import to_paint_evidence
from app.paint.frame_pitch import find_shared_pitch
from app.paint.grass import find_field_of_play
from app.paint.propose import propose_camera
from app.paint.snap import SnappedCamera, snap_camera
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER, TOUCHLINE, CalibrationPolicy
from app.solving.calibrate import calibrate
from app.solving.resect import REFERENCE_DIAGONAL
from tests.bench.table import print_table

MEETS = float(chi2.ppf(0.95, 3))
WITHIN = float(np.sqrt(chi2.ppf(0.95, 1)))
BAR_M, BAR_HALF_M = 2.50, 3.72
"""People click the middle of the bar: its height, and half its length between the posts' middles."""
CLICK_PX = 1.0
"""Standard deviation of a click on a bar, at 960 x 540."""
FRAMES = 5
PITCH = Pitch()


@dataclass(frozen=True)
class Known:
    """A camera and how well it is known."""

    camera: Camera
    covariance: FloatArray
    size: ImageSize
    snapped: SnappedCamera | None = None

    @property
    def sigma_m(self) -> float:
        """Largest standard deviation of the position, metres."""
        return float(np.sqrt(np.linalg.eigvalsh(self.covariance[X : Z + 1, X : Z + 1])[-1]))


@dataclass
class Found:
    """Cameras of one kind.

    Attributes:
        by_clip: By clip, frame by frame.
        off: Of each clicked point of a crossbar, pixels at 960 x 540.
        sigma: What the camera allows for it, with the click, alike.
    """

    by_clip: dict[str, list[Known]] = field(default_factory=dict)
    off: list[float] = field(default_factory=list)
    sigma: list[float] = field(default_factory=list)

    def row(self) -> list[object]:
        """Numbers of the table."""
        meets = [meet(*pair) for each in self.by_clip.values() for pair in combinations(each, 2)]
        sigmas = [known.sigma_m for each in self.by_clip.values() for known in each]
        off, sigma = np.abs(self.off), np.array(self.sigma)
        return [
            f"{sum(meets)} of {len(meets)}",
            100 * float(np.mean(meets)) if meets else None,
            float(np.median(sigmas)) if sigmas else None,
            len(off),
            100 * float((off < WITHIN * sigma).mean()) if len(off) else None,
            float(np.median(off)) if len(off) else None,
        ]


def bench_clips(data: Path, frames: int = FRAMES) -> None:
    """Print the table; says so where there are no clips."""
    folder = data / "broadcast"
    if not (folder / "clips").is_dir():
        print(f"\nSigma on real clips: no data in {data}, left out")
        return
    makers: Mapping[str, Callable[[np.ndarray, Lines | None], Known | None]] = {
        "clicks": _clicked,
        "clicks and paint (snap)": _snapped,
        "paint alone (propose)": _proposed,
    }
    found = {name: Found() for name in makers}
    seen: dict[tuple[str, str | None], list[tuple[Known, Lines]]] = {}
    drawn: dict[tuple[str, str], list[tuple[np.ndarray, Lines]]] = {}
    for clip, image, lines in pictures(folder, frames):
        for name, make in makers.items():
            known = make(image, lines)
            if known is not None:
                if clip is not None and known.snapped is not None:
                    start = (
                        _grass(lines) if make is _snapped and lines else _on_paint(known.snapped)
                    )
                    drawn.setdefault((name, clip), []).append((image, start))
                seen.setdefault((name, clip), []).append((known, lines or make_lines({})))
    for name in [*makers][1:]:
        views = {clip: each for (kind, clip), each in drawn.items() if kind == name}
        found[f"{name}, in a dataset"] = Found(in_a_dataset(views))
    for (name, clip), each in seen.items():
        cameras = [known for known, _ in each]
        if clip is not None:
            found[name].by_clip[clip] = cameras = share(cameras)
        for known, (_, lines) in zip(cameras, each, strict=True):
            for off, sigma in bar_errors(known, lines):
                found[name].off.append(off)
                found[name].sigma.append(sigma)
    header = (
        "cameras by", "pairs that meet", "%", "sigma m median", "bar points", "in 95 %",
        "px median",
    )  # fmt: skip
    rows = [[name, *each.row()] for name, each in found.items()]
    print_table("Sigma on real clips and crossbars", header, rows)


def share(cameras: list[Known]) -> list[Known]:
    """Frames of one clip with what they show together of their pitch."""
    painted = [known.snapped for known in cameras if known.snapped is not None]
    shared = find_shared_pitch(painted, PITCH, CalibrationPolicy()) if painted else None
    if shared is None or len(painted) < len(cameras):
        return cameras
    pairs = zip(cameras, shared[1], strict=True)
    return [replace(known, covariance=covariance) for known, covariance in pairs]


def in_a_dataset(
    clips: Mapping[str, Sequence[tuple[np.ndarray, Lines]]],
) -> dict[str, list[Known]]:
    """Cameras of a dataset that has each clip as a match, and each frame with its lines as a group of it."""
    names = [(clip, image, lines) for clip, each in clips.items() for image, lines in each]
    with tempfile.TemporaryDirectory() as place, closing(_store(Path(place) / "home")) as store:
        groups = []
        for number, (clip, image, lines) in enumerate(names):
            key, file = f"{number:03}", Path(place) / f"{number:03}.png"
            cv2.imwrite(str(file), image[:, :, ::-1])
            view = View(key, Station(key, _size(image), lines=lines), media=Media(str(file)))
            groups.append(Group(key, (view,), match=clip))
        import_groups(store, "clips", groups, source="frames", actor="bench")
        change_policy(store, "clips", TOUCHLINE, if_match=None, actor="bench")
        read_paint_of_pictures(store, "clips", actor="bench", workers=1)
        solve_dataset(store, "clips")
        found: dict[str, list[Known]] = {}
        for number, (clip, image, _) in enumerate(names, start=1):
            solution = load_group_state(store, number).solution
            calibration = None if solution is None else solution.views[0].calibration
            if calibration is None or calibration.camera is None or calibration.source != "paint":
                continue
            covariance = np.reshape(
                calibration.known_covariance_with_pitch, (PARAMETERS, PARAMETERS)
            )
            found.setdefault(clip, []).append(Known(calibration.camera, covariance, _size(image)))
        return found


def _store(home: Path) -> Store:
    return Store.open(Settings(home=home))


def _grass(lines: Lines) -> Lines:
    return make_lines({name: at for name, at in lines.items() if not name.startswith("Goal")})


def _on_paint(snapped: SnappedCamera) -> Lines:
    """What an accepted proposal draws."""
    return to_paint_evidence(snapped.evidence).thin_points()


def meet(one: Known, other: Known) -> bool:
    """Whether the 95 % regions of two positions meet."""
    apart = one.camera.position - other.camera.position
    both = (one.covariance + other.covariance)[X : Z + 1, X : Z + 1]
    return bool(apart @ np.linalg.solve(both, apart) < MEETS)


def bar_errors(known: Known, lines: Lines) -> Iterator[tuple[float, float]]:
    """Of each clicked point of a crossbar how far it lies across the bar, and the sigma of that."""
    half, unit = known.size.diagonal / 2, known.size.diagonal / REFERENCE_DIAGONAL
    for side, x in (("left", -PITCH.length / 2), ("right", PITCH.length / 2)):
        along = np.linspace(-BAR_HALF_M, BAR_HALF_M, 401)
        bar = np.column_stack([np.full(401, x), along, np.full(401, -BAR_M)])
        seen = known.camera.project(bar)
        for point in lines.get(f"Goal {side} crossbar", ()):
            place = np.array([point.x, point.y])
            nearest = int(np.nan_to_num(np.hypot(*(seen - place).T), nan=np.inf).argmin())
            way = np.diff(seen[[max(nearest - 1, 0), min(nearest + 1, 400)]], axis=0)[0]
            normal = np.array([-way[1], way[0]]) / np.hypot(*way)
            numbers = parameters_from_camera(known.camera, half)[None]
            rows = projection_jacobians(numbers, bar[[nearest]], np.array([half]))[0]
            variance = float(normal @ rows @ known.covariance @ rows.T @ normal)
            off = float((place - seen[nearest]) @ normal) / unit
            yield off, float(np.hypot(np.sqrt(variance) / unit, CLICK_PX))


def pictures(folder: Path, frames: int) -> Iterator[tuple[str | None, np.ndarray, Lines | None]]:
    """Frames of the clips, clicked ones among them, and clicked stills: clip, picture and lines."""
    for file in sorted((folder / "clips").glob("*.mp4")):
        clicked = {
            int(item.stem.rpartition("_f")[2]): item
            for item in (folder / "lines").glob(f"{file.stem}_f*.json")
        }
        for number, image in _decoded(file, frames, clicked):
            lines = _lines(clicked[number], image) if number in clicked else None
            yield file.stem, image, lines
    for file in sorted((folder / "lines").glob("*.json")):
        still = folder / "stills" / f"{file.stem}.png"
        if still.is_file():
            image = np.ascontiguousarray(cv2.imread(str(still))[:, :, ::-1])
            yield None, image, _lines(file, image)


def _decoded(file: Path, frames: int, clicked: Collection[int]) -> Iterator[tuple[int, np.ndarray]]:
    """Some frames of a clip. All are read: jumping to one may land beside it, and few clips know
    how many they hold."""
    video = cv2.VideoCapture(str(file))
    count = 0
    while video.grab():
        count += 1
    chosen = {*np.linspace(0, count - 1, frames).astype(int).tolist(), *clicked}
    video = cv2.VideoCapture(str(file))
    for number in range(count):
        if video.grab() and number in chosen:
            yield number, np.ascontiguousarray(video.retrieve()[1][:, :, ::-1])


def _lines(file: Path, image: np.ndarray) -> Lines:
    """Clicked lines without goals, but for the crossbars."""
    value = json.loads(file.read_text(encoding="utf-8"))
    return lines_from_json(value, _size(image), file.stem, ReaderReport())[0]


def _size(image: np.ndarray) -> ImageSize:
    return ImageSize(image.shape[1], image.shape[0])


def _clicked(image: np.ndarray, lines: Lines | None) -> Known | None:
    """The camera of the clicks on the grass."""
    if lines is None:
        return None
    found = calibrate(_grass(lines), PITCH, _size(image), PAPER.calibration)
    if found.camera is None or found.covariance is None:
        return None
    covariance = np.reshape(found.covariance, (PARAMETERS, PARAMETERS))
    return Known(found.camera, covariance, _size(image))


def _snapped(image: np.ndarray, lines: Lines | None) -> Known | None:
    start = _clicked(image, lines)
    if start is None:
        return None
    field = find_field_of_play(image)
    found = snap_camera(image, field, start.camera, start_covariance=start.covariance)
    if found.reason is not None or found.covariance is None:
        return None
    return Known(found.camera, found.covariance, start.size, found)


def _proposed(image: np.ndarray, lines: Lines | None) -> Known | None:
    found = propose_camera(image)
    if found.outcome != "proposed" or found.camera is None or found.snapped is None:
        return None
    if found.snapped.covariance is None:
        return None
    return Known(found.camera, found.snapped.covariance, _size(image), found.snapped)


if __name__ == "__main__":
    from tests.bench.__main__ import REAL_DATA

    bench_clips(REAL_DATA, int(sys.argv[1]) if len(sys.argv) > 1 else FRAMES)
