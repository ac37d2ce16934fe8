"""ISSIA in its original shape: ViPER XGTF per camera, given cameras, lines of static cameras."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import IO, Any
from xml.sax.saxutils import quoteattr

from app.formats import fields
from app.formats.camera_json import camera_to_json
from app.formats.issia import CALIBRATION, DEFAULT_OFFSET, FramePersons, IssiaNumberRegistry
from app.formats.safe_path import resolve_inside
from app.formats.sn_calibration_writer import format_line_file
from app.formats.view_files import Key, SortedSpill, open_spill
from app.json_text import json_text
from app.soccer.annotation import CORNERS
from app.soccer.frames import ImageSize
from app.soccer.group import Group, Station, View

_BALL, _NOTE, _PERSON = 0, 1, 2
_DIGITS = 12
_BREAK = "\n"
"""Between the person and the element; neither holds one."""
# XML 1.0 has no place for these, not even escaped.
_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_HEAD = """<?xml version="1.0" encoding="UTF-8"?>
<viper xmlns="http://lamp.cfar.umd.edu/viper#" xmlns:data="http://lamp.cfar.umd.edu/viperdata#">
  <config>
    <descriptor name="Information" type="FILE">
      <attribute dynamic="false" name="H-FRAME-SIZE" type="http://lamp.cfar.umd.edu/viperdata#dvalue"/>
      <attribute dynamic="false" name="V-FRAME-SIZE" type="http://lamp.cfar.umd.edu/viperdata#dvalue"/>
    </descriptor>
    <descriptor name="BALL" type="OBJECT">
      <attribute dynamic="true" name="BallPos" type="http://lamp.cfar.umd.edu/viperdata#point"/>
    </descriptor>
    <descriptor name="Person" type="OBJECT">
      <attribute dynamic="true" name="LOCATION" type="http://lamp.cfar.umd.edu/viperdata#bbox"/>
    </descriptor>
  </config>
  <data>
    <sourcefile filename=%s>
"""
_INFORMATION = """      <file id="0" name="Information">
        <attribute name="H-FRAME-SIZE">
          <data:dvalue value="%d"/>
        </attribute>
        <attribute name="V-FRAME-SIZE">
          <data:dvalue value="%d"/>
        </attribute>
      </file>
"""
_TAIL = """    </sourcefile>
  </data>
</viper>
"""


def write_issia(
    root: Path, groups: Iterable[Group], unassigned: Iterable[FramePersons] = ()
) -> dict[str, int]:
    """Write ``ground_truth_<n>.xgtf`` per camera, and what belongs to the cameras.

    ``issia_calibration.json`` holds the cameras that were given, ``lines/cam<n>.json`` the
    annotated lines; neither is computed. Frame numbers are those of the groups plus 8. A ball
    is its centre, whole pixels as integers. ``H-FRAME-SIZE`` and ``V-FRAME-SIZE`` are the size of
    the images.

    Args:
        root: Existing folder.
        groups: Groups of ISSIA, in any order.
        unassigned: People of frames that no group's view holds.

    Returns:
        Counts: ``groups``, ``annotated_balls``, ``persons``, ``cameras`` (files).

    Raises:
        InputError: A group is not from ISSIA, or two have one frame or differ in a camera.
    """
    counts = {"groups": 0, "annotated_balls": 0, "persons": 0, "cameras": 0}
    stations, known = dict[int, Station](), IssiaNumberRegistry()
    with open_spill() as spill:
        for group in groups:
            counts["groups"] += 1
            frame = known.claim_frame_number(group) + DEFAULT_OFFSET
            for view in group.views:
                station = view.station
                camera = known.claim_camera_number(
                    group, view, (station.given, station.lines, station.size)
                )
                stations.setdefault(camera, view.station)
                _add_balls(spill, camera, frame, view, counts)
                _add_persons(spill, camera, frame, view.extras.boxes, counts)
        for item in unassigned:
            camera = int(item.camera.removeprefix("cam"))
            _add_persons(spill, camera, item.frame + DEFAULT_OFFSET, item.boxes, counts)
        for camera, items in groupby(spill.items(), key=lambda item: item[0][0]):
            # People of a camera without a ball came without the size of its images.
            size = stations[camera].size if camera in stations else None
            _write_ground_truth(root / f"ground_truth_{camera}.xgtf", camera, size, items)
            counts["cameras"] += 1
    _write_cameras_and_lines(root, stations)
    return counts


def _add_balls(
    spill: SortedSpill, camera: int, frame: int, view: View, counts: dict[str, int]
) -> None:
    for ball in view.balls:
        if ball.center is not None:
            x, y = map(_format_quoted_number, ball.center)
            spill.add((camera, _BALL, "", frame), f"<data:point {_framespan(frame)} x={x} y={y}/>")
            counts["annotated_balls"] += 1
    notes = view.extras.metadata.get("ball")
    for name, value in (notes if isinstance(notes, dict) else {}).items():
        body = f"<data:svalue {_framespan(frame)} value={_format_quoted_attribute(value)}/>"
        spill.add((camera, _NOTE, str(name), frame), body)


def _add_persons(
    spill: SortedSpill,
    camera: int,
    frame: int,
    boxes: Iterable[Mapping[str, Any]],
    counts: dict[str, int],
) -> None:
    for box in boxes:
        points = box.get("points")
        if not isinstance(points, dict) or not set(CORNERS) <= points.keys():
            continue
        try:
            x, y, right, bottom = (fields.parse_number(points[corner]) for corner in CORNERS)
        except ValueError:
            # Kept as it came from a file that said something else.
            continue
        numbers = map(_format_quoted_number, (x, y, right - x, bottom - y))
        place = " ".join(
            f"{name}={number}"
            for name, number in zip(("x", "y", "width", "height"), numbers, strict=True)
        )
        identity = str(box.get("ID"))
        # Numbers in their own order, so that people come back as they came.
        key = (camera, _PERSON, identity.zfill(_DIGITS), frame)
        spill.add(
            key,
            f"{_format_quoted_attribute(identity)}{_BREAK}<data:bbox {_framespan(frame)} {place}/>",
        )
        counts["persons"] += 1


def _format_quoted_number(value: float) -> str:
    """A quoted number; the ground truth has whole pixels."""
    number = float(value)
    return f'"{int(number) if number.is_integer() else repr(number)}"'


def _framespan(frame: int) -> str:
    return f'framespan="{frame}:{frame}"'


def _format_quoted_attribute(value: Any) -> str:
    return quoteattr(_NO_XML.sub("", str(value)).replace(_BREAK, " "))


def _write_ground_truth(
    path: Path, camera: int, size: ImageSize | None, items: Iterable[tuple[Key, str]]
) -> None:
    """One camera: an object for the ball, and one for each person."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.write(_HEAD % quoteattr(f"cam{camera}.mp4"))
        if size is not None:
            file.write(_INFORMATION % (size.width, size.height))
        for is_person, part in groupby(items, key=lambda item: item[0][1] == _PERSON):
            if is_person:
                _write_persons(file, part)
            else:
                _write_ball(file, part)
        file.write(_TAIL)


def _write_ball(file: IO[str], items: Iterator[tuple[Key, str]]) -> None:
    file.write('      <object id="0" name="BALL">\n')
    for (kind, name), part in groupby(items, key=lambda item: (item[0][1], item[0][2])):
        _write_attribute(file, "BallPos" if kind == _BALL else name, part)
    file.write("      </object>\n")


def _write_persons(file: IO[str], items: Iterator[tuple[Key, str]]) -> None:
    for identity, part in groupby(items, key=lambda item: item[1].partition(_BREAK)[0]):
        file.write(f'      <object id={identity} name="Person">\n')
        _write_attribute(file, "LOCATION", part)
        file.write("      </object>\n")


def _write_attribute(file: IO[str], name: str, items: Iterator[tuple[Key, str]]) -> None:
    file.write(f"        <attribute name={_format_quoted_attribute(name)}>\n")
    for _, body in items:
        file.write(f"          {body.rpartition(_BREAK)[2]}\n")
    file.write("        </attribute>\n")


def _write_cameras_and_lines(root: Path, stations: Mapping[int, Station]) -> None:
    given = {
        f"cam{number}": camera_to_json(station.given)
        for number, station in sorted(stations.items())
        if station.given is not None
    }
    if given:
        text = json_text(given, indent=1, ascii_=True) + "\n"
        (root / CALIBRATION).write_text(text, encoding="utf-8")
    for number, station in sorted(stations.items()):
        if station.lines:
            path = resolve_inside(root, f"lines/cam{number}.json")
            path.parent.mkdir(exist_ok=True)
            text = format_line_file(station.lines, station.size, pixels=True)
            path.write_text(text, encoding="utf-8")
