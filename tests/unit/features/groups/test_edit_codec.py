"""Lines of more points than anybody draws are refused before they are solved."""

from __future__ import annotations

import pytest

from app.errors import TooManyPointsError
from app.features.groups.edit import SetLines, SetStationLines, make_set_ball_edit
from app.features.groups.edit_codec import (
    MARKING_POINTS,
    REQUEST_POINTS,
    VIEW_POINTS,
    require_point_limits,
    require_point_limits_of_edits,
)
from app.features.groups.submit import load_group_state, solve_edited_group, submit_edit
from app.features.stations.service import load_station, submit_station_edit
from app.soccer.annotation import make_lines
from app.soccer.frames import ImagePoint

NO_LINES = make_lines({})
NAMES = ("Middle line", "Side line top", "Side line bottom", "Circle central", "Side line left")


def points(count: int) -> tuple[ImagePoint, ...]:
    return tuple(ImagePoint(float(place), 1.0) for place in range(count))


class TestRequireFewPoints:
    def test_names_view_marking_count_and_limit(self) -> None:
        require_point_limits("view 7.png", NO_LINES, {"Middle line": points(MARKING_POINTS)})
        with pytest.raises(TooManyPointsError) as caught:
            require_point_limits("view 7.png", NO_LINES, {"Middle line": points(101)})
        assert caught.value.message == "view 7.png: Middle line has 101 points; the limit is 100"

    def test_counts_the_markings_that_stay_and_not_those_that_go(self) -> None:
        full = make_lines({name: points(VIEW_POINTS // 5) for name in NAMES})
        with pytest.raises(TooManyPointsError, match="Side line right its lines have 501 points"):
            require_point_limits("view 7.png", full, {"Side line right": points(1)})
        require_point_limits("view 7.png", full, {"Side line right": points(1), NAMES[0]: None})

    def test_lines_of_a_dataset_that_are_denser_can_be_moved_and_thinned_out(self) -> None:
        dense = make_lines({"Middle line": points(600)})
        require_point_limits("view 7.png", dense, {"Middle line": points(600)})
        require_point_limits("view 7.png", dense, {"Middle line": points(300)})
        with pytest.raises(TooManyPointsError):
            require_point_limits("view 7.png", dense, {"Middle line": points(601)})


class TestRequireFewPointsInAll:
    def test_all_lines_of_a_request_count_together(self, make_group) -> None:
        each = {name: points(80) for name in NAMES}
        edits = [SetLines(f"{number}.png", each) for number in range(20, 25)]
        require_point_limits_of_edits(make_group(7), edits)
        more = SetLines("c.png", {"Middle line": points(1)})
        with pytest.raises(
            TooManyPointsError, match=f"the request has {REQUEST_POINTS + 1} points"
        ):
            require_point_limits_of_edits(make_group(7), [*edits, more])


class TestEveryDoor:
    """Edits, previews and static cameras are held to the same limits."""

    LINES = {"Middle line": points(MARKING_POINTS + 1)}  # noqa: RUF012

    def test_an_edit_of_too_many_points_is_refused_and_changes_nothing(
        self, store, fill, make_group
    ) -> None:
        state = load_group_state(store, fill(make_group(7))[0])
        with pytest.raises(TooManyPointsError, match=r"view 7\.png"):
            edit = SetLines("7.png", self.LINES)
            submit_edit(store, state.id, edit, if_match=state.etag, actor="ann")
        assert load_group_state(store, state.id) == state

    def test_a_preview_of_too_many_points_is_refused(self, store, fill, make_group) -> None:
        (group,) = fill(make_group(7))
        with pytest.raises(TooManyPointsError, match=r"view 7\.png"):
            edits = [make_set_ball_edit("7.png", None), SetLines("7.png", self.LINES)]
            solve_edited_group(store, group, lambda _: edits)

    def test_an_edit_of_a_static_camera_with_too_many_points_is_refused(
        self, store, fill, make_static
    ) -> None:
        state = load_group_state(store, fill(make_static(10))[0])
        station = load_station(store, state.station_ids["cam1"])
        with pytest.raises(TooManyPointsError, match="camera cam1"):
            edit = SetStationLines(self.LINES)
            submit_station_edit(store, station.id, edit, if_match=station.etag, actor="ann")
