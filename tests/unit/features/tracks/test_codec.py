from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.canonical import canonical
from app.errors import DamagedError
from app.features.tracks.codec import (
    Correction,
    TrackInputs,
    corrected,
    inputs_digest,
    inputs_from_json,
    inputs_to_json,
    make_track,
    track_from_json,
    track_to_json,
)
from app.features.tracks.stretches import gather_stretches
from app.formats.export_record import ExportRecord
from app.soccer.policy import PAPER
from app.solving.solve import solve
from app.tracking.ball_track import BallEvent, BallTrack, Contradiction, LeftOut
from tests.flights import FIRST, flight_groups, places


@pytest.fixture(scope="module")
def inputs() -> TrackInputs:
    records = [ExportRecord(item, solve(item, PAPER), "unreviewed") for item in flight_groups(60)]
    (stretch,) = gather_stretches(records, PAPER)
    return TrackInputs.of(stretch)


@pytest.fixture(scope="module")
def track(inputs) -> BallTrack:
    return make_track(inputs)


def equal(one: BallTrack, other: BallTrack) -> bool:
    return canonical(track_to_json(one)) == canonical(track_to_json(other))


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
        assert inputs_digest(inputs_from_json(value)) == inputs_digest(inputs)

    def test_a_moved_ball_and_a_correction_have_another_digest(self, inputs) -> None:
        pixels = inputs.measurements.pixels.copy()
        pixels[0, 0] += 1e-9
        moved = replace(inputs, measurements=replace(inputs.measurements, pixels=pixels))
        said = replace(inputs, corrections=(Correction(FIRST, "kick", True),))
        assert len({inputs_digest(item) for item in (inputs, moved, said)}) == 3

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
            contradicted=(Contradiction(3, 9.5, "off"),),
            left_out=LeftOut(px, px, 1.5, 1.5, 1),
            offsets=(("cam2", 0.04),),
        )
        again = track_from_json(track_to_json(whole))
        assert equal(again, whole)
        assert np.isnan(again.position[4]).all()
        known = np.isfinite(whole.covariance).all(axis=(1, 2))
        assert np.array_equal(again.covariance[known], whole.covariance[known])
        assert track_to_json(whole)["position"][4] is None

    def test_no_track_has_a_reason(self, inputs) -> None:
        nothing = BallTrack.none(inputs.frames, inputs.times, "one measurement")
        assert track_from_json(track_to_json(nothing)).reason == "one measurement"


class TestCorrected:
    def test_adds_and_removes_events_by_frame(self, track) -> None:
        event = BallEvent(FIRST + 5, 4.2, "kick", track.position[5], 0.02)
        bare = replace(track, events=(event,))
        near = Correction(FIRST + 7, "kick", False)
        assert corrected(bare, [near]).events == ()
        assert corrected(bare, [replace(near, kind="bounce")]).events == (event,)
        assert corrected(bare, [replace(near, frame=FIRST + 9)]).events == (event,)
        added = corrected(bare, [Correction(FIRST + 2, "bounce", True)]).events
        assert [(item.frame, item.kind) for item in added] == [
            (FIRST + 2, "bounce"),
            (FIRST + 5, "kick"),
        ]
        assert np.array_equal(added[0].position, track.position[2])

    def test_an_event_that_is_there_is_not_added_twice(self, track) -> None:
        event = BallEvent(FIRST + 5, 4.2, "kick", track.position[5], 0.02)
        bare = replace(track, events=(event,))
        assert corrected(bare, [Correction(FIRST + 6, "kick", True)]).events == (event,)
