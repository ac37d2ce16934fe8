"""Views that are named alike: in every format each record has the picture of its own frame."""

from __future__ import annotations

import csv
import json
import re
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

import touchline
from app.errors import InputError
from app.evaluation.frame import FrameNameIndex, NamedFrame
from app.evaluation.prediction_files import read_predicted_cameras
from app.features.exports.service import ExportReport, export_dataset, require_exportable
from app.features.groups.submit import load_group_state
from app.features.imports.cameras import import_given_cameras
from app.features.verdicts.service import set_verdict
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.formats.cameras import read_cameras
from app.formats.coco_reader import read_coco
from app.formats.export_formats import FORMATS, TRACKS, list_options_of_format
from app.formats.gamestate_reader import read_gamestate
from app.formats.parquet import read_parquet
from app.formats.report import ReaderReport
from app.formats.sn_calibration_reader import read_sn_calibration
from app.soccer.annotation import BallAnnotation, make_lines
from app.soccer.frames import Box
from app.soccer.group import Group, Media, Station, View
from tests.cameras import SIZE
from tests.unit.stores import BEHIND, MAIN

OWN = tuple(name for name in FORMATS if name not in ("touchline", *TRACKS))
SCHEMES: dict[str, Sequence[tuple[str, str, tuple[str, ...]]]] = {
    "alike": [("", f"kick-{number}", ("north", "south")) for number in range(3)],
    "alike in a match": [("l/s/m", f"l/s/m/{number}", ("north", "south")) for number in range(3)],
    "alike but for case": [("", "a", ("North", "north")), ("", "b", ("NORTH", "South"))],
    "groups alike but for case": [("", "Kick", ("north",)), ("", "kick", ("north",))],
    "alike but for composition": [("", "a", ("caf\u00e9",)), ("", "b", ("cafe\u0301",))],
    "alike but for the ending": [("", "a", ("7.png", "7.jpg")), ("", "b", ("7.png", "7"))],
    "alike in other folders": [("", "x/7.png", ("x/7.png",)), ("", "y/7.png", ("y/7.png",))],
    "alike but for a sign": [("", "a", ("cam 1", "cam-1")), ("", "b", ("cam_1", "cam/1"))],
    "called as another one would be": [
        ("", "a", ("b/7", "7")), ("", "b", ("7", "a/7")), ("", "c", ("b_7", "a_7")),
    ],
    "from SoccerNet": [
        ("l/s/m", "l/s/m/7.png", ("7.png", "7_1.png")), ("l/s/m", "l/s/m/8.png", ("8.png",)),
        ("l/s/n", "l/s/n/7.png", ("7.png",)),
    ],
    "from SoccerNet, one image twice": [
        ("", "l/s/m/7.png", ("7.png", "7_1.png")), ("", "l/s/m/8.png", ("8.png", "7_1.png")),
    ],
    "from SoccerNet, numbers alike": [("", "l/s/m/7.png", ("7.png",)), ("", "l/s/m/8.png", ("07.png",))],
    "from ISSIA": [("issia", str(number), ("cam1", "cam2")) for number in (358, 359)],
    "from ISSIA, numbers alike": [("issia", "7", ("cam1",)), ("issia", "07", ("cam1",))],
}  # fmt: skip
"""Match and key of each group, and keys of its views."""
FITTING = {
    "from SoccerNet": ("soccernet-v3", "soccernet-v3d"),
}
"""Which of the formats that prescribe names hold a scheme; all others hold every scheme."""
PRESCRIBED = {
    "soccernet-v3": "from SoccerNet",
    "soccernet-v3d": "from SoccerNet",
    "issia": "from ISSIA",
    "issia-3d": "from ISSIA",
}
"""Formats that prescribe the names; a refusal names both frames of those that came from there."""


def shade(number: int) -> int:
    """The grey of the picture of a frame."""
    return 12 + 25 * number


def made(scheme: str, folder: Path, pictures: str = ".png") -> list[Group]:
    """The groups of a scheme; ball, lines, camera and picture of each view hold its number."""
    groups, number = [], 0
    for match, key, names in SCHEMES[scheme]:
        views = []
        for name in names:
            path = folder / f"picture-{number}{pictures}"
            path.parent.mkdir(exist_ok=True)
            grey = np.full((SIZE.height, SIZE.width, 3), shade(number), np.uint8)
            assert cv2.imwrite(str(path), grey)
            camera = BEHIND if number % 2 else MAIN
            camera = replace(camera, position=camera.position - np.array([0.0, 0.0, number / 64]))
            lines = make_lines({"Middle line": [(number * 10.0, 5.0), (number * 10.0, 600.0)]})
            station = Station(f"{key}/{name}", SIZE, lines=lines, given=camera)
            ball = BallAnnotation(box=Box(200.0 + 10.0 * number, 300.0, 14.0, 14.0))
            views.append(View(name, station, (ball,), Media(str(path))))
            number += 1
        groups.append(Group(key, tuple(views), match=match, split="train"))
    return groups


def grey_of(path: Path) -> int:
    return int(cv2.imread(str(path))[9, 9, 0])


def told_apart(view: View) -> int:
    """The number of a view that was read again: that of its ball, or of its lines."""
    if view.ball is not None and view.ball.box is not None:
        return round((view.ball.box.x - 200) / 10)
    return round(view.station.lines["Middle line"][0].x / 10)


READERS: dict[str, Callable[[Path, ReaderReport], Iterator[Group]]] = {
    "coco": read_coco,
    "parquet": read_parquet,
    "gamestate": read_gamestate,
    "sn-calibration": lambda path, report: read_sn_calibration(path, SIZE, report),
}


def coco_records(out: Path) -> Iterator[tuple[int, Path]]:
    (path,) = (out / "annotations").glob("instances_*.json")
    found = json.loads(path.read_text())
    boxes = {item["image_id"]: item["bbox"] for item in found["annotations"]}
    for image in found["images"]:
        yield int((boxes[image["id"]][0] - 200) // 10), out / image["file_name"]


def gamestate_records(out: Path) -> Iterator[tuple[int, Path]]:
    for path in out.rglob("Labels-GameState.json"):
        found = json.loads(path.read_text())
        names = {image["image_id"]: image["file_name"] for image in found["images"]}
        for item in found["annotations"]:
            if item["category_id"] == 4:
                number = round((item["bbox_image"]["x"] - 200) / 10)
                yield number, path.parent / "img1" / names[item["image_id"]]


def line_records(out: Path) -> Iterator[tuple[int, Path]]:
    for path in (out / "lines").rglob("*.json"):
        unit = json.loads(path.read_text())["Middle line"][0]["x"]
        yield round(unit * (SIZE.width - 1) / 10), path.with_suffix(".png")


def yolo_records(out: Path) -> Iterator[tuple[int, Path]]:
    with (out / "frames.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            label = re.sub("^images", "labels", row["image"]).rsplit(".", 1)[0] + ".txt"
            x = float((out / label).read_text().split()[1]) * SIZE.width
            yield int((x - 207) // 10), out / row["image"]


RECORDS: dict[str, Callable[[Path], Iterator[tuple[int, Path]]]] = {
    "coco": coco_records,
    "gamestate": gamestate_records,
    "sn-calibration": line_records,
    "yolo": yolo_records,
}
"""The number of each record as a reader of the format finds it, and its picture."""


def on_disk(folder: Path) -> list[str]:
    return sorted(
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()
    )


def is_picture(name: str) -> bool:
    return name.endswith((".png", ".jpg"))


def require_apart(folder: Path) -> None:
    """No two files of an export are one to a disk that knows no case."""
    names = [unicodedata.normalize("NFC", name).casefold() for name in on_disk(folder)]
    assert len(set(names)) == len(names)


class TestEveryFormat:
    @pytest.mark.parametrize("scheme", SCHEMES)
    @pytest.mark.parametrize("images", ["copy", "link"])
    @pytest.mark.parametrize("name", OWN)
    def test_each_record_has_the_picture_of_its_own_frame(
        self, store, fill, tmp_path: Path, name: str, images: str, scheme: str
    ) -> None:
        groups = made(scheme, tmp_path / "in")
        fill(*groups)
        out = tmp_path / "out"
        boxes = "annotated" if "boxes" in list_options_of_format(name) else "optimized"
        try:
            report = export_dataset(
                store, "demo", name, out, everything=True, boxes=boxes, images=images
            )
        except InputError as error:
            assert name in PRESCRIBED and name not in FITTING.get(scheme, ())
            of_format = scheme.startswith(PRESCRIBED[name])
            assert (all if of_format else any)(group.key in error.message for group in groups)
            assert not out.exists()
            return
        require_apart(out)
        numbers = list(range(sum(len(group.views) for group in groups)))
        self.require_pictures(out, report, numbers)
        if name in RECORDS:
            found = [(number, grey_of(path)) for number, path in RECORDS[name](out)]
            assert sorted(found) == [(number, shade(number)) for number in numbers]
        if name in READERS and images == "copy":
            self.require_read_again(name, out, numbers)
        if name == "parquet":
            views = touchline.open(out).views
            assert [int(view.image()[9, 9, 0]) for view in views] == [*map(shade, numbers)]
        if name in ("cameras", "sn-calibration"):
            heights = sorted(
                float(c.position[2]) for c in read_cameras(out, ReaderReport()).values()
            )
            wanted = [view.station.given.position[2] for group in groups for view in group.views]
            assert heights == pytest.approx(sorted(wanted))
            assert report.counts["cameras"] == len(numbers)

    def require_pictures(self, out: Path, report: ExportReport, numbers: list[int]) -> None:
        pictures = [file for file in on_disk(out) if is_picture(file)]
        greys = sorted(grey_of(out / file) for file in pictures)
        assert greys == [*map(shade, numbers)]
        assert report.missing_images == ()
        counted = report.counts.get("pictures", report.counts.get("images"))
        assert counted == len(pictures)
        manifest = json.loads((out / "manifest.json").read_text())
        assert manifest["counts"] == dict(report.counts)
        assert sum(is_picture(item["path"]) for item in manifest["files"]) == len(pictures)

    def require_read_again(self, name: str, out: Path, numbers: list[int]) -> None:
        report = ReaderReport()
        views = [view for group in READERS[name](out, report) for view in group.views]
        assert report.problems == []
        assert sorted(map(told_apart, views)) == numbers
        greys = [grey_of(Path(view.media.path)) for view in views if view.media]
        assert greys == [shade(told_apart(view)) for view in views]

    @pytest.mark.parametrize("name", [*READERS, "cameras", "yolo"])
    def test_a_version_is_written_with_the_same_names(
        self, store, fill, tmp_path: Path, name: str
    ) -> None:
        for group_id in fill(*made("alike", tmp_path / "in")):
            etag = load_group_state(store, group_id).etag
            set_verdict(store, group_id, "accepted", None, "known", if_match=etag, actor="ann")
        freeze_dataset(store, "demo", FreezeRequest("v1"), actor="ann")
        for out, version in (("live", None), ("frozen", "v1")):
            options = {"images": "copy", "version": version}
            if "views" in list_options_of_format(name):
                options["views"] = "all"
            export_dataset(store, "demo", name, tmp_path / out, **options)
        assert on_disk(tmp_path / "live") == on_disk(tmp_path / "frozen")
        pictures = [file for file in on_disk(tmp_path / "frozen") if is_picture(file)]
        assert len(pictures) == 6

    def test_a_version_takes_no_other_picture_of_the_same_size(
        self, store, fill, tmp_path: Path
    ) -> None:
        groups = made("alike", tmp_path / "in")
        for group_id in fill(*groups):
            etag = load_group_state(store, group_id).etag
            set_verdict(store, group_id, "accepted", None, "known", if_match=etag, actor="ann")
        freeze_dataset(store, "demo", FreezeRequest("v1"), actor="ann")
        picture = next(Path(view.media.path) for view in groups[0].views if view.media)
        picture.write_bytes(picture.read_bytes()[:-1] + b"?")
        out = tmp_path / "out"
        report = export_dataset(
            store, "demo", "coco", out, images="copy", views="all", version="v1"
        )
        assert len(report.missing_images) == 1

    @pytest.mark.parametrize("name", ["issia", "issia-3d"])
    def test_views_of_one_camera_that_differ_in_it_are_named_together(
        self, store, fill, tmp_path: Path, name: str
    ) -> None:
        fill(*made("from ISSIA", tmp_path / "in"))
        with pytest.raises(InputError, match=r"358, cam1 and 359, cam1.*different cameras"):
            require_exportable(store, "demo", name, everything=True)

    def test_names_that_no_other_frame_has_stay_what_they_were(
        self, store, fill, tmp_path: Path
    ) -> None:
        fill(*made("from SoccerNet", tmp_path / "in"))
        export_dataset(store, "demo", "coco", tmp_path / "out", everything=True, images="copy")
        assert [name for name in on_disk(tmp_path / "out") if is_picture(name)] == [
            f"l/s/{name}" for name in (
                "m/Frames-v3/7.png", "m/Frames-v3/7_1.png", "m/Frames-v3/8.png", "n/Frames-v3/7.png",
            )
        ]  # fmt: skip

    def test_a_frame_that_two_groups_show_has_one_picture(
        self, store, fill, tmp_path: Path
    ) -> None:
        first, second = made("alike", tmp_path / "in")[:2]
        shown = replace(second.views[0], media=first.views[0].media)
        fill(first, replace(second, views=(shown,)))
        for images in ("copy", "link"):
            report = export_dataset(
                store, "demo", "coco", tmp_path / images, everything=True, images=images
            )
            assert (report.counts["images"], report.counts["pictures"]) == (3, 2)


TOLD_APART = [scheme for scheme in SCHEMES if scheme != "alike but for the ending"]
"""Where the name of a file without its ending means one frame."""


def index_frames(groups: Sequence[Group]) -> FrameNameIndex:
    """The frames of a dataset, each with its number as its id."""
    views = [(group, view) for group in groups for view in group.views]
    return FrameNameIndex.of(
        NamedFrame(number, group.key, view.key, group.match, SIZE)
        for number, (group, view) in enumerate(views)
    )


class TestWhatIsWrittenIsFoundAgain:
    @pytest.mark.parametrize("scheme", TOLD_APART)
    @pytest.mark.parametrize("name", ["cameras", "sn-calibration"])
    def test_cameras_fit_the_views_that_they_are_of(
        self, store, fill, tmp_path: Path, name: str, scheme: str
    ) -> None:
        groups = made(scheme, tmp_path / "in")
        fill(*groups)
        export_dataset(store, "demo", name, tmp_path / name, everything=True)
        count = sum(len(group.views) for group in groups)
        cameras = read_cameras(tmp_path / name, ReaderReport())
        report = import_given_cameras(store, "demo", cameras, source="x", actor="ann")
        assert report.left_out.problems == []
        assert (report.unchanged, report.changed, report.problems) == (count, 0, [])
        # A camera means its own view whatever lies beside it.
        for key, camera in cameras.items():
            report = import_given_cameras(store, "demo", {key: camera}, source="x", actor="ann")
            assert (report.unchanged, report.changed, report.problems) == (1, 0, []), key
        known = index_frames(groups)
        found = read_predicted_cameras(tmp_path / name, known)
        assert (found.unknown, found.report.problems) == ({}, [])
        views = [view for group in groups for view in group.views]
        assert {
            number: camera.position[2].item() for number, camera in found.cameras.items()
        } == pytest.approx(
            {number: view.station.given.position[2] for number, view in enumerate(views)}
        )

    @pytest.mark.parametrize("scheme", TOLD_APART)
    @pytest.mark.parametrize("name", ["coco", "gamestate", "sn-calibration", "yolo"])
    def test_predictions_may_call_a_frame_as_an_export_does(
        self, store, fill, tmp_path: Path, name: str, scheme: str
    ) -> None:
        groups = made(scheme, tmp_path / "in")
        fill(*groups)
        export_dataset(store, "demo", name, tmp_path / "out", everything=True, images="copy")
        known = index_frames(groups)
        for file in filter(is_picture, on_disk(tmp_path / "out")):
            found = known.find(file)
            assert found is not None, known.explain_unknown_name(file)
            assert grey_of(tmp_path / "out" / file) == shade(found.id)


class TestLinks:
    def test_a_file_that_is_gone_is_missing_and_not_counted(
        self, store, fill, tmp_path: Path
    ) -> None:
        groups = made("alike", tmp_path / "in")
        fill(*groups)
        Path(groups[1].views[0].media.path).unlink()
        report = export_dataset(
            store, "demo", "coco", tmp_path / "out", everything=True, images="link"
        )
        assert report.missing_images == ("kick-1, north: the image file picture-2.png is missing",)
        assert report.counts["pictures"] == 5
        assert len([name for name in on_disk(tmp_path / "out") if is_picture(name)]) == 5
