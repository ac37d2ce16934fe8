"""Tracks as exports have them: computed from the groups of an export, or as people accepted them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import pairwise
from typing import Any

import numpy as np

from app.errors import InputError
from app.features.tracks.codec import (
    TrackInputs,
    digest_inputs,
    inputs_from_json,
    make_track,
    track_from_json,
)
from app.features.tracks.run_measurements import AcceptedRunObservation
from app.features.tracks.stretches import (
    MOST_FRAMES,
    RATE,
    Shots,
    Stretch,
    gather_stretches,
    match_stored_to_stretches,
    require_any_stretch,
)
from app.formats.export_record import ExportRecord
from app.formats.tracks_writer import TrackRecord
from app.geometry.arrays import FloatArray
from app.geometry.camera import Camera
from app.media.video import MAX_FRAMES
from app.soccer.policy import Policy
from app.tracking.ball_track import BallTrack, EventCorrection

_FRAMES = re.compile(r" \d+-\d+$", re.ASCII)


@dataclass(frozen=True)
class StoredStretchTrack:
    """What is stored of a stretch.

    Attributes:
        key, match, first, last: Of the stretch, when the track was made.
        digest: Of the inputs of its track.
        track: The track, with its corrections; None where nobody accepted it.
        verdict: ``accepted``, ``rejected`` or None.
        corrections: What people said of its events.
        inputs: What a frozen track was made of; None of another.
    """

    key: str
    match: str
    first: int
    last: int
    digest: str
    track: BallTrack | None
    verdict: str | None
    corrections: tuple[EventCorrection, ...] = ()
    inputs: TrackInputs | None = None


@dataclass(frozen=True)
class TrackSource:
    """Makes the tracks of an export.

    Attributes:
        dataset: Name of the dataset.
        policy: Says how noisy clicks and cameras are.
        shots: Of its recordings; of a frozen version none, as they may be others by now.
        known: What is stored of stretches, or frozen.
        followed: Balls of accepted runs, by match.
        frozen: Whether it is a frozen version's tracks that are known: they are written as they are, and
            no others.
        everything: Whether rejected groups and tracks take part.
        try_only: Whether it is only asked if there are stretches.
        facts: Gets what the manifest says of each stretch, as its track is made.
    """

    dataset: str
    policy: Policy
    shots: Shots = field(default_factory=dict)
    known: Sequence[StoredStretchTrack] = ()
    frozen: bool = False
    everything: bool = False
    try_only: bool = False
    facts: list[dict[str, Any]] = field(default_factory=list)
    followed: Mapping[str, Sequence[AcceptedRunObservation]] = field(default_factory=dict)

    def make_track_records(self, records: Iterable[ExportRecord]) -> Iterator[TrackRecord]:
        """The tracks of groups, in the order of their keys.

        Raises:
            InputError: No groups follow each other in time, or no stretch has a track; with the reasons.
        """
        taken = (item for item in records if self.everything or item.verdict != "rejected")
        shots = _cut_at_frozen_tracks(self.known) if self.frozen else self.shots
        stretches = gather_stretches(taken, self.policy, shots, self.followed)
        if self.frozen:
            stretches = _restore_frozen_stretches(self.known, stretches)
        require_any_stretch(self.dataset, stretches)
        if self.try_only:
            return
        reasons, known = [], match_stored_to_stretches(stretches, self.known)
        for stretch in stretches:
            found = self._make_record(stretch, known.get(stretch.key))
            if isinstance(found, str):
                reasons.append(f"{stretch.key}: {found}")
                self.facts.append({"stretch": stretch.key, "reason": found})
            else:
                yield found
        if len(reasons) == len(stretches):
            raise InputError(
                f'no stretch of "{self.dataset}" has a track of the ball ({"; ".join(reasons[:5])})'
            )

    def _make_record(self, stretch: Stretch, known: StoredStretchTrack | None) -> TrackRecord | str:
        """A stretch's track, or why there is none."""
        if self.frozen:
            if known is None or known.track is None:
                return "its track was not accepted when the version was frozen"
            return self._build_track_record(stretch, known.track, "accepted")
        verdict, track = "unreviewed", None
        if known is not None and known.digest == digest_inputs(TrackInputs.of(stretch)):
            if known.verdict == "rejected" and not self.everything:
                return "its track was rejected"
            verdict = known.verdict or verdict
            track = known.track
        corrections = known.corrections if known is not None else ()
        return self._build_track_record(
            stretch, track or make_track(TrackInputs.of(stretch, corrections)), verdict
        )

    def _build_track_record(
        self, stretch: Stretch, track: BallTrack, verdict: str
    ) -> TrackRecord | str:
        if track.reason is not None:
            return track.reason
        self.facts.append(_describe_track(stretch, track, verdict))
        return TrackRecord(
            stretch.key, track, stretch.pitch, stretch.rate, stretch.cameras, verdict
        )


def _cut_at_frozen_tracks(known: Iterable[StoredStretchTrack]) -> dict[str, list[tuple[int, int]]]:
    """Frames of recordings cut into those of frozen tracks and those between them, by match."""
    tracks: dict[str, list[StoredStretchTrack]] = {}
    for stored in known:
        tracks.setdefault(stored.match, []).append(stored)
    found = {}
    for match, of_match in tracks.items():
        edges = {0, MAX_FRAMES}
        for stored in of_match:
            edges |= {stored.first, stored.last + 1}
        found[match] = [
            (start, min(start + MOST_FRAMES, end) - 1)
            for first, end in pairwise(sorted(edges))
            for start in range(first, end, MOST_FRAMES)
        ]
    return found


def _restore_frozen_stretches(
    known: Iterable[StoredStretchTrack], stretches: Sequence[Stretch]
) -> list[Stretch]:
    """The stretches of frozen tracks as they were, and those of groups that none of them is of.

    Args:
        known: The frozen tracks.
        stretches: Of the groups of the version, cut at those: cameras, and balls that are no measurement, are theirs.
    """
    found, left = [], [*stretches]
    for stored in known:
        if stored.inputs is None:
            continue
        inside = [
            one
            for one in stretches
            if one.match == stored.match and one.first <= stored.last and stored.first <= one.last
        ]
        left = [one for one in left if one not in inside]
        found.append(_restore_frozen_stretch(stored, stored.inputs, inside))
    left = [
        one if one.key == one.match else replace(one, key=f"{one.match} {one.first}-{one.last}")
        for one in left
    ]
    return sorted([*found, *left], key=lambda one: (one.match, one.first))


def _restore_frozen_stretch(
    stored: StoredStretchTrack, inputs: TrackInputs, inside: Sequence[Stretch]
) -> Stretch:
    frames = range(stored.first, stored.last + 1)
    cameras: dict[str, dict[int, Camera]] = {}
    for view, frame, camera in (
        (view, frame, camera)
        for one in inside
        for view, of_view in one.cameras.items()
        for frame, camera in of_view.items()
        if frame in frames
    ):
        cameras.setdefault(view, {})[frame] = camera
    measured = inputs.measurements
    for view, frame, camera in zip(
        measured.views, measured.frames.tolist(), measured.cameras, strict=True
    ):
        cameras.setdefault(view, {}).setdefault(frame, camera)
    span = float(inputs.times[-1] - inputs.times[0])
    is_rig = stored.key == stored.match
    return Stretch(
        key=stored.key,
        match=stored.match,
        rate=RATE if is_rig or span <= 0 else (len(inputs.frames) - 1) / span,
        frames=inputs.frames,
        times=inputs.times,
        pitch=inputs.pitch,
        measurements=measured,
        groups={},
        cameras=cameras,
        unused=dict(sum((Counter(one.unused) for one in inside), Counter[str]())),
    )


def parse_frozen_track(key: str, value: Mapping[str, Any]) -> StoredStretchTrack:
    """The track of a stretch in a frozen version.

    Args:
        key: Of the stretch, as it was frozen.
        value: As ``codec.frozen_track_to_json`` made it.
    """
    track, inputs = track_from_json(value["track"]), inputs_from_json(value["inputs"])
    # Versions of earlier software do not say the match: a recording's stretches end in their frames.
    match = value.get("match") or _FRAMES.sub("", key)
    bounds = int(inputs.frames[0]), int(inputs.frames[-1])
    return StoredStretchTrack(key, match, *bounds, "", track, "accepted", inputs=inputs)


def list_frozen_track_records(frozen: Mapping[str, Mapping[str, Any]]) -> list[TrackRecord]:
    """The tracks of a frozen version as they are, without cameras.

    Args:
        frozen: By stretch, as ``codec.frozen_track_to_json`` made them.
    """
    found = []
    for key, value in sorted(frozen.items()):
        track, inputs = track_from_json(value["track"]), inputs_from_json(value["inputs"])
        step = np.diff(inputs.times)
        rate = 1 / float(np.median(step)) if len(step) else RATE
        found.append(TrackRecord(key, track, inputs.pitch, rate, verdict="accepted"))
    return found


def _describe_track(stretch: Stretch, track: BallTrack, verdict: str) -> dict[str, Any]:
    """What a manifest says of a track."""
    left, measured = track.left_out, stretch.measurements
    return {
        "stretch": stretch.key,
        "verdict": verdict,
        "frames": len(track.frames),
        "frames_a_second": stretch.rate,
        # Groups of a rig are numbered and say no time.
        "rate": "assumed" if stretch.key == stretch.match else "of the recording",
        "states": {state: track.state.count(state) for state in sorted(set(track.state))},
        "measurements": len(measured),
        "contradicted": len(track.contradicted),
        "untracked": [asdict(item) for item in track.untracked],
        "jumps": [asdict(item) for item in track.jumps],
        "not_measured": dict(stretch.unused),
        "left_out_median_px": left and left.median_px,
        "left_out_p95_px": left and left.p95_px,
        "left_out_median_m": None
        if left is None
        else _compute_median_error_metres(stretch, track, left.px),
    }


def _compute_median_error_metres(
    stretch: Stretch, track: BallTrack, px: FloatArray
) -> float | None:
    """Median of left-out errors at the ball's distance, metres across the rays; None without one.

    Args:
        stretch: What was measured.
        track: Made of all of it.
        px: Error of each measurement, NaN where none was predicted, shape (M,).
    """
    measured, rows = stretch.measurements, stretch.measurements.frames - track.frames[0]
    if len(px) != len(measured):
        return None
    places = track.position[rows]
    known = np.flatnonzero(np.isfinite(px) & np.isfinite(places).all(axis=1))
    metres = [
        px[row]
        * float(measured.cameras[row].pitch_to_camera(places[row][None])[0, 2])
        / measured.cameras[row].focal_length[0]
        for row in known.tolist()
    ]
    return float(np.median(metres)) if metres else None
