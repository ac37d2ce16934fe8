"""ISSIA and ISSIA-3D: names of their files, numbers of frames and cameras, and mirrored people turned right."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from app.errors import InputError
from app.formats.viper_reader import ViperVideo
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize
from app.soccer.group import Group, View

CALIBRATION = "issia_calibration.json"
TABLE_3D = "ISSIA-3D.csv"
MATCH = "issia"
DEFAULT_SIZE = ImageSize(1920, 1080)
DEFAULT_OFFSET = 8

_VIEW = re.compile(r"cam([1-6])", re.ASCII)
_FRAME = re.compile(r"-?\d{1,9}", re.ASCII)


@dataclass(frozen=True)
class FramePersons:
    """People seen by one camera in a frame that is no view of a group.

    ``boxes`` have the shape of ``Extras.boxes``.
    """

    frame: int
    camera: str
    boxes: tuple[Mapping[str, Any], ...]


def camera_number_of_view(group: Group, view: View) -> int:
    """Number of the camera of a view of ISSIA.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    found = _VIEW.fullmatch(view.key)
    if found is None:
        raise _make_not_issia_error(group, view.key)
    frame_number_of_group(group)
    return int(found[1])


def frame_number_of_group(group: Group) -> int:
    """Number of the frame of a group of ISSIA.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    if not _FRAME.fullmatch(group.key):
        raise _make_not_issia_error(group, ", ".join(view.key for view in group.views))
    return int(group.key)


class IssiaNumberRegistry:
    """Keeps whose the numbers of frames and cameras are, of which ISSIA's files have one each."""

    def __init__(self) -> None:
        self._groups: dict[int, str] = {}
        self._cameras: dict[int, tuple[str, object]] = {}

    def claim_frame_number(self, group: Group) -> int:
        """Number of the frame of a group.

        Raises:
            InputError: It is not from ISSIA, or another group has its number.
        """
        number = frame_number_of_group(group)
        first = self._groups.setdefault(number, group.key)
        if first != group.key:
            raise InputError(
                f"the groups {first} and {group.key} would both be frame {number} of ISSIA's files",
                hint="Export them as coco, parquet or cameras instead.",
            )
        return number

    def claim_camera_number(self, group: Group, view: View, given: object) -> int:
        """Number of the camera of a view.

        Args:
            group: The group of the view.
            view: The view.
            given: What the files hold of the camera, which stands still.

        Raises:
            InputError: It is not from ISSIA, or a view has its number that says otherwise.
        """
        number, whose = camera_number_of_view(group, view), f"{group.key}, {view.key}"
        station = view.station.key if view.station.shared else given
        first, known = self._cameras.setdefault(number, (whose, station))
        if known != station:
            raise InputError(
                f"two frames ({first} and {whose}) have different cameras called cam{number}, and"
                " ISSIA's files can hold only one of that name",
                hint="Export them as coco, parquet or cameras instead.",
            )
        return number


def _make_not_issia_error(group: Group, view: str) -> InputError:
    return InputError(
        f"group {group.key}, view {view} cannot be from ISSIA, whose groups are named by a frame number and whose views are cam1 to cam6",
        hint="Export it as soccernet-v3d or cameras instead.",
    )


MIRRORED = frozenset({2, 6})
"""Cameras whose people the published files hold mirrored."""
LEAST_PAIRS = 20
"""Sightings of one person by two cameras from which on the files themselves decide."""
MOST_FRAMES = 300
"""Frames that two cameras share that are looked at, spread over all."""
_WRITTEN_HERE = re.compile(r"cam\d{1,3}", re.ASCII)
"""Name of the video in a file that ``issia_writer`` wrote, whose people are turned right."""


def find_cameras_with_mirrored_people(
    tracks: Mapping[int, ViperVideo], given: Mapping[int, Camera], widths: Mapping[int, int]
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
        apart = _measure_person_distances(number, tracks, given, widths[number])
        if len(apart) >= LEAST_PAIRS:
            written, turned = np.median(apart, axis=0)
            is_mirrored = bool(turned < written)
        else:
            is_mirrored = _WRITTEN_HERE.fullmatch(name) is None
        if is_mirrored:
            found.append(number)
    return found


def mirror_people(track: ViperVideo, width: int) -> ViperVideo:
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


def _measure_person_distances(
    number: int, tracks: Mapping[int, ViperVideo], given: Mapping[int, Camera], width: int
) -> FloatArray:
    """How far the same person lies from where another camera puts it, as written and turned, metres,
    shape (N, 2)."""
    own, rows = tracks[number], []
    back = mirror_people(own, width)
    others = [other for other in given if other in tracks and other not in MIRRORED]
    for other in others if number in given else ():
        common = sorted(own.persons.keys() & tracks[other].persons.keys())
        for frame in common[:: len(common) // MOST_FRAMES + 1]:
            there = locate_people_on_grass(given[other], tracks[other], frame)
            here, turn = (locate_people_on_grass(given[number], one, frame) for one in (own, back))
            rows += [
                [float(np.hypot(*(place[name] - there[name]))) for place in (here, turn)]
                for name in here.keys() & turn.keys() & there.keys()
            ]
    return np.array(rows).reshape(-1, 2)


def locate_people_on_grass(camera: Camera, track: ViperVideo, frame: int) -> dict[str, FloatArray]:
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
