"""Cameras of picture files drawn onto their paint, and measured by it, without a database."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import numpy.typing as npt

from app.config import Settings
from app.errors import GeometryError, InputError, ReviewError
from app.features.file_tools.matches import SnappedFrame, refine_shared_tripod_cameras
from app.features.file_tools.output_folder import require_writable_folder, write_out_file
from app.formats.cameras import camera_file_name, format_camera_file, read_cameras
from app.formats.file_tree import ImportLimits
from app.formats.frame_names import IMAGE_SUFFIXES
from app.formats.report import ReaderReport
from app.formats.safe_path import resolve_inside
from app.formats.sn_calibration import LineFile, read_line_documents
from app.formats.sn_calibration_reader import lines_from_json
from app.formats.sn_calibration_writer import write_line_files
from app.formats.trees import open_tree_context
from app.formats.view_files import write_file_below
from app.geometry.arrays import flatten_covariance
from app.geometry.camera import Camera
from app.geometry.lens import BROWN_CONRADY
from app.json_text import json_text
from app.media.files import decode_picture
from app.media.frames import LIMITS
from app.paint.agreement import measure_agreement
from app.paint.evidence import to_paint_evidence
from app.paint.grass import explain_missing_field, find_field_of_play
from app.paint.propose import explain_too_small_picture
from app.paint.ridges import find_line_like_pixels
from app.paint.snap import SnappedCamera, snap_camera
from app.progress import ReportProgress
from app.soccer.frames import ImageSize
from app.soccer.paint_evidence import PROPOSAL_OUTCOMES
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED
from app.soccer.solution import Calibration
from app.solving.calibrate import calibrate
from app.wording import plural
from app.worker_process import WorkerEnded, WorkerProcess


class UniqueNameGenerator:
    """Names of frames, none given twice: ``a.jpg`` and ``a.png`` are ``a`` and ``a_2``."""

    def __init__(self) -> None:
        self._given: set[str] = set()

    def name(self, stem: str) -> str:
        """The stem, or the stem and the first number that no frame has yet."""
        frame, count = stem, 1
        while frame in self._given:
            count += 1
            frame = f"{stem}_{count}"
        self._given.add(frame)
        return frame


@dataclass(frozen=True)
class PictureFile:
    """One picture, or why there is none.

    Attributes:
        stem: Name of the frame, with its folders where it lies in some.
        image: Red green blue, shape (H, W, 3); None where ``problem`` says why.
        problem: A sentence.
    """

    stem: str
    image: npt.NDArray[np.uint8] | None
    problem: str | None = None


def read_pictures(
    sources: Sequence[Path], settings: Settings, report: ReaderReport
) -> Iterator[PictureFile]:
    """Every picture of some folders, zips and files, in the order of their names.

    Each is decoded in a process with limits; one that cannot be is told, and the next one read.

    Args:
        report: Hears what could not be opened at all.
    """
    with closing(WorkerProcess(LIMITS)) as worker:
        for source in sources:
            with open_tree_context(source, report, ImportLimits.of(settings)) as tree:
                if tree is None:
                    continue
                for name in tree.names():
                    if PurePosixPath(name).suffix.lower() not in IMAGE_SUFFIXES:
                        continue
                    stem = str(PurePosixPath(name).with_suffix(""))
                    try:
                        data = tree.read_bytes(name)
                        image = worker.run(decode_picture, data, settings, PurePosixPath(name).name)
                        yield PictureFile(stem, image)
                    except ReviewError as error:
                        yield PictureFile(stem, None, error.message)
                    except WorkerEnded as error:
                        yield PictureFile(stem, None, f"{PurePosixPath(name).name} {error}")


def list_picture_stems(sources: Sequence[Path], settings: Settings) -> list[str]:
    """Stems of every picture of some folders, zips and files; nothing is decoded."""
    stems: list[str] = []
    for source in sources:
        with open_tree_context(source, ReaderReport(), ImportLimits.of(settings)) as tree:
            if tree is None:
                continue
            places = [PurePosixPath(name) for name in tree.names()]
        stems += [
            str(place.with_suffix("")) for place in places if place.suffix.lower() in IMAGE_SUFFIXES
        ]
    return stems


PROPOSED, UNSURE, NOTHING = PROPOSAL_OUTCOMES
"""Outcomes: the camera is the paint's; the clicks' camera stays; there is none."""
NAMED = 10
"""Files without a picture that a problem names."""
SENTENCES = {
    "no_paint": "too little paint is seen: the camera from the annotated lines is kept",
    "paint_disagrees": "the paint and the annotated lines disagree: the camera from the lines is kept",
}


def snap_cameras_to_paint(
    lines: Path,
    images: Sequence[Path],
    out: Path,
    *,
    settings: Settings,
    tripod: str | None = None,
    report: ReaderReport | None = None,
    progress: ReportProgress | None = None,
) -> list[dict[str, Any]]:
    """Cameras from clicks and paint: ``camera_<stem>.json``, ``lines/<stem>.json``, ``snap.json``.

    Args:
        lines: Folder or zip of line files; normalised by the size of each picture, or in pixels.
        images: Folders, zips or files; those without a line file are passed over.
        out: Folder, made when missing.
        settings: Limits of pictures.
        tripod: ``one`` where all pictures are of one camera that stands still, or a file that
            names the camera of each frame.
        report: Gets what could not be read, and line files that have no picture.
        progress: Called with frames done.

    Returns:
        The rows of ``snap.json``.

    Raises:
        InputError: No picture has a line file, or ``out`` cannot be written.
    """
    require_writable_folder(out)
    report = ReaderReport() if report is None else report
    values = _read_line_values(lines, settings, report)
    match = _PictureFileMatcher(values, images, settings)
    rows: list[dict[str, Any]] = []
    drawn: list[SnappedFrame] = []
    for picture, frame, key in match.iterate_matched_pictures(report):
        row, text, snapped = _snap_picture(picture, frame, values[key], report)
        _write_snapped_camera(out, frame, text, snapped)
        rows.append(row)
        if snapped is not None:
            size = ImageSize(snapped.size[1], snapped.size[0])
            drawn.append(SnappedFrame(frame, snapped, snapped.camera, size, Pitch()))
        if progress is not None:
            progress(len(rows))
    if not rows:
        raise report.make_refusal_error(f"no picture has a line file of its name in {lines}")
    match.add_unused_files(report, lines, "line file")
    refine_shared_tripod_cameras(drawn, tripod, rows, out, report)
    write_out_file(out / "snap.json", json_text(rows, indent=1) + "\n")
    return rows


def measure_paint_agreement_of_files(
    cameras: Path,
    images: Sequence[Path],
    *,
    settings: Settings,
    report: ReaderReport | None = None,
    progress: ReportProgress | None = None,
) -> list[dict[str, Any]]:
    """How well cameras and the paint of their pictures agree, a row for each picture.

    Args:
        cameras: Folder or zip of ``camera_<stem>.json``, or one such file.
        images: Folders, zips or files; those without a camera are passed over.
        settings: Limits of pictures.
        report: Gets what could not be read, and cameras that have no picture.
        progress: Called with frames done.

    Raises:
        InputError: No picture has a camera.
    """
    report = ReaderReport() if report is None else report
    found = read_cameras(cameras, report)
    match = _PictureFileMatcher(found, images, settings)
    rows: list[dict[str, Any]] = []
    for picture, frame, key in match.iterate_matched_pictures(report):
        rows.append(_measure_picture_agreement(picture, frame, found[key]))
        if progress is not None:
            progress(len(rows))
    if not rows:
        raise report.make_refusal_error(f"no picture has a camera of its name in {cameras}")
    match.add_unused_files(report, cameras, "camera")
    return rows


class _PictureFileMatcher:
    """Which line file or camera belongs to a picture.

    The one of its whole name; else the one of its bare stem, where that stem is unique among
    the files and among the pictures: two folders with a ``1`` each are two frames.
    """

    def __init__(self, values: Mapping[str, Any], images: Sequence[Path], settings: Settings):
        self._keys, self._images, self._settings = set(values), images, settings
        self._bare: dict[str, list[str]] = {}
        for key in values:
            self._bare.setdefault(PurePosixPath(key).name, []).append(key)
        places = list_picture_stems(images, settings)
        self._stems = Counter(PurePosixPath(stem).name for stem in places)
        self._used: set[str] = set()

    def iterate_matched_pictures(
        self, report: ReaderReport
    ) -> Iterator[tuple[PictureFile, str, str]]:
        """Each picture that has a file, with the name of its frame and the key of its file."""
        names = UniqueNameGenerator()
        for picture in read_pictures(self._images, self._settings, report):
            key = self._find_key(picture.stem)
            if key is not None:
                self._used.add(key)
                yield picture, names.name(picture.stem), key

    def add_unused_files(self, report: ReaderReport, source: Path, what: str) -> None:
        """Report the files that no picture has used; ``what`` is the word for one of them."""
        unused = sorted(self._keys - self._used)
        if unused:
            count, named = plural(len(unused), what), ", ".join(unused[:NAMED])
            more = f" and {len(unused) - NAMED} more" if len(unused) > NAMED else ""
            report.add_problem_at(
                str(source), None, None, f"{count} without a picture: {named}{more}"
            )

    def _find_key(self, stem: str) -> str | None:
        if stem in self._keys:
            return stem
        bare = PurePosixPath(stem).name
        keys = self._bare.get(bare, [])
        return keys[0] if len(keys) == 1 and self._stems[bare] == 1 else None


def _read_line_values(lines: Path, settings: Settings, report: ReaderReport) -> dict[str, Any]:
    """The lines of each image, by stem with folders; an error where they cannot be read."""
    values: dict[str, Any] = {}
    with open_tree_context(lines, report, ImportLimits.of(settings)) as tree:
        if tree is None:
            raise report.make_refusal_error(f"{lines} contains no line files")
        for name in tree.names():
            place = PurePosixPath(name)
            if place.suffix.lower() != ".json":
                continue
            whole = str(place.with_suffix(""))
            try:
                found = read_line_documents(tree.read_bytes(name), tree.shown(name), report)
            except ReviewError as error:
                values[whole] = error
                continue
            for document in found:
                alone = document.name in (None, place.stem)
                values[whole if alone else str(place.with_name(str(document.name)))] = (
                    document.lines
                )
    return values


def _snap_picture(
    picture: PictureFile, frame: str, value: Any, report: ReaderReport
) -> tuple[dict[str, Any], str | None, SnappedCamera | None]:
    """The row of a picture, the text of its camera's file, and how it lies on the paint."""
    if picture.image is None:
        return _build_result_row(frame, NOTHING, reason=picture.problem), None, None
    if isinstance(value, ReviewError):
        return _build_result_row(frame, NOTHING, reason=value.message), None, None
    if (small := explain_too_small_picture(picture.image)) is not None:
        return _build_result_row(frame, NOTHING, reason=small), None, None
    height, width = picture.image.shape[:2]
    size = ImageSize(width, height)
    try:
        lines, _ = lines_from_json(value, size, picture.stem, report)
    except ReviewError as error:
        return _build_result_row(frame, NOTHING, reason=error.message), None, None
    began = time.thread_time()
    clicked = calibrate(lines, Pitch(), size, CLICKED)
    if clicked.camera is None:
        return _build_result_row(frame, NOTHING, reason=clicked.reason), None, None
    kept = format_camera_file(clicked.camera, clicked.known_covariance_with_pitch, size)
    field = find_field_of_play(picture.image)
    reason = explain_missing_field(picture.image, field)
    if reason is not None:
        return _build_result_row(frame, UNSURE, reason=f"no_paint: {reason}"), kept, None
    try:
        snapped = _snap_to_paint(picture, field, clicked)
    except (GeometryError, np.linalg.LinAlgError) as error:
        broken = (
            f"the paint cannot be solved ({error}): the camera from the annotated lines is kept"
        )
        return _build_result_row(frame, UNSURE, reason=broken), kept, None
    spent = 1000 * (time.thread_time() - began)
    seen = measure_agreement(snapped.camera, field, find_line_like_pixels(picture.image, field))
    row = _build_result_row(
        frame,
        UNSURE if snapped.reason else PROPOSED,
        supported=seen.supported,
        explained=seen.explained,
        points=snapped.point_count,
        error_px=snapped.error_px,
        ms=spent,
        moved_px=snapped.moved_px,
        reason=f"{snapped.reason}: {SENTENCES[snapped.reason]}" if snapped.reason else None,
    )
    known = snapped.covariance
    if snapped.reason is not None or known is None:
        return row, kept, None
    return row, format_camera_file(snapped.camera, flatten_covariance(known), size), snapped


def _snap_to_paint(picture: PictureFile, field: Any, clicked: Calibration) -> SnappedCamera:
    assert picture.image is not None and clicked.camera is not None
    known = None if clicked.covariance is None else np.reshape(clicked.covariance, (8, 8))
    return snap_camera(picture.image, field, clicked.camera, start_covariance=known)


def _measure_picture_agreement(picture: PictureFile, frame: str, camera: Camera) -> dict[str, Any]:
    if picture.image is None:
        return _build_result_row(frame, NOTHING, reason=picture.problem)
    if camera.lens != BROWN_CONRADY:
        other = "the paint is read with lenses of one radial term; this camera has another"
        return _build_result_row(frame, NOTHING, reason=other)
    began = time.thread_time()
    field = find_field_of_play(picture.image)
    reason = explain_missing_field(picture.image, field)
    if reason is not None:
        return _build_result_row(frame, NOTHING, reason=reason)
    seen = measure_agreement(camera, field, find_line_like_pixels(picture.image, field))
    return _build_result_row(
        frame,
        "measured",
        supported=seen.supported,
        explained=seen.explained,
        points=seen.points,
        ms=1000 * (time.thread_time() - began),
    )


def _build_result_row(frame: str, outcome: str, **known: Any) -> dict[str, Any]:
    names = ("supported", "explained", "points", "error_px", "runner_up", "ms", "moved_px")
    empty: Mapping[str, Any] = dict.fromkeys((*names, "reason"))
    return {"frame": frame, "outcome": outcome, **empty, "points": 0, **known}


def _write_snapped_camera(
    out: Path, stem: str, text: str | None, snapped: SnappedCamera | None
) -> None:
    """Write the camera of a frame and the points that were snapped; what an earlier run left
    there goes where there is nothing to write."""
    old = resolve_inside(out, camera_file_name(stem))
    old_lines = resolve_inside(out, f"lines/{stem}.json")
    try:
        if snapped is None:
            old_lines.unlink(missing_ok=True)
        if text is None:
            old.unlink(missing_ok=True)
            return
        out.mkdir(parents=True, exist_ok=True)
        write_file_below(out, camera_file_name(stem), text)
        if snapped is not None:
            (out / "lines").mkdir(exist_ok=True)
            height, width = snapped.size
            points = to_paint_evidence(snapped.evidence).thin_points()
            file = LineFile(stem, ImageSize(width, height), points)
            write_line_files(out / "lines", [file])
    except OSError as error:
        raise InputError(f"{out} cannot hold the cameras ({error.strerror})") from error
