"""A track around a frame, as its groups are now."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.db.session import Session
from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.groups.submit import load_group_state
from app.features.people.visibility_queries import READER, RestrictedReader
from app.features.tracks.around import AROUND, compute_track_excerpt, find_tracks_of_group
from app.features.tracks.codec import TrackInputs, make_partial_track
from app.features.tracks.making import read_export_records
from app.features.tracks.queries import GroupForTracking
from app.features.tracks.service import list_tracks, make_tracks, read_track_detail
from app.features.verdicts.service import set_verdict
from app.formats.export_record import ExportRecord
from app.soccer.group import Group
from app.tracking.ball_track import BallTrack, ViewErrors
from tests.flights import FIRST, flight_groups, places
from tests.unit.features.tracks.test_service import move

AT = 30


@pytest.fixture
def track(store: Store, flight: list[int]) -> int:
    """Id of the track of the flight."""
    make_tracks(store, "demo", None, "ann", lambda *_: None)
    (found,) = list_tracks(store, "demo")
    return found.id


def at_frame(store: Store, track: int) -> np.ndarray:
    detail = compute_track_excerpt(store, track, FIRST + AT)
    (row,) = np.flatnonzero(detail.ball.frames == FIRST + AT)
    return np.asarray(detail.ball.position[row])


class TestTrackAround:
    def test_is_the_track_where_nothing_has_changed(self, store: Store, track: int) -> None:
        whole = read_track_detail(store, track).ball.position[AT]
        assert np.linalg.norm(at_frame(store, track) - whole) < 0.03
        assert np.linalg.norm(at_frame(store, track) - places(AT + 1)[-1]) < 0.1

    def test_tells_what_an_edit_makes_of_it(
        self, store: Store, flight: list[int], track: int
    ) -> None:
        move(store, flight[AT], 60.0)
        detail = compute_track_excerpt(store, track, FIRST + AT)
        (changed,) = list_tracks(store, "demo")
        assert changed.stale
        frames = [
            int(detail.inputs.measurements.frames[item.measurement])
            for item in detail.ball.contradicted
        ]
        assert frames == [FIRST + AT]
        assert not read_track_detail(store, track).ball.contradicted

    def test_reads_what_changed_and_keeps_the_rest(
        self, store: Store, flight: list[int], track: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        compute_track_excerpt(store, track, FIRST + AT)
        asked: list[str] = []

        def reading(session: Session, groups: Sequence[GroupForTracking]) -> Iterator[ExportRecord]:
            asked.extend(group.key for group in groups)
            return read_export_records(session, groups)

        monkeypatch.setattr("app.features.tracks.around.read_export_records", reading)
        move(store, flight[AT], 47.0)
        detail = compute_track_excerpt(store, track, FIRST + AT)
        assert [int(key) for key in asked] == [FIRST + AT]
        assert len(detail.ball.contradicted) == 1

    def test_has_no_frames_beyond_those_of_the_track(self, store: Store, track: int) -> None:
        detail = compute_track_excerpt(store, track, FIRST)
        assert detail.ball.frames[0] == FIRST
        assert AROUND <= len(detail.ball.frames) < 60

    def test_says_why_there_is_none(self, store: Store, flight: list[int], track: int) -> None:
        for group in flight:
            set_verdict(
                store, group, "rejected", "ball_not_visible",
                if_match=load_group_state(store, group).etag, actor="ann",
            )  # fmt: skip
        detail = compute_track_excerpt(store, track, FIRST + AT)
        assert detail.ball.reason == "No group near this frame is part of the track."

    def test_is_of_the_worst_frame_where_none_is_named(self, store: Store, track: int) -> None:
        (worst,) = [found.summary.worst for found in list_tracks(store, "demo")]
        assert compute_track_excerpt(store, track).frame == worst

    def test_refuses_what_it_does_not_have(self, store: Store, track: int) -> None:
        with pytest.raises(InputError, match="frame 3 is not in the track"):
            compute_track_excerpt(store, track, 3)
        with pytest.raises(NotFoundError, match="there is no track 99"):
            compute_track_excerpt(store, 99, FIRST)


class TestInexactCamera:
    def test_is_known_from_the_whole(
        self, store: Store, fill: Callable[..., list[int]], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        fill(*map(with_a_low_camera, flight_groups(60)))
        make_tracks(store, "demo", None, "ann", lambda *_: None)
        (track,) = list_tracks(store, "demo")
        assert track.summary.noise.keys() == {"cam1"} and track.summary.noise["cam1"] > 5
        told: list[ViewErrors] = []

        def part(inputs: TrackInputs, known: ViewErrors) -> BallTrack:
            told.append(known)
            return make_partial_track(inputs, known)

        monkeypatch.setattr("app.features.tracks.around.make_partial_track", part)
        whole = read_track_detail(store, track.id).ball.position[AT]
        assert np.linalg.norm(at_frame(store, track.id) - whole) < 0.05
        assert told == [ViewErrors(track.summary.noise, track.summary.late)]


def with_a_low_camera(group: Group) -> Group:
    """A group whose first camera is said to stand a metre lower than it does."""
    views = []
    for view in group.views:
        given = view.station.given
        if view.key == "cam1" and given is not None:
            given = replace(given, position=given.position + np.array([0.0, 0.0, 1.0]))
        views.append(replace(view, station=replace(view.station, given=given)))
    return replace(group, views=tuple(views))


class TestTracksOfGroup:
    def test_are_those_of_its_frame(self, store: Store, flight: list[int], track: int) -> None:
        (found,) = find_tracks_of_group(store, flight[7])
        assert (found.track.id, found.frame) == (track, FIRST + 7)

    def test_are_none_before_somebody_made_them(self, store: Store, flight: list[int]) -> None:
        assert find_tracks_of_group(store, flight[7]) == []
        with pytest.raises(NotFoundError):
            find_tracks_of_group(store, 999)


def test_who_does_not_see_all_groups_is_told_of_no_track(
    store: Store, flight: list[int], track: int
) -> None:
    assert [one.track.id for one in find_tracks_of_group(store, flight[AT])] == [track]
    dataset = list_tracks(store, "demo")[0].dataset_id
    token = READER.set(RestrictedReader("bo", {dataset: frozenset({1})}, lambda _: False))
    try:
        assert find_tracks_of_group(store, flight[AT]) == []
    finally:
        READER.reset(token)
