"""ISSIA's people: in which cameras their boxes are mirrored, and the boxes turned right.

The people of cameras 2 and 6 were annotated on mirrored videos, the balls were not. Of the files that
CNR published, the same person in two cameras lies 0.5 m (cameras 1 and 2) and 0.8 m (5 and 6) apart in
the median with those boxes turned, 11 and 17 m as they are written.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import PurePosixPath

import numpy as np

from app.formats.viper_reader import ViperTrack
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera

MIRRORED = frozenset({2, 6})
"""Cameras whose people the published files hold mirrored."""
LEAST_PAIRS = 20
"""Sightings of one person by two cameras from which on the files themselves decide."""
MOST_FRAMES = 300
"""Frames that two cameras share that are looked at, spread over all."""
_WRITTEN_HERE = re.compile(r"cam\d{1,3}", re.ASCII)
"""Name of the video in a file that ``issia_writer`` wrote, whose people are turned right."""


def cameras_with_mirrored_people(
    tracks: Mapping[int, ViperTrack], given: Mapping[int, Camera], widths: Mapping[int, int]
) -> list[int]:
    """Numbers of the cameras whose people are to be turned.

    Of 2 and 6 those whose people, turned, lie nearer to the same people of other cameras; where
    nothing can be compared, all but those of files that Touchline wrote.

    Args:
        tracks: By number of the camera.
        given: Cameras that are known, by number.
        widths: Of the images, pixels, by number.
    """
    found = []
    for number in sorted(MIRRORED & tracks.keys()):
        track = tracks[number]
        name = PurePosixPath(track.source.replace("\\", "/")).stem
        if not track.persons:
            continue
        apart = _median_person_distances(number, tracks, given, widths[number])
        if len(apart) >= LEAST_PAIRS:
            written, turned = np.median(apart, axis=0)
            is_mirrored = bool(turned < written)
        else:
            is_mirrored = _WRITTEN_HERE.fullmatch(name) is None
        if is_mirrored:
            found.append(number)
    return found


def turn_people(track: ViperTrack, width: int) -> ViperTrack:
    """The track with its people turned left to right.

    A box covers the columns from x to x + width - 1, as ViPER counts them: of a picture of W columns
    they become those from W - x - width on.
    """
    return replace(
        track,
        persons={
            frame: [(name, width - x - wide, y, wide, high) for name, x, y, wide, high in boxes]
            for frame, boxes in track.persons.items()
        },
    )


def _median_person_distances(
    number: int, tracks: Mapping[int, ViperTrack], given: Mapping[int, Camera], width: int
) -> FloatArray:
    """How far the same person lies from where another camera puts it, as written and turned, metres,
    shape (N, 2)."""
    own, rows = tracks[number], []
    back = turn_people(own, width)
    others = [other for other in given if other in tracks and other not in MIRRORED]
    for other in others if number in given else ():
        common = sorted(own.persons.keys() & tracks[other].persons.keys())
        for frame in common[:: len(common) // MOST_FRAMES + 1]:
            there = people_on_grass(given[other], tracks[other], frame)
            here, turn = (people_on_grass(given[number], one, frame) for one in (own, back))
            rows += [
                [float(np.hypot(*(place[name] - there[name]))) for place in (here, turn)]
                for name in here.keys() & turn.keys() & there.keys()
            ]
    return np.array(rows).reshape(-1, 2)


def people_on_grass(camera: Camera, track: ViperTrack, frame: int) -> dict[str, FloatArray]:
    """Where the people of a frame stand, metres from the centre mark, shape (2,) each, by id.

    That is where the camera sees the middle of the lower edge of their box on the grass; whose it
    sees above the horizon stand nowhere.
    """
    boxes = track.persons.get(frame, [])
    if not boxes:
        return {}
    feet = np.array([(x + wide / 2, y + high) for _, x, y, wide, high in boxes])
    rays = camera.rays(feet)
    with np.errstate(divide="ignore", invalid="ignore"):
        far = -camera.position[2] / rays[:, 2]
        places = camera.position[:2] + far[:, None] * rays[:, :2]
    seen = np.isfinite(places).all(axis=1) & (far > 0)
    return {box[0]: place for box, place, shown in zip(boxes, places, seen, strict=True) if shown}
