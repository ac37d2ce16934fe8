from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from sqlalchemy import select

from app.db.log import read_log
from app.db.store import Store
from app.errors import ConflictError, InputError, NotFoundError, StaleRevisionError
from app.features.datasets.tables import GroupModel
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import import_groups
from app.features.solutions.service import solve_dataset
from app.features.tracks import service
from app.features.tracks.queries import GroupStateForTracking
from app.features.tracks.service import (
    MadeTracks,
    Track,
    TrackReview,
    get_track,
    list_tracks,
    make_tracks,
    read_track_detail,
    review_track,
)
from app.features.tracks.stored import compute_track_stamp, summarize_track
from app.features.verdicts.service import set_verdict
from app.soccer.frames import ImagePoint
from app.soccer.group import Group
from app.soccer.policy import PAPER
from app.tracking.ball_track import EventCorrection
from tests.flights import FIRST, flight_groups, places
from tests.unit.features.tracks.test_stretches import recorded


def make(store: Store) -> MadeTracks:
    return make_tracks(store, "demo", None, "ann", lambda *_: None)


def only(store: Store) -> Track:
    (track,) = list_tracks(store, "demo")
    return track


def change(store: Store, what: TrackReview) -> Track:
    track = only(store)
    return review_track(store, track.id, what, track.etag, actor="ben")


def move(store: Store, group: int, by: float) -> None:
    """Move the first ball of a group, and solve it."""
    state = load_group_state(store, group)
    view = state.group.views[0]
    ball = replace(view.ball, point=ImagePoint(view.ball.point.x + by, view.ball.point.y))
    submit_edit(store, group, make_set_ball_edit(view.key, ball), if_match=state.etag, actor="ann")
    solve_dataset(store, "demo")


class TestMakeTracks:
    def test_a_track_is_stored_with_what_came_of_it(self, store, flight) -> None:
        assert make(store) == MadeTracks(made=1, unchanged=0, without=[])
        track = only(store)
        assert (track.key, track.first, track.last) == ("rig", FIRST, FIRST + 59)
        assert (track.stale, track.verdict, track.actor) == (False, None, "ann")
        assert track.summary.frames == sum(track.summary.states.values()) == 60
        assert track.summary.measurements > 150
        detail = read_track_detail(store, track.id)
        assert np.nanmedian(np.linalg.norm(detail.ball.position - places(60), axis=1)) < 0.1
        assert detail.groups[FIRST + 3].id == flight[3]

    def test_again_changes_nothing(self, store, flight) -> None:
        make(store)
        before = only(store)
        assert make(store) == MadeTracks(made=0, unchanged=1, without=[])
        assert only(store) == before

    def test_a_changed_group_makes_it_stale_until_it_is_made_again(self, store, flight) -> None:
        make(store)
        before = only(store)
        change(store, TrackReview("accepted"))
        move(store, flight[7], 3.0)
        assert only(store).stale
        assert make(store).made == 1
        after = only(store)
        assert (after.id, after.stale, after.verdict) == (before.id, False, None)
        assert after.etag != before.etag

    def test_a_rejected_group_measures_nothing(self, store, flight) -> None:
        make(store)
        state = load_group_state(store, flight[4])
        set_verdict(
            store, flight[4], "rejected", "ball_not_visible", if_match=state.etag, actor="ann"
        )
        assert only(store).stale
        make(store)
        views = len(flight_groups(60)[4].views)
        assert (
            only(store).summary.measurements
            == sum(len(group.views) for group in flight_groups(60)) - views
        )

    def test_corrections_stay_when_it_is_made_again(self, store, flight) -> None:
        make(store)
        said = (EventCorrection(FIRST + 2, "kick", True),)
        change(store, TrackReview(corrections=said))
        move(store, flight[30], 2.0)
        make(store)
        assert only(store).corrections == said

    def test_groups_without_time_are_refused(self, store, fill, make_group) -> None:
        fill(make_group())
        with pytest.raises(InputError, match="follow each other in time"):
            make(store)

    def test_too_little_is_a_stretch_without_a_track(self, store, fill) -> None:
        fill(*(replace(group, views=group.views[:1]) for group in flight_groups(2)))
        (without,) = make(store).without
        assert without["stretch"] == "rig"
        assert only(store).summary.reason == without["reason"]
        with pytest.raises(ConflictError, match='the stretch "rig" has no track'):
            change(store, TrackReview("accepted"))

    def test_a_stretch_that_is_gone_goes_unless_somebody_judged_it(self, store, flight) -> None:
        make(store)
        with store.write() as session:
            session.execute(_renamed())
        make(store)
        assert [track.key for track in list_tracks(store, "demo")] == ["other"]


def add_instants(store: Store, *numbers: int) -> None:
    """Groups of a recording at frames of it, solved."""
    groups = [
        recorded(item, n) for item, n in zip(flight_groups(len(numbers)), numbers, strict=True)
    ]
    import_groups(store, "demo", groups, source="test", actor="ann")
    solve_dataset(store, "demo")


class TestStretchesThatChange:
    """A stretch is the one that it was, whatever groups it gains and wherever it is cut."""

    def test_one_more_instant_leaves_it_its_corrections(self, store) -> None:
        add_instants(store, *range(20))
        make(store)
        said = (EventCorrection(7, "kick", True),)
        before = change(store, TrackReview(corrections=said))
        add_instants(store, 20)
        make(store)
        after = only(store)
        assert (after.key, after.id, after.corrections) == ("final 0-20", before.id, said)

    def test_joined_ones_have_what_was_said_of_both(self, store) -> None:
        add_instants(store, *range(20), *range(150, 170))
        make(store)
        said = (EventCorrection(7, "kick", True), EventCorrection(155, "bounce", True))
        for track, item in zip(list_tracks(store, "demo"), said, strict=True):
            wanted = TrackReview(corrections=(item,))
            review_track(store, track.id, wanted, track.etag, actor="ben")
        add_instants(store, 85)
        make(store)
        assert (only(store).key, only(store).corrections) == ("final 0-169", said)

    def test_cut_ones_have_each_what_was_said_of_its_frames(self, store) -> None:
        add_instants(store, *range(20), 85, *range(150, 180))
        make(store)
        said = (EventCorrection(7, "kick", True), EventCorrection(155, "bounce", True))
        whole = change(store, TrackReview(corrections=said))
        with store.read() as session:
            cut = session.scalar(select(GroupModel.id).where(GroupModel.key == "final/85.png"))
        etag = load_group_state(store, cut).etag
        set_verdict(store, cut, "rejected", "ball_not_visible", if_match=etag, actor="ann")
        make(store)
        first, last = list_tracks(store, "demo")
        assert (first.corrections, last.corrections) == (said[:1], said[1:])
        assert (last.id, last.key) == (whole.id, "final 150-179")

    def test_a_rig_that_goes_on_makes_its_track_stale(self, store, flight) -> None:
        make(store)
        import_groups(store, "demo", flight_groups(62)[60:], source="test", actor="ann")
        assert only(store).stale

    def test_groups_that_its_shot_gained_or_lost_make_a_track_stale(self) -> None:
        groups = [
            GroupStateForTracking(f"final/{frame}.png", ("hash", True, False))
            for frame in (*range(20), 30)
        ]
        place = SimpleNamespace(key="final 0-19", match="final", first=0, last=19)

        def stamp(of: Sequence[GroupStateForTracking], *shots: tuple[int, int]) -> str:
            return compute_track_stamp(PAPER, of, place, (), shots)

        made = stamp(groups[:20], (0, 40))
        assert made == stamp(groups[:20]) == stamp(groups, (0, 25), (26, 40))
        assert made != stamp(groups, (0, 40))
        assert made != stamp(groups[:20], (0, 9), (10, 40))


class TestWarnings:
    def test_they_are_of_the_track_as_it_is_corrected(self, store, flight) -> None:
        make(store)
        track = only(store)
        ball = read_track_detail(store, track.id).ball
        like = replace(track.summary, unused={"not solved": 2}, warnings=["of another time"])
        assert summarize_track(ball, like).warnings == ["Not measured: 2 balls (not solved)."]

    def test_a_run_that_fits_no_ball_is_named_beside_a_good_one(self, store, fill) -> None:
        groups = flight_groups(60)
        far = [replace(item, key=str(FIRST + 200 + at)) for at, item in enumerate(groups[:20])]
        fill(*groups, *(mirrored(item) for item in far))
        make(store)
        summary = only(store).summary
        assert summary.reason is None
        (warning,) = summary.warnings
        assert warning.startswith(f"Frames {FIRST + 200} to {FIRST + 219} (")
        assert "contradict each other" in warning


def mirrored(group: Group) -> Group:
    """A group with the balls of two of four views where mirrored cameras would have them."""
    for view in group.views[:2]:
        point = view.ball.point
        ball = replace(view.ball, point=ImagePoint(view.size.width - 1 - point.x, point.y))
        group = group.with_view(replace(view, balls=(ball,)))
    return group


def _events(store: Store) -> list[tuple[int, str]]:
    events = read_track_detail(store, only(store).id).ball.events
    return [(event.frame, event.kind) for event in events]


def _renamed():
    from sqlalchemy import update

    from app.features.datasets.tables import GroupModel

    return update(GroupModel).values(match="other")


class TestChangeTrack:
    def test_is_accepted_by_a_person_and_the_log_says_so(self, store, flight) -> None:
        make(store)
        found = change(store, TrackReview("accepted", "looks right"))
        assert (found.verdict, found.note, found.judged_by) == ("accepted", "looks right", "ben")
        assert found == only(store)
        with store.read() as session:
            deeds = [entry.body for entry in read_log(session) if entry.kind == "deed"]
        assert deeds[-1]["did"] == "track accepted"
        back = change(store, TrackReview("none"))
        assert (back.verdict, back.note, back.judged_by, back.judged_at) == (None, None, None, None)
        with pytest.raises(InputError, match="changes nothing"):
            change(store, TrackReview(note="a word"))

    def test_a_stale_one_is_not_accepted(self, store, flight) -> None:
        make(store)
        move(store, flight[7], 3.0)
        with pytest.raises(ConflictError, match='groups of the track "rig" have changed'):
            change(store, TrackReview("accepted"))
        assert change(store, TrackReview("rejected")).verdict == "rejected"

    def test_events_are_corrected_and_what_was_accepted_is_not_any_more(
        self, store, flight
    ) -> None:
        make(store)
        change(store, TrackReview("accepted"))
        before = _events(store)
        found = change(store, TrackReview(corrections=(EventCorrection(FIRST + 40, "out", True),)))
        assert found.verdict is None
        assert set(_events(store)) - set(before) == {(FIRST + 40, "out")}

    def test_a_correction_outside_of_it_is_refused(self, store, flight) -> None:
        make(store)
        with pytest.raises(
            InputError, match=f"is not in the track .rig., which has the frames {FIRST} to"
        ) as error:
            change(store, TrackReview(corrections=(EventCorrection(3, "out", True),)))
        assert error.value.pointer == "/corrections/0/frame"

    def test_what_is_corrected_and_accepted_at_once_is_judged_as_it_becomes(
        self, store, flight, monkeypatch
    ) -> None:
        make(store)
        monkeypatch.setattr(
            service, "summarize_track", lambda _, like: replace(like, reason="too little is seen")
        )
        asked = TrackReview("accepted", corrections=(EventCorrection(FIRST + 9, "kick", True),))
        with pytest.raises(ConflictError, match="has no track"):
            change(store, asked)
        assert only(store).verdict is None

    def test_two_people_do_not_overwrite_each_other(self, store, flight) -> None:
        make(store)
        etag = only(store).etag
        change(store, TrackReview("rejected"))
        with pytest.raises(StaleRevisionError):
            review_track(store, only(store).id, TrackReview("accepted"), etag, actor="ann")

    def test_a_track_that_is_not_there(self, store) -> None:
        with pytest.raises(NotFoundError, match="there is no track 9"):
            get_track(store, 9)
