"""Is another size of the pitch proposed where ten frames of a match are looked at, and is it right?

A length or width that the frames do not show has to be unknown, never a number that is wrong.
"""

from __future__ import annotations

import numpy as np

from app.errors import DegenerateGeometryError
from app.geometry.arrays import FloatArray
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.pitch_size import PitchEstimate, PitchSizeFrameLines, estimate_pitch
from tests.bench.cases import SIZE, Case, _aimed, _clicks, _shows_enough
from tests.bench.table import print_table

MATCHES = 100
FRAMES = 10
SEED = 3000
NEAR_M = 0.3
CASES = (
    Case("105 x 68, as assumed"),
    Case("105 x 68, line errors half in common", together=0.5),
    Case("103 x 66", pitch=Pitch(103.0, 66.0)),
    Case("103 x 66, line errors half in common", pitch=Pitch(103.0, 66.0), together=0.5),
    Case("100 x 64", pitch=Pitch(100.0, 64.0)),
)


def bench_pitches() -> None:
    """Print a row for each case."""
    rows = []
    for case in CASES:
        found = [estimate_match(case, SEED + match) for match in range(MATCHES)]
        truth = np.array([case.pitch.length, case.pitch.width])
        used = [Pitch() if one is None else one.proposal(Pitch()) or Pitch() for one in found]
        proposed = sum(pitch != Pitch() for pitch in used)
        off = np.array([(pitch.length, pitch.width) for pitch in used]) - truth
        near = int((np.abs(off) < NEAR_M).all(axis=1).sum())
        said, sigma = np.stack([_said(one) for one in found], axis=1)
        known = ~np.isnan(said)
        held = (np.abs(said - truth) < 1.96 * sigma).sum(axis=0) / known.sum(axis=0)
        farthest = np.nanpercentile(np.abs(said - truth), 95, axis=0)
        unknown = (~known).sum(axis=0)
        rows.append([case.name, proposed, near, *unknown, *farthest, *(100 * held)])
    header = (
        f"{MATCHES} matches, {FRAMES} frames each",
        "proposed",
        f"in use within {NEAR_M} m then",
        "length unknown",
        "width unknown",
        "length p95 m",
        "width p95 m",
        "length in 95 %",
        "width in 95 %",
    )
    print_table("Size of the pitch, solved as 105 x 68 m", header, rows)


def _said(found: PitchEstimate | None) -> FloatArray:
    """Length and width, and their sigmas, metres, shape (2, 2); NaN where they are unknown."""
    if found is None:
        return np.full((2, 2), np.nan)
    sizes = [[found.length, found.width], [found.length_sigma_m, found.width_sigma_m]]
    return np.array(sizes, float)


def estimate_match(case: Case, seed: int) -> PitchEstimate | None:
    """What ten frames of a match say of its pitch; None where they are too few that say anything."""
    try:
        return estimate_pitch(_frames(case, seed), PAPER.calibration)
    except DegenerateGeometryError:
        return None


def _frames(case: Case, seed: int) -> list[PitchSizeFrameLines]:
    """Frames of a main camera that turns and zooms, and shows enough each time."""
    rng = np.random.default_rng([seed, 7])
    place = np.array([rng.normal(0, 3), rng.uniform(50, 85), -rng.uniform(11, 24)])
    frames: list[PitchSizeFrameLines] = []
    while len(frames) < FRAMES:
        target = np.array([rng.uniform(-48, 48), rng.uniform(-30, 30), -0.1])
        camera = _aimed(rng, place, target)
        if _shows_enough(camera, case.pitch):
            frames.append(PitchSizeFrameLines(_clicks(rng, camera, case), SIZE))
    return frames


if __name__ == "__main__":
    bench_pitches()
