"""OpenTrackIO, written: a JSON sample of each frame of a camera over time."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from typing import Any
from uuid import NAMESPACE_URL, uuid5

import numpy as np

from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.soccer.frames import ImageSize

SENSOR_WIDTH_MM = 9.59
"""Of a broadcast camera (2/3 inch). No picture says how large its sensor is; every number in millimetres
scales with it, and no pixel does."""
_VERSION = [1, 0, 1]
_TO_Z_UP = np.diag([1.0, -1.0, -1.0])
"""From the pitch frame to x along the pitch, y across it away from the main stand, z up."""
_BODY = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""From the camera frame (x right, y down, z forward) to x right, y forward, z up."""


def camera_to_opentrackio(
    camera: Camera,
    size: ImageSize,
    frame: int,
    *,
    source: str,
    time: float | None = None,
    rate: Fraction | None = None,
    status: str | None = None,
) -> dict[str, Any]:
    """One sample of OpenTrackIO 1.0.

    Args:
        camera: Of the frame, with a lens that ``find_opentrackio_problem`` has nothing against.
        size: Of its image.
        frame: Its number, which becomes the sequence number.
        source: Name of the recording; samples of one name have one source id.
        time: Of the frame, seconds.
        rate: Frames a second.
        status: What became of the frame when it was tracked.

    Source: SMPTE RIS OSVP, OpenTrackIO 1.0 (axes, angles, units) and "Conversion of OpenCV to OpenTrackIO
    (OpenLensIO) lens calibration parameters".
    """
    (ax, ay), (x0, y0) = camera.focal_length, camera.principal_point
    focal = ax * SENSOR_WIDTH_MM / size.width
    # Pixels that are not square are a sensor whose height is not its width's.
    pitch_x, pitch_y = SENSOR_WIDTH_MM / size.width, focal / ay
    x, y, z = (_TO_Z_UP @ camera.position).tolist()
    pan, tilt, roll = pan_tilt_roll_z_up(camera.rotation)
    timing: dict[str, Any] = {"mode": "internal", "sequenceNumber": frame}
    if time is not None and time >= 0:
        seconds, nanoseconds = divmod(round(time * 1e9), 10**9)
        timing["sampleTimestamp"] = {"seconds": seconds, "nanoseconds": nanoseconds}
    if rate is not None:
        timing["sampleRate"] = {"num": rate.numerator, "denom": rate.denominator}
    sample: dict[str, Any] = {
        "protocol": {"name": "OpenTrackIO", "version": _VERSION},
        "sampleId": uuid5(NAMESPACE_URL, f"touchline:{source}:{frame}").urn,
        "sourceId": uuid5(NAMESPACE_URL, f"touchline:{source}").urn,
        "sourceNumber": 1,
        "static": {
            "camera": {
                "activeSensorPhysicalDimensions": {
                    "height": pitch_y * size.height,
                    "width": SENSOR_WIDTH_MM,
                },
                "activeSensorResolution": {"height": size.height, "width": size.width},
            }
        },
        "timing": timing,
        "transforms": [
            {
                "translation": {"x": x, "y": y, "z": z},
                "rotation": {"pan": pan, "tilt": tilt, "roll": roll},
                "id": "Camera",
            }
        ],
        "lens": {
            "pinholeFocalLength": focal,
            # Theirs is from the middle of the image, whose corner is that of the first pixel.
            "projectionOffset": {
                "x": pitch_x * (x0 + 0.5 - size.width / 2),
                "y": pitch_y * (y0 + 0.5 - size.height / 2),
            },
            "distortion": [_convert_to_opentrackio_distortion(camera.distortion, focal)],
        },
    }
    if status is not None:
        sample["tracker"] = {"status": status}
    return sample


def find_opentrackio_problem(camera: Camera) -> str | None:
    """What of a camera OpenTrackIO cannot say; None where it can say all of it."""
    if camera.is_wide:
        return f"has the lens {camera.lens}, which OpenTrackIO does not know"
    if camera.skew:
        return "has skewed pixels, which OpenTrackIO does not know"
    if camera.distortion[2:4].any():
        # The published conversion divides by the focal length squared, which pixels contradict.
        return "has tangential distortion, whose unit OpenTrackIO's documents leave open"
    if camera.distortion[8:].any():
        return "has thin prism distortion, which OpenTrackIO does not know"
    return None


def pan_tilt_roll_z_up(rotation: FloatArray) -> tuple[float, float, float]:
    """OpenTrackIO's angles of a camera, degrees: about z up, then x right, then y forward.

    Pan 0 looks along y, away from the main stand; it grows to the left, tilt upwards, roll to the right.
    """
    turn = _TO_Z_UP @ rotation.T @ _BODY.T
    pan = np.arctan2(-turn[0, 1], turn[1, 1])
    tilt = np.arctan2(turn[2, 1], np.hypot(turn[2, 0], turn[2, 2]))
    roll = np.arctan2(-turn[2, 0], turn[2, 2])
    return float(np.degrees(pan)), float(np.degrees(tilt)), float(np.degrees(roll))


def estimate_frame_rate(times: Mapping[int, float]) -> Fraction | None:
    """Frames a second of frames at times, None where they are too few or stand still.

    Television's rates are over 1001, such as 30000/1001.
    """
    frames = sorted(times)
    if len(frames) < 2 or times[frames[-1]] <= times[frames[0]]:
        return None
    rate = (frames[-1] - frames[0]) / (times[frames[-1]] - times[frames[0]])
    for found in (Fraction(round(rate)), Fraction(1000 * round(1.001 * rate), 1001)):
        if found and abs(float(found) - rate) < 2e-4 * rate:
            return found
    return Fraction(rate).limit_denominator(1001) or None


def _convert_to_opentrackio_distortion(coefficients: FloatArray, focal: float) -> dict[str, Any]:
    """OpenCV's radial coefficients on the sensor in millimetres, numerator and denominator in turn."""
    k1, k2, _, _, k3, k4, k5, k6 = coefficients[:8].tolist()
    two, four, six = focal**2, focal**4, focal**6
    return {
        # From undistorted to distorted, as OpenCV's.
        "model": "Brown-Conrady U-D",
        "radial": [k1 / two, k4 / two, k2 / four, k5 / four, k3 / six, k6 / six],
    }
