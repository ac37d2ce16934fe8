"""ISSIA and ISSIA-3D: names of their files, numbers of frames and cameras."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from app.errors import InputError
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
        raise _not_issia_error(group, view.key)
    frame_number_of_group(group)
    return int(found[1])


def frame_number_of_group(group: Group) -> int:
    """Number of the frame of a group of ISSIA.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    if not _FRAME.fullmatch(group.key):
        raise _not_issia_error(group, ", ".join(view.key for view in group.views))
    return int(group.key)


class IssiaNumberOwners:
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
                " ISSIA's files have one of each number",
                hint="Export them as coco, parquet or cameras instead.",
            )
        return number


def _not_issia_error(group: Group, view: str) -> InputError:
    return InputError(
        f"group {group.key}, view {view} is not from ISSIA (frame, cam1 to cam6)",
        hint="Export it as soccernet-v3d or cameras instead.",
    )
