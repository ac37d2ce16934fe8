from __future__ import annotations

import unicodedata
from dataclasses import replace

import pytest
from sqlalchemy import text

from app.db.store import Store
from app.errors import ConflictError, NotFoundError
from app.features.datasets.service import get_dataset, list_datasets
from app.features.groups.edit import SetLines, SetStationLines, SetViewInclusion, make_set_ball_edit
from app.features.groups.history import read_history
from app.features.groups.state import GroupState
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.cameras import import_given_cameras
from app.features.imports.ingest import (
    UnassignedFrame,
    ensure_dataset,
    import_groups,
    import_unassigned_frames,
    read_unassigned_frames,
)
from app.features.stations.service import load_station, submit_station_edit
from app.features.verdicts.service import set_verdict
from app.formats.report import ReaderReport
from app.soccer.annotation import BallAnnotation, Extras, make_lines
from app.soccer.frames import Box, ImagePoint
from app.soccer.group import Group, Media
from tests.unit.features.independent_annotations.begun import begin_take


def again(store: Store, *groups: Group):
    return import_groups(store, "demo", groups, source="test", actor="ann")


def without_lines(group: Group) -> Group:
    """As ISSIA comes when nobody names a folder of lines."""
    views = (
        replace(view, station=replace(view.station, lines={}, calibration="given"))
        for view in group.views
    )
    return replace(group, views=tuple(views))


def with_switch(group: Group, calibration: str) -> Group:
    views = (
        replace(view, station=replace(view.station, calibration=calibration))
        for view in group.views
    )
    return replace(group, views=tuple(views))


def with_ball(group: Group, view: str, x: float) -> Group:
    found = group.view(view)
    assert found is not None
    return group.with_view(replace(found, balls=(BallAnnotation(box=Box(x, 100.0, 12.0, 12.0)),)))


def rows(store: Store) -> dict[str, int]:
    names = ("groups", "view", "station", "log", "queue", "import_finding")
    with store.read() as session:
        return {
            name: session.execute(text(f"SELECT count(*) FROM {name}")).scalar_one()
            for name in names
        }


class TestIngest:
    def test_nothing_is_imported_into_what_one_person_annotates_on_their_own(
        self, store, fill, make_group
    ) -> None:
        (group,) = fill(make_group())
        take = begin_take(store, group, person="ann")
        name = load_group_state(store, take.copy_id).dataset
        with pytest.raises(ConflictError, match="independent annotations"):
            import_groups(store, name, [make_group(7)], source="test", actor="lea")
        assert load_group_state(store, take.copy_id).group == load_group_state(store, group).group

    def test_a_group_comes_back_as_it_went_in(self, store, fill, make_group) -> None:
        group = make_group()
        state = load_group_state(store, fill(group, solved=False)[0])
        assert state.group == group
        assert (state.revision, state.number, state.dataset) == (1, 1, "demo")
        assert state.solution is None

    def test_shared_stations_are_stored_once(self, store, fill, make_static) -> None:
        ids = fill(make_static(10), make_static(11), make_static(12), solved=False)
        counts = rows(store)
        assert (counts["groups"], counts["view"], counts["station"]) == (3, 9, 3)
        first, last = load_group_state(store, ids[0]), load_group_state(store, ids[2])
        assert first.station_ids == last.station_ids
        assert last.group == make_static(12)

    def test_importing_again_changes_and_duplicates_nothing(
        self, store, fill, make_group, make_static
    ) -> None:
        groups = [make_group(7), make_group(8), make_static(10)]
        fill(*groups)
        before = rows(store)
        report = again(store, *groups)
        assert (report.new, report.changed, report.unchanged) == (0, 0, 3)
        assert rows(store) == before

    def test_an_import_that_yields_no_group_makes_no_dataset(self, store) -> None:
        assert vars(again(store)) == {
            "new": 0, "changed": 0, "unchanged": 0, "findings": 0, "missing": 0, "problems": [],
            "without_picture": 0, "left_out": ReaderReport(), "dropped_views": {}, "replaced": {},
            "withdrawn": 0,
        }  # fmt: skip
        with pytest.raises(NotFoundError):
            get_dataset(store, "demo")

    def test_an_import_that_fails_at_once_makes_no_dataset(self, store) -> None:
        def failing():
            raise NotFoundError("no such folder")
            yield

        with pytest.raises(NotFoundError):
            import_groups(store, "demo", failing(), source="test", actor="ann")
        assert list_datasets(store) == []

    def test_a_match_that_was_stored_with_accents_apart_is_the_same_match(
        self, store, fill, make_group
    ) -> None:
        def spelt(form: str) -> Group:
            group, match = make_group(7), unicodedata.normalize(form, "l/s/K\u00f6ln")
            views = tuple(
                replace(view, station=replace(view.station, key=f"{match}/{view.key}"))
                for view in group.views
            )
            return replace(group, key=f"{match}/7.png", match=match, views=views)

        (number,) = fill(spelt("NFD"))
        report = again(store, spelt("NFC"))
        assert (report.new, report.unchanged, report.missing) == (0, 1, 0)
        assert load_group_state(store, number).group == spelt("NFD")

    def test_a_dataset_that_is_there_is_filled(self, store, make_group) -> None:
        made = ensure_dataset(store, "demo", "ann")
        again(store, make_group(7))
        assert get_dataset(store, "demo").id == made

    def test_an_import_that_was_killed_is_taken_up_where_it_ended(
        self, store, make_group, monkeypatch
    ) -> None:
        monkeypatch.setattr("app.features.imports.ingest.BATCH", 2)
        groups = [make_group(number) for number in range(1, 6)]

        def killed():
            yield from groups[:3]
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            import_groups(store, "demo", killed(), source="test", actor="ann")
        assert get_dataset(store, "demo").groups == 2
        report = again(store, *groups)
        assert (report.new, report.unchanged) == (3, 2)
        assert rows(store)["view"] == 10

    def test_a_group_that_appears_twice_counts_once_and_is_named(
        self, store, fill, make_group
    ) -> None:
        report = again(store, make_group(7), make_group(7))
        assert (report.new, report.problems) == (1, [])
        (problem,) = report.left_out.problems
        assert "7.png: appears twice" in problem.message

    def test_a_group_of_too_many_views_is_left_out_and_is_not_missing(
        self, store, make_group, monkeypatch
    ) -> None:
        again(store, make_group(7), make_group(8))
        monkeypatch.setattr("app.features.imports.body.MAX_VIEWS", 1)
        one = replace(make_group(9), views=make_group(9).views[:1])
        told = ReaderReport()
        groups = [make_group(7), make_group(8), one]
        report = import_groups(store, "demo", groups, source="test", actor="ann", limit_report=told)
        assert (report.new, report.missing) == (1, 0)
        assert [problem.record for problem in told.problems] == [
            make_group(7).key,
            make_group(8).key,
        ]

    def test_progress_counts_the_groups_done(self, store, make_group) -> None:
        calls: list[int] = []
        groups = [make_group(7), make_group(8)]
        import_groups(store, "demo", groups, source="x", actor="ann", progress=calls.append)
        assert calls == [2]

    def test_media_are_kept_by_absolute_path(self, store, fill, make_group, monkeypatch, tmp_path):
        monkeypatch.chdir(tmp_path)
        group = make_group()
        view = replace(group.views[0], media=Media("data/7.png"))
        state = load_group_state(store, fill(group.with_view(view), solved=False)[0])
        media = state.group.views[0].media
        assert media is not None
        assert media.path == str(tmp_path / "data/7.png")


class TestAChangedSource:
    def test_a_ball_that_nobody_edited_follows_its_source(self, store, fill, make_group) -> None:
        (group_id,) = fill(make_group())
        changed = with_ball(make_group(), "7.png", 300.0)
        report = again(store, changed)
        state = load_group_state(store, group_id)
        assert (report.changed, report.findings) == (1, 0)
        assert state.group == changed
        assert state.revision == 2
        assert state.solution is None

    def test_a_ball_that_a_person_edited_stays_and_becomes_a_finding(
        self, store: Store, fill, state: GroupState, make_group
    ) -> None:
        ball = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))
        submit_edit(
            store, state.id, make_set_ball_edit("7.png", ball), if_match=state.etag, actor="ann"
        )
        report = again(store, with_ball(make_group(), "7.png", 300.0))
        after = load_group_state(store, state.id)
        assert (report.changed, report.findings) == (1, 1)
        assert after.group.view("7.png").balls == (ball,)
        fill()
        solution = load_group_state(store, state.id).solution
        finding = next(item for item in solution.findings if item.kind == "upstream_changed")
        assert finding.view == "7.png"
        assert "7.png" in finding.sentence

    def test_importing_the_changed_source_again_finds_nothing_new(
        self, store, fill, state, make_group
    ) -> None:
        edit = SetViewInclusion("7.png", False)
        submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        changed = with_ball(make_group(), "7.png", 300.0)
        again(store, changed)
        before = rows(store)
        report = again(store, changed)
        assert (report.unchanged, report.findings) == (1, 0)
        assert rows(store) == before
        assert before["import_finding"] == 1

    def test_another_view_follows_beside_an_edited_one(
        self, store, fill, state, make_group
    ) -> None:
        edit = make_set_ball_edit("7.png", None)
        submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        changed = with_ball(make_group(), "7_1.png", 300.0)
        report = again(store, changed)
        after = load_group_state(store, state.id)
        assert report.findings == 0
        assert after.group.view("7.png").balls == ()
        assert after.group.view("7_1.png") == changed.view("7_1.png")

    def test_lines_follow_beside_an_edited_ball(self, store, fill, state, make_group) -> None:
        edit = make_set_ball_edit("7.png", None)
        submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        view = make_group().views[0]
        lines = make_lines({"Middle line": [(1.0, 2.0), (3.0, 4.0)]})
        changed = replace(view, station=replace(view.station, lines=lines))
        again(store, make_group().with_view(changed))
        after = load_group_state(store, state.id).group.view("7.png")
        assert after.station.lines == lines
        assert after.balls == ()

    def test_an_edit_that_was_undone_counts_as_no_edit(
        self, store, fill, state, make_group
    ) -> None:
        edited = submit_edit(
            store, state.id, make_set_ball_edit("7.png", None), if_match=state.etag, actor="ann"
        )
        undo_group_edit(store, state.id, if_match=edited.etag, actor="ann")
        changed = with_ball(make_group(), "7.png", 300.0)
        assert again(store, changed).findings == 0
        assert load_group_state(store, state.id).group == changed

    def test_a_finding_goes_when_the_source_says_what_the_person_said(
        self, store, fill, state, make_group
    ) -> None:
        agreed = with_ball(make_group(), "7.png", 333.0)
        ball = agreed.view("7.png").balls[0]
        submit_edit(
            store, state.id, make_set_ball_edit("7.png", ball), if_match=state.etag, actor="ann"
        )
        again(store, with_ball(make_group(), "7.png", 300.0))
        again(store, agreed)
        assert rows(store)["import_finding"] == 0

    def test_views_come_and_go_unless_a_person_edited_them(
        self, store, fill, state, make_group
    ) -> None:
        one = replace(make_group(), views=make_group().views[:1])
        again(store, one)
        assert [view.key for view in load_group_state(store, state.id).group.views] == ["7.png"]
        again(store, make_group())
        back = load_group_state(store, state.id)
        assert back.group == make_group()
        edit = make_set_ball_edit("7_1.png", None)
        submit_edit(store, state.id, edit, if_match=back.etag, actor="ann")
        report = again(store, one)
        assert report.findings == 1
        kept = load_group_state(store, state.id).group
        assert [view.key for view in kept.views] == ["7.png", "7_1.png"]

    def test_views_that_are_no_longer_in_the_files_are_told(self, store, fill, make_group) -> None:
        groups = [make_group(7), make_group(8)]
        fill(*groups)
        cut = [replace(group, views=group.views[:1]) for group in groups]
        gone = sum(len(group.views) - 1 for group in groups)
        told = f"{gone} views of 2 groups are no longer in the files and were removed"
        dry = import_groups(store, "demo", cut, source="test", actor="ann", dry_run=True)
        assert dry.problems == [told]
        assert again(store, *cut).problems == [told]
        assert again(store, *cut).problems == []

    def test_views_that_people_edited_do_not_add_up_beyond_what_a_group_may_have(
        self, store, state, make_group, monkeypatch
    ) -> None:
        submit_edit(
            store, state.id, make_set_ball_edit("7_1.png", None), if_match=state.etag, actor="ann"
        )
        before = load_group_state(store, state.id).group
        monkeypatch.setattr("app.features.imports.ingest.MAX_VIEWS", 2)
        view = make_group().views[0]
        other = replace(make_group(), views=(view, replace(view, key="other.png")))
        report = again(store, other)
        assert (report.changed, report.findings) == (0, 0)
        assert load_group_state(store, state.id).group == before
        (problem,) = report.left_out.problems
        told = "would have 3 views with those that people edited; the limit is 2"
        assert told in problem.message

    def test_a_static_camera_that_changed_makes_its_groups_stale(
        self, store, fill, make_static
    ) -> None:
        ids = fill(make_static(10), make_static(11))
        group = make_static(10)
        view = group.views[0]
        moved = replace(view.station, lines=make_lines({"Middle line": [(1, 2), (3, 4)]}))
        again(
            store,
            group.with_view(replace(view, station=moved)),
        )
        assert [load_group_state(store, number).solution for number in ids] == [None, None]
        assert load_group_state(store, ids[1]).group.views[0].station.lines == moved.lines

    @pytest.mark.parametrize(("before", "after"), [("", "m"), ("m", "")])
    def test_a_match_that_comes_or_goes_makes_a_group_of_one_view_stale(
        self, store, fill, make_group, before, after
    ) -> None:
        whole = make_group(9)
        one = replace(whole, views=whole.views[:1], match=before)
        (number,) = fill(one)
        state = load_group_state(store, number)
        assert state.solution is not None
        set_verdict(
            store, number, "rejected", "not_same_instant", None, if_match=state.etag, actor="ann"
        )
        again(store, replace(one, match=after))
        state = load_group_state(store, number)
        assert (state.group.match, state.solution, state.verdict.stale) == (after, None, False)

    def test_a_static_camera_that_changed_counts_as_changed_once(
        self, store, fill, make_static, monkeypatch
    ) -> None:
        monkeypatch.setattr("app.features.imports.ingest.BATCH", 1)
        fill(make_static(10), make_static(11))
        report = again(store, *(with_switch(make_static(n), "lines") for n in (10, 11)))
        assert (report.changed, report.unchanged) == (3, 2)

    def test_a_static_camera_keeps_lines_and_switch_when_the_source_brings_none(
        self, store, fill, make_static
    ) -> None:
        ids = fill(with_switch(make_static(10), "lines"))
        before, counts = load_group_state(store, ids[0]), rows(store)
        report = again(store, without_lines(make_static(10)))
        assert (report.new, report.changed, report.unchanged) == (0, 0, 1)
        after = load_group_state(store, ids[0])
        assert after.group == before.group
        assert after.group.views[0].station.lines != {}
        assert after.group.views[0].station.calibration == "lines"
        assert after.solution is not None
        assert rows(store) == counts

    def test_a_new_camera_follows_beside_lines_that_are_kept(
        self, store, fill, make_static, opposite
    ) -> None:
        ids = fill(make_static(10))
        group = without_lines(make_static(10))
        view = group.views[0]
        moved = replace(view, station=replace(view.station, given=opposite))
        report = again(store, group.with_view(moved))
        station = load_group_state(store, ids[0]).group.views[0].station
        assert report.changed == 1
        assert (station.given, station.lines) == (
            opposite, make_static(10).views[0].station.lines,
        )  # fmt: skip

    @pytest.mark.parametrize("camera_alone", [False, True])
    def test_an_edited_static_camera_stays_edited_without_a_finding_when_no_lines_come(
        self, store, fill, make_static, opposite, camera_alone: bool
    ) -> None:
        (group_id,) = fill(make_static(10))
        if camera_alone:
            import_given_cameras(store, "demo", {"cam1": opposite}, source="x", actor="ann")
        station_id = load_group_state(store, group_id).station_ids["cam1"]
        station = load_station(store, station_id)
        edit = SetStationLines({"Side line left": (ImagePoint(1.0, 2.0), ImagePoint(30.0, 40.0))})
        submit_station_edit(store, station_id, edit, if_match=station.etag, actor="ann")
        edited, group = load_station(store, station_id), without_lines(make_static(10))
        if camera_alone:
            view = group.views[0]
            group = group.with_view(replace(view, station=replace(view.station, given=None)))
        report = again(store, group)
        assert (report.changed, report.findings) == (0, 0)
        after = load_station(store, station_id)
        assert after == edited
        assert after.stored.edited

    def test_an_edited_static_camera_stays_and_becomes_a_finding_of_its_groups(
        self, store, fill, make_static
    ) -> None:
        (group_id,) = fill(make_static(10))
        station_id = load_group_state(store, group_id).station_ids["cam1"]
        lines = {"Side line left": (ImagePoint(1.0, 2.0), ImagePoint(30.0, 40.0))}
        station = load_station(store, station_id)
        edit = SetStationLines(lines)
        submit_station_edit(store, station_id, edit, if_match=station.etag, actor="ann")
        group = make_static(10)
        view = group.views[0]
        upstream = replace(view.station, lines=make_lines({"Middle line": [(1, 2), (3, 4)]}))
        report = again(store, group.with_view(replace(view, station=upstream)))
        assert report.findings == 1
        assert "Side line left" in load_station(store, station_id).station.lines
        fill()
        kinds = [item.kind for item in load_group_state(store, group_id).solution.findings]
        assert "upstream_changed" in kinds

    def test_the_log_has_each_import_of_a_group(self, store, state, make_group) -> None:
        again(store, with_ball(make_group(), "7.png", 300.0))
        assert [entry.kind for entry in read_history(store, state.id)] == ["import", "import"]

    def test_an_edit_of_lines_stays(self, store, state, make_group) -> None:
        edit = SetLines("7.png", {"Middle line": None})
        submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        view = make_group().views[0]
        lines = make_lines({"Middle line": [(1.0, 2.0), (3.0, 4.0)]})
        changed = replace(view, station=replace(view.station, lines=lines))
        report = again(store, make_group().with_view(changed))
        assert report.findings == 1
        assert "Middle line" not in load_group_state(store, state.id).group.views[0].station.lines


class TestMissingGroups:
    def test_groups_that_left_the_source_are_counted_and_stay(self, store, make_group) -> None:
        again(store, make_group(7), make_group(8), make_group(9))
        report = again(store, make_group(8))
        assert (report.unchanged, report.missing) == (1, 2)
        assert report.problems == [
            "2 groups of an earlier import are missing in this import; all are kept"
        ]
        assert get_dataset(store, "demo").groups == 3

    def test_groups_of_another_source_are_not_missing(self, store, make_group) -> None:
        import_groups(store, "demo", [make_group(7)], source="first", actor="ann")
        report = import_groups(store, "demo", [make_group(8)], source="second", actor="ann")
        assert (report.missing, report.problems) == (0, [])

    def test_a_group_belongs_to_the_source_that_changed_it_last(self, store, make_group) -> None:
        import_groups(store, "demo", [make_group(7), make_group(8)], source="first", actor="ann")
        moved = with_ball(make_group(7), "7.png", 300.0)
        import_groups(store, "demo", [moved], source="second", actor="ann")
        report = import_groups(store, "demo", [make_group(8)], source="first", actor="ann")
        assert report.missing == 0

    def test_the_first_import_misses_nothing(self, store, make_group) -> None:
        assert again(store, make_group(7)).missing == 0


def frames(count: int, x: float = 1.5) -> list[UnassignedFrame]:
    box = {"class": "Person", "ID": "3", "points": {"x1": x, "y1": 2}}
    return [UnassignedFrame("cam1", str(number), Extras(boxes=(box,))) for number in range(count)]


def kept(store) -> list[UnassignedFrame]:
    """The spare frames of the only dataset."""
    with store.read() as session:
        return list(read_unassigned_frames(session, 1))


class TestIngestSpare:
    def test_frames_come_back(self, store) -> None:
        report = import_unassigned_frames(store, "demo", frames(3), source="x", actor="ann")
        assert report.new == 3
        assert kept(store) == frames(3)

    def test_again_it_changes_nothing_and_follows_changes(self, store) -> None:
        import_unassigned_frames(store, "demo", frames(3), source="x", actor="ann")
        same = import_unassigned_frames(store, "demo", frames(3), source="x", actor="ann")
        assert (same.new, same.changed, same.unchanged) == (0, 0, 3)
        moved = import_unassigned_frames(store, "demo", frames(3, 9.0)[:1], source="x", actor="ann")
        assert moved.changed == 1
        assert kept(store) == [frames(1, 9.0)[0], *frames(3)[1:]]

    def test_many_come_in_batches(self, store, monkeypatch) -> None:
        monkeypatch.setattr("app.features.imports.ingest.BATCH", 4)
        import_unassigned_frames(store, "demo", frames(10), source="x", actor="ann")
        assert len(kept(store)) == 10
