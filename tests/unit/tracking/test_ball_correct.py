"""Tracks of a made ball, corrected by people."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.soccer.pitch import Pitch
from app.tracking.ball_correct import NEAR_FRAMES, TrackPatch, apply_patches, correct_track
from app.tracking.ball_track import BallEvent, BallMeasurements, BallTrack, EventCorrection
from tests.unit.tracking.test_ball_solve import BOTH, FRAMES, PLACES, RIGHT, seen, tracked

GIVEN = seen(BOTH)
ALONE = seen({"right": RIGHT})


@pytest.fixture(scope="module")
def track() -> BallTrack:
    return tracked(GIVEN)


@pytest.fixture(scope="module")
def alone() -> BallTrack:
    return tracked(ALONE)


def solved(
    track: BallTrack,
    measurements: BallMeasurements,
    *said: EventCorrection,
    known: Sequence[TrackPatch] = (),
) -> tuple[BallTrack, tuple[TrackPatch, ...]]:
    patches = correct_track(track, measurements, Pitch(), said, known)
    return apply_patches(track, measurements, patches, said), patches


def kinds_near(track: BallTrack, frame: int, reach: int = NEAR_FRAMES) -> list[str]:
    return [event.kind for event in track.events if abs(event.frame - frame) <= reach]


def kick_of(track: BallTrack) -> BallEvent:
    """A kick in the middle of a track, with no other event beside it."""
    frames = np.array([event.frame for event in track.events])
    return next(
        event
        for event in track.events
        if event.kind == "kick"
        and 130 < event.frame < 260
        and (np.abs(frames - event.frame) <= 2 * NEAR_FRAMES).sum() == 1
    )


def quiet_frame(track: BallTrack) -> int:
    """A frame far from every event."""
    events = np.array([event.frame for event in track.events])
    return int(max(FRAMES[30:-30], key=lambda frame: np.abs(events - frame).min()))


class TestAdded:
    def test_an_event_is_in_the_search_and_the_fit(self, track: BallTrack) -> None:
        frame = quiet_frame(track)
        assert kinds_near(track, frame) == []
        found, (patch,) = solved(track, GIVEN, EventCorrection(frame, "kick", True))
        assert kinds_near(patch.part, frame, 1) == ["kick"]
        row = frame - FRAMES[0]
        assert not np.array_equal(found.velocity[row], track.velocity[row])
        # The measurements know better than to follow a kick that was none.
        assert np.linalg.norm(found.position - track.position, axis=1).max() < 0.2

    def test_the_rest_of_the_track_stays_bit_for_bit(self, track: BallTrack) -> None:
        frame = quiet_frame(track)
        found, (patch,) = solved(track, GIVEN, EventCorrection(frame, "kick", True))
        beside = ~np.isin(track.frames, patch.part.frames)
        assert 0.3 < beside.mean() < 0.9
        for name in ("position", "velocity", "covariance"):
            assert np.array_equal(getattr(found, name)[beside], getattr(track, name)[beside])
        inside = patch.part.frames
        others = [event for event in track.events if event.frame not in inside]
        assert [event for event in found.events if event.frame not in inside] == others

    def test_no_step_where_the_part_meets_the_rest(self, track: BallTrack) -> None:
        found, (patch,) = solved(track, GIVEN, EventCorrection(quiet_frame(track), "kick", True))
        for row in (int(patch.part.frames[0] - FRAMES[0]), int(patch.part.frames[-1] - FRAMES[0])):
            off = np.linalg.norm(found.position[row] - track.position[row])
            assert off < 2 * track.sigma[row]

    def test_an_event_that_is_there_is_not_added_twice(self, track: BallTrack) -> None:
        event = kick_of(track)
        found, _ = solved(track, GIVEN, EventCorrection(event.frame + 1, "kick", True))
        assert kinds_near(found, event.frame) == ["kick"]

    def test_an_event_that_measurements_say_nothing_of_stands_where_the_ball_is(
        self, track: BallTrack
    ) -> None:
        found = apply_patches(track, GIVEN, (), [EventCorrection(FRAMES[50], "out", True)])
        (event,) = [item for item in found.events if item.kind == "out"]
        assert np.array_equal(event.position, track.position[50])

    def test_a_ball_that_one_view_sees_is_where_the_line_is_that_it_crosses(self) -> None:
        pitch = Pitch(length=105.0, width=2 * (float(PLACES[60, 1]) if PLACES[60, 1] > 0 else 34.0))
        base = tracked(ALONE)
        said = EventCorrection(int(FRAMES[60]), "out", True)
        patches = correct_track(base, ALONE, pitch, [said])
        assert apply_patches(base, ALONE, patches, [said]).events


class TestRemoved:
    def test_an_event_is_not_there_and_the_ball_goes_on_without_it(self, track: BallTrack) -> None:
        event = kick_of(track)
        found, _ = solved(track, GIVEN, EventCorrection(event.frame, event.kind, False))
        assert "kick" not in kinds_near(found, event.frame)
        row = event.frame - FRAMES[0]
        step = [
            np.linalg.norm(one.velocity[row + 1] - one.velocity[row - 1]) for one in (found, track)
        ]
        assert step[0] < step[1]

    def test_taken_back_the_track_is_what_it_was(self, track: BallTrack) -> None:
        found, patches = solved(track, GIVEN)
        assert (patches, found.events) == ((), track.events)
        assert found.position is track.position

    def test_an_event_is_moved_by_removing_and_adding_it(self, track: BallTrack) -> None:
        event = kick_of(track)
        for by in (-2, 2):
            found, _ = solved(
                track,
                GIVEN,
                EventCorrection(event.frame, "kick", False),
                EventCorrection(event.frame + by, "kick", True),
            )
            (moved,) = [
                item
                for item in found.events
                if item.kind == "kick" and abs(item.frame - event.frame) <= NEAR_FRAMES
            ]
            assert abs(moved.frame - event.frame - by) <= 1


class TestPatches:
    def test_corrections_far_apart_are_solved_apart_and_once(self, track: BallTrack) -> None:
        first, second = (
            EventCorrection(FRAMES[20], "kick", True),
            EventCorrection(FRAMES[170], "kick", True),
        )
        _, one = solved(track, GIVEN, first)
        _, both = solved(track, GIVEN, second, first, known=one)
        assert both[0] is one[0] and len(both) == 2

    def test_those_side_by_side_are_solved_together(self, track: BallTrack) -> None:
        said = [EventCorrection(int(FRAMES[80 + at]), "kick", True) for at in (0, 9)]
        _, (patch,) = solved(track, GIVEN, *said)
        assert patch.corrections == tuple(said)

    def test_left_out_errors_are_those_of_the_new_part(self, track: BallTrack) -> None:
        found, (patch,) = solved(track, GIVEN, EventCorrection(quiet_frame(track), "kick", True))
        assert found.left_out is not None and track.left_out is not None
        same = found.left_out.px == track.left_out.px
        assert not same[patch.rows].any() and np.delete(same, patch.rows).all()

    def test_frames_that_the_track_has_not_are_left_out(self, track: BallTrack) -> None:
        found, patches = solved(track, GIVEN, EventCorrection(3, "kick", True))
        assert (patches, found.events) == ((), track.events)

    def test_fifty_frames_take_less_than_a_tenth_of_a_second(self, track: BallTrack) -> None:
        said = EventCorrection(quiet_frame(track), "kick", True)
        solved(track, GIVEN, said)
        began = time.process_time()
        _, (patch,) = solved(track, GIVEN, said)
        taken = time.process_time() - began
        assert len(patch.part.frames) >= 30
        # A busy machine takes longer than the tenth of a second that a quiet one is measured with.
        assert taken < 0.3


class TestOneView:
    def test_a_part_is_solved_as_far_as_one_view_alone_sees_the_ball(
        self, alone: BallTrack
    ) -> None:
        known = np.flatnonzero(np.isfinite(alone.position).all(axis=1))
        frame = int(FRAMES[known[len(known) // 2]])
        _, (patch,) = solved(alone, ALONE, EventCorrection(frame, "kick", True))
        assert len(patch.part.frames) > 75

    def test_a_bounce_that_a_person_saw_gives_a_track_where_there_was_none(self) -> None:
        count = 30
        fall = PLACES[:count].copy()
        since = np.arange(count) / 25.0
        fall[:, 0], fall[:, 1] = 12 * since - 10, 3 * since
        touch = 14
        up = np.where(since < since[touch], since[touch] - since, 0.6 * (since - since[touch]))
        fall[:, 2] = -0.113 - np.abs(6.0 * up - 4.9 * up**2)
        given = seen({"right": RIGHT}, places=np.vstack([fall, PLACES[count:]]))
        given = given.part(given.frames < FRAMES[count])
        base = tracked(given)
        said = EventCorrection(int(FRAMES[touch]), "bounce", True)
        found, _ = solved(base, given, said)
        assert found.reason is None
        assert "bounce" in kinds_near(found, said.frame, 1)


class TestNonsense:
    def test_every_frame_at_once(self, track: BallTrack) -> None:
        said = [EventCorrection(int(frame), "kick", True) for frame in FRAMES]
        found, (patch,) = solved(track, GIVEN, *said)
        assert len(patch.part.frames) == len(FRAMES)
        assert np.isfinite(found.position).all()

    def test_a_bounce_of_a_ball_that_rolls(self, track: BallTrack) -> None:
        rolls = [row for row, mode in enumerate(track.mode) if mode == "roll" and 30 < row < 160]
        found, _ = solved(track, GIVEN, EventCorrection(int(FRAMES[rolls[0]]), "bounce", True))
        assert "bounce" in kinds_near(found, int(FRAMES[rolls[0]]))

    def test_no_measurement_at_all(self) -> None:
        nothing = GIVEN.part(np.zeros(0, dtype=int))
        base = BallTrack.make_empty_track(FRAMES, FRAMES / 25.0, "nothing")
        said = [EventCorrection(int(FRAMES[3]), "kick", True)]
        assert correct_track(base, nothing, Pitch(), said) == ()
        assert replace(apply_patches(base, nothing, (), said), events=()).reason == "nothing"
