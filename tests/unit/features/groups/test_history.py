"""What an entry of the log has changed of a group, before and after."""

from __future__ import annotations

import pytest

from app.db.store import Store
from app.errors import NotFoundError
from app.features.groups.edit import SetLines, SetStationLines, make_set_ball_edit
from app.features.groups.history import EntryChanges, read_entry_changes, read_history
from app.features.groups.submit import load_group_state, submit_edit
from app.features.groups.undo import undo_group_edit
from app.features.stations.service import load_station, submit_station_edit
from app.soccer.annotation import BallAnnotation
from app.soccer.frames import Box, ImagePoint

HERE = (ImagePoint(1.5, 2.5), ImagePoint(3.0, 4.0))
BALL = BallAnnotation(box=Box(500.0, 300.0, 14.0, 14.0))


def steps(store: Store, group: int) -> list[EntryChanges]:
    return [read_entry_changes(store, group, entry.id) for entry in read_history(store, group)]


class TestReadStep:
    def test_each_edit_tells_its_view_before_and_after_whatever_came_later(
        self, store: Store, state
    ) -> None:
        edited = submit_edit(
            store, state.id, make_set_ball_edit("7.png", BALL), if_match=state.etag, actor="ann"
        )
        edited = submit_edit(
            store,
            state.id,
            SetLines("7_1.png", {"Middle line": HERE}),
            if_match=edited.etag,
            actor="bob",
        )
        undo_group_edit(store, state.id, if_match=edited.etag, actor="bob")
        brought, ball, lines, back = steps(store, state.id)
        assert (brought.first, [view.key for view in brought.views]) == (True, ["7.png", "7_1.png"])
        assert brought.views[0].before is None
        (view,) = ball.views
        assert (view.key, ball.entry.actor) == ("7.png", "ann")
        assert view.before == state.group.view("7.png")
        assert view.after.balls == (BALL,)
        (drawn,), (gone,) = lines.views, back.views
        assert drawn.after.station.lines["Middle line"] == HERE
        assert (gone.before, gone.after) == (drawn.after, drawn.before)

    def test_a_static_camera_that_was_changed_stands_in_the_past_of_its_groups(
        self, store: Store, fill, make_static
    ) -> None:
        first, second = fill(make_static(10), make_static(11))
        camera = load_station(store, load_group_state(store, first).station_ids["cam1"])
        edit = SetStationLines({"Middle line": HERE})
        submit_station_edit(store, camera.id, edit, if_match=camera.etag, actor="ann")
        for group in (first, second):
            brought, changed = steps(store, group)
            assert changed.entry.kind == "station_edit"
            assert [view.key for view in changed.views] == ["cam1"]
            assert brought.views[0].after.station == camera.station
            assert changed.views[0].after.station.lines["Middle line"] == HERE

    def test_what_was_changed_of_it_before_a_group_came_is_not_in_its_past(
        self, store: Store, fill, make_static
    ) -> None:
        (first,) = fill(make_static(10))
        camera = load_station(store, load_group_state(store, first).station_ids["cam1"])
        edit = SetStationLines({"Middle line": HERE})
        submit_station_edit(store, camera.id, edit, if_match=camera.etag, actor="ann")
        second = fill(make_static(10), make_static(11))[1]
        kinds = [[entry.kind for entry in read_history(store, group)] for group in (first, second)]
        assert kinds == [["import", "station_edit"], ["import"]]

    def test_an_entry_of_another_group_is_unknown(self, store: Store, fill, make_group) -> None:
        one, other = fill(make_group(7), make_group(8))
        (entry,) = read_history(store, other)
        for group in (one, 99):
            with pytest.raises(NotFoundError):
                read_entry_changes(store, group, entry.id)
