"""Frame: one image of a dataset as evaluation sees it, how boxes overlap, and which frame a name means."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from urllib.parse import unquote

from app.formats.fields import id_to_text
from app.formats.frame_names import (
    HolderFolders,
    frame_path_by_match,
    list_frame_stems_in_split,
    list_possible_export_keys,
    view_file_path,
    with_export_key,
)
from app.formats.gamestate_reader import sequence_frame_path
from app.formats.sn_calibration import line_frame_path
from app.geometry.camera import Camera
from app.soccer.annotation import Lines
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch


def iou(a: Box, b: Box) -> float:
    """Intersection over union of two boxes; 0 when they only touch.

    Example:
        >>> iou(Box(0, 0, 2, 2), Box(1, 0, 2, 2))
        0.3333333333333333
    """
    width = min(a.x + a.width, b.x + b.width) - max(a.x, b.x)
    height = min(a.y + a.height, b.y + b.height) - max(a.y, b.y)
    shared = max(width, 0.0) * max(height, 0.0)
    return shared / (a.width * a.height + b.width * b.height - shared)


def size_error_percent(box: Box, reference: Box) -> float:
    """|d - d_reference| in per cent of the reference box's diagonal, d = (width + height) / 2.

    Example:
        >>> size_error_percent(Box(0, 0, 6, 8), Box(0, 0, 3, 4))
        70.0
    """
    return (
        100.0
        * abs(box.diameter - reference.diameter)
        / math.hypot(reference.width, reference.height)
    )


@dataclass(frozen=True)
class GroundTruthFrame:
    """One view of one group: the truth that a prediction is measured with.

    Attributes:
        id: Of the view, opaque; predictions refer to it.
        boxes: The ball's boxes by kind, those of ``ball_boxes.BOX_KINDS`` that exist.
        absent: Somebody said that the ball is out of view: whatever is found here is wrong.
        camera: The dataset's own camera, the oracle; None when it is not calibrated.
        point: The triangulated ball, pitch frame, metres; only where this view is in a valid
            pair.
        lines: Annotated markings, pixels of ``size``.
        station: Key of the camera station, which lines and camera belong to.
        predicted_by: Set of predictions that the ball was accepted from; empty: somebody drew it.
    """

    id: int
    group_id: int
    group: str
    view: str
    match: str
    size: ImageSize
    split: str = ""
    boxes: Mapping[str, Box] = field(default_factory=dict)
    absent: bool = False
    camera: Camera | None = None
    point: tuple[float, float, float] | None = None
    parallax_degrees: float | None = None
    lines: Lines = field(default_factory=dict)
    pitch: Pitch = field(default_factory=Pitch)
    station: str = ""
    predicted_by: str = ""


@dataclass(frozen=True)
class Detection:
    """A ball that a detector found: pixels of the annotated size, and how sure it was."""

    box: Box
    score: float = 1.0


@dataclass(frozen=True)
class FrameWithDetections:
    """A frame whose truth about the ball is known, with its detections, the surest first.

    ``truth`` is None where the ball is out of view.
    """

    frame: GroundTruthFrame
    truth: Box | None
    detections: tuple[Detection, ...]


def pair_truth_with_detections(
    frames: Sequence[GroundTruthFrame], detections: Mapping[int, Sequence[Detection]], boxes: str
) -> list[FrameWithDetections]:
    """The frames that have the box to compare with, or no ball at all.

    Detections of other frames cannot be judged and take no part.

    Args:
        frames: Of the dataset.
        detections: By id of the frame; frames without any were looked at in vain.
        boxes: One of ``ball_boxes.BOX_KINDS``.
    """
    judged = []
    for frame in frames:
        truth = frame.boxes.get(boxes)
        if truth is None and not frame.absent:
            continue
        # The sort is stable: of equal scores, the one that stands first in the file comes first.
        found = sorted(detections.get(frame.id, ()), key=lambda item: -item.score)
        judged.append(FrameWithDetections(frame, None if frame.absent else truth, tuple(found)))
    return judged


_SUFFIX = re.compile(r"\.(png|jpe?g|jfif|webp|bmp|txt|json)$", re.IGNORECASE | re.ASCII)
_NUMBER = re.compile(r"(?:frame|image|img)?[ _-]?(\d{1,9})", re.IGNORECASE | re.ASCII)
_DIGITS = re.compile(r"\d{1,9}", re.ASCII)
_MATCH = " - "
"""Stands in the name of every SoccerNet match."""
_SEVERAL = -1
"""Stands in the index for a name that fits several frames."""


@dataclass(frozen=True)
class NamedFrame:
    """A frame of a dataset by its names.

    Attributes:
        station: Key of a static camera, or empty.
        picture: Name of its picture's file with the last folder, ``images/0004.jpg``, or empty.
        path: Where its picture is read, or empty.
    """

    id: int
    group: str
    view: str
    match: str
    size: ImageSize
    station: str = ""
    picture: str = ""
    path: str = ""


@dataclass(frozen=True)
class FrameNameIndex:
    """Every spelling by which exactly one frame is meant.

    A broadcast frame is ``<match>/7_1.png``, with or without the folders before the match, its
    ending, or (where only one match has it) the match. A frame of a static camera is
    ``<camera>/<frame>`` or ``<frame>/<camera>``. Slashes may be spelt ``_``, ``__`` or ``-``.
    The names that exports give to frames are known, too.

    A name that does not tell the match means a frame only where no folder before it could be
    another match: ``7_1.png`` and ``labels/test/7_1.txt``, but not ``epl/Arsenal/7_1.png``. Where
    frames have no match and the names of their views tell them apart, only a folder that is called
    like a match counts. The path by which a picture is read is always its name.
    """

    frames: Mapping[int, NamedFrame]
    _index: Mapping[str, int] = field(repr=False)
    _telling: frozenset[str] = field(repr=False)
    """Names of the index that tell the match, whatever stands before them."""
    _numbered: Mapping[int, int] = field(default_factory=dict, repr=False)
    _stations: Mapping[str, tuple[int, ...]] = field(default_factory=dict, repr=False)
    """Frames of a static camera, and views of one match that are called alike, by their names."""
    _holders: HolderFolders = field(default_factory=HolderFolders, repr=False)
    _paths: Mapping[str, int] = field(default_factory=dict, repr=False)
    _folders_tell: bool = True
    """Whether a folder may be that of another match or group."""

    @staticmethod
    def of(frames: Iterable[NamedFrame]) -> FrameNameIndex:
        """The index of a dataset's frames."""
        known = {frame.id: frame for frame in frames}
        index: dict[str, int] = {}
        telling: set[str] = set()
        stations: dict[str, list[int]] = {}
        numbered: dict[int, int] = {}
        for frame in known.values():
            for name in _own_names(frame):
                if index.setdefault(name, frame.id) != frame.id:
                    index[name] = _SEVERAL
        own = frozenset(index)
        for frame in known.values():
            distinguishing = _distinguishing_names(frame)
            telling |= distinguishing
            # As in an export, the name of one frame is not made for another one.
            for name in (distinguishing | _ambiguous_names(frame)) - own:
                if index.setdefault(name, frame.id) != frame.id:
                    index[name] = _SEVERAL
            for number in _parse_frame_numbers(frame):
                if numbered.setdefault(number, frame.id) != frame.id:
                    numbered[number] = _SEVERAL
            alike = frame.station or _strip_suffix(frame.view)
            folders = _strip_suffix(frame.match).split("/") if frame.match else []
            for start in range(len(folders) + 1):
                stations.setdefault("/".join((*folders[start:], alike)), []).append(frame.id)
        by_station = {
            name: tuple(ids)
            for name, ids in stations.items()
            if len({known[identity].match for identity in ids}) == 1
        }
        holders = HolderFolders(
            name for frame in known.values() for name in (frame.group, frame.match)
        )
        paths: dict[str, int] = {}
        for frame in known.values():
            if frame.path and paths.setdefault(_strip_suffix(frame.path), frame.id) != frame.id:
                paths[_strip_suffix(frame.path)] = _SEVERAL
        return FrameNameIndex(
            known,
            index,
            frozenset(telling),
            numbered,
            by_station,
            holders,
            paths,
            _folders_tell_frames_apart(list(known.values())),
        )

    def find(self, name: str) -> NamedFrame | None:
        """The one frame that a name means, or None.

        Folders before a known match do not matter: ``/data/labels/test/<match>/7_1.txt``.
        """
        identity = self._find_frame_id(name)
        return self.frames[identity] if identity is not None and identity != _SEVERAL else None

    def list_passed_folders(self, name: str) -> list[str]:
        """The folders of a name that ``find`` passes over, or all of them where it is a path of a picture."""
        return self._find_with_passed_folders(name)[1]

    def list_folders_without_meaning(self, name: str) -> tuple[str, ...]:
        """Those that may be a match or a group, in a dataset in which folders tell nothing."""
        passed = [] if self._folders_tell else self.list_passed_folders(name)
        return tuple(self._holders.find_other_folders(passed))

    def find_by_number(self, text: str) -> NamedFrame | None:
        """The one frame whose view or picture has a number for its name, ``4`` for ``0004.jpg``."""
        number = _parse_number(text)
        identity = None if number is None else self._numbered.get(number)
        return self.frames[identity] if identity is not None and identity != _SEVERAL else None

    def explain_unknown_number(self, text: str) -> str:
        """Why ``find_by_number`` found nothing, in words."""
        if _parse_number(text) in self._numbered:
            return "is the number of several frames of the dataset; name the picture or the camera, too"
        return "is not a number that the name of a picture of the dataset has"

    def list_example_names(self, most: int = 3) -> list[str]:
        """How some frames of the dataset are called."""
        found = list(self.frames.values())[:most]
        return [
            f"{frame.station}/{frame.group}" if frame.station else frame.view for frame in found
        ]

    def explain_unknown_name(self, name: str) -> str:
        """Why ``find`` found nothing, in words."""
        if self._find_frame_id(name) == _SEVERAL:
            return "fits several frames of the dataset; name its match or group, too, as MATCH/GROUP/VIEW"
        if _strip_suffix(name).rsplit("/", 1)[-1] in self._index:
            return "is not a frame of the dataset: its folders name no group or match"
        return "is not a frame of the dataset"

    def find_station_frames(self, name: str, top_folder: str = "") -> tuple[int, ...]:
        """Ids of all frames of a camera of a rig: a static one, or views of one match called alike.

        Args:
            name: Folders before the camera have to be those of its match, or hold files of any match;
                others do not matter where one camera alone has the name.
            top_folder: A folder that names nothing.
        """
        parts = _strip_suffix(name).split("/")
        for start in range(len(parts)):
            known = "/".join(parts[start:])
            found = self._stations.get(known)
            if found is None:
                continue
            first = self.frames[found[0]]
            folders = parts[parts[0] == top_folder : start]
            alone = (len(found) == 1 or bool(first.station)) and (
                len(folders) < 3 or not first.match
            )
            tells = bool(first.match) and known.startswith(f"{_strip_suffix(first.match)}/")
            if alone or tells or not self._holders.find_other_folders(folders):
                return found
            return ()
        return ()

    def _find_frame_id(self, name: str) -> int | None:
        return self._find_with_passed_folders(name)[0]

    def _find_with_passed_folders(self, name: str) -> tuple[int | None, list[str]]:
        if name.startswith("file://"):
            name = unquote(name.removeprefix("file://"))
        stem = _strip_suffix(name)
        folder, slash, last = stem.rpartition("/")
        if stem in self._paths:
            return self._paths[stem], folder.split("/")
        found = self._find_by_end_of_path(stem)
        if found[0] is None and slash and _DIGITS.fullmatch(last):
            # Files of a static camera are called by their frames, ``cam3/000358.jpg``.
            return self._find_by_end_of_path(f"{folder}/{int(last)}")
        return found

    def _find_by_end_of_path(self, stem: str) -> tuple[int | None, list[str]]:
        parts = stem.split("/")
        for start in range(len(parts)):
            known = "/".join(parts[start:])
            passed = parts[:start]
            # 7_1 of a match that the dataset does not have is not the 7_1 that it has.
            if (
                known in self._telling
                or (not self._folders_tell and not any(_MATCH in part for part in passed))
                or not self._holders.find_other_folders(passed)
            ):
                found = self._index.get(known)
                if found is not None:
                    return found, passed
        return None, []


def _folders_tell_frames_apart(frames: Sequence[NamedFrame]) -> bool:
    """Whether a folder may name the match or the group of a frame."""
    if any(frame.match or frame.station or "/" in frame.view for frame in frames):
        return True
    groups = {frame.group for frame in frames}
    alone = len(groups) == 1 and any(frame.group != frame.view for frame in frames)
    return alone or len({_strip_suffix(frame.view) for frame in frames}) < len(frames)


def _parse_number(text: str) -> int | None:
    """A number as tables write it, ``4``, ``0004`` or ``4.0``."""
    found = _DIGITS.fullmatch(id_to_text(text) or "")
    return int(found[0]) if found else None


def _strip_suffix(name: str) -> str:
    return _SUFFIX.sub("", name.replace("\\", "/").strip().strip("/"))


def _own_names(frame: NamedFrame) -> set[str]:
    """The names of a frame in an export in which no other frame is called alike."""
    own = set() if frame.station else {_strip_suffix(frame.view)}
    return {name for name in own.union(_exported_names(frame, most=1)) if name}


def _distinguishing_names(frame: NamedFrame) -> set[str]:
    """Names that tell the match of a frame, or the group where it has no match."""
    view, group, match = (
        _strip_suffix(frame.view),
        _strip_suffix(frame.group),
        _strip_suffix(frame.match),
    )
    last = match.rsplit("/", 1)[-1]
    places = {match, last} if _MATCH in last else {match}
    within = _names_within_match(frame)
    if match:
        names = {f"{place}/{name}" for place in places for name in within}
    else:
        names = within if frame.station else set()
    if not frame.station:
        names.add(f"{group}/{view}")
        # Folders that may hold files of any match, as img1, do not tell it.
        if not match and HolderFolders().find_other_folders(view.split("/")[:-1]):
            names.add(view)
    return _add_separator_variants(names) | {name for name in _exported_names(frame) if name}


def _ambiguous_names(frame: NamedFrame) -> set[str]:
    """Names that another match could have as well."""
    last = _strip_suffix(frame.match).rsplit("/", 1)[-1]
    within = _names_within_match(frame)
    pictures = {
        _strip_suffix(frame.picture),
        _strip_suffix(frame.picture).rsplit("/", 1)[-1],
    } - {""}
    return pictures | _add_separator_variants(
        within | ({f"{last}/{name}" for name in within} if last else set())
    )


def _names_within_match(frame: NamedFrame) -> set[str]:
    """Names of a frame within its match."""
    view, group = _strip_suffix(frame.view), _strip_suffix(frame.group)
    return {f"{view}/{group}", f"{group}/{view}"} if frame.station else {view}


def _add_separator_variants(names: set[str]) -> set[str]:
    return names | {name.replace("/", glue) for name in names for glue in ("_", "__", "-")}


def _parse_frame_numbers(frame: NamedFrame) -> set[int]:
    """Numbers that a frame's view, picture or (static camera) group is called by."""
    names = {_strip_suffix(name).rsplit("/", 1)[-1] for name in (frame.view, frame.picture)}
    if frame.station:
        names = {_strip_suffix(frame.group)}
    found = (_NUMBER.fullmatch(name) for name in names)
    return {int(match[1]) for match in found if match}


def _exported_names(frame: NamedFrame, most: int = 3) -> Iterator[str]:
    """Names that our exports give to the frame, without the folder of a split.

    Args:
        frame: The frame.
        most: How many of its keys in an export (``list_possible_export_keys``) count.
    """
    station = Station(frame.station or frame.view, frame.size, shared=bool(frame.station))
    view = View(frame.view, station)
    group = Group(frame.group, (view,), match=frame.match)
    yield from list_frame_stems_in_split(group, view)
    for key in list_possible_export_keys(group, view)[:most]:
        called = with_export_key(view, key)
        yield _strip_suffix(frame_path_by_match(group, called, "", ".jpg"))
        lines = _strip_suffix(line_frame_path(group, called, "", ".jpg").rsplit("/", 1)[-1])
        # A plain number tells no match, and a static camera has one file of lines.
        if not frame.station and lines != _strip_suffix(frame.view).rsplit("/", 1)[-1]:
            yield lines
        if not frame.station and key != frame.view:
            yield _strip_suffix(view_file_path(group, called))
    for key in list_possible_export_keys(group, view, "_")[:most]:
        called = with_export_key(view, key)
        yield _strip_suffix(sequence_frame_path(group, called, "", ".jpg").split("/", 1)[-1])
