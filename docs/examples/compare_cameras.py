"""Compare two calibrators on the annotated lines: python compare_cameras.py SOURCE [CAMERAS]

SOURCE is an export or a server with one dataset; CAMERAS a folder of `camera_<frame>.json` of the other
calibrator. Without it the version's own cameras are compared with themselves without lens distortion.
"""

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import touchline


def errors_px(view, camera, pitch):
    """How far each annotated point lies from its marking as the camera draws it, pixels."""
    found = []
    for marking, points in view.lines.items():
        drawn = camera.project(pitch[marking])
        distance = np.linalg.norm(np.array(points)[:, None] - drawn[None], axis=2)
        if not np.isnan(distance).all():
            found.extend(np.nanmin(distance, axis=1))
    return found


version = touchline.open(sys.argv[1])
errors = {"version": [], "other": []}
pitch = touchline.markings(*version[0].pitch, step=0.05)
for view in version.views:
    if view.camera is None:
        continue
    other = replace(view.camera, lens="brown_conrady", distortion=(0.0,) * 12)
    if len(sys.argv) > 2:
        file = Path(sys.argv[2]) / f"camera_{Path(view.key).stem}.json"
        if not file.exists():
            continue
        other = touchline.Camera.from_json(json.loads(file.read_text()))
    errors["version"] += errors_px(view, view.camera, pitch)
    errors["other"] += errors_px(view, other, pitch)
for name, values in errors.items():
    median, p95 = np.quantile(values, [0.5, 0.95])
    print(f"{name:8} {len(values):6} points   median {median:.2f} px   95 % below {p95:.2f} px")
