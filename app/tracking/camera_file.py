"""Cameras of frames that follow each other, as one compressed file of numpy."""

from __future__ import annotations

import json
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np

from app.errors import InputError
from app.geometry.camera import Camera
from app.geometry.resection import PARAMETERS
from app.json_text import json_text
from app.soccer.frames import ImageSize
from app.tracking.follow import OUTCOMES
from app.tracking.track import FrameCamera

_VERSION = 1
_NONE = np.full(29, np.nan)
_UNKNOWN = np.full(PARAMETERS**2, np.nan)


def frame_cameras_to_bytes(frames: Sequence[FrameCamera]) -> bytes:
    """Cameras of frames that follow each other as a compressed file of numpy; the same frames, the same bytes."""
    size = frames[0].size
    reasons = sorted({frame.reason for frame in frames if frame.reason is not None})
    head = {
        "version": _VERSION,
        "first": frames[0].number,
        "size": [size.width, size.height],
        "reasons": reasons,
    }
    agreement = [(frame.supported, frame.explained, frame.error_px) for frame in frames]
    arrays: dict[str, Any] = {
        "head": np.frombuffer(json_text(head).encode(), np.uint8),
        "time": np.array([frame.time for frame in frames]),
        "outcome": np.array([OUTCOMES.index(frame.outcome) for frame in frames], np.uint8),
        "reason": np.array(
            [-1 if frame.reason is None else reasons.index(frame.reason) for frame in frames],
            np.int16,
        ),
        "agreement": np.array(agreement, np.float64),
        "keyframe": np.array([frame.is_keyframe for frame in frames]),
        "camera": np.array(
            [_NONE if frame.camera is None else frame.camera.parameters for frame in frames]
        ),
        "covariance": np.array(
            [_UNKNOWN if frame.covariance is None else frame.covariance for frame in frames]
        ),
    }
    content = BytesIO()
    np.savez_compressed(content, allow_pickle=False, **arrays)
    return content.getvalue()


def frame_cameras_from_bytes(content: bytes) -> list[FrameCamera]:
    """Back from ``frame_cameras_to_bytes``.

    Raises:
        InputError: It is no such file, or one of another version.
    """
    try:
        return _decode_frames(content)
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            "the file of cameras is empty or damaged", hint="Track the shot again."
        ) from error


def _decode_frames(content: bytes) -> list[FrameCamera]:
    with np.load(BytesIO(content), allow_pickle=False) as arrays:
        head = json.loads(arrays["head"].tobytes())
        kept = {name: arrays[name] for name in arrays.files if name != "head"}
    if head["version"] != _VERSION:
        raise InputError(
            "the file of cameras is of another version of Touchline", hint="Track the shot again."
        )
    size, reasons = ImageSize(*head["size"]), head["reasons"]
    known = [
        tuple(None if np.isnan(value) else value for value in row)
        for row in kept["agreement"].tolist()
    ]
    return [
        FrameCamera(
            number=head["first"] + place,
            time=float(kept["time"][place]),
            outcome=OUTCOMES[kept["outcome"][place]],
            size=size,
            camera=_camera_from_row(kept["camera"][place]),
            covariance=_covariance_from_row(kept["covariance"][place]),
            supported=known[place][0],
            explained=known[place][1],
            error_px=known[place][2],
            is_keyframe=bool(kept["keyframe"][place]),
            reason=None if kept["reason"][place] < 0 else reasons[kept["reason"][place]],
        )
        for place in range(len(kept["time"]))
    ]


def _camera_from_row(row: Any) -> Camera | None:
    if np.isnan(row[0]):
        return None
    focal_x, focal_y, x0, y0, skew = row[12:17].tolist()
    return Camera(row[:9].reshape(3, 3), row[9:12], (focal_x, focal_y), (x0, y0), skew, row[17:])


def _covariance_from_row(row: Any) -> tuple[float, ...] | None:
    return None if np.isnan(row[0]) else tuple(row.tolist())
