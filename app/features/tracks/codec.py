"""What a track is made from and the track itself as JSON: stored, frozen and computed again from.

A track is always computed from its stored inputs, so that whoever has them gets the same bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass
from typing import Any, cast

import numpy as np

from app.db.json_columns import Json, parse_json_column, translate_shape_errors_to_damage
from app.features.tracks.stretches import Stretch
from app.geometry.arrays import FloatArray, IntArray
from app.geometry.camera import Camera
from app.json_text import canonical_json_text, digest_content
from app.soccer.codec import camera_from_json, camera_to_json
from app.soccer.pitch import Pitch
from app.tracking.ball_correct import TrackPatch, apply_patches, correct_track
from app.tracking.ball_solve import TrackOptions, track_ball
from app.tracking.ball_track import (
    BallEvent,
    BallMeasurements,
    BallTrack,
    ContradictingMeasurement,
    EventCorrection,
    EventKind,
    LeaveOneOutSummary,
    UntrackedRun,
    ViewErrors,
    ViewJump,
)

TRACK_VERSION = "7"
"""Of the solver: tracks of another one are stale."""
_UPPER = np.triu_indices(6)
_NEAR_M = 1e-3
"""How near a part of a track comes to its solution: it is shown to the centimetre, and not stored."""


@dataclass(frozen=True)
class TrackInputs:
    """What a track is computed from; the same bits, the same track.

    Attributes:
        frames: Numbers of the frames, shape (N,).
        times: Seconds, shape (N,).
        pitch: Where it lies.
        measurements: What views show.
        corrections: What people said of its events.
    """

    frames: IntArray
    times: FloatArray
    pitch: Pitch
    measurements: BallMeasurements
    corrections: tuple[EventCorrection, ...] = ()

    @staticmethod
    def of(stretch: Stretch, corrections: Iterable[EventCorrection] = ()) -> TrackInputs:
        """The inputs of a stretch as it is now."""
        return TrackInputs(
            stretch.frames,
            stretch.times,
            stretch.pitch,
            stretch.measurements,
            tuple(sorted(corrections, key=lambda item: (item.frame, item.kind))),
        )


def make_track(inputs: TrackInputs) -> BallTrack:
    """The track of inputs, with their corrections."""
    track = track_ball(inputs.measurements, inputs.frames, inputs.times, pitch=inputs.pitch)
    return apply_corrections(inputs, track, solve_corrected_parts(inputs, track))


def make_partial_track(inputs: TrackInputs, known: ViewErrors) -> BallTrack:
    """The track of a part of a stretch, with corrections, where the whole says how wrong views are."""
    measured, frames, times = inputs.measurements, inputs.frames, inputs.times
    options = TrackOptions(settled_m=_NEAR_M)
    track = track_ball(measured, frames, times, pitch=inputs.pitch, options=options, known=known)
    return apply_corrections(inputs, track, solve_corrected_parts(inputs, track))


def solve_corrected_parts(
    inputs: TrackInputs, track: BallTrack, known: Sequence[TrackPatch] = ()
) -> tuple[TrackPatch, ...]:
    """The parts of a track that corrections change, solved anew.

    Args:
        inputs: With the corrections.
        track: Made of them without corrections.
        known: Parts that were solved before, of the same track.
    """
    return correct_track(track, inputs.measurements, inputs.pitch, inputs.corrections, known)


def apply_corrections(
    inputs: TrackInputs, track: BallTrack, patches: Sequence[TrackPatch]
) -> BallTrack:
    """A track with its corrections.

    Args:
        inputs: With the corrections.
        track: Made of them without corrections.
        patches: As ``solve_corrected_parts`` made them.
    """
    return apply_patches(track, inputs.measurements, patches, inputs.corrections)


def frozen_track_to_json(match: str, inputs: TrackInputs, track: BallTrack) -> Json:
    """A track with all that it was computed from, as versions keep it.

    Args:
        match: Of its groups.
        inputs: With corrections.
        track: The same with its corrections.
    """
    return {"match": match, "inputs": inputs_to_json(inputs), "track": track_to_json(track)}


def recompute_frozen_track(frozen: Mapping[str, Any]) -> Json:
    """The track of a frozen one's inputs, computed anew, as ``track_to_json`` has it."""
    return parse_json_column(
        canonical_json_text(track_to_json(make_track(inputs_from_json(frozen["inputs"]))))
    )


def inputs_to_json(inputs: TrackInputs) -> Json:
    """Every number that a track depends on; a camera of many measurements stands there once."""
    measured = inputs.measurements
    cameras: dict[int, int] = {}
    texts: list[Json] = []
    known: dict[str, int] = {}
    which = []
    for camera in measured.cameras:
        if id(camera) not in cameras:
            value = camera_to_json(camera)
            number = known.setdefault(canonical_json_text(value), len(texts))
            if number == len(texts):
                texts.append(value)
            cameras[id(camera)] = number
        which.append(cameras[id(camera)])
    names = measured.view_names
    return {
        "version": TRACK_VERSION,
        "first": int(inputs.frames[0]),
        "times": inputs.times.tolist(),
        "pitch": [float(inputs.pitch.length), float(inputs.pitch.width)],
        "views": list(names),
        "cameras": texts,
        "measurements": {
            "frame": measured.frames.tolist(),
            "time": measured.times.tolist(),
            "view": [names.index(view) for view in measured.views],
            "camera": which,
            "x": measured.pixels[:, 0].tolist(),
            "y": measured.pixels[:, 1].tolist(),
            "sigma": measured.sigma.tolist(),
            "size": _nan_to_none(measured.sizes),
            "size_sigma": _nan_to_none(measured.size_sigma),
        },
        "corrections": corrections_to_json(inputs.corrections),
    }


def corrections_to_json(corrections: Iterable[EventCorrection]) -> Json:
    """Corrections in their order."""
    return [[item.frame, item.kind, item.added] for item in corrections]


def corrections_to_text(corrections: Iterable[EventCorrection]) -> str:
    """Corrections as they are stored, each once."""
    whole = sorted(set(corrections), key=lambda item: (item.frame, item.kind, item.added))
    return canonical_json_text(corrections_to_json(whole))


def corrections_from_json(value: Sequence[Any]) -> tuple[EventCorrection, ...]:
    """Back from ``corrections_to_json``."""
    return tuple(
        EventCorrection(frame, cast(EventKind, kind), added) for frame, kind, added in value
    )


def digest_inputs(inputs: TrackInputs) -> str:
    """The same digest, the same track."""
    return digest_content(canonical_json_text(inputs_to_json(inputs)).encode())


def inputs_from_json(value: Mapping[str, Any]) -> TrackInputs:
    """Back from ``inputs_to_json``.

    Raises:
        DamagedError: It is not what was written.
    """
    with translate_shape_errors_to_damage():
        found, names = value["measurements"], value["views"]
        cameras: list[Camera] = [camera_from_json(item) for item in value["cameras"]]
        times = np.array(value["times"], dtype=float)
        return TrackInputs(
            value["first"] + np.arange(len(times)),
            times,
            Pitch(*value["pitch"]),
            BallMeasurements(
                np.array(found["frame"], dtype=np.int64),
                np.array(found["time"], dtype=float),
                tuple(names[number] for number in found["view"]),
                np.array([found["x"], found["y"]], dtype=float).T.reshape(-1, 2).copy(),
                np.array(found["sigma"], dtype=float),
                tuple(cameras[number] for number in found["camera"]),
                _none_to_nan(found["size"]),
                _none_to_nan(found["size_sigma"]),
            ),
            corrections_from_json(value["corrections"]),
        )


def track_to_json(track: BallTrack) -> Json:
    """A track with every digit; frames without a place have null."""
    left = track.left_out
    return {
        "frames": track.frames.tolist(),
        "times": track.times.tolist(),
        "position": _rows_to_json(track.position),
        "velocity": _rows_to_json(track.velocity),
        "covariance": _rows_to_json(track.covariance[:, _UPPER[0], _UPPER[1]]),
        "state": list(track.state),
        "mode": list(track.mode),
        "views": [list(names) for names in track.views],
        "events": [
            [item.frame, item.time_s, item.kind, item.position.tolist(), item.sigma_s]
            for item in track.events
        ],
        "contradicted": [[item.measurement, item.px, item.reason] for item in track.contradicted],
        "untracked": [list(astuple(item)) for item in track.untracked],
        "jumps": [list(astuple(item)) for item in track.jumps],
        "reason": track.reason,
        "left_out": left
        and {
            "px": _nan_to_none(left.px),
            "by_frame": _nan_to_none(left.by_frame),
            "median_px": left.median_px,
            "p95_px": left.p95_px,
            "predicted": left.predicted,
        },
        "offsets": [list(item) for item in track.offsets],
        "noise": [list(item) for item in track.noise],
    }


def patches_to_json(patches: Iterable[TrackPatch]) -> Json:
    """Parts of a track that corrections changed."""
    return [
        {
            "corrections": corrections_to_json(patch.corrections),
            "rows": patch.rows.tolist(),
            "part": track_to_json(patch.part),
        }
        for patch in patches
    ]


def patches_from_json(value: Iterable[Mapping[str, Any]]) -> tuple[TrackPatch, ...]:
    """Back from ``patches_to_json``.

    Raises:
        DamagedError: It is not what was written.
    """
    with translate_shape_errors_to_damage():
        return tuple(
            TrackPatch(
                corrections_from_json(item["corrections"]),
                np.array(item["rows"], dtype=np.int64),
                track_from_json(item["part"]),
            )
            for item in value
        )


def track_from_json(value: Mapping[str, Any]) -> BallTrack:
    """Back from ``track_to_json``.

    Raises:
        DamagedError: It is not what was written.
    """
    with translate_shape_errors_to_damage():
        frames = np.array(value["frames"], dtype=np.int64)
        count, left = len(frames), value["left_out"]
        covariance = np.full((count, 6, 6), np.nan)
        upper = _rows_from_json(value["covariance"], count, 21)
        covariance[:, _UPPER[0], _UPPER[1]] = upper
        covariance[:, _UPPER[1], _UPPER[0]] = upper
        return BallTrack(
            frames,
            np.array(value["times"], dtype=float),
            _rows_from_json(value["position"], count, 3),
            _rows_from_json(value["velocity"], count, 3),
            covariance,
            tuple(value["state"]),
            tuple(value["mode"]),
            tuple(tuple(names) for names in value["views"]),
            tuple(
                BallEvent(frame, time, kind, np.array(place, dtype=float), sigma)
                for frame, time, kind, place, sigma in value["events"]
            ),
            tuple(ContradictingMeasurement(*item) for item in value["contradicted"]),
            value["reason"],
            left
            and LeaveOneOutSummary(
                _none_to_nan(left["px"]),
                _none_to_nan(left["by_frame"]),
                left["median_px"],
                left["p95_px"],
                left["predicted"],
            ),
            tuple((name, offset) for name, offset in value["offsets"]),
            # Tracks of earlier versions do not say these.
            tuple((name, times) for name, times in value.get("noise", ())),
            tuple(UntrackedRun(*item) for item in value.get("untracked", ())),
            tuple(
                ViewJump(frame, time, metres, tuple(views))
                for frame, time, metres, views in value.get("jumps", ())
            ),
        )


def _nan_to_none(values: FloatArray) -> list[float | None]:
    return [None if value != value else value for value in values.tolist()]


def _none_to_nan(values: Sequence[float | None]) -> FloatArray:
    return np.array([np.nan if value is None else value for value in values], dtype=float)


def _rows_to_json(values: FloatArray) -> list[list[float] | None]:
    known = np.atleast_1d(np.isfinite(values).all(axis=1)).tolist()
    return [row if there else None for row, there in zip(values.tolist(), known, strict=True)]


def _rows_from_json(rows: Sequence[Sequence[float] | None], count: int, width: int) -> FloatArray:
    nothing = [np.nan] * width
    found = [nothing if row is None else row for row in rows]
    return np.array(found, dtype=float).reshape(count, width)
