"""Frames alone, on pitches and in pictures of which nobody knows anything: does sigma hold there?

Half of the cameras are main cameras, half stand anywhere. What is asked is whether the 95 % ellipsoid of the
position holds the true one, and how many are far off with nothing said.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.geometry.camera import Camera
from app.soccer.pitch import LENGTH_RANGE, WIDTH_RANGE, Pitch
from app.soccer.policy import PAPER, CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import add_lone_frame_uncertainty, analyse_lone_frame, calibrate
from tests.bench.cases import SIZE, Case, _aimed, _clicks, _deformed, _place, _shows_enough
from tests.bench.table import print_table
from tests.bench.truth import INSIDE_95

FRAMES, SEED = 200, 20261201
FAR_M = 3.0
STADIUM_M = 1.5
"""How much the sizes of professional pitches differ."""
ASPECTS = (4 / 3, 3 / 4, 1.05, 0.95)
SHIFTS = (-0.25, -0.1, 0.1, 0.25)
POLICIES = {
    "exact": replace(PAPER.calibration, lone_frames="exact"),
    "any": replace(PAPER.calibration, lone_frames="any"),
    "any, markings": replace(PAPER.calibration, lone_frames="any", weighed="markings"),
}
KINDS = (
    "105 x 68 m",
    "professional pitches",
    "90-120 x 45-90 m",
    "stretched",
    "cropped",
)


@dataclass(frozen=True)
class Lone:
    """A frame alone and the camera that it was taken with."""

    calibration: Calibration
    camera: Camera


def bench_lone_frames() -> None:
    """Print a row for each kind of frame and policy."""
    rows: list[list[object]] = []
    for kind in KINDS:
        for name, policy in POLICIES.items():
            rows.append([f"{kind}, {name}", *_row([*lone_frames(kind, policy)])])
    header = (
        f"{FRAMES} frames alone",
        "cameras",
        "position in 95 %",
        f"> {FAR_M:g} m off",
        "of those nothing said",
        "sigma median m",
        "off median m",
    )
    print_table("Frames alone: truth inside 95 % where pitch or picture is another", header, rows)


def lone_frames(kind: str, policy: CalibrationPolicy, count: int = FRAMES) -> list[Lone]:
    """Frames of a kind, calibrated; those without a camera are left out."""
    found = []
    for number in range(count):
        rng = np.random.default_rng([SEED, number])
        case = _case(rng, kind)
        camera = _camera(rng, case, is_main=number % 2 == 0)
        lines = _clicks(rng, _deformed(camera, case), case)
        calibration = calibrate(lines, Pitch(), SIZE, policy)
        alone = analyse_lone_frame(calibration, lines, Pitch(), SIZE, policy)
        calibration = add_lone_frame_uncertainty(calibration, alone, Pitch())
        if calibration.camera is not None:
            found.append(Lone(calibration, _deformed(camera, case)))
    return found


def _case(rng: np.random.Generator, kind: str) -> Case:
    if kind == "professional pitches":
        return Case(kind, pitch=Pitch(*rng.normal((105.0, 68.0), STADIUM_M).tolist()))
    if kind == "90-120 x 45-90 m":
        return Case(kind, pitch=Pitch(rng.uniform(*LENGTH_RANGE), rng.uniform(*WIDTH_RANGE)))
    if kind == "stretched":
        return Case(kind, aspect=float(rng.choice(ASPECTS)))
    if kind == "cropped":
        return Case(kind, shift=float(rng.choice(SHIFTS)))
    return Case(kind)


def _camera(rng: np.random.Generator, case: Case, *, is_main: bool) -> Camera:
    while True:
        half = np.array([case.pitch.length, case.pitch.width]) / 2 - 4
        target = np.array([*rng.uniform(-half, half), -0.1])
        place = _place(rng, target, case.pitch, is_main=is_main)
        if place is None:
            continue
        camera = _aimed(rng, place, target)
        if _shows_enough(camera, case.pitch):
            return camera


def _row(frames: list[Lone]) -> list[object]:
    off = np.array([one.calibration.camera.position - one.camera.position for one in frames])
    inside, sigma, told = [], [], []
    for one, apart in zip(frames, off, strict=True):
        found = one.calibration
        told.append(bool(found.unobservable) or found.picture is not None)
        if found.covariance is None:
            inside.append(True)
            sigma.append(np.inf)
            continue
        spread = np.reshape(found.covariance, (8, 8))[3:6, 3:6]
        held = apart @ np.linalg.solve(spread, apart) < INSIDE_95
        inside.append(held)
        sigma.append(float(np.sqrt(np.trace(spread))))
    far = np.linalg.norm(off, axis=1)
    silent = (far > FAR_M) & ~np.array(inside) & ~np.array(told)
    return [
        len(frames),
        100 * float(np.mean(inside)),
        int((far > FAR_M).sum()),
        int(silent.sum()),
        float(np.median(sigma)),
        float(np.median(far)),
    ]


if __name__ == "__main__":
    bench_lone_frames()
