"""Cameras for frames alone: against the sample's truth, and on real frames where they are."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from app.geometry.camera import Camera
from app.geometry.polyline import distance_to_polyline
from app.paint.propose import FrameProposal, propose_camera
from app.sample.render import render_view
from app.soccer.annotation import Lines, make_lines
from app.soccer.frames import ImageSize
from app.soccer.pitch import Pitch, opposite_marking
from app.solving.jaccard import camera_jaccard, project_markings
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS, SEED = 36, 20261123
UNSEEN, UNSEEN_SEED, WIDTHS = 150, 20261207, (1280, 848, 480)
JPEG = [cv2.IMWRITE_JPEG_QUALITY, 85]
PITCH = Pitch()
GAMMA, RIGHT = 0.005, 0.75
"""A camera of the sample is right where JaC at this share of the diagonal is above 0.75; one of a
real frame where the median click of at least three quarters of its markings is that near."""

Image = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Tried:
    """One frame: its kind, what was proposed, whether it is right, processor and wall time."""

    kind: str
    found: FrameProposal
    right: bool | None
    processor_ms: float
    wall_ms: float


def bench_propose(data: Path) -> None:
    """Print the table; real frames where they are."""
    rows = [*_rows("sample", list(_sample())), *_rows("sample, match known", list(_known()))]
    rows += _rows("unseen", list(_unseen()))
    if (data / "broadcast" / "index.csv").is_file():
        rows += _rows("real", list(_real(data / "broadcast")))
        rows += _rows("real, 398 px wide", list(_real(data / "broadcast", 398)))
        rows += _rows("real, squeezed to 1024 x 1024", list(_real(data / "broadcast", 1024, 1024)))
    header = (
        "camera from a frame alone",
        "frames",
        "proposed %",
        "judged",
        "of those right %",
        "wall ms median",
        "wall ms p95",
        "CPU ms median",
    )
    rows.append(["edges and Hough lines of the same sample frames alone", *_reference()])
    print_table(
        "Propose: no annotation at all; right but for the half turn of the pitch", header, rows
    )


def _reference() -> list[object]:
    """What OpenCV needs for the lines of a frame, in the same run on the same machine."""
    wall, processor = [], []
    for _, _, image, _ in _shots():
        began, busy = time.perf_counter(), time.process_time()
        edges = cv2.Canny(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), 60, 160)
        cv2.HoughLinesP(edges, 1, np.pi / 360, 80, None, 60, 10)
        wall.append(1000 * (time.perf_counter() - began))
        processor.append(1000 * (time.process_time() - busy))
    middle, late = float(np.median(wall)), float(np.percentile(wall, 95))
    return [len(wall), None, None, None, middle, late, float(np.median(processor))]


def _rows(name: str, tried: list[Tried]) -> list[list[object]]:
    rows: list[list[object]] = []
    for kind in sorted({one.kind for one in tried}):
        some = [one for one in tried if one.kind == kind]
        proposed = [one for one in some if one.found.outcome == "proposed"]
        judged = [one.right for one in proposed if one.right is not None]
        rows.append(
            [
                f"{name}, {kind}",
                len(some),
                100 * len(proposed) / len(some),
                len(judged),
                100 * float(np.mean(judged)) if judged else None,
                float(np.median([one.wall_ms for one in some])),
                float(np.percentile([one.wall_ms for one in some], 95)),
                float(np.median([one.processor_ms for one in some])),
            ]
        )
    return rows


def _try(kind: str, image: Image, known: list[Camera]) -> tuple[FrameProposal, float, float]:
    began, busy = time.perf_counter(), time.process_time()
    found = propose_camera(image, known=known)
    return found, 1000 * (time.process_time() - busy), 1000 * (time.perf_counter() - began)


@cache
def _shots() -> list[tuple[str, str, Image, Camera]]:
    """Match, kind, picture and true camera of every view of a sample."""
    return list(_drawn())


def _drawn(groups: int = GROUPS, seed: int = SEED) -> Iterator[tuple[str, str, Image, Camera]]:
    for scene in make_scenes(groups, seed, faults=False):
        for index, view in enumerate(scene.truth.views):
            done, data = cv2.imencode(".jpg", render_view(scene, view.view), JPEG)
            assert done
            image = np.ascontiguousarray(cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :, ::-1])
            yield str(scene.group.match), "replays" if index else "main", image, view.camera


def _sample() -> Iterator[Tried]:
    for _, kind, image, true in _shots():
        found, processor, wall = _try(kind, image, [])
        yield Tried(kind, found, _agrees(found, true, image), processor, wall)


def _known() -> Iterator[Tried]:
    """Main cameras once more, with the one of the match's first group known."""
    first: dict[str, Camera] = {}
    for match, kind, image, true in _shots():
        if kind != "main":
            continue
        if match in first:
            found, processor, wall = _try(kind, image, [first[match]])
            yield Tried(kind, found, _agrees(found, true, image), processor, wall)
        first.setdefault(match, true)


def _unseen() -> Iterator[Tried]:
    """Main cameras that nothing was chosen on, a third of them in each width of ``WIDTHS``."""
    shots = (shot for shot in _drawn(UNSEEN, UNSEEN_SEED) if shot[1] == "main")
    for number, (_, kind, image, true) in enumerate(shots):
        width = WIDTHS[number % len(WIDTHS)]
        small = _resized(image, width)
        camera = true.scaled(width / image.shape[1], small.shape[0] / image.shape[0])
        found, processor, wall = _try(kind, small, [])
        yield Tried(kind, found, _agrees(found, camera, small), processor, wall)


def _resized(image: Image, width: int, height: int | None = None) -> Image:
    size = (width, height or round(image.shape[0] * width / image.shape[1]))
    return np.ascontiguousarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA))


def _agrees(found: FrameProposal, true: Camera, image: Image) -> bool | None:
    if found.outcome != "proposed" or found.camera is None:
        return None
    size = ImageSize(image.shape[1], image.shape[0])
    seen = make_lines(
        {name: points[::5].tolist() for name, points in project_markings(true, PITCH, size).items()}
    )
    gammas = (GAMMA * size.diagonal,)
    return camera_jaccard(found.camera, seen, PITCH, size, gammas, symmetric=True)[0] > RIGHT


def _real(folder: Path, width: int | None = None, height: int | None = None) -> Iterator[Tried]:
    """Real frames, resized to a width, or squeezed to a width and height."""
    for row in csv.DictReader((folder / "index.csv").read_text().splitlines()):
        path, names = folder / row["file"], row["clicked"].split()
        kind = row["camera"].split("-")[0]
        if path.suffix == ".mp4":
            frames = [(n, int(n.rpartition("_f")[2][:4])) for n in names if path.stem + "_f" in n]
        else:
            frames = [(names[0] if names else "", 0)]
        for name, number in frames:
            image = _picture(path, number)
            image = image if width is None else _resized(image, width, height)
            found, processor, wall = _try(kind, image, [])
            right = _near_clicks(found, folder / "lines" / name, image) if name else None
            yield Tried(kind, found, right, processor, wall)


def _picture(path: Path, number: int) -> Image:
    if path.suffix == ".mp4":
        video = cv2.VideoCapture(str(path))
        video.set(cv2.CAP_PROP_POS_FRAMES, number)
        done, picture = video.read()
        assert done
    else:
        picture = cv2.imread(str(path))
    return np.ascontiguousarray(picture[:, :, ::-1])


def _near_clicks(found: FrameProposal, lines: Path, image: Image) -> bool | None:
    if found.outcome != "proposed" or found.camera is None:
        return None
    size = ImageSize(image.shape[1], image.shape[0])
    clicked: Lines = make_lines(
        {
            name: [size.unit_to_pixel(point["x"], point["y"]) for point in points]
            for name, points in json.loads(lines.read_text()).items()
            if not name.startswith("Goal")
        }
    )
    turned = {opposite_marking(name): points for name, points in clicked.items()}
    return max(_near(found.camera, clicked, size), _near(found.camera, turned, size)) >= RIGHT


def _near(camera: Camera, lines: Lines, size: ImageSize) -> float:
    """Share of the clicked markings whose median click lies near their projection."""
    near = []
    for name, points in lines.items():
        polyline = camera.project(PITCH.sample(name, 0.3, 0.2))
        polyline = polyline[np.isfinite(polyline).all(axis=1)]
        apart = np.inf
        if len(polyline) > 1:
            apart = float(np.median(distance_to_polyline(np.array(points), polyline)[0]))
        near.append(apart < GAMMA * size.diagonal)
    return float(np.mean(near))


if __name__ == "__main__":
    from tests.bench.__main__ import REAL_DATA

    bench_propose(REAL_DATA)
