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


def view_camera(group: Group, view: View) -> int:
    """Number of the camera of a view of ISSIA.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    found = _VIEW.fullmatch(view.key)
    if found is None:
        raise _not_issia(group, view.key)
    frame_number(group)
    return int(found[1])


def frame_number(group: Group) -> int:
    """Number of the frame of a group of ISSIA.

    Raises:
        InputError: The group is from another kind of dataset.
    """
    if not _FRAME.fullmatch(group.key):
        raise _not_issia(group, ", ".join(view.key for view in group.views))
    return int(group.key)


def _not_issia(group: Group, view: str) -> InputError:
    return InputError(
        f"group {group.key}, view {view} is not from ISSIA (frame, cam1 to cam6)",
        hint="Export it as soccernet-v3d or cameras instead.",
    )
