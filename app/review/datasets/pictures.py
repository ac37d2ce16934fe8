"""Pictures of line files: how they were stretched or cropped, told, read and used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from app.datasets.json_text import read_json
from app.datasets.plain_file import read_plain
from app.datasets.report import Report
from app.datasets.sn_calibration import LineFile
from app.datasets.sn_calibration_reader import read_line_files
from app.errors import DatasetFormatError, GeometryError
from app.soccer.frames import ImageSize
from app.soccer.picture import PictureGeometry
from app.soccer.policy import CLICKED
from app.solving.match_picture import PictureEstimate, PictureFrame, estimate_match_picture


def estimate_picture_of_files(source: Path, *, size: ImageSize) -> dict[str, Any]:
    """How the pictures of line files were stretched or cropped, as ``read_picture`` reads it.

    Raises:
        InputError: There is no line file.
        DegenerateGeometryError: Too few show enough markings.
    """
    report = Report()
    files = list(read_line_files(source, size, report))
    if not files:
        raise report.refusal(f"{source} holds no line files")
    found = _estimated(files, size)
    values = _values(found)
    return {**values, "problems": [problem.message for problem in report.problems]}


def picture_for(
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
        picture = read_picture(given)
        return picture, {"aspect": picture.aspect, "shift": [*picture.shift]}
    try:
        found = _estimated(files, size)
    except GeometryError as error:
        return None, {"problem": error.message}
    return found.proposal, _values(found)


def read_picture(path: Path) -> PictureGeometry:
    """A picture as ``touchline picture --json`` writes it; numbers that are absent are nothing.

    Raises:
        DatasetFormatError: The file holds something else.
    """
    value = read_json(read_plain(path), str(path))
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


def as_taken(files: Sequence[LineFile], picture: PictureGeometry | None) -> list[LineFile]:
    """Line files with their points where the pictures as they were taken show them."""
    if picture is None:
        return list(files)
    return [replace(file, lines=picture.undone(file.lines, file.size)) for file in files]


def _estimated(files: Sequence[LineFile], size: ImageSize) -> PictureEstimate:
    frames = [PictureFrame(file.lines, size) for file in files]
    return estimate_match_picture(frames, CLICKED)


def _values(found: PictureEstimate) -> dict[str, Any]:
    return {
        "aspect": found.picture.aspect,
        "shift": [*found.picture.shift],
        "sigma": [*found.picture.sigma],
        "frames": found.frames,
        "changed": found.proposal is not None,
    }
