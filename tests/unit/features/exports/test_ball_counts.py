"""One rule for the ball's boxes: every format, the evaluation and the version count alike."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.exports.service import export_dataset
from app.features.groups.submit import load_group_state
from app.features.predictions.frames import read_live_truth, read_version_truth
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.service import find_version
from app.formats.parquet import import_pyarrow
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.ball_boxes import collect_ball_boxes, find_ball_fit, is_ball_3d_valid_in_view
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Station, View
from tests.balls import seen
from tests.cameras import SIZE
from tests.unit.stores import MATCH, OPPOSITE, drawn


def with_a_view_apart(group: Group, number: int) -> Group:
    """The group with a third view, calibrated, whose ball is somewhere else altogether."""
    name = f"{number}_2.png"
    lines = make_lines(drawn(OPPOSITE))
    station = Station(f"{MATCH}/{name}", SIZE, lines=lines, given=OPPOSITE)
    center = seen(OPPOSITE, (5.0, 2.0, -0.5))
    away = Box.square(ImagePoint(center.x, center.y + 250.0), 12.4)
    return replace(group, views=(*group.views, View(name, station, (BallAnnotation(box=away),))))


@pytest.fixture
def mixed(store: Store, fill, make_group) -> Store:
    """A group of two views that agree, and one with a third view in no valid pair."""
    ids = fill(make_group(7), with_a_view_apart(make_group(8), 8))
    solution = load_group_state(store, ids[1]).solution
    assert solution is not None
    assert [view.included for view in solution.views] == [True, True, False]
    freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
    return store


def coco(root: Path) -> tuple[int, int]:
    (path,) = (root / "annotations").glob("instances_*")
    found = json.loads(path.read_text())["annotations"]
    return sum(item["ball_3d"] is not None for item in found), len(found)


def parquet(root: Path) -> tuple[int, int]:
    rows = import_pyarrow()[1].read_table(root / "views.parquet").to_pylist()
    boxes = sum(row["box_x"] is not None for row in rows)
    return sum(row["ball_3d_x"] is not None for row in rows), boxes


def soccernet_v3d(root: Path) -> tuple[int, int]:
    (table,), (labels,) = root.rglob("SNv3D.csv"), root.rglob("Labels-v3D.json")
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert sum(bool(row["optimized_d"]) for row in rows) == sum(
        bool(row["ball_3D"]) for row in rows
    )
    value = json.loads(labels.read_text())
    images = [*value["actions"].values(), *value["replays"].values()]
    boxes = sum(box["class"] == "Ball" for image in images for box in image["bboxes"])
    return sum(bool(row["ball_3D"]) for row in rows), boxes


def yolo(root: Path) -> tuple[None, int]:
    return None, sum(bool(path.read_text()) for path in root.rglob("labels/**/*.txt"))


READ: dict[str, Callable[[Path], tuple[int | None, int]]] = {
    "coco": coco,
    "parquet": parquet,
    "soccernet-v3d": soccernet_v3d,
    "yolo": yolo,
}


class TestCounts:
    @pytest.mark.parametrize("format_", READ)
    @pytest.mark.parametrize("boxes", ["optimized", "exact", "annotated"])
    def test_version_manifest_and_files_count_the_same_balls(
        self, mixed: Store, tmp_path: Path, format_: str, boxes: str
    ) -> None:
        dataset = get_dataset(mixed, "demo")
        version = find_version(mixed, dataset.id, "v1")
        export_dataset(mixed, "demo", format_, tmp_path / "out", boxes=boxes, version="v1")
        manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
        balls, written = READ[format_](tmp_path / "out")
        assert version.counts["balls"] == 4
        assert manifest["counts"]["balls"] == 4
        assert balls in (None, 4)
        # Two views, and three of which one is in no valid pair: it keeps its annotated box, and no
        # detector learns from it.
        expected = 4 if format_ in ("coco", "yolo") else 5
        assert written == expected
        named = manifest["counts"].get("boxes", manifest["counts"].get("annotations", expected))
        assert named == expected

    @pytest.mark.parametrize("format_", ["soccernet-v3", "cameras", "sn-calibration", "gamestate"])
    def test_formats_without_3d_balls_count_them_all_the_same(
        self, mixed: Store, tmp_path: Path, format_: str
    ) -> None:
        report = export_dataset(mixed, "demo", format_, tmp_path / "out", version="v1")
        manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
        assert manifest["counts"]["balls"] == report.counts["balls"] == 4

    @pytest.mark.parametrize("format_", ["coco", "yolo"])
    def test_detectors_learn_from_the_view_apart_where_that_is_asked(
        self, mixed: Store, tmp_path: Path, format_: str
    ) -> None:
        said = {}
        for name, options in (
            ("asked", {"version": "v1", "views": "all"}),
            ("everything", {"everything": True}),
            ("not asked", {"version": "v1"}),
        ):
            export_dataset(mixed, "demo", format_, tmp_path / name, **options)
            manifest = json.loads((tmp_path / name / "manifest.json").read_text())
            said[name] = (READ[format_](tmp_path / name)[1], manifest["settings"]["views"])
        assert said == {"asked": (5, "all"), "everything": (5, "all"), "not asked": (4, "valid")}

    def test_a_frame_that_teaches_nobody_is_not_copied_to_yolo(
        self, mixed: Store, tmp_path: Path
    ) -> None:
        export_dataset(mixed, "demo", "yolo", tmp_path / "out", version="v1")
        assert "8_2" not in (tmp_path / "out/frames.csv").read_text()
        assert list((tmp_path / "out").rglob("*8_2*")) == []

    @pytest.mark.parametrize("format_", READ)
    def test_an_export_of_everything_counts_the_same(
        self, mixed: Store, tmp_path: Path, format_: str
    ) -> None:
        report = export_dataset(mixed, "demo", format_, tmp_path / "out", everything=True)
        assert report.counts["balls"] == 4

    def test_static_cameras_count_alike(
        self, store: Store, fill, make_static, tmp_path: Path
    ) -> None:
        fill(make_static(10), make_static(11))
        freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        version = find_version(store, get_dataset(store, "demo").id, "v1")
        for name in ("issia", "issia-3d", "coco", "parquet", "yolo"):
            report = export_dataset(store, "demo", name, tmp_path / name, version="v1")
            assert report.counts["balls"] == version.counts["balls"] == 6

    def test_the_evaluation_judges_the_same_balls(self, mixed: Store) -> None:
        dataset = get_dataset(mixed, "demo")
        with mixed.read() as session:
            version = find_version(mixed, dataset.id, "v1")
            truths = [
                read_version_truth(session, version, None).frames,
                read_live_truth(session, dataset, "passing", None).frames,
            ]
        for frames in truths:
            for kind in ("optimized", "exact"):
                assert sum(kind in frame.boxes for frame in frames) == 4
            assert sum("annotated" in frame.boxes for frame in frames) == 5
            assert sum(frame.point is not None for frame in frames) == 4


class TestBoxOfAViewApart:
    @pytest.mark.parametrize("kind", ["optimized", "exact"])
    def test_it_is_the_annotated_one_in_every_format(
        self, mixed: Store, tmp_path: Path, kind: str
    ) -> None:
        export_dataset(
            mixed, "demo", "coco", tmp_path / "coco", boxes=kind, version="v1", views="all"
        )
        export_dataset(mixed, "demo", "parquet", tmp_path / "parquet", boxes=kind, version="v1")
        (path,) = (tmp_path / "coco" / "annotations").iterdir()
        value = json.loads(path.read_text())
        (image,) = (item["id"] for item in value["images"] if item["view"] == "8_2.png")
        (found,) = (item for item in value["annotations"] if item["image_id"] == image)
        assert found["bbox"] == found["annotated_bbox"]
        assert (found["ball_3d"], found["optimized_diameter_px"]) == (None, None)
        rows = import_pyarrow()[1].read_table(tmp_path / "parquet" / "views.parquet").to_pylist()
        (row,) = (row for row in rows if row["view"] == "8_2.png")
        assert row["box_width"] == row["annotated_width"] == pytest.approx(12.4)

    def test_everything_tells_its_error_and_no_optimised_box(
        self, mixed: Store, tmp_path: Path
    ) -> None:
        export_dataset(mixed, "demo", "coco", tmp_path / "out", everything=True)
        (path,) = (tmp_path / "out" / "annotations").iterdir()
        value = json.loads(path.read_text())
        (image,) = (item["id"] for item in value["images"] if item["view"] == "8_2.png")
        (found,) = (item for item in value["annotations"] if item["image_id"] == image)
        assert found["error_px"] > 20.0
        assert found["bbox"] == found["annotated_bbox"]
        assert (found["optimized_diameter_px"], found["optimized_error_m"]) == (None, None)

    def test_without_an_annotation_it_has_none(self, mixed: Store) -> None:
        ids: Any = {
            item.key: item for item in (load_group_state(mixed, 1), load_group_state(mixed, 2))
        }
        state = ids[f"{MATCH}/8.png"]
        view = replace(state.group.views[2], balls=())
        assert collect_ball_boxes(state.solution, view) == {}
        assert find_ball_fit(state.solution, view, everything=True) is None
        assert not is_ball_3d_valid_in_view(state.solution, view)
