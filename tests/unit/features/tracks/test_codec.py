from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from app.errors import DamagedError
from app.features.tracks.codec import (
    TRACK_VERSION,
    TrackInputs,
    apply_corrections,
    digest_inputs,
    inputs_from_json,
    inputs_to_json,
    make_track,
    patches_from_json,
    patches_to_json,
    solve_corrected_parts,
    track_from_json,
    track_to_json,
)
from app.features.tracks.stretches import gather_stretches
from app.formats.export_record import ExportRecord
from app.json_text import canonical_json_text
from app.soccer.pitch import Pitch
from app.soccer.policy import PAPER
from app.solving.solve import solve_group
from app.tracking.ball_track import (
    BallEvent,
    BallTrack,
    ContradictingMeasurement,
    EventCorrection,
    LeaveOneOutSummary,
    UntrackedRun,
    ViewJump,
)
from tests.flights import FIRST, flight_groups, places
from tests.unit.tracking.test_ball_solve import BOTH, FRAMES, TIMES, seen


@pytest.fixture(scope="module")
def inputs() -> TrackInputs:
    records = [
        ExportRecord(item, solve_group(item, PAPER), "unreviewed") for item in flight_groups(60)
    ]
    (stretch,) = gather_stretches(records, PAPER)
    return TrackInputs.of(stretch)


@pytest.fixture(scope="module")
def track(inputs) -> BallTrack:
    return make_track(inputs)


def equal(one: BallTrack, other: BallTrack) -> bool:
    return canonical_json_text(track_to_json(one)) == canonical_json_text(track_to_json(other))


class TestMakeTrack:
    def test_is_where_the_ball_was(self, track) -> None:
        assert track.reason is None
        off = np.linalg.norm(track.position - places(60), axis=1)
        assert np.nanmedian(off) < 0.1
        assert np.isfinite(off).mean() > 0.9

    def test_is_the_same_bit_for_bit_from_what_was_stored(self, inputs, track) -> None:
        assert equal(make_track(inputs_from_json(inputs_to_json(inputs))), track)


class TestInputs:
    def test_come_back_with_the_same_digest(self, inputs) -> None:
        value = inputs_to_json(inputs)
        assert len(value["cameras"]) == 4
        assert digest_inputs(inputs_from_json(value)) == digest_inputs(inputs)

    def test_a_moved_ball_and_a_correction_have_another_digest(self, inputs) -> None:
        pixels = inputs.measurements.pixels.copy()
        pixels[0, 0] += 1e-9
        moved = replace(inputs, measurements=replace(inputs.measurements, pixels=pixels))
        said = replace(inputs, corrections=(EventCorrection(FIRST, "kick", True),))
        assert len({digest_inputs(item) for item in (inputs, moved, said)}) == 3

    def test_what_was_not_written_so_is_damage(self, inputs) -> None:
        with pytest.raises(DamagedError):
            inputs_from_json({**inputs_to_json(inputs), "cameras": []})


class TestTrackJson:
    def test_keeps_every_digit_and_every_gap(self, track) -> None:
        position = track.position.copy()
        position[4] = np.nan
        px = np.array([1.5, np.nan])
        whole = replace(
            track,
            position=position,
            events=(BallEvent(FIRST, 4.0, "kick", np.array([1.0, 2.0, 1 / 3]), 0.02),),
            contradicted=(ContradictingMeasurement(3, 9.5, "off"),),
            left_out=LeaveOneOutSummary(px, px, 1.5, 1.5, 1),
            offsets=(("cam2", 0.04),),
            untracked=(UntrackedRun(FIRST, FIRST + 3, 5, "They contradict each other."),),
            jumps=(ViewJump(FIRST + 2, 4.08, 0.5, ("cam1", "cam2")),),
        )
        again = track_from_json(track_to_json(whole))
        assert equal(again, whole)
        assert np.isnan(again.position[4]).all()
        known = np.isfinite(whole.covariance).all(axis=(1, 2))
        assert np.array_equal(again.covariance[known], whole.covariance[known])
        assert track_to_json(whole)["position"][4] is None

    def test_no_track_has_a_reason(self, inputs) -> None:
        nothing = BallTrack.make_empty_track(inputs.frames, inputs.times, "one measurement")
        assert track_from_json(track_to_json(nothing)).reason == "one measurement"


class TestCorrections:
    def test_patches_come_back_bit_for_bit(self, inputs, track) -> None:
        said = replace(inputs, corrections=(EventCorrection(FIRST + 8, "kick", True),))
        patches = solve_corrected_parts(said, track)
        again = patches_from_json(json.loads(canonical_json_text(patches_to_json(patches))))
        assert len(patches) == 1
        assert equal(apply_corrections(said, track, again), apply_corrections(said, track, patches))

    def test_a_stored_track_is_corrected_as_a_fresh_one(self, inputs, track) -> None:
        said = replace(inputs, corrections=(EventCorrection(FIRST + 8, "kick", True),))
        stored = track_from_json(json.loads(canonical_json_text(track_to_json(track))))
        assert equal(
            apply_corrections(said, stored, solve_corrected_parts(said, stored)), make_track(said)
        )


def pinned() -> TrackInputs:
    """A made ball before two cameras, part of its way before one, with a correction."""
    measured = seen(BOTH, hide=[("left", 60, 90), ("right", 100, 106)])
    said = (EventCorrection(130, "kick", True), EventCorrection(231, "bounce", False))
    return TrackInputs(FRAMES, TIMES, Pitch(), measured, said)


PLACES = [
    *(-7.788814833480648, 5.525342384329569, -0.11322623429637715),
    *(-17.306490073534267, 9.965362913594934, -0.08213557481301506),
    *(-3.9237562912575443, -14.084785123826896, -0.9739250604700936),
    *(-3.056739811727608, -2.328541324920376, -1.6898964747200402),
    *(26.615321735434016, -8.915113459216348, -0.18487305472768703),
]
SIGMA = [
    *(0.02898530599434924, 0.02912507613665375, 0.17110791067565193),
    *(0.043114813098111875, 0.01989406154150712),
]
EVENTS = [
    *((125, "kick"), (129, "kick"), (169, "kick"), (193, "bounce"), (196, "kick")),
    *((227, "bounce"), (244, "bounce"), (256, "kick")),
]


class TestVersion:
    def test_the_track_of_a_pinned_input_is_what_its_version_says(self) -> None:
        """A change here asks for another ``TRACK_VERSION``: tracks of the old one are stale then."""
        track = make_track(pinned())
        assert (TRACK_VERSION, track.reason) == ("7", None)
        rows = [10, 30, 75, 103, 150]
        assert track.position[rows].ravel() == pytest.approx(PLACES, abs=1e-5)
        assert track.sigma[rows] == pytest.approx(SIGMA, rel=1e-4)
        assert [(event.frame, event.kind) for event in track.events] == EVENTS
