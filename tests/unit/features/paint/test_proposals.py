"""Proposals of a dataset: looked for, kept as predictions, accepted, and forgotten."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from app.db.log import verify_chain
from app.db.store import Store
from app.errors import InputError, JobCancelled, NotFoundError
from app.features.groups import pictures as proposal_reading
from app.features.groups.edit import SetLines
from app.features.groups.history import read_history
from app.features.groups.pictures import MISSING
from app.features.groups.replay import replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.edits_export import group_to_export_json
from app.features.imports.ingest import import_groups
from app.features.paint import proposals as editing
from app.features.paint.proposals import (
    ProposalRunReport,
    forget_proposals,
    get_group_proposals,
    get_proposal_counts,
    propose_cameras_for_views,
)
from app.features.queue.service import list_groups
from app.features.solutions.service import solve_dataset
from app.features.versions.frozen_queries import freeze_annotations, thaw_group
from app.media.files import has_video_index
from app.paint.view_proposal import ViewProposal
from app.soccer.codec import station_digest
from app.soccer.group import Group, Media, Station, View
from tests.cameras import SIZE
from tests.unit.applications import lines_of
from tests.unit.features.paint.test_service import Here
from tests.unit.paint.lawns import TRUE, drawn, lawn
from tests.videos import write_video

CAMERA = TRUE.scaled(4 / 3, 4 / 3)
"""Of the annotated size; the pictures are smaller."""


@cache
def picture(empty: bool) -> bytes:
    """The markings on grass, or grass alone, as PNG."""
    mask = np.zeros((540, 960), np.bool_) if empty else drawn(TRUE, 3)
    return bytes(cv2.imencode(".png", lawn(mask)[:, :, ::-1])[1])


def draw(file: Path, *, empty: bool = False) -> Media:
    """A picture of the markings, or of grass alone."""
    file.write_bytes(picture(empty))
    return Media(str(file))


def view(name: str, media: Media | None, **station: object) -> View:
    return View(name, Station(name, SIZE, **station), media=media)  # type: ignore[arg-type]


@pytest.fixture
def groups(tmp_path: Path) -> list[Group]:
    """Two instants of a match: one that is annotated, and one with a picture and lines nowhere."""
    known = view("a.png", draw(tmp_path / "a.png"), lines=lines_of(CAMERA))
    fresh = view("b.png", draw(tmp_path / "b.png"))
    bare = view("c.png", None)
    given = view("d.png", draw(tmp_path / "d.png", empty=True), given=CAMERA)
    return [
        Group("1", (known,), match="m"),
        Group("2", (fresh, bare, given), match="m"),
    ]


@pytest.fixture(autouse=True)
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """In place of processes: pictures are looked at where the test is."""
    monkeypatch.setattr(editing, "WorkerPool", Here)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[object, ...]]:
    """What was asked for each picture that was looked at; the markings are always found."""
    seen: list[tuple[object, ...]] = []

    def look(image, size, known, pitch, policy):  # type: ignore[no-untyped-def]
        seen.append(tuple(known))
        if image.max() < 200:
            return ViewProposal("nothing", "No straight line is seen on the grass.", {})
        return ViewProposal("proposed", "", lines_of(CAMERA), 0.9, 0.8, 0.3, 0.25, 500)

    monkeypatch.setattr(proposal_reading, "propose_lines_in_image", look)
    return seen


@pytest.fixture
def filled(store: Store, groups: list[Group]) -> Store:
    import_groups(store, "demo", groups, source="files", actor="ann")
    solve_dataset(store, "demo")
    return store


def counts(store: Store) -> tuple[int, ...]:
    (item,) = get_proposal_counts(store, "demo").items
    return item.views, item.looked, item.proposed, item.unsure, item.nothing, item.accepted


def found(store: Store, q: str) -> list[int]:
    return [row.id for row in list_groups(store, 1, q).items]


def accept(store: Store, number: int = 2) -> str:
    """Save what is proposed for a group's first view; its key."""
    (key, is_open, item), *_ = get_group_proposals(store, number)
    assert is_open and item.outcome == "proposed"
    edit = SetLines(key, item.lines, tuple(item.lines))
    submit_edit(store, number, edit, if_match=load_group_state(store, number).etag, actor="bob")
    return key


class TestProposeViews:
    def test_a_video_is_indexed_before_its_frames_are_looked_at(
        self, store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        media = Media(str(write_video(tmp_path / "cam1.mp4", "mp4v", 20)), frame=5)
        import_groups(
            store, "demo", [Group("5", (view("cam1", media),))], source="files", actor="ann"
        )
        seen: list[bool] = []

        def look(task, settings):  # type: ignore[no-untyped-def]
            seen.append(has_video_index(task.media, settings))
            return task.make_proposal_without_picture(MISSING)

        monkeypatch.setattr(editing, "propose_lines_for_task", look)
        told: list[str] = []
        propose_cameras_for_views(store, "demo", progress=lambda _, __, said="": told.append(said))
        assert seen == [True]
        assert told[0] == "Finding the frames of cam1.mp4."

    def test_lines_are_found_from_the_picture_and_the_match_and_nothing_is_said(self, filled):
        before, kinds = (
            load_group_state(filled, 2).etag,
            [entry.kind for entry in read_history(filled, 2)],
        )
        assert counts(filled) == (1, 0, 0, 0, 0, 0)
        run = propose_cameras_for_views(filled, "demo")
        assert run == ProposalRunReport(views=1, proposed=1)
        ((key, is_open, item),) = get_group_proposals(filled, 2)
        assert (key, is_open, item.outcome, item.sentence) == ("b.png", True, "proposed", "")
        assert item.supported > 0.9 and item.points > 100 and item.error_px < 0.5
        assert item.frame and item.version
        curve = CAMERA.project(
            load_group_state(filled, 2).group.pitch.sample("Side line right", 0.05, 0.05)
        )
        for point in item.lines["Side line right"]:
            assert np.hypot(*(curve - point).T).min() < 1.5
        assert load_group_state(filled, 2).etag == before
        assert [entry.kind for entry in read_history(filled, 2)] == kinds

    def test_what_the_match_knows_is_handed_on(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        ((camera,),) = asked
        assert np.linalg.norm(camera.position - CAMERA.position) < 1.0

    def test_cameras_that_say_nothing_of_a_stand_or_lens_are_not_handed_on(
        self, store, groups, asked
    ):
        names = iter(lines_of(CAMERA))
        mixed = {next(names): points for points in reversed(lines_of(CAMERA).values())}
        wide = replace(CAMERA, focal_length=(CAMERA.focal_length[0] * 1.1, CAMERA.focal_length[1]))
        cropped = replace(CAMERA, principal_point=(500.0, 359.5))
        odd = [
            Group("3", (view("3", None, given=wide),), match="m"),
            Group("4", (view("4", None, given=cropped),), match="m"),
            Group("5", (view("5", None, lines=mixed),), match="m"),
        ]
        import_groups(store, "demo", [*groups, *odd], source="files", actor="ann")
        solve_dataset(store, "demo")
        propose_cameras_for_views(store, "demo")
        ((camera,),) = asked
        assert np.linalg.norm(camera.position - CAMERA.position) < 1.0

    def test_once_more_compares_pictures_and_looks_at_none(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        assert propose_cameras_for_views(filled, "demo") == ProposalRunReport(views=1, left=1)
        assert len(asked) == 1

    def test_another_picture_and_a_missing_one_are_said(self, filled, asked, tmp_path: Path):
        propose_cameras_for_views(filled, "demo")
        draw(tmp_path / "b.png", empty=True)
        assert propose_cameras_for_views(filled, "demo") == ProposalRunReport(
            views=1, nothing=1, changed=1
        )
        (tmp_path / "b.png").unlink()
        run = propose_cameras_for_views(filled, "demo")
        assert run == ProposalRunReport(views=1, nothing=1, missing=1)
        ((_, _, item),) = get_group_proposals(filled, 2)
        assert (item.sentence, item.frame, dict(item.lines)) == (MISSING, "", {})

    def test_what_another_extractor_found_is_looked_for_again(self, filled, asked, monkeypatch):
        with monkeypatch.context() as patch:
            patch.setattr(proposal_reading, "EXTRACTOR_VERSION", "0")
            propose_cameras_for_views(filled, "demo")
        assert propose_cameras_for_views(filled, "demo") == ProposalRunReport(views=1, proposed=1)

    def test_where_nothing_was_found_a_later_search_looks_again(
        self, filled, asked, monkeypatch, tmp_path: Path
    ):
        draw(tmp_path / "b.png", empty=True)
        propose_cameras_for_views(filled, "demo")
        assert propose_cameras_for_views(filled, "demo") == ProposalRunReport(views=1, left=1)
        monkeypatch.setattr(editing, "SEARCH_VERSION", editing.SEARCH_VERSION + 1)
        assert propose_cameras_for_views(filled, "demo") == ProposalRunReport(views=1, nothing=1)

    def test_where_nothing_was_found_more_of_the_match_is_worth_another_look(
        self, store, groups, asked, tmp_path: Path
    ):
        draw(tmp_path / "b.png", empty=True)
        import_groups(store, "demo", groups, source="files", actor="ann")
        propose_cameras_for_views(store, "demo")
        solve_dataset(store, "demo")
        assert propose_cameras_for_views(store, "demo") == ProposalRunReport(views=1, nothing=1)
        assert propose_cameras_for_views(store, "demo") == ProposalRunReport(views=1, left=1)

    def test_a_static_camera_is_looked_at_once(self, store, asked, tmp_path: Path):
        media = draw(tmp_path / "s.png")
        shared = [
            Group(str(number), (view("cam1", media, shared=True),), match="m") for number in (1, 2)
        ]
        import_groups(store, "demo", shared, source="files", actor="ann")
        assert propose_cameras_for_views(store, "demo") == ProposalRunReport(views=1, proposed=1)
        assert counts(store) == (1, 1, 1, 0, 0, 0)

    def test_killed_midway_it_goes_on_where_it_was(self, store, asked, tmp_path, monkeypatch):
        monkeypatch.setattr(editing, "_PER_WORKER", 1)
        many = [
            Group(str(number), (view(f"{number}.png", draw(tmp_path / f"{number}.png")),))
            for number in range(3)
        ]
        import_groups(store, "demo", many, source="files", actor="ann")

        def stop(_done, _total):
            raise JobCancelled

        with pytest.raises(JobCancelled):
            propose_cameras_for_views(store, "demo", workers=1, progress=stop)
        told = []
        run = propose_cameras_for_views(
            store, "demo", workers=1, progress=lambda *at: told.append(at)
        )
        assert (run.left, run.proposed, len(asked)) == (1, 2, 3)
        assert told == [(1, 3), (2, 3), (3, 3)]

    def test_a_match_that_is_not_there_is_refused(self, filled):
        with pytest.raises(NotFoundError, match="no match final"):
            propose_cameras_for_views(filled, "demo", ["final"])


class TestAccepting:
    def test_the_source_stands_in_log_state_and_frozen_text_and_undo_takes_all_back(
        self, filled, asked
    ):
        propose_cameras_for_views(filled, "demo")
        before = load_group_state(filled, 2)
        key = accept(filled)
        state = load_group_state(filled, 2)
        station = state.group.view(key).station
        assert station.proposed == tuple(station.lines)
        edit = read_history(filled, 2)[-1].body["edit"]
        assert set(edit["source"].values()) == {"proposed"} and edit["edit"] == "set_lines"
        said = freeze_annotations(state.group)
        assert '"proposed":["' in said.texts[said.key]
        back = undo_group_edit(filled, 2, if_match=state.etag, actor="bob")
        assert back.group == before.group and back.group.view(key).station.proposed == ()

    def test_who_says_the_lines_is_part_of_what_is_said(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        key = accept(filled)
        station = load_group_state(filled, 2).group.view(key).station
        assert station_digest(station) != station_digest(replace(station, proposed=()))

    def test_a_frozen_group_and_a_carried_one_keep_it(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        key = accept(filled)
        group = load_group_state(filled, 2).group
        said = freeze_annotations(group)
        texts = {name: json.loads(text) for name, text in said.texts.items()}
        thawed = thaw_group(texts[said.key], texts)
        assert thawed.view(key).station.proposed == group.view(key).station.proposed
        assert Station("x", SIZE).with_annotations_of(group.view(key).station).proposed
        assert group_to_export_json(group)["views"][0]["station"]["proposed"] == [
            *thawed.view(key).station.proposed
        ]

    def test_the_log_makes_the_same_tables(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        accept(filled)
        with filled.read() as session:
            verify_chain(session)
            assert replay_log(session) == read_state_snapshot(session)

    def test_a_marking_that_is_moved_is_a_person_s_again(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        key = accept(filled)
        state = load_group_state(filled, 2)
        first, *rest = state.group.view(key).station.proposed
        moved = SetLines(key, {first: state.group.view(key).station.lines[first][:-1]})
        after = submit_edit(filled, 2, moved, if_match=state.etag, actor="bob")
        assert after.group.view(key).station.proposed == tuple(rest)
        back = undo_group_edit(filled, 2, if_match=after.etag, actor="bob")
        assert back.group.view(key).station.proposed == (first, *rest)

    def test_what_is_accepted_is_no_longer_open_and_undo_opens_it(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        assert found(filled, "proposal:proposed") == [2]
        accept(filled)
        assert counts(filled) == (0, 0, 0, 0, 0, 1)
        assert found(filled, "proposal:any") == []
        undo_group_edit(filled, 2, if_match=load_group_state(filled, 2).etag, actor="bob")
        assert found(filled, "proposal:any") == [2]


class TestDrawnLines:
    """Views with lines that determine no camera."""

    @pytest.fixture
    def poor(self, store: Store, groups, tmp_path: Path) -> Store:
        """One line in the first view, and enough of them in the second."""
        few = {"Side line right": lines_of(CAMERA)["Side line right"]}
        first = view("p.png", draw(tmp_path / "p.png"), lines=few)
        second = view("q.png", draw(tmp_path / "q.png"), lines=lines_of(CAMERA))
        bare = view("r.png", None, lines=few)
        import_groups(
            store, "demo", [Group("3", (first, second, bare), match="m")], source="f", actor="a"
        )
        return store

    def test_are_looked_at_once_they_are_solved(self, poor, asked):
        assert propose_cameras_for_views(poor, "demo") == ProposalRunReport()
        solve_dataset(poor, "demo")
        assert counts(poor) == (1, 0, 0, 0, 0, 0)
        assert propose_cameras_for_views(poor, "demo") == ProposalRunReport(views=1, proposed=1)
        assert counts(poor) == (1, 1, 1, 0, 0, 0)
        assert found(poor, "proposal:proposed") == [1]
        assert propose_cameras_for_views(poor, "demo") == ProposalRunReport(views=1, left=1)

    def test_a_camera_that_is_a_guess_is_none(self, store, asked, tmp_path: Path):
        names = iter(lines_of(CAMERA))
        mixed = {next(names): points for points in reversed(lines_of(CAMERA).values())}
        wrong = view("w.png", draw(tmp_path / "w.png"), lines=mixed)
        import_groups(store, "demo", [Group("1", (wrong,), match="m")], source="f", actor="a")
        solve_dataset(store, "demo")
        calibration = load_group_state(store, 1).solution.views[0].calibration
        assert calibration.camera is not None and calibration.unobservable
        assert propose_cameras_for_views(store, "demo") == ProposalRunReport(views=1, unsure=1)
        ((_, is_open, item),) = get_group_proposals(store, 1)
        assert is_open and "Side line right” is drawn" in item.sentence

    def test_stay_and_the_others_join_them_in_one_edit(self, poor, asked):
        solve_dataset(poor, "demo")
        propose_cameras_for_views(poor, "demo")
        before = load_group_state(poor, 1)
        assert before.solution.views[0].calibration.camera is None
        accept(poor, 1)
        after = load_group_state(poor, 1)
        station = after.group.views[0].station
        assert (
            station.lines["Side line right"]
            == before.group.views[0].station.lines["Side line right"]
        )
        assert set(station.proposed) == {*lines_of(CAMERA)} - {"Side line right"}
        assert after.solution.views[0].calibration.camera is not None
        assert counts(poor) == (0, 0, 0, 0, 0, 1)
        assert not get_group_proposals(poor, 1)[0][1]
        back = undo_group_edit(poor, 1, if_match=after.etag, actor="bob")
        assert back.group == before.group
        assert get_group_proposals(poor, 1)[0][1]

    def test_that_are_others_now_are_looked_at_again(self, poor, asked):
        solve_dataset(poor, "demo")
        propose_cameras_for_views(poor, "demo")
        at = load_group_state(poor, 1)
        more = SetLines("p.png", {"Big rect. right main": lines_of(CAMERA)["Big rect. right main"]})
        submit_edit(poor, 1, more, if_match=at.etag, actor="bob")
        assert not get_group_proposals(poor, 1)[0][1]
        assert counts(poor) == (1, 0, 0, 0, 0, 0)
        assert propose_cameras_for_views(poor, "demo") == ProposalRunReport(views=1, proposed=1)
        assert counts(poor) == (1, 1, 1, 0, 0, 0)
        ((_, is_open, item),) = get_group_proposals(poor, 1)
        assert is_open and "Big rect. right main" not in item.lines
        # Without any line the one beside them does not count.
        none = SetLines(
            "p.png", dict.fromkeys(load_group_state(poor, 1).group.views[0].station.lines)
        )
        submit_edit(poor, 1, none, if_match=load_group_state(poor, 1).etag, actor="bob")
        assert not get_group_proposals(poor, 1)[0][1]
        assert counts(poor) == (1, 0, 0, 0, 0, 0)

    def test_the_views_of_a_static_camera_are_proposed_once(self, store, asked, tmp_path: Path):
        media, few = (
            draw(tmp_path / "s.png"),
            {"Side line right": lines_of(CAMERA)["Side line right"]},
        )
        shared = [
            Group(str(n), (view("cam1", media, shared=True, lines=few),), match="m") for n in (1, 2)
        ]
        import_groups(store, "demo", shared, source="files", actor="ann")
        solve_dataset(store, "demo")
        assert propose_cameras_for_views(store, "demo") == ProposalRunReport(views=1, proposed=1)


class TestQuery:
    def test_finds_groups_by_what_became_of_their_views(self, filled, asked, tmp_path: Path):
        assert found(filled, "proposal:none") == [1, 2]
        propose_cameras_for_views(filled, "demo")
        assert found(filled, "proposal:proposed,unsure") == [2]
        assert found(filled, "-proposal:any") == found(filled, "proposal:none") == [1]
        draw(tmp_path / "b.png", empty=True)
        propose_cameras_for_views(filled, "demo")
        assert (found(filled, "proposal:nothing"), found(filled, "proposal:proposed")) == ([2], [])

    def test_refuses_what_it_does_not_know(self, filled):
        with pytest.raises(InputError, match="proposal cannot be"):
            found(filled, "proposal:perhaps")


class TestForget:
    def test_takes_all_back_at_once_and_leaves_what_was_accepted(self, filled, asked):
        propose_cameras_for_views(filled, "demo")
        accept(filled)
        assert forget_proposals(filled, "demo") == 1
        assert counts(filled) == (0, 0, 0, 0, 0, 0)
        assert load_group_state(filled, 2).group.view("b.png").station.proposed
        assert forget_proposals(filled, "demo") == 0

    def test_leaves_other_datasets_alone(self, filled, groups, asked):
        import_groups(filled, "other", groups, source="files", actor="ann")
        propose_cameras_for_views(filled, "demo")
        propose_cameras_for_views(filled, "other")
        assert forget_proposals(filled, "other") == 1
        assert counts(filled)[:3] == (1, 1, 1)
