"""What becomes of a person's work when other files come under the same names."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from app.db.store import Store
from app.features.datasets.service import get_dataset
from app.features.groups.edit import make_set_ball_edit
from app.features.groups.replay import replay_log
from app.features.groups.state import GroupState
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.imports.ingest import IngestReport, import_groups
from app.features.imports.sources import ImportSource, import_source
from app.features.queue.service import list_groups
from app.features.verdicts.service import set_verdict
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box
from app.soccer.group import Group, Media

BALL = BallAnnotation(box=Box(300.0, 100.0, 12.0, 12.0))
TOP = {"Side line top": [{"x": 0.1, "y": 0.2}, {"x": 0.9, "y": 0.2}]}
BOTTOM = {"Side line bottom": [{"x": 0.1, "y": 0.8}, {"x": 0.9, "y": 0.8}]}


def picture(colour: tuple[int, int, int], size: tuple[int, int] = (640, 360)) -> bytes:
    file = io.BytesIO()
    Image.new("RGB", size, colour).save(file, "JPEG")
    return file.getvalue()


RED, BLUE = picture((200, 0, 0)), picture((0, 0, 200), (800, 450))


def zipped(path: Path, members: Mapping[str, object]) -> Path:
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content if isinstance(content, bytes) else json.dumps(content))
    return path


def bring(store: Store, path: Path, form: str = "frames", *, dry_run: bool = False) -> IngestReport:
    """Import, under the name of the file alone, as uploads are."""
    source = ImportSource(form, path, name=path.name)
    return import_source(store, "cup", source, store.settings, dry_run=dry_run).result


def first_group(store: Store) -> GroupState:
    (row, *_) = list_groups(store, get_dataset(store, "cup").id, limit=9).items
    return load_group_state(store, row.id)


def draw_ball(store: Store) -> GroupState:
    state = first_group(store)
    edit = make_set_ball_edit(state.group.views[0].key, BALL)
    submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
    return first_group(store)


class TestOtherPictures:
    def test_the_picture_on_which_a_person_worked_stays_and_it_is_said(
        self, store: Store, tmp_path: Path
    ) -> None:
        bring(store, zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED}))
        before = draw_ball(store).group
        other = zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": BLUE})
        assert bring(store, other, dry_run=True).findings == 1
        report = bring(store, other)
        assert (report.changed, report.findings) == (1, 1)
        state = first_group(store)
        assert state.group == before
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        again = bring(store, other)
        assert (again.unchanged, again.findings) == (1, 0)

    def test_the_same_picture_in_another_file_is_followed(
        self, store: Store, tmp_path: Path
    ) -> None:
        bring(store, zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED}))
        draw_ball(store)
        moved = zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": RED})
        assert bring(store, moved).findings == 0
        (view,) = first_group(store).group.views
        assert view.media is not None
        assert (view.media.path, view.balls) == (str(moved), (BALL,))

    def test_the_picture_of_a_file_that_is_gone_is_followed(
        self, store: Store, tmp_path: Path
    ) -> None:
        gone = zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED})
        bring(store, gone)
        draw_ball(store)
        gone.unlink()
        assert bring(store, zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": BLUE})).findings == 0

    def test_a_corrected_picture_on_which_nobody_worked_is_followed(
        self, store: Store, tmp_path: Path
    ) -> None:
        bring(store, zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED}))
        mended = zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": BLUE})
        assert bring(store, mended).findings == 0
        (view,) = first_group(store).group.views
        assert view.media is not None
        assert (view.media.path, view.size.width) == (str(mended), 800)

    def test_loose_files_of_one_length_are_compared_by_what_they_hold(
        self, store: Store, tmp_path: Path
    ) -> None:
        for folder, end in (("a", b"\x01"), ("b", b"\x02")):
            (tmp_path / folder / "pics").mkdir(parents=True)
            (tmp_path / folder / "pics" / "0001.jpg").write_bytes(RED + end)
        bring(store, tmp_path / "a" / "pics")
        before = draw_ball(store).group
        assert bring(store, tmp_path / "b" / "pics").findings == 1
        assert first_group(store).group == before


class TestOtherFrames:
    def test_an_edited_view_of_a_video_follows_its_camera_and_is_to_be_checked(
        self,
        store: Store,
        fill: Callable[..., list[int]],
        make_static: Callable[..., Group],
        tmp_path: Path,
    ) -> None:
        def at(frame: int) -> Group:
            group = make_static(10)
            media = Media(str(tmp_path / "cam1.mp4"), frame=frame)
            return group.with_view(replace(group.views[0], media=media))

        (number,) = fill(at(10))
        state = load_group_state(store, number)
        key = state.group.views[0].key
        edit = make_set_ball_edit(key, BALL)
        submit_edit(store, number, edit, if_match=state.etag, actor="ann")
        report = import_groups(store, "demo", [at(12)], source="test", actor="ann")
        (view, *_) = load_group_state(store, number).group.views
        assert view.media is not None
        assert (report.findings, view.media.frame, view.balls) == (1, 12, (BALL,))


class TestOtherSources:
    @pytest.mark.parametrize("what", ["split", "match"])
    def test_a_group_of_another_match_or_split_is_left_out(
        self, store: Store, tmp_path: Path, what: str
    ) -> None:
        made = []
        for name, lines in (("train", TOP), ("test", BOTTOM)):
            folder = name if what == "split" else "x"
            info = {} if what == "split" else {f"{folder}/match_info.json": match_info(name)}
            made.append(zipped(tmp_path / f"{name}.zip", {f"{folder}/00001.json": lines, **info}))
        bring(store, made[0], "sn-calibration")
        before = first_group(store).group
        for dry_run in (True, False):
            report = bring(store, made[1], "sn-calibration", dry_run=dry_run)
            assert (report.changed, report.findings) == (0, 0)
            (problem,) = report.left_out.problems
            assert (
                "test.zip, 00001: is also the name of another group, which came from train.zip"
                in str(problem)
            )
        assert first_group(store).group == before

    def test_cameras_of_a_group_that_is_left_out_are_not_those_of_the_other(
        self, store: Store, tmp_path: Path, make_static: Callable[..., Group]
    ) -> None:
        def of_source(name: str, metres: float, colour: tuple[int, int, int]) -> Group:
            group = make_static(10, (5.0 + metres, 2.0, -0.5))
            views = []
            for view in group.views:
                path = tmp_path / name / f"{view.key}.jpg"
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(picture(colour))
                given = view.station.given
                assert given is not None
                moved = replace(given, position=given.position + metres)
                station = replace(view.station, given=moved)
                views.append(replace(view, media=Media(str(path)), station=station))
            return replace(group, views=tuple(views))

        first, second = of_source("a", 0.0, (200, 0, 0)), of_source("b", 5.0, (0, 0, 200))
        import_groups(store, "cup", [first], source="a.zip", actor="x")
        accept(store)
        before = first_group(store)
        report = import_groups(store, "cup", [second], source="b.zip", actor="x")
        assert (report.changed, len(report.left_out.problems)) == (0, 1)
        after = first_group(store)
        assert after.group == before.group
        assert not after.verdict.stale

    @pytest.mark.parametrize("what", ["split", "match"])
    def test_of_the_same_source_what_a_person_edited_stays_what_it_was(
        self, store: Store, tmp_path: Path, what: str
    ) -> None:
        def bring_part(name: str, lines: object) -> IngestReport:
            folder = name if what == "split" else "x"
            info = {} if what == "split" else {f"{folder}/match_info.json": match_info(name)}
            made = zipped(tmp_path / "x.zip", {f"{folder}/00001.json": lines, **info})
            return bring(store, made, "sn-calibration")

        bring_part("train", TOP)
        before = draw_ball(store).group
        report = bring_part("test", BOTTOM)
        assert (report.changed, report.findings) == (1, 1)
        assert first_group(store).group == before
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_other_pictures_under_the_same_names_are_left_out(
        self, store: Store, tmp_path: Path
    ) -> None:
        bring(store, zipped(tmp_path / "a.zip", {"0001.jpg": RED}))
        before = accept(store)
        other = zipped(tmp_path / "b.zip", {"0001.jpg": BLUE, "0002.jpg": BLUE})
        report = bring(store, other)
        assert (report.new, report.changed, len(report.left_out.problems)) == (1, 0, 1)
        assert (first_group(store).group, status(store)) == (before.group, "accepted")

    def test_corrected_lines_of_the_same_picture_are_followed(
        self, store: Store, tmp_path: Path
    ) -> None:
        for name, lines in (("a", TOP), ("b", BOTTOM)):
            members = {"train/00001.json": lines, "train/00001.jpg": RED}
            report = bring(store, zipped(tmp_path / f"{name}.zip", members), "sn-calibration")
        told = "1 group came from a.zip before and now has other pictures or annotations from b.zip"
        assert (report.changed, report.problems) == (1, [told])

    def test_the_same_lines_on_a_picture_that_was_encoded_anew_are_followed(
        self, store: Store, tmp_path: Path
    ) -> None:
        for name, shown in (("a", RED), ("b", BLUE)):
            members = {"train/00001.json": TOP, "train/00001.jpg": shown}
            report = bring(store, zipped(tmp_path / f"{name}.zip", members), "sn-calibration")
        assert (report.changed, report.left_out.problems) == (1, [])


class TestVerdicts:
    def test_a_verdict_does_not_move_to_another_picture(self, store: Store, tmp_path: Path) -> None:
        bring(store, zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED}))
        accept(store)
        other = picture((0, 0, 200))
        report = bring(store, zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": other}))
        assert report.problems == [
            "1 verdict was withdrawn, because the picture that was judged has been replaced by another"
        ]
        assert status(store) == "unreviewed"
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_verdict_follows_its_picture_into_another_file(
        self, store: Store, tmp_path: Path
    ) -> None:
        bring(store, zipped(tmp_path / "a" / "pics.zip", {"0001.jpg": RED}))
        accept(store)
        report = bring(store, zipped(tmp_path / "b" / "pics.zip", {"0001.jpg": RED}))
        assert (report.changed, status(store)) == (1, "accepted")


def accept(store: Store) -> GroupState:
    state = first_group(store)
    return set_verdict(
        store, state.id, "accepted", note="looked at", if_match=state.etag, actor="ann"
    )


def status(store: Store) -> str:
    (row, *_) = list_groups(store, get_dataset(store, "cup").id, limit=9).items
    return row.status


def match_info(match: str) -> dict[str, object]:
    record = {"league": "l", "season": "s", "match": match}
    return {"00001.jpg": record}
