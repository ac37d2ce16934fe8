from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from sqlalchemy import select

from app.db.log import LogModel
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import get_dataset
from app.features.exports.service import export_dataset
from app.features.findings.queries import list_group_import_findings
from app.features.findings.service import FindingReference, set_dismissal
from app.features.groups.edit import (
    SetLines,
    SetStationCamera,
    SetStationLines,
    SetViewInclusion,
    make_set_ball_edit,
)
from app.features.groups.history import read_history
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.cameras import import_given_cameras
from app.features.imports.edits_export import GROUPS, STATIONS
from app.features.imports.ingest import (
    UnassignedFrame,
    import_groups,
    import_unassigned_frames,
    read_unassigned_frames,
)
from app.features.imports.merge import merge_edits
from app.features.pitches.service import change_pitches, read_pitches
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.features.stations.service import load_station, submit_station_edit, undo_station
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.formats.file_tree import DEFAULT_LIMITS
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import Box, ImagePoint
from app.soccer.pitch import Pitch
from app.soccer.policy import STRICT

BALL, OTHER = (BallAnnotation(box=Box(500.0 + n, 300.0, 14.0, 14.0)) for n in (0, 9))


@pytest.fixture
def bring(tmp_path: Path) -> Callable:
    """Carries the dataset of one home to another; returns what the import says."""

    def run(source: Store, target: Store, out: str = "carried.zip", dry_run: bool = False):
        export_dataset(source, "demo", "touchline", tmp_path / out)
        return bring_file(target, tmp_path / out, dry_run=dry_run)

    return run


def bring_file(store: Store, path: Path, dry_run: bool = False):
    report = ReaderReport()
    result = merge_edits(
        store, "demo", path, report, DEFAULT_LIMITS, source="there", actor="zoe", dry_run=dry_run
    )
    result.problems += [str(problem) for problem in report.problems]
    return result


def edit(store, group_id, change, actor="ann"):
    return submit_edit(
        store, group_id, change, if_match=load_group_state(store, group_id).etag, actor=actor
    )


def judge(store, group_id, state, reason=None, note=None, actor="ann"):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor=actor)


def entries(store: Store) -> int:
    with store.read() as session:
        return len(list(session.scalars(select(LogModel.id))))


def assert_replays(store: Store) -> None:
    """The log still rebuilds the tables."""
    with store.read() as session:
        assert replay_log(session) == read_state_snapshot(session)


def findings(store: Store, group_id: int) -> list[str]:
    solve_dataset(store, "demo")
    noticed = load_group_state(store, group_id).solution.findings
    return [item.sentence for item in noticed if item.kind == "upstream_changed"]


def ball_of(store: Store, group_id: int, view: str):
    return load_group_state(store, group_id).group.view(view).ball


@pytest.fixture
def busy(store, once, fill, make_group, make_static, opposite):
    """Edits, verdicts, a camera of its own, a static camera's lines, spare frames, a policy."""

    def make():
        ids = fill(make_group(7), make_group(8), make_group(9, shift=80.0), make_static(10))
        edit(store, ids[0], make_set_ball_edit("7.png", BALL))
        edit(store, ids[0], SetLines("7_1.png", {"Middle line": None}))
        edit(store, ids[1], SetViewInclusion("8_1.png", False))
        undo_group_edit(store, ids[1], if_match=load_group_state(store, ids[1]).etag, actor="ben")
        judge(store, ids[0], "deferred", actor="ben")
        judge(store, ids[1], "accepted")
        judge(store, ids[2], "accepted", note="seen on video")
        station = load_station(store, load_group_state(store, ids[3]).station_ids["cam2"])
        lines = SetStationLines({"Side line left": (ImagePoint(1.0, 2.0), ImagePoint(30.0, 40.0))})
        submit_station_edit(store, station.id, lines, if_match=station.etag, actor="ann")
        import_given_cameras(store, "demo", {"8_1": opposite}, source="cameras", actor="ann")
        spare = [UnassignedFrame("cam1", "99", Extras(boxes=({"class": "Person"},)))]
        import_unassigned_frames(store, "demo", spare, source="spare", actor="ann")
        change_policy(store, "demo", replace(STRICT, min_jac=0.5), if_match=None, actor="ann")
        solve_dataset(store, "demo")
        return ids

    return once("busy", make)


class TestRoundTrip:
    def test_a_fresh_home_freezes_the_same_hash(self, store, there, busy, bring) -> None:
        report = bring(store, there)
        assert (report.new, report.problems) == (4, [])
        solve_dataset(there, "demo")
        hashes = {
            freeze_dataset(home, "demo", FreezeRequest("v1", groups="passing"), actor="x").hash
            for home in (store, there)
        }
        assert len(hashes) == 1
        assert get_dataset(there, "demo").policy == get_dataset(store, "demo").policy
        kept = []
        for home in (there, store):
            with home.read() as session:
                kept.append(list(read_unassigned_frames(session, get_dataset(home, "demo").id)))
        assert kept[0] == kept[1]
        assert_replays(there)

    def test_what_a_person_edited_is_still_known_to_be_edited(
        self, store, there, busy, bring, make_group
    ) -> None:
        bring(store, there)
        assert load_group_state(there, 1).stored.edited_views == {"7.png"}
        assert not load_group_state(there, 2).stored.edited
        told = [
            entry.body["carried"] for entry in read_history(there, 1) if "carried" in entry.body
        ]
        assert [entry["actor"] for entry in told[0]] == ["ann", "ann"]

    @pytest.mark.parametrize("back", [False, True])
    def test_carrying_again_or_back_changes_nothing(
        self, store, there, busy, bring, back: bool
    ) -> None:
        bring(store, there)
        before = entries(store) if back else entries(there)
        report = bring(there, store, "back.zip") if back else bring(store, there)
        assert (report.new, report.changed, report.unchanged, report.findings) == (0, 0, 4, 0)
        assert (entries(store) if back else entries(there)) == before

    def test_a_file_is_the_same_every_time_and_holds_no_place_of_a_frame(
        self, store, busy, tmp_path
    ) -> None:
        for name in ("a.zip", "b.zip"):
            export_dataset(store, "demo", "touchline", tmp_path / name)
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
        export_dataset(store, "demo", "touchline", tmp_path / "c")
        assert "/frames/" not in (tmp_path / "c" / GROUPS).read_text()

    def test_a_dry_run_says_the_same_and_keeps_nothing(self, store, there, busy, bring) -> None:
        before = entries(there)
        assert bring(store, there, dry_run=True).new == 4
        assert entries(there) == before

    def test_a_frozen_version_is_not_carried(self, store, busy, tmp_path) -> None:
        with pytest.raises(InputError, match="exports the whole dataset"):
            export_dataset(store, "demo", "touchline", tmp_path / "x", version="v1")


@pytest.fixture
def both(store, there, fill, make_group, make_static):
    """Two homes that imported the same two groups."""
    groups = [make_group(7), make_static(10)]
    fill(*groups)
    import_groups(there, "demo", groups, source="test", actor="zoe")
    solve_dataset(there, "demo")
    return store, there


class TestMerge:
    def test_what_nobody_edited_here_follows_the_other_installation(self, both, bring) -> None:
        here, there = both
        edit(there, 1, make_set_ball_edit("7.png", BALL))
        assert bring(there, here).changed == 1
        assert ball_of(here, 1, "7.png") == BALL
        assert load_group_state(here, 1).group.view("7.png").media is not None
        assert findings(here, 1) == []
        assert_replays(here)

    def test_what_was_edited_here_alone_stays(self, both, bring) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        assert bring(there, here).unchanged == 2
        assert ball_of(here, 1, "7.png") == BALL

    def test_two_views_edited_in_two_places_come_together(self, both, bring) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        edit(there, 1, make_set_ball_edit("7_1.png", OTHER))
        assert bring(there, here).findings == 0
        assert (ball_of(here, 1, "7.png"), ball_of(here, 1, "7_1.png")) == (BALL, OTHER)

    def test_a_conflict_keeps_the_edit_here_and_is_a_finding_once(self, both, bring) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        edit(there, 1, make_set_ball_edit("7.png", OTHER))
        assert bring(there, here).findings == 1
        assert ball_of(here, 1, "7.png") == BALL
        (sentence,) = findings(here, 1)
        assert "edited the ball of 7.png too" in sentence
        before = entries(here)
        assert bring(there, here).findings == 0
        assert entries(here) == before
        assert_replays(here)

    def test_the_same_edit_in_both_is_no_conflict(self, both, bring) -> None:
        here, there = both
        for home in both:
            edit(home, 1, make_set_ball_edit("7.png", BALL))
        assert bring(there, here).findings == 0

    def test_an_installation_that_is_behind_follows_and_one_ahead_stays(self, both, bring) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        bring(here, there)
        edit(there, 1, make_set_ball_edit("7.png", OTHER))
        assert bring(here, there).findings == 0
        assert ball_of(there, 1, "7.png") == OTHER
        assert bring(there, here, "back.zip").findings == 0
        assert ball_of(here, 1, "7.png") == OTHER

    def test_an_edit_that_was_taken_back_is_taken_back_everywhere(self, both, bring) -> None:
        here, there = both
        before = ball_of(here, 1, "7.png")
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        bring(here, there)
        undo_group_edit(here, 1, if_match=load_group_state(here, 1).etag, actor="ann")
        bring(here, there)
        assert ball_of(there, 1, "7.png") == before
        assert not load_group_state(there, 1).stored.edited

    def test_lines_of_a_view_merge_like_balls(self, both, bring) -> None:
        here, there = both
        edit(there, 1, SetLines("7.png", {"Middle line": None}))
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        bring(there, here)
        view = load_group_state(here, 1).group.view("7.png")
        assert ("Middle line" in view.station.lines, view.ball) == (False, BALL)

    def test_a_static_camera_follows_or_is_a_finding(self, both, bring) -> None:
        here, there = both
        lines = SetStationLines({"Middle line": None})
        edit_station(there, lines)
        assert bring(there, here).changed == 1
        assert "Middle line" not in station(here).station.lines
        edit_station(there, SetStationLines({"Circle central": None}))
        edit_station(here, SetStationLines({"Side line top": None}))
        assert bring(there, here).findings == 1
        assert "Circle central" in station(here).station.lines
        assert bring(there, here).findings == 0
        assert any("cam2" in sentence for sentence in findings(here, 2))
        assert_replays(here)
        undo_station(here, station(here).id, if_match=station(here).etag, actor="ann")
        assert_replays(here)

    def test_what_is_known_of_a_static_camera_comes_along(self, both, bring) -> None:
        here, there = both
        given = station(there).station.given
        edit_station(there, SetStationCamera(given, (0.25,) * 64))
        bring(there, here)
        assert station(here).station.given_covariance == (0.25,) * 64
        assert_replays(here)

    def test_a_newer_state_of_the_source_comes_along(self, both, bring, make_group) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        newer = make_group(7, ball=(6.0, 2.0, -0.5))
        import_groups(there, "demo", [newer], source="test", actor="zoe")
        assert bring(there, here).findings == 1
        assert ball_of(here, 1, "7.png") == BALL
        assert ball_of(here, 1, "7_1.png") == newer.view("7_1.png").ball
        assert bring(there, here).changed == 0
        assert_replays(here)

    def test_an_older_state_of_the_source_does_not_come_back(self, both, bring, make_group) -> None:
        here, there = both
        newer = make_group(7, ball=(6.0, 2.0, -0.5))
        import_groups(here, "demo", [newer], source="test", actor="ann")
        edit(there, 1, make_set_ball_edit("7_1.png", OTHER))
        assert bring(there, here).findings == 1
        assert ball_of(here, 1, "7.png") == newer.view("7.png").ball
        assert ball_of(here, 1, "7_1.png") == OTHER
        assert any("another state of the dataset" in item for item in findings(here, 1))

    def test_the_policy_of_the_existing_dataset_stays(self, both, bring) -> None:
        here, there = both
        change_policy(there, "demo", STRICT, if_match=None, actor="ann")
        assert any("another policy" in item for item in bring(there, here).problems)
        assert get_dataset(here, "demo").policy.name == "paper"


def station(store: Store):
    return load_station(store, load_group_state(store, 2).station_ids["cam2"])


def edit_station(store: Store, change) -> None:
    found = station(store)
    submit_station_edit(store, found.id, change, if_match=found.etag, actor="ann")


class TestVerdicts:
    def test_verdicts_of_both_are_kept_and_the_newest_counts(self, both, bring) -> None:
        here, there = both
        judge(there, 1, "rejected", "bad_calibration", actor="ben")
        judge(here, 1, "accepted")
        bring(there, here)
        state = load_group_state(here, 1)
        assert {item.actor: item.state for item in state.verdicts} == {
            "ann": "accepted",
            "ben": "rejected",
        }
        assert state.verdict.state == "accepted"
        judge(there, 1, "deferred", actor="ben")
        bring(there, here)
        assert load_group_state(here, 1).verdict.state == "deferred"
        assert_replays(here)

    def test_a_verdict_on_another_state_is_stale(self, both, bring) -> None:
        here, there = both
        edit(here, 1, make_set_ball_edit("7.png", BALL))
        judge(there, 1, "accepted")
        bring(there, here)
        assert load_group_state(here, 1).verdict.stale


class TestDismissals:
    def dismiss(self, store, actor: str, *, dismissed: bool = True):
        state = load_group_state(store, 1)
        finding = state.solution.findings[0]
        named = FindingReference(finding.kind, finding.view, finding.marking, finding.suggested)
        sent = {"dismissed": dismissed, "if_match": state.etag, "actor": actor}
        return set_dismissal(store, 1, named, **sent)

    def test_what_was_dismissed_is_carried_and_the_newest_counts(self, both, bring) -> None:
        here, there = both
        for store in both:
            edit(store, 1, make_set_ball_edit("7.png", BALL))
        self.dismiss(there, "ben")
        bring(there, here)
        said = load_group_state(here, 1).dismissed[0]
        assert said is not None
        assert said.actor == "ben"
        etag = load_group_state(here, 1).etag
        bring(there, here)
        assert load_group_state(here, 1).etag == etag
        self.dismiss(here, "ann", dismissed=False)
        bring(there, here)
        assert load_group_state(here, 1).dismissed[0] is None
        self.dismiss(there, "ben", dismissed=False)
        self.dismiss(there, "ben")
        bring(there, here)
        assert load_group_state(here, 1).dismissed[0] is not None


class TestBrokenFiles:
    @pytest.mark.parametrize(
        ("path", "value"),
        [
            (("group", "key"), 7),
            (("group", "views"), []),
            (("group", "views"), {}),
            (("group", "pitch"), [0, 68]),
            (("group", "views", 0, "station", "size"), [1280, -720]),
            (("group", "views", 0, "station", "lines"), {"Midfield": [[1, 2]]}),
            (("group", "views", 0, "station", "lines"), {"Middle line": [[1, "x"]]}),
            (("group", "views", 0, "station", "given"), {"rotation": [1]}),
            (("group", "views", 0, "station", "calibration"), "guess"),
            (("group", "views", 0, "station", "given_covariance"), [1.0]),
            (("group", "views", 0, "station", "given_covariance"), [0.0] * 64),
            (("group", "views", 0, "station"), "cam9"),
            (("group", "views", 0, "balls"), [{"box": [1, 2, 3]}]),
            (("group", "views", 0, "extras"), {"boxes": 1, "lines": [], "metadata": {}}),
            (("verdicts",), [{"state": "loved"}]),
            (("log",), [{"kind": "drop"}]),
            (("views",), {"7.png": "x"}),
            (("base",), 1),
        ],
    )
    def test_a_line_that_is_not_ours_is_skipped_and_told(
        self, store, there, fill, make_group, tmp_path, path, value
    ) -> None:
        fill(make_group(7), make_group(8))
        export_dataset(store, "demo", "touchline", tmp_path / "out")
        lines = (tmp_path / "out" / GROUPS).read_text().splitlines()
        record = json.loads(lines[0])
        place = record
        for step in path[:-1]:
            place = place[step]
        place[path[-1]] = value
        (tmp_path / "out" / GROUPS).write_text("\n".join([json.dumps(record), lines[1]]))
        report = bring_file(there, tmp_path / "out")
        assert report.new == 1
        assert any("line 1" in problem for problem in report.problems), report.problems

    def test_frames_are_not_read_from_where_a_file_says(
        self, store, there, fill, make_group, tmp_path
    ) -> None:
        fill(make_group(7))
        export_dataset(store, "demo", "touchline", tmp_path / "out")
        record = json.loads((tmp_path / "out" / GROUPS).read_text())
        for view in record["group"]["views"]:
            view["media"] = ["/etc/passwd", None, None]
        (tmp_path / "out" / GROUPS).write_text(json.dumps(record))
        bring_file(there, tmp_path / "out")
        assert [view.media for view in load_group_state(there, 1).group.views] == [None, None]

    def test_a_file_that_is_no_export_is_refused(self, there, tmp_path) -> None:
        (tmp_path / "out").mkdir()
        (tmp_path / "out" / STATIONS).write_text("")
        report = bring_file(there, tmp_path / "out")
        assert (report.new, len(report.problems)) == (0, 1)


class TestPitch:
    """The size of a match's pitch is said for the match and goes along with each group."""

    @pytest.fixture
    def match(self, make_group) -> list:
        return [replace(make_group(number), match="cup") for number in (7, 8)]

    @pytest.fixture
    def sized(self, store: Store, match) -> Store:
        import_groups(store, "demo", match, source="files", actor="ann")
        resize(store, SMALL)
        return store

    def test_an_accepted_size_arrives_in_an_empty_home(self, sized, there, bring) -> None:
        bring(sized, there)
        (item,) = read_pitches(there, "demo").items
        assert (item.pitch, item.previous, item.mixed) == (SMALL, Pitch(), False)
        assert_replays(there)
        before = entries(there)
        assert bring(sized, there, "again.zip").changed == 0
        assert entries(there) == before

    def test_it_goes_on_back_when_the_other_says_another(self, sized, there, bring) -> None:
        bring(sized, there)
        resize(there, Pitch())
        assert bring(there, sized, "back.zip").changed == 2
        assert read_pitches(sized, "demo").items[0].pitch == Pitch()

    def test_who_changed_it_too_keeps_the_size_and_is_told(
        self, sized, there, bring, match
    ) -> None:
        import_groups(there, "demo", match, source="files", actor="ben")
        resize(there, Pitch(101.0, 65.0))
        bring(sized, there)
        assert read_pitches(there, "demo").items[0].pitch == Pitch(101.0, 65.0)
        with there.read() as session:
            ((view, sentence),) = list_group_import_findings(session, 1)
        assert view is None
        assert "edited the pitch" in sentence
        before = entries(there)
        bring(sized, there, "again.zip")
        assert entries(there) == before


SMALL = Pitch(100.0, 64.0)


def resize(store: Store, pitch: Pitch) -> None:
    with store.write() as session:
        change_pitches(session, "demo", {"cup": pitch}, if_match=None, actor="ann")
