"""Snap on the sample as ``touchline sample`` draws it, its planted faults too (docs/paint.md).

A view that ends worse than its clicks must be named: by snap's own reason, or by a finding of its
group. ``python -m tests.bench.drawn``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.geometry.camera import Camera
from app.sample import SEED
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from tests.bench.paint import WORSE_PX, Shot, field_error, shots_of
from tests.bench.table import print_table
from tests.scenes import make_scenes

GROUPS = 40
HALF_TURN = np.diag([-1.0, -1.0, 1.0])


def bench_drawn() -> None:
    """Print the table."""
    errors, worse, named = [], 0, 0
    for scene in make_scenes(GROUPS, SEED):
        findings = solve_group(scene.group, PAPER).findings
        swapped = {item.view for item in findings if item.kind == "sides_swapped"}
        told = {item.view for item in findings}
        for key, shot in shots_of(scene):
            assert shot.clicked.camera is not None
            cameras = shot.clicked.camera, shot.snapped.camera
            clicks, paint = (field_error(camera, shot.truth, shot.size) for camera in cameras)
            if paint > clicks + WORSE_PX:
                worse += 1
                named += key in told or shot.snapped.reason is not None
            # Which half is which no paint says: the finding does, and its fix turns the camera.
            errors.append(_turned_error(shot) if key in swapped else paint)
    rows = [
        [f"worse than its clicks by more than {WORSE_PX} px", worse],
        ["of those named by a finding or a reason", named],
        ["field error px, median (swapped sides turned)", float(np.median(errors))],
        ["p95", float(np.percentile(errors, 95))],
    ]
    title = f"Snap on {len(errors)} views of the sample as it is drawn, faults too"
    print_table(title, ("what", "value"), rows)


def _turned_error(shot: Shot) -> float:
    """Of the camera after the half turn that the finding ``sides_swapped`` offers."""
    camera: Camera = shot.snapped.camera
    turned = replace(
        camera, rotation=camera.rotation @ HALF_TURN, position=HALF_TURN @ camera.position
    )
    return field_error(turned, shot.truth, shot.size)


if __name__ == "__main__":
    bench_drawn()
