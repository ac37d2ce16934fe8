"""Frames of foreign COCO files: their pictures, what several files say of one, and their groups.

The same frame in two files (captions beside instances) is one frame; frames of one name in
different folders or subsets (CVAT's ``Train`` and ``Validation``) are two.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import unquote

from app.formats.file_tree import FileTree
from app.formats.picture_finder import (
    PICTURE_FOLDERS,
    LabelLocation,
    PictureFinder,
    PictureSearchResult,
    drop_contested_pictures,
    split_picture_name,
)
from app.formats.report import ReaderReport
from app.formats.split_names import parse_split_name
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch
from app.wording import plural

SAME_PX = 1.0
"""How far two annotations of one ball may be apart, pixels: files round."""
_SHOWN = 5
"""Names that a sentence lists."""


@dataclass
class CocoFrame:
    """One image of a foreign file, and what was said of it.

    Attributes:
        path: The file, for problems.
        record: The image in it.
        parts: Its name as ``split_picture_name`` gives it.
        key: Its name as a key; unlike ``parts`` without the folders of another machine.
        group: Its ``group_id``, or None.
        view: Name of the view in that group.
        named: Whether the file says that name; else it is the last part of the key.
        place: Name of its picture in the tree, once it is found.
    """

    path: str
    record: str
    parts: tuple[str, ...]
    key: str
    group: str | None
    view: str
    size: ImageSize
    split: str
    camera: Camera | None
    balls: list[BallAnnotation] = field(default_factory=list)
    boxes: list[Mapping[str, Any]] = field(default_factory=list)
    named: bool = False
    place: str | None = None
    scope: str = ""

    @property
    def identity(self) -> tuple[str, ...]:
        """The same for the same frame: its picture, else its name among those of its set."""
        return (self.place,) if self.place is not None else ("", self.scope, *self.parts)


@dataclass
class CocoFileFrames:
    """The frames of one file, and where that lies."""

    path: str
    home: LabelLocation
    frames: list[CocoFrame]

    @property
    def scope(self) -> str:
        """The set that it is about: files of one set speak of the same frames."""
        return "/".join(part for part in (self.home.root, self.home.subset) if part)


def group_frames(
    files: Sequence[CocoFileFrames],
    tree: FileTree,
    names: Sequence[str],
    calibration: str,
    report: ReaderReport,
) -> Iterator[Group]:
    """The groups of all files, each frame once.

    Args:
        files: As they were read.
        tree: Where the pictures lie.
        names: Of its files.
        calibration: What counts for a view that has a camera and lines.
        report: Takes contradictions, and pictures that are missing or cannot be told apart.
    """
    finder = PictureFinder(names)
    for file in _mark_folders_of_other_files(files):
        _assign_pictures_to_frames(file, finder, report)
    frames = _merge_frames(files, report)
    for key, members in _group_by_key(frames, report):
        views = tuple(_make_view(key, frame, tree, calibration) for frame in members)
        report.imported += len(views)
        report.counts["balls"] += sum(len(view.balls) for view in views)
        yield Group(
            key,
            views,
            "",
            Pitch(),
            _choose_split(members, key, report),
            _group_label(members[0], key),
        )


def _mark_folders_of_other_files(files: Sequence[CocoFileFrames]) -> Iterator[CocoFileFrames]:
    """The files, each knowing which pictures are those of others."""
    subsets = {file.home.subset.lower() for file in files} - {"", "default", *PICTURE_FOLDERS}
    roots = {file.home.root for file in files} - {""}
    for file in files:
        home, own = file.home, {file.home.subset.lower()}
        around = {root for root in roots if f"{home.root}/".startswith(f"{root}/")}
        file.home = replace(
            home, strange=frozenset(subsets - own), elsewhere=frozenset(roots - around)
        )
        for frame in file.frames:
            frame.scope = file.scope
        yield file


def _assign_pictures_to_frames(
    file: CocoFileFrames, finder: PictureFinder, report: ReaderReport
) -> None:
    first: dict[tuple[str, ...], CocoFrame] = {}
    for frame in file.frames:
        first.setdefault(frame.parts, frame)
    found = drop_contested_pictures(
        {parts: _find_picture(parts, file.home, finder) for parts in first}
    )
    for frame in file.frames:
        frame.place = found[frame.parts].place
    _report_picture_problems(file, found, first, finder, report)


def _find_picture(
    parts: tuple[str, ...], home: LabelLocation, finder: PictureFinder
) -> PictureSearchResult:
    found = finder.find_picture(parts, home)
    if found == PictureSearchResult() and any("%" in part for part in parts):
        # Written as a part of an address: a%20b.jpg.
        return finder.find_picture(split_picture_name(unquote("/".join(parts))), home)
    return found


def _report_picture_problems(
    file: CocoFileFrames,
    found: Mapping[tuple[str, ...], PictureSearchResult],
    first: Mapping[tuple[str, ...], CocoFrame],
    finder: PictureFinder,
    report: ReaderReport,
) -> None:
    """What cannot be told apart, one by one; what is missing or was guessed, once a file."""
    missing, guessed = [], []
    for parts, item in found.items():
        frame, name = first[parts], "/".join(parts)
        if item.rivals:
            fits = " and ".join(item.rivals)
            problem = f"has no picture of its own: {fits} cannot be told apart by {name}"
            if len(item.rivals) == 1:
                problem = f"has no picture of its own: {fits} fits another image as well"
            report.add_problem_at(
                file.path, frame.record, "file_name", f"{problem}; write the folder before the name"
            )
        elif item.place is None:
            missing.append(name)
        elif item.parts < len(parts):
            guessed.append(f"{name} is {item.place}")
    if guessed:
        report.add_remark(
            f"{file.path}: {plural(len(guessed), 'picture was', 'pictures were')} found by the end of"
            f" the name: {_format_first_names(guessed)}"
        )
    if missing:
        where = ", ".join(
            f"{folder or '.'}/" for folder in list(file.home.list_picture_folders())[:_SHOWN]
        )
        sentence = (
            f"{plural(len(missing), 'picture was', 'pictures were')} not found: {_format_first_names(missing)}"
            f" (looked in {where} and everywhere else)"
        )
        if finder.has_pictures:
            report.add_problem_at(file.path, None, "file_name", sentence)
        else:
            report.add_remark(f"{file.path}: {sentence}")


def _merge_frames(files: Sequence[CocoFileFrames], report: ReaderReport) -> list[CocoFrame]:
    """Each frame once, with all that the files say of it."""
    known: dict[tuple[str, ...], list[CocoFrame]] = {}
    frames: list[CocoFrame] = []
    for file in files:
        for frame in file.frames:
            same = known.setdefault(frame.identity, [])
            # A picture may be a view of several groups; who names no group speaks of any.
            other = next((item for item in same if _is_same_view(item, frame)), None)
            if other is None:
                same.append(frame)
                frames.append(frame)
            else:
                _merge_records_of_frame(other, frame, report)
    return frames


def _is_same_view(one: CocoFrame, other: CocoFrame) -> bool:
    if one.group is None or other.group is None:
        return True
    return (one.group, one.view) == (other.group, other.view)


def _merge_records_of_frame(frame: CocoFrame, other: CocoFrame, report: ReaderReport) -> None:
    """Add what another record says of a frame; what contradicts is named, and the first one counts."""
    first = f"{frame.path}, {frame.record}" if other.path != frame.path else frame.record
    if other.size != frame.size:
        report.add_problem_at(
            other.path,
            other.record,
            "width",
            f"is {other.size.width}x{other.size.height}, and the same image is"
            f" {frame.size.width}x{frame.size.height} in {first}; this record is left out",
        )
        return
    if frame.group is None:
        frame.group, frame.view, frame.named = other.group, other.view, other.named
    if frame.camera is None:
        frame.camera = other.camera
    elif other.camera is not None and other.camera != frame.camera:
        problem = f"differs from the camera in {first}, which is used"
        report.add_problem_at(other.path, other.record, "camera", problem)
    if not frame.split:
        frame.split = other.split
    elif other.split and other.split != frame.split:
        problem = (
            f"puts this image into the split {other.split}, and {first} puts it into"
            f" {frame.split}; {frame.split} counts"
        )
        report.add_problem_at(other.path, other.record, "split", problem)
    for ball in other.balls:
        _add_ball(frame, ball, other, first, report)
    shown = [_class_and_points(box) for box in frame.boxes]
    frame.boxes += [box for box in other.boxes if _class_and_points(box) not in shown]


def _class_and_points(box: Mapping[str, Any]) -> tuple[Any, Any]:
    return box.get("class"), box.get("points")


def _add_ball(
    frame: CocoFrame, ball: BallAnnotation, other: CocoFrame, first: str, report: ReaderReport
) -> None:
    for place, known in enumerate(frame.balls):
        if _is_same_ball(known, ball):
            occluded = known.occluded or ball.occluded
            kept = ball if known.box is None and ball.box is not None else known
            frame.balls[place] = replace(kept, occluded=occluded)
            return
    if frame.balls:
        report.add_problem_at(
            other.path,
            other.record,
            "annotations",
            f"places the ball elsewhere than {first} does; both are kept, and a person has to choose",
        )
    frame.balls.append(ball)


def _is_same_ball(one: BallAnnotation, other: BallAnnotation) -> bool:
    """Whether two annotations are of one ball: equal boxes, or a point that lies in the box."""
    if one.box is not None and other.box is not None:
        sides = zip(_box_corners(one.box), _box_corners(other.box), strict=True)
        return all(abs(a - b) <= SAME_PX for a, b in sides)
    if one.center is None or other.center is None:
        return False
    reach = [max(item.box.width, item.box.height) / 2 for item in (one, other) if item.box]
    apart = max(abs(one.center.x - other.center.x), abs(one.center.y - other.center.y))
    return apart <= max([SAME_PX, *reach])


def _box_corners(box: Box) -> tuple[float, ...]:
    return box.x, box.y, box.x + box.width, box.y + box.height


def _group_by_key(
    frames: Sequence[CocoFrame], report: ReaderReport
) -> Iterator[tuple[str, list[CocoFrame]]]:
    """Groups by key; where sets of frames use one key for different frames, each has its own."""
    groups: dict[str, list[CocoFrame]] = {}
    for frame in frames:
        groups.setdefault(frame.key if frame.group is None else frame.group, []).append(frame)
    taken = set(groups)
    for key, members in groups.items():
        _add_folders_to_view_names(members)
        views = Counter(frame.view for frame in members)
        scopes = list(dict.fromkeys(frame.scope for frame in members))
        if max(views.values()) == 1 or len(scopes) == 1:
            yield key, _drop_duplicate_frames(key, members, report)
            continue
        # The views of one name are of different sets, so that their groups are, too.
        for scope in scopes:
            own = [frame for frame in members if frame.scope == scope]
            name = f"{scope}/{key}" if scope else key
            while name != key and name in taken:
                name = f"{scope}/{name}"
            taken.add(name)
            yield name, _drop_duplicate_frames(name, own, report)


def _add_folders_to_view_names(frames: Sequence[CocoFrame]) -> None:
    """Give views that no file names, and whose files have one name, their folders as well."""
    if len({frame.split for frame in frames}) > 1:
        return
    for long in (lambda frame: frame.key, lambda frame: "/".join((frame.scope, frame.key))):
        views = Counter(frame.view for frame in frames)
        for frame in frames:
            if frame.group is not None and not frame.named and views[frame.view] > 1:
                frame.view = long(frame).strip("/")


def _drop_duplicate_frames(
    key: str, frames: Sequence[CocoFrame], report: ReaderReport
) -> list[CocoFrame]:
    """The frames of a group, one of each name."""
    views: dict[str, CocoFrame] = {}
    for frame in frames:
        other = views.setdefault(frame.view, frame)
        if other is not frame:
            problem = (
                f"is a second view {frame.view} of group {key}, with another picture than"
                f" {other.record}; left out"
            )
            report.add_problem_at(frame.path, frame.record, "view", problem)
    return list(views.values())


def _make_view(group: str, frame: CocoFrame, tree: FileTree, calibration: str) -> View:
    # A group of one view is the place of its frame, and so is its camera.
    alone = frame.group is None
    key = group if alone else frame.view
    station = Station(key if alone else f"{group}/{key}", frame.size, calibration=calibration)
    if frame.camera is not None:
        station = station.with_given_camera(frame.camera)
    media = None if frame.place is None else tree.media(frame.place)
    return View(key, station, tuple(frame.balls), media, extras=Extras(tuple(frame.boxes)))


def _choose_split(frames: Sequence[CocoFrame], key: str, report: ReaderReport) -> str:
    splits = list(dict.fromkeys(frame.split for frame in frames if frame.split))
    for other in splits[1:]:
        frame = next(item for item in frames if item.split == other)
        problem = f"puts a view of group {key} into {other}, another one is in {splits[0]}"
        report.add_problem_at(
            frame.path, frame.record, "split", f"{problem}; the group is in {splits[0]}"
        )
    return splits[0] if splits else ""


def _group_label(frame: CocoFrame, key: str) -> str:
    kind = "Image" if frame.group is None else "Group"
    return f"{kind} {PurePosixPath(key).name}"


def find_split_in_folders(parts: Sequence[str]) -> str:
    """The split that the innermost folder of a name says; empty where none does."""
    return next((split for part in reversed(parts) if (split := parse_split_name(part))), "")


def _format_first_names(items: Sequence[str]) -> str:
    return ", ".join(items[:_SHOWN]) + (", ..." if len(items) > _SHOWN else "")
