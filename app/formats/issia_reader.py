"""ISSIA, read: six static cameras, ViPER ground truth, ``issia_calibration.json``."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any

from app.formats.cameras import read_camera_files
from app.formats.file_tree import DEFAULT_LIMITS, FileTree, ImportLimits, Root
from app.formats.frame_names import IMAGE_SUFFIXES, VIDEO_SUFFIXES
from app.formats.issia import (
    CALIBRATION,
    DEFAULT_OFFSET,
    DEFAULT_SIZE,
    MATCH,
    FramePersons,
    find_cameras_with_mirrored_people,
    mirror_people,
)
from app.formats.report import ReaderReport
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_reader import read_line_files, read_line_files_of_tree
from app.formats.trees import FolderTree, open_tree_context
from app.formats.viper_reader import ViperVideo, is_viper_file, read_viper
from app.geometry.camera import Camera
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group, Media, Station, View
from app.soccer.split import TEST_CAMERAS
from app.wording import plural

# "Film Role-0 ID-3 T-0 ...", "cam3", "camera_3", "ground_truth_3": what follows says nothing.
_NUMBERED = (
    re.compile(r"\bID-(\d{1,3})\b", re.ASCII),
    re.compile(r"cam(?:era)?[ _-]?(\d{1,3})(?!\d)", re.ASCII | re.IGNORECASE),
    re.compile(r"(\d{1,3})(?!.*\d)", re.ASCII),
)
_XGTF = re.compile(r"\.xgtf(\.gz)?$", re.IGNORECASE)
_XML = re.compile(r"\.xml(\.gz)?$", re.IGNORECASE)
_VIDEO = re.compile(r"(?:cam(?:era)?[ _-]?\d{1,3}|Film Role.*\bID-\d{1,3}\b.*)", re.IGNORECASE)
_OWN_LINES = re.compile(r"lines/cam\d{1,3}\.json", re.ASCII)
_FRAME = re.compile(r"(?:frame[ _-]?)?(\d{1,9})", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True)
class IssiaOptions:
    """What the files do not say themselves.

    Attributes:
        frame_offset: Number of a frame = number in the XGTF file - offset; for all cameras, or
            by camera.
        flipped: Cameras whose frames are mirrored; annotations and calibration are not.
        lines: Folder (or zip) of ``cam1.json`` .. with the field lines of the static cameras.
        calibration: What counts for a camera that has both: ``lines``, or ``given``, and its lines are
            left aside; None: the given one, which is measured by its lines.
        size: Size of the annotated images; None: as the XGTF file says, else ISSIA's.
    """

    frame_offset: int | Mapping[int, int] = DEFAULT_OFFSET
    flipped: frozenset[int] = frozenset()
    lines: Root | None = None
    calibration: str | None = None
    size: ImageSize | None = None

    def get_image_size(self, track: ViperVideo) -> ImageSize:
        """Size of the images of a camera."""
        return self.size or track.size or DEFAULT_SIZE

    def get_frame_offset(self, camera: int) -> int:
        """Offset of one camera."""
        if isinstance(self.frame_offset, int):
            return self.frame_offset
        return self.frame_offset.get(camera, DEFAULT_OFFSET)


@dataclass
class IssiaFolder:
    """A folder as read: one track and one station per camera, by camera number."""

    tracks: dict[int, ViperVideo] = field(default_factory=dict)
    stations: dict[int, Station] = field(default_factory=dict)
    videos: dict[int, str] = field(default_factory=dict)
    frames: dict[tuple[int, int], Media] = field(default_factory=dict)

    def groups(self) -> Iterator[Group]:
        """Every frame with a ball annotation as a group, keyed by its number, in their order.

        Its views are the cameras that annotate the ball (``cam1`` ..), which share one station
        per camera. People of such a view are in its ``Extras.boxes``.
        """
        seen: dict[int, list[int]] = {}
        for camera in sorted(self.tracks):
            for frame in self.tracks[camera].balls:
                seen.setdefault(frame, []).append(camera)
        for frame in sorted(seen):
            cameras = seen[frame]
            views = tuple(self._make_view(camera, frame) for camera in cameras)
            split = _choose_split_of_cameras(cameras)
            yield Group(str(frame), views, match=MATCH, split=split, label=f"Frame {frame}")

    def persons_without_ball(self) -> Iterator[FramePersons]:
        """Persons of camera and frame pairs without a ball, which no group holds."""
        for camera in sorted(self.tracks):
            track = self.tracks[camera]
            for frame in sorted(track.persons):
                if frame not in track.balls:
                    boxes = _make_person_boxes(track, frame)
                    yield FramePersons(frame, f"cam{camera}", boxes)

    def _make_view(self, camera: int, frame: int) -> View:
        track = self.tracks[camera]
        balls = tuple(
            BallAnnotation(box=ball) if isinstance(ball, Box) else BallAnnotation(point=ball)
            for ball in track.balls[frame]
        )
        notes = track.ball_notes.get(frame)
        extras = Extras(_make_person_boxes(track, frame), (), {"ball": notes} if notes else {})
        media = self.frames.get((camera, frame))
        if media is None and camera in self.videos:
            media = Media(self.videos[camera], frame=frame)
        return View(f"cam{camera}", self.stations[camera], balls, media, extras=extras)


def _make_person_boxes(track: ViperVideo, frame: int) -> tuple[Mapping[str, Any], ...]:
    """Boxes in the shape of SoccerNet's, so that all datasets show them alike; by id."""
    persons = sorted(track.persons.get(frame, ()), key=lambda item: (item[0].zfill(12), item[1:]))
    return tuple(
        {
            "class": "Person",
            "ID": identity,
            "points": {"x1": x, "y1": y, "x2": x + width, "y2": y + height},
        }
        for identity, x, y, width, height in persons
    )


def _choose_split_of_cameras(cameras: list[int]) -> str:
    """The split of a frame; empty where cameras of both see it."""
    sides = {"test" if f"cam{camera}" in TEST_CAMERAS else "train" for camera in cameras}
    return sides.pop() if len(sides) == 1 else ""


def open_issia(
    folder: Root, options: IssiaOptions, report: ReaderReport, limits: ImportLimits = DEFAULT_LIMITS
) -> IssiaFolder:
    """Read a folder (or zip) once, for its groups and its persons.

    XGTF files (plain or .gz, ``.xgtf`` or ``.xml``) may lie anywhere below it; the camera's number
    comes from the file's name, or from those of its sources where it has several. ``issia_calibration.json`` gives the cameras. Line files are those of
    ``options.lines``, else ``lines/cam1.json`` .. of the folder itself.
    """
    found = IssiaFolder()
    with open_tree_context(folder, report, limits) as tree:
        if tree is None:
            return found
        names = tree.names()
        _read_viper_videos(tree, names, options, found, report, limits)
        add_stations_and_media(found, tree, names, options, report, limits)
    report_annotation_counts(found, report)
    return found


def add_stations_and_media(
    found: IssiaFolder,
    tree: FileTree,
    names: list[str],
    options: IssiaOptions,
    report: ReaderReport,
    limits: ImportLimits,
) -> None:
    """Give each camera that has a track its station and its media."""
    given = _read_given_cameras(tree, names, report)
    _index_camera_media(tree, names, found)
    sizes = {camera: options.get_image_size(track) for camera, track in found.tracks.items()}
    lines: dict[int, LineFile] = {}
    drawn = set[int]()
    for index, size in enumerate(dict.fromkeys(sizes.values())):
        # Each file is read for the size of its own camera; what is wrong with it is told once.
        own_report = ReaderReport() if index else report
        if options.lines is None:
            read = _read_exported_lines(tree, names, size, own_report)
        else:
            read = _read_lines(options.lines, size, own_report, limits)
        drawn |= read.keys()
        lines |= {camera: file for camera, file in read.items() if sizes.get(camera) == size}
    for camera, size in sizes.items():
        station = _make_station(camera, given.get(camera), lines.get(camera), options, size)
        found.stations[camera] = station
    widths = {camera: size.width for camera, size in sizes.items()}
    mirrored = find_cameras_with_mirrored_people(found.tracks, given, widths)
    for camera in mirrored:
        found.tracks[camera] = mirror_people(found.tracks[camera], widths[camera])
    if mirrored:
        report.add_remark(
            f"People of {' and '.join(f'cam{camera}' for camera in mirrored)} are turned left to "
            "right: ISSIA's files hold them mirrored, and the balls as the cameras see them."
        )
    _report_unused_cameras(found, {"camera": list(given), "line file": list(drawn)}, report)


def _report_unused_cameras(
    found: IssiaFolder, brought: Mapping[str, Sequence[int]], report: ReaderReport
) -> None:
    """Say which numbers of cameras came without ground truth of that camera."""
    for what, numbers in brought.items():
        unused = sorted(set(numbers) - found.tracks.keys())
        if unused and found.tracks:
            names = ", ".join(f"cam{number}" for number in unused)
            report.add_remark(
                f"{what} of {names} not used: there is no ground truth of that camera"
            )


def parse_camera_number(name: str, *, strict: bool = False) -> int | None:
    """Number of the camera that a file's name speaks of; ``strict``: not any last number.

    Example:
        >>> parse_camera_number("Film Role-0 ID-3 T-0 m00s00-026.xgtf"), parse_camera_number("ground_truth_5")
        (3, 5)
    """
    for pattern in _NUMBERED[: -1 if strict else None]:
        found = pattern.search(name)
        if found:
            return int(found[1])
    return None


def _read_viper_videos(
    tree: FileTree,
    names: list[str],
    options: IssiaOptions,
    found: IssiaFolder,
    report: ReaderReport,
    limits: ImportLimits,
) -> None:
    files = [name for name in names if _XGTF.search(name)]
    for name in (name for name in names if _XML.search(name)):
        if is_viper_file(tree, name):
            files.append(name)
        else:
            report.add_problem_at(
                tree.shown(name), None, None, "is XML of another kind than XGTF; left out"
            )
    if not files:
        report.add_problem_at(str(tree.path), None, None, "contains no XGTF file")
    for name in files:
        shown, stem = tree.shown(name), re.sub(r"(?i)\.\w+(\.gz)?$", "", PurePosixPath(name).name)
        for camera, track in _assign_videos_to_cameras(
            stem, read_viper(tree, name, report, limits), shown, report
        ):
            if camera is None:
                report.add_problem_at(shown, None, None, "has no camera number in its name")
            elif camera in found.tracks:
                report.add_problem_at(
                    shown,
                    None,
                    None,
                    f"is left out: another file of camera {camera} was read already",
                )
            else:
                found.tracks[camera] = _shift_frames(track, options.get_frame_offset(camera))
                _report_size_difference(camera, track, shown, options, report)
                if not track.balls:
                    report.add_remark(f"{shown} contains no ball for camera {camera}.")


def _assign_videos_to_cameras(
    stem: str, tracks: list[ViperVideo], shown: str, report: ReaderReport
) -> Iterator[tuple[int | None, ViperVideo]]:
    """Each source of a file with the number of its camera.

    One source is that of the file. Of several each must name its own camera; where they do not,
    the first is that of the file, and the others are reported.
    """
    named = [
        parse_camera_number(PurePosixPath(track.source.replace("\\", "/")).stem, strict=True)
        for track in tracks
    ]
    if len(tracks) > 1 and None not in named and len(set(named)) == len(named):
        yield from zip(named, tracks, strict=True)
        return
    yield parse_camera_number(stem), tracks[0]
    for number, track in enumerate(tracks[1:], 2):
        balls, persons = track.ball_point_count, track.person_box_count
        report.add_problem_at(
            shown,
            f"source {number} ({track.source})",
            None,
            f"is left out with {plural(balls, 'ball')} and {plural(persons, 'person')}: its file "
            "name has no camera number, such as cam2",
        )


def _report_size_difference(
    camera: int, track: ViperVideo, shown: str, options: IssiaOptions, report: ReaderReport
) -> None:
    """Say which size counts where file and options differ."""
    size = options.get_image_size(track)
    if track.size is not None and track.size != size:
        report.add_remark(
            f"{shown}: the file says {track.size.width} x {track.size.height} for camera {camera}, "
            f"and {size.width} x {size.height} was asked for (--size), which is used."
        )


def _shift_frames(track: ViperVideo, offset: int) -> ViperVideo:
    return ViperVideo(
        {frame - offset: points for frame, points in track.balls.items()},
        {frame - offset: boxes for frame, boxes in track.persons.items()},
        {frame - offset: notes for frame, notes in track.ball_notes.items()},
        track.source,
        track.size,
    )


def _read_given_cameras(
    tree: FileTree, names: list[str], report: ReaderReport
) -> dict[int, Camera]:
    files = [name for name in names if PurePosixPath(name).name == CALIBRATION]
    if not files:
        return {}
    for name in files[1:]:
        report.add_problem_at(
            tree.shown(name), None, None, f"is a second {CALIBRATION}; {files[0]} is used"
        )
    side = ReaderReport()
    cameras = read_camera_files(tree, files[:1], side)
    for problem in side.problems:
        report.add_problem(problem)
    shown, given = tree.shown(files[0]), dict[int, Camera]()
    for name, camera in cameras.items():
        number = parse_camera_number(PurePosixPath(name).name)
        if number is None:
            report.add_problem_at(
                shown, name[:80], None, "has no camera number in its name; left out"
            )
        elif given.setdefault(number, camera) is not camera:
            report.add_problem_at(shown, name[:80], None, f"is a second camera {number}; left out")
    return given


def _read_lines(
    path: Root, size: ImageSize, report: ReaderReport, limits: ImportLimits
) -> dict[int, LineFile]:
    side = ReaderReport()
    return _index_line_files_by_camera(read_line_files(path, size, side, limits), side, report)


def _read_exported_lines(
    tree: FileTree, names: list[str], size: ImageSize, report: ReaderReport
) -> dict[int, LineFile]:
    """Lines that an export of this format laid beside the ground truth."""
    own, side = [name for name in names if _OWN_LINES.fullmatch(name)], ReaderReport()
    return _index_line_files_by_camera(read_line_files_of_tree(tree, own, size, side), side, report)


def _index_line_files_by_camera(
    files: Iterator[LineFile], side: ReaderReport, report: ReaderReport
) -> dict[int, LineFile]:
    lines: dict[int, LineFile] = {}
    for file in files:
        number = parse_camera_number(PurePosixPath(file.stem).name)
        if number is None:
            sentence = "has no camera number in its name; left out"
            report.add_problem_at(f"{file.place}.json", None, None, sentence)
        elif lines.setdefault(number, file) is not file:
            sentence = f"is a second file of lines of camera {number}; left out"
            report.add_problem_at(f"{file.place}.json", None, None, sentence)
    for problem in side.problems:
        report.add_problem(problem)
    return lines


def _make_station(
    camera: int,
    given: Camera | None,
    lines: LineFile | None,
    options: IssiaOptions,
    size: ImageSize,
) -> Station:
    left_aside = options.calibration == "given" and given is not None
    return Station(
        key=f"cam{camera}",
        size=size,
        shared=True,
        lines=lines.lines if lines and not left_aside else {},
        given=given,
        calibration=options.calibration or "given",
        flipped=camera in options.flipped,
    )


def _index_camera_media(tree: FileTree, names: list[str], found: IssiaFolder) -> None:
    """Videos ``cam3.mp4`` and frames ``cam3/000123.jpg``, where they lie in the folder.

    Their numbers count as the groups' keys do.
    """
    if not tree.path.is_dir():
        return
    for name in names:
        place = PurePosixPath(name)
        suffix = place.suffix.lower()
        if suffix in VIDEO_SUFFIXES and _VIDEO.fullmatch(place.stem):
            camera = parse_camera_number(place.stem)
            # A video is opened as a file of this machine.
            if camera is not None and isinstance(tree, FolderTree):
                found.videos.setdefault(camera, tree.shown(name))
        elif suffix in IMAGE_SUFFIXES and _VIDEO.fullmatch(place.parent.name):
            camera, number = parse_camera_number(place.parent.name), _FRAME.fullmatch(place.stem)
            if camera is not None and number:
                found.frames.setdefault((camera, int(number[1])), tree.media(name))


def report_annotation_counts(found: IssiaFolder, report: ReaderReport) -> None:
    """Note what a folder held."""
    balls = {frame for track in found.tracks.values() for frame in track.balls}
    persons = {frame for track in found.tracks.values() for frame in track.persons}
    report.read += len(balls)
    report.imported += len(balls)
    report.counts["ball points"] += sum(t.ball_point_count for t in found.tracks.values())
    report.counts["persons"] += sum(t.person_box_count for t in found.tracks.values())
    report.counts["frames with persons only"] += len(persons - balls)
