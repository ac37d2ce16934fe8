"""Are stretched and cropped pictures found where the frames of a match are looked at together?"""

from __future__ import annotations

import numpy as np

from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.match_picture import (
    PictureFrameLines,
    estimate_match_picture,
    select_informative_frames,
)
from app.solving.picture_camera import picture_to_warp
from tests.bench.cases import SIZE, Case, _aimed, _clicks, _deformed, _shows_enough
from tests.bench.table import print_table

MATCHES = 20
FRAMES = (3, 10, 30)
SEED = 1000
CASES = (
    Case("as assumed"),
    Case("line errors half in common", together=0.5),
    Case("pitch 103 x 66", pitch=Pitch(103.0, 66.0)),
    Case("pixels 5 % wide", aspect=1.05),
    Case("principal point 10 % off", shift=0.10),
    Case("4:3 stretched to 16:9", aspect=4 / 3),
)


def bench_pictures() -> None:
    """Print a row for each case and number of frames."""
    rows = []
    for case in CASES:
        right = case.shift * SIZE.width / (SIZE.diagonal / 2)
        truth = np.array([np.log(case.aspect), right, 0.0])
        for count in FRAMES:
            found = [
                estimate_match_picture(_match(case, SEED + match, count), PAPER.calibration)
                for match in range(MATCHES)
            ]
            off = np.array([picture_to_warp(item.picture) - truth for item in found])
            sigma = np.array([item.picture.sigma for item in found])
            inside = (np.abs(off) < 1.96 * sigma).mean(axis=0)
            wide, aside, _ = np.sqrt((off**2).mean(axis=0))
            proposed = sum(item.proposal is not None for item in found)
            rows.append(
                [case.name, count, f"{proposed}/{MATCHES}", 100 * wide, aside, *(100 * inside)]
            )
    header = (
        "Pictures of one match",
        "frames",
        "proposed",
        "aspect off %",
        "axis off",
        "aspect in 95 %",
        "right in 95 %",
        "down in 95 %",
    )
    print_table("Stretched and cropped pictures, over the frames of a match", header, rows)


def _match(case: Case, seed: int, count: int) -> list[PictureFrameLines]:
    """Frames of a main camera that turns and zooms, and shows enough each time."""
    rng = np.random.default_rng([seed, 7])
    place = np.array([rng.normal(0, 3), rng.uniform(50, 85), -rng.uniform(11, 24)])
    frames: list[PictureFrameLines] = []
    while len(frames) < count:
        target = np.array([rng.uniform(-48, 48), rng.uniform(-30, 30), -0.1])
        camera = _aimed(rng, place, target)
        if not _shows_enough(camera, case.pitch):
            continue
        frame = PictureFrameLines(_clicks(rng, _deformed(camera, case), case), SIZE, Pitch())
        frames += [frame] if select_informative_frames([frame]) else []
    return frames


if __name__ == "__main__":
    bench_pictures()
