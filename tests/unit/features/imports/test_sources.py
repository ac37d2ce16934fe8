from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from sqlalchemy import select

from app.db.log import LogModel
from app.db.store import Store
from app.errors import InputError
from app.features.datasets.service import dataset_id, get_dataset, list_datasets
from app.features.datasets.tables import GroupModel
from app.features.exports.service import export_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import (
    UnassignedFrame,
    import_groups,
    import_unassigned_frames,
    read_unassigned_frames,
)
from app.features.imports.sources import FORMATS, USERS, ImportSource, import_source
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.formats import issia
from app.formats.soccernet_v3_writer import write_soccernet_v3
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import Box, ImageSize
from app.soccer.group import Group
from tests.cameras import write_cameras
from tests.unit.formats.test_issia import issia_folder

SIZE = ImageSize(1280, 720)
Fill = Callable[..., list[int]]
Make = Callable[..., Group]


def groups_of(store: Store, dataset: str) -> dict[str, Group]:
    page = list_groups(store, get_dataset(store, dataset).id, limit=500)
    groups = (load_group_state(store, row.id).group for row in page.items)
    return {group.key: group for group in groups}


def hashes(store: Store, dataset: str) -> dict[str, str]:
    found = get_dataset(store, dataset)
    with store.read() as session:
        rows = session.execute(
            select(GroupModel.key, GroupModel.source_hash).where(GroupModel.dataset_id == found.id)
        )
        return {row.key: row.source_hash for row in rows}


def there_and_back(store: Store, form: str, out: Path, **options: object) -> dict[str, Group]:
    """Export "demo" and import what was written as "again"."""
    export_dataset(store, "demo", form, out, everything=True)
    size = SIZE if form in USERS["size"] else None
    source = ImportSource(form, out, size=size, **options)  # type: ignore[arg-type]
    imported = import_source(store, "again", source, store.settings)
    assert imported.report.problems == []
    return groups_of(store, "again")


def bare(group: Group, **changes: object) -> Group:
    """A group without what a format has no place for."""
    views = []
    for view in group.views:
        station = replace(view.station, **changes)  # type: ignore[arg-type]
        views.append(replace(view, station=station, media=None, extras=Extras()))
    return replace(group, views=tuple(views), label="")


@pytest.fixture
def broadcast(fill: Fill, make_group: Make) -> list[int]:
    return fill(make_group(7), make_group(8, split="test"))


class TestThereAndBack:
    """Import, export, import: the same state, in a folder and in a zip."""

    @pytest.mark.parametrize("out", ["out", "out.zip"])
    @pytest.mark.parametrize("form", ["coco", "parquet"])
    def test_everything_that_people_said_comes_back(
        self, store, broadcast, tmp_path, form, out
    ) -> None:
        again = there_and_back(store, form, tmp_path / out)
        for key, group in groups_of(store, "demo").items():
            assert bare(again[key]) == bare(group)
            assert (again[key].label, again[key].split) == (group.label, group.split)

    def test_parquet_keeps_what_the_ball_pipeline_does_not_use(
        self, store, broadcast, tmp_path
    ) -> None:
        again = there_and_back(store, "parquet", tmp_path / "out")
        for key, group in groups_of(store, "demo").items():
            assert [view.extras for view in again[key].views] == [
                view.extras for view in group.views
            ]

    def test_soccernet_v3_has_all_but_the_cameras(self, store, broadcast, tmp_path) -> None:
        again = there_and_back(store, "soccernet-v3", tmp_path / "out")
        for key, group in groups_of(store, "demo").items():
            assert bare(again[key]) == bare(group, given=None)

    def test_soccernet_v3d_has_the_cameras_and_the_annotated_boxes(
        self, store, broadcast, tmp_path
    ) -> None:
        again = there_and_back(store, "soccernet-v3d", tmp_path / "out.zip")
        for key, group in groups_of(store, "demo").items():
            assert bare(again[key]) == bare(group)

    @pytest.mark.parametrize("form", ["soccernet-v3", "soccernet-v3d", "gamestate", "parquet"])
    def test_the_second_time_every_byte_is_the_same(
        self, store, broadcast, tmp_path, form: str
    ) -> None:
        there_and_back(store, form, tmp_path / "first")
        solve_dataset(store, "again")
        export_dataset(store, "again", form, tmp_path / "second", everything=True)
        again = ImportSource(
            form, tmp_path / "second", size=SIZE if form in USERS["size"] else None
        )
        imported = import_source(store, "third", again, store.settings)
        assert imported.result.new == len(groups_of(store, "again"))
        assert hashes(store, "third") == hashes(store, "again")

    def test_gamestate_has_an_image_a_view(self, store, broadcast, tmp_path) -> None:
        again = there_and_back(store, "gamestate", tmp_path / "out")
        balls = [view.balls for group in again.values() for view in group.views]
        first = [view.balls for group in groups_of(store, "demo").values() for view in group.views]
        assert balls == first

    def test_sn_calibration_has_lines_and_matches(self, store, tmp_path) -> None:
        lines = make_lines({"Side line top": [(0.0, 80.25), (1279.0, 85.5)]})
        for name in ("00002", "00005"):
            text = {"Side line top": [{"x": 0.25, "y": 0.5}, {"x": 1.125, "y": 0.75}]}
            (tmp_path / f"{name}.json").write_text(json.dumps(text))
        info = {"00002.jpg": {"league": "l", "season": "s", "match": "m", "ms_time": 7}}
        (tmp_path / "match_info.json").write_text(json.dumps(info))
        source = ImportSource("sn-calibration", tmp_path, size=SIZE)
        import_source(store, "demo", source, store.settings)
        again = there_and_back(store, "sn-calibration", tmp_path / "out")
        assert hashes(store, "again") == hashes(store, "demo")
        assert again["00002"].match == "l/s/m"
        assert lines.keys() == again["00002"].views[0].station.lines.keys()

    @pytest.mark.parametrize("out", ["out", "out.zip"])
    def test_issia_in_its_original_shape(self, store, fill, make_static, tmp_path, out) -> None:
        person = {
            "class": "Person",
            "ID": "12",
            "points": {"x1": 10.0, "y1": 20.0, "x2": 40.0, "y2": 90.0},
        }
        group = make_static(10)
        first = replace(group.views[0], extras=Extras((person,), (), {"ball": {"SHOT": "true"}}))
        fill(replace(group, views=(first, *group.views[1:])), make_static(-3))
        spare = UnassignedFrame("cam2", "99", Extras(boxes=(person,)))
        import_unassigned_frames(store, "demo", [spare], source="test", actor="ann")
        again = there_and_back(store, "issia", tmp_path / out)
        with store.read() as session:
            assert list(read_unassigned_frames(session, dataset_id(store, "again"))) == [spare]
        for key, group in groups_of(store, "demo").items():
            views = [replace(view, media=None) for view in group.views]
            assert list(again[key].views) == views

    def test_issia_3d_has_the_centres_and_the_cameras(
        self, store, fill, make_static, tmp_path
    ) -> None:
        fill(make_static(10), make_static(2))
        again = there_and_back(store, "issia-3d", tmp_path / "out")
        assert list(again) == ["2", "10"]
        for key, group in groups_of(store, "demo").items():
            assert bare(again[key]) == bare(group, lines={})

    def test_cameras_go_where_they_came_from(self, store, fill, make_group, tmp_path) -> None:
        fill(make_group(7))
        export_dataset(store, "demo", "cameras", tmp_path / "out", everything=True)
        views = [
            replace(view, station=replace(view.station, given=None)) for view in make_group(7).views
        ]
        store_groups = [replace(make_group(7), views=tuple(views))]
        import_groups(store, "again", store_groups, source="test", actor="ann")
        source = ImportSource("cameras", tmp_path / "out")
        imported = import_source(store, "again", source, store.settings)
        assert (imported.result.changed, imported.result.problems) == (2, [])
        (again,), (group,) = (groups_of(store, name).values() for name in ("again", "demo"))
        assert [view.station.given for view in again.views] == [
            view.station.given for view in group.views
        ]


class TestImportSource:
    def test_every_format_says_when_there_is_nothing_of_it(self, store, tmp_path) -> None:
        (tmp_path / "readme.txt").write_text("nothing here")
        for form in FORMATS:
            if form in ("cameras", "sn-calibration"):
                continue
            imported = import_source(store, "demo", ImportSource(form, tmp_path), store.settings)
            assert len(imported.report.problems) == 1, form
            assert not imported.imported_anything
        assert list_datasets(store) == []

    @pytest.mark.parametrize(
        ("name", "problem", "hint"),
        [
            (
                "match.mp4",
                "holds a video, which is a recording",
                "Bring it in with `touchline import video",
            ),
            ("still.jpg", "holds pictures and no annotations", "Import them as frames"),
        ],
    )
    def test_pictures_and_videos_are_told_in_a_sentence_of_their_own(
        self, store, tmp_path, name, problem, hint
    ) -> None:
        (tmp_path / name).write_bytes(b"x")
        for form in FORMATS:
            # Cameras are brought to a dataset that is there.
            if form == "cameras" or (form == "frames" and name == "still.jpg"):
                continue
            for path in (tmp_path, tmp_path / name):
                imported = import_source(store, "demo", ImportSource(form, path), store.settings)
                sentence, advice = imported.explain_nothing_imported()
                assert sentence == f"nothing could be imported: {path} {problem}", form
                assert advice.startswith(hint)
                (skipped,) = imported.to_report_values()["skipped"]
                assert skipped["problem"] == problem
        assert list_datasets(store) == []

    def test_pictures_become_groups_of_one_view(self, store, tmp_path) -> None:
        for name in ("a.jpg", "b.jpg"):
            Image.new("RGB", (128, 72)).save(tmp_path / name)
        imported = import_source(store, "demo", ImportSource("frames", tmp_path), store.settings)
        assert (imported.complete, imported.result.new) == (True, 2)
        found = groups_of(store, "demo")
        assert {key: group.views[0].size for key, group in found.items()} == {
            "a.jpg": ImageSize(128, 72),
            "b.jpg": ImageSize(128, 72),
        }
        again = import_source(store, "demo", ImportSource("frames", tmp_path), store.settings)
        assert (again.result.new, again.result.unchanged) == (0, 2)

    def test_an_import_that_was_killed_ends_in_the_same_state(
        self, store, make_group, tmp_path, monkeypatch
    ) -> None:
        _write_labels(store, make_group, tmp_path)
        monkeypatch.setattr("app.features.imports.ingest.BATCH", 2)

        def kill(done: int) -> None:
            raise KeyboardInterrupt

        source = ImportSource("soccernet-v3", tmp_path)
        with pytest.raises(KeyboardInterrupt):
            import_source(store, "demo", source, store.settings, kill)
        assert get_dataset(store, "demo").groups == 2
        imported = import_source(store, "demo", source, store.settings)
        assert (imported.result.new, imported.result.unchanged) == (3, 2)
        import_source(store, "whole", source, store.settings)
        assert hashes(store, "demo") == hashes(store, "whole")

    def test_lines_of_too_many_points_are_told_and_the_rest_is_imported(
        self, store, tmp_path
    ) -> None:
        dense = [{"x": place / 2000, "y": 0.5} for place in range(2000)]
        lines = {"Middle line": dense, "Side line top": dense[:2]}
        (tmp_path / "00002.json").write_text(json.dumps(lines))
        source = ImportSource("sn-calibration", tmp_path, size=SIZE)
        imported = import_source(store, "demo", source, store.settings)
        values = imported.to_report_values()
        assert (values["new"], values["outcome"]) == (1, "partial")
        assert [(item["record"], item["field"]) for item in values["skipped"]] == [
            ("00002", "view 00002, Middle line")
        ]
        (group,) = groups_of(store, "demo").values()
        assert group.views[0].station.lines.keys() == {"Side line top"}


class TestDryRun:
    def test_says_what_would_happen_and_keeps_nothing(self, store, make_group, tmp_path) -> None:
        _write_labels(store, make_group, tmp_path)
        source = ImportSource("soccernet-v3", tmp_path)
        dry = import_source(store, "demo", source, store.settings, dry_run=True)
        assert list_datasets(store) == []
        assert _log_size(store) == 0
        done = import_source(store, "demo", source, store.settings)
        assert dry.to_report_values() == done.to_report_values()

    def test_counts_changes_and_findings_as_the_import_does(
        self, store, make_group, tmp_path
    ) -> None:
        root = _write_labels(store, make_group, tmp_path)
        source = ImportSource("soccernet-v3", tmp_path)
        import_source(store, "demo", source, store.settings)
        first = list_groups(store, get_dataset(store, "demo").id, limit=1).items[0].id
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        state = load_group_state(store, first)
        submit_edit(store, first, make_set_ball_edit(state.group.views[0].key, ball), if_match=state.etag,
               actor="ben")  # fmt: skip
        labels = json.loads(root.read_text())
        for number in (1, 2):
            labels["actions"][f"{number}.png"]["bboxes"][0]["points"]["x1"] -= 2
        root.write_text(json.dumps(labels))
        before = (hashes(store, "demo"), _log_size(store))
        dry = import_source(store, "demo", source, store.settings, dry_run=True)
        assert (hashes(store, "demo"), _log_size(store)) == before
        assert (dry.result.changed, dry.result.findings, dry.result.unchanged) == (2, 1, 3)
        done = import_source(store, "demo", source, store.settings)
        assert dry.to_report_values() == done.to_report_values()

    def test_a_shared_station_that_changed_counts_once(
        self, store, make_static, tmp_path, monkeypatch, fill
    ) -> None:
        monkeypatch.setattr("app.features.imports.ingest.BATCH", 1)
        fill(make_static(1), make_static(2), make_static(3), solved=False)
        export_dataset(store, "demo", "issia-3d", tmp_path, everything=True)
        import_source(store, "again", ImportSource("issia-3d", tmp_path), store.settings)
        wider = ImportSource("issia-3d", tmp_path, size=ImageSize(1921, 1080))
        dry = import_source(store, "again", wider, store.settings, dry_run=True)
        assert (dry.result.changed, dry.result.unchanged) == (3, 3)
        done = import_source(store, "again", wider, store.settings)
        assert done.result == dry.result

    def test_cameras_are_not_attached(self, store, fill, make_group, tmp_path, opposite) -> None:
        fill(make_group(7), solved=False)
        write_cameras(tmp_path, {"7": opposite})
        before = groups_of(store, "demo")
        dry = import_source(
            store, "demo", ImportSource("cameras", tmp_path), store.settings, dry_run=True
        )
        assert dry.result.changed == 1
        assert groups_of(store, "demo") == before


class TestSource:
    def test_a_source_with_a_name_does_not_tell_where_it_lies(self, store, tmp_path) -> None:
        (tmp_path / "Labels-v3.json").write_text("{")
        source = ImportSource("soccernet-v3", tmp_path, name="mine")
        imported = import_source(store, "demo", source, store.settings)
        text = json.dumps(imported.to_report_values())
        assert str(tmp_path) not in text
        assert imported.to_report_values()["skipped"][0]["file"] == "Labels-v3.json"


def _write_labels(store: Store, make_group: Make, root: Path) -> Path:
    """A tree of one match with five groups; its labels file."""
    groups = [make_group(number) for number in range(1, 6)]
    (path,) = write_soccernet_v3(root, groups)
    return path


def _log_size(store: Store) -> int:
    with store.read() as session:
        return len(session.scalars(select(LogModel.id)).all())


class TestRemarks:
    def test_files_without_any_ball_say_so_with_what_they_have(
        self, store: Store, tmp_path: Path
    ) -> None:
        box = {"class": "Player team left", "points": {"x1": 1, "y1": 2, "x2": 3, "y2": 4}}
        image = {"imageMetadata": {"width": 1280, "height": 720}, "bboxes": [box], "lines": []}
        (tmp_path / "Labels-v3.json").write_text(json.dumps({"actions": {"7.png": image}}))
        imported = import_source(store, "x", ImportSource("soccernet-v3", tmp_path), store.settings)
        assert imported.to_report_values()["remarks"][0] == (
            'no ball was read from the 1 group; its boxes are of "Player team left" (1)'
        )

    def test_a_category_that_is_named_is_the_ball_and_the_report_says_so(
        self, store: Store, tmp_path: Path
    ) -> None:
        value = {
            "images": [{"id": 1, "file_name": "a.jpg", "width": 1280, "height": 720}],
            "annotations": [{"id": 1, "image_id": 1.0, "category_id": "7", "bbox": [1, 2, 3, 4]}],
            "categories": [{"id": 7, "name": "thing"}],
        }
        (tmp_path / "x.json").write_text(json.dumps(value))
        plain = ImportSource("coco", tmp_path, name="up.zip")
        dry = import_source(store, "x", plain, store.settings, dry_run=True).to_report_values()
        assert (dry["outcome"], dry["skipped"][0]["field"]) == ("partial", "categories")
        named = replace(plain, ball_category="Thing")
        imported = import_source(store, "x", named, store.settings)
        assert (
            'x.json: category "thing" is the ball (1 annotation)'
            in imported.to_report_values()["remarks"]
        )
        (group,) = groups_of(store, "x").values()
        assert len(group.views[0].balls) == 1

    def test_what_files_are_is_said_where_nothing_can_be_read(
        self, store: Store, tmp_path: Path
    ) -> None:
        (tmp_path / "a.json").write_text(json.dumps({"shapes": [], "imagePath": "a.jpg"}))
        imported = import_source(store, "x", ImportSource("coco", tmp_path), store.settings)
        assert imported.explain_nothing_imported()[1].startswith("It looks like LabelMe")

    @pytest.mark.parametrize(
        ("value", "advice"),
        [
            ({"images": [], "annotations": []}, "import it as coco"),
            ({"images": [], "annotations": [{"bbox_image": {}}]}, "import it as gamestate"),
            ({"pan_degrees": 1.0}, "import it as cameras"),
            ({"actions": {"1.png": {"imageMetadata": {}}}}, "import it as soccernet-v3"),
            ([{"image_id": 1, "bbox": [1, 2, 3, 4], "score": 1}], "touchline evaluate"),
            ({"shapes": [], "imagePath": "a.jpg"}, "export it as COCO"),
        ],
    )
    def test_what_files_are_is_said_once(
        self, store: Store, tmp_path: Path, value: object, advice: str
    ) -> None:
        (tmp_path / "x.json").write_text(json.dumps(value))
        imported = import_source(
            store, "x", ImportSource("sn-calibration", tmp_path), store.settings
        )
        sentence, hint = imported.explain_nothing_imported()
        assert (advice in sentence, "looks like" in hint) == (True, False)


class TestCheck:
    @pytest.mark.parametrize("form", FORMATS)
    @pytest.mark.parametrize(
        ("name", "value", "typed"),
        [
            ("calibration", "lines", "--calibration"),
            ("size", SIZE, "--size"),
            ("lines", Path("lines"), "--lines"),
            ("frame_offset", {1: 9}, "--frame-offset"),
            ("flipped", frozenset({2}), "--flip"),
            ("ball_category", "ball", "--ball-category"),
            ("frames", Path("list.json"), "--frames"),
            ("propose", False, "--no-propose"),
        ],
    )
    def test_an_option_that_a_format_does_not_use_is_refused(
        self, form: str, name: str, value: object, typed: str
    ) -> None:
        source = replace(ImportSource(form, Path("x")), **{name: value})  # type: ignore[arg-type]
        if form in USERS[name]:
            source.require_used_options()
            return
        with pytest.raises(InputError, match=f"^{form} does not use {typed}$") as caught:
            source.require_used_options()
        assert caught.value.pointer == f"/options/{name}"

    @pytest.mark.parametrize("form", ["cameras", "touchline"])
    def test_what_makes_no_dataset_takes_no_policy(self, form: str) -> None:
        with pytest.raises(InputError, match="does not use --policy"):
            ImportSource(form, Path("x")).require_used_options(policy=True)

    def test_the_browser_offers_the_options_that_a_format_uses(self) -> None:
        text = Path("static/state/import_formats.js").read_text(encoding="utf-8")
        names = {"CALIBRATION": "calibration", "SIZE": "size", "OFFSET": "frame_offset"}
        names |= {"FLIPPED": "flipped", "CATEGORY": "ball_category", "GROUPING": "grouping"}
        names["PROPOSE"] = "propose"
        offered = re.findall(
            r"name: '([a-z0-9-]+)', label: .*?, options: \[(.*?)\]( , lines|, lines)?", text
        )
        assert len(offered) > 5
        for form, options, lines in offered:
            found = {names[name] for name in re.findall(r"[A-Z]{4,}", options)}
            found |= {"lines"} if lines else set()
            assert found == {name for name in USERS if form in USERS[name]} - {"frames", "policy"}

    def test_nothing_is_imported_then(self, store: Store, tmp_path: Path) -> None:
        source = ImportSource("coco", tmp_path, size=SIZE)
        with pytest.raises(InputError, match="coco does not use --size"):
            import_source(store, "new", source, store.settings)
        assert list_datasets(store) == []


class TestLinesOfAnotherDay:
    """Lines of static cameras that do not fit the cameras that were given."""

    @pytest.fixture
    def source(self, tmp_path: Path) -> ImportSource:
        """Two cameras, both given, and lines that were drawn before they were moved."""
        folder, lines = issia_folder(tmp_path / "issia"), tmp_path / "lines"
        lines.mkdir()
        for name in ("cam1", "cam2"):
            points = [{"x": 100.0 + 90 * n, "y": 900.0 - 7 * n * n} for n in range(9)]
            drawn = {"Middle line": points[:4], "Side line top": points[4:]}
            (lines / f"{name}.json").write_text(json.dumps(drawn))
        return ImportSource("issia", folder, lines=lines)

    def test_import_and_solve_say_what_does_not_pass_and_how_to_take_the_given(
        self, store: Store, source: ImportSource
    ) -> None:
        imported = import_source(store, "old", source, store.settings)
        (told,) = [text for text in imported.report.remarks if "do not fit" in text]
        assert told.startswith(
            "The lines of cam1, cam2 do not fit the given calibration (JaC 0.00): 1 of 1"
        )
        assert (
            f"`touchline import issia {source.path} --dataset old --lines {source.lines} "
            "--calibration given` uses the given cameras"
        ) in told
        solved = solve_dataset(store, "old")
        assert (solved.passed, solved.failing) == (0, {"jac": 1})
        assert (
            "0 pass, 1 do not (first failing gate: jac 1); 0 errors. The lines of"
            in solved.sentence
        )
        assert "1 of 1 groups fail first at the gate jac" in solved.sentence
        assert "importing the files again with `--calibration given`" in solved.sentence

    def test_given_asked_for_leaves_them_aside_also_those_of_before(
        self, store: Store, source: ImportSource
    ) -> None:
        import_source(store, "old", source, store.settings)
        given = replace(source, calibration="given")
        for name in ("old", "new"):
            imported = import_source(store, name, given, store.settings)
            assert not [text for text in imported.report.remarks if "do not fit" in text]
            solved = solve_dataset(store, name)
            assert (solved.solved, solved.failing["jac"], solved.advice) == (1, 0, "")
            (group,) = groups_of(store, name).values()
            assert [(view.station.lines, view.station.calibration) for view in group.views] == [
                ({}, "given"), ({}, "given"),
            ]  # fmt: skip

    def test_without_the_option_lines_of_an_earlier_import_stay(
        self, store: Store, source: ImportSource
    ) -> None:
        import_source(store, "old", source, store.settings)
        import_source(store, "old", replace(source, lines=None), store.settings)
        (group,) = groups_of(store, "old").values()
        assert all(view.station.lines for view in group.views)


class TestWhatIsLeftOut:
    def test_a_camera_that_fits_nothing_makes_an_import_one_in_part(
        self, store: Store, fill: Fill, make_group: Make, tmp_path: Path, opposite
    ) -> None:
        fill(make_group(7))
        (tmp_path / "cameras").mkdir()
        write_cameras(tmp_path / "cameras", {"7": opposite, "99": opposite})
        source = ImportSource("cameras", tmp_path / "cameras")
        imported = import_source(store, "demo", source, store.settings)
        values = imported.to_report_values()
        assert (values["outcome"], values["changed"]) == ("partial", 1)
        (skipped,) = values["skipped"]
        assert skipped["record"] == 'camera "99"'
        assert "no view has this name" in skipped["problem"]


class TestMirroredPeople:
    """People of ISSIA's camera 2, who are mirrored in its files (``formats.issia``)."""

    def test_importing_again_mends_a_dataset_of_before_and_turns_nobody_twice(
        self, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        source = ImportSource("issia", issia_folder(tmp_path / "issia"))

        def people() -> list[list[float]]:
            (group,) = groups_of(store, "old").values()
            view = group.view("cam2")
            assert view is not None
            dataset = get_dataset(store, "old").id
            with store.read() as session:
                spare = [
                    one for one in read_unassigned_frames(session, dataset) if one.camera == "cam2"
                ]
            every = (view.extras, *(one.extras for one in spare))
            return [[box["points"]["x1"] for box in extras.boxes] for extras in every]

        with monkeypatch.context() as before:
            before.setattr(issia, "MIRRORED", frozenset())
            import_source(store, "old", source, store.settings)
        mirrored = people()
        again = import_source(store, "old", source, store.settings)
        assert again.result.changed == 1
        right = [[1920 - 20.0 - x for x in frame] for frame in mirrored]
        assert np.array(people()) == pytest.approx(np.array(right))
        third = import_source(store, "old", source, store.settings)
        assert (third.result.changed, third.result.unchanged) == (0, 1)
        assert np.array(people()) == pytest.approx(np.array(right))
