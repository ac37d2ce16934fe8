"""Records and tables say what was computed."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

import touchline
from app.formats.export_record import ExportRecord
from tests.unit.touchline.conftest import write_export, zipped
from touchline.errors import DataError, MissingPackageError


@pytest.fixture(scope="module")
def version(export: Path) -> touchline.Dataset:
    return touchline.open(export)


class TestRecords:
    def test_a_group_split_by_camera_claims_no_split(
        self, records: list[ExportRecord], tmp_path: Path
    ) -> None:
        group = records[0].group
        splits = {view.key: "test" if index else "train" for index, view in enumerate(group.views)}
        record = replace(records[0], group=replace(group, split=""), splits=splits)
        (found,) = touchline.open(write_export(tmp_path / "out", [record], images=False))
        assert found.split == ""
        assert [view.split for view in found.views] == list(splits.values())

    def test_cameras_and_balls_are_those_of_the_solution_to_the_last_bit(
        self, version: touchline.Dataset, records: list[ExportRecord]
    ) -> None:
        points = np.random.default_rng(1).uniform((-52, -34, -8), (52, 34, 0), (200, 3))
        assert len(version) == len(version.groups) == len(records)
        for group, record in zip(version, records, strict=True):
            assert record.solution is not None and record.solution.ball is not None
            assert group.ball is not None
            assert group.ball.position == tuple(record.solution.ball.point)
            assert group.ball.sigma_m == record.solution.ball.sigma_m
            assert group.ball.height_m == -group.ball.position[2]
            for view, said in zip(group.views, record.group.views, strict=True):
                camera = record.camera(said)
                assert camera is not None and view.camera is not None
                one, other = view.camera.project(points), camera.project(points)
                assert np.nanmax(np.abs(one - other)) < 1e-9
                assert view.lines == {
                    name: tuple((float(x), float(y)) for x, y in points)
                    for name, points in said.station.lines.items()
                }

    def test_a_marking_that_the_picture_does_not_show_is_no_line(
        self, records: list[ExportRecord], tmp_path: Path
    ) -> None:
        group = records[0].group
        view = group.views[0]
        gone = sorted(view.station.lines)[0]
        lines = {name: points for name, points in view.station.lines.items() if name != gone}
        station = replace(view.station, lines=lines, not_visible=(gone,))
        record = replace(records[0], group=group.with_view(replace(view, station=station)))
        (found,) = touchline.open(write_export(tmp_path / "out", [record], images=False))
        assert set(found.views[0].lines) == set(lines)
        assert found.views[0].not_visible == {gone}
        assert found.views[1].not_visible == frozenset()

    def test_a_ball_projects_to_where_the_server_says(self, version: touchline.Dataset) -> None:
        balls = [(view, view.ball, view.ball_3d) for view in version.views if view.ball_3d]
        assert len(balls) >= 6
        for view, ball, ball_3d in balls:
            assert ball is not None and ball.reprojected is not None and view.camera is not None
            difference = view.camera.project(ball_3d.position) - ball.reprojected
            assert np.abs(difference).max() < 1e-9
            assert ball.error_px == pytest.approx(
                float(np.hypot(*(view.camera.project(ball_3d.position) - ball.center)))
            )

    def test_a_box_has_its_centre_where_the_ball_is(self, version: touchline.Dataset) -> None:
        ball = version.views[0].ball
        assert ball is not None and ball.annotated is not None
        assert ball.annotated.center == pytest.approx(ball.center)

    def test_repr_says_what_it_is(self, version: touchline.Dataset) -> None:
        count = len(version.views)
        assert repr(version) == f"<touchline.Dataset league, version v1, 3 groups, {count} views>"


class TestTables:
    def test_each_has_a_row_a_record(self, version: touchline.Dataset) -> None:
        views, groups, balls = (version.table(name) for name in ("views", "groups", "balls"))
        assert views.num_rows == len(version.views)
        assert groups["group"].to_pylist() == [group.key for group in version.groups]
        assert groups["views"].to_pylist() == [len(group.views) for group in version.groups]
        assert balls["z"].to_pylist() == [ball.position[2] for ball in version.balls]
        with pytest.raises(ValueError, match="players"):
            version.table("players")

    def test_where_pandas_is_missing_the_error_says_how_to_install_it(
        self, version: touchline.Dataset, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setitem(__import__("sys").modules, "pandas", None)
        with pytest.raises(MissingPackageError, match="pip install 'pandas'"):
            version.pandas()


class TestSamples:
    def test_they_are_indexed_by_split_and_stack_without_holes(
        self, version: touchline.Dataset
    ) -> None:
        assert version.splits == ("test", "train")
        train, test = version.samples("train"), version.samples("test", images=False)
        assert len(train) + len(test) == len(version.views)
        assert len(test) == len(version.groups[0].views)
        sample = train[0]
        assert sample["image"].shape == (*sample["size"][::-1], 3)
        # PyTorch makes tensors of them in place.
        arrays = [value for value in sample.values() if isinstance(value, np.ndarray)]
        assert len(arrays) == 6
        assert all(array.flags.writeable for array in arrays)
        assert "image" not in test[0]
        stacked = {name: np.stack([s[name] for s in train]) for name in ("box", "ball", "P")}
        assert {name: array.shape[1:] for name, array in stacked.items()} == {
            "box": (4,),
            "ball": (3,),
            "P": (3, 4),
        }

    def test_a_transform_and_a_choice_are_taken(self, version: touchline.Dataset) -> None:
        chosen = version.samples(
            where=lambda view: view.key == version.views[0].key,
            images=False,
            transform=lambda sample: sample["view"],
        )
        assert set(chosen) == {version.views[0].key}

    def test_a_split_that_nobody_is_in_is_refused(self, version: touchline.Dataset) -> None:
        with pytest.raises(DataError, match="Splits are: test, train"):
            version.samples("valid")

    def test_what_a_view_lacks_is_not_a_number(self, version: touchline.Dataset) -> None:
        bare = replace(version.views[0], ball=None, ball_3d=None, camera=None)
        sample = touchline.Samples([bare], images=False)[0]
        shapes = {name: sample[name].shape for name in ("box", "center", "ball", "P")}
        assert shapes == {"box": (4,), "center": (2,), "ball": (3,), "P": (3, 4)}
        assert all(np.isnan(sample[name]).all() for name in shapes)

    @pytest.mark.parametrize("packed", [False, True])
    def test_a_worker_process_can_have_a_copy(
        self, export: Path, tmp_path: Path, packed: bool
    ) -> None:
        source = zipped(export, tmp_path / "v1.zip") if packed else export
        samples = touchline.open(source).samples("train")
        with ProcessPoolExecutor(1, get_context("spawn")) as pool:
            again = [*pool.map(samples.__getitem__, [0])]
        assert (again[0]["image"] == samples[0]["image"]).all()
