from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from sqlalchemy import Engine, event

from app.errors import InputError, NotFoundError, StaleRevisionError
from app.features.datasets.service import dataset_id
from app.features.findings.service import iterate_findings_as_json
from app.features.groups.edit import SetLines
from app.features.groups.history import read_history
from app.features.groups.replay import rebuild_tables, replay_log
from app.features.groups.state_snapshot_queries import read_state_snapshot
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.imports.ingest import import_groups
from app.features.pitches.service import (
    change_pitches,
    estimate_pitches,
    list_matches_to_estimate,
    parse_pitch,
    pitch_size_by_match,
    read_pitches,
    set_pitch_of_groups,
    update_pitch_findings,
)
from app.features.queue.service import list_groups
from app.features.solutions.service import list_stale_groups, solve_dataset
from app.soccer.annotation import make_lines
from app.soccer.group import Group, Station, View
from app.soccer.picture import OPEN, PictureGeometry
from app.soccer.pitch import Pitch
from tests.cameras import SIZE, looking
from tests.unit.solving.conftest import BEND, click

SMALL, RIGHT = "a_small_pitch", "b_right_pitch"
TRUE = Pitch(103.0, 66.0)


@cache
def season() -> tuple[Group, ...]:
    """Two matches of six groups: one on a pitch smaller than the one that is assumed."""
    groups = []
    for match, pitch in ((SMALL, TRUE), (RIGHT, Pitch())):
        for number in range(6):
            target = (-30.0 + 12.0 * number, -4.0, 0.0)
            camera = looking((1.0, 62.0, -16.0), target, 1200.0, bend=BEND)
            station = Station(
                f"{match}/{number}.png", SIZE, lines=click(camera, 0.7, number, pitch)
            )
            view = View(f"{number}.png", station)
            groups.append(Group(f"{match}/{number}.png", (view,), match=match))
    return tuple(groups)


@pytest.fixture
def solved(store, once):
    """The season, solved, and the pitch of its matches estimated."""

    def fill():
        import_groups(store, "demo", season(), source="files", actor="ann")
        solve_dataset(store, "demo")
        estimate_pitches(store, "demo")

    once("season", fill)
    return store


def stretched(group, picture):
    """A group whose picture was stretched in width, which its station knows."""
    (view,) = group.views
    middle = (SIZE.width - 1) / 2
    lines = make_lines(
        {
            name: [(middle + (x - middle) * picture.aspect, y) for x, y in points]
            for name, points in view.station.lines.items()
        }
    )
    station = replace(view.station, lines=lines, picture=picture)
    return replace(group, views=(replace(view, station=station),))


def sizes(store):
    return {item.match: item.pitch for item in read_pitches(store, "demo").items}


def accept(store, match=SMALL, pitch=TRUE, **how):
    how = {"if_match": None, "actor": "ann", **how}
    with store.write() as session:
        return change_pitches(session, "demo", {match: pitch}, **how)


class TestEstimatePitches:
    def test_another_size_is_proposed_where_the_lines_show_one(self, solved):
        (proposal,) = read_pitches(solved, "demo").proposals
        assert proposal.match == SMALL
        assert proposal.proposed.length == pytest.approx(103.0, abs=0.3)
        assert proposal.proposed.width == pytest.approx(66.0, abs=0.3)

    def test_the_match_has_one_finding(self, solved):
        (found,) = [
            item
            for item in iterate_findings_as_json(solved, "demo")
            if item["kind"] == "pitch_size"
        ]
        assert found["group"] == f"{SMALL}/0.png"
        listed = list_groups(solved, dataset_id(solved, "demo"), "finding:pitch_size").items
        assert [row.key for row in listed] == [found["group"]]
        assert "solved with 105 x 68 m" in found["sentence"]

    def test_what_is_known_is_not_computed_again(self, solved, monkeypatch):
        from app.features.pitches import service as pitches

        def refuse(*_, **__):
            raise AssertionError("estimated once more")

        monkeypatch.setattr(pitches, "estimate_pitch", refuse)
        estimate_pitches(solved, "demo")
        accept(solved)
        estimate_pitches(solved, "demo")
        state = load_group_state(solved, 1)
        view = state.group.views[0].key
        submit_edit(
            solved, 1, SetLines(view, {"Middle line": None}), if_match=state.etag, actor="ann"
        )
        with pytest.raises(AssertionError, match="once more"):
            estimate_pitches(solved, "demo")

    def test_a_match_of_few_frames_says_why_there_is_no_size(self, store):
        import_groups(store, "demo", season()[:3], source="files", actor="ann")
        (item,) = estimate_pitches(store, "demo").items
        assert (item.estimate, item.proposed) == (None, None)
        assert "needs 5" in item.problem

    def test_lines_are_read_as_the_picture_was_taken(self, store):
        wide = PictureGeometry(1.05, (0.0, 0.0), (0.001, 0.001, 0.001))
        groups = [stretched(group, wide) for group in season() if group.match == RIGHT]
        open_ones = [stretched(group, OPEN) for group in season() if group.match == SMALL]
        import_groups(store, "demo", [*groups, *open_ones], source="files", actor="ann")
        found = {item.match: item for item in estimate_pitches(store, "demo").items}
        assert found[RIGHT].proposed is None
        assert found[RIGHT].estimate.length == pytest.approx(105.0, abs=0.3)
        # Of pictures that nobody knows enough about nothing is said.
        assert "needs 5" in found[SMALL].problem


class TestGroupsWithoutMatch:
    def test_another_size_is_proposed_and_accepted_for_all_of_them(self, store):
        nameless = [replace(group, match="") for group in season()[:6]]
        import_groups(store, "demo", nameless, source="files", actor="ann")
        (item,) = estimate_pitches(store, "demo").proposals
        assert item.proposed.length == pytest.approx(103.0, abs=0.3)
        assert item.proposed.width == pytest.approx(66.0, abs=0.3)
        assert "for the groups without a match under Statistics" in item.proposal_reason
        accept(store, match="", pitch=TRUE)
        assert {load_group_state(store, number).group.pitch for number in range(1, 7)} == {TRUE}
        assert read_pitches(store, "demo").proposals == ()

    def test_a_size_holds_for_those_that_it_was_said_of(self, store):
        first, second, third = (replace(group, match="") for group in season()[:3])
        import_groups(store, "demo", [first, second], source="files", actor="ann")
        accept(store, match="", pitch=TRUE)
        (item,) = read_pitches(store, "demo").items
        assert item.previous == Pitch()
        changed = replace(first, label="the source says more of it now")
        import_groups(store, "demo", [changed, second, third], source="files", actor="ann")
        assert [load_group_state(store, n).group.pitch for n in (1, 2, 3)] == [TRUE, TRUE, Pitch()]
        assert load_group_state(store, 1).group.label == changed.label
        # One more came since: the size before was not that of all.
        assert read_pitches(store, "demo").items[0].previous is None
        with store.write() as session:
            set_pitch_of_groups(session, 1, [3], Pitch(101.0, 65.0), "ann")
        import_groups(store, "demo", [first], source="files", actor="ann")
        assert [load_group_state(store, n).group.pitch.length for n in (1, 2, 3)] == [
            103.0,
            103.0,
            101.0,
        ]
        assert read_pitches(store, "demo").items[0].previous is None
        assert_replays(store)

    def test_of_several_pitches_nothing_is_proposed_and_that_is_said(self, store):
        nameless = [replace(group, match="") for group in season()]
        import_groups(store, "demo", nameless, source="files", actor="ann")
        (item,) = estimate_pitches(store, "demo").items
        assert (item.estimate, item.proposed) == (None, None)
        assert "pitches of several sizes" in item.problem

    def test_without_lines_they_are_not_told_of(self, store):
        bare = [
            replace(
                group, match="", views=(replace(view, station=replace(view.station, lines={})),)
            )
            for group in season()[:2]
            for view in group.views
        ]
        import_groups(store, "demo", bare, source="files", actor="ann")
        assert estimate_pitches(store, "demo").items == ()


class TestChangePitches:
    def test_all_groups_of_the_match_get_the_size_and_are_stale(self, solved):
        accept(solved)
        assert sizes(solved) == {SMALL: TRUE, RIGHT: Pitch()}
        assert list_stale_groups(solved, "demo") == [1, 2, 3, 4, 5, 6]

    def test_the_finding_goes_once_the_size_is_accepted(self, solved):
        accept(solved)
        solve_dataset(solved, "demo")
        assert "pitch_size" not in {
            item["kind"] for item in iterate_findings_as_json(solved, "demo")
        }

    def test_the_size_before_takes_it_back(self, solved):
        accept(solved)
        (small, _) = read_pitches(solved, "demo").items
        assert small.previous == Pitch()
        accept(solved, pitch=small.previous)
        assert sizes(solved)[SMALL] == Pitch()
        assert list_stale_groups(solved, "demo") == []
        assert len(read_pitches(solved, "demo").proposals) == 1

    def test_the_log_tells_it_again(self, solved):
        accept(solved)
        with solved.read() as session:
            assert replay_log(session) == read_state_snapshot(session)
        before = [load_group_state(solved, number).stored for number in (1, 7)]
        rebuild_tables(solved)
        assert [load_group_state(solved, number).stored for number in (1, 7)] == before

    def test_undo_of_a_group_takes_back_its_own_edits_and_not_the_pitch(self, solved):
        state = load_group_state(solved, 1)
        view = state.group.views[0].key
        submit_edit(
            solved, 1, SetLines(view, {"Middle line": None}), if_match=state.etag, actor="ann"
        )
        accept(solved)
        state = undo_group_edit(solved, 1, if_match=load_group_state(solved, 1).etag, actor="ann")
        assert state.group.pitch == TRUE
        assert state.group.views[0].station.lines == season()[0].views[0].station.lines

    def test_an_edit_that_builds_on_the_size_before_is_refused(self, solved):
        state = load_group_state(solved, 1)
        accept(solved)
        edit = SetLines(state.group.views[0].key, {"Middle line": None})
        with pytest.raises(StaleRevisionError):
            submit_edit(solved, 1, edit, if_match=state.etag, actor="ben")

    def test_two_people_do_not_overwrite_each_other(self, solved):
        etag = read_pitches(solved, "demo").etag
        accept(solved, if_match=etag)
        with pytest.raises(StaleRevisionError):
            accept(solved, pitch=Pitch(100.0, 64.0), if_match=etag)

    def test_the_size_in_use_changes_nothing(self, solved):
        revision = load_group_state(solved, 1).revision
        accept(solved, pitch=Pitch())
        assert load_group_state(solved, 1).revision == revision

    def test_an_unknown_match_is_refused(self, solved):
        with pytest.raises(NotFoundError, match="no match nowhere"):
            accept(solved, match="nowhere")

    def test_an_import_keeps_it_and_new_groups_of_the_match_get_it(self, store):
        first, second, third, *_ = season()
        import_groups(store, "demo", (first, second), source="files", actor="ann")
        accept(store)
        import_groups(store, "demo", (first, third), source="files", actor="ann")
        changed = Group(
            second.key, second.views, match=SMALL, label="the source says more of it now"
        )
        import_groups(store, "demo", (changed,), source="files", actor="ann")
        assert [load_group_state(store, number).group.pitch for number in (1, 2, 3)] == [TRUE] * 3
        assert load_group_state(store, 2).group.label == changed.label
        with store.read() as session:
            assert replay_log(session) == read_state_snapshot(session)

    def test_an_import_keeps_it_for_groups_that_came_later(self, store):
        first, second, third, *_ = season()
        import_groups(store, "demo", (first, second), source="files", actor="ann")
        accept(store)
        import_groups(store, "demo", (third,), source="files", actor="ann")
        changed = Group(third.key, third.views, match=SMALL, label="the source says more now")
        import_groups(store, "demo", (changed,), source="files", actor="ann")
        assert load_group_state(store, 3).group == replace(changed, pitch=TRUE)
        assert [entry.kind for entry in read_history(store, 3)] == ["import", "pitch", "import"]
        assert_replays(store)

    def test_a_group_that_comes_later_gets_the_newest_size(self, store):
        first, second, third, *_ = season()
        import_groups(store, "demo", (first, second), source="files", actor="ann")
        with store.write() as session:
            set_pitch_of_groups(session, 1, [2], TRUE, "ann")
            set_pitch_of_groups(session, 1, [1], Pitch(101.0, 65.0), "ann")
        import_groups(store, "demo", (third,), source="files", actor="ann")
        assert load_group_state(store, 3).group.pitch == Pitch(101.0, 65.0)


class TestReadPitches:
    def test_of_groups_of_several_sizes_each_is_held_against_the_lines(self, solved):
        with solved.write() as session:
            set_pitch_of_groups(session, 1, [4, 5], TRUE, "ann")
            set_pitch_of_groups(session, 1, [7, 8], TRUE, "ann")
            update_pitch_findings(session, 1)
        small, right = read_pitches(solved, "demo").items
        assert (small.mixed, right.mixed) == (True, True)
        assert small.proposed.length == pytest.approx(103.0, abs=0.3)
        assert right.proposed.length == pytest.approx(105.0, abs=0.3)
        assert (small.previous, right.previous) == (Pitch(), Pitch())
        assert "solved with several sizes" in right.proposal_reason

    def test_a_minority_of_another_size_is_told(self, solved):
        accept(solved)
        with solved.write() as session:
            set_pitch_of_groups(session, 1, [2], Pitch(), "ann")
        small, _ = read_pitches(solved, "demo").items
        assert (small.pitch, small.mixed) == (TRUE, True)
        assert small.proposed.length == pytest.approx(103.0, abs=0.3)
        assert small.previous == TRUE

    def test_there_is_no_size_before_where_groups_had_several(self, solved):
        with solved.write() as session:
            set_pitch_of_groups(session, 1, [4, 5], Pitch(100.0, 64.0), "ann")
        assert read_pitches(solved, "demo").items[0].previous == Pitch()
        # All groups change, and have two sizes to go back to; then only those that differ do.
        for wanted in (TRUE, Pitch(100.0, 64.0)):
            accept(solved, pitch=wanted)
            small, right = read_pitches(solved, "demo").items
            assert (small.pitch, small.mixed) == (wanted, False)
            assert small.previous == (None if wanted == TRUE else TRUE)
            assert right.previous is None
            if wanted == TRUE:
                with pytest.raises(InputError, match="no earlier pitch size"):
                    pitch_size_by_match(read_pitches(solved, "demo"), SMALL, size="previous")

    def test_groups_that_changed_alike_one_after_the_other_had_one_size_before(self, solved):
        for ids in ([1], [2, 3, 4, 5]):
            with solved.write() as session:
                set_pitch_of_groups(session, 1, ids, TRUE, "ann")
            assert read_pitches(solved, "demo").items[0].previous == Pitch()

    def test_sizes_that_both_agree_with_the_lines_become_one(self, solved):
        accept(solved)
        near = Pitch(TRUE.length + 0.1, TRUE.width)
        with solved.write() as session:
            set_pitch_of_groups(session, 1, [2], near, "ann")
        small, _ = read_pitches(solved, "demo").items
        assert small.proposed == TRUE

    def test_an_estimate_of_other_lines_is_not_shown(self, solved):
        state = load_group_state(solved, 1)
        view = state.group.views[0].key
        submit_edit(
            solved, 1, SetLines(view, {"Middle line": None}), if_match=state.etag, actor="ann"
        )
        small, right = read_pitches(solved, "demo").items
        assert (small.estimate, small.problem, small.proposed) == (None, None, None)
        assert right.estimate is not None
        assert list_matches_to_estimate(solved, "demo") == [SMALL]

    def test_many_matches_cost_no_more_questions_than_one(self, solved):
        accept(solved)
        assert len(questions(solved)) == (one := len(questions(solved)))
        more = [
            replace(group, key=f"{group.key}+", match=f"{number}")
            for number, group in enumerate(season())
        ]
        import_groups(solved, "demo", more, source="files", actor="ann")
        assert len(questions(solved)) == one


def questions(store):
    """Statements that reading the pitches of the dataset costs."""
    asked = []
    note = lambda *said: asked.append(said[2])  # noqa: E731
    event.listen(Engine, "before_cursor_execute", note)
    try:
        read_pitches(store, "demo")
    finally:
        event.remove(Engine, "before_cursor_execute", note)
    return asked


def assert_replays(store):
    with store.read() as session:
        assert replay_log(session) == read_state_snapshot(session)


class TestParsePitch:
    def test_is_length_by_width(self):
        assert parse_pitch("103x66.5") == Pitch(103.0, 66.5)

    def test_an_error_says_how_a_size_is_written(self):
        with pytest.raises(InputError, match="write it as 105x68"):
            parse_pitch("big")
