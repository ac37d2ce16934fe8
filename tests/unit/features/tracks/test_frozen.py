"""Tracks in frozen versions: kept with what they were computed from, verified, exported."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import text

from app.db.json_columns import Json
from app.db.session import Session
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import read_dataset_head
from app.features.exports.service import export_dataset
from app.features.integrity.records import examine_versions
from app.features.tracks.codec import TRACK_VERSION, recompute_frozen_track
from app.features.tracks.export import TrackSource, parse_frozen_track
from app.features.tracks.making import read_export_records
from app.features.tracks.queries import read_groups_by_match
from app.features.tracks.service import (
    TrackReview,
    collect_accepted_tracks,
    list_tracks,
    make_tracks,
    review_track,
)
from app.features.versions import verify as verify_module
from app.features.versions.diff import diff_versions
from app.features.versions.freeze import FreezeRequest, freeze_dataset, plan_freeze
from app.features.versions.frozen_queries import compress_text, decode_frozen_json, read_frozen
from app.features.versions.service import Version
from app.features.versions.verify import verify_version
from app.json_text import canonical_json_text
from app.tracking.ball_track import EventCorrection
from tests.databases import said_for_sqlite
from tests.flights import FIRST
from tests.unit.features.tracks.test_service import move


@pytest.fixture
def accepted(store: Store, flight: list[int]) -> list[int]:
    """The flight with a track that a person corrected and accepted."""
    make_tracks(store, "demo", None, "ann", lambda *_: None)
    said = TrackReview(corrections=(EventCorrection(FIRST + 40, "out", True),))
    for change in (said, TrackReview("accepted")):
        (track,) = list_tracks(store, "demo")
        review_track(store, track.id, change, track.etag, actor="ben")
    return flight


def frozen(store: Store, name: str = "v1") -> Version:
    return freeze_dataset(store, "demo", FreezeRequest(name, groups="passing"), actor="ann")


def track_elsewhere(value: Mapping[str, Any]) -> Json:
    """What a solver of another version makes of a frozen track's inputs."""
    track = recompute_frozen_track(value)
    track["position"][3][0] += 1e-9
    return track


def unseal(session: Session) -> None:
    """Let frozen content be changed, as damage would."""
    for what in ("update", "delete"):
        session.execute(text(f"DROP TRIGGER frozen_refuses_{what}"))


class TestFreeze:
    def test_accepted_tracks_are_in_it_and_in_its_hash(self, store, accepted) -> None:
        version = frozen(store)
        assert [*version.tracks] == ["rig"]
        assert version.counts["tracks"] == 1
        (track,) = list_tracks(store, "demo")
        review_track(store, track.id, TrackReview("none"), track.etag, actor="ben")
        without = frozen(store, "v2")
        assert (without.tracks, "tracks" in without.counts) == ({}, False)
        assert without.hash != version.hash

    def test_a_track_whose_groups_have_changed_is_not(self, store, accepted) -> None:
        move(store, accepted[4], 2.0)
        assert frozen(store).tracks == {}


class TestVerify:
    def test_a_track_comes_out_bit_for_bit(self, store, accepted) -> None:
        version = frozen(store)
        report = verify_version(store, version.id)
        assert report.ok, report.to_values()

    def test_a_track_of_an_earlier_solver_is_named_and_not_called_damaged(
        self, store, accepted, monkeypatch
    ) -> None:
        version = frozen(store)
        monkeypatch.setattr(verify_module, "TRACK_VERSION", "later")
        assert verify_version(store, version.id).ok
        monkeypatch.setattr(verify_module, "recompute_frozen_track", track_elsewhere)
        report = verify_version(store, version.id)
        assert (report.ok, report.equal, report.groups) == (False, report.groups, len(accepted))
        assert [(item.place, item.frozen, item.now) for item in report.differences] == [
            ("track rig", f"made by version {TRACK_VERSION}", "version later makes another one")
        ]
        assert report.sentence == (
            f"All {len(accepted)} groups and the hash came out as they were frozen. 1 track comes out "
            f"differently (rig): made by version {TRACK_VERSION} of the track solver, and this is version later: "
            "compute anew and freeze another version, or keep this one as it was frozen."
        )

    def test_a_track_that_breaks_the_solver_does_not_hide_the_rest(
        self, store, accepted, monkeypatch
    ) -> None:
        version = frozen(store)
        monkeypatch.setattr(verify_module, "recompute_frozen_track", lambda _: 1 / 0)
        report = verify_version(store, version.id)
        assert (report.equal, report.different) == (report.groups, 1)
        assert report.differences[0].now == "ZeroDivisionError: division by zero"

    def test_a_number_that_was_changed_is_found(self, store, accepted) -> None:
        version = frozen(store)
        key = version.tracks["rig"]
        with store.write() as session, said_for_sqlite(session):
            value = decode_frozen_json(read_frozen(session, version.dataset_id, [key])[key])
            value["track"]["times"][3] += 1e-12
            unseal(session)
            session.execute(
                text("UPDATE frozen SET body = :body WHERE key = :key"),
                {"body": compress_text(canonical_json_text(value)), "key": key},
            )
        report = verify_version(store, version.id)
        assert (report.ok, report.different) == (False, 1)
        assert report.differences[0].place == "track rig"
        assert "1 value of the version itself came out differently" in report.sentence


class TestExport:
    def test_a_version_has_its_track_whatever_happens_later(
        self, store, accepted, tmp_path: Path
    ) -> None:
        frozen(store)
        for name in ("a", "b"):
            report = export_dataset(store, "demo", "tracks", tmp_path / f"{name}.zip", version="v1")
            assert report.counts["tracks"] == 1
            move(store, accepted[7], 4.0)
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
        export_dataset(store, "demo", "tracks", tmp_path / "out", version="v1")
        assert f"\n{FIRST + 40},5.6,out," in (tmp_path / "out/events.csv").read_text()

    def test_an_accepted_track_goes_out_with_its_corrections_and_a_rejected_one_does_not(
        self, store, accepted, tmp_path: Path
    ) -> None:
        export_dataset(store, "demo", "tracks", tmp_path / "out")
        assert f"\n{FIRST + 40},5.6,out," in (tmp_path / "out/events.csv").read_text()
        (track,) = list_tracks(store, "demo")
        review_track(store, track.id, TrackReview("rejected"), track.etag, actor="ben")
        with pytest.raises(InputError, match="rig: its track was rejected"):
            export_dataset(store, "demo", "tracks", tmp_path / "none")
        assert (
            export_dataset(store, "demo", "tracks", tmp_path / "all", everything=True).counts[
                "tracks"
            ]
            == 1
        )

    def test_every_frozen_track_goes_out_as_it_was_whichever_groups_and_shots_there_are(
        self, store, accepted
    ) -> None:
        """Of a track no group has to be in the version, and its recording may have other shots by then."""
        with store.read() as session:
            head = read_dataset_head(session, "demo")
            (value,) = collect_accepted_tracks(session, head).values()
            groups = read_groups_by_match(session, head.id, None)["rig"]
            some = [*read_export_records(session, groups[:20])]
        inputs = {**value["inputs"], "times": [time / 2 for time in value["inputs"]["times"]]}
        other = parse_frozen_track("final 0-99", {**value, "match": "final", "inputs": inputs})
        known = [parse_frozen_track("rig", value), other]
        for records in ([], some):
            source = TrackSource("demo", head.policy, {"final": [(0, 9)]}, known, frozen=True)
            written = [*source.make_track_records(records)]
            assert [(one.key, len(one.track.frames)) for one in written] == [
                ("final 0-99", 60),
                ("rig", 60),
            ]
            assert [one.rate for one in written] == [pytest.approx(50), 25]
            assert [fact["measurements"] for fact in source.facts] == [
                len(other.inputs.measurements)
            ] * 2


class TestCheck:
    def test_a_version_with_tracks_is_sound_until_one_is_gone(self, store, accepted) -> None:
        version = frozen(store)
        assert all(item.ok for item in examine_versions(store))
        with store.write() as session, said_for_sqlite(session):
            unseal(session)
            session.execute(text("DELETE FROM frozen WHERE key LIKE 'track:%'"))
        (wrong,) = [item for item in examine_versions(store) if not item.ok]
        assert (version.name in wrong.sentence, "1 of its tracks" in wrong.sentence) == (True, True)


class TestDiff:
    def test_tracks_that_came_and_went_are_named(self, store, accepted) -> None:
        versions = [frozen(store)]
        (track,) = list_tracks(store, "demo")
        review_track(store, track.id, TrackReview("none"), track.etag, actor="ben")
        versions.append(frozen(store, "v2"))
        for one, other, what in ((0, 1, "dropped"), (1, 0, "added")):
            diff = diff_versions(store, versions[one].id, versions[other].id)
            assert diff.to_values()["tracks"] == [{"stretch": "rig", "what": what}]
            assert diff.to_values()["lines"][1:] == [f"1 track of the ball {what} (rig)."]

    def test_a_plan_names_accepted_tracks_that_would_stay_out(self, store, accepted) -> None:
        request = FreezeRequest("v1", groups="passing")
        plan = plan_freeze(store, "demo", request)
        assert (plan.tracks, plan.stale_tracks) == (1, ())
        move(store, accepted[4], 2.0)
        plan = plan_freeze(store, "demo", request)
        assert (plan.tracks, plan.stale_tracks) == (0, ("rig",))
