"""Line files to camera files, and the JaC of cameras on line files, without a database."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import asdict, dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from app.durable import replace_file
from app.errors import DatasetFormatError, InputError
from app.evaluation.cameras import combine_frame_scores, measure_leave_one_out_errors, score_frame
from app.features.file_tools.matches import (
    OtherFramesCameraPlaces,
    choose_picture_geometry,
    collect_camera_places_of_other_frames,
    map_points_to_original_pictures,
    read_match_of_each_frame,
    require_named_frame,
)
from app.features.file_tools.output_folder import require_writable_folder
from app.formats.cameras import camera_file_name, format_camera_file, read_cameras
from app.formats.frame_names import compose_name, strip_image_suffix
from app.formats.json_reader import read_json
from app.formats.report import ReaderReport
from app.formats.safe_path import read_regular_file
from app.formats.sn_calibration import LineFile
from app.formats.sn_calibration_reader import read_line_files
from app.geometry.camera import Camera
from app.json_text import json_text
from app.progress import ReportProgress
from app.soccer.annotation import remove_markings
from app.soccer.choices import GoalEdge
from app.soccer.finding import Finding
from app.soccer.frames import ImageSize
from app.soccer.picture import PictureGeometry
from app.soccer.pitch import Pitch
from app.soccer.policy import CLICKED, CalibrationPolicy
from app.soccer.solution import Calibration
from app.solving.calibrate import add_lone_frame_uncertainty, analyse_lone_frame, calibrate
from app.solving.calibration_findings import find_calibration_findings
from app.solving.lone_frame import LoneFrameUncertainty
from app.solving.match_position import (
    FrameCameraPlace,
    FrameCameraPlaces,
    calibrate_with_match_position,
    find_main_camera_place,
)
from app.solving.solve import warm_up_solver

CHUNK = 16
"""Frames that one process takes at a time."""


@dataclass(frozen=True)
class CalibratedFrame:
    """What became of one line file.

    ``camera`` is the text of its file, ``left_out`` (marking, pixels) of ``measure_leave_one_out_errors``,
    ``lone`` what nobody says of its pitch and picture, where no match shares anything with it.
    """

    stem: str
    camera: str | None
    reason: str | None
    findings: tuple[Finding, ...]
    left_out: tuple[tuple[str, float | None], ...]
    milliseconds: float
    alone: Calibration
    place: FrameCameraPlace | None
    lone: LoneFrameUncertainty | None


def calibrate_files(
    source: Path,
    out: Path,
    *,
    size: ImageSize,
    labels: str = "checked",
    goal: GoalEdge = "middle",
    with_leave_one_out: bool = False,
    matches: Path | None = None,
    guess: bool = False,
    picture: Path | None = None,
    guess_picture: bool = False,
    executor: Executor,
    progress: ReportProgress | None = None,
) -> dict[str, Any]:
    """Write a camera file for each line file, and what was noticed on the way.

    Args:
        source: Folder or zip of sn-calibration line files.
        out: Folder that gets ``camera_<stem>.json``, ``findings.json``, ``calibrate.json`` and,
            if asked, ``leave_one_out.json``. What an earlier run left there is replaced.
        size: Size of the annotated images.
        labels: ``checked`` leaves out markings found mislabelled, ``given`` trusts all.
        goal: What people click of goals and lines.
        with_leave_one_out: Also drop each marking in turn.
        matches: File that names the match of each frame (``read_match_of_each_frame``): frames of a match
            share what they say of the main camera's position.
        guess: Without such a file: guess the matches from names and positions.
        picture: File that says how all pictures were stretched or cropped (``read_picture``).
        guess_picture: Without such a file: estimate that from all frames together.
        executor: Where the frames are calibrated.
        progress: Called with frames done and in all.

    Returns:
        What ``calibrate.json`` holds.

    Raises:
        InputError: There is no line file, ``matches`` names none of the frames, or ``out`` cannot
            hold the result.
    """
    began = time.perf_counter()
    require_writable_folder(out)
    report, of_matches = ReaderReport(), ReaderReport()
    files = list(read_line_files(source, size, report))
    if not files:
        raise report.make_refusal_error(f"{source} contains no line files")
    geometry: PictureGeometry | None = None
    picture_summary: dict[str, Any] | None = None
    if picture is not None or guess_picture:
        geometry, picture_summary = choose_picture_geometry(files, size, picture)
        files = map_points_to_original_pictures(files, geometry)
    named = None
    if matches is not None:
        named = read_match_of_each_frame(matches, of_matches)
        require_named_frame(named, [file.stem for file in files], matches)
    sharing = guess or named is not None
    policy = replace(CLICKED, goal=goal, check_labels=labels == "checked", lone_frames="any")
    chunks = [files[start : start + CHUNK] for start in range(0, len(files), CHUNK)]
    rounds = 2 if sharing else 1

    def collect_frames(
        jobs: Sequence[Future[list[CalibratedFrame]]], done: int
    ) -> list[CalibratedFrame]:
        frames: list[CalibratedFrame] = []
        for job in jobs:
            frames.extend(job.result())
            if progress is not None:
                progress((done + len(frames)) // rounds, len(files))
        return frames

    alone = with_leave_one_out and not sharing
    frames = collect_frames(
        [executor.submit(calibrate_chunk, it, size, policy, alone) for it in chunks], 0
    )
    groups = 0
    if sharing:
        shares = collect_camera_places_of_other_frames(
            files, [frame.place for frame in frames], named
        )
        groups = len({share.match for share in shares if share.match})
        jobs = []
        for start in range(0, len(files), CHUNK):
            piece = slice(start, start + CHUNK)
            jobs.append(
                executor.submit(
                    recalibrate_chunk_with_match, files[piece], frames[piece], shares[piece], size, policy,
                    with_leave_one_out,
                )
            )  # fmt: skip
        frames = collect_frames(jobs, len(files))
    frames = [_map_frame_to_given_picture(frame, geometry, size) for frame in frames]
    lost = _find_frames_without_lines(source, files, report)
    summary = _make_summary(frames, lost, report, time.perf_counter() - began)
    summary["problems"] += [problem.message for problem in of_matches.problems]
    if sharing:
        summary["matches"] = groups
    if picture_summary is not None:
        summary["picture"] = picture_summary
    _write_results(out, frames, summary, with_leave_one_out)
    return summary


def calibrate_chunk(
    files: list[LineFile], size: ImageSize, policy: CalibrationPolicy, with_leave_one_out: bool
) -> list[CalibratedFrame]:
    """Calibrate some frames in this process, one after the other on one thread."""
    warm_up_solver()
    return [_calibrate_file(file, size, policy, with_leave_one_out) for file in files]


def recalibrate_chunk_with_match(
    files: Sequence[LineFile],
    frames: Sequence[CalibratedFrame],
    shares: Sequence[OtherFramesCameraPlaces],
    size: ImageSize,
    policy: CalibrationPolicy,
    with_leave_one_out: bool,
) -> list[CalibratedFrame]:
    """The same frames once more, each with what the others of its match say."""
    warm_up_solver()
    return [
        _calibrate_with_shared_position(file, frame, share.others, size, policy, with_leave_one_out)
        for file, frame, share in zip(files, frames, shares, strict=True)
    ]


def _calibrate_file(
    file: LineFile, size: ImageSize, policy: CalibrationPolicy, with_leave_one_out: bool
) -> CalibratedFrame:
    began = time.thread_time()
    calibration = calibrate(file.lines, Pitch(), size, policy)
    milliseconds = 1000 * (time.thread_time() - began)
    began = time.thread_time()
    lone = analyse_lone_frame(calibration, file.lines, Pitch(), size, policy)
    milliseconds += 1000 * (time.thread_time() - began)
    left_out = (
        measure_leave_one_out_errors(file.lines, Pitch(), size, policy)
        if with_leave_one_out
        else ()
    )
    return _make_frame(file.stem, calibration, size, milliseconds, tuple(left_out), lone)


def _calibrate_with_shared_position(
    file: LineFile,
    frame: CalibratedFrame,
    others: FrameCameraPlaces,
    size: ImageSize,
    policy: CalibrationPolicy,
    with_leave_one_out: bool,
) -> CalibratedFrame:
    pitch = Pitch()
    began = time.thread_time()
    calibration = calibrate_with_match_position(
        frame.alone, others, file.lines, pitch, size, policy
    )
    milliseconds = frame.milliseconds + 1000 * (time.thread_time() - began)
    left_out = (
        measure_leave_one_out_errors(file.lines, pitch, size, policy, others)
        if with_leave_one_out
        else ()
    )
    if calibration is frame.alone:
        return replace(frame, milliseconds=milliseconds, left_out=tuple(left_out))
    return _make_frame(file.stem, calibration, size, milliseconds, tuple(left_out))


def _make_frame(
    stem: str,
    calibration: Calibration,
    size: ImageSize,
    milliseconds: float,
    left_out: tuple[tuple[str, float | None], ...],
    lone: LoneFrameUncertainty | None = None,
) -> CalibratedFrame:
    camera = calibration.camera
    known = add_lone_frame_uncertainty(calibration, lone, Pitch())
    # What is drawn travels no further: it is most of a calibration.
    alone = replace(calibration, markings=())
    return CalibratedFrame(
        stem=stem,
        camera=None
        if camera is None
        else format_camera_file(camera, known.known_covariance_with_pitch, size),
        reason=calibration.reason,
        findings=tuple(find_calibration_findings(known, size)),
        left_out=left_out,
        milliseconds=milliseconds,
        alone=alone,
        place=find_main_camera_place(calibration, size),
        lone=lone,
    )


def _map_frame_to_given_picture(
    frame: CalibratedFrame, picture: PictureGeometry | None, size: ImageSize
) -> CalibratedFrame:
    """The frame with the camera of the picture as it is; it was found in the one that was taken."""
    camera = frame.alone.camera
    if picture is None or camera is None:
        return frame
    known = add_lone_frame_uncertainty(frame.alone, frame.lone, Pitch()).known_covariance_with_pitch
    return replace(
        frame,
        camera=format_camera_file(picture.camera_of_annotated_picture(camera, size), known, size),
    )


def _find_frames_without_lines(
    source: Path, files: Sequence[LineFile], report: ReaderReport
) -> dict[str, str]:
    """Frames whose lines could not be read, with the reason; what is wrong in others is none of it."""
    came = {file.place for file in files}
    lost: dict[str, str] = {}
    for problem in report.problems:
        path = Path(problem.path)
        if path.suffix.lower() != ".json":
            continue
        inside = path.relative_to(source) if path.is_relative_to(source) else path
        whole = inside if inside.name else Path(path.name)
        image = strip_image_suffix(problem.record.rsplit("/", 1)[-1]) if problem.record else None
        place = (whole.parent / image if image else whole.with_suffix("")).as_posix()
        if place not in came:
            lost.setdefault(place, problem.message)
    names = Counter(place.rsplit("/", 1)[-1] for place in (*came, *lost))
    bare = {place: place.rsplit("/", 1)[-1] for place in lost}
    return {
        bare[place] if names[bare[place]] == 1 else place: reason for place, reason in lost.items()
    }


def _make_summary(
    frames: list[CalibratedFrame], lost: Mapping[str, str], report: ReaderReport, seconds: float
) -> dict[str, Any]:
    times = [frame.milliseconds for frame in frames]
    failed = [
        {"frame": frame.stem, "reason": frame.reason} for frame in frames if frame.camera is None
    ]
    failed += [{"frame": name, "reason": reason} for name, reason in lost.items()]
    return {
        "frames": report.read,
        "calibrated": len(frames) - sum(frame.camera is None for frame in frames),
        "failed": failed,
        "ms_median": float(np.median(times)),
        "ms_p95": float(np.percentile(times, 95)),
        "seconds": seconds,
        "problems": [problem.message for problem in report.problems],
    }


def _write_results(
    out: Path, frames: list[CalibratedFrame], summary: dict[str, Any], with_leave_one_out: bool
) -> None:
    texts = {camera_file_name(frame.stem): frame.camera for frame in frames if frame.camera}
    findings = [
        {"frame": frame.stem, **asdict(finding)} for frame in frames for finding in frame.findings
    ]
    texts["findings.json"] = _format_json_file(findings)
    if with_leave_one_out:
        rows = [
            {"frame": frame.stem, "marking": marking, "error_px": error}
            for frame in frames
            for marking, error in frame.left_out
        ]
        texts["leave_one_out.json"] = _format_json_file(rows)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for stale in _find_files_of_earlier_run(out) - set(texts):
            (out / stale).unlink()
        # calibrate.json says what the folder holds, so it comes last.
        for name, text in chain(texts.items(), [("calibrate.json", _format_json_file(summary))]):
            file = out / name
            file.parent.mkdir(parents=True, exist_ok=True)
            replace_file(file, text.encode(), durable=False, private=False)
    except OSError as error:
        raise InputError(f"the cameras cannot be written to {out} ({error.strerror})") from error


def _find_files_of_earlier_run(out: Path) -> set[str]:
    """Files of an earlier run; none where no run ended, so nothing foreign is removed."""
    if not (out / "calibrate.json").is_file():
        return set()
    names = {str(path.relative_to(out)) for path in out.rglob("camera_*.json")}
    return names | ({"leave_one_out.json"} if (out / "leave_one_out.json").is_file() else set())


def _format_json_file(value: Any) -> str:
    return json_text(value, indent=1) + "\n"


def score_camera_files(
    lines: Path,
    cameras: Path,
    *,
    size: ImageSize,
    without: Path | None = None,
    progress: ReportProgress | None = None,
) -> dict[str, Any]:
    """Measure camera files against line files.

    Args:
        lines: Folder or zip of line files.
        cameras: Folder or zip of ``camera_<stem>.json``.
        size: Size of the annotated images where no folder of an export says it.
        without: ``findings.json``; markings that it calls mislabelled are left out.
        progress: Called with frames done.

    Raises:
        InputError: There is no line file, or no camera at all.
    """
    report, camera_report = ReaderReport(), ReaderReport()
    named = read_cameras(cameras, camera_report)
    found = _cameras_by_frame({compose_name(key): camera for key, camera in named.items()})
    if not found:
        raise camera_report.make_refusal_error(f"{cameras} contains no camera files")
    dropped = _read_wrong_labels(without) if without is not None else set()
    pitch = Pitch()
    scores = []
    frames: set[str] = set()
    for file in read_line_files(lines, size, report, by_folder=True):
        kept = remove_markings(
            file.lines, {marking for stem, marking in dropped if stem == file.stem}
        )
        camera = found.get(compose_name(file.stem))
        frames.add(file.stem)
        scores.append(None if camera is None else score_frame(camera, kept, pitch, file.size))
        if progress is not None:
            progress(len(scores))
    if not scores:
        raise report.make_refusal_error(f"{lines} contains no line files")
    if all(score is None for score in scores):
        frame, other = sorted(frames)[0], sorted(found)[0]
        raise InputError(
            f'no camera file has the frame name of a line file: there is a camera of "{other}"'
            f' and a line file of "{frame}"',
            hint="The camera of the frame 00002 must be in the file camera_00002.json.",
        )
    # A line file that cannot be read is a frame without a camera.
    scores.extend([None] * (report.read - len(scores)))
    total = combine_frame_scores(scores)
    return {
        "frames": total.frames,
        "calibrated": total.calibrated,
        "completeness": total.completeness,
        "jac_0.5": total.jac[0],
        "jac_1": total.jac[1],
        "jac_2": total.jac[2],
        "share": total.share,
        "fs5": total.challenge,
        "error_median_px": total.error_median_px,
        "error_p95_px": total.error_p95_px,
        **_read_time_per_frame(cameras),
        "problems": [item.message for item in (*report.problems, *camera_report.problems)],
    }


def _cameras_by_frame(cameras: Mapping[str, Camera]) -> dict[str, Camera]:
    """Cameras by key, and by each end of it, down to the name of the frame, that only one has."""
    ends = [
        (key.split("/", folders)[-1], camera)
        for key, camera in cameras.items()
        for folders in range(1, key.count("/") + 1)
    ]
    names = Counter(name for name, _ in ends)
    return {**{name: camera for name, camera in ends if names[name] == 1}, **cameras}


def _read_wrong_labels(findings: Path) -> set[tuple[str, str]]:
    """Frame and marking of each finding ``wrong_label``."""
    value = read_json(read_regular_file(findings), str(findings))
    if not isinstance(value, list):
        raise DatasetFormatError(str(findings), None, None, "is not a list of findings")
    rows = [item for item in value if isinstance(item, dict) and item.get("kind") == "wrong_label"]
    return {(str(item.get("frame")), str(item.get("marking"))) for item in rows}


def _read_time_per_frame(cameras: Path) -> dict[str, Any]:
    """Milliseconds a frame from the ``calibrate.json`` beside the cameras, or null."""
    beside = cameras / "calibrate.json"
    value = read_json(beside.read_bytes(), str(beside)) if beside.is_file() else {}
    times = {"ms_median": None, "ms_p95": None}
    if isinstance(value, dict):
        times |= {name: value.get(name) for name in times}
    return {name: time if isinstance(time, int | float) else None for name, time in times.items()}
