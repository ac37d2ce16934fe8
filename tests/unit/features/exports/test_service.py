from __future__ import annotations

import csv
import json
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from app.db.store import Store
from app.errors import InputError, NotFoundError
from app.features.exports.service import (
    FORMATS,
    TRACKS,
    export_dataset,
    list_format_availability,
    require_exportable,
)
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import ensure_dataset
from app.features.policies.service import change_policy
from app.features.solutions.service import solve_dataset
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.formats.export_formats import list_options_of_format
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Media
from app.soccer.policy import PAPER

OF_BROADCAST = [name for name in FORMATS if name not in ("issia", "issia-3d", *TRACKS)]
"""Formats of groups of different instants."""


def judge(store, group_id, state, reason=None, note=None):
    etag = load_group_state(store, group_id).etag
    return set_verdict(store, group_id, state, reason, note, if_match=etag, actor="ann")


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "SNv3D.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def ball_corners(folder: Path, image: str) -> list[float]:
    (path,) = folder.rglob("Labels-v3D.json")
    labels = json.loads(path.read_text())
    boxes = (labels["actions"] | labels["replays"])[image]["bboxes"]
    (ball,) = [box["points"] for box in boxes if box["class"] == "Ball"]
    return [ball[name] for name in ("x1", "y1", "x2", "y2")]


def files(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


@pytest.fixture
def three(fill, make_group):
    """Two groups that pass and one that fails."""
    return fill(make_group(7), make_group(8), make_group(9, shift=80.0))


class TestExport:
    def test_accepted_groups_go_out_and_others_stay(self, store, three, tmp_path) -> None:
        judge(store, three[0], "accepted")
        judge(store, three[1], "rejected", "bad_calibration")
        report = export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out")
        assert {row["main_action"] for row in table(report.out)} == {"7"}
        assert (report.counts["groups"], report.left_out) == (1, {})

    def test_a_failing_group_goes_out_with_the_reason_of_its_override(
        self, store, three, tmp_path
    ) -> None:
        judge(store, three[2], "accepted", note="seen on video")
        report = export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out")
        assert {row["main_action"] for row in table(report.out)} == {"9"}
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "all", everything=True)
        verdicts = {row["main_action"]: row["verdict"] for row in table(tmp_path / "all")}
        assert verdicts["9"] == "accepted: overrides reprojection: seen on video"
        assert verdicts["7"] == "unreviewed"

    def test_a_group_that_passes_by_now_overrides_nothing(self, store, three, tmp_path) -> None:
        judge(store, three[2], "accepted", note="seen on video")
        loose = replace(PAPER, name="loose", tau_percent=50.0, min_p_value=0.0, max_sigma_m=50.0)
        change_policy(store, "demo", loose, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out", everything=True)
        verdicts = {row["main_action"]: row["verdict"] for row in table(tmp_path / "out")}
        assert verdicts["9"] == "accepted"
        manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
        assert manifest["overrides"] == []

    def test_where_no_view_may_teach_yolo_is_refused_and_says_so(
        self, store, three, tmp_path
    ) -> None:
        judge(store, three[2], "accepted", note="seen on video")
        with pytest.raises(InputError, match="has a view that a detector may learn from for yolo"):
            export_dataset(store, "demo", "yolo", tmp_path / "out")
        assert not (tmp_path / "out").exists()
        assert (
            export_dataset(store, "demo", "yolo", tmp_path / "out", views="all").counts["labels"]
            == 2
        )

    def test_an_override_of_one_gate_covers_no_other_that_fails_later(
        self, store, three, tmp_path
    ) -> None:
        judge(store, three[0], "accepted")
        judge(store, three[2], "accepted", note="seen on video")
        wide = replace(PAPER, name="wide", min_baseline_m=1000.0)
        change_policy(store, "demo", wide, if_match=None, actor="ann")
        solve_dataset(store, "demo")
        judge(store, three[0], "accepted", note="the baseline is known")
        report = export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out")
        assert {row["main_action"] for row in table(report.out)} == {"7"}
        assert report.left_out == {"failing": 1}

    def test_a_group_that_changed_after_its_verdict_is_left_out_and_counted(
        self, store, three, tmp_path
    ) -> None:
        judge(store, three[0], "accepted")
        state = judge(store, three[1], "accepted")
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        submit_edit(
            store, three[1], make_set_ball_edit("8.png", ball), if_match=state.etag, actor="ben"
        )
        report = export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out")
        assert {row["main_action"] for row in table(report.out)} == {"7"}
        assert report.left_out == {"stale": 1}

    @pytest.mark.parametrize("out", ["out", "out.zip"])
    def test_nothing_to_export_leaves_no_file(self, store, three, tmp_path, out: str) -> None:
        with pytest.raises(InputError, match="no group has been accepted"):
            export_dataset(store, "demo", "soccernet-v3d", tmp_path / out)
        assert not (tmp_path / out).exists()

    @pytest.mark.parametrize("state", ["unreviewed", "stale"])
    def test_nothing_to_export_is_said_in_one_sentence(
        self, store, three, tmp_path, state: str
    ) -> None:
        if state == "stale":
            etag = judge(store, three[0], "accepted").etag
            submit_edit(
                store, three[0], make_set_ball_edit("7.png", None), if_match=etag, actor="ben"
            )
        with pytest.raises(InputError) as caught:
            export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out")
        assert caught.value.hint is None

    @pytest.mark.parametrize("out", ["out", "out.zip"])
    def test_groups_without_cameras_are_nothing_to_export_as_cameras(
        self, store, fill, make_group, tmp_path, out: str
    ) -> None:
        fill(make_group(7), solved=False)
        with pytest.raises(InputError, match=r"no group of .* has a camera") as caught:
            export_dataset(store, "demo", "cameras", tmp_path / out, everything=True)
        assert caught.value.hint is None
        assert list(tmp_path.glob("*out*")) == []

    def test_groups_without_balls_are_nothing_to_export_as_issia_3d(
        self, store, fill, make_static, tmp_path
    ) -> None:
        group = make_static(10)
        views = tuple(replace(view, balls=()) for view in group.views)
        fill(replace(group, views=views))
        with pytest.raises(InputError, match="has a ball for issia-3d"):
            export_dataset(store, "demo", "issia-3d", tmp_path / "out", everything=True)
        assert list(tmp_path.glob("*out*")) == []

    def test_a_stale_verdict_says_so_in_an_export_of_everything(
        self, store, three, tmp_path
    ) -> None:
        judge(store, three[0], "accepted")
        etag = judge(store, three[1], "accepted").etag
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        submit_edit(store, three[1], make_set_ball_edit("8.png", ball), if_match=etag, actor="ben")
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out", everything=True)
        verdicts = {row["main_action"]: row["verdict"] for row in table(tmp_path / "out")}
        assert verdicts == {"7": "accepted", "8": "accepted (stale)", "9": "unreviewed"}

    def test_an_empty_dataset_has_nothing_either(self, store, tmp_path) -> None:
        ensure_dataset(store, "demo", "ann")
        with pytest.raises(InputError, match="contains no groups"):
            export_dataset(store, "demo", "cameras", tmp_path / "out", everything=True)

    def test_the_manifest_says_what_it_is(self, store, three, tmp_path) -> None:
        state = judge(store, three[0], "accepted")
        export_dataset(store, "demo", "soccernet-v3d", tmp_path / "out.zip", boxes="exact")
        manifest = json.loads(files(tmp_path / "out.zip")["manifest.json"])
        assert (manifest["dataset"], manifest["version"]) == ("demo", None)
        assert manifest["date"] == state.verdict.at
        assert manifest["settings"]["policy_hash"] == state.policy.hash
        assert manifest["settings"]["boxes"] == "exact"
        assert manifest["settings"]["ball_bbox"] == "annotated"
        assert "soccer-net.org" in manifest["licence"]
        assert {item["path"] for item in manifest["files"]} >= {"SNv3D.csv", "SNv3D-train.txt"}

    def test_the_chosen_boxes_stand_in_the_labels_and_not_in_the_table(
        self, store, three, tmp_path
    ) -> None:
        fit = load_group_state(store, three[0]).solution.view("7.png").ball
        annotated = load_group_state(store, three[0]).group.view("7.png").ball.box
        expected = {
            "annotated": annotated,
            "optimized": fit.optimized_box,
            "exact": fit.exact_box,
        }
        cells = set()
        for kind, box in expected.items():
            out = tmp_path / kind
            export_dataset(store, "demo", "soccernet-v3d", out, everything=True, boxes=kind)
            assert ball_corners(out, "7.png") == pytest.approx(
                [box.x, box.y, box.x + box.width, box.y + box.height]
            )
            # The group that fails has no view that takes part.
            raw = load_group_state(store, three[2]).group.view("9.png").ball.box
            assert ball_corners(out, "9.png")[0] == raw.x
            cells.add(table(out)[0]["ball_bbox"])
        assert len(set(expected.values())) == 3
        assert len(cells) == 1

    @pytest.mark.parametrize("form", ["soccernet-v3", "cameras", "sn-calibration"])
    def test_formats_without_a_chosen_box_claim_none(
        self, store, three, tmp_path, form: str
    ) -> None:
        export_dataset(store, "demo", form, tmp_path / "out.zip", everything=True)
        manifest = json.loads(files(tmp_path / "out.zip")["manifest.json"])
        assert "boxes" not in manifest["settings"]

    @pytest.mark.parametrize(
        ("form", "asked", "formats"),
        [
            ("issia", {"boxes": "exact"}, "coco, parquet, soccernet-v3d, yolo"),
            ("parquet", {"views": "all"}, "coco, yolo"),
            ("touchline", {"images": "copy"}, "cameras, coco, gamestate, issia"),
        ],
    )
    def test_an_option_that_the_format_does_not_use_is_refused(
        self, store, three, tmp_path, form: str, asked: dict[str, str], formats: str
    ) -> None:
        (name,) = asked
        for run in (
            lambda: export_dataset(store, "demo", form, tmp_path / "out", everything=True, **asked),
            lambda: require_exportable(store, "demo", form, everything=True, **asked),
        ):
            with pytest.raises(
                InputError, match=f"exports in the format {form} do not use --{name}"
            ) as refused:
                run()
            assert refused.value.pointer == f"/{name}"
            assert f"Only these formats use it: {formats}" in str(refused.value.hint)
        assert not (tmp_path / "out").exists()

    def test_every_format_uses_the_options_that_it_says(self) -> None:
        assert {name: list_options_of_format(name) for name in FORMATS} == {
            "soccernet-v3d": ["boxes", "images"],
            "soccernet-v3": ["images"],
            "issia-3d": ["images"],
            "issia": ["images"],
            "cameras": ["images"],
            "coco": ["boxes", "images", "views"],
            "yolo": ["boxes", "images", "views"],
            "parquet": ["boxes", "images"],
            "gamestate": ["images"],
            "sn-calibration": ["images"],
            "touchline": [],
            **{name: [] for name in TRACKS},
        }

    def test_the_manifest_has_the_licence_of_every_source_once(
        self, store, fill, make_group, make_static, tmp_path
    ) -> None:
        fill(make_group(7), make_static(10), make_static(11))
        export_dataset(store, "demo", "cameras", tmp_path / "out", everything=True)
        manifest = json.loads((tmp_path / "out/manifest.json").read_text())
        assert manifest["licence"].count("soccer-net.org") == 1
        assert manifest["licence"].count("CNR-ISSIA") == 1

    def test_the_same_state_makes_the_same_bytes(self, store, three, tmp_path) -> None:
        for name in ("a.zip", "b.zip"):
            export_dataset(store, "demo", "soccernet-v3d", tmp_path / name, everything=True)
        assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()

    @pytest.mark.parametrize("form", OF_BROADCAST)
    def test_every_format_of_broadcast_groups(self, store, three, tmp_path, form: str) -> None:
        report = export_dataset(store, "demo", form, tmp_path / "out.zip", everything=True)
        assert report.counts["groups"] == 3
        assert len(files(tmp_path / "out.zip")) > 1

    def test_static_cameras_go_out_as_issia_3d(self, store, fill, make_static, tmp_path) -> None:
        fill(make_static(10), make_static(11))
        calls: list[tuple] = []
        report = export_dataset(
            store,
            "demo",
            "issia-3d",
            tmp_path / "out",
            everything=True,
            progress=lambda *place: calls.append(place),
        )
        assert report.counts == {"groups": 2, "points": 2, "balls": 6}
        assert calls[:2] == [(1, 2), (2, 2)]
        assert {sentence for *_, sentence in calls[2:]} == {"Reading the files' checksums."}
        assert (tmp_path / "out/issia_calibration.json").is_file()

    def test_groups_that_do_not_fit_the_format_leave_no_file(self, store, three, tmp_path) -> None:
        with pytest.raises(InputError, match="cannot be from ISSIA"):
            export_dataset(store, "demo", "issia-3d", tmp_path / "out", everything=True)
        assert list(tmp_path.glob("*out*")) == []

    @pytest.mark.parametrize(
        "options", [{"format": "xml"}, {"boxes": "round"}, {"images": "all"}, {"images": "link"}]
    )
    def test_unknown_options_are_refused(self, store, three, tmp_path, options) -> None:
        values = {"format": "cameras", **options}
        with pytest.raises(InputError):
            export_dataset(store, "demo", values.pop("format"), tmp_path / "out.zip", **values)

    def test_an_unknown_dataset_is_not_found(self, store, tmp_path) -> None:
        with pytest.raises(NotFoundError):
            export_dataset(store, "nothing", "cameras", tmp_path / "out")


class TestImages:
    @pytest.fixture
    def framed(self, fill, make_group, tmp_path):
        """A group whose first view has a frame in a zip and whose second has none."""
        picture = np.full((72, 128, 3), 90, dtype=np.uint8)
        data = cv2.imencode(".png", picture)[1].tobytes()
        path = tmp_path / "Frames-v3.zip"
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("7.png", data)
        group = make_group(7)
        view = replace(group.views[0], media=Media(str(path), "7.png"))
        return fill(group.with_view(view)), data

    def test_frames_are_copied_and_missing_ones_named(self, store, framed, tmp_path) -> None:
        _, data = framed
        report = export_dataset(
            store, "demo", "soccernet-v3", tmp_path / "out", everything=True, images="copy"
        )
        (copied,) = (tmp_path / "out").rglob("7.png")
        assert copied.read_bytes() == data
        assert copied.parent.name == "Frames-v3"
        assert len(report.missing_images) == 1
        assert "7_1.png" in report.missing_images[0]

    def test_views_that_came_without_a_picture_are_named_once_where_images_are_wanted(
        self, store, fill, make_group, tmp_path
    ) -> None:
        group = make_group(7)
        (tmp_path / "7.png").write_bytes(cv2.imencode(".png", np.zeros((9, 16, 3)))[1].tobytes())
        first, second = group.views
        first = replace(first, media=Media(str(tmp_path / "7.png")))
        fill(group.with_view(first).with_view(replace(second, media=None)))
        for images, named in (("copy", 1), ("none", 0)):
            out = tmp_path / images
            report = export_dataset(store, "demo", "yolo", out, everything=True, images=images)
            assert len(report.missing_images) == named
            assert all("no picture came with it" in line for line in report.missing_images)

    @pytest.mark.parametrize("form", ["coco", "gamestate", "parquet", "yolo"])
    def test_pictures_of_another_size_than_their_annotations_are_said(
        self, store, framed, tmp_path, form
    ) -> None:
        report = export_dataset(
            store, "demo", form, tmp_path / "out", everything=True, images="copy"
        )
        manifest = json.loads((tmp_path / "out/manifest.json").read_text())
        # Of YOLO, whose coordinates are parts of the picture, it does not matter.
        said = manifest["settings"].get("pictures_of_another_size", "")
        count = 0 if form == "yolo" else 1
        assert report.counts.get("pictures_of_another_size", 0) == count
        assert said.startswith("1 picture has another size than the annotations") is bool(count)

    def test_a_picture_that_was_missing_when_its_version_was_frozen_is_said(
        self, store, fill, make_group, tmp_path
    ) -> None:
        group, path = make_group(7), tmp_path / "7.png"
        fill(group.with_view(replace(group.views[0], media=Media(str(path)))))
        freeze_dataset(store, "demo", FreezeRequest("v1", groups="passing"), actor="ann")
        cv2.imwrite(str(path), np.full((72, 128, 3), 90, dtype=np.uint8))
        freeze_dataset(store, "demo", FreezeRequest("v2", groups="passing"), actor="ann")
        for version, count in (("v1", 1), ("v2", 0)):
            out = tmp_path / version
            report = export_dataset(store, "demo", "coco", out, version=version, images="copy")
            manifest = json.loads((out / "manifest.json").read_text())
            assert report.counts.get("pictures_unchecked", 0) == count
            assert ("pictures_unchecked" in manifest["settings"]) is bool(count)

    def test_labels_name_the_images_that_were_copied(self, store, framed, tmp_path) -> None:
        _, data = framed
        for form in ("yolo", "coco", "parquet"):
            export_dataset(store, "demo", form, tmp_path / form, everything=True, images="copy")
        with (tmp_path / "yolo/frames.csv").open(newline="") as file:
            rows = {row["view"]: row for row in csv.DictReader(file)}
        assert (rows["7.png"]["present"], rows["7_1.png"]["present"]) == ("True", "False")
        assert (tmp_path / "yolo" / rows["7.png"]["image"]).read_bytes() == data
        manifest = json.loads((tmp_path / "yolo/manifest.json").read_text())
        assert manifest["settings"]["missing_images"].startswith("1 image is not")
        assert manifest["counts"]["images_missing"] == 1
        (path,) = (tmp_path / "coco/annotations").iterdir()
        image = json.loads(path.read_text())["images"][0]
        assert (tmp_path / "coco" / image["file_name"]).read_bytes() == data

    def test_the_manifest_knows_frames_that_are_not_copied(self, store, framed, tmp_path) -> None:
        _, data = framed
        export_dataset(store, "demo", "soccernet-v3", tmp_path / "out", everything=True)
        manifest = json.loads((tmp_path / "out/manifest.json").read_text())
        (item,) = manifest["media"]
        assert (item["view"], item["bytes"]) == ("7.png", len(data))
        assert item["crc32"] == zlib.crc32(data)


class TestPossibleFormats:
    def test_a_format_that_has_no_place_for_the_groups_says_why(self, store, three) -> None:
        answers = {one.format: one for one in list_format_availability(store, "demo")}
        refused = [name for name, one in answers.items() if one.reason is not None]
        assert refused == ["issia-3d", "issia", *TRACKS]
        assert "cannot be from ISSIA" in answers["issia"].reason
        assert tuple(answers) == FORMATS

    def test_the_groups_are_read_once_for_all_formats(
        self, store: Store, three: object, counted: Callable[..., Any]
    ) -> None:
        with counted(store) as one:
            require_exportable(store, "demo", "parquet", everything=True)
        with counted(store) as every:
            list_format_availability(store, "demo")
        assert every.reads == 1
        assert every.statements < 3 * one.statements

    def test_of_static_cameras_it_is_the_other_way_round(self, store, fill, make_static) -> None:
        fill(make_static(10))
        refused = {
            one.format for one in list_format_availability(store, "demo") if one.reason is not None
        }
        assert {"soccernet-v3", "soccernet-v3d"} <= refused
        assert not {"issia", "issia-3d"} & refused

    def test_an_export_that_is_refused_names_the_formats_that_fit(self, store, three) -> None:
        with pytest.raises(InputError, match="cannot be from ISSIA") as caught:
            require_exportable(store, "demo", "issia", everything=True)
        assert caught.value.hint is not None
        named = caught.value.hint.removesuffix(".").partition(": ")[2].split(", ")
        assert named == OF_BROADCAST

    def test_that_nothing_is_accepted_is_no_matter_of_the_format(self, store, three) -> None:
        with pytest.raises(InputError, match="no group has been accepted") as caught:
            require_exportable(store, "demo", "issia")
        assert caught.value.hint is None
