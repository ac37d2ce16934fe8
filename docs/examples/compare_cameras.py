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

SEGMENTS = {  # where the longest markings lie, metres: their ends
    "Side line top": ((-52.5, -34), (52.5, -34)),
    "Side line bottom": ((-52.5, 34), (52.5, 34)),
    "Side line left": ((-52.5, -34), (-52.5, 34)),
    "Side line right": ((52.5, -34), (52.5, 34)),
    "Middle line": ((0, -34), (0, 34)),
    "Big rect. left main": ((-36, -20.16), (-36, 20.16)),
    "Big rect. right main": ((36, -20.16), (36, 20.16)),
    "Big rect. left top": ((-52.5, -20.16), (-36, -20.16)),
    "Big rect. right top": ((36, -20.16), (52.5, -20.16)),
    "Big rect. left bottom": ((-52.5, 20.16), (-36, 20.16)),
    "Big rect. right bottom": ((36, 20.16), (52.5, 20.16)),
}


def camera_of(document):
    """A camera of SoccerNet's JSON, with the distortion in the order of docs/coordinates.md."""
    k1, k2, k3, k4, k5, k6 = document.get("radial_distortion", [0.0] * 6)
    p1, p2 = document.get("tangential_distortion", [0.0] * 2)
    prism = document.get("thin_prism_distortion", [0.0] * 4)
    return touchline.Camera(
        rotation=document["rotation_matrix"],
        position=document["position_meters"],
        focal_length=(document["x_focal_length"], document["y_focal_length"]),
        principal_point=document["principal_point"],
        distortion=(k1, k2, p1, p2, k3, k4, k5, k6, *prism),
    )


def errors_px(view, camera):
    """How far each annotated point lies from its marking as the camera draws it, pixels."""
    found = []
    for marking, points in view.lines.items():
        if marking in SEGMENTS:
            (x0, y0), (x1, y1) = SEGMENTS[marking]
            share = np.linspace(0, 1, 2000)[:, None]
            drawn = np.hstack([share * (x1 - x0) + x0, share * (y1 - y0) + y0, 0 * share])
            pixels = camera.project(drawn)
            distance = np.hypot(*(np.array(points)[:, None] - pixels[None]).transpose(2, 0, 1))
            if not np.isnan(distance).all():
                found.extend(np.nanmin(distance, axis=1))
    return found


version = touchline.open(sys.argv[1])
errors = {"version": [], "other": []}
for view in version.views:
    if view.camera is None:
        continue
    other = replace(view.camera, lens="brown_conrady", distortion=(0.0,) * 12)
    if len(sys.argv) > 2:
        file = Path(sys.argv[2]) / f"camera_{Path(view.key).stem}.json"
        if not file.exists():
            continue
        other = camera_of(json.loads(file.read_text()))
    errors["version"] += errors_px(view, view.camera)
    errors["other"] += errors_px(view, other)
for name, values in errors.items():
    median, p95 = np.quantile(values, [0.5, 0.95])
    print(f"{name:8} {len(values):6} points   median {median:.2f} px   95 % below {p95:.2f} px")
