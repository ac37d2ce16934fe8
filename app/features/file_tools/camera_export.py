"""Cameras over time for other tools: a folder of camera files to npz or OpenTrackIO."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from app.errors import DatasetFormatError, InputError
from app.features.file_tools.output_folder import require_writable_folder, write_out_file
from app.formats.camera_matrix import cameras_to_arrays
from app.formats.cameras import read_cameras
from app.formats.opentrackio_writer import (
    camera_to_opentrackio,
    estimate_frame_rate,
    find_opentrackio_problem,
)
from app.formats.report import ReaderReport
from app.geometry.camera import Camera
from app.json_text import json_text
from app.soccer.frames import ImageSize

T = TypeVar("T")


def export_cameras(
    source: Path, out: Path, kind: str, size: ImageSize | None = None
) -> dict[str, Any]:
    """Write the cameras of a clip, as ``track`` leaves them, for another tool.

    Args:
        source: Folder of ``camera_<frame>.json``; ``track.json`` in it says the times and outcomes.
        out: The npz, or the folder that gets ``sample_<frame>.json``.
        kind: ``npz`` or ``opentrackio``.
        size: Of the images, where the camera files do not state it; OpenTrackIO needs it.

    Returns:
        Counts: ``cameras``, ``first`` and ``last`` frame, ``missing`` frames between; ``problems``.

    Raises:
        InputError: There is no camera of a frame, no size, or ``out`` cannot be written.
        DatasetFormatError: A camera is none that the format can say.
    """
    if kind != "npz":
        require_writable_folder(out)
    elif out.is_dir():
        raise InputError(f"{out} is a folder; name a file, such as {out / 'cameras.npz'}")
    else:
        require_writable_folder(out.parent)
    report = ReaderReport()
    sizes: dict[str, ImageSize] = {}
    found = read_cameras(source, report, sizes=sizes)
    cameras = key_by_frame_number(found, source, report)
    if not cameras:
        raise report.make_refusal_error(f"{source} contains no camera_<frame>.json")
    if kind == "npz":
        content = io.BytesIO()
        arrays: dict[str, Any] = dict(cameras_to_arrays(cameras, source.resolve().name))
        np.savez_compressed(content, **arrays)
        write_out_file(out, content.getvalue())
    else:
        known = key_by_frame_number(sizes, source, ReaderReport())
        _write_opentrackio_samples(source, out, cameras, known, size)
    return {
        "cameras": len(cameras),
        "first": min(cameras),
        "last": max(cameras),
        "missing": max(cameras) - min(cameras) + 1 - len(cameras),
        "problems": [problem.message for problem in report.problems],
    }


def key_by_frame_number(
    values: Mapping[str, T], source: Path, report: ReaderReport
) -> dict[int, T]:
    """What belongs to cameras by the number of their frame: ``camera_00012.json`` is that of frame 12.

    Args:
        values: By the key of the camera.
        source: Where the cameras lie, for errors.
        report: Takes the cameras whose names are no number.

    Raises:
        InputError: Two cameras are of one frame.
    """
    found: dict[int, T] = {}
    owners: dict[int, str] = {}
    for key, value in values.items():
        stem = key.rsplit("/", 1)[-1]
        if not (stem.isascii() and stem.isdigit()):
            problem = "is not called by the number of a frame (camera_00012.json); left out"
            report.add_problem_at(str(source), f'camera "{key}"', None, problem)
            continue
        first = owners.setdefault(int(stem), key)
        if first != key:
            raise InputError(
                f'{source} holds two cameras of frame {int(stem)}, "{first}" and "{key}"',
                hint="Give the folder of one clip.",
            )
        found[int(stem)] = value
    return found


def _write_opentrackio_samples(
    source: Path,
    out: Path,
    cameras: Mapping[int, Camera],
    sizes: Mapping[int, ImageSize],
    size: ImageSize | None,
) -> None:
    rows = _read_track_rows(source)
    times = {frame: row["time"] for frame, row in rows.items() if _is_number(row.get("time"))}
    rate = estimate_frame_rate(times)
    width = len(str(max(cameras)))
    samples = {}
    for frame, camera in sorted(cameras.items()):
        shape = sizes.get(frame, size)
        if shape is None:
            raise InputError(
                f"the camera of frame {frame} does not contain the size of its image, which"
                " OpenTrackIO needs: give it as --size 1280x720"
            )
        if problem := find_opentrackio_problem(camera):
            raise DatasetFormatError(source.resolve().name, f"frame {frame}", None, problem)
        outcome = rows.get(frame, {}).get("outcome")
        samples[f"sample_{frame:0{width}d}.json"] = camera_to_opentrackio(
            camera,
            shape,
            frame,
            source=source.resolve().name,
            time=times.get(frame),
            rate=rate,
            status=outcome if isinstance(outcome, str) and outcome else None,
        )
    for name, sample in samples.items():
        write_out_file(out / name, json_text(sample, indent=1) + "\n")


def _read_track_rows(source: Path) -> dict[int, dict[str, Any]]:
    """The rows of ``track.json`` by frame; none where there is no such file."""
    path = source / "track.json"
    if not path.is_file():
        return {}
    try:
        rows = json.loads(path.read_bytes())["frames"]
        return {int(row["frame"]): row for row in rows}
    except (ValueError, LookupError, TypeError) as error:
        raise DatasetFormatError(
            f"{source.resolve().name}/{path.name}",
            None,
            "frames",
            "is not a list of tracked frames as touchline track writes it",
        ) from error


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
