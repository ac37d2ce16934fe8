"""Lists of tracks: which, in which order, and for whom."""

from __future__ import annotations

from dataclasses import replace

import pytest

from app.db.store import Store
from app.errors import InputError
from app.features.batches.leases import BatchMember
from app.features.batches.progress import list_own_batches, list_team_batches
from app.features.batches.service import (
    NewBatch,
    change_batch,
    get_batch,
    list_batches,
    make_batch,
    remove_batch,
)
from app.features.imports.ingest import import_groups
from app.features.people.roles import Role
from app.features.people.service import invite
from app.features.solutions.service import solve_dataset
from app.features.tracks.listing import TrackChoice, choose_tracks
from app.features.tracks.service import TrackReview, list_tracks, make_tracks, review_track
from app.features.webhooks.queries import read_message_values_of_batch
from tests.flights import flight_groups
from tests.unit.features.tracks.test_service import move
from tests.unit.stores import Once

NAMES = ("early", "late")


@pytest.fixture
def tracks(store: Store, once: Once) -> dict[str, int]:
    """Ids of the tracks of two matches; every third group of the second is missing its balls."""
    made: dict[str, int] = once("tracks of two matches", lambda: _tracks(store))
    return made


def _tracks(store: Store) -> dict[str, int]:
    early = [replace(group, match="early") for group in flight_groups(40)]
    late = [
        replace(group, match="late", key=f"late/{group.key}")
        for group in flight_groups(40, noise_px=1.5)
    ]
    import_groups(store, "demo", [*early, *late], source="test", actor="ann")
    solve_dataset(store, "demo")
    make_tracks(store, "demo", None, "ann", lambda *_: None)
    for name, role in (("bo", Role.REVIEWER), ("cy", Role.REVIEWER), ("ada", Role.ANNOTATOR)):
        invite(store, name, role, actor="local")
    return {track.key: track.id for track in list_tracks(store, "demo")}


def keys(store: Store, choice: TrackChoice) -> list[str]:
    return [one.track.key for one in choose_tracks(store, "demo", choice)]


def judge(store: Store, track: int, verdict: str) -> None:
    (found,) = [one for one in list_tracks(store, "demo") if one.id == track]
    review_track(store, track, TrackReview(verdict), found.etag, actor="bo")


class TestChooseTracks:
    def test_by_match_or_the_worst_first(self, store: Store, tracks: dict[str, int]) -> None:
        assert keys(store, TrackChoice()) == ["early", "late"]
        assert keys(store, TrackChoice(sort="worst")) == ["late", "early"]
        assert keys(store, TrackChoice(sort="gaps")) == ["early", "late"]

    def test_by_verdict_and_stale(self, store: Store, tracks: dict[str, int]) -> None:
        judge(store, tracks["late"], "rejected")
        assert keys(store, TrackChoice(verdict="none")) == ["early"]
        assert keys(store, TrackChoice(verdict="rejected")) == ["late"]
        assert keys(store, TrackChoice(stale=True)) == []
        move(store, 1, 3.0)
        assert keys(store, TrackChoice(stale=True)) == ["early"]

    def test_by_whom_they_are_given_to(self, store: Store, tracks: dict[str, int]) -> None:
        new = NewBatch("first", reviewers=["bo"], tracks=[tracks["late"]])
        batch = make_batch(store, "demo", new, actor="lead")
        assert keys(store, TrackChoice(assigned="bo")) == ["late"]
        assert keys(store, TrackChoice(assigned="cy")) == []
        assert keys(store, TrackChoice(batch=batch.id)) == ["late"]
        early, late = choose_tracks(store, "demo", TrackChoice())
        assert (early.batches, early.assigned) == ((), ())
        assert (late.batches, late.assigned) == ((batch.id,), ("bo",))
        change_batch(store, batch.id, actor="lead", reviewers=[])
        assert keys(store, TrackChoice(assigned="cy")) == ["late"]
        change_batch(store, batch.id, actor="lead", state="closed")
        assert keys(store, TrackChoice(assigned="bo")) == []


class TestBatchesOfTracks:
    def test_count_verdicts(self, store: Store, tracks: dict[str, int]) -> None:
        wanted = [tracks["late"], tracks["early"]]
        batch = make_batch(store, "demo", NewBatch("both", tracks=wanted), actor="lead")
        assert (batch.kind, batch.groups, batch.settled, batch.last) == ("tracks", 2, 0, None)
        assert keys(store, TrackChoice(batch=batch.id)) == ["late", "early"]
        judge(store, tracks["late"], "accepted")
        found = get_batch(store, batch.id)
        assert (found.settled, found.waiting, found.last is None) == (1, 1, False)
        judge(store, tracks["late"], "none")
        assert get_batch(store, batch.id).settled == 0
        with store.read() as session:
            values = read_message_values_of_batch(session, batch.id)
        assert values is not None
        assert (values["groups"], values["settled"]) == (2, 0)

    def test_are_the_work_of_their_reviewers(self, store: Store, tracks: dict[str, int]) -> None:
        new = NewBatch("mine", reviewers=["bo"], tracks=list(tracks.values()))
        make_batch(store, "demo", new, actor="lead")
        judge(store, tracks["early"], "rejected")
        (mine,) = list_own_batches(store, lambda _: BatchMember("bo"))
        assert (mine.left, mine.batch.kind) == (1, "tracks")
        assert list_own_batches(store, lambda _: BatchMember("cy")) == []
        (team,) = list_team_batches(store, "demo")
        assert team.stalled is None

    def test_hold_what_nobody_else_has(self, store: Store, tracks: dict[str, int]) -> None:
        first = NewBatch("first", size=1, tracks=list(tracks.values()))
        make_batch(store, "demo", first, actor="lead")
        rest = make_batch(store, "demo", replace(first, name="rest"), actor="lead")
        assert keys(store, TrackChoice(batch=rest.id)) == ["late"]
        with pytest.raises(InputError, match="in an open batch already"):
            make_batch(store, "demo", replace(first, name="third"), actor="lead")

    @pytest.mark.parametrize(
        ("change", "message"),
        [
            ({"annotators": ["ada"]}, "has reviewers only, no annotators"),
            ({"verdicts": 2}, "each of its tracks gets one verdict"),
            ({"gold_every": 5}, "cannot have a query or gold groups"),
            ({"query": "status:accepted"}, "cannot have a query or gold groups"),
            ({"tracks": []}, "the list of tracks is empty"),
            ({"tracks": [999]}, "track 999 does not belong to this dataset"),
        ],
    )
    def test_refuse_what_no_track_has(
        self, store: Store, tracks: dict[str, int], change: dict, message: str
    ) -> None:
        with pytest.raises(InputError, match=message):
            make_batch(store, "demo", replace(NewBatch("a", tracks=[1]), **change), actor="lead")
        assert list_batches(store, "demo") == []

    def test_leave_their_tracks_when_they_are_deleted(
        self, store: Store, tracks: dict[str, int]
    ) -> None:
        batch = make_batch(store, "demo", NewBatch("a", tracks=[tracks["late"]]), actor="lead")
        remove_batch(store, batch.id, actor="lead")
        assert len(list_tracks(store, "demo")) == 2
