"""Paint of a dataset's pictures: read, given, solved with, renewed and taken back."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.groups import pictures as paint_reading
from app.features.groups.edit import SetLines, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.queries import read_groups
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.edits_export import group_to_export_json
from app.features.imports.ingest import import_groups
from app.features.paint import service as editing
from app.features.paint.service import (
    read_paint_of_pictures,
    summarize_paint_readings,
    undo_paint_reading,
)
from app.features.policies.service import change_policy
from app.features.queue.service import list_groups
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.features.versions.freeze import FreezeRequest, freeze_dataset
from app.features.versions.verify import verify_version
from app.features.what_if.funnel import count_yield
from app.features.what_if.service import WhatIfStore
from app.media import files as media
from app.sample.render import render_view
from app.sample.scene import Scene
from app.soccer.annotation import BallAnnotation, Extras
from app.soccer.frames import ImagePoint
from app.soccer.group import Group, Media
from app.soccer.paint_evidence import NO_FRAME, NO_PAINT
from app.soccer.policy import PAPER, TOUCHLINE
from app.worker_pool import PoolTask
from tests.scenes import make_scenes


@cache
def scenes() -> list[Scene]:
    return make_scenes(2, 1, faults=False)


@pytest.fixture(scope="session")
def pictures(tmp_path_factory) -> Path:
    """The pictures of two groups, as they were rendered."""
    folder = tmp_path_factory.mktemp("pictures")
    for number, scene in enumerate(scenes()):
        for view in scene.group.views[:2]:
            cv2.imwrite(str(folder / f"{number}_{view.key}"), render_view(scene, view.key))
    return folder


def groups(folder: Path) -> list[Group]:
    """Two groups of a match with two views each, whose pictures lie in a folder."""
    found = []
    for number, scene in enumerate(scenes()):
        views = tuple(
            replace(view, media=Media(str(folder / f"{number}_{view.key}")))
            for view in scene.group.views[:2]
        )
        found.append(replace(scene.group, key=f"{number}", match="m", views=views))
    return found


class Here:
    """In place of processes: pictures are read where the test is, and counted."""

    read = 0

    def __init__(self, *_):
        pass

    def submit(self, work, *arguments, explain, bounded):
        task = PoolTask(explain)
        Here.read += 1
        task.future.set_result(work(*arguments))
        return task

    def close(self):
        pass


@pytest.fixture
def here(monkeypatch) -> Iterator[type[Here]]:
    monkeypatch.setattr(editing, "WorkerPool", Here)
    Here.read = 0
    yield Here


@pytest.fixture
def looked(monkeypatch) -> list[str]:
    """Keys of views whose pictures were looked at, not only compared."""
    seen: list[str] = []
    whole = paint_reading._read_paint_of_image

    def read(task, digest, image):
        seen.append(task.view.key)
        return whole(task, digest, image)

    monkeypatch.setattr(paint_reading, "_read_paint_of_image", read)
    return seen


@pytest.fixture
def painted(store, once, pictures, here) -> Store:
    """The two groups, their paint read, and solved."""

    def fill():
        import_groups(store, "demo", groups(pictures), source="files", actor="ann")
        solve_dataset(store, "demo")
        change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
        read_paint_of_pictures(store, "demo", actor="ann", run="first")
        solve_dataset(store, "demo")

    once("paint", fill)
    return store


def state(store):
    (item,) = summarize_paint_readings(store, "demo").items
    return item


def calibrations(store, number=1):
    return [view.calibration for view in load_group_state(store, number).solution.views]


def draw(store, number):
    """Edit the lines of a group's first view."""
    at = load_group_state(store, number)
    view = at.group.views[0]
    edit = SetLines(view.key, {next(iter(view.station.lines)): None})
    return submit_edit(store, number, edit, if_match=at.etag, actor="ann")


def kinds(store, number=1):
    said = load_group_state(store, number).solution.findings
    return [item.kind for item in said if item.kind in ("no_paint", "paint_disagrees")]


def inside(box, place):
    """Whether a place of paint lies well inside a box."""
    across, down = place.x - box.x, place.y - box.y
    return 2 < across < box.width - 2 and 2 < down < box.height - 2


class TestReadPaint:
    def test_is_refused_where_the_policy_would_not_use_it(self, store, pictures):
        import_groups(store, "demo", groups(pictures), source="files", actor="ann")
        with pytest.raises(ConflictError, match="does not use the paint"):
            read_paint_of_pictures(store, "demo", actor="ann")

    def test_an_unknown_match_is_refused(self, painted):
        with pytest.raises(NotFoundError, match="no match nowhere"):
            read_paint_of_pictures(painted, "demo", ["nowhere"], actor="ann")

    def test_cameras_lie_on_their_paint_and_nearer_to_the_truth(self, painted):
        item = state(painted)
        assert (item.groups, item.views, item.read, item.painted) == (2, 4, 4, 4)
        for number, scene in enumerate(scenes(), start=1):
            of_views = calibrations(painted, number)
            assert len(of_views) == 2
            for view, found in zip(scene.group.views, of_views, strict=False):
                truth = scene.truth.view(view.key).camera
                assert (found.source, found.paint.reason) == ("paint", None)
                assert found.paint.supported > 0.5 and found.paint.error_px < 0.2
                assert np.linalg.norm(found.camera.position - truth.position) < 0.25
        assert kinds(painted) == []

    def test_nothing_is_believed_where_the_dataset_has_people(self, painted):
        for number in (1, 2):
            group = load_group_state(painted, number).group
            for view in group.views:
                people = [box for box in view.extras.pixel_boxes if box.width * box.height < 2e4]
                believed = group.paint[view.key].evidence.points
                assert people and believed
                for places in believed.values():
                    assert not [place for place in places for box in people if inside(box, place)]

    def test_the_least_agreement_of_a_groups_views_is_in_the_queue(self, painted):
        rows = list_groups(painted, 1).items
        assert len(rows) == 2
        for row in rows:
            least = min(item.paint.agreement for item in calibrations(painted, row.id))
            assert row.agreement == least and 0.2 < least <= 1
        page = list_groups(painted, 1, "sort:agreement-desc agreement>0.2")
        assert [row.agreement for row in page.items] == sorted(
            (row.agreement for row in page.items), reverse=True
        )
        assert page.total == 2
        change_policy(painted, "demo", PAPER, if_match=None, actor="ann")
        solve_dataset(painted, "demo")
        assert list_groups(painted, 1, "agreement:none").total == 2

    def test_a_policy_may_ask_for_agreement_and_what_if_says_what_it_costs(self, painted):
        first, second = sorted(row.agreement for row in list_groups(painted, 1).items)
        yields = WhatIfStore(painted)
        for asked, passing in ((first, 2), (second, 1), (1.0, 0)):
            found = count_yield(yields, 1, {"min_agreement": asked})
            assert (found.passing, found.needs_solving) == (passing, ())
        assert "agreement" not in [step.gate for step in count_yield(yields, 1).funnel]
        strict = replace(TOUCHLINE, name="strict", min_agreement=1.0)
        change_policy(painted, "demo", strict, if_match=None, actor="ann")
        solve_dataset(painted, "demo")
        rows = list_groups(painted, 1, "gate:agreement").items
        assert [row.gate for row in rows] == ["agreement"] * 2
        assert load_group_state(painted, 1).solution.view(rows[0].gate_view).failed == "agreement"

    def test_what_was_read_is_not_read_again(self, painted, here, looked, monkeypatch):
        monkeypatch.setattr(media, "_decode_pixels", lambda *_: pytest.fail("it was decoded again"))
        read_paint_of_pictures(painted, "demo", actor="ann")
        assert (here.read, looked, list_stale_groups(painted, "demo")) == (4, [], [])
        assert [entry.kind for entry in read_history(painted, 1)] == ["import", "paint"]

    def test_an_edit_of_a_ball_leaves_cameras_and_paint(self, painted, here, looked):
        at = load_group_state(painted, 1)
        edit = make_set_ball_edit(
            at.group.views[0].key, BallAnnotation(point=ImagePoint(600.0, 400.0))
        )
        after = submit_edit(painted, 1, edit, if_match=at.etag, actor="ann")
        assert [view.calibration for view in after.solution.views] == calibrations(painted)
        assert after.group.paint == at.group.paint
        read_paint_of_pictures(painted, "demo", actor="ann")
        assert looked == []

    def test_an_edit_of_lines_falls_back_to_the_clicks_until_it_is_read_again(
        self, painted, looked
    ):
        after = draw(painted, 1)
        first, second = (view.calibration for view in after.solution.views)
        assert (first.source, first.paint, second.source) == ("lines", None, "paint")
        assert kinds(painted) == ["no_paint"]
        assert (state(painted).old, "1 to be read again" in state(painted).sentence) == (1, True)
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        assert state(painted).old == 0
        assert looked == [after.group.views[0].key]
        assert [item.source for item in calibrations(painted)] == ["paint", "paint"]

    def test_what_an_older_extractor_read_is_counted_and_read_again(
        self, painted, looked, monkeypatch
    ):
        monkeypatch.setattr(paint_reading, "EXTRACTOR_VERSION", "next")
        assert state(painted).old == 4
        read_paint_of_pictures(painted, "demo", actor="ann")
        assert len(looked) == 4

    def test_where_too_many_were_read_nobody_says_how_many_are_old(self, painted, monkeypatch):
        monkeypatch.setattr(editing, "MOST_COMPARED", 1)
        assert (state(painted).old, state(painted).read) == (None, 4)

    def test_undo_of_the_lines_brings_their_paint_back(self, painted):
        before = calibrations(painted)
        draw(painted, 1)
        undo_group_edit(painted, 1, if_match=load_group_state(painted, 1).etag, actor="ann")
        assert calibrations(painted) == before

    def test_where_other_people_hide_paint_now_it_is_read_again(self, painted, pictures, looked):
        first, other = groups(pictures)
        key = first.views[0].key
        boxes = first.views[0].extras.boxes
        assert len(boxes) > 1
        changed = first.with_view(
            replace(first.views[0], extras=replace(first.views[0].extras, boxes=boxes[1:]))
        )
        before = load_group_state(painted, 1)
        import_groups(painted, "demo", [changed, other], source="files", actor="ann")
        assert state(painted).old == 1
        solve_dataset(painted, "demo")
        after = load_group_state(painted, 1)
        assert [view.calibration.source for view in after.solution.views] == ["lines", "paint"]
        (finding,) = (item for item in after.solution.findings if item.kind == NO_PAINT)
        assert (finding.view, finding.fix.action) == (key, "read_paint")
        assert "boxes of its people" in finding.sentence
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        again = load_group_state(painted, 1)
        assert (looked, state(painted).old) == ([key], 0)
        assert [view.calibration.source for view in again.solution.views] == ["paint", "paint"]
        assert again.group.paint[key].people not in ("", before.group.paint[key].people)
        with painted.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_what_was_read_while_an_import_brought_other_people_is_old(
        self, painted, pictures, looked
    ):
        first, other = groups(pictures)
        reading = load_group_state(painted, 1).group.paint
        bare = replace(first, views=tuple(replace(view, extras=Extras()) for view in first.views))
        import_groups(painted, "demo", [bare, other], source="files", actor="ann")
        # What a process was at while that happened is given afterwards.
        with painted.write() as session:
            editing._save_reading_edits(session, 1, {1: reading}, "ann", {"run": "late"})
        solve_dataset(painted, "demo")
        assert state(painted).old == 2
        assert [item.source for item in calibrations(painted)] == ["lines", "lines"]
        assert kinds(painted) == ["no_paint"] * 2
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        assert (len(looked), state(painted).old) == (2, 0)
        assert [item.source for item in calibrations(painted)] == ["paint", "paint"]
        # What is had back was read beside those people, too.
        for _ in range(2):
            take_back(painted)
            solve_dataset(painted, "demo")
            assert [item.source for item in calibrations(painted)] == ["lines", "lines"]
        with painted.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_picture_that_changed_is_read_again(self, painted, pictures, tmp_path, looked):
        changed = groups(pictures)[0]
        file = Path(changed.views[0].media.path)
        other = tmp_path / file.name
        picture = cv2.imread(str(file))
        cv2.imwrite(str(other), np.full_like(picture, 127))
        view = replace(changed.views[0], media=Media(str(other)))
        import_groups(painted, "demo", [changed.with_view(view)], source="files", actor="ann")
        assert len(load_group_state(painted, 1).group.paint) == 2
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        assert looked == [view.key]
        assert load_group_state(painted, 1).group.paint[view.key].reason == NO_PAINT
        assert calibrations(painted)[0].source == "lines"

    def test_a_picture_that_is_gone_keeps_what_was_read_of_it(self, painted, pictures, tmp_path):
        changed = groups(pictures)[0]
        view = replace(changed.views[0], media=Media(str(tmp_path / "gone.png")))
        import_groups(painted, "demo", [changed.with_view(view)], source="files", actor="ann")
        read_paint_of_pictures(painted, "demo", actor="ann")
        assert load_group_state(painted, 1).group.paint[view.key].reason is None
        draw(painted, 1)
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        assert load_group_state(painted, 1).group.paint[view.key].reason == NO_FRAME
        assert "missing" in load_group_state(painted, 1).solution.findings[-1].sentence
        assert "1 missing or unreadable" in state(painted).sentence

    def test_a_view_that_never_had_a_picture_has_the_camera_of_its_clicks_and_no_finding(
        self, store, pictures, here
    ):
        first, second = groups(pictures)
        bare = first.with_view(replace(first.views[0], media=None))
        import_groups(store, "demo", [bare, second], source="files", actor="ann")
        change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
        read_paint_of_pictures(store, "demo", actor="ann")
        solve_dataset(store, "demo")
        assert [item.source for item in calibrations(store)] == ["lines", "paint"]
        assert kinds(store) == []
        item = state(store)
        assert (item.views, item.without_picture, item.read) == (4, 1, 3)
        assert item.sentence == "3 of 3 pictures were read: 3 by their paint, 1 without a picture"

    def test_mirrored_and_smaller_pictures_are_read_as_they_were_annotated(
        self, painted, pictures, tmp_path
    ):
        changed = groups(pictures)[0]
        file = changed.views[0].media.path
        picture = cv2.flip(cv2.imread(file), 1)
        cv2.imwrite(str(tmp_path / "half.png"), cv2.resize(picture, (960, 540)))
        view = replace(
            changed.views[0],
            media=Media(str(tmp_path / "half.png")),
            station=replace(changed.views[0].station, flipped=True),
        )
        import_groups(painted, "demo", [changed.with_view(view)], source="files", actor="ann")
        read_paint_of_pictures(painted, "demo", actor="ann")
        solve_dataset(painted, "demo")
        found, truth = calibrations(painted)[0], scenes()[0].truth.view(view.key).camera
        assert found.source == "paint"
        assert np.linalg.norm(found.camera.position - truth.position) < 0.5

    def test_a_run_that_ends_early_is_taken_up_where_it_was(
        self, store, pictures, here, looked, monkeypatch
    ):
        import_groups(store, "demo", groups(pictures), source="files", actor="ann")
        change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
        monkeypatch.setattr(editing, "_PER_WORKER", 1)

        def stop(done, _total):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            read_paint_of_pictures(store, "demo", actor="ann", workers=1, progress=stop)
        assert (len(looked), state(store).read) == (2, 2)
        read_paint_of_pictures(store, "demo", actor="ann", workers=1)
        assert (len(looked), state(store).read) == (4, 4)

    def test_pictures_are_read_in_processes_of_their_own(self, store, pictures, looked):
        import_groups(store, "demo", groups(pictures)[:1], source="files", actor="ann")
        change_policy(store, "demo", TOUCHLINE, if_match=None, actor="ann")
        read_paint_of_pictures(store, "demo", actor="ann", workers=1)
        assert (state(store).painted, looked) == (2, [])


class TestKept:
    def test_the_log_tells_it_again(self, painted):
        with painted.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        before = load_group_state(painted, 1).stored
        rebuild_tables(painted)
        assert load_group_state(painted, 1).stored == before

    def test_without_paint_reading_groups_costs_no_statement_more(self, store, pictures, counted):
        import_groups(store, "demo", groups(pictures), source="files", actor="ann")
        with counted(store) as cost, store.read() as session:
            read_groups(session, [1, 2])
        assert cost.statements == 1

    def test_a_version_holds_it_and_is_verified_without_pictures(self, painted, pictures):
        version = freeze_dataset(
            painted, "demo", FreezeRequest("one", groups="passing"), actor="ann"
        )
        take_back(painted)
        report = verify_version(painted, version.id)
        assert (report.ok, report.groups) == (True, int(version.counts["groups"]))
        assert report.groups > 0

    def test_another_policy_leaves_it_and_solves_with_the_clicks(self, painted):
        before = load_group_state(painted, 1).group.paint
        change_policy(painted, "demo", PAPER, if_match=None, actor="ann")
        solve_dataset(painted, "demo")
        assert load_group_state(painted, 1).group.paint == before
        assert [item.source for item in calibrations(painted)] == ["lines", "lines"]

    def test_it_does_not_go_to_another_installation(self, painted):
        assert "paint" not in group_to_export_json(load_group_state(painted, 1).group)

    def test_an_import_keeps_it(self, painted, pictures):
        changed = replace(groups(pictures)[0], label="the source says more of it now")
        import_groups(painted, "demo", [changed], source="files", actor="ann")
        assert len(load_group_state(painted, 1).group.paint) == 2
        with painted.read() as session:
            assert replay_log(session) == read_state_snapshot(session)


def take_back(store):
    with store.write() as session:
        undo_paint_reading(session, "demo", actor="ann")


class TestTakeBackPaint:
    def test_cameras_are_again_those_of_the_clicks(self, painted):
        take_back(painted)
        solve_dataset(painted, "demo")
        assert (state(painted).read, load_group_state(painted, 1).group.paint) == (0, {})
        assert [item.source for item in calibrations(painted)] == ["lines", "lines"]

    def test_each_reading_is_taken_back_once_the_newest_first(self, painted):
        first = load_group_state(painted, 1).group.paint
        draw(painted, 1)
        read_paint_of_pictures(painted, "demo", actor="ann", run="second")
        assert load_group_state(painted, 1).group.paint != first
        take_back(painted)
        assert load_group_state(painted, 1).group.paint == first
        take_back(painted)
        assert state(painted).read == 0
        with pytest.raises(ConflictError, match="has a measurement of its paint"):
            take_back(painted)
