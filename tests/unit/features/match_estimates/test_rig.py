from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from app.errors import ConflictError, InputError, StaleRevisionError
from app.features.groups.edit import (
    SetStationCalibrationSource,
    SetStationCamera,
    SetStationLines,
)
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state
from app.features.imports.cameras import GivenCamera, NamedStation, attach_cameras
from app.features.imports.ingest import IngestReport, import_groups
from app.features.match_estimates import rig
from app.features.match_estimates.rig import (
    CAMERAS,
    SIGMA,
    ProposedRig,
    accept_rig,
    describe_anchor,
    describe_time_difference,
    propose_adjustment,
    require_adjustable_cameras,
    rig_proposal_to_json,
    undo_accepted_rig,
)
from app.features.pitches.service import change_pitches, read_pitches
from app.features.solutions.service import list_stale_groups
from app.features.stations.service import load_station, submit_station_edit, undo_station
from app.features.versions.frozen_queries import freeze_annotations, thaw_group
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Station, View
from app.soccer.pitch import Pitch
from tests.cameras import SIZE
from tests.rigs import GIVEN, cameras, frames


def groups() -> list[Group]:
    stations = {
        item.key: Station(item.key, SIZE, shared=True, lines=item.lines, given=item.camera)
        for item in cameras()
    }
    return [
        Group(
            str(frame.time),
            tuple(
                View(key, stations[key], (BallAnnotation(point=center),))
                for key, center in frame.balls.items()
            ),
            match="rig",
        )
        for frame in frames(60)
        if frame.balls
    ]


@pytest.fixture
def ids(fill) -> list[int]:
    return fill(*groups(), solved=False)


@pytest.fixture(scope="module")
def known() -> dict[str, ProposedRig]:
    """What was proposed once holds for every copy of the same database."""
    return {}


@pytest.fixture
def proposed(store, ids, known) -> ProposedRig:
    """Something for every camera."""
    if not known:
        known["demo"] = propose_adjustment(store, "demo")
    found = known["demo"]
    keys = [change.key for change in found.proposal.cameras]
    assert keys == sorted(found.stations) == sorted(GIVEN) != []
    return found


def stations(store, proposed) -> dict[str, Station]:
    return {key: load_station(store, state.id).station for key, state in proposed.stations.items()}


class TestPropose:
    def test_saves_nothing(self, store, ids, proposed) -> None:
        assert all(item.given == GIVEN[key] for key, item in stations(store, proposed).items())
        assert all(load_station(store, s.id).revision == 1 for s in proposed.stations.values())

    def test_says_what_holds_the_rig_and_that_no_camera_is_ahead(self, proposed) -> None:
        assert "points of field lines" in describe_anchor(proposed.proposal)
        assert describe_time_difference(proposed.proposal).startswith("no camera is ahead")
        values = rig_proposal_to_json(proposed)
        assert json.loads(json.dumps(values)) == values

    def test_tells_the_largest_difference_in_time_that_is_one(self, proposed) -> None:
        def said(*offsets: tuple[float, float]) -> str:
            pairs = tuple(
                replace(pair, offset_frames=offset, offset_sigma_frames=sigma)
                for pair, (offset, sigma) in zip(proposed.proposal.pairs, offsets, strict=False)
            )
            return describe_time_difference(replace(proposed.proposal, pairs=pairs))

        first, second = proposed.proposal.pairs[:2]
        # Small and sure, large and sure enough, larger and unsure.
        found = said((0.05, 0.001), (0.40, 0.08), (0.9, 0.5))
        assert found.startswith(f"{second.b} is 0.40 ± 0.08 frames ahead of {second.a}")
        assert f"what {second.a} shows at t + 0.40" in found
        found = said((-0.40, 0.08))
        assert found.startswith(f"{first.a} is 0.40 ± 0.08 frames ahead of {first.b}")
        # Not the mean: which of two comes first says nothing.
        none = said((0.05, 0.01), (-0.05, 0.02))
        assert none.startswith("no camera is ahead")
        assert f"{first.b} and {first.a}, differs by +0.050 ± 0.010 frames" in none
        assert said() == "too few moving balls to see whether a camera is ahead of another"

    def test_a_ball_that_was_put_where_others_see_it_says_nothing(self, store, fill) -> None:
        inferred = BallAnnotation(point=ImagePoint(10, 10), inferred=True)
        fill(
            *(
                Group(g.key, tuple(View(v.key, v.station, (inferred,)) for v in g.views), "rig")
                for g in groups()
            ),
            solved=False,
        )
        with pytest.raises(InputError, match="show the ball together"):
            propose_adjustment(store, "demo")

    def test_line_files_count_instead_of_the_lines_of_the_dataset(
        self, store, ids, proposed, tmp_path
    ) -> None:
        lines = {"Middle line": [{"x": 640.0, "y": y} for y in (100.0, 300.0, 500.0)]}
        (tmp_path / "cam1.json").write_text(json.dumps(lines))
        assert propose_adjustment(store, "demo", tmp_path).proposal.line_points == 3
        (tmp_path / "cam1.json").rename(tmp_path / "left.json")
        with pytest.raises(InputError, match="no line file"):
            propose_adjustment(store, "demo", tmp_path)


class TestAccept:
    def test_gives_every_camera_its_place_and_its_covariance(self, store, ids, proposed) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        for change in proposed.proposal.cameras:
            station = stations(store, proposed)[change.key]
            assert (station.given, station.given_covariance) == (change.after, change.covariance)
        assert set(list_stale_groups(store, "demo")) == set(ids)

    def test_accepting_sigma_keeps_the_cameras_and_says_how_far_they_may_be_off(
        self, store, proposed
    ) -> None:
        accept_rig(store, proposed, SIGMA, actor="ann")
        for change in proposed.proposal.cameras:
            station = stations(store, proposed)[change.key]
            assert station.given == GIVEN[change.key]
            assert station.given_covariance == change.covariance_before

    def test_importing_the_dataset_again_changes_nothing_of_it(self, store, proposed) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        before = stations(store, proposed)
        report = import_groups(store, "demo", groups(), source="test", actor="ann")
        assert (report.changed, report.findings) == (0, 0)
        assert stations(store, proposed) == before

    def test_a_frozen_group_has_the_covariance_of_its_cameras(self, store, ids, proposed) -> None:
        accept_rig(store, proposed, SIGMA, actor="ann")
        group = load_group_state(store, ids[0]).group
        said = freeze_annotations(group)
        texts = {key: json.loads(text) for key, text in said.texts.items()}
        assert group.views[0].station.given_covariance is not None
        assert thaw_group(texts[said.key], texts) == group

    def test_the_log_alone_leads_to_the_same_cameras(self, store, proposed) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        with store.read() as session:
            ledger = replay_log(session)
        for key, state in proposed.stations.items():
            assert ledger.stations[state.id].station == stations(store, proposed)[key]

    def test_a_camera_that_has_changed_since_is_not_overwritten(self, store, proposed) -> None:
        state = proposed.stations["cam3"]
        other = SetStationCalibrationSource("lines")
        submit_station_edit(store, state.id, other, if_match=state.etag, actor="bob")
        with pytest.raises(StaleRevisionError):
            accept_rig(store, proposed, CAMERAS, actor="ann")
        # All of them or none.
        assert stations(store, proposed)["cam1"].given_covariance is None

    def test_balls_do_not_count_twice(self, store, proposed) -> None:
        accept_rig(store, proposed, SIGMA, actor="ann")
        with pytest.raises(ConflictError, match="adjusted already"):
            propose_adjustment(store, "demo")

    def test_cameras_that_came_with_a_covariance_were_not_adjusted(self, store, fill) -> None:
        known = tuple((1e-6 * np.eye(8)).ravel().tolist())
        attached = {
            view.station.key: replace(view.station, given_covariance=known)
            for group in groups()
            for view in group.views
            if view.key in ("cam1", "cam2")
        }
        came = [
            replace(
                group,
                views=tuple(
                    replace(view, station=attached.get(view.key, view.station))
                    for view in group.views
                ),
            )
            for group in groups()
        ]
        fill(*came, solved=False)
        with pytest.raises(
            InputError, match=r"2 static cameras .* given with a covariance: cam1, cam2"
        ):
            require_adjustable_cameras(store, "demo")

    def test_what_can_be_accepted_is_the_cameras_or_sigma_and_nothing_else(
        self, store, proposed
    ) -> None:
        with pytest.raises(InputError, match='"sigma"'):
            accept_rig(store, proposed, "all", actor="ann")

    def test_a_pitch_that_has_changed_since_makes_another_proposal(self, store, proposed) -> None:
        etag = read_pitches(store, "demo").etag
        with store.write() as session:
            wanted = {"rig": Pitch(104.0, 67.0)}
            change_pitches(session, "demo", wanted, if_match=etag, actor="ann")
        with pytest.raises(ConflictError, match="size of the pitch has changed"):
            accept_rig(store, proposed, CAMERAS, actor="ann")
        assert stations(store, proposed)["cam1"].given_covariance is None
        assert propose_adjustment(store, "demo").inputs != proposed.inputs

    def test_a_solver_that_has_changed_since_makes_another_proposal(
        self, store, ids, proposed, monkeypatch
    ) -> None:
        monkeypatch.setattr(rig, "propose_rig", lambda *asked: proposed.proposal)
        assert propose_adjustment(store, "demo").inputs == proposed.inputs
        monkeypatch.setattr(rig, "SOLVER_VERSION", "another")
        assert propose_adjustment(store, "demo").inputs != proposed.inputs

    def test_importing_again_does_not_take_an_accepted_camera_for_the_datasets(
        self, store, fill
    ) -> None:
        bare = [
            Group(
                g.key,
                tuple(View(v.key, replace(v.station, given=None), v.balls) for v in g.views),
                "rig",
            )
            for g in groups()[:2]
        ]
        fill(*bare, solved=False)
        view = load_group_state(store, 1).group.views[0]
        before = load_station(store, load_group_state(store, 1).station_ids[view.key])
        assert before.station.given is None
        covariance = tuple((np.eye(8) / 7).ravel().tolist())
        edit = SetStationCamera(GIVEN[view.key], covariance)
        submit_station_edit(store, before.id, edit, if_match=before.etag, actor="ann")
        edited = load_station(store, before.id)
        report = import_groups(store, "demo", bare, source="test", actor="ann")
        assert (report.changed, report.findings) == (0, 0)
        assert load_station(store, before.id) == edited


class TestTakeBack:
    def test_every_camera_is_what_it_was(self, store, proposed) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        assert undo_accepted_rig(store, "demo", actor="ann") == len(GIVEN)
        for key, state in proposed.stations.items():
            assert stations(store, proposed)[key] == state.station

    def test_a_camera_that_was_edited_since_is_given_back_too_and_keeps_its_edits(
        self, store, proposed
    ) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        kept: dict[str, Station] = {}
        for key, edit in (
            ("cam1", SetStationLines({"Middle line": ((640.0, 100.0), (640.0, 300.0))})),
            ("cam2", SetStationCalibrationSource("lines")),
        ):
            state = load_station(store, proposed.stations[key].id)
            submit_station_edit(store, state.id, edit, if_match=state.etag, actor="bob")
            kept[key] = edit.apply(proposed.stations[key].station)
        assert undo_accepted_rig(store, "demo", actor="ann") == len(GIVEN)
        for key, state in proposed.stations.items():
            assert stations(store, proposed)[key] == kept.get(key, state.station)
        require_adjustable_cameras(store, "demo")
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        # Its own undo brings the adjusted camera back, and the whole rig's takes it away again.
        state = load_station(store, proposed.stations["cam1"].id)
        undo_station(store, state.id, if_match=state.etag, actor="bob")
        assert undo_accepted_rig(store, "demo", actor="ann") == 1
        assert stations(store, proposed)["cam1"] == kept["cam1"]

    def test_a_camera_that_was_brought_since_is_left_alone(self, store, proposed) -> None:
        accept_rig(store, proposed, CAMERAS, actor="ann")
        state = load_station(store, proposed.stations["cam1"].id)
        brought = GivenCamera(GIVEN["cam1"], tuple((np.eye(8) / 7).ravel().tolist()))
        with store.write() as session:
            place = [(NamedStation(state.id, None, "rig", SIZE), brought)]
            attach_cameras(session, state.dataset_id, place, "test", "bob", IngestReport())
        assert undo_accepted_rig(store, "demo", actor="ann") == len(GIVEN) - 1
        found = stations(store, proposed)["cam1"]
        assert (found.given, found.given_covariance) == (brought.camera, brought.covariance)

    def test_there_must_be_something_to_take_back(self, store, ids) -> None:
        with pytest.raises(ConflictError, match="nothing to undo"):
            undo_accepted_rig(store, "demo", actor="ann")
