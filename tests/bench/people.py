"""Does the same person stand at one place in two cameras of ISSIA? ``python -m tests.bench.people``."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np

from app.formats.issia import MIRRORED, locate_people_on_grass, mirror_people
from app.formats.issia_reader import IssiaFolder, IssiaOptions, open_issia
from app.formats.report import ReaderReport
from tests.bench.table import print_table

CAMERAS = ((1, 2), (5, 6), (3, 4), (2, 3), (2, 4), (3, 6), (4, 6))
EVERY = 5
"""Frames that are looked at: each fifth."""


def bench_people(data: Path, every: int = EVERY) -> None:
    """Print the table: people as an import brings them, and as the files hold them."""
    folder = open_issia(data / "issia", IssiaOptions(), ReaderReport())
    rows: list[list[object]] = []
    for one, other in CAMERAS:
        found = apart(folder, one, other, every)
        # Turned once more they are as they were written.
        width = folder.stations[one].size.width
        tracks = {
            number: mirror_people(track, width) if number in MIRRORED else track
            for number, track in folder.tracks.items()
        }
        written = apart(IssiaFolder(tracks, folder.stations), one, other, every)
        rows.append([f"{one}, {other}", len(found), _median(written), _median(found)])
    header = ("cameras", "sightings", "as written, m", "imported, m")
    print_table("Same person in two ISSIA cameras, median", header, rows)


def apart(folder: IssiaFolder, one: int, other: int, every: int = EVERY) -> list[float]:
    """How far the same person lies apart by two cameras, metres, of each frame that both show."""
    (camera, track), (camera_b, track_b) = (
        (folder.stations[number].given, folder.tracks[number]) for number in (one, other)
    )
    assert camera is not None and camera_b is not None
    found = []
    for frame in sorted(track.persons.keys() & track_b.persons.keys())[::every]:
        here, there = (
            locate_people_on_grass(camera, track, frame),
            locate_people_on_grass(camera_b, track_b, frame),
        )
        found += [
            float(np.hypot(*(here[name] - there[name]))) for name in here.keys() & there.keys()
        ]
    return found


def _median(values: list[float]) -> float | None:
    return float(np.median(values)) if values else None


if __name__ == "__main__":
    bench_people(
        Path(os.environ.get("TOUCHLINE_REAL_DATA", "../shared/data")), *map(int, sys.argv[1:])
    )
