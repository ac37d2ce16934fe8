"""Frames that share something: those of one match, its pitch and how its pictures were stretched, or of one tripod.

Frames of one camera that stands still say together which pitch they show; the files of their cameras
get covariances that know it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.errors import DatasetFormatError, GeometryError, InputError
from app.features.file_tools.output_folder import write_out_file
from app.features.file_tools.track import pitch_to_row
from app.formats.cameras import camera_file_name, format_camera_file
from app.formats.csv_text import read_rows
from app.formats.file_tree import ImportLimits
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.formats.safe_path import read_regular_file, resolve_inside
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_reader import read_line_files
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera
from app.paint.frame_pitch import find_shared_pitch
from app.paint.snap import SnappedCamera
from app.soccer.frames import ImageSize
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.solving.match_picture import PictureEstimate, PictureFrameLines, estimate_match_picture
from app.solving.match_position import (
    NO_PLACES,
    FrameCameraPlace,
    FrameCameraPlaces,
    guess_match_of_each_frame,
)
from app.solving.pitch_size import PitchSizeFrameLines, estimate_pitch

ONE = "one"
"""Of ``--tripod``: all pictures are of one camera."""


@dataclass(frozen=True)
class OtherFramesCameraPlaces:
    """What a frame gets from the others of its match: their places. ``match`` is its name."""

    match: str
    others: FrameCameraPlaces


def read_match_of_each_frame(path: Path, report: ReaderReport | None = None) -> dict[str, str]:
    """The match of each frame: a JSON object, or a CSV file with columns ``frame`` and ``match``.

    A frame is the stem of its line file, ``00002`` or ``folder/00002``. One whose match is empty
    has none.

    Args:
        path: The file.
        report: Gets the rows of a CSV file that name no match.

    Raises:
        DatasetFormatError: The file is neither.
    """
    report = ReaderReport() if report is None else report
    content = path.read_bytes()
    if path.suffix.lower() == ".json":
        value = read_json(content, str(path))
        if not isinstance(value, dict) or not all(isinstance(it, str) for it in value.values()):
            raise DatasetFormatError(
                str(path),
                None,
                None,
                "is not a JSON object that maps each frame name to a match name",
            )
        return {frame: match for frame, match in value.items() if match}
    rows = read_rows(content, str(path), ("frame", "match"), ImportLimits())
    named = {}
    for line, row in rows:
        cells = {name: row.get(name, "").strip() for name in ("frame", "match")}
        empty = next((name for name, cell in cells.items() if not cell), None)
        if empty is None:
            named[cells["frame"]] = cells["match"]
        else:
            report.add_problem_at(str(path), f"line {line}", empty, "is empty; the row is left out")
    return named


def require_named_frame(named: Mapping[str, str], frames: Sequence[str], path: Path) -> None:
    """Raise InputError where a file of matches names none of some frames."""
    if not any(frame in named for frame in frames):
        raise InputError(f"{path} names none of the {len(frames)} frames, such as {frames[0]}")


def collect_camera_places_of_other_frames(
    files: Sequence[LineFile],
    places: Sequence[FrameCameraPlace | None],
    named: Mapping[str, str] | None,
) -> list[OtherFramesCameraPlaces]:
    """What each frame gets from the others of its match.

    Args:
        files: The frames.
        places: Where each alone puts its camera.
        named: Match by frame; a frame that is missing is alone. None: matches are guessed.
    """
    if named is None:
        order = sorted(range(len(files)), key=lambda index: files[index].stem)
        guessed = guess_match_of_each_frame([places[index] for index in order])
        match = {files[index].stem: str(run) for index, run in zip(order, guessed, strict=True)}
    else:
        match = {file.stem: named.get(file.stem, "") for file in files}
    members = defaultdict(list)
    for index, file in enumerate(files):
        members[match[file.stem]].append(index)
    shares = [OtherFramesCameraPlaces(match[file.stem], NO_PLACES) for file in files]
    for name, indices in members.items():
        if not name:
            continue
        known = {index: place for index in indices if (place := places[index]) is not None}
        all_ = FrameCameraPlaces(list(known.values()))
        row = {index: at for at, index in enumerate(known)}
        for index in indices:
            others = all_.without_frame(row[index]) if index in row else all_
            shares[index] = OtherFramesCameraPlaces(name, others)
    return shares


def estimate_pitch_of_files(source: Path, *, size: ImageSize) -> dict[str, Any]:
    """Length and width of the pitch that the line files of one match show; null: not shown.

    Raises:
        InputError: There is no line file.
        DegenerateGeometryError: Too few show enough markings.
    """
    report = ReaderReport()
    frames = [
        PitchSizeFrameLines(file.lines, size) for file in read_line_files(source, size, report)
    ]
    if not frames:
        raise report.make_refusal_error(f"{source} contains no line files")
    found = estimate_pitch(frames, CLICKED)
    return {
        "length_m": found.length,
        "width_m": found.width,
        "length_sigma_m": found.length_sigma_m,
        "width_sigma_m": found.width_sigma_m,
        "frames": found.frames,
        "problems": [problem.message for problem in report.problems],
    }


def estimate_picture_geometry_of_files(source: Path, *, size: ImageSize) -> dict[str, Any]:
    """How the pictures of line files were stretched or cropped, as ``read_picture_geometry`` reads it.

    Raises:
        InputError: There is no line file.
        DegenerateGeometryError: Too few show enough markings.
    """
    report = ReaderReport()
    files = list(read_line_files(source, size, report))
    if not files:
        raise report.make_refusal_error(f"{source} contains no line files")
    found = _estimate_picture_geometry(files, size)
    values = _picture_estimate_to_json(found)
    return {**values, "problems": [problem.message for problem in report.problems]}


def choose_picture_geometry(
    files: Sequence[LineFile], size: ImageSize, given: Path | None
) -> tuple[PictureGeometry | None, dict[str, Any]]:
    """The picture to calibrate line files with, and what ``calibrate.json`` says of it.

    Args:
        files: Of one match or shot.
        size: Of their images.
        given: File that ``touchline picture --json`` wrote; None: estimated here, and used only
            where something certainly happened to the pictures.
    """
    if given is not None:
        picture = read_picture_geometry(given)
        return picture, {"aspect": picture.aspect, "shift": [*picture.shift]}
    try:
        found = _estimate_picture_geometry(files, size)
    except GeometryError as error:
        return None, {"problem": error.message}
    return found.proposal, _picture_estimate_to_json(found)


def read_picture_geometry(path: Path) -> PictureGeometry:
    """A picture as ``touchline picture --json`` writes it; numbers that are absent are nothing.

    Raises:
        DatasetFormatError: The file holds something else.
    """
    value = read_json(read_regular_file(path), str(path))
    try:
        assert isinstance(value, dict)
        right, down = value.get("shift", (0.0, 0.0))
        aspect, x, y = value.get("sigma", (0.0, 0.0, 0.0))
        return PictureGeometry(
            float(value.get("aspect", 1.0)),
            (float(right), float(down)),
            (float(aspect), float(x), float(y)),
        )
    except (AssertionError, TypeError, ValueError) as error:
        problem = "is not what touchline picture --json writes"
        raise DatasetFormatError(str(path), None, None, problem) from error


def map_points_to_original_pictures(
    files: Sequence[LineFile], picture: PictureGeometry | None
) -> list[LineFile]:
    """Line files with their points where the pictures as they were taken show them."""
    if picture is None:
        return list(files)
    return [
        replace(file, lines=picture.lines_in_original_picture(file.lines, file.size))
        for file in files
    ]


def _estimate_picture_geometry(files: Sequence[LineFile], size: ImageSize) -> PictureEstimate:
    frames = [PictureFrameLines(file.lines, size) for file in files]
    return estimate_match_picture(frames, CLICKED)


def _picture_estimate_to_json(found: PictureEstimate) -> dict[str, Any]:
    return {
        "aspect": found.picture.aspect,
        "shift": [*found.picture.shift],
        "sigma": [*found.picture.sigma],
        "frames": found.frames,
        "changed": found.proposal is not None,
    }


@dataclass(frozen=True)
class SnappedFrame:
    """A camera on its paint, and its file.

    Attributes:
        frame: Name of the frame.
        snapped: Pixels of the picture.
        camera: As its file has it.
        size: Of the picture, as the file has it.
        pitch: On which it lies.
    """

    frame: str
    snapped: SnappedCamera
    camera: Camera
    size: ImageSize
    pitch: Pitch


def refine_shared_tripod_cameras(
    drawn: Sequence[SnappedFrame],
    tripod: str | None,
    rows: Sequence[dict[str, Any]],
    out: Path,
    report: ReaderReport | None = None,
) -> None:
    """Write cameras of frames of one tripod again, with what they know together.

    Args:
        drawn: All cameras that lie on paint.
        tripod: ``one``, or a file that names the camera of each frame; None: nothing is known.
        rows: Of all frames; those of a tripod get ``shown``, the pitch that they show.
        out: Folder of the camera files.
        report: Gets the rows of the file that name no camera.

    Raises:
        InputError: The file cannot be read, or names no frame, or ``out`` cannot be written.
    """
    if tripod is None:
        return
    by_camera: dict[str, list[SnappedFrame]] = {}
    named = None if tripod == ONE else _read_camera_names(Path(tripod), rows, report)
    for each in drawn:
        name = ONE if named is None else named.get(each.frame, "")
        if name:
            by_camera.setdefault(name, []).append(each)
    by_frame = {row["frame"]: row for row in rows}
    for frames in by_camera.values():
        if len({each.pitch for each in frames}) > 1:
            continue
        shared = find_shared_pitch(
            [each.snapped for each in frames], frames[0].pitch, CalibrationPolicy()
        )
        if shared is None:
            continue
        shown, covariances = shared
        for each, covariance in zip(frames, covariances, strict=True):
            by_frame[each.frame]["shown"] = pitch_to_row(shown, on_shown=False)
            text = format_camera_file(each.camera, flatten_covariance(covariance), each.size)
            write_out_file(resolve_inside(out, camera_file_name(each.frame)), text)


def _read_camera_names(
    file: Path, rows: Sequence[Mapping[str, Any]], report: ReaderReport | None
) -> dict[str, str]:
    """The camera of each frame, as ``calibrate --matches`` reads matches."""
    if not file.is_file():
        raise InputError(
            f'"{file}" is not {ONE}, and there is no such file',
            hint="Give a CSV file with the columns frame and match, or a JSON object of frame names and matches.",
        )
    named = read_match_of_each_frame(file, report)
    require_named_frame(named, [row["frame"] for row in rows], file)
    return named
