from __future__ import annotations

import json
import unicodedata
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from app.errors import NotFoundError
from app.features.datasets.service import get_dataset
from app.features.exports.service import export_dataset
from app.features.groups.edit import SetLines, SetStationCamera
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.cameras import import_given_cameras
from app.features.imports.ingest import import_groups
from app.features.imports.sources import ImportSource, import_source
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.features.stations.service import load_station, submit_station_edit
from app.formats.camera_json import covariance_to_json
from app.formats.cameras import format_camera_file
from app.geometry.arrays import flatten_covariance
from app.soccer.frames import ImageSize
from app.soccer.group import Group
from tests.cameras import FULL_HD


def attach(store, cameras):
    return import_given_cameras(store, "demo", cameras, source="cameras.zip", actor="ann")


class TestIngestCameras:
    @pytest.mark.parametrize("name", ["7_1", "{match}/7_1"])
    def test_a_camera_is_matched_to_a_view_by_the_stem_of_its_name(
        self, store, state, opposite, name
    ) -> None:
        report = attach(store, {name.format(match=state.group.match): opposite})
        after = load_group_state(store, state.id)
        assert (report.changed, report.problems) == (1, [])
        assert after.group.view("7_1.png").station.given == opposite
        assert (after.revision, after.solution) == (2, None)

    @pytest.mark.parametrize(("view", "camera"), [("NFC", "NFD"), ("NFD", "NFC")])
    def test_accents_may_be_composed_otherwise_in_the_name_of_a_camera(
        self, store, fill, state, opposite, view, camera
    ) -> None:
        key, name = (unicodedata.normalize(form, "K\u00f6ln") for form in (view, camera))
        group = state.group
        own = replace(
            group.views[0],
            key=f"{key}.png",
            station=replace(group.views[0].station, key=f"{group.match}/{key}.png"),
        )
        *_, group_id = fill(
            replace(group, key=f"{group.match}/{key}.png", views=(own, *group.views[1:]))
        )
        report = attach(store, {name: opposite})
        assert (report.changed, report.left_out.problems) == (1, [])
        assert load_group_state(store, group_id).group.views[0].station.given == opposite

    def test_attaching_the_same_cameras_again_changes_nothing(self, store, state, opposite) -> None:
        attach(store, {"7": opposite})
        before = load_group_state(store, state.id)
        report = attach(store, {"7": opposite})
        assert (report.changed, report.unchanged) == (0, 1)
        assert load_group_state(store, state.id) == before

    def test_a_static_camera_changes_for_all_its_groups(
        self, store, fill, make_static, opposite
    ) -> None:
        ids = fill(make_static(10), make_static(11))
        assert attach(store, {"cam1": opposite}).changed == 1
        assert load_group_state(store, ids[1]).group.view("cam1").station.given == opposite
        assert list_stale_groups(store, "demo") == ids

    def test_what_was_known_of_the_camera_before_is_not_known_of_the_new_one(
        self, store, fill, make_static, opposite
    ) -> None:
        (group_id,) = fill(make_static(10))
        station = load_station(store, load_group_state(store, group_id).station_ids["cam1"])
        known = SetStationCamera(station.station.given, (0.5,) * 64)
        submit_station_edit(store, station.id, known, if_match=station.etag, actor="ann")
        assert load_station(store, station.id).station.given_covariance == (0.5,) * 64
        attach(store, {"cam1": opposite})
        after = load_station(store, station.id).station
        assert (after.given, after.given_covariance) == (opposite, None)
        with store.read() as session:
            assert replay_log(session).stations[station.id].station == after

    def test_how_well_it_is_known_comes_along_and_counts_for_the_ball(
        self, store, state, tmp_path
    ) -> None:
        view, sigmas = state.group.view("7_1.png"), []
        camera = state.solution.view("7_1.png").calibration.camera
        for sigma in (1e-3, 1.0):
            known = flatten_covariance(np.diag([1e-6] * 3 + [sigma**2] * 3 + [1e-6] * 2))
            (tmp_path / "camera_7_1.json").write_text(format_camera_file(camera, known, view.size))
            source = ImportSource("cameras", tmp_path)
            assert import_source(store, "demo", source, store.settings).result.changed == 1
            again = import_source(store, "demo", source, store.settings).result
            assert (again.changed, again.unchanged) == (0, 1)
            solve_dataset(store, "demo")
            after = load_group_state(store, state.id)
            station = after.group.view("7_1.png").station
            assert station.given_covariance == pytest.approx(known, rel=1e-9)
            with store.read() as session:
                assert replay_log(session) == read_state_snapshot(session)
            sigmas.append(after.solution.ball.sigma_m)
        assert sigmas[1] > 2 * sigmas[0]
        export_dataset(store, "demo", "cameras", tmp_path / "out", everything=True)
        (file,) = (tmp_path / "out").rglob("camera_7_1.json")
        told = json.loads(file.read_text())["covariance"]
        assert np.diag(told)[:3] == pytest.approx([1.0] * 3)

    def test_a_file_that_says_nothing_takes_nothing_of_what_is_known(
        self, store, state, opposite
    ) -> None:
        known = {"7": covariance_to_json(flatten_covariance(np.eye(8) * 1e-4), opposite, FULL_HD)}
        options = {"source": "x", "actor": "ann"}
        import_given_cameras(store, "demo", {"7": opposite}, covariances=known, **options)
        assert attach(store, {"7": opposite}).unchanged == 1
        station = load_group_state(store, state.id).group.views[0].station
        assert station.given_covariance is not None

    def test_names_that_match_no_view_or_several_are_reported(
        self, store, fill, make_group, opposite
    ) -> None:
        other = replace(make_group(7), key="other/7.png", match="other")
        fill(make_group(7), other, solved=False)
        report = attach(store, {"7": opposite, "99": opposite})
        assert report.changed == 0
        assert report.problems == []
        assert [(error.record, error.problem) for error in report.left_out.problems] == [
            (
                'camera "7"',
                f'views of 2 matches have this name; call it "{make_group(7).match}/7", '
                "or like the other match",
            ),
            ('camera "99"', 'no view has this name; views are called "7", "7_1"'),
        ]

    def test_a_view_whose_name_has_a_dot_is_called_by_its_whole_name(
        self, store, fill, make_group, opposite
    ) -> None:
        group = make_group(7)
        keys = ("north.left", "north.right.png")
        views = [replace(view, key=key) for view, key in zip(group.views, keys, strict=False)]
        (number,) = fill(replace(group, views=tuple(views)), solved=False)
        report = attach(store, {"north.left": opposite, "north.right": opposite})
        assert (report.changed, report.left_out.problems) == (2, [])
        found = load_group_state(store, number).group.views
        assert [view.station.given for view in found[:2]] == [opposite, opposite]

    def test_views_of_one_match_that_are_called_alike_have_one_camera(
        self, store, fill, make_group, opposite
    ) -> None:
        first = make_group(7)
        second = replace(make_group(8), key="8", match=first.match)
        views = [
            replace(view, key=old.key) for view, old in zip(second.views, first.views, strict=True)
        ]
        ids = fill(first, replace(second, views=tuple(views)), solved=False)
        report = attach(store, {"7": opposite})
        assert report.changed == 2
        assert report.problems == ['camera "7" belongs to 2 views of this name']
        assert all(
            load_group_state(store, each).group.view("7.png").station.given == opposite
            for each in ids
        )

    def test_a_camera_in_the_folder_of_a_group_is_that_of_its_view_alone(
        self, store, fill, make_group, opposite
    ) -> None:
        views = make_group(7).views
        bare = [replace(view, station=replace(view.station, given=None)) for view in views]
        keys = ("a", "b", "c")
        groups = [
            Group(key, tuple(
                replace(view, station=replace(view.station, key=f"{key}/{view.key}"))
                for view in bare
            ))
            for key in keys
        ]  # fmt: skip
        ids = dict(zip(keys, fill(*groups, solved=False), strict=True))

        def list_groups_with_camera():
            states = {key: load_group_state(store, each) for key, each in ids.items()}
            given = {key: state.group.view("7.png").station.given for key, state in states.items()}
            return {key: camera.skew for key, camera in given.items() if camera is not None}

        report = attach(store, {"a/7": replace(opposite, skew=1.0)})
        assert (report.changed, report.problems) == (1, [])
        assert list_groups_with_camera() == {"a": 1.0}
        report = attach(store, {"d/7": opposite, "cameras/d/7": opposite})
        assert (report.changed, list_groups_with_camera()) == (0, {"a": 1.0})
        assert {error.problem for error in report.left_out.problems} == {
            'folder "d" names no group or match'
        }
        # A record may name its image by the place that it had on somebody's disk.
        report = attach(store, {"/home/ann/frames/a/7": replace(opposite, skew=1.5)})
        assert (report.problems, list_groups_with_camera()) == ([], {"a": 1.5})
        attach(store, {"a/7": replace(opposite, skew=1.0)})
        # A camera of one view counts before that of its rig.
        rig = {"b/7": replace(opposite, skew=2.0), "cameras/7": replace(opposite, skew=3.0)}
        report = attach(store, rig)
        assert report.problems == ['camera "cameras/7" belongs to 2 views of this name']
        assert list_groups_with_camera() == {"a": 3.0, "b": 2.0, "c": 3.0}
        report = attach(store, {"a/7": opposite, "x/a/7": opposite})
        assert [error.problem for error in report.left_out.problems] == [
            'is a second camera of its view; "a/7" is used'
        ]

    @pytest.mark.parametrize(("name", "changed"), [("rig.zip", 2), ("other.zip", 0)])
    def test_the_folder_of_a_zip_file_names_nothing(
        self, store, fill, make_group, tmp_path, opposite, name, changed
    ) -> None:
        first = make_group(7)
        other = replace(first.views[0], station=replace(first.views[0].station, key="x"))
        fill(first, Group("x", (other,), match=first.match), solved=False)
        path = tmp_path / name
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("rig/camera_7.json", format_camera_file(opposite))
        source = ImportSource("cameras", path)
        assert import_source(store, "demo", source, store.settings).result.changed == changed

    def test_cameras_of_another_size_are_scaled_to_their_views(
        self, store, state, opposite
    ) -> None:
        size = state.group.view("7.png").size
        half = opposite.scaled(0.5, 0.5)
        halved = ImageSize(size.width // 2, size.height // 2)
        report = import_given_cameras(
            store, "demo", {"7": half}, source="x", actor="ann", size=halved
        )
        given = load_group_state(store, state.id).group.view("7.png").station.given
        assert report.problems == []
        assert given.focal_length == opposite.focal_length
        assert given.principal_point == opposite.principal_point

    def test_a_size_that_the_file_states_counts_before_the_option(
        self, store, state, opposite
    ) -> None:
        size = state.group.view("7.png").size
        halved = ImageSize(size.width // 2, size.height // 2)
        half, sizes = opposite.scaled(0.5, 0.5), {"7": halved}
        for said, told in ((None, 0), (halved, 0), (ImageSize(640, 480), 1)):
            report = import_given_cameras(
                store, "demo", {"7": half}, source="x", actor="ann", size=said, sizes=sizes
            )
            assert len(report.problems) == told
            given = load_group_state(store, state.id).group.view("7.png").station.given
            assert given.focal_length == opposite.focal_length

    def test_a_camera_of_another_size_than_was_said_is_told(self, store, state, opposite) -> None:
        size = state.group.view("7.png").size
        half = replace(
            opposite, principal_point=((size.width / 2 - 1) / 2, (size.height / 2 - 1) / 2)
        )
        (problem,) = attach(store, {"7": half}).problems
        assert f"--size {size.width // 2}x{size.height // 2}" in problem

    def test_the_camera_stays_when_the_labels_are_imported_again(
        self, store, fill, make_group, opposite
    ) -> None:
        bare = make_group()
        for view in bare.views:
            bare = bare.with_view(replace(view, station=replace(view.station, given=None)))
        (group_id,) = fill(bare, solved=False)
        attach(store, {"7": opposite})
        import_groups(store, "demo", [replace(bare, label="new")], source="x", actor="ann")
        after = load_group_state(store, group_id)
        assert after.group.label == "new"
        assert after.group.view("7.png").station.given == opposite
        assert not after.stored.edited

    def test_attaching_cameras_is_no_edit_of_a_person(self, store, state, opposite) -> None:
        attach(store, {"7": opposite})
        assert not load_group_state(store, state.id).stored.edited
        now = load_group_state(store, state.id)
        edit = SetLines("7.png", {"Middle line": None})
        submit_edit(store, state.id, edit, if_match=now.etag, actor="ann")
        attach(store, {"7": replace(opposite, skew=0.5)})
        assert load_group_state(store, state.id).stored.edited

    def test_needs_a_dataset(self, store, opposite) -> None:
        with pytest.raises(NotFoundError):
            import_given_cameras(store, "nothing", {"7": opposite}, source="x", actor="ann")
        with pytest.raises(NotFoundError):
            get_dataset(store, "nothing")
